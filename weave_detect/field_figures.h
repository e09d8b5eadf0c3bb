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
    const float *weft_rad, *warp_rad; /* in each vertex's tangent basis */
    bool threads_seen;
} tsuya_field_view;

TSUYA_MUST_CHECK tsuya_status tsuya_field_figures(tsuya_weave_mesh_info *info, const tsuya_field_view *field);

/* Half turns (in units of π) that the weft makes around a triangle, as a field of lines: 0, or ±1 at a singularity.  vertex: three
 * indices into the field. */
int tsuya_field_index(const tsuya_field_view *field, const uint32_t vertex[3]);

#endif
