/* What `tsuya calib light` does with its photographs: light.json and the picture of what is left. */
#ifndef TSUYA_APP_CALIB_LIGHT_H
#define TSUYA_APP_CALIB_LIGHT_H

#include "app/calib_run.h"
#include "calib/lamp.h"

typedef struct tsuya_calib_light_input {
    const char *board, *camera, *color; /* color: may be NULL */
    const char *const *photos;          /* files, or one folder; or several folders, a lamp each */
    int photo_count;
    bool linear;                        /* integer files hold linear light */
    double reflectance;
    const char *const *ball;            /* "X,Y,DIAMETER[; PHOTO …]", mm; none: the plate is the light meter */
    int balls;
    int lamps;                          /* with balls: that shine at once, each a highlight in every ball; at least 1 */
    bool white;                         /* with balls: the plates' white is the light meter beside them */
    const char *file;                   /* light.json */
} tsuya_calib_light_input;

TSUYA_MUST_CHECK tsuya_status tsuya_calib_light(tsuya_json *figures, const tsuya_calib_light_input *input, const tsuya_context *context);
/* A panel a photograph, cut to what was read in it.  Tags' white: blue below the fit, red above, `high` (a share) at the colours' ends,
 * grey where left out; a bar of these colours at the foot.  Balls: a cross at each highlight, and its residual, forty times as long. */
TSUYA_MUST_CHECK tsuya_status tsuya_calib_light_picture(const char *path, const tsuya_lamp_readings *readings, const tsuya_lamp_balls *balls, int photos, double high);

#endif
