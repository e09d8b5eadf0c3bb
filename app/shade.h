/* Quick pictures of a mesh for the report: no light is simulated here, shape and numbers are made visible. */
#ifndef TSUYA_APP_SHADE_H
#define TSUYA_APP_SHADE_H

#include "core/image.h"
#include "core/raster.h"

typedef enum tsuya_shade {
    TSUYA_SHADE_CLAY,   /* grey, lit from the viewer's upper left */
    TSUYA_SHADE_COLOR,  /* vertex colours as they are */
    TSUYA_SHADE_NORMAL, /* normals as colours, camera frame */
    TSUYA_SHADE_VALUE,  /* a number per vertex through the colour map */
} tsuya_shade;

typedef struct tsuya_shade_options {
    tsuya_shade shade;
    const float *value; /* vertex_count numbers for TSUYA_SHADE_VALUE, drawn from low to high, low < high; NaN: clay */
    double low, high;
} tsuya_shade_options;

/* 8-bit sRGB picture of a raster that was drawn of this mesh through this camera. */
TSUYA_MUST_CHECK tsuya_status tsuya_shade_raster(tsuya_image *picture, const tsuya_raster *raster, const tsuya_mesh *mesh,
                                                 const tsuya_camera *camera, tsuya_pose camera_from_world,
                                                 const tsuya_shade_options *options);
/* Draws and shades, with 2 × 2 samples a pixel. */
TSUYA_MUST_CHECK tsuya_status tsuya_shade_view(tsuya_image *picture, const tsuya_mesh *mesh, const tsuya_camera *camera,
                                               tsuya_pose camera_from_world, const tsuya_shade_options *options,
                                               const tsuya_context *context);

/* Perceptually even, dark blue to yellow (nine anchors of matplotlib's viridis, CC0), t in [0, 1]; others are clamped. */
void tsuya_color_map(uint8_t rgb[3], double t);

#endif
