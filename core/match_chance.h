/* Do two photographs share a geometry, or does chance explain the matches that fit one?
 *
 * Cloth whose threads are all alike gives some hundred wrong matches, and the best of many geometries always fits some dozens of them.  The
 * number of geometries that would fit k of n wrong matches as well as the one found,
 *
 *     NFA = (n − 7) C(n, k) C(k, 7) p^(k − 7),
 *
 * p the probability that one wrong match fits, must be small (Moisan & Stival, "A probabilistic criterion to detect rigid point
 * matches between two images and estimate the fundamental matrix", IJCV 57, 2004, eq. 5). */
#ifndef TSUYA_CORE_MATCH_CHANCE_H
#define TSUYA_CORE_MATCH_CHANCE_H

#include "core/matching.h"

/* Decades: a thousand pairs, a false one in a thousand sets. */
static const double TSUYA_MATCH_MOST_FALSE_ALARMS = -6.0;
/* Decadic logarithm of NFA; 0 where inliers < 8.  `chance`: p, in (0, 1]. */
TSUYA_INTERNAL double tsuya_match_false_alarms(int matches, int inliers, double chance);
/* p for features of the second photograph: the share of their bounding box within `off_px` of a line through it, at most 1. */
TSUYA_INTERNAL double tsuya_match_chance(const tsuya_sift *features, double off_px);

#endif
