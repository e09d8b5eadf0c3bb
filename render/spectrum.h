/* Spectra to colours: flames, daylight, and cloth that was measured wavelength by wavelength.
 *
 * The 2° observer is the multi-lobe fit of Wyman, Sloan, Shirley, "Simple analytic approximations to the CIE XYZ color matching
 * functions", JCGT 2(2), 2013; daylight is the CIE's D series (CIE 15:2004). */
#ifndef TSUYA_RENDER_SPECTRUM_H
#define TSUYA_RENDER_SPECTRUM_H

#include "core/geometry.h"
#include "core/status.h"

/* x̄, ȳ, z̄ at a wavelength. */
TSUYA_API tsuya_vec3 tsuya_observer(double nm);
/* Relative power of the D series, 1 at 560 nm; 380 … 780 nm, temperature 4000 … 25000 K (held at the ends). */
TSUYA_API double tsuya_daylight_power(double nm, double temperature_k);
/* Planck's law, relative, 1 at 560 nm. */
TSUYA_API double tsuya_blackbody_power(double nm, double temperature_k);
/* Linear Rec.709 of luminance 1 for a black body or for daylight; what lies outside the gamut is held at 0. */
TSUYA_API tsuya_vec3 tsuya_rgb_of_blackbody(double temperature_k);
TSUYA_API tsuya_vec3 tsuya_rgb_of_daylight(double temperature_k);
/* Linear Rec.709 of a reflectance under D65, 380 … 780 nm; linear between the samples, held beyond them.  nm ascending; a
 * reflectance of 1 everywhere gives (1, 1, 1).  May leave [0, 1] for colours outside the gamut. */
TSUYA_API tsuya_vec3 tsuya_rgb_of_reflectance(const double *nm, const double *reflectance, int count);

#endif
