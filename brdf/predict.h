/* Reflectance from the fibre's cross-section and the weave (the paper's section 3.1): distribution of facet normals = normals of the section,
 * across the yarn, times the yarn's path over and under, along it.
 *
 * Facets of a yarn whose tangent rises by α and whose section's normal leans by ζ point to n = cosζ (normal turned by α) + sinζ
 * (across), so their inclination along the yarn is exactly −α, across it nearly ζ, and dω = cosζ dα dζ:
 *     D(n) = share · p(α) p(ζ) / cosζ, scaled so that ∫ D cosθ dω = share.
 * That is the model `yarn` with curves log p(α) and log p(ζ)/cosζ; its strength is the dielectric's Fresnel reflectance at 30°. */
#ifndef TSUYA_BRDF_PREDICT_H
#define TSUYA_BRDF_PREDICT_H

#include "brdf/material.h"
#include "brdf/samples.h"
#include "brdf/weave_draft.h"

typedef struct tsuya_predict_yarn {
    const char *section;   /* one of tsuya_predict_sections() */
    double crimp_deg;      /* steepest tangent of the path, where the yarn dives under the others */
    double along_deg;      /* spread of fibres' directions along the yarn, standard deviation */
    double turn_deg;       /* spread of the section's turn about the fibre, standard deviation: more where
                            * filaments do not all lie on the same side, or a twist turns them along a float */
    double eta;            /* refractive index */
    double metal[3];       /* mirror reflectance of a metal's surface; 0: dielectric */
} tsuya_predict_yarn;

typedef struct tsuya_predict_options {
    const char *name;
    tsuya_predict_yarn warp, weft;
    double dye[3]; /* under the surface */
} tsuya_predict_options;
/* triangle, 30°, 4°, 10°, 1.54; dye 0 */
TSUYA_API tsuya_predict_options tsuya_predict_options_default(void);

/* NULL-terminated: circle ellipse triangle rounded-triangle trilobal hollow ribbon */
TSUYA_API const char *const *tsuya_predict_sections(void);

/* Density over the inclination ψ = −90 … 90 in steps of half a degree, integral 1: of the section's normals (into the air above), and
 * of the path of warp or weft where it lies on the face. */
enum { TSUYA_PREDICT_BINS = 361 };
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_predict_across(double density[TSUYA_PREDICT_BINS], const tsuya_predict_yarn *yarn);
/* `share`: of the face that these yarns cover. */
TSUYA_API void tsuya_predict_along(double density[TSUYA_PREDICT_BINS], double *share, const tsuya_draft *draft, bool warp, const tsuya_predict_yarn *yarn);

TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_predict(tsuya_material **material, const tsuya_draft *draft, const tsuya_predict_options *options);

/* A prediction held against readings of three channels.  It knows neither how much of the light the yarns' surfaces get to see nor what has been
 * in the fibres and comes out again in every direction: one factor and a level a channel are fitted, to cube roots. */
typedef struct tsuya_predict_match {
    double scale, body[3];                 /* readings ≈ scale · f + body/π */
    double error_cbrt;
    double scale_without_body, error_without_body; /* the factor alone: the paper's case, a black cloth */
    double error_body_alone;                       /* of a cloth that is dull, which the prediction has to beat: where it does not, scale is 0 */
} tsuya_predict_match;
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_predict_hold_against(tsuya_predict_match *match, const tsuya_material *material, const tsuya_samples *samples);

#endif
