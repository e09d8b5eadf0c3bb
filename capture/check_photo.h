/* What the check keeps of one photograph while it looks at the session. */
#ifndef TSUYA_CAPTURE_CHECK_PHOTO_H
#define TSUYA_CAPTURE_CHECK_PHOTO_H

#include "calib/board.h"
#include "capture/check.h"
#include "capture/opencv_adapter.h"
#include "core/geometry.h"

typedef struct tsuya_check_sight {
    tsuya_features *features; /* NULL: unreadable */
    float *color;             /* 3 a feature: linear values around it, averaged */
    double work_scale;        /* work px over photograph px */
    int work_long_side_px;
    double focal_px;          /* in work px; `assumed` where EXIF tells none */
    bool assumed;
    tsuya_vec2 middle;        /* of the work picture */
    tsuya_vec3 towards;       /* unit, camera frame: middle of the mask, or of the picture */
    bool measured, is_new;
    int own_faults;           /* that the photograph alone has */
    double stamp[6];          /* size and time of change of photograph and mask */
} tsuya_check_sight;

/* What two photographs have to do with each other; `j` is the second. */
typedef struct tsuya_check_relation {
    bool known;
    bool used;         /* near in the order of names, or asked because one of both is lonely */
    int shared;
    /* log2 of i's light over j's on shared patches: red against green, green, blue against green; median and robust standard
     * deviation; NaN where too few. */
    double ratio[3], spread[3];
    double moved;      /* median way of the features, share of the longer side */
    int turned;        /* features that agree with the turn; 0: none */
    tsuya_mat3 turn;   /* j_from_i, rotation alone */
} tsuya_check_relation;

/* Fills everything that the photograph alone can tell; `target` may be NULL.  A photograph that cannot be decoded is a fault, not a failure. */
TSUYA_MUST_CHECK tsuya_status tsuya_check_photo(tsuya_checked_photo *photo, tsuya_check_sight *sight, const tsuya_board *target,
                                                const tsuya_check_options *options, const tsuya_context *context);
void tsuya_check_sight_free(tsuya_check_sight *sight);
void tsuya_check_fault(tsuya_checked_photo *photo, const char *format, ...) TSUYA_PRINTF(2, 3);

/* A robust standard deviation so many times over makes an outlier (Iglewicz & Hoaglin 1993). */
static const double TSUYA_CHECK_OUTLIER = 3.5;
/* Sorts; NaN of nothing. */
double tsuya_check_median(double *value, int count);

/* Colours of shared features against each other, and what all pairs say of each photograph (capture/check_light.c).  `list`: room for
 * three times r->shared. */
void tsuya_check_compare_light(tsuya_check_relation *r, const tsuya_check_sight *a, const tsuya_check_sight *b, const tsuya_feature_pair *pair,
                               double *list);
TSUYA_MUST_CHECK tsuya_status tsuya_check_light(tsuya_check *check, const tsuya_check_relation *relations, const tsuya_check_options *options);

/* Tags seen and the focal length that they tell (capture/check_tags.c); the image as it is on disk. */
TSUYA_MUST_CHECK tsuya_status tsuya_check_tags(tsuya_checked_photo *p, const tsuya_board *board, const tsuya_image *image);
TSUYA_MUST_CHECK tsuya_status tsuya_check_tags_verdicts(tsuya_check *check);

/* Verdicts out of all photographs' measures (capture/check_session.c).  `relations`: count × count, what is known stays. */
TSUYA_MUST_CHECK tsuya_status tsuya_check_relations(tsuya_check *check, tsuya_check_relation *relations, const tsuya_check_sight *sight,
                                                    const tsuya_check_options *options, const tsuya_context *context);
/* After the verdicts: directions, coverage, missing views (capture/check_cover.c). */
TSUYA_MUST_CHECK tsuya_status tsuya_check_cover(tsuya_check *check, const tsuya_check_relation *relations, const tsuya_check_sight *sight,
                                                const tsuya_check_options *options);
TSUYA_MUST_CHECK tsuya_status tsuya_check_verdicts(tsuya_check *check, const tsuya_check_options *options);

#endif
