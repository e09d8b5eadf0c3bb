/* Small dense symmetric matrices, row by row. */
#ifndef TSUYA_CORE_DENSE_H
#define TSUYA_CORE_DENSE_H

#include <stdbool.h>

/* a = L · Lᵀ in place, L in the lower triangle, the upper cleared; false where a is not positive definite (a pivot below
 * 1e-13 of its diagonal). */
bool tsuya_dense_cholesky(double *a, int n);
/* L⁻¹ · b and L⁻ᵀ · b in place; b is n × m. */
void tsuya_dense_forward(const double *l, double *b, int n, int m);
void tsuya_dense_backward(const double *l, double *b, int n, int m);
/* Eigenvalues and eigenvectors (columns of `vectors`) by cyclic Jacobi; `a` is used up. */
void tsuya_dense_eigen(double *a, double *values, double *vectors, int n);

#endif
