/* Fitting materials to samples. */
#ifndef TSUYA_BRDF_FIT_H
#define TSUYA_BRDF_FIT_H

#include "brdf/material.h"
#include "brdf/samples.h"
#include "core/context.h"

enum { TSUYA_FIT_MODELS = 10 };

typedef struct tsuya_fit_options {
    const char *name;  /* of the material */
    const char *model; /* a model's name, or "auto" */
    double tolerance;  /* auto: the cheapest model whose held-out e_cbrt is at most this; NaN: the one with the lowest
                       * product of its held-out errors, tilts counted twice */
} tsuya_fit_options;

typedef struct tsuya_fit_info {
    const char *model; /* static string */
    int samples;
    tsuya_brdf_error fit, heldout;             /* heldout: what the two below predicted, pooled */
    tsuya_brdf_error heldout_tilts, heldout_azimuth; /* NaN where the samples have too few to leave some out */
    double eval_ns; /* a direction, batched, all channels */
    size_t bytes;
    double reciprocity_deficit, furnace; /* see tsuya_material_physics */
    double seconds, reciprocal_condition; /* NaN where no linear system was solved */
} tsuya_fit_info;

/* Fits one model to all samples; its held-out errors come from fits to a part of them (every fifth tilt, a ring of half vectors,
 * left out; one azimuth left out).  Of more than 20000 samples, so many drawn at random are held out from and choose the model; all of
 * them fit it.  `candidates` (may be NULL, else TSUYA_FIT_MODELS entries)
 * receives every model that was tried and `candidate_count` their number.  Deterministic for any number of threads.  Fails on an
 * unknown model (naming the nearest), on fewer than 8 samples, and on samples without a single positive value. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_brdf_fit(tsuya_material **material, tsuya_fit_info *info, tsuya_fit_info *candidates,
                                                       int *candidate_count, const tsuya_samples *samples,
                                                       const tsuya_fit_options *options, const tsuya_context *context);

/* What another model makes of a material: fitted to 3000 values of its surface part over the whole hemisphere, under its dye.  A model with a
 * diffuse part of its own gets that as dye: `diffuse` (channel_count numbers) says how much, which belongs on top of any dye that a
 * caller gives in place of the material's own.  Cost: up to a second, and what tsuya_material_create takes. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_material_refit(tsuya_material **other, double *diffuse, const tsuya_material *material, const char *model);

/* Predictions of a material for the samples' directions, count × channel_count. */
TSUYA_API void tsuya_material_predict(double *predicted, const tsuya_material *material, const tsuya_samples *samples);
/* How far a material is from physics: Σ |f(wi, wo) − f(wo, wi)| cosθi cosθo over half the sum of both, for 4096 pairs of directions up
 * to 80° (0: reciprocal); and the largest directional albedo over 64 directions up to 80°, integrated from the BRDF (its own table
 * is held at 1).  Either may be NULL. */
TSUYA_API void tsuya_material_physics(double *reciprocity_deficit, double *furnace, const tsuya_material *material);
/* Nanoseconds a direction of batched evaluation, the best of several runs. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_material_time(double *ns, const tsuya_material *material);

/* Names that --model takes, NULL-terminated: "auto", then every model in the order of its cost. */
TSUYA_API const char *const *tsuya_fit_model_names(void);

#endif
