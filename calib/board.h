/* Boards: rigid flat plates that carry AprilTags, from board.yaml.
 *
 * Three forms of file (docs/calib.md): one regular grid; plates with their tags listed one by one (or each a grid); Kalibr's
 * aprilgrid (tagCols, tagRows, tagSize in metres, tagSpacing as a ratio; two-bit border).
 *
 * A plate's frame: x right, y up as the tags stand upright, z towards the viewer; grids have their origin at the lower left
 * corner of the first tag.  Corners of a tag: 0 lower left, then counter-clockwise.  Metres. */
#ifndef TSUYA_CALIB_BOARD_H
#define TSUYA_CALIB_BOARD_H

#include "core/geometry.h"
#include "core/memory.h"

#include <stdio.h>

typedef struct tsuya_board_tag {
    int id, plate;
    tsuya_vec2 corner_m[4];
} tsuya_board_tag;

typedef struct tsuya_board_plate {
    const char *name;
    int first_tag, tag_count;  /* in tsuya_board.tag */
    int cols, rows;            /* of a regular grid; 0 where tags are listed */
    double tag_m, gap_m;       /* of a regular grid */
    int first_id;
} tsuya_board_plate;

typedef struct tsuya_board {
    const char *family; /* an AprilTag family: tag36h11, … */
    int border_bits;    /* 1, or 2 on Kalibr's grids */
    tsuya_board_plate *plate;
    int plate_count;
    tsuya_board_tag *tag; /* plate by plate, in the file's order */
    int tag_count;
    tsuya_arena *arena;
} tsuya_board;

/* Fails, naming file, key and value, on unknown families, sizes that are not positive, ids that occur twice, overlapping
 * forms, and plates without tags. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_board_load(tsuya_board *board, const char *path);
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_board_parse(tsuya_board *board, const char *text, const char *name_for_messages);
TSUYA_API void tsuya_board_free(tsuya_board *board);

/* Index of a tag by its id, −1 where the board has none. */
TSUYA_API int tsuya_board_find(const tsuya_board *board, int id);
/* One plate whose corners make a grid of one spacing: gaps as wide as the tags. */
TSUYA_API bool tsuya_board_even_grid(const tsuya_board *board);
/* A regular grid, made in memory. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_board_grid(tsuya_board *board, const char *family, int border_bits, int cols, int rows,
                                                         double tag_m, double gap_m, int first_id);
static inline tsuya_vec3 tsuya_board_corner(const tsuya_board *board, int tag, int corner)
{
    tsuya_vec2 c = board->tag[tag].corner_m[corner];
    return (tsuya_vec3){c.x, c.y, 0.0};
}

static inline tsuya_vec2 tsuya_board_tag_middle(const tsuya_board_tag *tag)
{
    return (tsuya_vec2){0.5 * (tag->corner_m[0].x + tag->corner_m[2].x), 0.5 * (tag->corner_m[0].y + tag->corner_m[2].y)};
}

#endif
