/* Numbers of a wave of paths as planes, one lane a path, for loops that vectorise.
 *
 * Loops run over whole vectors (tsuya_lanes_padded), so that a lane's result does not depend on its place: lanes behind the last hold
 * copies of the first. */
#ifndef TSUYA_RENDER_WAVE_H
#define TSUYA_RENDER_WAVE_H

#include "brdf/material.h"

/* Paths of a wave; of these, lanes that are worked on at once; and those of the longest vector. */
enum { TSUYA_WAVE = 128, TSUYA_LANES = TSUYA_MATERIAL_LOOKS, TSUYA_VECTOR = 16 };

typedef struct tsuya_planes3 {
    _Alignas(64) float x[TSUYA_LANES];
    _Alignas(64) float y[TSUYA_LANES];
    _Alignas(64) float z[TSUYA_LANES];
} tsuya_planes3;

static inline int tsuya_lanes_padded(int count) { return (count + TSUYA_VECTOR - 1) & ~(TSUYA_VECTOR - 1); }

static inline tsuya_vec3 tsuya_planes3_at(const tsuya_planes3 *v, int k) { return (tsuya_vec3){v->x[k], v->y[k], v->z[k]}; }

static inline void tsuya_planes3_set(tsuya_planes3 *v, int k, tsuya_vec3 a)
{
    v->x[k] = (float)a.x;
    v->y[k] = (float)a.y;
    v->z[k] = (float)a.z;
}

/* Vectors within such a loop. */
static inline __attribute__((always_inline)) tsuya_vec3f tsuya_lane(const tsuya_planes3 *v, int k) { return (tsuya_vec3f){v->x[k], v->y[k], v->z[k]}; }

static inline __attribute__((always_inline)) void tsuya_set_lane(tsuya_planes3 *v, int k, tsuya_vec3f a)
{
    v->x[k] = a.x;
    v->y[k] = a.y;
    v->z[k] = a.z;
}

static inline __attribute__((always_inline)) float tsuya_dot_f32(tsuya_vec3f a, tsuya_vec3f b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
/* a + s·b */
static inline __attribute__((always_inline)) tsuya_vec3f tsuya_mad_f32(tsuya_vec3f a, float s, tsuya_vec3f b)
{
    return (tsuya_vec3f){a.x + s * b.x, a.y + s * b.y, a.z + s * b.z};
}
static inline __attribute__((always_inline)) tsuya_vec3f tsuya_sub_f32(tsuya_vec3f a, tsuya_vec3f b) { return (tsuya_vec3f){a.x - b.x, a.y - b.y, a.z - b.z}; }
static inline __attribute__((always_inline)) tsuya_vec3f tsuya_scale_f32(tsuya_vec3f a, float s) { return (tsuya_vec3f){a.x * s, a.y * s, a.z * s}; }
static inline __attribute__((always_inline)) tsuya_vec3f tsuya_cross_f32(tsuya_vec3f a, tsuya_vec3f b)
{
    return (tsuya_vec3f){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
/* The zero vector stays zero. */
static inline __attribute__((always_inline)) tsuya_vec3f tsuya_unit_f32(tsuya_vec3f a)
{
    float q = tsuya_dot_f32(a, a);
    return tsuya_scale_f32(a, q > 0.0f ? 1.0f / sqrtf(q) : 0.0f);
}
static inline __attribute__((always_inline)) tsuya_vec3f tsuya_choose_f32(bool which, tsuya_vec3f a, tsuya_vec3f b)
{
    return (tsuya_vec3f){which ? a.x : b.x, which ? a.y : b.y, which ? a.z : b.z};
}
/* render/frame.h */
static inline __attribute__((always_inline)) tsuya_vec3f tsuya_tangent_f32(tsuya_vec3f n)
{
    float sign = n.z >= 0.0f ? 1.0f : -1.0f, a = -1.0f / (sign + n.z);
    return (tsuya_vec3f){1.0f + sign * n.x * n.x * a, sign * n.x * n.y * a, -sign * n.x};
}

#endif
