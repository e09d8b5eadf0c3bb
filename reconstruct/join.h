/* Groups of photographs that share no features, joined by the tags that both show.
 *
 * A garment on a rack has a front and a back that no photograph shows together, and the mapper makes two models of it.  The corners of
 * the mat, triangulated in both, give the similarity between them (Umeyama 1991), a quarter of them left out at most; the adjustment
 * that follows has the corners as points in common and does the rest. */
#ifndef TSUYA_RECONSTRUCT_JOIN_H
#define TSUYA_RECONSTRUCT_JOIN_H

#include "reconstruct/scale.h"

/* Moves the views and points of `other` into `model`'s frame and into `model`; a view that both have stays as `model` has it.  `joined`:
 * views that came.  0, and both as they were, where fewer than eight corners of two tags are known in both, where they do not agree to
 * two pixels in three quarters of the sightings, without tags, and with several lenses.  Points are numbered anew from 1. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_models_join(tsuya_sparse_model *model, int *joined, tsuya_sparse_model *other,
                                                               const tsuya_scale_input *tags);

#endif
