/* Which pairs of photographs share a geometry: COLMAP's verification, in parts at once, and a test against chance.
 *
 * COLMAP imports matches on one processor and draws its samples from one stream of random numbers: the pairs are dealt out to
 * a fixed number of databases, so that the result does not depend on the number of threads.
 *
 * A pair whose inliers chance explains is dropped.  Cloth whose threads are all alike gives some hundred wrong matches, and the
 * best of many geometries always fits some dozens of them.  The number of geometries that would fit k of n wrong matches as well
 * as the one found,
 *
 *     NFA = (n − 7) C(n, k) C(k, 7) p^(k − 7),
 *
 * p the probability that one wrong match fits, must be small (Moisan & Stival, "A probabilistic criterion to detect rigid point
 * matches between two images and estimate the fundamental matrix", IJCV 57, 2004, eq. 5).  Homographies bind both coordinates and
 * pass as they are. */
#ifndef TSUYA_RECONSTRUCT_VERIFY_H
#define TSUYA_RECONSTRUCT_VERIFY_H

#include "reconstruct/colmap.h"
#include "reconstruct/database_adapter.h"

/* Decadic logarithm of NFA; 0 where inliers < 8.  `chance`: p, in (0, 1]. */
double tsuya_verify_false_alarms(int matches, int inliers, double chance);
/* p for features of the second photograph: the share of their bounding box within `off_px` of a line through it, at most 1. */
double tsuya_verify_chance(const tsuya_sift *features, double off_px);

/* Writes the matches of `pair` (their `chance` filled in) to FOLDER/database.db and the verified geometries beside them.
 * *dropped: pairs that COLMAP verified and chance explains. */
TSUYA_MUST_CHECK tsuya_status tsuya_verify(tsuya_colmap *colmap, int *dropped, const tsuya_database *database, const tsuya_two_view *pair, int count);

#endif
