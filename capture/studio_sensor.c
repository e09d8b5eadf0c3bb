#include "capture/studio_sensor.h"

#include <math.h>

tsuya_studio_sensor tsuya_studio_sensor_default(void)
{
    return (tsuya_studio_sensor){.full_radiance = 1.0, .full_well_e = 20000.0, .read_noise_e = 4.0};
}

static float expose(float radiance, const tsuya_studio_sensor *s, uint64_t seed, uint64_t stream, uint64_t counter)
{
    double signal = fmax(0.0, (double)radiance / s->full_radiance);
    if (!(s->full_well_e > 0.0)) {
        return (float)signal;
    }
    double electrons = fmin(signal, 4.0) * s->full_well_e;
    double sigma = sqrt(electrons + s->read_noise_e * s->read_noise_e);
    return (float)((electrons + sigma * tsuya_random_normal(seed, stream, counter)) / s->full_well_e);
}

tsuya_status tsuya_studio_develop(tsuya_image *photograph, const tsuya_image *radiance, const tsuya_studio_sensor *sensor,
                                  uint64_t stream, const tsuya_context *context)
{
    TSUYA_TRY(tsuya_image_create(photograph, radiance->width_px, radiance->height_px, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
#pragma omp parallel for schedule(static) num_threads(context->threads)
    for (int y = 0; y < radiance->height_px; y++) {
        for (int x = 0; x < radiance->width_px; x++) {
            const float *from = tsuya_image_f32(radiance, x, y);
            uint8_t *to = tsuya_image_u8(photograph, x, y);
            uint64_t counter = 3 * ((uint64_t)y * (uint64_t)radiance->width_px + (uint64_t)x);
            for (int c = 0; c < 3; c++) {
                float value = expose(from[c], sensor, context->seed, stream, counter + (uint64_t)c);
                to[c] = (uint8_t)lroundf(255.0f * tsuya_srgb_encode(value));
            }
        }
    }
    return TSUYA_OK;
}
