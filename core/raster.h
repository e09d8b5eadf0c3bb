/* A mesh drawn into a camera: depth and triangle per pixel (z-buffer).
 *
 * A pixel belongs to a triangle when its centre lies inside, or on a top or left edge (Pineda, "A parallel algorithm for
 * polygon rasterization", SIGGRAPH 1988); shared edges are drawn once and leave no gaps, since vertices are rounded to
 * 1/4096 px and edge functions are exact integers.  Both sides of a triangle are drawn.  Where two triangles have the same
 * depth, the one of the lower index wins.  The result does not depend on the number of threads.
 *
 * A lens with distortion bends vertices, not edges: right where triangles are small in the picture. */
#ifndef TSUYA_CORE_RASTER_H
#define TSUYA_CORE_RASTER_H

#include "core/camera.h"
#include "core/context.h"
#include "core/mesh.h"

typedef struct tsuya_raster {
    int width_px, height_px;
    float *depth;       /* z in the camera frame, unit of the mesh; 0: nothing */
    uint32_t *triangle; /* UINT32_MAX: nothing */
} tsuya_raster;

/* Empty picture of a size: depth 0, triangle UINT32_MAX. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_raster_create(tsuya_raster *raster, int width_px, int height_px);
TSUYA_API void tsuya_raster_free(tsuya_raster *raster);
TSUYA_API void tsuya_raster_clear(tsuya_raster *raster);

/* Draws into the picture, on top of what is there (a mesh drawn later wins only where it is nearer).  The picture's size
 * must be the camera's.  Triangles are clipped at 1e-5 of the farthest vertex's depth.  Temporary memory: 16 bytes a vertex. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_raster_draw(tsuya_raster *raster, const tsuya_mesh *mesh,
                                                          const tsuya_camera *camera, tsuya_pose camera_from_world,
                                                          const tsuya_context *context);

/* Weights of a triangle's three vertices at a pixel (they sum to 1), where the pixel's ray meets the triangle's plane; false
 * where it does not. */
TSUYA_API bool tsuya_raster_weights(double weights[3], const tsuya_mesh *mesh, uint32_t triangle, const tsuya_camera *camera,
                                    tsuya_pose camera_from_world, tsuya_vec2 pixel);

#endif
