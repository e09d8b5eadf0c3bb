/* Baselines: one lobe of two shape parameters over a diffuse part, fitted in ∛(f cosθi). */
#ifndef TSUYA_BRDF_FIT_LOBES_H
#define TSUYA_BRDF_FIT_LOBES_H

#include "brdf/model.h"
#include "brdf/samples.h"

/* lambert, ggx, ggx-aniso, ward, ashikhmin: the state, and kd per channel. */
TSUYA_MUST_CHECK tsuya_status tsuya_fit_lobe(void **state, double *diffuse, const tsuya_brdf_model *model, const tsuya_samples *samples);

#endif
