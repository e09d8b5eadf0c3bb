/* Poses that are known: a COLMAP model, or mrcal's .cameramodel files, one for each photograph or for each camera of a rig.
 *
 * A file is of the photograph that has its name (shot-001.cameramodel of shot-001.jpg), and as a rig's camera of every photograph whose
 * name goes on after it with '-', '_' or '.' (left.cameramodel of left-001.jpg); of several the longest.  Its extrinsics, camera from
 * reference, are the pose; the reference and its unit are the reconstruction's. */
#ifndef TSUYA_RECONSTRUCT_POSES_H
#define TSUYA_RECONSTRUCT_POSES_H

#include "core/camera.h"
#include "core/photo.h"

/* No points where the folder holds .cameramodel files; lenses that are the same are one camera.  Photographs that no file is of are left
 * out.  Fails where all cameras stand in one place: extrinsics that nobody wrote. */
TSUYA_MUST_CHECK tsuya_status tsuya_poses_load(tsuya_sparse_model *model, const char *folder, const tsuya_photo_set *photos);

#endif
