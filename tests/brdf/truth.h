/* Readings of truths that no fitted model contains: cloth of another model on the bench of the paper, and the measured woven fabric. */
#ifndef TSUYA_TESTS_BRDF_TRUTH_H
#define TSUYA_TESTS_BRDF_TRUTH_H

#include "brdf/material.h"
#include "brdf/samples.h"
#include "capture/irawan.h"
#include "capture/microcylinder.h"

#include <stdint.h>

typedef struct truth_cloth {
    void (*eval)(double value[3], const void *user, tsuya_vec3 wi, tsuya_vec3 wo);
    const void *user;
} truth_cloth;
truth_cloth truth_of_microcylinder(const tsuya_microcylinder *cloth);
truth_cloth truth_of_irawan(const tsuya_irawan *cloth);

/* The published weaves of Irawan and Marschner, NULL-terminated; coloured, the weft paler.  False where the data is absent. */
extern const char *const truth_weaves[];
bool truth_weave_load(tsuya_irawan *cloth, const char *name);

/* Lobes on one side only: a sign error would put them on the other. */
extern const tsuya_microcylinder truth_steep_twill;

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
void truth_read_cloth(tsuya_samples *samples, const truth_cloth *cloth, const truth_bench *bench);

/* The four azimuths every 3° that are fitted, and what is held out: tilts between, azimuths between, another geometry. */
typedef struct truth_set {
    tsuya_samples fit, tilts, azimuths, geometry;
} truth_set;
void truth_set_read(truth_set *set, const tsuya_microcylinder *cloth, double noise, uint64_t seed);
void truth_set_read_cloth(truth_set *set, const truth_cloth *cloth, double noise, uint64_t seed);
void truth_set_free(truth_set *set);

/* In-plane curves of the measured fabric, exits to 70°: incidences 0, 20, 40, 60° to fit, 10, 30, 50° held out.  False where the data is absent. */
bool truth_fabric_read(tsuya_samples *fit, tsuya_samples *held);
/* The samples whose light comes from that azimuth. */
void truth_at_azimuth(tsuya_samples *part, const tsuya_samples *samples, double phi_deg);

/* e_cbrt of a material; channel −1: all. */
double truth_error(const tsuya_material *material, const tsuya_samples *samples, int channel);

#endif
