/* Smooths directions of n-fold symmetry over a mesh. */
#ifndef TSUYA_WEAVE_DETECT_SMOOTH_H
#define TSUYA_WEAVE_DETECT_SMOOTH_H

#include "core/context.h"
#include "weave_detect/mesh_graph.h"

typedef struct tsuya_complex { double re, im; } tsuya_complex;

/* Minimises  Σ_edges w |z_v − e^{i n turn} z_u|² + Σ_vertices pull |z_v − target_v|²  (n = fold: 2 for lines, 4 for crosses) by
 * conjugate gradients with a Jacobi preconditioner.  `edge_scale`, one a graph entry, may be NULL (all 1); it must fit both ways.
 * `z` holds a start and gets the result.  One thread, so solves may run side by side.  Stops at a relative
 * residual of 1e-5 or after 400 steps. */
TSUYA_MUST_CHECK tsuya_status tsuya_smooth_directions(tsuya_complex *z, const tsuya_complex *target, const double *pull,
                                                      const float *edge_scale, int fold, const tsuya_mesh_graph *graph,
                                                      const tsuya_context *context);

#endif
