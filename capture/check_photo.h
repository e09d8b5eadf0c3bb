/* What the check keeps of one photograph while it looks at the session. */
#ifndef TSUYA_CAPTURE_CHECK_PHOTO_H
#define TSUYA_CAPTURE_CHECK_PHOTO_H

#include "capture/check.h"
#include "capture/opencv_adapter.h"

typedef struct tsuya_check_sight {
    tsuya_features *features; /* NULL: unreadable */
    float *color;             /* 3 a feature: linear values around it, averaged */
    double work_scale;        /* work px over photograph px */
    int work_long_side_px;
} tsuya_check_sight;

/* Fills everything that the photograph alone can tell.  A photograph that cannot be decoded is a fault, not a failure. */
TSUYA_MUST_CHECK tsuya_status tsuya_check_photo(tsuya_checked_photo *photo, tsuya_check_sight *sight,
                                                const tsuya_check_options *options, const tsuya_context *context);
void tsuya_check_sight_free(tsuya_check_sight *sight);
void tsuya_check_fault(tsuya_checked_photo *photo, const char *format, ...) TSUYA_PRINTF(2, 3);

/* Verdicts out of all photographs' measures (capture/check_session.c). */
TSUYA_MUST_CHECK tsuya_status tsuya_check_relations(tsuya_check *check, const tsuya_check_sight *sight, const tsuya_check_options *options,
                                                    const tsuya_context *context);
TSUYA_MUST_CHECK tsuya_status tsuya_check_verdicts(tsuya_check *check, const tsuya_check_options *options);

#endif
