/* The check of a session: which photographs to take again, and why.
 *
 * Each photograph is measured alone (capture/check_photo.c, capture/check_blur.c) and against the others that show the same
 * things (capture/check_session.c).  Exposure and white balance are judged on features that two photographs share, so that a
 * dark side of the object is not taken for a dark photograph.  From the same features comes how the cameras are turned to each other,
 * and from that which directions nobody has photographed yet (capture/check_cover.c). */
#ifndef TSUYA_CAPTURE_CHECK_H
#define TSUYA_CAPTURE_CHECK_H

#include "core/context.h"
#include "core/image.h"
#include "core/json.h"
#include "core/photo.h"

enum { TSUYA_CHECK_FAULTS = 8, TSUYA_BLUR_DIRECTIONS = 8, TSUYA_CHECK_MISSING = 12 };

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
    double apart_ev[3];                        /* red, exposure, blue as the neighbours agree, beyond what EXIF tells; NaN: fewer than two */
    int tags;                                  /* of the target seen; −1: no target was given */
    double tags_focal_px, tags_focal_sigma_px; /* focal length that they tell, without a calibration; NaN: too few, too frontal */
    double told_ev;                            /* exposure against the session by EXIF where the pixels confirm it; else 0 */
    int same_as;                               /* −1, or an earlier photograph with the same view */
    /* Where it was taken from, seen from the object: azimuth counter-clockwise from above (a step to the right raises it), 0 at the
     * first photograph by name that has one; elevation above the cameras' common horizon.  NaN: not known. */
    double azimuth_deg, elevation_deg;
    int fault_count;
    char fault[TSUYA_CHECK_FAULTS][160];       /* why to take it again, in words; none: it is good */
} tsuya_checked_photo;

/* A view still to take: from one photograph so far to the right and so far up. */
typedef struct tsuya_check_missing {
    double azimuth_deg, elevation_deg;
    double gain;               /* by which the covered share rises, given those before it */
    int nearest;               /* photograph */
    double right_deg, up_deg;
} tsuya_check_missing;

typedef struct tsuya_check {
    tsuya_checked_photo *photo; /* by name */
    int count, again;
    double blur_px, focal_mm;   /* of the session: median of the worst directions; most common, 0 where EXIF has none */
    double blur_limit_px;       /* beyond the session's own scatter */
    double limit_ev[3];         /* that apart_ev is held against */
    double tags_focal_px;       /* median of what the photographs' tags tell; NaN: fewer than three do */
    double wander_ev;           /* of the exposure, 10th to 90th percentile; NaN: not known */
    int width_px, height_px;    /* most common size */
    int shared;                 /* median of the photographs' strongest: how well the session hangs together */
    int placed;                 /* photographs whose direction is known */
    double covered;             /* share of the directions that surfaces may face which enough photographs see; NaN: nothing placed */
    double focal_assumed;       /* share of the placed whose focal length EXIF does not tell */
    int missing_count;
    tsuya_check_missing missing[TSUYA_CHECK_MISSING]; /* in the order of what they gain */
    double seconds;
} tsuya_check;

typedef struct tsuya_check_options {
    double blur_ratio;     /* a photograph is blurred beyond this multiple of the session's edges … */
    double blur_excess_px; /* … and by at least this much, added in squares */
    double clipped_share;
    double exposure_ev, white_balance_ev;
    int shared_features;   /* that make two photographs neighbours */
    int features, features_long_side_px;
    const char *target;    /* board.yaml of tags in the scene; NULL: none are looked for.  Borrowed */
} tsuya_check_options;
TSUYA_API tsuya_check_options tsuya_check_options_default(void);

/* Every image of a folder.  Photographs that cannot be read are reported, not failed on.  `masks` may be NULL.  Fails on an
 * empty folder and on a target that cannot be read.  About 1.6 s of CPU time and 400 MiB for a photograph of 24 Mpix. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_check_session(tsuya_check *check, const char *photos, const char *masks,
                                                            const tsuya_check_options *options, const tsuya_context *context);
TSUYA_API void tsuya_check_free(tsuya_check *check);

/* The same while photographs arrive: each is read once, pairs are matched once.  After every refresh the check is what
 * tsuya_check_session would say of the folder as it stands, to the last bit (seconds apart). */
typedef struct tsuya_check_watch tsuya_check_watch;
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_check_watch_create(tsuya_check_watch **watch, const char *photos, const char *masks,
                                                                 const tsuya_check_options *options);
/* Looks at the folder again; an empty one is fine.  `read`: photographs that were new or had changed.  Photographs that left are
 * forgotten.  After a failure other than an interruption the watch can only be freed. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_check_watch_refresh(tsuya_check_watch *watch, int *read, const tsuya_context *context);
/* Borrowed until the next refresh. */
TSUYA_API const tsuya_check *tsuya_check_watch_result(const tsuya_check_watch *watch);
TSUYA_API bool tsuya_check_watch_is_new(const tsuya_check_watch *watch, int photo); /* read by the last refresh */
TSUYA_API void tsuya_check_watch_free(tsuya_check_watch *watch);                    /* NULL is fine */

/* "20 degrees to the right of NAME and 15 degrees higher" */
TSUYA_API void tsuya_check_missing_text(char *text, size_t size, const tsuya_check *check, const tsuya_check_missing *missing);
/* {"photos", "take_again", "blur_px", "focal_mm", "placed", "covered", "seconds", "again": ["NAME: why", …], "missing": [{…}], "photographs": [{…}]} */
TSUYA_API void tsuya_check_to_json(tsuya_json *object, const tsuya_check *check);

/* Parts, for tests.  `grey`: 8-bit or float; `mask` may be NULL. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_blur_measure(tsuya_blur *blur, const tsuya_image *grey, const tsuya_image *mask,
                                                           const tsuya_context *context);

/* What a clean list of faults does not say, or NULL: that most photographs were compared with none. */
TSUYA_API const char *tsuya_check_blindness(const tsuya_check *check);

#endif
