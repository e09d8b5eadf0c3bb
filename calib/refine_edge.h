/* One edge of a tag: the fit behind calib/refine.h. */
#ifndef TSUYA_CALIB_REFINE_EDGE_H
#define TSUYA_CALIB_REFINE_EDGE_H

#include "calib/refine.h"

/* f(u) = OFFSET + SLOPE u + BOW (u² − 1/3); light W = (WHITE + WHITE_SLOPE u)(1 + ARC (u² − 1/3)), K likewise; TONE is γ, SHARPENING c.  Up to
 * TONE they are the edge's own. */
enum { EDGE_OFFSET, EDGE_SLOPE, EDGE_BOW, EDGE_BLUR, EDGE_WHITE, EDGE_WHITE_SLOPE, EDGE_BLACK, EDGE_BLACK_SLOPE, EDGE_ARC, EDGE_TONE, EDGE_SHARPENING, EDGE_PARAMETERS };

typedef struct tsuya_edge {
    tsuya_vec2 middle, tangent, inward; /* unit vectors */
    double half_length_px;
    double p[EDGE_PARAMETERS];
    double covariance[3][3];  /* of offset, slope, bow */
    double look_pull[2], look_information[2][2]; /* normal equations of γ and the sharpening, the rest eliminated; 0: it says nothing */
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

/* The unsharp mask takes off what a blur of this much more leaves. */
static const double EDGE_MASK_PX = 1.0;
static inline double tsuya_edge_wide(double blur_px) { return sqrt(blur_px * blur_px + EDGE_MASK_PX * EDGE_MASK_PX); }

/* The tone curve's a, for each unit of γ above 1. */
static const double EDGE_TONE_LIFT = 0.055 / 1.4;
static inline double tsuya_edge_value(double light, double gamma)
{
    const double lift = EDGE_TONE_LIFT * (gamma - 1.0);
    return (1.0 + lift) * pow(light, 1.0 / gamma) - lift;
}
/* Of what is darker than the curve's end: as there. */
static inline double tsuya_edge_light(double value, double gamma)
{
    const double lift = EDGE_TONE_LIFT * (gamma - 1.0);
    return pow(fmax((value + lift) / (1.0 + lift), 0.0), gamma);
}

/* The frame of an edge between two corners; the tag lies to the inward side. */
void tsuya_edge_place(tsuya_edge *edge, tsuya_vec2 from, tsuya_vec2 to);
/* Point of the fitted curve at u, and its derivative by u. */
tsuya_vec2 tsuya_edge_point(const tsuya_edge *edge, double u, tsuya_vec2 *derivative);
/* Fits an edge of a quadrilateral whose edges are placed, between two others.  `inner_px`, `outer_px`: how far black and white reach.
 * `learn`: look_pull and look_information are wanted. */
void tsuya_edge_fit(tsuya_edge *edge, const tsuya_image *grey, const tsuya_edge *before, const tsuya_edge *after, double inner_px,
                    double outer_px, const tsuya_edge_code *code, const tsuya_edge_look *look, bool learn);
/* Of a Gaussian edge as steep as this one in its middle. */
double tsuya_edge_blur(const tsuya_edge *edge);
/* Whether the code's cells are so small beside the blur that their light reaches the fit. */
bool tsuya_edge_is_narrow(double inner_px, double blur_px);

#endif
