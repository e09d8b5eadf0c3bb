/* What `tsuya calib camera` and the job's stage share: photographs or corners to camera.cameramodel, calib.json, corners.vnl,
 * uncertainty.vnl and calib.html. */
#ifndef TSUYA_APP_CALIB_RUN_H
#define TSUYA_APP_CALIB_RUN_H

#include "calib/calibrate.h"
#include "calib/detect.h"
#include "core/context.h"
#include "core/json.h"

enum { TSUYA_CALIB_MOST_PHOTOS = 4096 };

typedef struct tsuya_calib_input {
    const char *board;
    const char *const *photos; /* files, or one folder; none where corners are given */
    int photo_count;
    const char *corners;       /* vnlog */
    int width_px, height_px;   /* of the imager, with corners */
    const char *folder, *model; /* where to write, and the name of the model's file */
    tsuya_calibrate_options options;
} tsuya_calib_input;

TSUYA_MUST_CHECK tsuya_status tsuya_calib_run(tsuya_json *figures, const tsuya_calib_input *input, const tsuya_context *context);

/* calib.html.  `paths`: the photographs in the order of the corners' names, NULL where there are none; `detected`: may be NULL. */
TSUYA_MUST_CHECK tsuya_status tsuya_calib_page(const char *path, const char *folder, const tsuya_calibration *calibration,
                                               const tsuya_corner_set *corners, const char *const *paths, const tsuya_detect_info *detected);
/* A map as a picture, `high` at the colours' top; NaN grey. */
TSUYA_MUST_CHECK tsuya_status tsuya_calib_map_picture(tsuya_image *picture, const tsuya_projection_map *map, const tsuya_camera *camera, double high);

#endif
