#include "render/film.h"

#include "core/color.h"
#include "core/memory.h"
#include "core/order.h"

#include <math.h>

static const float half_largest = 65504.0f;

tsuya_status tsuya_film_save_exr(const tsuya_film *film, const char *path, const tsuya_film_note *note)
{
    tsuya_image image;
    TSUYA_TRY(tsuya_image_create(&image, film->width_px, film->height_px, 4, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    for (int y = 0; y < film->height_px; ++y) {
        for (int x = 0; x < film->width_px; ++x) {
            size_t k = (size_t)y * (size_t)film->width_px + (size_t)x;
            float *pixel = tsuya_image_f32(&image, x, y);
            for (size_t c = 0; c < 3; ++c) {
                pixel[c] = fminf(film->rgb[3 * k + c], half_largest);
            }
            pixel[3] = film->alpha[k];
        }
    }
    tsuya_image_save_options options = tsuya_image_save_options_default();
    options.exr_half = true;
    options.attribute_count = note->count;
    options.attribute_name = note->name;
    options.attribute_value = note->value;
    tsuya_status status = tsuya_image_save(&image, path, &options);
    tsuya_image_free(&image);
    return status;
}

tsuya_mat3 tsuya_film_adaptation(const double white[3])
{
    const tsuya_vec3 unit[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}}, from = tsuya_xyz_from_rgb((tsuya_vec3){white[0], white[1], white[2]});
    tsuya_mat3 adapt;
    for (int c = 0; c < 3; ++c) { /* a primary's way through it, as a column */
        tsuya_vec3 rgb = tsuya_rgb_from_xyz(tsuya_xyz_adapt(tsuya_xyz_from_rgb(unit[c]), from, tsuya_white_d65()));
        adapt.e[0][c] = rgb.x;
        adapt.e[1][c] = rgb.y;
        adapt.e[2][c] = rgb.z;
    }
    return adapt;
}

tsuya_status tsuya_film_save_png(const tsuya_film *film, const char *path, double exposure_ev, const tsuya_mat3 *adapt)
{
    tsuya_image image;
    float gain = (float)exp2(exposure_ev);
    TSUYA_TRY(tsuya_image_create(&image, film->width_px, film->height_px, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    for (int y = 0; y < film->height_px; ++y) {
        for (int x = 0; x < film->width_px; ++x) {
            const float *seen = film->rgb + 3 * ((size_t)y * (size_t)film->width_px + (size_t)x);
            float linear[3] = {seen[0], seen[1], seen[2]};
            if (adapt) {
                tsuya_vec3 v = tsuya_mat3_apply(*adapt, (tsuya_vec3){seen[0], seen[1], seen[2]});
                linear[0] = (float)v.x;
                linear[1] = (float)v.y;
                linear[2] = (float)v.z;
            }
            uint8_t *pixel = tsuya_image_u8(&image, x, y);
            for (int c = 0; c < 3; ++c) {
                pixel[c] = (uint8_t)lrintf(255.0f * tsuya_srgb_encode(gain * linear[c]));
            }
        }
    }
    tsuya_status status = tsuya_image_save(&image, path, NULL);
    tsuya_image_free(&image);
    return status;
}

tsuya_status tsuya_film_card_exposure(double *exposure_ev, double white[3], const tsuya_film *film)
{
    size_t pixels = (size_t)film->width_px * (size_t)film->height_px, count = 0;
    double sum[3] = {0, 0, 0};
    float *luminance = tsuya_calloc(pixels, sizeof *luminance);
    if (!luminance) {
        return TSUYA_ERROR_MEMORY;
    }
    for (size_t k = 0; k < pixels; ++k) {
        const float *rgb = film->rgb + 3 * k;
        if (film->alpha[k] > 0.5f) {
            for (int c = 0; c < 3; ++c) {
                sum[c] += rgb[c];
            }
            luminance[count++] = (float)tsuya_rgb_luminance_f32(rgb);
        }
    }
    double middle = count > 0 ? (double)tsuya_select_float(luminance, count, (count - 1) / 2) : 0.0;
    *exposure_ev = middle > 0.0 ? -log2(middle) : 0.0;
    double y = tsuya_rgb_luminance(sum);
    for (int c = 0; c < 3; ++c) {
        white[c] = y > 0.0 ? sum[c] / y : 1.0;
    }
    tsuya_free(luminance);
    return TSUYA_OK;
}

tsuya_status tsuya_film_rmse(double *rmse, const tsuya_film *film, const char *reference_path)
{
    tsuya_image image = {0}, linear = {0};
    tsuya_status status = TSUYA_OK;
    double sum = 0.0;
    TSUYA_GOTO_DONE(status, tsuya_image_load(&image, reference_path));
    TSUYA_GOTO_DONE(status, tsuya_image_convert(&linear, &image, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    if (linear.width_px != film->width_px || linear.height_px != film->height_px || linear.channels < 3) {
        TSUYA_GOTO_DONE(status, tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d × %d with %d channels; the picture has %d × %d and r, g, b",
                                           reference_path, linear.width_px, linear.height_px, linear.channels, film->width_px,
                                           film->height_px));
    }
    for (int y = 0; y < film->height_px; ++y) {
        for (int x = 0; x < film->width_px; ++x) {
            const float *a = film->rgb + 3 * ((size_t)y * (size_t)film->width_px + (size_t)x), *b = tsuya_image_f32(&linear, x, y);
            for (int c = 0; c < 3; ++c) {
                double d = (double)a[c] - b[c];
                sum += d * d;
            }
        }
    }
    *rmse = sqrt(sum / (3.0 * film->width_px * film->height_px));
done:
    tsuya_image_free(&image);
    tsuya_image_free(&linear);
    return status;
}
