/* How firmly a photograph is tied to the others of a sparse model (inside reconstruct/).
 *
 * A pose that few or ill-placed observations hold may lie anywhere along what they leave free, with residuals as small as any
 * other's.  Two measures, both as the distance in pixels that points over the photograph's whole frame would move, root mean square
 * per coordinate:
 *  - by the normal equations: sigma² · (Jᵀ W J)⁻¹ of the pose, the photograph's own points free to follow (Schur complement; Triggs,
 *    McLauchlan, Hartley & Fitzgibbon, Bundle Adjustment — A Modern Synthesis, 2000), so that a point that only one other photograph
 *    sees ties in one direction only;
 *  - by halves: every second observation alone and the rest alone give two poses, half of whose difference is what an error that is no
 *    noise would show as (Quenouille 1956).
 * The other cameras and the lens are taken as known. */
#ifndef TSUYA_RECONSTRUCT_TIE_H
#define TSUYA_RECONSTRUCT_TIE_H

#include "core/camera.h"

#include <stdbool.h>

typedef struct tsuya_tie {
    int observations;
    double normal_px, halves_px; /* INFINITY where they do not determine the pose */
} tsuya_tie;

/* Of every view of an adjusted model, whose points' tracks are what was adjusted; `sigma_px`: scatter of each view's observations per
 * coordinate.  Fails only for want of memory. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_ties_measure(tsuya_tie *tie, const tsuya_sparse_model *model, const double *sigma_px);

/* Takes the views that are marked out of the model, and the points that fewer than two others see; indices close up. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_views_drop(tsuya_sparse_model *model, const bool *drop);

/* The larger of both. */
static inline double tsuya_tie_px(const tsuya_tie *tie) { return tie->normal_px > tie->halves_px ? tie->normal_px : tie->halves_px; }

#endif
