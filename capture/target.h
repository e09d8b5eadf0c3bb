/* Printable boards of AprilTags: a PDF exact in millimetres with a ruler to check the printer, and the board.yaml that says
 * where its tags are. */
#ifndef TSUYA_CAPTURE_TARGET_H
#define TSUYA_CAPTURE_TARGET_H

#include "core/status.h"

typedef enum tsuya_target_kind {
    TSUYA_TARGET_GRID,
    TSUYA_TARGET_MAT, /* of a turntable: tags in a ring, the axis in the middle and a circle of degrees; the frame's origin is the axis */
    TSUYA_TARGET_BAR, /* two tags at either end of a ruler; the origin is the middle of the first, size_mm lie between it and the last */
} tsuya_target_kind;

typedef struct tsuya_target_options {
    tsuya_target_kind kind;
    const char *family;
    int border_bits, cols, rows, first_id; /* cols and rows: of a grid */
    double tag_mm, gap_mm;
    double size_mm;   /* diameter of a mat, length of a bar */
    double margin_mm; /* of white around the tags; the ruler stands below */
} tsuya_target_options;
TSUYA_API tsuya_target_options tsuya_target_options_default(void); /* 8 × 5 tags of 30 mm, 9 mm apart */
/* A mat of 190 mm with tags of 18 mm, a bar of 240 mm with tags of 20 mm: both fit on A4. */
TSUYA_API tsuya_target_options tsuya_target_options_of(tsuya_target_kind kind);

typedef struct tsuya_target_page { double width_mm, height_mm, left_mm, bottom_mm; } tsuya_target_page; /* the origin from the page's lower left */
TSUYA_API tsuya_target_page tsuya_target_page_of(const tsuya_target_options *options);

enum { TSUYA_TARGET_MOST = 10000 };
typedef struct tsuya_target_tag { double x_mm, y_mm; } tsuya_target_tag; /* the tag's middle; ids run on from first_id */
/* Places of the tags; as many as there are, of which `most` are written. */
TSUYA_API int tsuya_target_tags(tsuya_target_tag *tag, int most, const tsuya_target_options *options);

/* Fails on unknown families, ids the family lacks, and gaps that the family's outer cells do not fit into, mats and bars
 * that are too small for their tags. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_target_save(const char *pdf, const char *yaml, const tsuya_target_options *options);

#endif
