/* The cloth's own model in float, eight directions at a time: angles and curves side by side, the net channel by channel. */
#include "brdf/kernel.h"
#include "brdf/sheen.h"

#include "core/clones.h"

#include <string.h>

enum { BLOCK = 128, LANES = 4 };
typedef float lanes __attribute__((vector_size(LANES * sizeof(float)), aligned(4)));
typedef float pairs __attribute__((vector_size(8 * sizeof(float)), aligned(4)));

/* Angles of one block as places on the knots, what they say of the net, and what multiplies it. */
typedef struct block {
    float t[BLOCK], b[BLOCK], u[BLOCK], v[BLOCK], d[BLOCK]; /* places: ψt, ψb, φh, θh, θd in intervals; then v and d as fractions */
    float warp[BLOCK], weft[BLOCK], falloff[BLOCK];         /* warp, weft: logarithms first */
    float gloss[BLOCK];                                     /* what Fresnel's term adds, the same in every channel */
    float wu[4][BLOCK], wd[4][BLOCK];
    int column[4][BLOCK], corner[BLOCK]; /* where the four columns round φ begin, and where in each */
} block;

static inline void cubic(float w[4], float t)
{
    float s = 1.0f - t;
    w[0] = s * s * s * (1.0f / 6.0f);
    w[1] = (4.0f + t * t * (3.0f * t - 6.0f)) * (1.0f / 6.0f);
    w[2] = (4.0f + s * s * (3.0f * s - 6.0f)) * (1.0f / 6.0f);
    w[3] = t * t * t * (1.0f / 6.0f);
}

/* Interval of a place, clamped to [0, intervals − 1]. */
static inline int interval_of(float place, int intervals)
{
    int i = (int)place;
    return i < 0 ? 0 : i < intervals ? i : intervals - 1;
}

/* The four weights of a cubic as polynomials of the fraction, each written twice or four times over. */
#define CUBIC(w0, w1, w2, w3, f) ((w0) + (f) * ((w1) + (f) * ((w2) + (f) * (w3))))
#define TWICE(a, b, c, d) {(a) / 6, (a) / 6, (b) / 6, (b) / 6, (c) / 6, (c) / 6, (d) / 6, (d) / 6}
#define FOURFOLD(a, b) {(a) / 6, (a) / 6, (a) / 6, (a) / 6, (b) / 6, (b) / 6, (b) / 6, (b) / 6}

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
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        float z = larger(iz[k] + oz[k], 1e-9f), x = ix[k] + ox[k], y = iy[k] + oy[k];
        float tx = fabsf(x), ty = fabsf(y), top_t = larger(tx, z), top_b = larger(ty, z), all = 1.0f / (z * top_t * top_b);
        float psi_t = angle_from(smaller(tx, z) * (all * z * top_b), tx > z);
        float psi_b = angle_from(smaller(ty, z) * (all * z * top_t), ty > z);
        float dx = ix[k] - ox[k], dy = iy[k] - oy[k], dt2 = 0.25f * dx * dx, db2 = 0.25f * dy * dy;
        b->falloff[k] = 0.5f * (all * top_t * top_b);
        b->t[k] = ((x < 0.0f ? -psi_t : psi_t) + half_pi) * per_span;
        b->b[k] = ((y < 0.0f ? -psi_b : psi_b) + half_pi) * per_span;
        b->warp[k] = k00 * db2 + k01 * dt2;
        b->weft[k] = k10 * dt2 + k11 * db2;
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
    const float *over_b = s->fast_curve, *over_t = over_b + 2 * (s->spans + 3);
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
    const float lowest = (float)s->lowest_cosine, per = (float)(2.0 / (1.0 - s->lowest_cosine)), warp = (float)s->gloss[0], weft = (float)s->gloss[1];
    const float *r = s->fast_rise, r0 = r[0], r1 = r[1], r2 = r[2], r3 = r[3], r4 = r[4], r5 = r[5], r6 = r[6], r7 = r[7];
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        float x = ix[k] + ox[k], y = iy[k] + oy[k], z = iz[k] + oz[k], c = larger(0.5f * sqrtf(x * x + y * y + z * z), lowest);
        float t = (c - lowest) * per - 1.0f, rise = r0 + t * (r1 + t * (r2 + t * (r3 + t * (r4 + t * (r5 + t * (r6 + t * r7))))));
        b->gloss[k] = (warp * b->warp[k] + weft * b->weft[k]) * rise;
    }
}

/* Weights round φ and over θd, and where the window of each direction begins; v and d become fractions. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
block_window(block *restrict b, const tsuya_sheen *s, int count)
{
    const int nu = s->nu, nv = s->nv, nd = s->nd, column = (nv + 3) * LANES, layer = nu * column;
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        int u = interval_of(b->u[k], nu), v = interval_of(b->v[k], nv), d = nd > 0 ? interval_of(b->d[k], nd) : 0;
        float fu = b->u[k] - (float)u, gu = 1.0f - fu, fd = b->d[k] - (float)d, gd = 1.0f - fd;
        b->wu[0][k] = gu * gu * gu;
        b->wu[1][k] = 4.0f + fu * fu * (3.0f * fu - 6.0f);
        b->wu[2][k] = 4.0f + gu * gu * (3.0f * gu - 6.0f);
        b->wu[3][k] = fu * fu * fu;
        b->wd[0][k] = nd > 0 ? gd * gd * gd * (1.0f / 6.0f) : 1.0f;
        b->wd[1][k] = (4.0f + fd * fd * (3.0f * fd - 6.0f)) * (1.0f / 6.0f);
        b->wd[2][k] = (4.0f + gd * gd * (3.0f * gd - 6.0f)) * (1.0f / 6.0f);
        b->wd[3][k] = fd * fd * fd * (1.0f / 6.0f);
        b->v[k] -= (float)v;
        b->corner[k] = d * layer + v * LANES;
        b->column[0][k] = u * column;
        b->column[1][k] = (u + 1 < nu ? u + 1 : u + 1 - nu) * column;
        b->column[2][k] = (u + 2 < nu ? u + 2 : u + 2 - nu) * column;
        b->column[3][k] = (u + 3 < nu ? u + 3 : u + 3 - nu) * column;
    }
}

/* Logarithms S of one block where all channels fit in one line: the four lines of a window lie side by side, in two registers. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
block_window_sums(lanes *restrict sum, const block *restrict b, const tsuya_sheen *s, int count)
{
    const pairs a0 = FOURFOLD(1.0f, 4.0f), a1 = FOURFOLD(-3.0f, 0.0f), a2 = FOURFOLD(3.0f, -6.0f), a3 = FOURFOLD(-1.0f, 3.0f);
    const pairs b0 = FOURFOLD(1.0f, 0.0f), b1 = FOURFOLD(3.0f, 0.0f), b2 = FOURFOLD(3.0f, 0.0f), b3 = FOURFOLD(-3.0f, 1.0f);
    const int layer = s->nu * (s->nv + 3) * LANES, deep = s->nd > 0 ? 4 : 1;
    const float *net = s->net;
    for (int k = 0; k < count; ++k) {
        const float *p0 = net + b->corner[k] + b->column[0][k], *p1 = net + b->corner[k] + b->column[1][k];
        const float *p2 = net + b->corner[k] + b->column[2][k], *p3 = net + b->corner[k] + b->column[3][k];
        float w0 = b->wu[0][k], w1 = b->wu[1][k], w2 = b->wu[2][k], w3 = b->wu[3][k];
        pairs first = {0}, last = {0};
        for (int m = 0, at = 0; m < deep; ++m, at += layer) {
            pairs near = *(const pairs *)(p0 + at) * w0, far = *(const pairs *)(p0 + at + 8) * w0;
            near += *(const pairs *)(p1 + at) * w1;
            far += *(const pairs *)(p1 + at + 8) * w1;
            near += *(const pairs *)(p2 + at) * w2;
            far += *(const pairs *)(p2 + at + 8) * w2;
            near += *(const pairs *)(p3 + at) * w3;
            far += *(const pairs *)(p3 + at + 8) * w3;
            first += near * b->wd[m][k];
            last += far * b->wd[m][k];
        }
        float f = b->v[k];
        first = first * CUBIC(a0, a1, a2, a3, f) + last * CUBIC(b0, b1, b2, b3, f);
        sum[k] = __builtin_shufflevector(first, first, 0, 1, 2, 3) + __builtin_shufflevector(first, first, 4, 5, 6, 7);
    }
}

TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
block_planes(float *restrict log_value, const lanes *restrict sum, int count)
{
    for (int k = 0; k < count; ++k) {
        for (int c = 0; c < LANES; ++c) {
            log_value[c * BLOCK + k] = sum[k][c] * (1.0f / 6.0f); /* what the weights round φ are short of */
        }
    }
}

static void block_net_of_four(float *log_value, const block *b, const tsuya_sheen *s, int count)
{
    lanes sum[BLOCK];
    block_window_sums(sum, b, s, count);
    block_planes(log_value, sum, count);
}

/* Logarithms S of one block, four channels at a time. */
TSUYA_CLONES("arch=x86-64-v3", "default") static void
block_net(float *restrict log_value, const block *b, const tsuya_sheen *s, int channel, int count)
{
    const int row = (s->nv + 3) * s->line, layer = s->nu * row, deep = s->nd > 0 ? 4 : 1;
    for (int k = 0; k < count; ++k) {
        float wu[4], wv[4], wd[4] = {1.0f};
        int u = interval_of(b->u[k], s->nu), v = interval_of(b->v[k], s->nv), d = s->nd > 0 ? interval_of(b->d[k], s->nd) : 0;
        cubic(wu, b->u[k] - (float)u);
        cubic(wv, b->v[k] - (float)v);
        if (s->nd > 0) {
            cubic(wd, b->d[k] - (float)d);
        }
        lanes sum = {0};
        for (int m = 0; m < deep; ++m) {
            for (int i = 0; i < 4; ++i) {
                int around = u + i < s->nu ? u + i : u + i - s->nu;
                const float *p = s->net + (d + m) * layer + around * row + v * s->line + channel;
                lanes part = *(const lanes *)p * wv[0];
                part += *(const lanes *)(p + s->line) * wv[1];
                part += *(const lanes *)(p + 2 * s->line) * wv[2];
                part += *(const lanes *)(p + 3 * s->line) * wv[3];
                sum += part * (wd[m] * wu[i]);
            }
        }
        for (int c = 0; c < LANES; ++c) {
            log_value[c * BLOCK + k] = sum[c];
        }
    }
}

TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
block_values(float *restrict value, const block *b, const float *restrict log_value, float warp, float weft, float matte, int count)
{
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        value[k] = (warp * b->warp[k] + weft * b->weft[k] + matte + b->gloss[k]) * b->falloff[k] * exponential(log_value[k]);
    }
}

/* The same where there is no net. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
block_values_alone(float *restrict value, const block *b, float warp, float weft, float matte, int count)
{
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        value[k] = (warp * b->warp[k] + weft * b->weft[k] + matte + b->gloss[k]) * b->falloff[k];
    }
}

void tsuya_sheen_eval_batch(const void *sheen, int channels, const tsuya_direction_batch *batch, float *value)
{
    const tsuya_sheen *s = sheen;
    block b;
    float log_value[LANES * BLOCK];
    for (int from = 0; from < batch->count; from += BLOCK) {
        int count = batch->count - from < BLOCK ? batch->count - from : BLOCK;
        block_yarn_angles(&b, s, batch, from, count);
        block_yarns(&b, s, count);
        if (s->gloss[0] + s->gloss[1] > 0.0) {
            block_gloss(&b, s, batch, from, count);
        } else {
            memset(b.gloss, 0, sizeof b.gloss);
        }
        if (s->nu > 0 && s->line == LANES) {
            block_net_angles(&b, s, batch, from, count);
            block_window(&b, s, count);
            block_net_of_four(log_value, &b, s, count);
        }
        for (int c = 0; c < channels; ++c) {
            float *to = value + (size_t)c * (size_t)batch->count + from;
            float warp = (float)s->strength[0][c], weft = (float)s->strength[1][c], matte = (float)s->matte[c];
            if (s->nu == 0) {
                block_values_alone(to, &b, warp, weft, matte, count);
                continue;
            }
            if (s->line > LANES && c % LANES == 0) {
                block_net_angles(&b, s, batch, from, count);
                block_net(log_value, &b, s, c, count);
            }
            block_values(to, &b, log_value + c % LANES * BLOCK, warp, weft, matte, count);
        }
    }
}
