/* A symmetric positive definite block matrix as a list of entries, and its solution by CHOLMOD. */
#ifndef TSUYA_CAPTURE_CHOLMOD_ADAPTER_H
#define TSUYA_CAPTURE_CHOLMOD_ADAPTER_H

#include "core/status.h"

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

/* Entries of 3 × 3 blocks; each pair of vertices in one order only, entries of one place add up. */
typedef struct drape_matrix {
    int *row, *column;
    double *value;
    size_t count, room;
} drape_matrix;
TSUYA_MUST_CHECK tsuya_status tsuya_drape_matrix_reserve(drape_matrix *m, size_t more);
void tsuya_drape_matrix_free(drape_matrix *m);
/* k · a bᵀ-like block at vertices (i, j); of a diagonal block only the lower half is kept.  Room must be there (9). */
void tsuya_drape_matrix_add(drape_matrix *m, uint32_t i, uint32_t j, const double block[3][3]);

typedef struct drape_solver drape_solver;
/* The order of elimination comes from the graph of `pair` (may repeat) and serves every later matrix. */
TSUYA_MUST_CHECK tsuya_status tsuya_drape_solver_create(drape_solver **solver, size_t vertices, const uint32_t *pair, size_t pair_count);
void tsuya_drape_solver_free(drape_solver *solver);
/* x = m⁻¹ b, 3 × vertices; *definite tells whether it could be done. */
TSUYA_MUST_CHECK tsuya_status tsuya_drape_solver_solve(double *x, bool *definite, drape_solver *solver, const drape_matrix *m, const double *b);

#endif
