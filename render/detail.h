/* Level of detail: a mesh with fewer triangles where they are smaller than a pixel.
 *
 * The triangles are cut into patches.  A patch whose triangles' edges are shorter than half a pixel in every view is simplified
 * with its border held, so that patches of all levels fit; then every vertex that it had is held against the simplified surface
 * (rays along its normal).  Where one is off by more than is allowed it keeps its triangles and the patch is simplified again, finer
 * towards the end; a patch that never holds gets all of its own triangles back.  What is left out is therefore bounded by measurement and not by a heuristic. */
#ifndef TSUYA_RENDER_DETAIL_H
#define TSUYA_RENDER_DETAIL_H

#include "core/context.h"
#include "core/mesh.h"

/* Where a mesh is seen from, and how large a pixel is there: distance × pixel_rad. */
typedef struct tsuya_detail_view {
    tsuya_vec3 eye;
    double pixel_rad;
} tsuya_detail_view;

/* What a vertex may be off by. */
typedef struct tsuya_detail_options {
    double distance_px;      /* from the simplified surface, in pixels of the nearest view; 0: nothing is simplified */
    double normal_deg, weft_deg;
    double color;            /* of 255, the largest of r g b */
} tsuya_detail_options;
TSUYA_API tsuya_detail_options tsuya_detail_options_default(void); /* 0.1 px, 1°, 1°, 3 */

typedef struct tsuya_detail_info {
    size_t triangles_before, triangles_after;
    double distance_px, normal_deg, weft_deg, color; /* the largest of all vertices */
} tsuya_detail_info;

/* coarse: a mesh of its own, vertices that no triangle needs left out; with the same number of triangles as `mesh` and no vertices
 * when nothing was left out (use `mesh`).  The mesh needs normals.  The same for any number of threads. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_mesh_detail(tsuya_mesh *coarse, tsuya_detail_info *info, const tsuya_mesh *mesh,
                                                          const tsuya_detail_view *view, int view_count,
                                                          const tsuya_detail_options *options, const tsuya_context *context);

#endif
