/* The dye under a surface part, and the table of the surface's directional albedo that it needs.
 *
 * With A(w) the surface part's directional albedo,
 *
 *     base(wi, wo) = r(wi) r(wo) / (π r̄),    r(w) = max(0, 1 − 1.003 A(w)),    r̄ the same mean of r
 *
 * (Kelemen & Szirmay-Kalos 2001, who have 1 − A): reciprocal, and the whole albedo is A + dye r ≤ 1 when A ≤ 1 and dye ≤ 1.  The
 * 0.003 are what the table of A may be off by.
 *
 * The table is bilinear over azimuth and polar angle in coordinates that need no trigonometry.  brdf/energy.h
 * fills it. */
#ifndef TSUYA_BRDF_DYE_H
#define TSUYA_BRDF_DYE_H

#include "brdf/model.h"

typedef struct tsuya_albedo_table {
    int side, channels;
    float *value;         /* (row * side + column) * channels + c */
    double *inverse_rest; /* 1 / (π r̄) per channel; 0 where nothing is left */
    float level_above;    /* of a table of factors: directions whose z is at least this have the value of the first node; ∞: none */
} tsuya_albedo_table;

/* A table of zeros. */
TSUYA_MUST_CHECK tsuya_status tsuya_albedo_table_create(tsuya_albedo_table **table, int side, int channels);
/* inverse_rest from the values. */
void tsuya_albedo_table_fill_mean(tsuya_albedo_table *table);
/* level_above, from the values of the first channel. */
void tsuya_limit_find_level(tsuya_albedo_table *limit);
/* value[c * count + k] *= s(wi) s(wo).  Cost: nearly none for directions that no factor but a common one holds. */
void tsuya_limit_batch(const tsuya_albedo_table *limit, int channels, const tsuya_direction_batch *batch, float *value);
void tsuya_albedo_table_free(tsuya_albedo_table *table);
size_t tsuya_albedo_table_bytes(const tsuya_albedo_table *table);

/* r for an albedo. */
static inline double tsuya_dye_rest(double albedo) { return fmax(0.0, 1.0 - 1.003 * albedo); }

/* A(w), `channels` values. */
void tsuya_albedo_table_eval(const tsuya_albedo_table *table, tsuya_vec3 w, double *value);
/* r(w) as planes rest[c * count + k]; 1 where w is not above the surface. */
void tsuya_dye_rest_batch(const tsuya_albedo_table *table, int count, const float *const w[3], float *rest);
/* Adds dye · base to value[c * count + k]. */
void tsuya_dye_add_batch(const tsuya_albedo_table *table, const double *dye, const tsuya_direction_batch *batch, float *value);

#endif
