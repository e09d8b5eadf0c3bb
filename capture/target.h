/* Printable boards of AprilTags: a PDF exact in millimetres with a ruler to check the printer, and the board.yaml that says
 * where its tags are. */
#ifndef TSUYA_CAPTURE_TARGET_H
#define TSUYA_CAPTURE_TARGET_H

#include "core/status.h"

typedef struct tsuya_target_options {
    const char *family;
    int border_bits, cols, rows, first_id; /* one row makes a scale bar */
    double tag_mm, gap_mm;
    double margin_mm; /* of white around the tags; the ruler stands below */
} tsuya_target_options;
TSUYA_API tsuya_target_options tsuya_target_options_default(void); /* 8 × 5 tags of 30 mm, 9 mm apart */

typedef struct tsuya_target_page { double width_mm, height_mm, left_mm, bottom_mm; } tsuya_target_page; /* the origin from the page's lower left */
TSUYA_API tsuya_target_page tsuya_target_page_of(const tsuya_target_options *options);

/* Fails on unknown families, ids the family lacks, and gaps that the family's outer cells do not fit into. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_target_save(const char *pdf, const char *yaml, const tsuya_target_options *options);

#endif
