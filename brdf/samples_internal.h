/* Readers of single formats, for brdf/samples*.c alone. */
#ifndef TSUYA_BRDF_SAMPLES_INTERNAL_H
#define TSUYA_BRDF_SAMPLES_INTERNAL_H

#include "brdf/samples.h"

TSUYA_MUST_CHECK tsuya_status tsuya_samples_from_klems(tsuya_samples *samples, const char *text, const char *name);
TSUYA_MUST_CHECK tsuya_status tsuya_samples_from_rgl(tsuya_samples *samples, const char *bytes, size_t size, const char *name);

#endif
