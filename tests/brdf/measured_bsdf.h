/* RGL's measured BRDF as a renderer looks it up, written from the publication and from nothing of this program: J. Dupuy, W. Jakob, "An
 * Adaptive Parameterization for Efficient Material Acquisition and Rendering", ACM TOG 37(6), 2018, and the layout of its tensor files. */
#ifndef TSUYA_TESTS_BRDF_MEASURED_BSDF_H
#define TSUYA_TESTS_BRDF_MEASURED_BSDF_H

#include "core/geometry.h"

typedef struct measured_bsdf measured_bsdf;

/* NULL, with a line on stderr, for files that a renderer would refuse. */
measured_bsdf *measured_bsdf_open(const char *path);
void measured_bsdf_close(measured_bsdf *bsdf);

int measured_bsdf_channels(const measured_bsdf *bsdf);
/* Wavelengths in nm; NULL in files of r, g, b. */
const float *measured_bsdf_wavelengths(const measured_bsdf *bsdf);
/* f, sr⁻¹: wi to the light that the table is over, wo the other direction. */
void measured_bsdf_eval(double *value, const measured_bsdf *bsdf, tsuya_vec3 wi, tsuya_vec3 wo);
/* Density, sr⁻¹, with which a renderer draws wo for this wi. */
double measured_bsdf_pdf(const measured_bsdf *bsdf, tsuya_vec3 wi, tsuya_vec3 wo);

#endif
