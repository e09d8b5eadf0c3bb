#include "brdf/export_loss.h"
#include "brdf/model.h"
#include "brdf/samples_color.h"

#include "core/file.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

/* The square of half vectors: x = √(2θh/π), y = (φh + π)/2π; nodes at its edges. */
enum { TURNS = 33, TILTS = 23, SIDE = 40, FINE_X = 160, FINE_Y = 181, FIELDS = 11, U8 = 1, U32 = 5, F32 = 10 };

typedef struct tables {
    const tsuya_material *material;
    int channels;
    bool spectral, flat; /* flat: one channel without a wavelength, written as a spectrum that is the same everywhere */
    float phi[TURNS], theta[TILTS], nm[TSUYA_MATERIAL_MAX_CHANNELS];
    float *ndf, *value, *luminance; /* FINE_Y × FINE_X; [turn][tilt][channel][y][x]; [turn][tilt][y][x] */
    double floor;
} tables;

static tsuya_vec3 polar(double theta, double phi) { return (tsuya_vec3){sin(theta) * cos(phi), sin(theta) * sin(phi), cos(theta)}; }
static tsuya_vec3 half_at(double x, double y) { return polar(0.5 * M_PI * x * x, 2.0 * M_PI * y - M_PI); }

static double mean_value(const tsuya_material *m, tsuya_vec3 wi, tsuya_vec3 wo)
{
    double value[TSUYA_MATERIAL_MAX_CHANNELS], sum = 0.0;
    tsuya_material_eval(m, NULL, wi, wo, value);
    for (int c = 0; c < m->channel_count; ++c) {
        sum += value[c] / m->channel_count;
    }
    return sum;
}

/* Retroreflection, down to 85° from the normal and never nearly zero, since the values are divided by it. */
static void fill_ndf(tables *t)
{
    double largest = 0.0;
    for (int k = 0; k < FINE_X * FINE_Y; ++k) {
        tsuya_vec3 h = half_at((double)(k % FINE_X) / (FINE_X - 1), (double)(k / FINE_X) / (FINE_Y - 1));
        h.z = fmax(h.z, 0.087);
        h = tsuya_vec3_unit(h);
        double d = mean_value(t->material, h, h);
        t->ndf[k] = (float)d;
        largest = fmax(largest, d);
    }
    t->floor = largest > 0.0 ? 0.01 * largest : 1.0;
    for (int k = 0; k < FINE_X * FINE_Y; ++k) {
        t->ndf[k] = fmaxf(t->ndf[k], (float)t->floor);
    }
}

static double bilinear(const float *table, int w, int h, double x, double y)
{
    double px = fmin(fmax(x, 0.0), 1.0) * (w - 1), py = fmin(fmax(y, 0.0), 1.0) * (h - 1);
    int i = (int)fmin(px, w - 2), j = (int)fmin(py, h - 2);
    const float *a = table + j * w + i, *b = a + w;
    px -= i;
    py -= j;
    return (1 - py) * ((1 - px) * (double)a[0] + px * (double)a[1]) + py * ((1 - px) * (double)b[0] + px * (double)b[1]);
}

static size_t slice_of(int turn, int tilt) { return (size_t)turn * TILTS + (size_t)tilt; }

static void fill_slice(tables *t, int turn, int tilt)
{
    double value[TSUYA_MATERIAL_MAX_CHANNELS];
    tsuya_vec3 wi = polar((double)t->theta[tilt], (double)t->phi[turn]);
    for (int k = 0; k < SIDE * SIDE; ++k) {
        double x = (double)(k % SIDE) / (SIDE - 1), y = (double)(k / SIDE) / (SIDE - 1), sum = 0.0;
        tsuya_vec3 h = half_at(x, y), wo = tsuya_vec3_mad(tsuya_vec3_scale(wi, -1.0), 2.0 * tsuya_vec3_dot(wi, h), h);
        tsuya_material_eval(t->material, NULL, wi, tsuya_vec3_unit(wo), value);
        double ndf = bilinear(t->ndf, FINE_X, FINE_Y, x, y);
        for (int c = 0; c < t->channels; ++c) {
            double v = wo.z > 0.0 ? value[t->flat ? 0 : c] * wo.z / ndf : 0.0;
            t->value[((slice_of(turn, tilt) * (size_t)t->channels + (size_t)c) * SIDE * SIDE) + (size_t)k] = (float)v;
            sum += v * ndf / t->channels;
        }
        /* what sampling follows: f cosθo over the square, whose area element is 2π² x sinθh, times 4 wi·h of the reflection */
        t->luminance[slice_of(turn, tilt) * SIDE * SIDE + (size_t)k] =
            (float)(sum * 8.0 * M_PI * M_PI * x * sin(0.5 * M_PI * x * x) * fmax(tsuya_vec3_dot(wi, h), 0.0) + 1e-6 * t->floor);
    }
}

/* What a reader of the format makes of these tables: linear in incidence, bilinear on the square. */
static void read_back(double *value, const void *user, tsuya_vec3 wi, tsuya_vec3 wo)
{
    const tables *t = user;
    tsuya_vec3 h = tsuya_vec3_unit(tsuya_vec3_add(wi, wo));
    double x = sqrt(acos(fmin(h.z, 1.0)) * 2.0 / M_PI), y = (atan2(h.y, h.x) + M_PI) / (2.0 * M_PI);
    double a = (atan2(wi.y, wi.x) + M_PI) / (2.0 * M_PI) * (TURNS - 1), theta = acos(fmin(wi.z, 1.0));
    int turn = (int)fmin(a, TURNS - 2), tilt = 0;
    while (tilt < TILTS - 2 && theta > (double)t->theta[tilt + 1]) {
        tilt++;
    }
    double b = fmin(fmax((theta - (double)t->theta[tilt]) / (double)(t->theta[tilt + 1] - t->theta[tilt]), 0.0), 1.0);
    double ndf = bilinear(t->ndf, FINE_X, FINE_Y, x, y);
    a -= turn;
    for (int c = 0; c < t->material->channel_count; ++c) {
        double sum = 0.0;
        for (int k = 0; k < 4; ++k) {
            size_t slice = slice_of(turn + (k & 1), tilt + (k >> 1)) * (size_t)t->channels + (size_t)c;
            sum += (k & 1 ? a : 1.0 - a) * (k >> 1 ? b : 1.0 - b) * bilinear(t->value + slice * SIDE * SIDE, SIDE, SIDE, x, y);
        }
        value[c] = sum * ndf / wo.z;
    }
}

typedef struct field {
    const char *name;
    int type, dimensions;
    uint64_t shape[5];
    const void *data;
} field;

static size_t bytes_of(const field *f)
{
    size_t n = f->type == U8 ? 1 : 4;
    for (int d = 0; d < f->dimensions; ++d) {
        n *= f->shape[d];
    }
    return n;
}

static double write_fields(FILE *stream, const field *f, uint32_t count)
{
    const uint8_t version[2] = {1, 0};
    uint64_t offset = 18;
    for (uint32_t k = 0; k < count; ++k) {
        offset += 2 + strlen(f[k].name) + 11 + 8 * (uint64_t)f[k].dimensions;
    }
    fwrite("tensor_file", 12, 1, stream);
    fwrite(version, 2, 1, stream);
    fwrite(&count, 4, 1, stream);
    for (uint32_t k = 0; k < count; ++k) {
        uint16_t length = (uint16_t)strlen(f[k].name), dimensions = (uint16_t)f[k].dimensions;
        fwrite(&length, 2, 1, stream);
        fwrite(f[k].name, length, 1, stream);
        fwrite(&dimensions, 2, 1, stream);
        fputc(f[k].type, stream);
        offset = (offset + 7) & ~(uint64_t)7;
        fwrite(&offset, 8, 1, stream);
        fwrite(f[k].shape, 8, dimensions, stream);
        offset += bytes_of(&f[k]);
    }
    for (uint32_t k = 0; k < count; ++k) {
        while (ftell(stream) % 8) {
            fputc(0, stream);
        }
        fwrite(f[k].data, 1, bytes_of(&f[k]), stream);
    }
    return (double)offset;
}

static tsuya_status save(tsuya_export_loss *loss, const char *path, const tables *t)
{
    static const uint32_t version[2] = {1, 0};
    static const uint8_t jacobian[1] = {1}, description[] = "tsuya: fitted reflectance, x weft, y warp";
    static const float sigma[4] = {0.25f, 0.25f, 0.25f, 0.25f};
    float *ones = tsuya_calloc((size_t)TURNS * TILTS * 4, sizeof *ones);
    uint64_t n = (uint64_t)t->channels;
    if (!ones) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int k = 0; k < TURNS * TILTS * 4; ++k) {
        ones[k] = 1.0f;
    }
    const field fields[FIELDS] = {
        {"version", U32, 1, {2}, version}, {"description", U8, 1, {sizeof description - 1}, description}, {"phi_i", F32, 1, {TURNS}, t->phi},
        {"theta_i", F32, 1, {TILTS}, t->theta}, {"sigma", F32, 2, {2, 2}, sigma}, {"ndf", F32, 2, {FINE_Y, FINE_X}, t->ndf},
        {"vndf", F32, 4, {TURNS, TILTS, 2, 2}, ones}, {"luminance", F32, 4, {TURNS, TILTS, SIDE, SIDE}, t->luminance},
        {t->spectral ? "spectra" : "rgb", F32, 5, {TURNS, TILTS, n, SIDE, SIDE}, t->value}, {"jacobian", U8, 1, {1}, jacobian},
        {"wavelengths", F32, 1, {n}, t->nm},
    };
    tsuya_file_writer w;
    tsuya_status status = tsuya_file_begin(&w, path);
    if (status == TSUYA_OK) {
        loss->bytes = write_fields(w.stream, fields, t->spectral ? FIELDS : FIELDS - 1);
        status = tsuya_file_commit(&w);
    }
    tsuya_free(ones);
    return status;
}

static tsuya_status check_channels(tables *t, const char *path)
{
    const tsuya_material *m = t->material;
    t->spectral = true;
    for (int c = 0; c < t->channels; ++c) {
        double nm = 0.0;
        t->spectral &= tsuya_channel_nm(&nm, m->channel[c]);
        t->nm[c] = (float)nm;
    }
    if (!t->spectral && t->channels == 1) {
        t->spectral = t->flat = true;
        t->channels = 2;
        t->nm[0] = 360.0f;
        t->nm[1] = 830.0f;
    }
    if (!t->spectral && (t->channels != 3 || strcmp(m->channel[0], "r") != 0)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: RGL files hold r, g, b, wavelengths or one channel; the material's first of several is %s", path, m->channel[0]);
    }
    return TSUYA_OK;
}

tsuya_status tsuya_export_rgl(tsuya_export_loss *loss, const char *path, const tsuya_material *material)
{
    tables *t = tsuya_calloc(1, sizeof *t);
    if (!t) {
        return TSUYA_ERROR_MEMORY;
    }
    *t = (tables){.material = material, .channels = material->channel_count};
    size_t slices = (size_t)TURNS * TILTS;
    tsuya_status status;
    TSUYA_GOTO_DONE(status, check_channels(t, path));
    TSUYA_NEW(status, t->ndf, (size_t)FINE_X * FINE_Y);
    TSUYA_NEW(status, t->value, slices * (size_t)t->channels * SIDE * SIDE);
    TSUYA_NEW(status, t->luminance, slices * SIDE * SIDE);
    for (int k = 0; k < TURNS; ++k) {
        t->phi[k] = (float)(-M_PI + 2.0 * M_PI * k / (TURNS - 1));
    }
    for (int k = 0; k < TILTS; ++k) {
        t->theta[k] = (float)(k * 88.0 / (TILTS - 1) * M_PI / 180.0);
    }
    fill_ndf(t);
#pragma omp parallel for schedule(dynamic, 4)
    for (int k = 0; k < TURNS * TILTS; ++k) {
        fill_slice(t, k / TILTS, k % TILTS);
    }
    TSUYA_GOTO_DONE(status, tsuya_export_measure(loss, material, read_back, t));
    status = save(loss, path, t);
done:
    tsuya_free(t->ndf);
    tsuya_free(t->value);
    tsuya_free(t->luminance);
    tsuya_free(t);
    return status;
}
