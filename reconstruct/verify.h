/* Which pairs of photographs share a geometry: COLMAP's verification, in parts at once, and a test against chance.
 *
 * COLMAP imports matches on one processor and draws its samples from one stream of random numbers: the pairs are dealt out to
 * a fixed number of databases, so that the result does not depend on the number of threads.
 *
 * A pair whose inliers chance explains (core/match_chance.h) is dropped; homographies bind both coordinates and pass as they are. */
#ifndef TSUYA_RECONSTRUCT_VERIFY_H
#define TSUYA_RECONSTRUCT_VERIFY_H

#include "reconstruct/colmap.h"
#include "reconstruct/database_adapter.h"

/* Writes the matches of `pair` (their `chance` filled in) to FOLDER/database.db and the verified geometries beside them.
 * *dropped: pairs that COLMAP verified and chance explains. */
TSUYA_MUST_CHECK tsuya_status tsuya_verify(tsuya_colmap *colmap, int *dropped, const tsuya_database *database, const tsuya_two_view *pair, int count);

#endif
