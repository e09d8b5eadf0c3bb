/* What a reader of an exported file would see, held against the material. */
#ifndef TSUYA_BRDF_EXPORT_LOSS_H
#define TSUYA_BRDF_EXPORT_LOSS_H

#include "brdf/export.h"
#include "brdf/samples.h"

#include <stdint.h>

/* Fills wi and wo: directions up to 80° from the normal, every other pair about the mirror direction, where cloth shines. */
void tsuya_export_pairs(tsuya_samples *samples, uint64_t seed);

typedef void (*tsuya_export_reader)(double *value, const void *user, tsuya_vec3 wi, tsuya_vec3 wo);
TSUYA_MUST_CHECK tsuya_status tsuya_export_measure(tsuya_export_loss *loss, const tsuya_material *material, tsuya_export_reader reader,
                                                   const void *user);

#endif
