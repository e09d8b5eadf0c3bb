#include "render/bands.h"

#include "brdf/samples_color.h"

#include "core/color.h"
#include "core/spectrum.h"

#include <math.h>
#include <string.h>

enum { TABLE_NM = 10, TABLE = (TSUYA_SPECTRUM_COUNT - 1) / TABLE_NM + 1 };

/* Red, green, blue, 380 … 780 nm every 10: the quadratic programme of the header, by an active set. */
static const double primaries[TABLE][3] = {
    {0.03987, 0.00000, 0.96013}, {0.04003, 0.00000, 0.95997}, {0.04065, 0.00000, 0.95935},
    {0.04136, 0.00000, 0.95864}, {0.03985, 0.00000, 0.96015}, {0.03486, 0.00000, 0.96514},
    {0.02781, 0.00000, 0.97219}, {0.01824, 0.00000, 0.98176}, {0.01959, 0.00000, 0.98041},
    {0.00000, 0.11385, 0.88615}, {0.00000, 0.29359, 0.70641}, {0.00000, 0.50568, 0.49432},
    {0.00000, 0.71232, 0.28768}, {0.00000, 0.88241, 0.11759}, {0.00000, 0.98688, 0.01312},
    {0.00000, 1.00000, 0.00000}, {0.00000, 1.00000, 0.00000}, {0.00000, 1.00000, 0.00000},
    {0.00000, 1.00000, 0.00000}, {0.00000, 0.94656, 0.05344}, {0.18896, 0.75293, 0.05811},
    {0.48012, 0.48885, 0.03103}, {0.76198, 0.23460, 0.00342}, {0.94641, 0.05359, 0.00000},
    {1.00000, 0.00000, 0.00000}, {1.00000, 0.00000, 0.00000}, {1.00000, 0.00000, 0.00000},
    {1.00000, 0.00000, 0.00000}, {1.00000, 0.00000, 0.00000}, {1.00000, 0.00000, 0.00000},
    {1.00000, 0.00000, 0.00000}, {1.00000, 0.00000, 0.00000}, {0.99963, 0.00024, 0.00013},
    {0.99918, 0.00056, 0.00026}, {0.99891, 0.00075, 0.00034}, {0.99877, 0.00085, 0.00038},
    {0.99871, 0.00089, 0.00040}, {0.99869, 0.00091, 0.00040}, {0.99869, 0.00091, 0.00040},
    {0.99868, 0.00091, 0.00041}, {0.99868, 0.00091, 0.00041},
};

static void primary_at(double rgb[3], double nm)
{
    double at = fmin(TABLE - 1, fmax(0.0, (nm - TSUYA_SPECTRUM_FIRST_NM) / TABLE_NM));
    int k = (int)fmin(at, TABLE - 2);
    for (int c = 0; c < 3; ++c) {
        rgb[c] = primaries[k][c] + (at - k) * (primaries[k + 1][c] - primaries[k][c]);
    }
}

/* Adds what power at a wavelength shows, to the two of the bands between which it lies. */
static void add_power(double *weight, const tsuya_bands *b, double nm, double power, int *cell)
{
    while (*cell + 2 < b->count && b->nm[*cell + 1] < nm) {
        ++*cell;
    }
    int k = *cell;
    double t = fmin(1.0, fmax(0.0, (nm - b->nm[k]) / (b->nm[k + 1] - b->nm[k])));
    tsuya_vec3 v = tsuya_rgb_from_xyz(tsuya_vec3_scale(tsuya_display_observer(nm), power));
    const double rgb[3] = {v.x, v.y, v.z};
    for (int c = 0; c < 3; ++c) {
        weight[c * b->count + k] += (1.0 - t) * rgb[c];
        weight[c * b->count + k + 1] += t * rgb[c];
    }
}

void tsuya_bands_respond(double *weight, const tsuya_bands *b, const tsuya_lamp_spectrum *s)
{
    int cell = 0;
    memset(weight, 0, 3 * (size_t)b->count * sizeof *weight);
    for (int k = 0; k < TSUYA_SPECTRUM_COUNT; ++k) {
        add_power(weight, b, TSUYA_SPECTRUM_FIRST_NM + k, s->power[k], &cell);
    }
}

/* Lamps of the primaries' colours under D65. */
static tsuya_status respond_to_primaries(tsuya_bands *b)
{
    double weight[3 * TSUYA_MATERIAL_MAX_CHANNELS], rgb[3];
    tsuya_lamp_spectrum white, lamp;
    TSUYA_TRY(tsuya_lamp_spectrum_load(&white, "D65", "."));
    for (int p = 0; p < 3; ++p) {
        for (int k = 0; k < TSUYA_SPECTRUM_COUNT; ++k) {
            primary_at(rgb, TSUYA_SPECTRUM_FIRST_NM + k);
            lamp.power[k] = white.power[k] * rgb[p];
        }
        tsuya_bands_respond(weight, b, &lamp);
        for (int c = 0; c < 3; ++c) {
            memcpy(b->response[p][c], weight + c * b->count, (size_t)b->count * sizeof *weight);
        }
    }
    return TSUYA_OK;
}

tsuya_status tsuya_bands_of_channels(tsuya_bands *b, const char *const *channel, int channel_count, const char *name)
{
    if (channel_count > TSUYA_MATERIAL_MAX_CHANNELS) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d channels; rendering takes at most %d", name, channel_count, TSUYA_MATERIAL_MAX_CHANNELS);
    }
    b->count = channel_count;
    for (int c = 0; c < b->count; ++c) {
        if (!tsuya_channel_nm(&b->nm[c], channel[c]) || (c > 0 && !(b->nm[c] > b->nm[c - 1]))) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: channel \"%s\"; rendering needs r, g, b or ascending wavelengths (nm390, nm400, …)", name,
                              channel[c]);
        }
        if (c > 0 && b->nm[c] - b->nm[c - 1] > 40.0 && b->nm[c] > 430.0 && b->nm[c - 1] < 670.0) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: nothing between %g and %g nm; rendering needs wavelengths at most 40 nm apart", name,
                              b->nm[c - 1], b->nm[c]);
        }
        primary_at(b->primary[c], b->nm[c]);
    }
    if (b->count < 2 || b->nm[0] > 430.0 || b->nm[b->count - 1] < 670.0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: wavelengths from %g to %g nm; rendering needs r, g, b or wavelengths from 430 to 670 nm", name,
                          b->nm[0], b->nm[b->count - 1]);
    }
    return respond_to_primaries(b);
}

tsuya_status tsuya_bands_check(bool *spectral, const char *const *channel, int channel_count, const char *name)
{
    static const char *const rgb[3] = {"r", "g", "b"};
    tsuya_bands bands;
    *spectral = channel_count != 3;
    for (int c = 0; !*spectral && c < 3; ++c) {
        *spectral = strcmp(channel[c], rgb[c]) != 0;
    }
    return *spectral ? tsuya_bands_of_channels(&bands, channel, channel_count, name) : TSUYA_OK;
}

tsuya_status tsuya_bands_of_material(tsuya_bands *b, const tsuya_material *material)
{
    tsuya_material_info info = tsuya_material_get_info(material);
    return tsuya_bands_of_channels(b, info.channel, info.channel_count, info.name);
}

bool tsuya_bands_match(const tsuya_bands *b, const tsuya_material *material)
{
    tsuya_material_info info = tsuya_material_get_info(material);
    bool same = info.channel_count == b->count;
    for (int c = 0; same && c < b->count; ++c) {
        double nm;
        same = tsuya_channel_nm(&nm, info.channel[c]) && nm == b->nm[c];
    }
    return same;
}

void tsuya_bands_spread(double *reflectance, const tsuya_bands *b, const double rgb[3])
{
    for (int c = 0; c < b->count; ++c) {
        reflectance[c] = rgb[0] * b->primary[c][0] + rgb[1] * b->primary[c][1] + rgb[2] * b->primary[c][2];
    }
}
