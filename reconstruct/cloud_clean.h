/* A fused cloud made ready for a surface: duplicates merged, thinned, normals checked, outliers dropped. */
#ifndef TSUYA_RECONSTRUCT_CLOUD_CLEAN_H
#define TSUYA_RECONSTRUCT_CLOUD_CLEAN_H

#include "core/context.h"
#include "core/mesh.h"

enum { TSUYA_CLOUD_NEIGHBOURS = 8 };

/* One point per cell of a grid (0: only points in exactly one place are merged), at the mean of the cell's points, with
 * their mean normal, colour, evidence and sigma.  Points of one cell whose normals oppose the first one's make a second
 * point, so that the two sides of a cloth do not mix. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_cloud_thin(tsuya_mesh *cloud, double cell);

/* Distance between neighbouring samples around every point, from the distance to its k-th neighbour as if samples lay on a
 * square grid: d_k · sqrt(π / k), k = 8.  `spacing` has vertex_count entries; the cloud must have more than 8 points. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_cloud_spacing(float *spacing, double *median, const tsuya_mesh *cloud,
                                                                 const tsuya_context *context);

/* Normals by the plane of the nearest 16 points where the cloud has none, turned alike along a minimum spanning tree of
 * the neighbourhood (Hoppe et al., SIGGRAPH 1992) and outwards from each part's centroid. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_cloud_estimate_normals(tsuya_mesh *cloud, const tsuya_context *context);

/* keep[v] = 0 for statistical outliers (mean distance to the 8 nearest above mean + sigmas · deviation over the cloud, Rusu
 * et al. 2008; sigmas 0: off) and for points whose normal opposes those of at least three quarters of the neighbours. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_cloud_mark_outliers(uint8_t *keep, const tsuya_mesh *cloud, double sigmas,
                                                                       const tsuya_context *context);

/* keep[v] = 0 for points that fall on black in the masks of two photographs or more, farther than `margin_px` from white:
 * the visual hull.  `workspace`: COLMAP's dense folder with sparse/ and masks/NAME.png. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_cloud_mark_outside_hull(uint8_t *keep, const tsuya_mesh *cloud,
                                                                           const char *workspace, int margin_px,
                                                                           const tsuya_context *context);

#endif
