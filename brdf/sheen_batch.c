/* The cloth's own model in float, eight directions at a time: angles and curves side by side, the net channel by channel. */
#include "brdf/sheen.h"

#include <string.h>

enum { BLOCK = 64, LANES = 4 };
typedef float lanes __attribute__((vector_size(LANES * sizeof(float)), aligned(4)));
static const float half_pi = 1.57079632679f, quarter_pi = 0.785398163397f, two_pi = 6.28318530718f;

/* Angles of one block as places on the knots, and what multiplies the net. */
typedef struct block {
    float bt[BLOCK], bb[BLOCK], u[BLOCK], v[BLOCK], d[BLOCK]; /* places: ψt, ψb, φh, θh, θd in intervals */
    float warp[BLOCK], weft[BLOCK], falloff[BLOCK];
} block;

/* atan of x ≥ 0 to 2e-7: two reductions and an odd polynomial (S. Moshier, Cephes). */
static inline float arc_tangent(float x)
{
    float big = x > 2.41421356f ? 1.0f : 0.0f, middle = x > 0.414213562f && x <= 2.41421356f ? 1.0f : 0.0f;
    float top = big > 0.0f ? -1.0f : middle > 0.0f ? x - 1.0f : x, bottom = big > 0.0f ? x : middle > 0.0f ? x + 1.0f : 1.0f;
    float t = top / bottom, z = t * t;
    float p = (((8.05374449538e-2f * z - 1.38776856032e-1f) * z + 1.99777106478e-1f) * z - 3.33329491539e-1f) * z * t + t;
    return p + big * half_pi + middle * quarter_pi;
}

/* exp for |x| < 80. */
static inline float exponential(float x)
{
    x = x < -80.0f ? -80.0f : x > 80.0f ? 80.0f : x;
    float k = x * 1.44269504089f;
    int n = (int)(k + (k >= 0.0f ? 0.5f : -0.5f));
    float r = (x - (float)n * 0.693359375f) + (float)n * 2.12194440e-4f;
    float p = 1.0f + r * (1.0f + r * (0.5f + r * (1.6666665e-1f + r * (4.1665795e-2f + r * (8.3334519e-3f + r * 1.3981999e-3f)))));
    union {
        int i;
        float f;
    } power = {(n + 127) << 23};
    return p * power.f;
}

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

static inline float curve_at(const float *curve, int i, const float w[4])
{
    return curve[i] * w[0] + curve[i + 1] * w[1] + curve[i + 2] * w[2] + curve[i + 3] * w[3];
}

__attribute__((target_clones("avx2", "default"))) static void
block_angles(block *b, const tsuya_sheen *s, const tsuya_direction_batch *d, int from, int count)
{
    const float *restrict ix = d->wi_x + from, *restrict iy = d->wi_y + from, *restrict iz = d->wi_z + from;
    const float *restrict ox = d->wo_x + from, *restrict oy = d->wo_y + from, *restrict oz = d->wo_z + from;
    const float *restrict warp_along = s->fast_curve, *restrict weft_across = warp_along + s->spans + 3;
    const float *restrict warp_across = weft_across + s->spans + 3, *restrict weft_along = warp_across + s->spans + 3;
    const float per_span = (float)s->spans / (2.0f * half_pi), per_u = (float)s->nu / two_pi, per_v = (float)s->nv / half_pi;
    const float per_d = (float)s->nd / half_pi, k00 = (float)s->slant[0][0], k01 = (float)s->slant[0][1];
    const float k10 = (float)s->slant[1][0], k11 = (float)s->slant[1][1];
    const int spans = s->spans, deep = s->nd > 0;
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        bool seen = iz[k] > 0.0f && oz[k] > 0.0f;
        float z = seen ? iz[k] + oz[k] : 1.0f, inverse = 1.0f / z, x = ix[k] + ox[k], y = iy[k] + oy[k];
        float tx = fabsf(x), ty = fabsf(y), psi_t = arc_tangent(tx * inverse), psi_b = arc_tangent(ty * inverse);
        float r2 = tx * tx + ty * ty, r = sqrtf(r2), theta = arc_tangent(r * inverse);
        float wide = tx > ty ? tx : ty, thin = tx > ty ? ty : tx, phi = arc_tangent(wide > 0.0f ? thin / wide : 0.0f);
        phi = ty > tx ? half_pi - phi : phi;
        phi = x < 0.0f ? 2.0f * half_pi - phi : phi;
        phi = y < 0.0f ? two_pi - phi : phi;
        float dx = ix[k] - ox[k], dy = iy[k] - oy[k], dz = iz[k] - oz[k];
        float dt2 = 0.25f * dx * dx, db2 = 0.25f * dy * dy;
        b->u[k] = phi * per_u;
        b->v[k] = theta * per_v;
        b->d[k] = deep ? arc_tangent(sqrtf((dx * dx + dy * dy + dz * dz) / (r2 + z * z))) * per_d : 0.0f;
        b->falloff[k] = 0.5f * inverse;
        float pt = ((x < 0.0f ? -psi_t : psi_t) + half_pi) * per_span, pb = ((y < 0.0f ? -psi_b : psi_b) + half_pi) * per_span;
        int it = interval_of(pt, spans), ib = interval_of(pb, spans);
        float wt[4], wb[4];
        cubic(wt, pt - (float)it);
        cubic(wb, pb - (float)ib);
        b->warp[k] = exponential(curve_at(warp_along, ib, wb) + curve_at(warp_across, it, wt) + k00 * db2 + k01 * dt2);
        b->weft[k] = exponential(curve_at(weft_along, it, wt) + curve_at(weft_across, ib, wb) + k10 * dt2 + k11 * db2);
    }
}

/* Logarithms S of one block, four channels at a time. */
__attribute__((target_clones("avx2", "default"))) static void
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

__attribute__((target_clones("avx2", "default"))) static void
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
        for (int c = 0; c < channels; ++c) {
            if (s->nu > 0 && c % LANES == 0) {
                block_net(log_value, &b, s, c, count);
            }
            block_values(value + (size_t)c * (size_t)batch->count + from, &b, log_value + c % LANES * BLOCK, (float)s->strength[0][c],
                         (float)s->strength[1][c], (float)s->matte[c], count);
        }
    }
}
