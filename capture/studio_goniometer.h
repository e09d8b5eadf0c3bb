/* The paper's bench: lamp and camera stand still, a flat sample turns about its normal and tilts; readings as a CSV table.
 *
 * Lab frame, right-handed, z the sample's normal at tilt 0, the stage tilts about +y.  Azimuth a and tilt τ give
 * w = Rz(a)·Ry(−τ)·w_lab in the sample's frame (x weft, y warp, z normal). */
#ifndef TSUYA_CAPTURE_STUDIO_GONIOMETER_H
#define TSUYA_CAPTURE_STUDIO_GONIOMETER_H

#include "core/context.h"
#include "core/geometry.h"

/* What lies on the stage: BRDF in sr⁻¹, r g b. */
typedef void (*tsuya_reflectance)(const void *user, tsuya_vec3 wi, tsuya_vec3 wo, double rgb[3]);

typedef struct tsuya_goniometer {
    double light_theta_deg, light_phi_deg, view_theta_deg, view_phi_deg;
    double azimuth_step_deg; /* from 0 to below 180 */
    double tilt_step_deg, tilt_most_deg;
    double irradiance;       /* of a facing surface, W m⁻² */
    double full_radiance;    /* where the camera's 16 bits end; 0: 1.25 times the brightest reading */
    double gain_noise;       /* standard deviation, relative to the reading */
    double floor_noise;      /* standard deviation, relative to the full range */
} tsuya_goniometer;

/* A lab direction in the frame of the tilted and turned sample. */
TSUYA_API tsuya_vec3 tsuya_goniometer_on_stage(tsuya_vec3 w_lab, double azimuth_deg, double tilt_deg);
/* ±30°, azimuths 0 45 90 135, tilts −57 … 57 by 3°, 1 % noise. */
TSUYA_API tsuya_goniometer tsuya_goniometer_default(void);
/* Writes the table (quantity=radiance), rows by azimuth and tilt; positions that turn lamp or camera below the sample are left
 * out.  Fails on steps or angles that make no table. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_goniometer_write(const char *path, const tsuya_goniometer *bench,
                                                               tsuya_reflectance reflectance, const void *user,
                                                               const tsuya_context *context);

#endif
