/* What `tsuya calib light` does with its photographs: light.json and the picture of what is left. */
#ifndef TSUYA_APP_CALIB_LIGHT_H
#define TSUYA_APP_CALIB_LIGHT_H

#include "app/calib_run.h"
#include "calib/lamp.h"

typedef struct tsuya_calib_light_input {
    const char *board, *camera, *color; /* color: may be NULL */
    const char *const *photos;          /* files, or one folder */
    int photo_count;
    bool linear;                        /* integer files hold linear light */
    double reflectance;
    const char *const *ball;            /* "X,Y,DIAMETER[; PHOTO …]", mm; none: the plate is the light meter */
    int balls;
    const char *file;                   /* light.json */
} tsuya_calib_light_input;

TSUYA_MUST_CHECK tsuya_status tsuya_calib_light(tsuya_json *figures, const tsuya_calib_light_input *input, const tsuya_context *context);
/* The readings' residuals where they were seen, a panel a photograph: blue below the fit, red above, `high` (a share) at the
 * colours' ends, grey where left out. */
TSUYA_MUST_CHECK tsuya_status tsuya_calib_light_picture(const char *path, const tsuya_lamp_readings *readings, const tsuya_camera *camera, double high);

#endif
