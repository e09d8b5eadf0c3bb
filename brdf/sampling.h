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

#endif
