/* What of a solved plane field is worth keeping (inside reconstruct/). */
#ifndef TSUYA_RECONSTRUCT_PATCHMATCH_FILTER_H
#define TSUYA_RECONSTRUCT_PATCHMATCH_FILTER_H

#include "reconstruct/patchmatch_sweep.h"

/* Sets w to 0 where the plane is not trustworthy: cost, contrast, agreement with the sources' own depth (where the level
 * has a geometric term), islands.  What stays gets the median of the depths that the neighbours' planes predict. */
TSUYA_MUST_CHECK tsuya_status tsuya_patchmatch_filter(plane_field *field, const patch_level *level,
                                                      const tsuya_patchmatch_options *options,
                                                      const tsuya_context *context);

/* Takes the depth from a bare backdrop's pixels along outlines (patchmatch_backdrop.c).  `flag` and `stack`: scratch of one
 * entry a pixel. */
void tsuya_patchmatch_drop_backdrop(plane_field *field, const patch_level *level, uint8_t *flag, size_t *stack,
                                    const tsuya_context *context);

/* Depth, normal and cost of the planes with w > 0. */
void tsuya_patchmatch_store(tsuya_depth_map *map, const plane_field *field, const patch_level *level);

#endif
