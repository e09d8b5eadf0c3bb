/* How far the edges of all tags lie outside where they are, as a wrong tone curve, sharpening in the camera or ink move them alike: in blur
 * widths, from the photographs alone.
 *
 * A tag's size tells where its neighbour on the plate must be (the homography of its four corners); edges that lie outside make it too
 * large and put the neighbour too far, while the neighbour's middle stays.  Each pair of neighbours is asked both ways, which cancels
 * what a lens bends in between.  Least squares on the bias, pairs beyond 3.5 robust sigmas left out. */
#ifndef TSUYA_CALIB_EDGE_BIAS_H
#define TSUYA_CALIB_EDGE_BIAS_H

#include "calib/board.h"
#include "calib/corners.h"

typedef struct tsuya_edge_bias {
    double bias, sigma; /* blur widths; outwards is positive.  sigma is infinite where nothing tells */
    int pairs;          /* that were used */
} tsuya_edge_bias;
/* `corners` in their order (tsuya_corner_set_sort), with their spread. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_edge_bias_measure(tsuya_edge_bias *bias, const tsuya_corner_set *corners, const tsuya_board *board);
/* Moves every corner back by so many blur widths. */
TSUYA_API void tsuya_edge_bias_remove(tsuya_corner_set *corners, double bias);

#endif
