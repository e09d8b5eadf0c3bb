/* B-spline basis functions and their derivatives.
 *
 * L. Piegl, W. Tiller, "The NURBS Book", 2nd ed. 1997, algorithms A2.1–A2.3, on a local window of knots, so that open and
 * periodic knot vectors share one evaluation and nothing is allocated. */
#ifndef TSUYA_BRDF_BASIS_H
#define TSUYA_BRDF_BASIS_H

#include <stdbool.h>

enum { TSUYA_BASIS_MAX_DEGREE = 7, TSUYA_BASIS_MAX_ORDER = TSUYA_BASIS_MAX_DEGREE + 1 };

/* `count` functions of a degree.  Open: count + degree + 1 knots, not decreasing; the domain is [knot[degree], knot[count]].
 * Periodic: count + 1 knots, strictly increasing, the last is the first plus the period; function k starts at knot[k]
 * and spans degree + 1 intervals, round the seam.  Borrowed. */
typedef struct tsuya_knots {
    int degree, count;
    bool periodic;
    const double *knot;
} tsuya_knots;

/* The interval of the domain that holds x (open: clamped into the domain, right end included in the last interval that is
 * not empty; periodic: wrapped).  `x` comes back clamped or wrapped. */
int tsuya_knots_span(const tsuya_knots *knots, double *x);

/* Writes the degree + 1 functions that do not vanish at x, and their derivatives up to `derivatives` (rows of degree + 1).
 * Returns the index of the first; function k of the row is (first + k) mod count. */
int tsuya_basis_eval(double *values, const tsuya_knots *knots, double x, int derivatives);

static inline double tsuya_knots_low(const tsuya_knots *k) { return k->periodic ? k->knot[0] : k->knot[k->degree]; }
static inline double tsuya_knots_high(const tsuya_knots *k) { return k->knot[k->count]; }
/* True where degree, count and order of the knots are as described, every function has a support, and no interior knot of an
 * open vector is repeated more than `degree` times. */
bool tsuya_knots_valid(const tsuya_knots *knots);

#endif
