/* The directional albedo of a surface part by quadrature, and the factors that keep it from reflecting more than it receives.
 *
 * The factors s(w) ≤ 1 solve, over the grid of brdf/albedo_grid.h,
 *
 *     s(w) ≤ 1,   s(w) ∫ f(w, w′) s(w′) cosθ′ dw′ ≤ 1,   and one of the two with equality
 *
 * so s(wi) f s(wo) is reciprocal, obeys energy, and is f wherever f does: Sinkhorn's scaling of a symmetric kernel with an
 * inequality (R. Sinkhorn, "A relationship between arbitrary positive matrices and doubly stochastic matrices", 1964).  A model
 * that is too bright by one factor is divided by that factor, not by its square. */
#ifndef TSUYA_BRDF_ENERGY_H
#define TSUYA_BRDF_ENERGY_H

#include "brdf/dye.h"

/* `limit` becomes NULL where the surface part nowhere exceeds what it receives, or says that it cannot (model->unbounded).  A
 * value beyond 1 that is left (of tanaka) is held at 1 in the table.  Cost: 2048 draws a node, in batches of float. */
TSUYA_MUST_CHECK tsuya_status tsuya_energy_tables_create(tsuya_albedo_table **albedo, tsuya_albedo_table **limit,
                                                         const tsuya_brdf_model *model, const void *state, int channels);

#endif
