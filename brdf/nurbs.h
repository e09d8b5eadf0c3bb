/* Rational B-spline curves and tensor surfaces: values, exact derivatives, knot insertion.
 *
 * Evaluation allocates nothing.  Control points are borrowed: point k of a curve at control[k * dimension], point (i, j) of a
 * surface at control[(i * v.count + j) * dimension].  `weight` NULL: polynomial. */
#ifndef TSUYA_BRDF_NURBS_H
#define TSUYA_BRDF_NURBS_H

#include "brdf/basis.h"
#include "core/status.h"

enum { TSUYA_NURBS_MAX_DIMENSION = 8 };

typedef struct tsuya_nurbs_curve {
    tsuya_knots u;
    int dimension;
    const double *control, *weight;
} tsuya_nurbs_curve;

typedef struct tsuya_nurbs_surface {
    tsuya_knots u, v;
    int dimension;
    const double *control, *weight;
} tsuya_nurbs_surface;

/* (derivatives + 1) × dimension numbers: the point, d/du, d²/du², … exact (quotient rule). */
void tsuya_nurbs_curve_eval(double *point, const tsuya_nurbs_curve *curve, double u, int derivatives);
/* du, dv may be NULL; `dimension` numbers each. */
void tsuya_nurbs_surface_eval(double *point, double *du, double *dv, const tsuya_nurbs_surface *surface, double u, double v);

/* The same curve with one knot more (Boehm 1980; in homogeneous coordinates where it is rational).  `knot` takes one number
 * more than the curve has, `control` count + 1 points, `weight` (NULL for a polynomial curve) as many.  Fails when u lies outside
 * the domain or the knot would be repeated more than degree times (periodic: at all). */
TSUYA_MUST_CHECK tsuya_status tsuya_nurbs_curve_insert(tsuya_nurbs_curve *refined, double *knot, double *control, double *weight,
                                                       const tsuya_nurbs_curve *curve, double u);
/* The same for a surface, across its first (`along_v` false) or second direction. */
TSUYA_MUST_CHECK tsuya_status tsuya_nurbs_surface_insert(tsuya_nurbs_surface *refined, double *knot, double *control, double *weight,
                                                         const tsuya_nurbs_surface *surface, bool along_v, double at);

#endif
