/* Environment maps: radiance from every direction, importance sampled.
 *
 * Latitude–longitude images: the top row looks along `up`, the centre column along `direction`, columns to the right turn
 * to the right as seen from inside.  A map is constant over each pixel, so that its sampling density follows it exactly
 * (Pharr, Jakob, Humphreys, Physically Based Rendering, 3rd ed., 14.2.4). */
#ifndef TSUYA_RENDER_ENVIRONMENT_H
#define TSUYA_RENDER_ENVIRONMENT_H

#include "core/geometry.h"
#include "core/image.h"

typedef struct tsuya_environment tsuya_environment;

/* Copies a float image of three or more channels.  Fails on negative or non-finite pixels (named) and on images that are
 * black all over. `name` is for messages. */
TSUYA_MUST_CHECK tsuya_status tsuya_environment_create(tsuya_environment **environment, const tsuya_image *image,
                                                       tsuya_vec3 direction, tsuya_vec3 up, const char *name);
void tsuya_environment_free(tsuya_environment *environment);

void tsuya_environment_radiance(const tsuya_environment *environment, tsuya_vec3 direction, double rgb[3]);
/* Density, sr⁻¹, of tsuya_environment_sample. */
double tsuya_environment_pdf(const tsuya_environment *environment, tsuya_vec3 direction);
tsuya_vec3 tsuya_environment_sample(const tsuya_environment *environment, const double u[2]);
/* Mean radiance over the sphere, Rec.709 luminance. */
double tsuya_environment_mean(const tsuya_environment *environment);
/* The map's pixels, for stamps; borrowed. */
const void *tsuya_environment_bytes(const tsuya_environment *environment, size_t *bytes);

#endif
