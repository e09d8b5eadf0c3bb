/* A camera's readings at many angles and a radiometer's spectra at few of them, as one table (paper 3.2).
 *
 * The camera alone is fitted first, which gives its r, g, b at the radiometer's directions (only those that lie within 7° of
 * camera readings link the two).  From these pairs comes a linear map from the camera's r, g, b to the wanted channels: on the
 * principal axes of the camera's own readings, as many of them (1 … 3) as predict left-out pairs best, so that a grey sheen does not
 * invent colours.  The camera's rows go through the map, the radiometer's are added as they are.
 *
 * Scales: L ± σ, the mean logarithm of radiometer over camera, is shared between the two by their scale_uncertainty=: the corrections
 * s are the most probable ones given s_camera − s_radiometer = L.  A relative table takes the other's scale; where neither states an
 * uncertainty the radiometer's scale is kept. */
#ifndef TSUYA_BRDF_SAMPLES_JOIN_H
#define TSUYA_BRDF_SAMPLES_JOIN_H

#include "brdf/samples.h"
#include "core/context.h"

#include <stdbool.h>

typedef struct tsuya_join_info {
    int camera, radiometer, linked; /* rows; radiometer rows that link the two */
    int rank;
    double gain[3], gain_sigma[3];             /* radiometer over camera, per r g b, with the standard error of the mean */
    double camera_scale, radiometer_scale;     /* factors that the tables were given to agree */
    double scale_sigma;                        /* relative standard uncertainty of the joined scale; NaN: not stated */
    double residual;                           /* e_cbrt of left-out pairs through the map */
    bool relative;
} tsuya_join_info;

/* `spectral`: the radiometer's wavelengths are the channels of the result, else r, g, b.  Fails when the camera's channels are not
 * r, g, b, the radiometer's not wavelengths, or fewer than 4 of its rows link the two. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_samples_join(tsuya_samples *joined, tsuya_join_info *info, const tsuya_samples *camera,
                                                           const tsuya_samples *radiometer, bool spectral, const tsuya_context *context);

#endif
