/* Tags in the adjustment of cameras: their corners as points beside the features', and photographs that only tags place.
 *
 * A corner is seen far more sharply than a feature, and in most photographs instead of three or four: it ties cameras together that
 * no feature joins.  Its place is left free, so that what the board's file says of it stays a check of the scale. */
#ifndef TSUYA_RECONSTRUCT_ADJUST_TAGS_H
#define TSUYA_RECONSTRUCT_ADJUST_TAGS_H

#include "reconstruct/database_adapter.h"
#include "reconstruct/scale.h"

/* Appends every corner that two photographs or more agree on, triangulated, with an observation for each sighting; one that is
 * sharper than `feature_sigma_px` counts by its weight, up to four times.  `added`: observations.  NULL tags or distances: none. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_tags_append(tsuya_sparse_model *model, size_t *added, const tsuya_scale_input *tags, double feature_sigma_px);
/* Takes away the points whose id is above `points`, and each view's observations from observations[view] on. */
TSUYA_INTERNAL void tsuya_tags_strip(tsuya_sparse_model *model, uint64_t points, const int *observations);

/* Photographs of the database that the model lacks get a pose from the corners they show, where eight or more of two tags or more
 * are known from the model's own photographs and three quarters of them agree to two pixels.  New views have no observations. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_tags_place(tsuya_sparse_model *model, int *placed, const tsuya_database *database, const tsuya_scale_input *tags);

#endif
