/* The dye under a surface part, and the table of the surface's directional albedo that it needs.
 *
 * With A(w) the surface part's directional albedo and Ā its cosine-weighted mean over the hemisphere,
 *
 *     base(wi, wo) = (1 − A(wi)) (1 − A(wo)) / (π (1 − Ā))
 *
 * (Kelemen & Szirmay-Kalos 2001): reciprocal, and the whole albedo is A + dye (1 − A) ≤ 1 when A ≤ 1 and dye ≤ 1.
 *
 * The table is bilinear over azimuth and polar angle in coordinates that need no trigonometry.  Where the model's A exceeds
 * 1 it is held at 1. */
#ifndef TSUYA_BRDF_DYE_H
#define TSUYA_BRDF_DYE_H

#include "brdf/model.h"

typedef struct tsuya_albedo_table {
    int side, channels;
    float *value;         /* (row * side + column) * channels + c */
    double *inverse_rest; /* 1 / (π (1 − Ā)) per channel; 0 where nothing is left */
    double *mean;         /* Ā per channel */
} tsuya_albedo_table;

/* `limit`: factors of both directions that the surface part is taken with; may be NULL.  `highest` (may be NULL): the largest
 * albedo before it was held at 1. */
TSUYA_MUST_CHECK tsuya_status tsuya_albedo_table_create(tsuya_albedo_table **table, double *highest, const tsuya_brdf_model *model,
                                                        const void *state, int channels, const tsuya_albedo_table *limit);
/* Factors s(w) ≤ 1 of one channel with which s(wi) f s(wo) reflects at most what it receives: 1 / max(1, A(w)) of a model whose
 * largest albedo over the channels is A.  Reciprocal, since both directions get theirs. */
TSUYA_MUST_CHECK tsuya_status tsuya_limit_table_create(tsuya_albedo_table **limit, const tsuya_brdf_model *model, const void *state,
                                                       int channels);
/* value[c * count + k] *= s(wi) s(wo) */
void tsuya_limit_batch(const tsuya_albedo_table *limit, int channels, const tsuya_direction_batch *batch, float *value);
void tsuya_albedo_table_free(tsuya_albedo_table *table);
size_t tsuya_albedo_table_bytes(const tsuya_albedo_table *table);

/* A(w), `channels` values. */
void tsuya_albedo_table_eval(const tsuya_albedo_table *table, tsuya_vec3 w, double *value);
/* Adds dye · base to value[c * count + k]. */
void tsuya_dye_add_batch(const tsuya_albedo_table *table, const double *dye, const tsuya_direction_batch *batch, float *value);

#endif
