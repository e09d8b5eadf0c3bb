/* What the readers and the writer of COLMAP's sparse models share: its lens models, and a file's bytes with their bounds. */
#ifndef TSUYA_CORE_COLMAP_LENS_H
#define TSUYA_CORE_COLMAP_LENS_H

#include "core/camera.h"
#include "core/file.h"

#include <string.h>

typedef struct tsuya_colmap_lens {
    int id; /* COLMAP's model id */
    const char *name;
    tsuya_lens lens;
    int parameters;
} tsuya_colmap_lens;

enum { TSUYA_COLMAP_LENS_COUNT = 6, LARGEST_SIDE = 65535, LONGEST_NAME = 4096 };
extern const tsuya_colmap_lens tsuya_colmap_lenses[TSUYA_COLMAP_LENS_COUNT];

/* Principal points move by half a pixel here: COLMAP's first pixel has its centre at (0.5, 0.5). */
void tsuya_colmap_camera(tsuya_camera *camera, const tsuya_colmap_lens *entry, const double *p);
/* COLMAP's entry for a lens and its parameters (room for 12); NULL with a reason for lenses that COLMAP lacks. */
const tsuya_colmap_lens *tsuya_colmap_parameters(double *p, const tsuya_camera *camera);

typedef struct tsuya_colmap_reader {
    const char *path;
    char *bytes; /* owned */
    const char *at, *end;
    bool failed; /* read past the end, or a number that is not finite */
} tsuya_colmap_reader;

TSUYA_MUST_CHECK tsuya_status tsuya_colmap_open(tsuya_colmap_reader *r, const char *path);
static inline size_t tsuya_colmap_left(const tsuya_colmap_reader *r)
{
    return (size_t)(r->end - r->at);
}
TSUYA_MUST_CHECK tsuya_status tsuya_colmap_check_camera(const tsuya_colmap_reader *r, const tsuya_camera *camera, uint64_t width,
                                                        uint64_t height);
TSUYA_MUST_CHECK tsuya_status tsuya_colmap_new_cameras(tsuya_sparse_model *model, size_t count);

/* The parts of a model.  Views' points and tracks' views are COLMAP's ids until colmap_model.c links them. */
typedef tsuya_status (*tsuya_colmap_part_reader)(tsuya_colmap_reader *, tsuya_sparse_model *);
TSUYA_MUST_CHECK tsuya_status tsuya_colmap_cameras_binary(tsuya_colmap_reader *r, tsuya_sparse_model *model);
TSUYA_MUST_CHECK tsuya_status tsuya_colmap_views_binary(tsuya_colmap_reader *r, tsuya_sparse_model *model);
TSUYA_MUST_CHECK tsuya_status tsuya_colmap_points_binary(tsuya_colmap_reader *r, tsuya_sparse_model *model);
TSUYA_MUST_CHECK tsuya_status tsuya_colmap_cameras_text(tsuya_colmap_reader *r, tsuya_sparse_model *model);
TSUYA_MUST_CHECK tsuya_status tsuya_colmap_views_text(tsuya_colmap_reader *r, tsuya_sparse_model *model);
TSUYA_MUST_CHECK tsuya_status tsuya_colmap_points_text(tsuya_colmap_reader *r, tsuya_sparse_model *model);

#endif
