/* The step that matches photographs: pairs by pairs.h, features by matching.h; COLMAP verifies the pairs without given
 * poses by RANSAC (in one thread, so that its draws come in one order), and where photographs
 * have few features what it finds leads to further matches along the epipolar lines. */
#ifndef TSUYA_RECONSTRUCT_MATCH_STEPS_H
#define TSUYA_RECONSTRUCT_MATCH_STEPS_H

#include "reconstruct/sparse_steps.h"

/* With given poses the model "posed" must stand, with the database's ids. */
TSUYA_MUST_CHECK tsuya_status tsuya_match_step(tsuya_reconstruction *r);

#endif
