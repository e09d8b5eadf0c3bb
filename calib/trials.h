/* Which lens: every candidate is solved, and held against the half of the photographs that it has not seen.
 *
 * The lenses of OPENCV's family come first, from the smallest up, until a larger one gains nothing.  The chosen one is tried again with plates
 * that may be bent; where these are taken, its neighbours are tried once more on the bent plates.  A splined lens is tried where the
 * photographs' residuals agree by place in the image, which is what a lens leaves that is too small for what it describes. */
#ifndef TSUYA_CALIB_TRIALS_H
#define TSUYA_CALIB_TRIALS_H

#include "calib/calibrate.h"

/* From the start in `calibration->solve` to the chosen solution there; fills trials, choice, reason, misfit, cross-validation maps and distance. */
TSUYA_MUST_CHECK tsuya_status tsuya_trials_run(tsuya_calibration *calibration, const tsuya_corner_set *corners, const tsuya_calibrate_options *options,
                                               const tsuya_context *context);

enum { TSUYA_CALIB_MAP_COLS = 41, TSUYA_CALIB_MAP_ROWS = 31, TSUYA_CALIB_FEWEST_CORNERS = 8, TSUYA_CALIB_FEWEST_FOR_HALVES = 6 };

/* A lens that took all of a larger misfit would lower the error by more than the two per cent that a larger one must gain. */
static const double TSUYA_CALIB_MISFIT_MOST = 0.04;

#endif
