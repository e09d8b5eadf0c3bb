/* Readings of a truth that no fitted model contains: microcylinder cloth on the bench of the paper. */
#ifndef TSUYA_TESTS_BRDF_TRUTH_H
#define TSUYA_TESTS_BRDF_TRUTH_H

#include "brdf/samples.h"
#include "capture/microcylinder.h"

#include <stdint.h>

typedef struct truth_bench {
    double light_deg, view_deg; /* polar angles, the light at azimuth 0, the camera at 180° */
    const double *azimuth_deg;
    int azimuths;
    double first_tilt_deg, last_tilt_deg, step_deg;
    double noise; /* relative, standard deviation */
    uint64_t seed;
} truth_bench;

/* Readings with both directions above 80° from the horizon's side are left out. */
void truth_read(tsuya_samples *samples, const tsuya_microcylinder *cloth, const truth_bench *bench);

/* The four azimuths every 3° that are fitted, and what is held out: tilts between, azimuths between, another geometry. */
typedef struct truth_set {
    tsuya_samples fit, tilts, azimuths, geometry;
} truth_set;
void truth_set_read(truth_set *set, const tsuya_microcylinder *cloth, double noise, uint64_t seed);
void truth_set_free(truth_set *set);

#endif
