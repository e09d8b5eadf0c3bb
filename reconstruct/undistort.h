/* Photographs as pinholes see them: the size for `colmap image_undistorter`, masks made to fit what it wrote, and images of our own. */
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
/* One image as the pinhole sees it, in float samples of its own encoding; 0 where the lens saw nothing.  Lanczos (six pixels wide) wants
 * float samples. */
typedef enum tsuya_resample { TSUYA_RESAMPLE_LINEAR, TSUYA_RESAMPLE_LANCZOS } tsuya_resample;
TSUYA_MUST_CHECK tsuya_status tsuya_undistort(tsuya_image *out, const tsuya_image *in, const tsuya_camera *pinhole, const tsuya_camera *lens,
                                              tsuya_resample how, int threads);
/* One mask, of any size in the photograph's shape: 255 keeps, else 0. */
TSUYA_MUST_CHECK tsuya_status tsuya_undistort_mask(const char *path, const char *mask_path, const tsuya_camera *pinhole, const tsuya_camera *lens,
                                                   int threads);

#endif
