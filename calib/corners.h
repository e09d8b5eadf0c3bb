/* Tag corners seen in photographs, and their vnlog file: `# filename tag_id corner x_px y_px sigma_px`.
 *
 * Pixel (0,0) is the centre of the first pixel.  Corner 0 is the tag's lower left, then counter-clockwise.  sigma_px is the
 * standard deviation of each coordinate. */
#ifndef TSUYA_CALIB_CORNERS_H
#define TSUYA_CALIB_CORNERS_H

#include "core/status.h"

struct tsuya_board;

typedef struct tsuya_corner {
    int photo;          /* index into the set's names */
    int tag_id, corner; /* 0 … 3 */
    double x_px, y_px, sigma_px;
    double spread_x_px, spread_y_px; /* how the corner moves when its two edges move outwards by one blur width; 0: unknown.
                                        Not in the file. */
} tsuya_corner;

typedef struct tsuya_corner_set {
    char **photo; /* names, in byte order */
    int photo_count;
    tsuya_corner *corner; /* by photograph, tag, corner */
    int count, capacity;
} tsuya_corner_set;

/* Keeps the set of names; the corners are added later. Sorted. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_corner_set_create(tsuya_corner_set *set, const char *const *names, int count);
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_corner_set_add(tsuya_corner_set *set, tsuya_corner corner);
/* Into the order of the struct's comment; call after the last add. */
TSUYA_API void tsuya_corner_set_sort(tsuya_corner_set *set);
TSUYA_API void tsuya_corner_set_free(tsuya_corner_set *set);

/* Fails, naming file and line, on missing columns, corners outside 0 … 3, sigmas that are not positive, coordinates outside
 * `width_px` × `height_px` (0: any), and a corner that occurs twice. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_corner_set_load(tsuya_corner_set *set, const char *path, int width_px, int height_px);
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_corner_set_save(const tsuya_corner_set *set, const char *path);

/* For mrcal's own tools, whose boards are grids of one spacing: `# filename x y level`, photograph by photograph, row by row from the
 * origin, `-` where a corner was not seen.  level: by how many halvings a corner is worse than the median.  The board must be
 * one plate whose tags are as far apart as they are large (tsuya_board_even_grid). */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_corner_set_save_grid(const tsuya_corner_set *set, const struct tsuya_board *board, const char *path);

#endif
