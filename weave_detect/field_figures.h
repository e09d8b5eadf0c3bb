/* Figures of a finished field: how much was seen, threads per length, shear, singularities. */
#ifndef TSUYA_WEAVE_DETECT_FIELD_FIGURES_H
#define TSUYA_WEAVE_DETECT_FIELD_FIGURES_H

#include "weave_detect/evidence.h"
#include "weave_detect/mesh_graph.h"

typedef struct tsuya_field_view {
    const tsuya_mesh *mesh;
    const tsuya_mesh_graph *graph;
    const tsuya_votes *votes;
    const tsuya_evidence *evidence;
    const float *weft_rad;   /* in each vertex's tangent basis */
    const float *edge_scale; /* one a graph entry: less than ½ over seams; NULL: no seams */
    bool threads_seen;
    tsuya_weft_told weft_told;
} tsuya_field_view;

/* `info` is the caller's, tsuya_weave_mesh_info_free. */
TSUYA_MUST_CHECK tsuya_status tsuya_field_figures(tsuya_weave_mesh_info *info, const tsuya_field_view *field);

/* Quarter turns that the cross makes around a triangle (three indices into the field), more than the surface does: 0, or not 0 at a
 * singularity.  A seam along one of its sides makes it 0. */
int tsuya_field_index(const tsuya_field_view *field, const uint32_t vertex[3]);

#endif
