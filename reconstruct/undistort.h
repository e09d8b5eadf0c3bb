/* Photographs as pinholes see them: the size for `colmap image_undistorter`, and masks made to fit what it wrote. */
#ifndef TSUYA_RECONSTRUCT_UNDISTORT_H
#define TSUYA_RECONSTRUCT_UNDISTORT_H

#include "core/camera.h"
#include "core/context.h"
#include "core/image.h"
#include "core/photo.h"

/* Size of the pinhole photographs, a share of the lens' own, with its focal length.  0 where the lens reaches its image's borders:
 * COLMAP then fits the size to them.  Where it does not (nothing was seen there, and the distortion folds over) that choice ends at
 * a strip of a fifth, and the largest size up to the photograph's own is taken that lies before the fold. */
double tsuya_undistort_scale(const tsuya_sparse_model *model);

/* For every view of `dense` whose photograph has a mask: workspace/masks/NAME.png, 255 keeps, 0 outside the photograph.
 * `sparse`: the model with the lenses. */
TSUYA_MUST_CHECK tsuya_status tsuya_undistort_masks(const char *workspace, const tsuya_sparse_model *dense,
                                                    const tsuya_sparse_model *sparse, const tsuya_photo_set *photos,
                                                    const tsuya_context *context);
/* One image (any samples) as the pinhole sees it: bilinear, 0 where the lens saw nothing. */
TSUYA_MUST_CHECK tsuya_status tsuya_undistort(tsuya_image *out, const tsuya_image *in, const tsuya_camera *pinhole,
                                              const tsuya_camera *lens);

#endif
