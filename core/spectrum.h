/* Spectra to colours: flames, daylight, and cloth that was measured wavelength by wavelength.
 *
 * The 2° observer is the multi-lobe fit of Wyman, Sloan, Shirley, "Simple analytic approximations to the CIE XYZ color matching
 * functions", JCGT 2(2), 2013; daylight is the CIE's D series (CIE 15:2004). */
#ifndef TSUYA_CORE_SPECTRUM_H
#define TSUYA_CORE_SPECTRUM_H

#include "core/geometry.h"
#include "core/status.h"

/* x̄, ȳ, z̄ at a wavelength. */
TSUYA_API tsuya_vec3 tsuya_observer(double nm);
/* Relative power of the D series, 1 at 560 nm; 380 … 780 nm, temperature 4000 … 25000 K (held at the ends). */
TSUYA_API double tsuya_daylight_power(double nm, double temperature_k);
/* Black body whose relative power is the CIE illuminant A (CIE 15: exp(1.435e7/(2848 λ)); 2855.5 K with the c2 of today). */
#define TSUYA_ILLUMINANT_A_K (1.438777e7 * 2848.0 / 1.435e7)
/* Planck's law, relative, 1 at 560 nm. */
TSUYA_API double tsuya_blackbody_power(double nm, double temperature_k);
/* Linear Rec.709 of luminance 1 for a lamp's XYZ, or for daylight; what lies outside the gamut is held at 0. */
TSUYA_API tsuya_vec3 tsuya_rgb_of_lamp(tsuya_vec3 xyz);
TSUYA_API tsuya_vec3 tsuya_rgb_of_daylight(double temperature_k);
/* XYZ (Y = 1 for white) of a reflectance under D65, as tsuya_rgb_of_reflectance; the white is exactly D65's, so that nothing has
 * to be adapted. */
TSUYA_API tsuya_vec3 tsuya_xyz_of_reflectance(const double *nm, const double *reflectance, int count);
/* Linear Rec.709 of a reflectance under D65, 380 … 780 nm; linear between the samples, held beyond them.  nm ascending; a
 * reflectance of 1 everywhere gives (1, 1, 1).  May leave [0, 1] for colours outside the gamut. */
TSUYA_API tsuya_vec3 tsuya_rgb_of_reflectance(const double *nm, const double *reflectance, int count);

#endif
