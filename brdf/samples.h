/* Measured reflectance: directions with values.  Everything downstream works on (wi, wo, f); goniometer tables, direction
 * tables, Klems matrices and RGL tensors are only ways to get there.
 *
 * Frame: x weft, y warp, z normal; wi to the light, wo to the viewer, both unit and above the surface.  Values are the BRDF in
 * sr⁻¹ without the cosine, whatever the file holds (brdf, brdf_cos, radiance, radiance_factor). */
#ifndef TSUYA_BRDF_SAMPLES_H
#define TSUYA_BRDF_SAMPLES_H

#include "core/geometry.h"
#include "core/status.h"

enum { TSUYA_SAMPLES_CHANNEL_SIZE = 16 };

typedef struct tsuya_samples {
    int count, channel_count;
    tsuya_vec3 *wi, *wo;
    double *value; /* count × channel_count, sr⁻¹; NaN: not usable (clipped) */
    char (*channel)[TSUYA_SAMPLES_CHANNEL_SIZE];
    double *azimuth_deg, *tilt_deg; /* of a goniometer's stage; NULL otherwise */
    double scale_sigma;             /* relative standard uncertainty of the common scale (scale_uncertainty=); NaN: not stated */
    bool relative;                  /* radiance without irradiance: known up to one common factor */
    int dropped_below, clipped, disagreeing; /* rows under the surface, values at the clip level, repeated rows that differ by > 10 % */
} tsuya_samples;

/* Lab directions that stand still while a stage turns by `azimuth_deg` and tilts by `tilt_deg`, in the sample's frame:
 * Rz(a)·Ry(−τ)·w.  With the light at 30°, 0 and the camera at 30°, 180: a = 90, τ = 10 gives wi = (0, sin 20°, cos 20°) and
 * wo = (0, −sin 40°, cos 40°). */
TSUYA_API tsuya_vec3 tsuya_goniometer_direction(double theta_deg, double phi_deg, double azimuth_deg, double tilt_deg);

/* Reads, by extension and content: a CSV of directions or of a goniometer, a Klems matrix (.xml, front reflection), an RGL tensor file (.bsdf).  Rows under the surface are left out and clipped values become NaN, each with one warning and a count; anything else
 * that is wrong fails with file, row and column.  tsuya_samples_free. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_samples_load(tsuya_samples *samples, const char *path);
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_samples_parse(tsuya_samples *samples, const char *text, const char *name_for_messages);
TSUYA_API void tsuya_samples_free(tsuya_samples *samples);

/* An empty table of that size, channels r, g, b when `channels` is NULL. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_samples_create(tsuya_samples *samples, int count, int channel_count,
                                                             const char *const *channels);
/* The same directions (and stage angles) with other channels, whose values are zero. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_samples_copy_frame(tsuya_samples *samples, const tsuya_samples *of, int channel_count,
                                                                 const char *const *channels);
/* The rows with keep[k] != 0. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_samples_copy(tsuya_samples *samples, const tsuya_samples *of, const unsigned char *keep);

/* Errors of predictions g (count × channel_count, sr⁻¹) against the values, all channels pooled, c = cosθi (MODEL):
 *   e_cbrt = sqrt(Σ (∛(g c) − ∛(f c))² / Σ ∛(f c)²),   e_log = mean |ln((g c + ε)/(f c + ε))|, ε = 1e-3 max(f c).
 * `channel` ≥ 0 restricts to one.  NaN where nothing is usable. */
typedef struct tsuya_brdf_error {
    double cbrt, log;
} tsuya_brdf_error;
TSUYA_API tsuya_brdf_error tsuya_samples_error(const tsuya_samples *samples, const double *predicted, int channel);

#endif
