/* A lamp of some size over a plate that is tilted about: the truth of the lamp's tests.  The lamp is summed over its face, its
 * lobe is its own, and the paper shines a little; none of it is the fitted model. */
#ifndef TSUYA_TESTS_CALIB_LAMP_SCENE_H
#define TSUYA_TESTS_CALIB_LAMP_SCENE_H

#include "support.h"

#include "calib/lamp.h"
#include "core/context.h"

typedef struct lamp_truth {
    tsuya_vec3 position_m, direction;
    double diameter_m;   /* of its face */
    double falloff;      /* 1: even disk */
    double intensity;    /* on the axis, camera's unit times m² */
    double gloss;        /* of the paper, a share of its matte radiance at normal incidence */
    double ambient;
} lamp_truth;

static inline lamp_truth lamp_usual(void)
{
    return (lamp_truth){{0.45, 0.35, 0.70}, {-0.45, -0.35, -0.75}, 0.04, 1.0, 1.6, 0.02, 0.004};
}

/* Radiance of white paper (reflectance 0.85) with normal n at p, seen from the eye. */
static inline double lamp_radiance(const lamp_truth *l, tsuya_vec3 p, tsuya_vec3 n, tsuya_vec3 eye)
{
    tsuya_vec3 axis = tsuya_vec3_unit(l->direction), side = tsuya_vec3_tangent((tsuya_vec3){0, 1, 0}, axis), up = tsuya_vec3_cross(axis, side);
    tsuya_vec3 wo = tsuya_vec3_unit(tsuya_vec3_sub(eye, p));
    double sum = 0.0;
    for (int i = 0; i < 25; i++) {
        double r = 0.5 * l->diameter_m * sqrt((i + 0.5) / 25.0), a = 2.399963229728653 * i;
        tsuya_vec3 q = tsuya_vec3_mad(tsuya_vec3_mad(l->position_m, r * cos(a), side), r * sin(a), up), d = tsuya_vec3_sub(q, p);
        double length = tsuya_vec3_norm(d);
        tsuya_vec3 wi = tsuya_vec3_scale(d, 1.0 / length), h = tsuya_vec3_unit(tsuya_vec3_add(wi, wo));
        double c = -tsuya_vec3_dot(wi, axis), cosine = tsuya_vec3_dot(n, wi);
        if (c > 0.0 && cosine > 0.0) {
            double shine = l->gloss * pow(fmax(tsuya_vec3_dot(n, h), 0.0), 12.0);
            sum += l->intensity * pow(c, l->falloff) * cosine / (length * length) * (1.0 + shine) / 25.0;
        }
    }
    return 0.85 / M_PI * sum + l->ambient;
}

/* The plate in photograph k: first flat, then tilted to all sides, nearer to the lamp and farther from it. */
static inline tsuya_pose lamp_plate(int k)
{
    double a = 2.1 * k, tilt = k == 0 ? 0.0 : 0.25 + 0.2 * (k % 3);
    tsuya_vec3 turn = {tilt * cos(a), tilt * sin(a), 0.3 * sin(3.0 * k)};
    return (tsuya_pose){k == 0 ? tsuya_mat3_identity() : tsuya_mat3_from_rodrigues(turn),
                        {0.07 * sin(1.7 * k), 0.06 * cos(2.3 * k) - (k == 0 ? 0.06 : 0.0), k == 0 ? 0.0 : 0.05 * (k % 4)}};
}

static inline tsuya_pose lamp_camera(void) { return tsuya_pose_look_at((tsuya_vec3){0.05, -0.2, 0.85}, (tsuya_vec3){0.07, 0.05, 0.03}, (tsuya_vec3){0, 0, 1}); }

#endif
