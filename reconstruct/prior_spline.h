/* A smooth height over part of a picture, from scattered reliable pixels: uniform cubic B-splines whose coefficients'
 * differences of second, third or fourth order are held small (inside reconstruct/).
 *
 *   Eilers, Marx, "Flexible smoothing with B-splines and penalties", Statistical Science 11(2), 1996 */
#ifndef TSUYA_RECONSTRUCT_PRIOR_SPLINE_H
#define TSUYA_RECONSTRUCT_PRIOR_SPLINE_H

#include "core/memory.h"

typedef struct prior_spline {
    int columns, rows; /* of coefficients */
    double cell_px, left_px, top_px;
    double *coefficient;
} prior_spline;

typedef struct prior_sample { float x_px, y_px, value, weight; } prior_sample;

/* Over width × height pixels from (left, top); cells are enlarged until the spline has at most 1600 coefficients. */
TSUYA_MUST_CHECK tsuya_status tsuya_prior_spline_create(prior_spline *spline, int left_px, int top_px, int width_px, int height_px,
                                                        double cell_px);
void tsuya_prior_spline_free(prior_spline *spline);

/* Least squares over the samples, plus `stiffness` times the squares of the differences of `order` (2 to 4, rotationally
 * symmetric).  False where the system is singular: without samples. */
TSUYA_MUST_CHECK tsuya_status tsuya_prior_spline_fit(prior_spline *spline, bool *solved, const prior_sample *sample, size_t count,
                                                     int order, double stiffness);

/* Value, slopes a pixel, and how much the slopes turn a pixel in the direction where they turn most. */
typedef struct prior_place { double value, slope[2], bend; } prior_place;
prior_place tsuya_prior_spline_at(const prior_spline *spline, double x_px, double y_px);

#endif
