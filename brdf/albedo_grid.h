/* The grid on which directional albedos are tabulated. */
#ifndef TSUYA_BRDF_ALBEDO_GRID_H
#define TSUYA_BRDF_ALBEDO_GRID_H

#include "core/geometry.h"

/* Grid coordinates in [0, 1]² of a direction above the surface: azimuth as the diamond angle y / (|x| + |y|), quadrant by
 * quadrant, so that its kinks lie on grid lines; polar angle as 1 − sqrt(1 − sqrt(1 − z)), which grows as θ at the pole and
 * packs the nodes towards grazing angles, where albedos rise. */
static inline void tsuya_grid_from_direction(double *u, double *v, tsuya_vec3 w)
{
    double across = fabs(w.x) + fabs(w.y), a = across > 0.0 ? w.y / across : 0.0;
    *u = 0.25 * (1.0 + (w.x >= 0.0 ? a : 2.0 - a));
    *v = 1.0 - sqrt(fmax(0.0, 1.0 - sqrt(fmax(0.0, 1.0 - w.z))));
}

static inline tsuya_vec3 tsuya_direction_from_grid(double u, double v)
{
    double a = 4.0 * u - 1.0, y = a <= 1.0 ? a : 2.0 - a, x = (a <= 1.0 ? 1.0 : -1.0) * (1.0 - fabs(y));
    double s = 1.0 - (1.0 - v) * (1.0 - v), z = 1.0 - s * s, k = sqrt(fmax(0.0, 1.0 - z * z) / (x * x + y * y));
    return (tsuya_vec3){k * x, k * y, z};
}

/* Albedos of a node at the horizon are taken this high, where nothing divides by zero. */
static inline tsuya_vec3 tsuya_grid_node(int node, int side)
{
    tsuya_vec3 w = tsuya_direction_from_grid((double)(node % side) / (side - 1), (double)(node / side) / (side - 1));
    w.z = fmax(w.z, 1e-3);
    return tsuya_vec3_unit(w);
}

#endif
