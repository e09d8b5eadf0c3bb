/* OpenCV's finder of 24-patch colour charts (module mcc). */
#ifndef TSUYA_CALIB_OPENCV_ADAPTER_H
#define TSUYA_CALIB_OPENCV_ADAPTER_H

#include "core/geometry.h"
#include "core/image.h"

#include <stdbool.h>

/* The box around the patches in a photograph (8 bits, RGB): upper left, upper right, lower right, lower left as the chart stands
 * with its greys below; off by up to a third of a patch. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_chart_box(bool *found, tsuya_vec2 box_px[4], const tsuya_image *photo, int threads);

#endif
