/* Lenses that COLMAP lacks, for tests. */
#ifndef TSUYA_TESTS_RECONSTRUCT_LENS_SCENE_H
#define TSUYA_TESTS_RECONSTRUCT_LENS_SCENE_H

#include "core/camera.h"

#include <math.h>

/* Stereographic, with its middle off the image's and the image pushed about by some pixels. */
static inline tsuya_camera lens_splined(int width_px, int height_px, double focal_px, int fov_x_deg)
{
    tsuya_camera c = {.lens = TSUYA_LENS_SPLINED_STEREOGRAPHIC, .width_px = width_px, .height_px = height_px, .fx_px = focal_px, .fy_px = 1.004 * focal_px,
                      .cx_px = 0.51 * width_px, .cy_px = 0.485 * height_px, .spline = {.nx = 14, .ny = 12, .fov_x_deg = fov_x_deg}};
    for (int i = 0; i < c.spline.nx * c.spline.ny; i++) {
        int x = i % c.spline.nx, y = i / c.spline.nx;
        c.spline.point[2 * i] = 0.012 * sin(0.7 * x + 0.3 * y);
        c.spline.point[2 * i + 1] = 0.009 * cos(0.5 * x - 0.6 * y + 1.0);
    }
    return c;
}

static inline tsuya_camera lens_thin_prism(int width_px, int height_px, double focal_px)
{
    return (tsuya_camera){.lens = TSUYA_LENS_OPENCV12, .width_px = width_px, .height_px = height_px, .fx_px = focal_px, .fy_px = 0.997 * focal_px,
                          .cx_px = 0.49 * width_px, .cy_px = 0.52 * height_px,
                          .distortion = {-0.21, 0.06, 0.001, -0.002, 0.01, 0.02, -0.01, 0.003, 0.004, -0.002, 0.003, 0.001}};
}

#endif
