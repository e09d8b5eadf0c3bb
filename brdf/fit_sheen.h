/* yarn, ndf and nurbs3 from samples; the guide of two yarns is fitted once and shared. */
#ifndef TSUYA_BRDF_FIT_SHEEN_H
#define TSUYA_BRDF_FIT_SHEEN_H

#include "brdf/samples.h"
#include "brdf/sheen.h"

/* The two yarns for `samples` (of more than a few thousand an even part is used). */
TSUYA_MUST_CHECK tsuya_status tsuya_fit_guide(tsuya_sheen **guide, const tsuya_samples *samples);
/* State of `model` over that guide. */
TSUYA_MUST_CHECK tsuya_status tsuya_fit_sheen(void **state, double *reciprocal_condition, const tsuya_brdf_model *model,
                                              const tsuya_sheen *guide, const tsuya_samples *samples);

#endif
