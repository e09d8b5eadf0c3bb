/* Rays against a triangle mesh (Embree 3 behind one adapter).
 *
 * The tree is built by one thread in robust mode, so that hits, ties on shared edges included, depend on nothing but the
 * mesh.  Both queries are thread safe. */
#ifndef TSUYA_RENDER_EMBREE_ADAPTER_H
#define TSUYA_RENDER_EMBREE_ADAPTER_H

#include "core/mesh.h"

typedef struct tsuya_ray_scene tsuya_ray_scene;

typedef struct tsuya_ray {
    float origin[3], direction[3]; /* direction unit */
    float near, far;
} tsuya_ray;

typedef struct tsuya_ray_hit {
    float distance, u, v; /* point = (1 − u − v) a + u b + v c */
    uint32_t triangle;
} tsuya_ray_hit;

/* Copies what it needs.  A mesh without triangles is a scene that nothing hits.  Fails on non-finite vertices (index
 * named), indices out of range, and when memory is short. */
TSUYA_MUST_CHECK tsuya_status tsuya_ray_scene_create(tsuya_ray_scene **scene, const tsuya_mesh *mesh);
void tsuya_ray_scene_free(tsuya_ray_scene *scene);

bool tsuya_ray_scene_intersect(const tsuya_ray_scene *scene, const tsuya_ray *ray, tsuya_ray_hit *hit);
bool tsuya_ray_scene_occluded(const tsuya_ray_scene *scene, const tsuya_ray *ray);

/* Up to eight rays that lie close together, at once: faster where they do, and the same answers (where two triangles lie at
 * the very same distance, either may be named). */
enum { TSUYA_RAY_PACKET = 8 };
void tsuya_ray_scene_intersect_packet(const tsuya_ray_scene *scene, const tsuya_ray *ray, int count, tsuya_ray_hit *hit, bool *met);
void tsuya_ray_scene_occluded_packet(const tsuya_ray_scene *scene, const tsuya_ray *ray, int count, bool *occluded);

#endif
