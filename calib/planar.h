/* Planes seen by a pinhole camera: homographies, focal length from them, pose from one. */
#ifndef TSUYA_CALIB_PLANAR_H
#define TSUYA_CALIB_PLANAR_H

#include "core/geometry.h"

/* image ~ h · (x, y, 1): least squares over n ≥ 4 pairs (direct linear transform, Hartley's normalisation).  False where the
 * points do not determine it. */
bool tsuya_homography_fit(tsuya_mat3 *h, const tsuya_vec2 *plane, const tsuya_vec2 *image, int n);
tsuya_vec2 tsuya_homography_apply(tsuya_mat3 h, tsuya_vec2 p);

/* Focal length that makes the planes' axes orthogonal and of one length (Zhang 2000, eq. 3–4, with square pixels and the
 * principal point given); weights: how well each homography is known.  `certainty`: how much the tilts determine it, 0 for
 * planes all seen frontally.  Returns 0 where no positive focal length does. */
double tsuya_homography_focal(double *certainty, const tsuya_mat3 *h, const double *weight, int n, double cx_px, double cy_px);

/* camera_from_plane of a homography, in front of the camera. */
bool tsuya_homography_pose(tsuya_pose *pose, tsuya_mat3 h, double focal_px, double cx_px, double cy_px);

#endif
