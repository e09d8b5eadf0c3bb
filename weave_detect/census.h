/* A garment is cut from few cloths: which thread counts its votes share. */
#ifndef TSUYA_WEAVE_DETECT_CENSUS_H
#define TSUYA_WEAVE_DETECT_CENSUS_H

#include "weave_detect/votes.h"

/* Votes whose pair of periods hardly any others have lose confidence: a print or an embroidery repeats too, and every photograph that sees it
 * agrees, but it does so with a count of its own.  A pair that holds a quarter as much surface as the commonest one, or more, is a cloth in its own
 * right, unless finer threads are seen through it: threads are the finest that repeats on a cloth, so that a lattice that far photographs take for
 * threads falls where close-ups know better.  `area`: of each vertex.  O(votes), the same result for any number of threads. */
TSUYA_MUST_CHECK tsuya_status tsuya_census_apply(tsuya_votes *votes, const float *area);

#endif
