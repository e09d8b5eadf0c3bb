/* A field of directions on a surface made visible: noise smeared along it. */
#ifndef TSUYA_APP_WEAVE_PICTURE_H
#define TSUYA_APP_WEAVE_PICTURE_H

#include "app/shade.h"

/* The mesh's weft through line integral convolution (Cabral & Leedom, SIGGRAPH 1993) in the picture's plane, on clay; tinted by
 * `value` (one a vertex, drawn from 0 to 1; NULL: not tinted).  8-bit sRGB. */
TSUYA_MUST_CHECK tsuya_status tsuya_weave_picture(tsuya_image *picture, const tsuya_mesh *mesh, const tsuya_camera *camera,
                                                  tsuya_pose camera_from_world, const float *value, const tsuya_context *context);

#endif
