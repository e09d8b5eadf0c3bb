/* Distance from points to a triangle mesh: a bounding-volume hierarchy and exact point-triangle distances. */
#ifndef TSUYA_RECONSTRUCT_MESH_DISTANCE_H
#define TSUYA_RECONSTRUCT_MESH_DISTANCE_H

#include "core/context.h"
#include "core/mesh.h"

typedef struct tsuya_mesh_tree tsuya_mesh_tree;

/* Borrows the mesh, which must stay as it is.  A mesh without triangles is refused.  About 40 bytes a triangle. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_mesh_tree_create(tsuya_mesh_tree **tree, const tsuya_mesh *mesh);
TSUYA_API void tsuya_mesh_tree_free(tsuya_mesh_tree *tree);

typedef struct tsuya_mesh_hit {
    double distance;    /* INFINITY where no triangle is within the limit */
    tsuya_vec3 closest; /* point on the mesh */
    uint32_t triangle;  /* UINT32_MAX where there is none */
} tsuya_mesh_hit;
/* The closest point of the mesh among those nearer than `limit`. */
TSUYA_API tsuya_mesh_hit tsuya_mesh_tree_closest(const tsuya_mesh_tree *tree, tsuya_vec3 point, double limit);

/* Distances of many points (3 × count floats); independent of the number of threads. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_mesh_distances(float *distance, const tsuya_mesh *mesh, const float *point,
                                                             size_t count, const tsuya_context *context);

#endif
