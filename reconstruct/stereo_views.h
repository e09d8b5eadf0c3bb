/* Which photographs help which, and how far away things are: both from the sparse model (inside reconstruct/). */
#ifndef TSUYA_RECONSTRUCT_STEREO_VIEWS_H
#define TSUYA_RECONSTRUCT_STEREO_VIEWS_H

#include "core/camera.h"
#include "core/memory.h"

typedef struct tsuya_view_plan {
    bool used;       /* reference; false: held out, too few points, or no neighbour */
    bool held_out;
    int source_count;
    int *source;     /* view indices, best first */
    double depth_min, depth_max;
} tsuya_view_plan;

/* One plan for every view of the model, in the arena.  A source is scored over the points that both see: by the angle
 * between their rays (best at 10 degrees; falls off with 5 below and 12 above) and by the likeness of their scales.
 * Fails when the model has no points, or when no view can be used. */
TSUYA_MUST_CHECK tsuya_status tsuya_view_plans_make(tsuya_view_plan **plan, const tsuya_sparse_model *model,
                                                    const char *const *hold_out, int hold_out_count, int source_views,
                                                    const char *workspace, tsuya_arena *arena);

/* Names the views that no plan uses. */
void tsuya_view_plans_warn(const tsuya_view_plan *plan, const tsuya_sparse_model *model);

#endif
