/* Edges, boundary and connected parts of a triangle mesh. */
#ifndef TSUYA_RECONSTRUCT_MESH_TOPOLOGY_H
#define TSUYA_RECONSTRUCT_MESH_TOPOLOGY_H

#include "core/mesh.h"

/* Edges that belong to exactly one triangle, as pairs of vertices (low, high) in ascending order; tsuya_free. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_mesh_boundary(uint32_t **pairs, size_t *count, const tsuya_mesh *mesh);

/* part[v]: the lowest vertex that v is joined to by edges both of whose ends have use[v] ≠ 0 (all, if use is NULL);
 * UINT32_MAX for vertices that are not used. */
TSUYA_INTERNAL void tsuya_mesh_parts(uint32_t *part, const tsuya_mesh *mesh, const uint8_t *use);

/* Drops parts of less than `fraction` of the largest part's area and vertices of no triangle.  parts_left may be NULL. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_mesh_drop_islands(tsuya_mesh *mesh, double fraction, size_t *parts_left);

/* Taubin's λ|μ smoothing ("A signal processing approach to fair surface design", SIGGRAPH 1995; λ 0.5, μ −0.53), which
 * does not shrink.  Boundary vertices move along the boundary's own curve only. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_mesh_smooth(tsuya_mesh *mesh, int iterations);

/* Keeps where field < level; triangles on the border are cut along the line field = level, attributes interpolated. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_mesh_cut(tsuya_mesh *mesh, const float *field, float level);

#endif
