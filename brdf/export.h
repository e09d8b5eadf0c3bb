/* Materials in the forms of other renderers, each with what is lost on the way. */
#ifndef TSUYA_BRDF_EXPORT_H
#define TSUYA_BRDF_EXPORT_H

#include "brdf/material.h"

/* Against the material on 4000 pairs of directions up to 80° from the normal. */
typedef struct tsuya_export_loss {
    double cbrt;                  /* e_cbrt */
    double de00_median, de00_p95; /* CIEDE2000 of the radiance factor π f under D65 */
    double bytes;
} tsuya_export_loss;

/* RGL tensor file (Dupuy & Jakob 2018) over the full circle of incidences, for Mitsuba 3's and pbrt's `measured`: tensor `rgb`, or `spectra`
 * with `wavelengths` where the channels are wavelengths (pbrt and spectral variants read only these) or where there is one channel, "visible"
 * say, which becomes a level spectrum.  vndf is constant, so its warp is the
 * identity; ndf is the material's retroreflection, sigma 1/4, and the values are f cosθo / ndf. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_export_rgl(tsuya_export_loss *loss, const char *path, const tsuya_material *material);
/* MERL's 90 × 90 × 180 table (Matusik et al. 2003): isotropic, so every value is the mean over the cloth's turns, which is what is
 * lost.  r, g, b only. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_export_merl(tsuya_export_loss *loss, const char *path, const tsuya_material *material);
/* glTF 2.0 with one material: base colour and roughness, KHR_materials_specular, _anisotropy and _sheen, fitted to the material over the
 * directions of the loss; the tangent is the weft.  Its `extras` hold the loss.  r, g, b only.  Cost: about a second. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_export_gltf(tsuya_export_loss *loss, const char *path, const tsuya_material *material);

#endif
