/* Sparse symmetric positive definite systems (SuiteSparse CHOLMOD, simplicial, so that no result depends on threads). */
#ifndef TSUYA_BRDF_CHOLMOD_ADAPTER_H
#define TSUYA_BRDF_CHOLMOD_ADAPTER_H

#include "core/status.h"

/* A sum of entries: row i, column j, value; (i, j) and (j, i) are the same entry, given once or several times (they add up). */
typedef struct tsuya_sparse_sum {
    int size;          /* unknowns */
    size_t count, capacity;
    int *row, *column;
    double *value;
} tsuya_sparse_sum;

TSUYA_MUST_CHECK tsuya_status tsuya_sparse_add(tsuya_sparse_sum *sum, int i, int j, double value);
void tsuya_sparse_free(tsuya_sparse_sum *sum);

/* Solves A x = b for `sides` right-hand sides (column after column), in place in `b`.  `reciprocal_condition` (may be NULL):
 * CHOLMOD's estimate from the factor's diagonal.  TSUYA_ERROR_NUMERIC when A is not positive definite. */
TSUYA_MUST_CHECK tsuya_status tsuya_sparse_solve(double *b, int sides, const tsuya_sparse_sum *a, double *reciprocal_condition);

#endif
