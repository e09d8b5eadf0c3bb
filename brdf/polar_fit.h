/* Penalised least squares on the control net of a surface in polar form (brdf/sheen.h): periodic in φ, signed radius θ that passes
 * the pole smoothly, and θd where it has a third direction.  Serves S of ndf and nurbs3, and the surface of tanaka. */
#ifndef TSUYA_BRDF_POLAR_FIT_H
#define TSUYA_BRDF_POLAR_FIT_H

#include "brdf/sheen.h"

typedef struct tsuya_polar_options {
    double smooth_phi, smooth_theta, smooth_d; /* of ∫ of squared second derivatives */
    double shrink, level;                      /* of ∫ S², and of ∫ (∂S/∂θ)² */
} tsuya_polar_options;

/* Samples: places (φh, θh, θd of the angles), targets and weights (0: not used). */
typedef struct tsuya_polar_samples {
    int count;
    const tsuya_half_angles *angles;
    const double *target, *weight;
} tsuya_polar_samples;

/* control: tsuya_sheen_net_points(nu, nv, nd) numbers.  Cost: one rank-one update of 16 (64 with θd) unknowns a sample, then
 * one sparse Cholesky. */
TSUYA_MUST_CHECK tsuya_status tsuya_polar_fit(double *control, double *reciprocal_condition, int nu, int nv, int nd,
                                              const tsuya_polar_samples *samples, const tsuya_polar_options *options);

#endif
