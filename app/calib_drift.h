/* Has the camera drifted?  The difference of two calibrations against what each says of its own uncertainty, place by place. */
#ifndef TSUYA_APP_CALIB_DRIFT_H
#define TSUYA_APP_CALIB_DRIFT_H

#include "calib/calibrate.h"
#include "core/json.h"

/* vnlog `# x_px y_px sigma_px sigma_infinity_px`, a row for each place where boards were seen. */
TSUYA_MUST_CHECK tsuya_status tsuya_calib_uncertainty_save(const tsuya_calibration *calibration, const char *path);

/* `map`: the difference of both cameras, covered where it is to be judged.  Adds uncertainty_px (root mean square over the places of both
 * sigmas together), difference_over_uncertainty (root mean square of the ratio) and drift: yes where that exceeds three; "unknown: …" where
 * no uncertainty.vnl lies beside both models, or where they have no place in common.  At a finite distance the sigmas of the boards' own
 * distance are taken. */
TSUYA_MUST_CHECK tsuya_status tsuya_calib_drift(tsuya_json *figures, const tsuya_projection_map *map, const char *const model[2],
                                                const tsuya_camera camera[2], double distance_m);

#endif
