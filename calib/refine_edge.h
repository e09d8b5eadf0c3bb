/* One edge of a tag: the fit behind calib/refine.h. */
#ifndef TSUYA_CALIB_REFINE_EDGE_H
#define TSUYA_CALIB_REFINE_EDGE_H

#include "calib/refine.h"

/* f(u) = OFFSET + SLOPE u + BOW (u² − 1/3); light W = WHITE + WHITE_SLOPE u, K likewise; TONE is γ. */
enum { EDGE_OFFSET, EDGE_SLOPE, EDGE_BOW, EDGE_BLUR, EDGE_WHITE, EDGE_WHITE_SLOPE, EDGE_BLACK, EDGE_BLACK_SLOPE, EDGE_TONE, EDGE_PARAMETERS };

typedef struct tsuya_edge {
    tsuya_vec2 middle, tangent, inward; /* unit vectors */
    double half_length_px;
    double p[EDGE_PARAMETERS];
    double covariance[3][3];  /* of offset, slope, bow */
    double tone_step, tone_variance; /* what a joint step would add to the tone, and that step's variance */
    double residual;          /* rms, 1 = full scale */
    int pixels;
    tsuya_refine_reason reason;
} tsuya_edge;

/* The frame of an edge between two corners; the tag lies to the inward side. */
void tsuya_edge_place(tsuya_edge *edge, tsuya_vec2 from, tsuya_vec2 to);
/* Point of the fitted curve at u, and its derivative by u. */
tsuya_vec2 tsuya_edge_point(const tsuya_edge *edge, double u, tsuya_vec2 *derivative);
/* Fits edge number `i` of a quadrilateral whose edges are placed.  `inner_px`, `outer_px`: how far black and white reach.  `learn_tone`:
 * tone_step and tone_variance are wanted. */
void tsuya_edge_fit(tsuya_edge *edge, const tsuya_image *grey, const tsuya_edge *before, const tsuya_edge *after, double inner_px,
                    double outer_px, double tone, bool learn_tone);

#endif
