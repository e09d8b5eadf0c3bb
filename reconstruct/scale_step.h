/* The step that makes a reconstruction metric. */
#ifndef TSUYA_RECONSTRUCT_SCALE_STEP_H
#define TSUYA_RECONSTRUCT_SCALE_STEP_H

#include "reconstruct/sparse_steps.h"

/* The folder of the model as COLMAP made it: sparse/0 itself where no scale is asked for. */
const char *tsuya_scale_unscaled(const tsuya_reconstruction *r);
/* Of everything that the scale rests on. */
TSUYA_MUST_CHECK tsuya_status tsuya_scale_hash(tsuya_hash *hash, const tsuya_scale_input *input);
/* unscaled/ to sparse/0; nothing where no scale is asked for. */
TSUYA_MUST_CHECK tsuya_status tsuya_scale_step(tsuya_reconstruction *r);

#endif
