/* Which weave a lattice of threads has.
 *
 * Each draft puts peaks where no other does (lattice.h): plain weave at the corners of the cell and nowhere else, a twill at the thirds or
 * quarters of one of its diagonals, a satin off both.  Points of two drafts may be neighbouring bins, so what counts is a peak whose place is
 * known to a fraction of a bin, and all the points that a draft has for itself must have theirs. */
#ifndef TSUYA_WEAVE_DETECT_KIND_H
#define TSUYA_WEAVE_DETECT_KIND_H

#include "weave_detect/lattice.h"

typedef struct tsuya_kind {
    tsuya_weave_kind kind; /* UNKNOWN where no draft's own peaks are seen, or more than one's */
    double diagonal_rad;   /* along the lines of a twill, in the image, counter-clockwise with y up, in [0, π); NaN else */
} tsuya_kind;

/* f: the threads' frequencies. */
tsuya_kind tsuya_kind_tell(const tsuya_spectrum *spectrum, const double f[2][2]);

#endif
