/* How well a Poisson surface is supported by the cloud that it was made from. */
#ifndef TSUYA_RECONSTRUCT_SURFACE_SUPPORT_H
#define TSUYA_RECONSTRUCT_SURFACE_SUPPORT_H

#include "core/context.h"
#include "core/mesh.h"

/* gap[v]: distance to the nearest point with a like normal among the nearest 8, in local spacings.  Where it is below
 * `reach`, the mesh's evidence, colour and sigma (arrays that the cloud has; evidence always) become the neighbours' mean;
 * evidence is 1 where the cloud has none, and 0 beyond.  The mesh needs normals. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_surface_measure(tsuya_mesh *mesh, float *gap, const tsuya_mesh *cloud,
                                                                   const float *spacing, double median_spacing, double reach,
                                                                   const tsuya_context *context);

/* Means over neighbouring vertices; values are cut at `most` first, so that far places do not leak. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_surface_smooth_gap(float *gap, const tsuya_mesh *mesh, float most,
                                                                      int iterations);

/* Sets gap to 0 on patches with gap ≥ trim that are closed all around and nowhere reach `bridge`. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_surface_bridge(float *gap, const tsuya_mesh *mesh, float trim,
                                                                  float bridge);

#endif
