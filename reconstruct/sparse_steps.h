/* The steps of a reconstruction up to the undistorted workspace; the dense ones are in reconstruct.c. */
#ifndef TSUYA_RECONSTRUCT_SPARSE_STEPS_H
#define TSUYA_RECONSTRUCT_SPARSE_STEPS_H

#include "core/photo.h"
#include "reconstruct/colmap.h"
#include "reconstruct/precision.h"
#include "reconstruct/reconstruct.h"

typedef struct tsuya_reconstruction {
    const tsuya_reconstruct_options *options;
    const tsuya_context *context;
    tsuya_reconstruct_info *info;
    tsuya_photo_set photos;
    tsuya_colmap colmap;
    tsuya_steps steps;
    tsuya_precision precision; /* of the dense steps, known once the sparse ones are done */
    tsuya_arena *arena;
} tsuya_reconstruction;

/* OUTPUT/NAME, in the arena. */
const char *tsuya_reconstruction_path(const tsuya_reconstruction *r, const char *name);
/* The given camera; fails where it was made for another size than the photographs'. */
TSUYA_MUST_CHECK tsuya_status tsuya_reconstruction_camera(tsuya_camera *camera, const tsuya_reconstruction *r);
/* Ends the step at work with what its child processes took. */
TSUYA_MUST_CHECK tsuya_status tsuya_reconstruction_end_step(tsuya_reconstruction *r, const tsuya_json *figures);
TSUYA_MUST_CHECK tsuya_status tsuya_sparse_steps(tsuya_reconstruction *r);

#endif
