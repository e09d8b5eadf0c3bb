/* libmrcal's optimiser and CHOLMOD behind calib/solve.h. */
#ifndef TSUYA_CALIB_MRCAL_ADAPTER_H
#define TSUYA_CALIB_MRCAL_ADAPTER_H

#include "calib/solve.h"

typedef enum tsuya_mrcal_free {
    TSUYA_MRCAL_POSES,      /* poses alone */
    TSUYA_MRCAL_CORE,       /* focal lengths and centre, too */
    TSUYA_MRCAL_ALL,        /* distortions, too */
} tsuya_mrcal_free;

/* One call of mrcal_optimize from where the solve stands: camera and poses are moved, residuals and rms filled. */
TSUYA_MUST_CHECK tsuya_status tsuya_mrcal_optimize(tsuya_solve *solve, tsuya_mrcal_free what);

/* Covariance of the intrinsics that move (n × n, n = tsuya_lens_parameters − tsuya_lens_locked) and, where `pose` ≥ 0, of that view's pose (6 × 6: rotation
 * vector, translation), at the solution, for unit weights' variance 1.  Fails where the photographs do not determine them. */
TSUYA_MUST_CHECK tsuya_status tsuya_mrcal_covariance(double *intrinsics, double *pose, const tsuya_solve *solve, int view);

/* Adds what mrcal's regularisation of a splined lens holds its control points with to the normal equations of the intrinsics that move
 * (rows of `stride` numbers), and its slope downwards.  Nothing for other lenses. */
TSUYA_MUST_CHECK tsuya_status tsuya_mrcal_regularization(double *h, double *slope, int stride, const tsuya_solve *solve);

/* Pixel of a point and its gradients: by the point (2 × 3) and by the intrinsics (2 × n). */
bool tsuya_mrcal_project(tsuya_vec2 *pixel, double by_point[6], double *by_intrinsics, const tsuya_camera *camera, tsuya_vec3 p);

#endif
