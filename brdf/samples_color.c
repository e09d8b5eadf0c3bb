#include "brdf/samples_color.h"

#include "core/file.h"
#include "core/memory.h"
#include "core/spectrum.h"
#include "core/table.h"

#include <stdlib.h>
#include <string.h>

enum { MOST = 256 };

bool tsuya_channel_nm(double *nm, const char *name)
{
    return strncmp(name, "nm", 2) == 0 && tsuya_parse_number(nm, name + 2) && *nm >= 100.0 && *nm <= 5000.0;
}

bool tsuya_samples_are_spectral(const tsuya_samples *s)
{
    double nm;
    for (int c = 0; c < s->channel_count; ++c) {
        if (!tsuya_channel_nm(&nm, s->channel[c])) {
            return false;
        }
    }
    return s->channel_count > 0;
}

void tsuya_color_of_spectrum(double color[3], const double *nm, const double *value, int count, tsuya_color_space space)
{
    tsuya_vec3 v = space == TSUYA_COLOR_XYZ ? tsuya_xyz_of_reflectance(nm, value, count) : tsuya_rgb_of_reflectance(nm, value, count);
    color[0] = v.x;
    color[1] = v.y;
    color[2] = v.z;
}

/* Wavelengths ascending, and where each stands in the table. */
static tsuya_status order_channels(double *nm, int *column, const tsuya_samples *s)
{
    if (!tsuya_samples_are_spectral(s) || s->channel_count > MOST) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "channel %s: colours are made of wavelengths, nm390,nm400,…", s->channel[0]);
    }
    for (int c = 0; c < s->channel_count; ++c) {
        double here = 0.0;
        int k = c;
        (void)tsuya_channel_nm(&here, s->channel[c]);
        for (; k > 0 && nm[k - 1] > here; --k) {
            nm[k] = nm[k - 1];
            column[k] = column[k - 1];
        }
        nm[k] = here;
        column[k] = c;
    }
    if (nm[0] > 430.0 || nm[s->channel_count - 1] < 670.0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "wavelengths from %g to %g nm: a colour needs at least 430 to 670", nm[0], nm[s->channel_count - 1]);
    }
    for (int c = 1; c < s->channel_count; ++c) {
        if (nm[c] - nm[c - 1] > 40.0) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "wavelengths %g and %g nm: a colour needs steps of at most 40 nm", nm[c - 1], nm[c]);
        }
    }
    return TSUYA_OK;
}

tsuya_status tsuya_samples_to_color(tsuya_samples *color, const tsuya_samples *s, tsuya_color_space space)
{
    static const char *const names[2][3] = {{"r", "g", "b"}, {"x", "y", "z"}};
    double nm[MOST], spectrum[MOST];
    int column[MOST], outside = 0;
    size_t n = (size_t)s->channel_count;
    TSUYA_TRY(order_channels(nm, column, s));
    TSUYA_TRY(tsuya_samples_copy_frame(color, s, 3, names[space]));
    for (int k = 0; k < s->count; ++k) {
        double *to = color->value + 3 * (size_t)k;
        for (size_t c = 0; c < n; ++c) {
            spectrum[c] = s->value[(size_t)k * n + (size_t)column[c]];
        }
        tsuya_color_of_spectrum(to, nm, spectrum, s->channel_count, space);
        outside += fmin(to[0], fmin(to[1], to[2])) < 0.0;
        for (int c = 0; c < 3; ++c) {
            to[c] = to[c] < 0.0 ? 0.0 : to[c]; /* NaN stays */
        }
    }
    if (outside) {
        tsuya_warn("%d of %d colours lie outside the gamut of Rec.709 and are held at its border", outside, s->count);
    }
    return TSUYA_OK;
}

static tsuya_status power_of_table(double *power, const double *nm, int count, const char *path)
{
    static const char *const columns[] = {"nm", "power", NULL};
    const tsuya_table_options options = {.required = columns, .known = columns};
    tsuya_table t;
    tsuya_status status = TSUYA_OK;
    TSUYA_TRY(tsuya_table_load(&t, path, &options));
    int at_nm = tsuya_table_column(&t, "nm"), at_power = tsuya_table_column(&t, "power");
    for (size_t row = 0; row < t.row_count && status == TSUYA_OK; ++row) {
        if (!(tsuya_table_at(&t, row, at_power) > 0.0) || (row > 0 && !(tsuya_table_at(&t, row, at_nm) > tsuya_table_at(&t, row - 1, at_nm)))) {
            status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: expected ascending wavelengths and powers above zero", path, t.line[row]);
        }
    }
    for (int k = 0; k < count && status == TSUYA_OK; ++k) {
        size_t row = 0;
        while (row + 2 < t.row_count && tsuya_table_at(&t, row + 1, at_nm) < nm[k]) {
            row++;
        }
        if (t.row_count < 2 || nm[k] < tsuya_table_at(&t, 0, at_nm) || nm[k] > tsuya_table_at(&t, t.row_count - 1, at_nm)) {
            status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: no power at %g nm; expected rows that span the samples' wavelengths", path, nm[k]);
            break;
        }
        double a = tsuya_table_at(&t, row, at_nm), b = tsuya_table_at(&t, row + 1, at_nm), u = (nm[k] - a) / (b - a);
        power[k] = (1.0 - u) * tsuya_table_at(&t, row, at_power) + u * tsuya_table_at(&t, row + 1, at_power);
    }
    tsuya_table_free(&t);
    return status;
}

static tsuya_status power_of_file(double *power, const double *nm, int count, const char *name, const char *table_path)
{
    char *folder = tsuya_path_folder(table_path), *path = folder ? tsuya_path_join(folder, name) : NULL;
    tsuya_status status = path ? power_of_table(power, nm, count, path) : TSUYA_ERROR_MEMORY;
    tsuya_free(folder);
    tsuya_free(path);
    return status;
}

tsuya_status tsuya_illuminant_power(double *power, const double *nm, int count, const char *name, const char *table_path)
{
    size_t length = strlen(name);
    double kelvin = 0.0;
    char *end = NULL;
    if (length > 4 && strcmp(name + length - 4, ".csv") == 0) {
        return power_of_file(power, nm, count, name, table_path);
    }
    bool daylight = strcmp(name, "D65") == 0 || strcmp(name, "D50") == 0, equal = strcmp(name, "E") == 0;
    if (daylight) {
        kelvin = name[1] == '6' ? 6504.0 : 5003.0;
    } else if (strcmp(name, "A") == 0) {
        kelvin = TSUYA_ILLUMINANT_A_K;
    } else if (!equal) {
        kelvin = strtod(name, &end);
        if (end == name || strcmp(end, "K") != 0 || !(kelvin >= 1000.0 && kelvin <= 20000.0)) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: # illuminant=%.40s: expected A, D50, D65, E, a black body (3200K) or FILE.csv with nm,power", table_path,
                              name);
        }
    }
    for (int k = 0; k < count; ++k) {
        power[k] = equal ? 1.0 : daylight ? tsuya_daylight_power(nm[k], kelvin) : tsuya_blackbody_power(nm[k], kelvin);
    }
    return TSUYA_OK;
}
