#include "capture/studio_sensor.h"

#include "core/memory.h"

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

static void store(const tsuya_image *photograph, int x, int y, const float value[3])
{
    for (int c = 0; c < 3; c++) {
        if (photograph->sample == TSUYA_SAMPLE_U16) {
            tsuya_image_u16(photograph, x, y)[c] = (uint16_t)lroundf(65535.0f * tsuya_srgb_encode(value[c]));
        } else {
            tsuya_image_u8(photograph, x, y)[c] = (uint8_t)lroundf(255.0f * tsuya_srgb_encode(value[c]));
        }
    }
}

static tsuya_status develop_mosaic(tsuya_image *photograph, const tsuya_image *radiance, const tsuya_studio_sensor *sensor, uint64_t stream,
                                   const tsuya_context *context)
{
    int width = radiance->width_px, height = radiance->height_px;
    float *mosaic = tsuya_calloc((size_t)width * (size_t)height, sizeof *mosaic);
    if (!mosaic) {
        return TSUYA_ERROR_MEMORY;
    }
#pragma omp parallel for schedule(static) num_threads(context->threads)
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            size_t pixel = (size_t)y * (size_t)width + (size_t)x;
            float from = tsuya_image_f32(radiance, x, y)[tsuya_studio_bayer_channel(x, y)];
            mosaic[pixel] = fminf(expose(from, sensor, context->seed, stream, pixel), 1.0f); /* the well's end comes before the interpolation */
        }
    }
#pragma omp parallel for schedule(static) num_threads(context->threads)
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            float rgb[3];
            tsuya_studio_demosaic(rgb, mosaic, width, height, x, y);
            store(photograph, x, y, rgb);
        }
    }
    tsuya_free(mosaic);
    return TSUYA_OK;
}

tsuya_status tsuya_studio_develop(tsuya_image *photograph, const tsuya_image *radiance, const tsuya_studio_sensor *sensor,
                                  uint64_t stream, const tsuya_context *context)
{
    TSUYA_TRY(tsuya_image_create(photograph, radiance->width_px, radiance->height_px, 3, sensor->deep ? TSUYA_SAMPLE_U16 : TSUYA_SAMPLE_U8,
                                 TSUYA_ENCODING_SRGB));
    if (sensor->bayer) {
        return develop_mosaic(photograph, radiance, sensor, stream, context);
    }
#pragma omp parallel for schedule(static) num_threads(context->threads)
    for (int y = 0; y < radiance->height_px; y++) {
        for (int x = 0; x < radiance->width_px; x++) {
            const float *from = tsuya_image_f32(radiance, x, y);
            float value[3];
            uint64_t counter = 3 * ((uint64_t)y * (uint64_t)radiance->width_px + (uint64_t)x);
            for (int c = 0; c < 3; c++) {
                value[c] = expose(from[c], sensor, context->seed, stream, counter + (uint64_t)c);
            }
            store(photograph, x, y, value);
        }
    }
    return TSUYA_OK;
}
