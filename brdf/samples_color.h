/* Spectral samples as colours, and the spectrum of the lamp that they were measured under. */
#ifndef TSUYA_BRDF_SAMPLES_COLOR_H
#define TSUYA_BRDF_SAMPLES_COLOR_H

#include "brdf/samples.h"

#include <stdbool.h>

/* The wavelength of a channel's name ("nm555", 100 … 5000 nm); false for other names. */
TSUYA_API bool tsuya_channel_nm(double *nm, const char *name);
/* true when every channel is a wavelength */
TSUYA_API bool tsuya_samples_are_spectral(const tsuya_samples *samples);

typedef enum tsuya_color_space { TSUYA_COLOR_RGB, TSUYA_COLOR_XYZ } tsuya_color_space;

/* Colour of one spectrum of sr⁻¹ values (wavelengths ascending, held beyond the ends): what the cloth shows under D65, so a white
 * of f = 1/π gives 1/π in every channel.  D65 is Rec.709's own white: nothing is adapted. */
TSUYA_API void tsuya_color_of_spectrum(double color[3], const double *nm, const double *value, int count, tsuya_color_space space);

/* Three channels (r g b, linear Rec.709; or x y z) from spectral ones.  Clipped wavelengths make a row's colour NaN; colours outside
 * the gamut are held at 0, with one warning and their count.  Fails when the wavelengths do not reach from 430 to 670 nm or leave
 * gaps above 40 nm. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_samples_to_color(tsuya_samples *color, const tsuya_samples *spectral, tsuya_color_space space);

/* Power of a lamp at `count` wavelengths, 1 at 560 nm: "A", "D50", "D65", "E", a black body ("3200K"), or a table FILE.csv of nm,power
 * (beside `table_path` unless absolute; linear between rows, and it must span the wavelengths). */
TSUYA_MUST_CHECK tsuya_status tsuya_illuminant_power(double *power, const double *nm, int count, const char *illuminant, const char *table_path);

#endif
