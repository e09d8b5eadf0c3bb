/* Sums over the pixels of an edge: what its fit spends its time on. */
#ifndef TSUYA_CALIB_REFINE_KERNEL_H
#define TSUYA_CALIB_REFINE_KERNEL_H

#include "calib/refine_edge.h"

enum { TSUYA_EDGE_LANES = 8, TSUYA_EDGE_MOST_PIXELS = 8192 };

/* Pixels of the strip along an edge: place along it (−1 … 1), depth inside the tag in px, grey value, and the share of white that reaches
 * its black from elsewhere, by the blur and by the mask's wider one. */
typedef struct tsuya_edge_pixels {
    _Alignas(4 * TSUYA_EDGE_LANES) float u[TSUYA_EDGE_MOST_PIXELS], depth[TSUYA_EDGE_MOST_PIXELS], grey[TSUYA_EDGE_MOST_PIXELS],
        stray[TSUYA_EDGE_MOST_PIXELS], stray_wide[TSUYA_EDGE_MOST_PIXELS];
    int count;
} tsuya_edge_pixels;

/* JᵀJ (lower half), Jᵀr and r² of the profile in refine.h; the rows from the tone's on are 0 without `learn`.  Floats within a few
 * hundred pixels, doubles across them: Φ to 1e-7, which is nothing beside a pixel's noise.  The last lanes beyond `count` are written. */
typedef struct tsuya_edge_normal { double h[EDGE_PARAMETERS][EDGE_PARAMETERS], g[EDGE_PARAMETERS], squares; } tsuya_edge_normal;
void tsuya_edge_normal_sum(tsuya_edge_normal *n, const double p[EDGE_PARAMETERS], tsuya_edge_pixels *pixels, bool learn);

#endif
