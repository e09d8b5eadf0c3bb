/* What a lens leaves: residuals that the photographs agree on by place in the image. */
#ifndef TSUYA_CALIB_MISFIT_H
#define TSUYA_CALIB_MISFIT_H

#include "calib/solve.h"

/* Share of the residuals' variance (in their sigmas) that is common to a cell of the image over photographs; 0 where chance
 * would bring as much about.  Outliers count, cut to the length from which on they are.  Only products between photographs are counted, so
 * what a photograph errs as a whole does not show. */
TSUYA_MUST_CHECK tsuya_status tsuya_misfit(double *share, const tsuya_solve *solve);

#endif
