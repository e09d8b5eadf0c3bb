/* Which stage angles to measure next.
 *
 * About a predicted material the cube root of f·cosθi is linear in small changes of its logarithm.  These are taken as Gaussian: for
 * each yarn, weighted by its part of the light there, a change along it as a smoothing spline expects it, a smooth one across it and one of
 * its strength; and a smooth change over the half vector, and over the light's difference at the same half vector, that belongs to no yarn.  Readings then shrink the covariance by a known amount whatever they will show, and
 * those are chosen, one after the other, that lower the expected squared error over all positions of the bench most (Bayesian
 * I-optimal design; Chaloner & Verdinelli, "Bayesian experimental design: a review", Statistical Science 10(3), 1995). */
#ifndef TSUYA_BRDF_PLAN_H
#define TSUYA_BRDF_PLAN_H

#include "brdf/material.h"
#include "brdf/samples.h"

typedef struct tsuya_plan_options {
    double light_deg[2], view_deg[2]; /* polar angle and azimuth in the lab */
    double azimuth_step_deg, tilt_step_deg, tilt_most_deg; /* positions that the stage can take */
    double noise;                     /* relative, of one reading */
    int readings;
} tsuya_plan_options;
/* Lamp 30, 0; camera 30, 180; azimuths every 7.5° below 180°, tilts every 1.5° to ±48°; 1 % noise; 132 readings */
TSUYA_API tsuya_plan_options tsuya_plan_options_default(void);

typedef struct tsuya_plan_reading {
    double azimuth_deg, tilt_deg;
    double gain; /* by which the expected error falls with this reading, given those chosen before it */
} tsuya_plan_reading;

typedef struct tsuya_plan_info {
    int positions;                     /* that the stage can take with lamp and camera above 10° */
    double expected_before, expected_after; /* e_cbrt over all positions */
} tsuya_plan_info;

/* `chosen`: options->readings entries, in the order of the choice.  `taken` (may be NULL): readings so far.  Cost: positions² a reading.
 * Fails when the bench has no positions or fewer than readings are wanted. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_plan(tsuya_plan_reading *chosen, tsuya_plan_info *info, const tsuya_material *predicted,
                                                   const tsuya_samples *taken, const tsuya_plan_options *options);

#endif
