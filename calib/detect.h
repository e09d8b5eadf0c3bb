/* Photographs of boards to corners: AprilTag's detection, our refinement, and the checks that make a corner one to trust. */
#ifndef TSUYA_CALIB_DETECT_H
#define TSUYA_CALIB_DETECT_H

#include "calib/board.h"
#include "calib/corners.h"
#include "calib/refine.h"
#include "core/context.h"
#include "core/image.h"

typedef struct tsuya_detect_photo {
    char *path, *name;
} tsuya_detect_photo;

/* Why tags of a photograph were left out. */
typedef struct tsuya_detect_counts {
    int foreign;     /* ids that the board does not have */
    int twice;       /* the same id at two places, neither or one of them where its plate says */
    int misplaced;   /* not where its plate's other tags say: a wrong id, a reflection */
    int edges;       /* single edges that failed the refinement */
} tsuya_detect_counts;

typedef struct tsuya_detect_report {
    int tags, corners;
    tsuya_detect_counts rejected;
    double blur_px;       /* median over the edges; NaN without any */
    double blur_high_px;  /* 90th percentile: motion blurs one direction */
    double seconds;       /* of detection and refinement */
} tsuya_detect_report;

typedef struct tsuya_detect_info {
    int width_px, height_px;
    tsuya_edge_look look;
    tsuya_detect_report *report; /* one a photograph, in the set's order; owned */
    double seconds_read, seconds_detect, seconds_refine; /* summed over threads */
} tsuya_detect_info;

/* One image in memory (any sample type, 1 or 3 channels): corners are appended as photograph number `photo` of the set.
 * `look` NULL: estimated from this image. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_detect_image(tsuya_corner_set *corners, tsuya_detect_report *report, const tsuya_board *board,
                                                           const tsuya_image *image, int photo, const tsuya_edge_look *look);

/* Photographs by path; their names (file names) become the set's.  All must have one size.  Memory: one photograph a thread. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_detect_photos(tsuya_corner_set *corners, tsuya_detect_info *info, const tsuya_board *board,
                                                            const char *const *paths, int count, const tsuya_context *context);
TSUYA_API void tsuya_detect_info_free(tsuya_detect_info *info);

#endif
