/* The cloth's own model in float, eight directions at a time: angles and curves side by side, the net channel by channel. */
#include "brdf/kernel.h"
#include "brdf/sheen.h"

#include "core/clones.h"

#include <string.h>

enum { BLOCK = 64, LANES = 4 };
typedef float lanes __attribute__((vector_size(LANES * sizeof(float)), aligned(4)));
typedef float pairs __attribute__((vector_size(8 * sizeof(float)), aligned(4)));

/* Angles of one block as places on the knots, and what multiplies the net. */
typedef struct block {
    float t[BLOCK], b[BLOCK], u[BLOCK], v[BLOCK], d[BLOCK]; /* places: ψt, ψb, φh, θh, θd in intervals */
    float warp[BLOCK], weft[BLOCK], falloff[BLOCK];         /* warp, weft: logarithms first */
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

TSUYA_CLONES("arch=x86-64-v3", "default") static void
block_angles(block *b, const tsuya_sheen *s, const tsuya_direction_batch *d, int from, int count)
{
    const float *restrict ix = d->wi_x + from, *restrict iy = d->wi_y + from, *restrict iz = d->wi_z + from;
    const float *restrict ox = d->wo_x + from, *restrict oy = d->wo_y + from, *restrict oz = d->wo_z + from;
    const float per_span = (float)s->spans / (2.0f * half_pi), per_u = (float)s->nu / two_pi, per_v = (float)s->nv / half_pi;
    const float per_d = (float)s->nd / half_pi, k00 = (float)s->slant[0][0], k01 = (float)s->slant[0][1];
    const float k10 = (float)s->slant[1][0], k11 = (float)s->slant[1][1];
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        bool seen = iz[k] > 0.0f && oz[k] > 0.0f;
        float z = seen ? iz[k] + oz[k] : 1.0f, inverse = 1.0f / z, x = ix[k] + ox[k], y = iy[k] + oy[k];
        float tx = fabsf(x), ty = fabsf(y), psi_t = arc_tangent(tx * inverse), psi_b = arc_tangent(ty * inverse);
        float r2 = tx * tx + ty * ty, r = sqrtf(r2), theta = arc_tangent(r * inverse);
        float wide = tx > ty ? tx : ty, thin = tx > ty ? ty : tx, phi = arc_tangent(thin / (wide > 1e-30f ? wide : 1e-30f));
        phi = ty > tx ? half_pi - phi : phi;
        phi = x < 0.0f ? 2.0f * half_pi - phi : phi;
        phi = y < 0.0f ? two_pi - phi : phi;
        float dx = ix[k] - ox[k], dy = iy[k] - oy[k], dz = iz[k] - oz[k];
        float dt2 = 0.25f * dx * dx, db2 = 0.25f * dy * dy;
        b->u[k] = phi * per_u;
        b->v[k] = theta * per_v;
        b->d[k] = arc_tangent(sqrtf((dx * dx + dy * dy + dz * dz) / (r2 + z * z))) * per_d;
        b->falloff[k] = 0.5f * inverse;
        b->t[k] = ((x < 0.0f ? -psi_t : psi_t) + half_pi) * per_span;
        b->b[k] = ((y < 0.0f ? -psi_b : psi_b) + half_pi) * per_span;
        b->warp[k] = k00 * db2 + k01 * dt2;
        b->weft[k] = k10 * dt2 + k11 * db2;
    }
}

/* The curves of both yarns: one row of four pairs a place, warp and weft side by side. */
TSUYA_CLONES("arch=x86-64-v3", "default") static void
block_yarns(block *b, const tsuya_sheen *s, int count)
{
    const pairs c0 = TWICE(1.0f, 4.0f, 1.0f, 0.0f), c1 = TWICE(-3.0f, 0.0f, 3.0f, 0.0f), c2 = TWICE(3.0f, -6.0f, 3.0f, 0.0f);
    const pairs c3 = TWICE(-1.0f, 3.0f, -3.0f, 1.0f);
    const float *over_b = s->fast_curve, *over_t = over_b + 2 * (s->spans + 3);
    for (int k = 0; k < count; ++k) {
        int ib = interval_of(b->b[k], s->spans), it = interval_of(b->t[k], s->spans);
        float fb = b->b[k] - (float)ib, ft = b->t[k] - (float)it;
        pairs p = *(const pairs *)(over_b + 2 * ib) * CUBIC(c0, c1, c2, c3, fb) + *(const pairs *)(over_t + 2 * it) * CUBIC(c0, c1, c2, c3, ft);
        b->warp[k] += (p[0] + p[2]) + (p[4] + p[6]);
        b->weft[k] += (p[1] + p[3]) + (p[5] + p[7]);
    }
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        b->warp[k] = exponential(b->warp[k]);
        b->weft[k] = exponential(b->weft[k]);
    }
}

/* The same as block_net where all channels fit in one line: the four lines of a window lie side by side. */
TSUYA_CLONES("arch=x86-64-v3", "default") static void
block_net_of_four(float *restrict log_value, const block *b, const tsuya_sheen *s, int count)
{
    const pairs a0 = FOURFOLD(1.0f, 4.0f), a1 = FOURFOLD(-3.0f, 0.0f), a2 = FOURFOLD(3.0f, -6.0f), a3 = FOURFOLD(-1.0f, 3.0f);
    const pairs b0 = FOURFOLD(1.0f, 0.0f), b1 = FOURFOLD(3.0f, 0.0f), b2 = FOURFOLD(3.0f, 0.0f), b3 = FOURFOLD(-3.0f, 1.0f);
    const int row = (s->nv + 3) * LANES, layer = s->nu * row, deep = s->nd > 0 ? 4 : 1;
    for (int k = 0; k < count; ++k) {
        float wu[4], wd[4] = {1.0f};
        int u = interval_of(b->u[k], s->nu), v = interval_of(b->v[k], s->nv), d = s->nd > 0 ? interval_of(b->d[k], s->nd) : 0;
        cubic(wu, b->u[k] - (float)u);
        if (s->nd > 0) {
            cubic(wd, b->d[k] - (float)d);
        }
        pairs first = {0}, last = {0};
        for (int m = 0; m < deep; ++m) {
            for (int i = 0; i < 4; ++i) {
                int around = u + i < s->nu ? u + i : u + i - s->nu;
                const float *p = s->net + (d + m) * layer + around * row + v * LANES, w = wd[m] * wu[i];
                first += *(const pairs *)p * w;
                last += *(const pairs *)(p + 8) * w;
            }
        }
        float f = b->v[k] - (float)v;
        first = first * CUBIC(a0, a1, a2, a3, f) + last * CUBIC(b0, b1, b2, b3, f);
        for (int c = 0; c < LANES; ++c) {
            log_value[c * BLOCK + k] = first[c] + first[c + 4];
        }
    }
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

TSUYA_CLONES("arch=x86-64-v3", "default") static void
block_values(float *restrict value, const block *b, const float *restrict log_value, float warp, float weft, float matte, int count)
{
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        value[k] = (warp * b->warp[k] + weft * b->weft[k] + matte) * b->falloff[k] * exponential(log_value[k]);
    }
}

void tsuya_sheen_eval_batch(const void *sheen, int channels, const tsuya_direction_batch *batch, float *value)
{
    const tsuya_sheen *s = sheen;
    block b;
    float log_value[LANES * BLOCK];
    memset(log_value, 0, sizeof log_value);
    for (int from = 0; from < batch->count; from += BLOCK) {
        int count = batch->count - from < BLOCK ? batch->count - from : BLOCK;
        block_angles(&b, s, batch, from, count);
        block_yarns(&b, s, count);
        for (int c = 0; c < channels; ++c) {
            if (s->nu > 0 && c % LANES == 0) {
                (s->line == LANES ? block_net_of_four(log_value, &b, s, count) : block_net(log_value, &b, s, c, count));
            }
            block_values(value + (size_t)c * (size_t)batch->count + from, &b, log_value + c % LANES * BLOCK, (float)s->strength[0][c],
                         (float)s->strength[1][c], (float)s->matte[c], count);
        }
    }
}
