/* The cloth's own model in float: angles side by side, the curves of all terms in one row.  Processors with AVX-512: brdf/sheen_wide.c. */
#include "brdf/kernel.h"
#include "brdf/sheen_tables.h"

#include "core/clones.h"

#include <string.h>

enum { BLOCK = 128, LANES = 4 };
typedef float lanes __attribute__((vector_size(LANES * sizeof(float)), aligned(4)));
typedef float pairs __attribute__((vector_size(8 * sizeof(float)), aligned(4)));

/* Angles of one block as places on the knots, and what multiplies S. */
typedef struct block {
    float t[BLOCK], b[BLOCK], u[BLOCK], v[BLOCK], d[BLOCK]; /* places: ψt, ψb, φh, θh, θd in intervals; of ψ, then fractions of one */
    float warp[BLOCK], weft[BLOCK], falloff[BLOCK];         /* warp, weft: logarithms first; falloff: 0 where nothing is seen */
    float gloss[BLOCK];                                     /* what Fresnel's term adds, the same in every channel */
} block;

/* Where a block's places lie among the rows of one curve of all terms. */
typedef struct window {
    int at[BLOCK];
    float weight[4][BLOCK];
} window;

/* Interval of a place, clamped to [0, intervals − 1]. */
static inline int interval_of(float place, int intervals)
{
    int i = (int)place;
    return i < 0 ? 0 : i < intervals ? i : intervals - 1;
}

/* The four weights of a cubic as polynomials of the fraction, each written twice over. */
#define CUBIC(w0, w1, w2, w3, f) ((w0) + (f) * ((w1) + (f) * ((w2) + (f) * (w3))))
#define TWICE(a, b, c, d) {(a) / 6, (a) / 6, (b) / 6, (b) / 6, (c) / 6, (c) / 6, (d) / 6, (d) / 6}

static inline float larger(float a, float b) { return a > b ? a : b; }
static inline float smaller(float a, float b) { return a < b ? a : b; }

/* Inclinations along the yarns, the falloff and the slants, which every model has. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
block_yarn_angles(block *restrict b, const tsuya_sheen *s, const tsuya_direction_batch *d, int from, int count)
{
    const float *restrict ix = d->wi_x + from, *restrict iy = d->wi_y + from, *restrict iz = d->wi_z + from;
    const float *restrict ox = d->wo_x + from, *restrict oy = d->wo_y + from, *restrict oz = d->wo_z + from;
    const float per_span = (float)s->spans / (2.0f * half_pi);
    const float k00 = (float)s->slant[0][0], k01 = (float)s->slant[0][1], k10 = (float)s->slant[1][0], k11 = (float)s->slant[1][1];
    const float reach_t = (float)s->reach[0], reach_b = (float)s->reach[1]; /* of slants that raise */
    const float r00 = k00 > 0.0f ? reach_b : 4.0f, r01 = k01 > 0.0f ? reach_t : 4.0f, r10 = k10 > 0.0f ? reach_t : 4.0f, r11 = k11 > 0.0f ? reach_b : 4.0f;
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        float z = larger(iz[k] + oz[k], 1e-9f), x = ix[k] + ox[k], y = iy[k] + oy[k];
        float tx = fabsf(x), ty = fabsf(y), top_t = larger(tx, z), top_b = larger(ty, z), all = 1.0f / (z * top_t * top_b);
        float psi_t = angle_from(smaller(tx, z) * (all * z * top_b), tx > z);
        float psi_b = angle_from(smaller(ty, z) * (all * z * top_t), ty > z);
        float dx = ix[k] - ox[k], dy = iy[k] - oy[k], dt2 = 0.25f * dx * dx, db2 = 0.25f * dy * dy;
        bool seen = (iz[k] > 0.0f) & (oz[k] > 0.0f) & (fabsf(x + y + (iz[k] + oz[k])) < INFINITY);
        b->falloff[k] = seen ? 0.5f * (all * top_t * top_b) : 0.0f;
        b->t[k] = ((x < 0.0f ? -psi_t : psi_t) + half_pi) * per_span;
        b->b[k] = ((y < 0.0f ? -psi_b : psi_b) + half_pi) * per_span;
        b->warp[k] = k00 * smaller(db2, r00) + k01 * smaller(dt2, r01);
        b->weft[k] = k10 * smaller(dt2, r10) + k11 * smaller(db2, r11);
    }
}

/* Azimuth, tilt and difference angle, which the net is looked up with. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
block_net_angles(block *restrict b, const tsuya_sheen *s, const tsuya_direction_batch *d, int from, int count)
{
    const float *restrict ix = d->wi_x + from, *restrict iy = d->wi_y + from, *restrict iz = d->wi_z + from;
    const float *restrict ox = d->wo_x + from, *restrict oy = d->wo_y + from, *restrict oz = d->wo_z + from;
    const float per_u = (float)s->nu / two_pi, per_v = (float)s->nv / half_pi, per_d = (float)s->nd / half_pi;
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        float z = larger(iz[k] + oz[k], 1e-9f), x = ix[k] + ox[k], y = iy[k] + oy[k], tx = fabsf(x), ty = fabsf(y);
        float r = sqrtf(tx * tx + ty * ty), wide = larger(larger(tx, ty), 1e-18f), top = larger(r, z), both = 1.0f / (wide * top);
        b->u[k] = unfold_azimuth(angle_from(smaller(tx, ty) * (both * top), ty > tx), x, y) * per_u;
        b->v[k] = angle_from(smaller(r, z) * (both * wide), r > z) * per_v;
    }
    if (s->nd > 0) {
#pragma omp simd
        for (int k = 0; k < count; ++k) {
            float z = iz[k] + oz[k], x = ix[k] + ox[k], y = iy[k] + oy[k], sum = x * x + y * y + z * z;
            float dx = ix[k] - ox[k], dy = iy[k] - oy[k], dz = iz[k] - oz[k], difference = dx * dx + dy * dy + dz * dz;
            float ratio = sqrtf(smaller(sum, difference) / larger(larger(sum, difference), 1e-30f));
            b->d[k] = angle_from(ratio, difference > sum) * per_d;
        }
    }
}

/* The curves of both yarns: one row of four pairs a place, warp and weft side by side. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
block_yarns(block *restrict b, const tsuya_sheen *s, int count)
{
    const pairs c0 = TWICE(1.0f, 4.0f, 1.0f, 0.0f), c1 = TWICE(-3.0f, 0.0f, 3.0f, 0.0f), c2 = TWICE(3.0f, -6.0f, 3.0f, 0.0f);
    const pairs c3 = TWICE(-1.0f, 3.0f, -3.0f, 1.0f);
    const tsuya_sheen_rows rows = tsuya_sheen_rows_of(s);
    const float *over_b = rows.over_b, *over_t = rows.over_t;
    lanes sum[BLOCK];
    int ib[BLOCK], it[BLOCK];
    const int spans = s->spans;
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        ib[k] = interval_of(b->b[k], spans);
        it[k] = interval_of(b->t[k], spans);
        b->b[k] -= (float)ib[k];
        b->t[k] -= (float)it[k];
    }
    for (int k = 0; k < count; ++k) {
        float fb = b->b[k], ft = b->t[k];
        pairs p = *(const pairs *)(over_b + 2 * ib[k]) * CUBIC(c0, c1, c2, c3, fb) + *(const pairs *)(over_t + 2 * it[k]) * CUBIC(c0, c1, c2, c3, ft);
        sum[k] = __builtin_shufflevector(p, p, 0, 1, 2, 3) + __builtin_shufflevector(p, p, 4, 5, 6, 7);
    }
    for (int k = 0; k < count; ++k) {
        b->warp[k] = exponential(b->warp[k] + (sum[k][0] + sum[k][2]));
        b->weft[k] = exponential(b->weft[k] + (sum[k][1] + sum[k][3]));
    }
}

/* What Fresnel's term adds to both yarns. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
block_gloss(block *restrict b, const tsuya_sheen *s, const tsuya_direction_batch *d, int from, int count)
{
    const float *restrict ix = d->wi_x + from, *restrict iy = d->wi_y + from, *restrict iz = d->wi_z + from;
    const float *restrict ox = d->wo_x + from, *restrict oy = d->wo_y + from, *restrict oz = d->wo_z + from;
    const float lowest = (float)s->lowest_cosine, warp = (float)s->gloss[0], weft = (float)s->gloss[1];
    const float eta2 = (float)(s->eta * s->eta - 1.0), per = (float)pow((s->eta + 1.0) / (s->eta - 1.0), 2.0);
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        float x = ix[k] + ox[k], y = iy[k] + oy[k], z = iz[k] + oz[k], cosine = larger(0.5f * sqrtf(x * x + y * y + z * z), lowest);
        b->gloss[k] = (warp * b->warp[k] + weft * b->weft[k]) * (fresnel_term(cosine, eta2, per) - 1.0f);
    }
}

/* Windows of the net's places, and the four weights of the cubic there. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
block_weights(window *restrict w, const float *restrict place, int intervals, int count)
{
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        int at = interval_of(place[k], intervals);
        float t = place[k] - (float)at, s = 1.0f - t, tt = t * t * (1.0f / 6.0f), ss = s * s * (1.0f / 6.0f);
        w->at[k] = at * TSUYA_SHEEN_TERMS;
        w->weight[0][k] = ss * s;
        w->weight[1][k] = 2.0f / 3.0f + tt * (3.0f * t - 6.0f);
        w->weight[2][k] = 2.0f / 3.0f + ss * (3.0f * s - 6.0f);
        w->weight[3][k] = tt * t;
    }
}

/* Four rows of all terms under the weights of a cubic. */
static inline __attribute__((always_inline)) void multiply_row(pairs *product, const float *rows, const window *w, int k)
{
    const float *p = rows + w->at[k];
    *product *= (*(const pairs *)p * w->weight[0][k] + *(const pairs *)(p + 8) * w->weight[1][k]) +
                (*(const pairs *)(p + 16) * w->weight[2][k] + *(const pairs *)(p + 24) * w->weight[3][k]);
}

/* The products of the terms' curves. */
TSUYA_CLONES("arch=x86-64-v3", "default") static void
block_terms(float term[TSUYA_SHEEN_TERMS][BLOCK], const window *u, const window *v, const window *d, const tsuya_sheen *s, int count)
{
    const tsuya_sheen_rows rows = tsuya_sheen_rows_of(s);
    const pairs ones = {1, 1, 1, 1, 1, 1, 1, 1}, first = s->nd > 0 ? ones : *(const pairs *)rows.deep;
    float row[BLOCK][TSUYA_SHEEN_TERMS]; /* of a direction */
    for (int k = 0; k < count; ++k) {
        pairs product = first;
        multiply_row(&product, rows.round, u, k);
        multiply_row(&product, rows.tilt, v, k);
        if (s->nd > 0) {
            multiply_row(&product, rows.deep, d, k);
        }
        *(pairs *)row[k] = product;
    }
    for (int k = 0; k < count; ++k) {
        for (int r = 0; r < TSUYA_SHEEN_TERMS; ++r) {
            term[r][k] = row[k][r];
        }
    }
}

/* S of one channel. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
block_surface(float *restrict log_value, float term[TSUYA_SHEEN_TERMS][BLOCK], const tsuya_sheen *s, int channel, int count)
{
    const float *tint = tsuya_sheen_rows_of(s).tint + channel * TSUYA_SHEEN_TERMS;
    float a[TSUYA_SHEEN_TERMS];
    memcpy(a, tint, sizeof a);
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        log_value[k] = ((a[0] * term[0][k] + a[1] * term[1][k]) + (a[2] * term[2][k] + a[3] * term[3][k])) +
                       ((a[4] * term[4][k] + a[5] * term[5][k]) + (a[6] * term[6][k] + a[7] * term[7][k]));
    }
}

TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
block_values(float *restrict value, const block *b, const float *restrict log_value, float warp, float weft, float matte, int count)
{
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        float f = (warp * b->warp[k] + weft * b->weft[k] + matte + b->gloss[k]) * b->falloff[k] * exponential(log_value[k]);
        value[k] = b->falloff[k] > 0.0f ? f : 0.0f; /* what was not finite is not now */
    }
}

/* The same where there is no S. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
block_values_alone(float *restrict value, const block *b, float warp, float weft, float matte, int count)
{
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        float f = (warp * b->warp[k] + weft * b->weft[k] + matte + b->gloss[k]) * b->falloff[k];
        value[k] = b->falloff[k] > 0.0f ? f : 0.0f;
    }
}

void tsuya_sheen_eval_rows(const tsuya_sheen *s, int channels, const tsuya_direction_batch *batch, float *value)
{
    block b;
    window u, v, d;
    float term[TSUYA_SHEEN_TERMS][BLOCK], log_value[BLOCK];
    for (int from = 0; from < batch->count; from += BLOCK) {
        int count = batch->count - from < BLOCK ? batch->count - from : BLOCK;
        block_yarn_angles(&b, s, batch, from, count);
        block_yarns(&b, s, count);
        if (tsuya_sheen_glossy(s)) {
            block_gloss(&b, s, batch, from, count);
        } else {
            memset(b.gloss, 0, sizeof b.gloss);
        }
        if (s->terms > 0) {
            block_net_angles(&b, s, batch, from, count);
            block_weights(&u, b.u, s->nu, count);
            block_weights(&v, b.v, s->nv, count);
            if (s->nd > 0) {
                block_weights(&d, b.d, s->nd, count);
            }
            block_terms(term, &u, &v, &d, s, count);
        }
        for (int c = 0; c < channels; ++c) {
            float *to = value + (size_t)c * (size_t)batch->count + from;
            float warp = (float)s->strength[0][c], weft = (float)s->strength[1][c], matte = (float)s->matte[c];
            if (s->terms == 0) {
                block_values_alone(to, &b, warp, weft, matte, count);
                continue;
            }
            block_surface(log_value, term, s, c, count);
            block_values(to, &b, log_value, warp, weft, matte, count);
        }
    }
}

void tsuya_sheen_eval_batch(const void *sheen, int channels, const tsuya_direction_batch *batch, float *value)
{
    const tsuya_sheen *s = sheen;
    if (s->wide) {
        tsuya_sheen_eval_wide(s, channels, batch, value);
    } else {
        tsuya_sheen_eval_rows(s, channels, batch, value);
    }
}
