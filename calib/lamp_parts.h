/* What the parts of the lamp's fit share. */
#ifndef TSUYA_CALIB_LAMP_PARTS_H
#define TSUYA_CALIB_LAMP_PARTS_H

#include "calib/lamp.h"

/* Damped least squares with numerical derivatives.  Rows come weighted; a step moves the state by n numbers. */
typedef struct tsuya_lamp_problem {
    void *state;
    size_t state_bytes;
    int n, rows;
    void (*residuals)(double *rows, const void *state);
    void (*move)(void *state, const double *step);
    const double *nudge; /* of the derivatives, one a number */
} tsuya_lamp_problem;
/* Down to where nothing moves, `steps` at most; *cost: the sum of squares. */
TSUYA_MUST_CHECK tsuya_status tsuya_lamp_descend(double *cost, const tsuya_lamp_problem *problem, int steps);
/* Inverse of JᵀJ at the state, n × n; fails where it is singular. */
TSUYA_MUST_CHECK tsuya_status tsuya_lamp_covariance(double *covariance, const tsuya_lamp_problem *problem);
/* Two unit vectors that stand on a unit vector and on each other. */
void tsuya_lamp_tangents(tsuya_vec3 t[2], tsuya_vec3 n);
/* A unit vector turned by (a, b) radians along its tangents. */
tsuya_vec3 tsuya_lamp_turn(tsuya_vec3 u, double a, double b);
double tsuya_lamp_median(double *values, int n); /* sorts; NaN without any */

#endif
