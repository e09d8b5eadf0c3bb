/* Draws of a material's sampling against its own density, by Pearson's χ² on cells equal in solid angle. */
#ifndef TSUYA_TESTS_BRDF_CHI_SQUARE_H
#define TSUYA_TESTS_BRDF_CHI_SQUARE_H

#include "brdf/material.h"

#include <stdint.h>

/* χ² of 10⁶ draws of wi for this wo, as a standard normal: a test at 1 % over n of them (Šidák) fails above chi_square_bar(n). */
double chi_square_z(int *freedom, const tsuya_material *material, tsuya_vec3 wo, uint64_t stream);
double chi_square_bar(int tests);
/* The same of tsuya_material_looks_sample's draws. */
double chi_square_looks_z(int *freedom, const tsuya_material *material, tsuya_vec3 wo, uint64_t stream);

#endif
