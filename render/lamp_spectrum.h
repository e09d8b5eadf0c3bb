/* What colours a lamp sends: relative power by wavelength. */
#ifndef TSUYA_RENDER_LAMP_SPECTRUM_H
#define TSUYA_RENDER_LAMP_SPECTRUM_H

#include "core/geometry.h"
#include "core/status.h"

enum { TSUYA_SPECTRUM_FIRST_NM = 380, TSUYA_SPECTRUM_COUNT = 401 }; /* 380 … 780 nm, every nm */

typedef struct tsuya_lamp_spectrum {
    double power[TSUYA_SPECTRUM_COUNT]; /* of luminance 1: Σ power · tsuya_display_observer has Y = 1 */
} tsuya_lamp_spectrum;

/* The 2° observer (core/spectrum.h) with x̄ and z̄ scaled, by less than 0.1 %, so that its D65 is Rec.709's white to the digit. */
TSUYA_API tsuya_vec3 tsuya_display_observer(double nm);

/* `name`: "halogen" (a black body of 3000 K), "led" (warm white near 3000 K: a blue pump at 452 nm, 22 nm wide in the form of Y. Ohno,
 * "Spectral design considerations for white LED color rendering", Optical Engineering 44, 2005, and a phosphor's broad lobe at
 * 590 nm; no measured lamp), "daylight" (D65), "A", "D50", "D65", "E", a black body ("3200K"), "D5400K" (daylight of that
 * temperature), or a table FILE.csv of nm,power beside `folder` (linear between rows, dark beyond them).  Fails, naming what would
 * be accepted, on other names, on tables that are not ascending, negative, or do not reach from 430 to 670 nm. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_lamp_spectrum_load(tsuya_lamp_spectrum *spectrum, const char *name, const char *folder);

/* Linear Rec.709 of it, luminance 1; what lies outside the gamut is held at 0. */
TSUYA_API tsuya_vec3 tsuya_lamp_spectrum_rgb(const tsuya_lamp_spectrum *spectrum);

#endif
