/* Splined lenses (core/camera.h) made from other lenses. */
#ifndef TSUYA_CALIB_SPLINE_H
#define TSUYA_CALIB_SPLINE_H

#include "core/camera.h"
#include "core/status.h"

/* A stereographic projection of a focal length, its principal point in the image's middle, as a splined lens that bends nothing. */
TSUYA_MUST_CHECK tsuya_status tsuya_spline_plain(tsuya_camera *splined, int width_px, int height_px, double focal_px, int nx);
/* The splined lens that follows `lens` over the image, core and all, with nx control points along x and as many as that takes along y; where
 * the lens does not reach the image's border it is continued.  Reaches a little beyond the border.  Fewer than nx where they would be too many.
 * A splined `lens` may be the same camera with other control points. */
TSUYA_MUST_CHECK tsuya_status tsuya_spline_fit(tsuya_camera *splined, const tsuya_camera *lens, int nx);

/* Control points are many, and boards do not reach every place of the image.  So a splined lens is believed to be near to the lens it was
 * made from: directions in which that lens has an even grid of pixels, about one for each control point, are to be seen at these pixels, give
 * or take a five hundredth of the image's width, as if one photograph more showed them, with a pose of its own. */
typedef struct tsuya_spline_hold {
    tsuya_vec3 ray;
    tsuya_vec2 pixel;
} tsuya_spline_hold;
/* At most nx ny of them; `hold` has room for as many.  How many, and their sigma. */
int tsuya_spline_holds(tsuya_spline_hold *hold, double *sigma_px, const tsuya_lens_spline *spline, const tsuya_camera *prior);

#endif
