/* How well a calibration knows its camera and its poses.
 *
 * The solve's normal equations give a covariance that holds where corners err independently.  Real corners do not: motion,
 * rolling shutter and bent paper move all corners of a photograph together, and a tag that is printed or glued a little wrong
 * errs in every photograph.  So the covariance is also measured, from how the parts of the data pull at the camera ("clusters";
 * sandwich estimator, Liang & Zeger 1986; leverage as in Bell & McCaffrey 2002, "CR2"; two ways at once as in Cameron, Gelbach
 * & Miller 2011): by photograph, and by tag.  Where corners err independently both agree.
 *
 * Of a splined lens, which has more control points than there are photographs, scatter is told from independence in smooth motions of
 * the control points alone; the others get its size.
 *
 * Poses are eliminated view by view; what is left are the intrinsics, the edges' bias and the plates' shapes, which the solve
 * estimates too. */
#ifndef TSUYA_CALIB_COVARIANCE_H
#define TSUYA_CALIB_COVARIANCE_H

#include "calib/solve.h"

typedef struct tsuya_covariance {
    int n;                     /* intrinsics */
    double *intrinsics;        /* n × n, zero where a lens keeps them (tsuya_lens_locked); owned */
    double *pose;              /* 6 × 6 a view: rotation vector (rad, in the camera's frame), translation (m); owned */
    double photo_factor;       /* sigma as photographs scatter over sigma as corners alone would have it, over all directions */
    double tag_factor;         /* what tags add to that, likewise (0: nothing that is told from chance) */
} tsuya_covariance;

/* Newton's step of what is neither camera nor pose, and moves in step with both: the edges' bias, then each plate's shape (calib/shape.h:
 * growth, bends).  `determined` false, and no step, where the photographs do not determine the camera. */
TSUYA_MUST_CHECK tsuya_status tsuya_covariance_step(double *step, bool *determined, const tsuya_solve *solve);

/* `clusters` false: independent corners are taken for granted.  Fails where the photographs do not determine the camera. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_covariance_estimate(tsuya_covariance *covariance, const tsuya_solve *solve, bool clusters);
TSUYA_API void tsuya_covariance_free(tsuya_covariance *covariance);

#endif
