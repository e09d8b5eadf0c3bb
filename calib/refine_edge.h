/* One edge of a tag: the fit behind calib/refine.h. */
#ifndef TSUYA_CALIB_REFINE_EDGE_H
#define TSUYA_CALIB_REFINE_EDGE_H

#include "calib/refine.h"

/* f(u) = OFFSET + SLOPE u + BOW (u² − 1/3); light W = (WHITE + WHITE_SLOPE u)(1 + ARC (u² − 1/3)), K likewise; TONE is γ. */
enum { EDGE_OFFSET, EDGE_SLOPE, EDGE_BOW, EDGE_BLUR, EDGE_WHITE, EDGE_WHITE_SLOPE, EDGE_BLACK, EDGE_BLACK_SLOPE, EDGE_ARC, EDGE_TONE, EDGE_PARAMETERS };

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

/* White cells of a tag's code as the image shows them.  Cells lie at x, y from 0 (corner 0) to `cells`, x towards corner 1. */
enum { EDGE_MOST_CELLS = 16 };
typedef struct tsuya_edge_code {
    int cells, border;
    bool read;                 /* false: the rest is unknown */
    tsuya_mat3 cells_from_px;  /* homography */
    bool white[EDGE_MOST_CELLS][EDGE_MOST_CELLS]; /* [y][x] */
} tsuya_edge_code;

/* The frame of an edge between two corners; the tag lies to the inward side. */
void tsuya_edge_place(tsuya_edge *edge, tsuya_vec2 from, tsuya_vec2 to);
/* Point of the fitted curve at u, and its derivative by u. */
tsuya_vec2 tsuya_edge_point(const tsuya_edge *edge, double u, tsuya_vec2 *derivative);
/* Fits an edge of a quadrilateral whose edges are placed, between two others.  `inner_px`, `outer_px`: how far black and white reach.
 * `learn_tone`: tone_step and tone_variance are wanted. */
void tsuya_edge_fit(tsuya_edge *edge, const tsuya_image *grey, const tsuya_edge *before, const tsuya_edge *after, double inner_px,
                    double outer_px, const tsuya_edge_code *code, double tone, bool learn_tone);
/* Whether the code's cells are so small beside the blur that their light reaches the fit. */
bool tsuya_edge_is_narrow(double inner_px, double blur_px);

#endif
