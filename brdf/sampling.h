/* Warps of the unit square. */
#ifndef TSUYA_BRDF_SAMPLING_H
#define TSUYA_BRDF_SAMPLING_H

#include "core/geometry.h"

/* Concentric map of the square to the unit disk (Shirley & Chiu 1997), area preserving. */
static inline tsuya_vec2 tsuya_sample_disk(double u, double v)
{
    double a = 2.0 * u - 1.0, b = 2.0 * v - 1.0;
    if (a == 0.0 && b == 0.0) {
        return (tsuya_vec2){0.0, 0.0};
    }
    bool wide = fabs(a) > fabs(b);
    double r = wide ? a : b;
    double phi = wide ? (M_PI / 4.0) * (b / a) : M_PI / 2.0 - (M_PI / 4.0) * (a / b);
    return (tsuya_vec2){r * cos(phi), r * sin(phi)};
}

/* Density cosθ/π around +z. */
static inline tsuya_vec3 tsuya_sample_cosine(double u, double v)
{
    tsuya_vec2 d = tsuya_sample_disk(u, v);
    return (tsuya_vec3){d.x, d.y, sqrt(fmax(0.0, 1.0 - d.x * d.x - d.y * d.y))};
}

/* The same in float, for loops that vectorise. */
static inline void tsuya_sample_disk_f32(float u, float v, float *x, float *y)
{
    float a = 2.0f * u - 1.0f, b = 2.0f * v - 1.0f;
    bool wide = fabsf(a) > fabsf(b);
    float r = wide ? a : b, t = 0.785398163f * (wide ? b : a) / (r != 0.0f ? r : 1.0f), q = t * t; /* |t| ≤ π/4 */
    float s = r * t * (1.0f - q * (1.6666667e-1f - q * (8.3333333e-3f - q * (1.9841270e-4f - q * 2.7557319e-6f))));
    float c = r * (1.0f - q * (0.5f - q * (4.1666667e-2f - q * (1.3888889e-3f - q * 2.4801587e-5f))));
    *x = wide ? c : s;
    *y = wide ? s : c;
}

static inline void tsuya_sample_cosine_f32(float u, float v, float *x, float *y, float *z)
{
    tsuya_sample_disk_f32(u, v, x, y);
    float rest = 1.0f - *x * *x - *y * *y;
    *z = sqrtf(rest > 0.0f ? rest : 0.0f);
}

#endif
