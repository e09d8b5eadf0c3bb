/* Masks of an undistorted workspace, and distances to their border. */
#ifndef TSUYA_RECONSTRUCT_VIEW_MASK_H
#define TSUYA_RECONSTRUCT_VIEW_MASK_H

#include "core/camera.h"
#include "core/image.h"

/* WORKSPACE/masks/NAME.png as one 8-bit channel of the camera's size, 128 and above keeps.  Where there is no such file the
 * image stays empty (data NULL). */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_view_mask_load(tsuya_image *mask, const char *workspace, const char *name,
                                                                  const tsuya_camera *camera);

/* Chebyshev distance in pixels to the nearest pixel that is `target` (0 on one; 65535 at most), in place of the flags:
 * on entry distance[p] ≠ 0 marks a target.  Two passes (Rosenfeld & Pfaltz 1968). */
TSUYA_INTERNAL void tsuya_distance_to_marked(uint16_t *distance, int width_px, int height_px);

#endif
