/* Draws of the half vector for many viewers, in float: the table is searched once for all of them. */
#include "brdf/half_table.h"
#include "brdf/kernel.h"
#include "brdf/sampling.h"

#include "core/clones.h"

#include <stdint.h>

static int cosine_draws(int total) { return total / 10 * TSUYA_HALF_COSINE_TENTHS; }

static double radical_inverse(uint32_t i)
{
    double sum = 0.0;
    for (double step = 0.5; i > 0; i >>= 1, step *= 0.5) {
        sum += i & 1 ? step : 0.0;
    }
    return sum;
}

void tsuya_half_table_shared_draws(const tsuya_half_table *t, int total, float *shared)
{
    int lobe = cosine_draws(total);
    for (int k = 0; k < total; ++k) {
        int among = k < lobe ? lobe : total - lobe, at = k < lobe ? k : k - lobe;
        const double u[2] = {(at + 0.5) / among, radical_inverse((uint32_t)at)};
        tsuya_vec3 w = k < lobe ? tsuya_sample_cosine(u[0], u[1]) : tsuya_half_table_draw(t, u);
        shared[k] = (float)w.x;
        shared[total + k] = (float)w.y;
        shared[2 * total + k] = (float)w.z;
    }
}

TSUYA_CLONES("arch=x86-64-v3", "default") static void
take_draws(const tsuya_half_table *t, tsuya_vec3 wo, const float *shared, int total, int from, int count, float *const wi[3], float *weight)
{
    const float ox = (float)wo.x, oy = (float)wo.y, oz = (float)wo.z, *restrict density = t->density;
    const float per_phi = (float)t->phi_cells / two_pi, per_theta = (float)t->theta_cells / half_pi;
    const float lobe = (float)cosine_draws(total), rest = (float)total - lobe; /* draws of either kind: weights need no share */
    const int direct = cosine_draws(total) - from, rows = t->theta_cells, columns = t->phi_cells;
    float *restrict wx = wi[0], *restrict wy = wi[1], *restrict wz = wi[2];
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        float x = shared[k], y = shared[total + k], z = shared[2 * total + k], twice = 2.0f * (x * ox + y * oy + z * oz);
        bool is_direct = k < direct;
        float ix = is_direct ? x : twice * x - ox, iy = is_direct ? y : twice * y - oy, iz = is_direct ? z : twice * z - oz;
        bool up = iz > 0.0f && (is_direct || twice > 0.0f);
        iz = up ? iz : 1.0f;
        ix = up ? ix : 0.0f;
        iy = up ? iy : 0.0f;
        float hx = ix + ox, hy = iy + oy, hz = iz + oz, across = sqrtf(hx * hx + hy * hy), size = sqrtf(across * across + hz * hz);
        float tx = fabsf(hx), ty = fabsf(hy), wide = tx > ty ? tx : ty, thin = tx > ty ? ty : tx;
        float turn = angle_from(thin / (wide > 1e-30f ? wide : 1e-30f), ty > tx);
        float tilt = angle_from(across > hz ? hz / across : across / hz, across > hz);
        int i = (int)(tilt * per_theta), j = (int)(unfold_azimuth(turn, hx, hy) * per_phi);
        i = i < rows ? i : rows - 1;
        j = j < columns ? j : columns - 1;
        float cosine = 0.5f * size; /* of wo and h */
        float pdf = lobe * iz * 0.318309886f + rest * density[i * columns + j] / (4.0f * (cosine > 1e-6f ? cosine : 1e-6f));
        wx[k] = ix;
        wy[k] = iy;
        wz[k] = iz;
        weight[k] = up ? iz / pdf : 0.0f;
    }
}

void tsuya_half_table_take_draws(const tsuya_half_table *t, tsuya_vec3 wo, const float *shared, int total, int from, int count, float *const wi[3],
                                 float *weight)
{
    take_draws(t, wo, shared, total, from, count, wi, weight);
}
