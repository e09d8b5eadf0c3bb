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
/* Where a fit stands: middle + to_lamp / inverse_m. */
typedef struct tsuya_lamp_place {
    tsuya_vec3 middle, to_lamp;
    double inverse_m;
} tsuya_lamp_place;
/* Rows of the highlights (two each, over sigma_px) and of the balls' shifts (two each, over what they were measured to). */
void tsuya_lamp_ball_rows(double *row, const tsuya_lamp_balls *balls, const tsuya_lamp_place *place, const double *shift_m, double sigma_px);
/* Scatter of the highlights from their residuals, where there are enough of them; else as it was. */
double tsuya_lamp_ball_sigma(const tsuya_lamp_balls *balls, const tsuya_lamp_place *place, const double *shift_m, double sigma_px);
/* The highlights' residuals; the balls go where they fit. */
void tsuya_lamp_ball_settle(tsuya_lamp *lamp, tsuya_lamp_balls *balls, const tsuya_lamp_place *place, const double *shift_m);
/* Unit direction in which the ball, where it was measured, mirrors the highlight's ray; 0 where the ray is none. */
tsuya_vec3 tsuya_lamp_ball_mirrored(const tsuya_lamp_balls *balls, const tsuya_lamp_highlight *highlight);
/* Pixel of the highlight less where it would be; false where that is not in the camera's view. */
bool tsuya_lamp_ball_miss(double e[2], const tsuya_lamp_balls *balls, const tsuya_lamp_highlight *highlight, const tsuya_lamp_place *place, const double *shift_m);
double tsuya_lamp_median(double *values, int n); /* sorts; NaN without any */

#endif
