#include "brdf/dye.h"

#include "brdf/albedo_grid.h"
#include "core/clones.h"
#include "core/memory.h"

#include <stdint.h>
#include <string.h>

enum { MEAN_SIDE = 256, ABREAST = 4 }; /* ABREAST: channels that batches take at a time */

/* r̄ of the table as it is interpolated, so that base integrates to r exactly. */
void tsuya_albedo_table_fill_mean(tsuya_albedo_table *t)
{
    double a[TSUYA_MATERIAL_MAX_CHANNELS], mean[TSUYA_MATERIAL_MAX_CHANNELS] = {0};
    for (int k = 0; k < MEAN_SIDE * MEAN_SIDE; ++k) {
        double r = sqrt((k % MEAN_SIDE + 0.5) / MEAN_SIDE), phi = 2.0 * M_PI * (k / MEAN_SIDE + 0.5) / MEAN_SIDE;
        tsuya_albedo_table_eval(t, (tsuya_vec3){r * cos(phi), r * sin(phi), sqrt(1.0 - r * r)}, a);
        for (int c = 0; c < t->channels; ++c) {
            mean[c] += tsuya_dye_rest(a[c]) / (MEAN_SIDE * MEAN_SIDE);
        }
    }
    for (int c = 0; c < t->channels; ++c) {
        t->inverse_rest[c] = mean[c] > 1e-6 ? 1.0 / (M_PI * mean[c]) : 0.0;
    }
}

tsuya_status tsuya_albedo_table_create(tsuya_albedo_table **table, int side, int channels)
{
    tsuya_status status = TSUYA_OK;
    tsuya_albedo_table *t;
    *table = NULL;
    TSUYA_NEW(status, t, 1);
    t->channels = channels;
    t->side = side;
    t->level_above = INFINITY;
    TSUYA_NEW(status, t->value, (size_t)t->side * (size_t)t->side * (size_t)channels + ABREAST); /* the last channels are read with what follows */
    TSUYA_NEW(status, t->inverse_rest, (size_t)channels);
    *table = t;
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
        tsuya_free(table);
    }
}

size_t tsuya_albedo_table_bytes(const tsuya_albedo_table *table)
{
    size_t c = (size_t)table->channels;
    return sizeof *table + ((size_t)table->side * (size_t)table->side * c + ABREAST) * sizeof(float) + c * sizeof(double);
}

void tsuya_albedo_table_eval(const tsuya_albedo_table *table, tsuya_vec3 w, double *value)
{
    double u, v;
    tsuya_grid_from_direction(&u, &v, w);
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
    u = u > 0.0f ? u : 0.0f; /* directions that are not finite come here too, and are cleared later */
    v = v > 0.0f ? v : 0.0f;
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

enum { BLOCK = 256 }; /* a multiple of 8 */

/* Where the directions of a block lie on the grid. */
typedef struct places { int index[BLOCK]; float a[BLOCK], b[BLOCK]; } places;

TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
locate(places *restrict p, int side, const float *restrict x, const float *restrict y, const float *restrict z, int count)
{
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        grid_cell g = cell_of(side, x[k], y[k], z[k] > 0.0f ? z[k] : 1.0f);
        p->index[k] = g.index;
        p->a[k] = g.a;
        p->b[k] = g.b;
    }
}

typedef float four __attribute__((vector_size(ABREAST * sizeof(float)), aligned(sizeof(float))));
typedef int fours __attribute__((vector_size(ABREAST * sizeof(int)), aligned(sizeof(int))));

static inline __attribute__((always_inline)) four rest_at(const float *table, int side, int channels, const places *p, int k)
{
    const float *low = table + p->index[k] * channels, *high = low + side * channels;
    four below = *(const four *)low, above = *(const four *)high;
    below += p->a[k] * (*(const four *)(low + channels) - below);
    above += p->a[k] * (*(const four *)(high + channels) - above);
    four rest = 1.0f - 1.003f * (below + p->b[k] * (above - below));
    return (four)((fours)rest & (fours)(rest > 0.0f)); /* at least 0 */
}

TSUYA_CLONES("arch=x86-64-v3", "default") static void
add_base(float *const to[ABREAST], const tsuya_albedo_table *table, int channel, four scale, const places *wi, const places *wo, int count)
{
    const float *from = table->value + channel;
    for (int k = 0; k < count; ++k) {
        four f = scale * rest_at(from, table->side, table->channels, wi, k) * rest_at(from, table->side, table->channels, wo, k);
        for (int c = 0; c < ABREAST; ++c) {
            to[c][k] += f[c];
        }
    }
}

/* factor[k] = share · s(wi) s(wo). */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
limit_block(const tsuya_albedo_table *limit, const tsuya_direction_batch *d, float share, float *restrict factor)
{
    const float *restrict ix = d->wi_x, *restrict iy = d->wi_y, *restrict iz = d->wi_z;
    const float *restrict ox = d->wo_x, *restrict oy = d->wo_y, *restrict oz = d->wo_z;
    const int side = limit->side;
#pragma omp simd
    for (int k = 0; k < d->count; ++k) {
        float zi = iz[k] > 0.0f ? iz[k] : 1.0f, zo = oz[k] > 0.0f ? oz[k] : 1.0f;
        float a = share * cell_value(limit->value, side, 1, cell_of(side, ix[k], iy[k], zi));
        factor[k] = a * cell_value(limit->value, side, 1, cell_of(side, ox[k], oy[k], zo));
    }
}

void tsuya_limit_find_level(tsuya_albedo_table *t)
{
    int nodes = t->side * t->side, same = 0;
    while (same < nodes && t->value[same * t->channels] == t->value[0]) {
        same++;
    }
    int row = same / t->side - 1; /* the last that is level */
    double rest = 1.0 - (double)row / (t->side - 1), s = 1.0 - rest * rest;
    t->level_above = row > 0 ? (float)(1.0 - s * s + 1e-6) : INFINITY; /* brdf/albedo_grid.h; and what float may be off by */
}

/* Multiplies all pairs of a block by one factor. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
multiply_all(float *restrict value, int channels, int plane, int count, float factor)
{
    for (int c = 0; c < channels; ++c) {
        for (int k = 0; k < count; ++k) {
            value[(size_t)c * (size_t)plane + (size_t)k] *= factor;
        }
    }
}

/* Whether a pair has a direction near the horizon, or one that is not finite. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
mark_low(unsigned char *restrict low, const float *restrict iz, const float *restrict oz, int count, float level_above)
{
    for (int k = 0; k < count; ++k) {
        low[k] = (unsigned char)!((iz[k] < oz[k] ? iz[k] : oz[k]) >= level_above);
    }
}

/* Their numbers within a block, with room for one more; most are skipped eight at a time. */
static int find_low(short *low, const float *iz, const float *oz, int count, float level_above)
{
    unsigned char mark[BLOCK] = {0};
    int found = 0;
    mark_low(mark, iz, oz, count, level_above);
    for (int k = 0; k < count; k += 8) {
        uint64_t eight;
        memcpy(&eight, mark + k, sizeof eight);
        for (int i = k; i < k + 8 && eight != 0; ++i) {
            low[found] = (short)i;
            found += mark[i];
        }
    }
    return found;
}

/* A block's pairs that are low, side by side, under their own factors; and what all have in common. */
static void limit_some(const tsuya_albedo_table *limit, int channels, const tsuya_direction_batch *d, int from, int count, float *value)
{
    short low[BLOCK + 1];
    float w[6][BLOCK], factor[BLOCK], common = limit->value[0] * limit->value[0];
    int found = find_low(low, d->wi_z + from, d->wo_z + from, count, limit->level_above);
    const float *const own[6] = {d->wi_x, d->wi_y, d->wi_z, d->wo_x, d->wo_y, d->wo_z};
    const tsuya_direction_batch some = {found, w[0], w[1], w[2], w[3], w[4], w[5]};
    for (int i = 0; i < 6; ++i) {
        for (int k = 0; k < found; ++k) {
            w[i][k] = own[i][from + low[k]];
        }
    }
    if (common < 1.0f) {
        multiply_all(value + from, channels, d->count, count, common);
    }
    limit_block(limit, &some, 1.0f / common, factor);
    for (int c = 0; c < channels; ++c) {
        float *to = value + (size_t)c * (size_t)d->count + from;
        for (int k = 0; k < found; ++k) {
            to[low[k]] *= factor[k];
        }
    }
}

void tsuya_limit_batch(const tsuya_albedo_table *limit, int channels, const tsuya_direction_batch *d, float *value)
{
    for (int from = 0; from < d->count; from += BLOCK) {
        limit_some(limit, channels, d, from, d->count - from < BLOCK ? d->count - from : BLOCK, value);
    }
}

void tsuya_dye_add_batch(const tsuya_albedo_table *table, const double *dye, const tsuya_direction_batch *d, float *value)
{
    places wi, wo;
    float none[BLOCK] = {0}; /* for channels beyond the last */
    for (int from = 0; from < d->count; from += BLOCK) {
        int count = d->count - from < BLOCK ? d->count - from : BLOCK;
        locate(&wi, table->side, d->wi_x + from, d->wi_y + from, d->wi_z + from, count);
        locate(&wo, table->side, d->wo_x + from, d->wo_y + from, d->wo_z + from, count);
        for (int c = 0; c < table->channels; c += ABREAST) {
            float *to[ABREAST];
            four scale = {0};
            for (int k = 0; k < ABREAST; ++k) {
                bool there = c + k < table->channels;
                to[k] = there ? value + (size_t)(c + k) * (size_t)d->count + from : none;
                scale[k] = there ? (float)(dye[c + k] * table->inverse_rest[c + k]) : 0.0f;
            }
            add_base(to, table, c, scale, &wi, &wo, count);
        }
    }
}

TSUYA_CLONES("arch=x86-64-v3", "default") static void
rest_all(float *const to[ABREAST], const tsuya_albedo_table *table, int channel, const places *w, int count)
{
    for (int k = 0; k < count; ++k) {
        four rest = rest_at(table->value + channel, table->side, table->channels, w, k);
        for (int c = 0; c < ABREAST; ++c) {
            to[c][k] = rest[c];
        }
    }
}

void tsuya_dye_rest_batch(const tsuya_albedo_table *table, int count, const float *const w[3], float *rest)
{
    places at;
    float none[BLOCK];
    for (int from = 0; from < count; from += BLOCK) {
        int here = count - from < BLOCK ? count - from : BLOCK;
        locate(&at, table->side, w[0] + from, w[1] + from, w[2] + from, here);
        for (int c = 0; c < table->channels; c += ABREAST) {
            float *to[ABREAST];
            for (int k = 0; k < ABREAST; ++k) {
                to[k] = c + k < table->channels ? rest + (size_t)(c + k) * (size_t)count + from : none;
            }
            rest_all(to, table, c, &at, here);
        }
    }
}
