/* Where two cameras, or one camera and its errors, put the same points: maps over the image.
 *
 * Two calibrations of one camera may differ by a motion of the camera, which no photograph can tell and which every later use
 * absorbs in its poses.  So the motion that fits best is taken out first: rotation and translation at a finite distance,
 * rotation alone at infinity.  It is fitted where boards were seen. */
#ifndef TSUYA_CALIB_PROJECTION_H
#define TSUYA_CALIB_PROJECTION_H

#include "calib/solve.h"

/* Sample points, corner to corner; cell (i, j) at i (width−1)/(cols−1). */
typedef struct tsuya_projection_map {
    int cols, rows;
    double *value;  /* px; NaN where the lens does not reach */
    bool *covered;  /* boards were seen there */
} tsuya_projection_map;

/* All cells covered; for cells under boards see tsuya_projection_cover. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_projection_map_create(tsuya_projection_map *map, int cols, int rows);
TSUYA_API void tsuya_projection_map_free(tsuya_projection_map *map);
/* Marks the cells that have a corner of the solve within one and a half cells. */
TSUYA_API void tsuya_projection_cover(tsuya_projection_map *map, const tsuya_solve *solve);
/* The same for corners of a file, and for a disc of a third of the image's shorter side around its middle. */
TSUYA_API void tsuya_projection_cover_corners(tsuya_projection_map *map, const tsuya_corner_set *corners, int width_px, int height_px);
TSUYA_API void tsuya_projection_cover_middle(tsuya_projection_map *map, int width_px, int height_px);
TSUYA_API int tsuya_projection_cell(const tsuya_projection_map *map, const tsuya_camera *camera, tsuya_vec2 pixel); /* the nearest */
TSUYA_API tsuya_vec2 tsuya_projection_pixel(const tsuya_projection_map *map, const tsuya_camera *camera, int cell);

/* |b's pixel − a's pixel| of points at a distance (INFINITY: directions), the best motion taken out.  `b_from_a` may be NULL. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_projection_difference(tsuya_projection_map *map, tsuya_pose *b_from_a, const tsuya_camera *a,
                                                                    const tsuya_camera *b, double distance_m);
/* One sigma in the worst direction, from the covariance of the intrinsics (n × n). */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_projection_uncertainty(tsuya_projection_map *map, const tsuya_camera *camera,
                                                                     const double *covariance, double distance_m);

/* The focal length in the middle along x, and its sigma (n × n covariance of the intrinsics). */
TSUYA_API double tsuya_projection_focal(double *sigma_px, const tsuya_camera *camera, const double *covariance);

typedef struct tsuya_projection_stats { double mean, p90, max; } tsuya_projection_stats;
/* Over the covered cells. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_projection_summary(tsuya_projection_stats *stats, const tsuya_projection_map *map);
/* The cell nearest to the image's centre; the worst of the four corners and its index (0 top left, 1 top right, 2 bottom
 * left, 3 bottom right). */
TSUYA_API double tsuya_projection_center(const tsuya_projection_map *map);
TSUYA_API double tsuya_projection_corner(int *which, const tsuya_projection_map *map);

#endif
