#include "render/surface.h"

#include "core/clones.h"

typedef tsuya_vec3f vec;
#define INLINE static inline __attribute__((always_inline))

/* The vertex's normal on the side of ng; ng itself where it has none. */
INLINE vec oriented(vec normal, vec ng)
{
    float side = tsuya_dot_f32(normal, ng);
    return tsuya_choose_f32(side == 0.0f, ng, tsuya_scale_f32(normal, side > 0.0f ? 1.0f : -1.0f));
}

INLINE float largest(vec a)
{
    float x = fabsf(a.x), y = fabsf(a.y), z = fabsf(a.z), m = x > y ? x : y;
    return m > z ? m : z;
}

/* Of the triangle, on the side of wo; wo where the triangle has none.  Edges are brought near 1 first: squares of tiny ones vanish. */
INLINE vec face_normal(vec e1, vec e2, vec wo)
{
    float a = largest(e1), b = largest(e2), size = a > b ? a : b, scale = size > 0.0f ? 1.0f / size : 0.0f;
    vec ng = tsuya_unit_f32(tsuya_cross_f32(tsuya_scale_f32(e1, scale), tsuya_scale_f32(e2, scale)));
    ng = tsuya_choose_f32(tsuya_dot_f32(ng, ng) > 0.5f, ng, wo);
    return tsuya_scale_f32(ng, tsuya_dot_f32(ng, wo) < 0.0f ? -1.0f : 1.0f);
}

/* From the surface to the plane of a vertex and its normal, by the share of that vertex, where the surface lies below. */
INLINE vec lifted(vec lift, vec from_vertex, vec normal, float share)
{
    float over = tsuya_dot_f32(from_vertex, normal);
    return tsuya_mad_f32(lift, over < 0.0f ? -share * over : 0.0f, normal);
}

/* Bent towards wo until it faces it. */
INLINE vec facing(vec n, vec wo)
{
    const float least = 1e-3f;
    float cosine = tsuya_dot_f32(n, wo), bend = least - cosine;
    return tsuya_unit_f32(tsuya_mad_f32(n, bend > 0.0f ? bend : 0.0f, wo));
}

/* Place, normals, lift. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
make_points(tsuya_surfaces *restrict s, const tsuya_corners *restrict c, const tsuya_planes3 *restrict view)
{
#pragma omp simd
    for (int k = 0; k < s->count; ++k) {
        float u = c->u[k], v = c->v[k], t = 1.0f - u - v;
        vec a = tsuya_lane(&c->position[0], k), wo = tsuya_lane(view, k), none = {0.0f, 0.0f, 0.0f};
        vec e1 = tsuya_sub_f32(tsuya_lane(&c->position[1], k), a), e2 = tsuya_sub_f32(tsuya_lane(&c->position[2], k), a);
        vec from_a = tsuya_mad_f32(tsuya_scale_f32(e1, u), v, e2), ng = face_normal(e1, e2, wo);
        vec n0 = oriented(tsuya_lane(&c->normal[0], k), ng), n1 = oriented(tsuya_lane(&c->normal[1], k), ng), n2 = oriented(tsuya_lane(&c->normal[2], k), ng);
        vec n = tsuya_mad_f32(tsuya_mad_f32(tsuya_scale_f32(n0, t), u, n1), v, n2);
        vec lift = lifted(lifted(lifted(none, from_a, n0, t), tsuya_sub_f32(from_a, e1), n1, u), tsuya_sub_f32(from_a, e2), n2, v);
        tsuya_set_lane(&s->p, k, tsuya_mad_f32(a, 1.0f, from_a));
        tsuya_set_lane(&s->lift, k, lift);
        tsuya_set_lane(&s->ng, k, ng);
        tsuya_set_lane(&s->n, k, facing(tsuya_unit_f32(n), wo));
    }
}

/* Weft is an axis: its sign may differ from vertex to vertex, so the corners are aligned to the first that has one. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
make_frames(tsuya_surfaces *restrict s, const tsuya_corners *restrict c)
{
#pragma omp simd
    for (int k = 0; k < s->count; ++k) {
        float u = c->u[k], v = c->v[k], t = 1.0f - u - v;
        vec n = tsuya_lane(&s->n, k), w0 = tsuya_lane(&c->weft[0], k), w1 = tsuya_lane(&c->weft[1], k), w2 = tsuya_lane(&c->weft[2], k);
        vec first = tsuya_choose_f32(tsuya_dot_f32(w0, w0) > 0.0f, w0, w1);
        vec sum = tsuya_scale_f32(w0, t);
        sum = tsuya_mad_f32(sum, tsuya_dot_f32(w1, first) < 0.0f ? -u : u, w1);
        sum = tsuya_mad_f32(sum, tsuya_dot_f32(w2, first) < 0.0f ? -v : v, w2);
        vec x = tsuya_mad_f32(sum, -tsuya_dot_f32(sum, n), n);
        /* shorter than this, the direction is an accident of rounding or of corners that contradict each other */
        bool known = tsuya_dot_f32(x, x) > 0.02f * 0.02f;
        x = tsuya_choose_f32(known, tsuya_unit_f32(x), tsuya_tangent_f32(n));
        s->has_weft[k] = known ? 1.0f : 0.0f;
        tsuya_set_lane(&s->x, k, x);
        tsuya_set_lane(&s->y, k, tsuya_cross_f32(n, x));
    }
}

TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
make_dye(tsuya_surfaces *restrict s, const tsuya_corners *restrict c, const float under[3])
{
    for (int i = 0; i < 3; ++i) {
        float *restrict to = s->dye + i * s->count;
        for (int k = 0; k < s->count; ++k) {
            float u = c->u[k], v = c->v[k], dye = (1.0f - u - v) * c->dye[0][i][k] + u * c->dye[1][i][k] + v * c->dye[2][i][k] + under[i];
            to[k] = dye < 1.0f ? dye : 1.0f;
        }
    }
}

void tsuya_surfaces_make(tsuya_surfaces *s, const tsuya_corners *corners, const tsuya_planes3 *wo, const double under[3])
{
    make_points(s, corners, wo);
    make_frames(s, corners);
    if (s->dyed) {
        make_dye(s, corners, (const float[3]){(float)under[0], (float)under[1], (float)under[2]});
    }
}

void tsuya_surfaces_turn_over(tsuya_surfaces *s)
{
    const tsuya_vec3 none = {0, 0, 0};
    for (int k = 0; k < s->count; ++k) {
        tsuya_planes3_set(&s->n, k, tsuya_vec3_scale(tsuya_planes3_at(&s->n, k), -1.0));
        tsuya_planes3_set(&s->ng, k, tsuya_vec3_scale(tsuya_planes3_at(&s->ng, k), -1.0));
        tsuya_planes3_set(&s->y, k, tsuya_vec3_scale(tsuya_planes3_at(&s->y, k), -1.0));
        tsuya_planes3_set(&s->lift, k, none);
    }
}

TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
ray_origins(const tsuya_surfaces *restrict s, const tsuya_planes3 *restrict wi, tsuya_planes3 *restrict origin, float *restrict starts)
{
    /* Far from the terminator the plain point serves, and cannot be lifted into a layer that lies close above. */
    const float steep = 0.25f, bias = s->bias;
#pragma omp simd
    for (int k = 0; k < s->count; ++k) {
        vec ng = tsuya_lane(&s->ng, k), lift = tsuya_lane(&s->lift, k);
        float side = tsuya_dot_f32(tsuya_lane(wi, k), ng), share = side >= steep ? 0.0f : 1.0f;
        starts[k] = (side > 0.0f) | (tsuya_dot_f32(lift, lift) > 4.0f * bias * bias) ? 1.0f : 0.0f;
        tsuya_set_lane(origin, k, tsuya_mad_f32(tsuya_lane(&s->p, k), 1.0f, tsuya_mad_f32(tsuya_scale_f32(lift, share), bias, ng)));
    }
}

void tsuya_surfaces_ray_origins(const tsuya_surfaces *s, const tsuya_planes3 *wi, tsuya_planes3 *origin, float *starts)
{
    ray_origins(s, wi, origin, starts);
}

TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
to_local(const tsuya_surfaces *restrict s, const tsuya_planes3 *restrict world, tsuya_planes3 *restrict local)
{
#pragma omp simd
    for (int k = 0; k < s->count; ++k) {
        vec w = tsuya_lane(world, k);
        tsuya_set_lane(local, k, (vec){tsuya_dot_f32(w, tsuya_lane(&s->x, k)), tsuya_dot_f32(w, tsuya_lane(&s->y, k)), tsuya_dot_f32(w, tsuya_lane(&s->n, k))});
    }
}

void tsuya_surfaces_to_local(const tsuya_surfaces *s, const tsuya_planes3 *world, tsuya_planes3 *local) { to_local(s, world, local); }

TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
to_world(const tsuya_surfaces *restrict s, const tsuya_planes3 *restrict local, tsuya_planes3 *restrict world)
{
#pragma omp simd
    for (int k = 0; k < s->count; ++k) {
        vec w = tsuya_lane(local, k), sum = tsuya_mad_f32(tsuya_scale_f32(tsuya_lane(&s->x, k), w.x), w.y, tsuya_lane(&s->y, k));
        tsuya_set_lane(world, k, tsuya_unit_f32(tsuya_mad_f32(sum, w.z, tsuya_lane(&s->n, k))));
    }
}

void tsuya_surfaces_to_world(const tsuya_surfaces *s, const tsuya_planes3 *local, tsuya_planes3 *world) { to_world(s, local, world); }
