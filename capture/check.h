/* The check of a session: which photographs to take again, and why.
 *
 * Each photograph is measured alone (capture/check_photo.c, capture/check_blur.c) and against the others that show the same
 * things (capture/check_session.c).  Exposure and white balance are judged on features that two photographs share, so that a
 * dark side of the object is not taken for a dark photograph. */
#ifndef TSUYA_CAPTURE_CHECK_H
#define TSUYA_CAPTURE_CHECK_H

#include "core/context.h"
#include "core/image.h"
#include "core/json.h"
#include "core/photo.h"

enum { TSUYA_CHECK_FAULTS = 8, TSUYA_BLUR_DIRECTIONS = 8 };

/* Widths of edges by the direction of their gradient: standard deviation of the blur, px of the full photograph. */
typedef struct tsuya_blur {
    double sigma_px[TSUYA_BLUR_DIRECTIONS]; /* gradient at 22.5° k from +x towards +y; NaN with too few edges */
    int edges[TSUYA_BLUR_DIRECTIONS];
    double best_px, worst_px; /* of the directions; NaN without edges */
} tsuya_blur;

typedef struct tsuya_checked_photo {
    tsuya_photo photo;
    bool readable;
    tsuya_blur blur;
    double bright_clipped[3], dark_clipped[3]; /* share of the object's pixels at the top and bottom of the range */
    double level[3];                           /* mean linear value of the object's pixels */
    int features, neighbours, strongest;       /* photographs that share enough; shared features with the nearest of them */
    double exposure_ev, red_ev, blue_ev;       /* against the session, log2; red and blue against green; NaN: not known */
    int same_as;                               /* −1, or an earlier photograph with the same view */
    int fault_count;
    char fault[TSUYA_CHECK_FAULTS][160];       /* why to take it again, in words; none: it is good */
} tsuya_checked_photo;

typedef struct tsuya_check {
    tsuya_checked_photo *photo; /* by name */
    int count, again;
    double blur_px, focal_mm;   /* of the session: median of the worst directions; most common, 0 where EXIF has none */
    int width_px, height_px;    /* most common size */
    int shared;                 /* median of the photographs' strongest: how well the session hangs together */
    double seconds;
} tsuya_check;

typedef struct tsuya_check_options {
    double blur_ratio;     /* a photograph is blurred beyond this multiple of the session's edges … */
    double blur_excess_px; /* … and by at least this much, added in squares */
    double clipped_share;
    double exposure_ev, white_balance_ev;
    int shared_features;   /* that make two photographs neighbours */
    int features, features_long_side_px;
} tsuya_check_options;
TSUYA_API tsuya_check_options tsuya_check_options_default(void);

/* Every image of a folder.  Photographs that cannot be read are reported, not failed on.  `masks` may be NULL.  Fails on an
 * empty folder.  About 1 s and 300 MiB for a photograph of 24 Mpix. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_check_session(tsuya_check *check, const char *photos, const char *masks,
                                                            const tsuya_check_options *options, const tsuya_context *context);
TSUYA_API void tsuya_check_free(tsuya_check *check);
/* {"photos", "take_again", "blur_px", "focal_mm", "seconds", "again": ["NAME: why", …], "photographs": [{…}]} */
TSUYA_API void tsuya_check_to_json(tsuya_json *object, const tsuya_check *check);

/* Parts, for tests.  `grey`: 8-bit or float; `mask` may be NULL. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_blur_measure(tsuya_blur *blur, const tsuya_image *grey, const tsuya_image *mask,
                                                           const tsuya_context *context);

#endif
