/* The COLMAP command line (3.8 and later, without CUDA and without a display), step by step.
 *
 * Options are probed in `colmap COMMAND -h`: what a version lacks is left out where it does not matter and refused by name
 * where it does. Every command's output is kept in FOLDER/log/COMMAND.txt. */
#ifndef TSUYA_RECONSTRUCT_COLMAP_H
#define TSUYA_RECONSTRUCT_COLMAP_H

#include "core/camera.h"
#include "core/context.h"

typedef struct tsuya_colmap {
    const char *folder;  /* JOB/reconstruct: database.db, sparse/, dense/, log/ */
    const char *photos;
    const tsuya_context *context;
    char version[64];
    double peak_mb;      /* highest memory of the commands run so far */
} tsuya_colmap;

/* Fails when colmap is missing; fills the version. */
TSUYA_MUST_CHECK tsuya_status tsuya_colmap_create(tsuya_colmap *colmap, const char *folder, const char *photos,
                                                  const tsuya_context *context);
/* database.db anew, with the features of every photograph and one shared camera.  `masks`: folder of NAME.jpg.png or NULL.
 * `camera`: intrinsics that are known, or NULL (focal length from EXIF, `lens` refined later).  `most`: features of a photograph, the
 * largest first; levels of scale are kept whole. */
TSUYA_MUST_CHECK tsuya_status tsuya_colmap_features(tsuya_colmap *colmap, const char *masks, const tsuya_camera *camera, tsuya_lens lens, int most);
/* Verifies lists of raw matches (two names, pairs of indices, an empty line), several at once: FOLDER/verify/N.txt within
 * FOLDER/verify/N.db for N from 0 to parts − 1, `pairs` in all. */
TSUYA_MUST_CHECK tsuya_status tsuya_colmap_verify(tsuya_colmap *colmap, int parts, int pairs);
/* Incremental mapping into FOLDER/OUTPUT/0, 1, …  */
TSUYA_MUST_CHECK tsuya_status tsuya_colmap_map(tsuya_colmap *colmap, const char *output, bool fixed_intrinsics);
typedef enum tsuya_adjust_what {
    TSUYA_ADJUST_POSES,  /* and points */
    TSUYA_ADJUST_LENS,   /* and focal length and distortion */
    TSUYA_ADJUST_CENTER, /* and the principal point */
} tsuya_adjust_what;
/* Bundle adjustment of FOLDER/INPUT to FOLDER/OUTPUT, on one processor: its sums depend on the number of threads. */
TSUYA_MUST_CHECK tsuya_status tsuya_colmap_adjust(tsuya_colmap *colmap, const char *input, const char *output, tsuya_adjust_what what);
/* Points for known poses: FOLDER/INPUT to FOLDER/OUTPUT. */
TSUYA_MUST_CHECK tsuya_status tsuya_colmap_triangulate(tsuya_colmap *colmap, const char *input, const char *output);
/* FOLDER/INPUT to the dense workspace FOLDER/OUTPUT, photographs at their full size; `scale` as tsuya_undistort_scale says. */
TSUYA_MUST_CHECK tsuya_status tsuya_colmap_undistort(tsuya_colmap *colmap, const char *input, const char *output, double scale);

#endif
