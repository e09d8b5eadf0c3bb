#include "brdf/dye.h"

#include "core/clones.h"
#include "core/memory.h"

enum { SIDE_FINE = 33, SIDE_COARSE = 17, FINE_CHANNELS = 4, DRAWS = 2048, MEAN_SIDE = 256 };

/* Grid coordinates in [0, 1]² of a direction above the surface: azimuth as the diamond angle y / (|x| + |y|), quadrant by
 * quadrant, so that its kinks lie on grid lines; polar angle as 1 − sqrt(1 − sqrt(1 − z)), which grows as θ at the pole and
 * packs the nodes towards grazing angles, where albedos rise. */
static inline void grid_from_direction(double *u, double *v, tsuya_vec3 w)
{
    double across = fabs(w.x) + fabs(w.y), a = across > 0.0 ? w.y / across : 0.0;
    *u = 0.25 * (1.0 + (w.x >= 0.0 ? a : 2.0 - a));
    *v = 1.0 - sqrt(fmax(0.0, 1.0 - sqrt(fmax(0.0, 1.0 - w.z))));
}

static tsuya_vec3 direction_from_grid(double u, double v)
{
    double a = 4.0 * u - 1.0, y = a <= 1.0 ? a : 2.0 - a, x = (a <= 1.0 ? 1.0 : -1.0) * (1.0 - fabs(y));
    double s = 1.0 - (1.0 - v) * (1.0 - v), z = 1.0 - s * s, k = sqrt(fmax(0.0, 1.0 - z * z) / (x * x + y * y));
    return (tsuya_vec3){k * x, k * y, z};
}

static double van_der_corput(uint32_t i)
{
    i = (i << 16) | (i >> 16);
    i = ((i & 0x00ff00ffu) << 8) | ((i & 0xff00ff00u) >> 8);
    i = ((i & 0x0f0f0f0fu) << 4) | ((i & 0xf0f0f0f0u) >> 4);
    i = ((i & 0x33333333u) << 2) | ((i & 0xccccccccu) >> 2);
    i = ((i & 0x55555555u) << 1) | ((i & 0xaaaaaaaau) >> 1);
    return i * 0x1.0p-32;
}

/* ∫ f cosθ dw by the model's own sampling over a Hammersley set. */
static void integrate(const tsuya_brdf_model *model, const void *state, int channels, const tsuya_albedo_table *limit, tsuya_vec3 wo,
                      double *albedo)
{
    double f[TSUYA_MATERIAL_MAX_CHANNELS], here = 1.0, there = 1.0;
    if (limit) {
        tsuya_albedo_table_eval(limit, wo, &here);
    }
    for (int c = 0; c < channels; ++c) {
        albedo[c] = 0.0;
    }
    for (uint32_t k = 0; k < DRAWS; ++k) {
        const double u[2] = {(k + 0.5) / DRAWS, van_der_corput(k)};
        tsuya_vec3 wi;
        double pdf;
        if (!model->sample(state, wo, u, &wi) || !((pdf = model->pdf(state, wi, wo)) > 0.0)) {
            continue;
        }
        model->eval(state, channels, wi, wo, f);
        if (limit) {
            tsuya_albedo_table_eval(limit, wi, &there);
        }
        for (int c = 0; c < channels; ++c) {
            albedo[c] += here * there * f[c] * wi.z / (pdf * DRAWS);
        }
    }
}

static double fill_node(tsuya_albedo_table *t, const tsuya_brdf_model *model, const void *state, const tsuya_albedo_table *limit,
                        int node)
{
    double albedo[TSUYA_MATERIAL_MAX_CHANNELS], highest = 0.0;
    tsuya_vec3 w = direction_from_grid((double)(node % t->side) / (t->side - 1), (double)(node / t->side) / (t->side - 1));
    w.z = fmax(w.z, 1e-3); /* the limit at the horizon, without dividing by it */
    w = tsuya_vec3_unit(w);
    if (model->albedo) {
        model->albedo(state, t->channels, w, albedo);
    } else {
        integrate(model, state, t->channels, limit, w, albedo);
    }
    for (int c = 0; c < t->channels; ++c) {
        double a = albedo[c];
        highest = a > highest ? a : highest;
        t->value[node * t->channels + c] = (float)(a > 0.0 ? fmin(a, 1.0) : 0.0); /* NaN gives 0 */
    }
    return highest;
}

/* Ā of the table as it is interpolated, so that base integrates to 1 − A exactly. */
static void fill_mean(tsuya_albedo_table *t)
{
    double a[TSUYA_MATERIAL_MAX_CHANNELS];
    for (int k = 0; k < MEAN_SIDE * MEAN_SIDE; ++k) {
        double r = sqrt((k % MEAN_SIDE + 0.5) / MEAN_SIDE), phi = 2.0 * M_PI * (k / MEAN_SIDE + 0.5) / MEAN_SIDE;
        tsuya_albedo_table_eval(t, (tsuya_vec3){r * cos(phi), r * sin(phi), sqrt(1.0 - r * r)}, a);
        for (int c = 0; c < t->channels; ++c) {
            t->mean[c] += a[c] / (MEAN_SIDE * MEAN_SIDE);
        }
    }
    for (int c = 0; c < t->channels; ++c) {
        double rest = 1.0 - t->mean[c];
        t->inverse_rest[c] = rest > 1e-6 ? 1.0 / (M_PI * rest) : 0.0;
    }
}

tsuya_status tsuya_albedo_table_create(tsuya_albedo_table **table, double *highest, const tsuya_brdf_model *model, const void *state,
                                       int channels, const tsuya_albedo_table *limit)
{
    tsuya_status status = TSUYA_OK;
    tsuya_albedo_table *t;
    double top = 0.0;
    *table = NULL;
    TSUYA_NEW(status, t, 1);
    t->channels = channels;
    t->side = channels <= FINE_CHANNELS ? SIDE_FINE : SIDE_COARSE;
    TSUYA_NEW(status, t->value, (size_t)t->side * (size_t)t->side * (size_t)channels);
    TSUYA_NEW(status, t->inverse_rest, (size_t)channels);
    TSUYA_NEW(status, t->mean, (size_t)channels);
#pragma omp parallel for schedule(dynamic, 16) reduction(max : top)
    for (int node = 0; node < t->side * t->side; ++node) {
        top = fmax(top, fill_node(t, model, state, limit, node));
    }
    fill_mean(t);
    if (highest) {
        *highest = top;
    }
    *table = t;
    return TSUYA_OK;
done:
    tsuya_albedo_table_free(t);
    return status;
}

/* The largest factor that a node and its neighbours allow, so that what lies between nodes keeps the bound too. */
static float allowed(const float *albedo, int side, int i, int j)
{
    float largest = 1.0f;
    for (int dj = -1; dj <= 1; ++dj) {
        for (int di = -1; di <= 1; ++di) {
            int u = (i + di + side - 1) % (side - 1), v = j + dj;
            if (v >= 0 && v < side) {
                largest = fmaxf(largest, albedo[v * side + u]);
            }
        }
    }
    return 1.0f / (largest > 1.0f ? 1.01f * largest : 1.0f);
}

tsuya_status tsuya_limit_table_create(tsuya_albedo_table **limit, const tsuya_brdf_model *model, const void *state, int channels)
{
    tsuya_status status = TSUYA_OK;
    tsuya_albedo_table *t;
    float *albedo = NULL;
    *limit = NULL;
    TSUYA_NEW(status, t, 1);
    t->channels = 1;
    t->side = SIDE_FINE;
    TSUYA_NEW(status, t->value, (size_t)t->side * (size_t)t->side);
    TSUYA_NEW(status, t->inverse_rest, 1);
    TSUYA_NEW(status, t->mean, 1);
    TSUYA_NEW(status, albedo, (size_t)t->side * (size_t)t->side);
#pragma omp parallel for schedule(dynamic, 16)
    for (int node = 0; node < t->side * t->side; ++node) {
        double value[TSUYA_MATERIAL_MAX_CHANNELS];
        tsuya_vec3 w = direction_from_grid((double)(node % t->side) / (t->side - 1), (double)(node / t->side) / (t->side - 1));
        w.z = fmax(w.z, 1e-3);
        integrate(model, state, channels, NULL, tsuya_vec3_unit(w), value);
        for (int c = 0; c < channels; ++c) {
            albedo[node] = value[c] > (double)albedo[node] ? (float)fmin(value[c], 1e30) : albedo[node];
        }
    }
    for (int node = 0; node < t->side * t->side; ++node) {
        t->value[node] = allowed(albedo, t->side, node % t->side, node / t->side);
    }
    float *pole = t->value; /* one direction, one factor */
    for (int u = 1; u < t->side; ++u) {
        pole[0] = fminf(pole[0], pole[u]);
    }
    for (int u = 1; u < t->side; ++u) {
        pole[u] = pole[0];
    }
    tsuya_free(albedo);
    *limit = t;
    return TSUYA_OK;
done:
    tsuya_albedo_table_free(t);
    return status;
}

void tsuya_albedo_table_free(tsuya_albedo_table *table)
{
    if (table) {
        tsuya_free(table->value);
        tsuya_free(table->inverse_rest);
        tsuya_free(table->mean);
        tsuya_free(table);
    }
}

size_t tsuya_albedo_table_bytes(const tsuya_albedo_table *table)
{
    size_t c = (size_t)table->channels;
    return sizeof *table + (size_t)table->side * (size_t)table->side * c * sizeof(float) + 2 * c * sizeof(double);
}

void tsuya_albedo_table_eval(const tsuya_albedo_table *table, tsuya_vec3 w, double *value)
{
    double u, v;
    grid_from_direction(&u, &v, w);
    int side = table->side, channels = table->channels;
    u *= side - 1;
    v *= side - 1;
    int i = (int)fmin(u, side - 2), j = (int)fmin(v, side - 2);
    double a = u - i, b = v - j;
    const float *p = table->value + (size_t)(j * side + i) * (size_t)channels, *q = p + (size_t)side * (size_t)channels;
    for (int c = 0; c < channels; ++c) {
        double low = (1.0 - a) * p[c] + a * p[channels + c], high = (1.0 - a) * q[c] + a * q[channels + c];
        value[c] = (1.0 - b) * low + b * high;
    }
}

typedef struct grid_cell { int index; float a, b; } grid_cell;

static inline grid_cell cell_of(int side, float x, float y, float z)
{
    float across = fabsf(x) + fabsf(y), a = y / (across > 1e-30f ? across : 1e-30f);
    float s = sqrtf(z < 1.0f ? 1.0f - z : 0.0f), last = (float)(side - 2);
    float u = 0.25f * (1.0f + (x >= 0.0f ? a : 2.0f - a)) * (float)(side - 1);
    float v = (1.0f - sqrtf(s < 1.0f ? 1.0f - s : 0.0f)) * (float)(side - 1);
    int i = (int)(u < last ? u : last), j = (int)(v < last ? v : last);
    return (grid_cell){j * side + i, u - (float)i, v - (float)j};
}

static inline float cell_value(const float *restrict plane, int side, int channels, grid_cell g)
{
    int k = g.index * channels;
    float low = plane[k] + g.a * (plane[k + channels] - plane[k]);
    int m = k + side * channels;
    float high = plane[m] + g.a * (plane[m + channels] - plane[m]);
    return low + g.b * (high - low);
}

TSUYA_CLONES("avx512f", "avx2", "default") static void
add_plane(const tsuya_albedo_table *table, int channel, float scale, const tsuya_direction_batch *d, float *restrict value)
{
    const float *restrict plane = table->value + channel;
    const float *restrict ix = d->wi_x, *restrict iy = d->wi_y, *restrict iz = d->wi_z;
    const float *restrict ox = d->wo_x, *restrict oy = d->wo_y, *restrict oz = d->wo_z;
    int side = table->side, channels = table->channels;
#pragma omp simd
    for (int k = 0; k < d->count; ++k) {
        float zi = iz[k] > 0.0f ? iz[k] : 1.0f, zo = oz[k] > 0.0f ? oz[k] : 1.0f;
        float ai = cell_value(plane, side, channels, cell_of(side, ix[k], iy[k], zi));
        float ao = cell_value(plane, side, channels, cell_of(side, ox[k], oy[k], zo));
        value[k] += scale * (1.0f - ai) * (1.0f - ao);
    }
}

TSUYA_CLONES("arch=x86-64-v3", "default") static void
limit_block(const tsuya_albedo_table *limit, const tsuya_direction_batch *d, int from, int count, float *restrict factor)
{
    const float *restrict ix = d->wi_x + from, *restrict iy = d->wi_y + from, *restrict iz = d->wi_z + from;
    const float *restrict ox = d->wo_x + from, *restrict oy = d->wo_y + from, *restrict oz = d->wo_z + from;
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        float zi = iz[k] > 0.0f ? iz[k] : 1.0f, zo = oz[k] > 0.0f ? oz[k] : 1.0f;
        float a = cell_value(limit->value, SIDE_FINE, 1, cell_of(SIDE_FINE, ix[k], iy[k], zi));
        factor[k] = a * cell_value(limit->value, SIDE_FINE, 1, cell_of(SIDE_FINE, ox[k], oy[k], zo));
    }
}

void tsuya_limit_batch(const tsuya_albedo_table *limit, int channels, const tsuya_direction_batch *d, float *value)
{
    enum { BLOCK = 256 };
    float factor[BLOCK];
    for (int from = 0; from < d->count; from += BLOCK) {
        int count = d->count - from < BLOCK ? d->count - from : BLOCK;
        limit_block(limit, d, from, count, factor);
        for (int c = 0; c < channels; ++c) {
            float *restrict plane = value + (size_t)c * (size_t)d->count + from;
            for (int k = 0; k < count; ++k) {
                plane[k] *= factor[k];
            }
        }
    }
}

void tsuya_dye_add_batch(const tsuya_albedo_table *table, const double *dye, const tsuya_direction_batch *batch, float *value)
{
    for (int c = 0; c < table->channels; ++c) {
        if (dye[c] > 0.0) {
            add_plane(table, c, (float)(dye[c] * table->inverse_rest[c]), batch, value + (size_t)c * (size_t)batch->count);
        }
    }
}
