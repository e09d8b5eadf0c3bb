/* Pairs that thumbnails cannot see: a detail and the whole it is of.
 *
 * A photograph of a hand's breadth of cloth looks like no photograph of the garment, but what is large in it is what is small in the
 * other.  Photographs that hang together with the largest part by no sure pair are compared by a digest, the largest features of
 * the one against all of the other, and are paired with those where most match. */
#ifndef TSUYA_RECONSTRUCT_DIGEST_H
#define TSUYA_RECONSTRUCT_DIGEST_H

#include "reconstruct/pairs.h"

/* `base`: the database with the features; `database`: what is verified so far.  Costs a digest's matching (some ms) for each photograph
 * outside the largest part and each that it does not hang together with; nothing where all hang together. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_digest_pairs(tsuya_pairs *pairs, int *added, const tsuya_database *database, const char *base,
                                                                const tsuya_photo_set *photos, const tsuya_context *context);

#endif
