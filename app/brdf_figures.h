/* Figures of a fit, as `tsuya brdf fit`, `tsuya brdf compare` and stage brdf write them. */
#ifndef TSUYA_APP_BRDF_FIGURES_H
#define TSUYA_APP_BRDF_FIGURES_H

#include "brdf/fit.h"
#include "core/json.h"

void tsuya_brdf_figures(tsuya_json *figures, const tsuya_fit_info *info);
/* "candidates": one object a model that was tried. */
void tsuya_brdf_candidates(tsuya_json *figures, const tsuya_fit_info *candidates, int count);

#endif
