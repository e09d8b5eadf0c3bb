/* The threads of a photograph, patch by patch. */
#ifndef TSUYA_WEAVE_DETECT_PATCHES_H
#define TSUYA_WEAVE_DETECT_PATCHES_H

#include "core/context.h"
#include "core/image.h"
#include "core/json.h"
#include "weave_detect/threads.h"

#include <stddef.h>

typedef struct tsuya_patch {
    double x_px, y_px; /* centre */
    tsuya_threads threads;
} tsuya_patch;

/* rows × columns, row by row from the image's upper left corner. */
typedef struct tsuya_patch_grid {
    int columns, rows, patch_px, step_px;
    tsuya_weft_told weft_told;
    tsuya_patch *patch;
} tsuya_patch_grid;

typedef struct tsuya_patch_options {
    int patch_px; /* even, 16 … 512; default 64 */
    int step_px;  /* ≥ 1; default 32 */
    double weft_deg; /* roughly where the weft runs, from the user; NaN: not known */
} tsuya_patch_options;
TSUYA_API tsuya_patch_options tsuya_patch_options_default(void);

static inline size_t tsuya_patch_count(const tsuya_patch_grid *grid) { return (size_t)grid->columns * (size_t)grid->rows; }

/* `mask`: white keeps; patches less than half white or with a black middle are empty (confidence 0); NULL or an empty image: everything is kept.
 * The first patch stands in the image's corner; an image smaller than a patch is an error.  O(pixels), the same result for any
 * number of threads. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_patches_detect(tsuya_patch_grid *grid, const tsuya_image *image,
                                                             const tsuya_image *mask, const tsuya_patch_options *options,
                                                             const tsuya_context *context);
TSUYA_API void tsuya_patches_free(tsuya_patch_grid *grid);

/* patches.csv, atomic: x_px,y_px,weft_deg,warp_deg,period_weft_px,period_warp_px,confidence. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_patches_save(const tsuya_patch_grid *grid, const char *path);
/* The same rows: x_px,y_px,kind,diagonal_deg. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_patches_save_kinds(const tsuya_patch_grid *grid, const char *path);

/* Figures: patches, sure (share with confidence ≥ 0.8), medians over those of period_weft_px, period_warp_px, angle_between_deg, and
 * with px_per_cm > 0 threads_per_cm_weft, threads_per_cm_warp; kind (the most frequent one). */
TSUYA_API void tsuya_patches_to_json(tsuya_json *figures, const tsuya_patch_grid *grid, double px_per_cm);

/* The photograph, paled, under a stroke along each family of each patch (weft long, warp short), coloured by confidence:
 * violet 0 to yellow 1; nothing where no thread was seen.  8 bits. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_patches_overlay(tsuya_image *picture, const tsuya_image *photo,
                                                              const tsuya_patch_grid *grid);

#endif
