/* Fitting of the cloth's own model (brdf/sheen.h). */
#ifndef TSUYA_BRDF_SHEEN_FIT_H
#define TSUYA_BRDF_SHEEN_FIT_H

#include "brdf/polar_fit.h"
#include "brdf/samples.h"
#include "brdf/sheen.h"

/* Samples as the fit sees them: only finite values, ∛(f cosθi), scaled so that the largest f is 1. */
typedef struct tsuya_fit_data {
    int count, channels;
    tsuya_half_angles *angles;
    double *cosine; /* cosθi */
    double *value;  /* count × channels, scaled; NaN: not usable */
    double *root;   /* ∛(f cosθi) of the scaled value */
    double scale;   /* f = scale · value */
    double root_sum; /* Σ root² */
    bool relative;   /* values are a reflectance up to a factor */
} tsuya_fit_data;

TSUYA_MUST_CHECK tsuya_status tsuya_fit_data_create(tsuya_fit_data *data, const tsuya_samples *samples);
void tsuya_fit_data_free(tsuya_fit_data *data);

typedef struct tsuya_sheen_guide_options {
    int spans;                          /* intervals of each curve over 180° */
    double smooth_along, smooth_across; /* of ∫ (a″)² along a yarn (where the search starts) and ∫ (a‴)² across it, of data with Σ root² = 1 */
    int iterations, rounds;             /* steps of one descent; re-estimations of the smoothing */
} tsuya_sheen_guide_options;
tsuya_sheen_guide_options tsuya_sheen_guide_options_default(void);

tsuya_polar_options tsuya_sheen_surface_options_default(void);

/* The fibres' refractive index, and how far it is trusted beyond the difference angles of `data`. */
void tsuya_sheen_set_fresnel(tsuya_sheen *sheen, const tsuya_fit_data *data);
/* How much of the fitted yarns is their surface. */
void tsuya_sheen_find_gloss(tsuya_sheen *sheen, const tsuya_fit_data *data);

/* The two yarns to `data`, Levenberg–Marquardt on differences of ∛(f cosθi); from the best of several starts. */
TSUYA_MUST_CHECK tsuya_status tsuya_sheen_fit_guide(tsuya_sheen *sheen, double *error, const tsuya_fit_data *data,
                                                    const tsuya_sheen_guide_options *options);
/* S over a fitted guide: penalised linear least squares of the logarithm of what is left, weighted as ∛ would. */
TSUYA_MUST_CHECK tsuya_status tsuya_sheen_fit_surface(tsuya_sheen *sheen, double *reciprocal_condition, const tsuya_fit_data *data,
                                                      const tsuya_polar_options *options);

/* tsuya_sheen_separate, with lines and layers weighted by the readings that touch them. */
TSUYA_MUST_CHECK tsuya_status tsuya_sheen_separate_by(tsuya_sheen *sheen, const tsuya_fit_data *data);

#endif
