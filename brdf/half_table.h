/* Sampling of the half vector from a tabulated density over (φh, θh), mixed with a cosine lobe that keeps weights bounded.
 * A draw of h reflects wo into wi: pdf(wi) = p(h) / (4 wo·h). */
#ifndef TSUYA_BRDF_HALF_TABLE_H
#define TSUYA_BRDF_HALF_TABLE_H

#include "brdf/model.h"

typedef struct tsuya_half_table {
    int phi_cells, theta_cells;
    float *marginal;    /* cumulative over θh, theta_cells + 1 */
    float *conditional; /* cumulative over φh of each θh, theta_cells × (phi_cells + 1) */
    float *density;     /* over h, sr⁻¹, theta_cells × phi_cells */
    float *edge;        /* cosθh at the cells' edges, theta_cells + 1 */
} tsuya_half_table;

/* `density(user, h)` ≥ 0, up to a factor, for unit h above the surface. */
TSUYA_MUST_CHECK tsuya_status tsuya_half_table_create(tsuya_half_table **table, double (*density)(const void *user, tsuya_vec3 h),
                                                      const void *user);
void tsuya_half_table_free(tsuya_half_table *table);
size_t tsuya_half_table_bytes(const tsuya_half_table *table);
double tsuya_half_table_pdf(const tsuya_half_table *table, tsuya_vec3 wi, tsuya_vec3 wo);
/* h of a draw in [0, 1)². */
tsuya_vec3 tsuya_half_table_draw(const tsuya_half_table *table, const double u[2]);
bool tsuya_half_table_sample(const tsuya_half_table *table, tsuya_vec3 wo, const double u[2], tsuya_vec3 *wi);

/* The same for many viewers (brdf/model.h): first the cosine lobe's draws, which are wi, then the table's, which are h. */
void tsuya_half_table_shared_draws(const tsuya_half_table *table, int total, float *shared);
void tsuya_half_table_take_draws(const tsuya_half_table *table, tsuya_vec3 wo, const float *shared, int total, int from, int count,
                                 float *const wi[3], float *weight);

/* pdf and sample for many pairs (brdf/model.h). */
void tsuya_half_table_pdf_batch(const tsuya_half_table *table, const tsuya_direction_batch *batch, float *pdf);
void tsuya_half_table_sample_batch(const tsuya_half_table *table, int count, const float *const wo[3], const float *const u[2], float *const wi[3]);

enum { TSUYA_HALF_COSINE_TENTHS = 4 }; /* share of the cosine lobe */

#endif
