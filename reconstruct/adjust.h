/* The mapper's model adjusted once more, without the observations that disturb it.
 *
 * COLMAP keeps whatever reprojects within 4 px and counts every pixel of error squared.  Features are far sharper than that
 * (0.05 to 0.3 px), so the few matches that are wrong by a pixel bend cameras and lens.  Here each photograph's own scatter
 * decides: sigma = 1.4826 × median |residual| per coordinate (a robust scale: Rousseeuw & Croux 1993), an observation farther
 * than four sigmas is left out, a point with fewer than two observations too, and COLMAP's bundle adjuster runs on the rest;
 * repeated until the choice stands.  With ten photographs or more of an unknown lens the principal point is freed last; where it
 * runs farther from the middle than 3 % of the picture, it stays there.  An observation that was left out comes back when it fits again. */
#ifndef TSUYA_RECONSTRUCT_ADJUST_H
#define TSUYA_RECONSTRUCT_ADJUST_H

#include "reconstruct/colmap.h"
#include "reconstruct/scale.h"
#include "reconstruct/tie.h"

typedef struct tsuya_adjust_info {
    size_t observations, kept;
    size_t tag_observations; /* of these, corners of tags; a sharp one counts up to four times */
    double sigma_px;     /* of features: median over the photographs, of what is kept */
    double tag_sigma_px; /* of corners of tags, likewise; 0 without */
    int rounds;
} tsuya_adjust_info;

/* Changes `model` (poses, points, tracks, and the intrinsics unless they are fixed).  The corners of `tags` (NULL: none) take part
 * as points of their own and are not in the model afterwards.  Works in colmap->folder/adjusting, which is removed afterwards.  A
 * model without points is left as it is.  `tie` (NULL: not wanted), one for each view: how firmly features and corners together hold it. */
TSUYA_MUST_CHECK tsuya_status tsuya_adjust(tsuya_sparse_model *model, tsuya_adjust_info *info, tsuya_tie *tie, tsuya_colmap *colmap,
                                           bool fixed_intrinsics, const tsuya_scale_input *tags);

#endif
