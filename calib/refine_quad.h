/* The four edges of a tag together: parts of calib/refine.h. */
#ifndef TSUYA_CALIB_REFINE_QUAD_H
#define TSUYA_CALIB_REFINE_QUAD_H

#include "calib/refine_edge.h"

typedef struct tsuya_edge_quad { tsuya_edge edge[4]; tsuya_edge_code code; } tsuya_edge_quad;
typedef struct tsuya_edge_grid { int cells, border_bits; } tsuya_edge_grid; /* the tag's edge in code cells; the border of them */

void tsuya_edge_quad_start(tsuya_edge_quad *q, double blur_px);
/* Fits until the strips lie where the edges are and are as wide as the blur asks.  `learn`: as in tsuya_edge_fit. */
void tsuya_edge_quad_settle(tsuya_edge_quad *q, tsuya_vec2 corner[4], const tsuya_image *grey, const tsuya_edge_grid *grid, const tsuya_edge_look *look,
                            bool learn);
/* A corner of the fitted curves; false where an edge failed, and the corner is left as it was. */
bool tsuya_edge_quad_corner(tsuya_vec2 *corner, double *sigma_px, const tsuya_edge_quad *q, int i);
/* Its motion where edges move outwards by their blur: n·δ = s for both normals. */
tsuya_vec2 tsuya_edge_quad_spread(const tsuya_edge_quad *q, int i);

#endif
