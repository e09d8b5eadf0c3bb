/* A render held against a photograph: figures of pictures whose differences are known. */
#include "support.h"

#include "core/color.h"

#include "render/compare.h"

enum { W = 96, H = 64 };

/* A soft pattern that stays well inside (0, 1). */
static void fill_pattern(tsuya_image *render)
{
    assert_ok(tsuya_image_create(render, W, H, 4, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    for (int k = 0; k < W * H; ++k) {
        int x = k % W, y = k / W;
        float *p = tsuya_image_f32(render, x, y), wave = (float)(0.2 + 0.1 * sin(0.3 * x) * cos(0.2 * y));
        p[0] = wave;
        p[1] = 0.7f * wave + 0.05f;
        p[2] = 0.3f;
        p[3] = x < W / 2 + 20 ? 1.0f : 0.0f; /* the cloth */
    }
}

/* The photograph that gain makes of the render, sRGB of 16 bits. */
static void make_photo(tsuya_image *photo, const tsuya_image *render, const double gain[3])
{
    tsuya_image linear;
    assert_ok(tsuya_image_create(&linear, render->width_px, render->height_px, 3, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    for (int k = 0; k < W * H; ++k) {
        for (int c = 0; c < 3; ++c) {
            tsuya_image_f32(&linear, k % W, k / W)[c] = (float)(gain[c] * (double)tsuya_image_f32(render, k % W, k / W)[c]);
        }
    }
    assert_ok(tsuya_image_convert(photo, &linear, TSUYA_SAMPLE_U16, TSUYA_ENCODING_SRGB));
    tsuya_image_free(&linear);
}

static tsuya_comparison compare(tsuya_image *map, const tsuya_image *render, const tsuya_image *photo, const tsuya_image *mask,
                                const tsuya_compare_options *options)
{
    tsuya_context context = tsuya_context_default();
    tsuya_comparison result;
    assert_ok(tsuya_compare(&result, map, NULL, render, photo, mask, options, "test", &context));
    return result;
}

static void test_gain_is_recovered(void **state)
{
    (void)state;
    tsuya_image render, photo;
    const double gain[3] = {1.7, 1.2, 0.6};
    tsuya_compare_options options = tsuya_compare_options_default();
    fill_pattern(&render);
    make_photo(&photo, &render, gain);
    tsuya_comparison r = compare(NULL, &render, &photo, NULL, &options);
    for (int c = 0; c < 3; ++c) {
        assert_true(fabs(r.gain[c] - gain[c]) < 1e-4 * gain[c]);
    }
    assert_true(r.fitted && r.psnr_db > 70.0 && r.ssim > 0.9999 && r.de00_mean < 0.01 && r.de00_p95 <= 0.04);
    assert_true(r.pixels == (W / 2 + 20) * H && r.compared == 1.0);
    options.gain[0] = options.gain[1] = options.gain[2] = 1.0; /* given: nothing is fitted, and the colours differ */
    r = compare(NULL, &render, &photo, NULL, &options);
    assert_true(!r.fitted && r.gain[0] == 1.0 && r.de00_mean > 5.0);
    tsuya_image_free(&render);
    tsuya_image_free(&photo);
}

/* Every encoded value off by the same amount: PSNR by its definition, and ΔE00 of grey patches by the difference itself. */
static void test_known_difference(void **state)
{
    (void)state;
    tsuya_image render, photo, map, mask;
    const float grey = 0.2f, other = 0.25f;
    tsuya_compare_options options = {.gain = {1.0, 1.0, 1.0}};
    fill_pattern(&render);
    assert_ok(tsuya_image_create(&photo, W, H, 3, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    assert_ok(tsuya_image_create(&mask, W, H, 1, TSUYA_SAMPLE_U8, TSUYA_ENCODING_DATA));
    for (int k = 0; k < W * H; ++k) {
        for (int c = 0; c < 3; ++c) {
            tsuya_image_f32(&render, k % W, k / W)[c] = grey;
            tsuya_image_f32(&photo, k % W, k / W)[c] = other;
        }
        *tsuya_image_u8(&mask, k % W, k / W) = k / W < H / 2 ? 255 : 0; /* upper half */
    }
    tsuya_comparison r = compare(&map, &render, &photo, &mask, &options);
    double d = (double)tsuya_srgb_encode(other) - (double)tsuya_srgb_encode(grey);
    double e = tsuya_color_difference(tsuya_lab_from_rgb((tsuya_vec3){0.2, 0.2, 0.2}), tsuya_lab_from_rgb((tsuya_vec3){0.25, 0.25, 0.25}));
    assert_true(fabs(r.psnr_db + 20.0 * log10(d)) < 1e-4);
    assert_true(fabs(r.de00_mean - e) < 1e-4 && fabs(r.de00_median - e) < 0.02 && fabs(r.de00_p95 - e) < 0.02);
    assert_true(r.pixels == (W / 2 + 20) * (H / 2) && fabs(r.compared - (W / 2 + 20.0) / W) < 1e-12);
    assert_true(*tsuya_image_f32(&map, 3, 3) > 0.0f && *tsuya_image_f32(&map, 3, H - 1) == -1.0f && *tsuya_image_f32(&map, W - 1, 3) == -1.0f);
    /* flat patches differ in their mean alone: the first factor of SSIM */
    double a = tsuya_srgb_encode(grey), b = tsuya_srgb_encode(other), expected = (2 * a * b + 1e-4) / (a * a + b * b + 1e-4);
    assert_true(fabs(r.ssim - expected) < 1e-3);
    tsuya_image_free(&render);
    tsuya_image_free(&photo);
    tsuya_image_free(&map);
    tsuya_image_free(&mask);
}

/* Noise, blur and shifts lower SSIM; a larger photograph of the same scene is made smaller first. */
static void test_structure_and_size(void **state)
{
    (void)state;
    tsuya_image render, photo, noisy, large;
    const double one[3] = {1, 1, 1};
    tsuya_compare_options options = {.gain = {1.0, 1.0, 1.0}};
    fill_pattern(&render);
    make_photo(&photo, &render, one);
    assert_ok(tsuya_image_convert(&noisy, &photo, TSUYA_SAMPLE_F32, TSUYA_ENCODING_SRGB));
    for (int k = 0; k < W * H; ++k) {
        for (int c = 0; c < 3; ++c) {
            tsuya_image_f32(&noisy, k % W, k / W)[c] += (float)(0.1 * tsuya_random_normal(1, (uint64_t)c, (uint64_t)k));
        }
    }
    tsuya_comparison r = compare(NULL, &render, &noisy, NULL, &options);
    assert_true(r.ssim < 0.6 && r.ssim > 0.0 && fabs(r.psnr_db - 20.0) < 0.5);
    assert_ok(tsuya_image_create(&large, 2 * W, 2 * H, 3, TSUYA_SAMPLE_U16, TSUYA_ENCODING_SRGB));
    for (int k = 0; k < 4 * W * H; ++k) {
        memcpy(tsuya_image_u16(&large, k % (2 * W), k / (2 * W)), tsuya_image_u16(&photo, k % (2 * W) / 2, k / (2 * W) / 2), 6);
    }
    r = compare(NULL, &render, &large, NULL, &options);
    assert_true(r.ssim > 0.9999 && r.de00_mean < 0.01);
    tsuya_image_free(&render);
    tsuya_image_free(&photo);
    tsuya_image_free(&noisy);
    tsuya_image_free(&large);
}

static void test_quantiles_and_picture(void **state)
{
    (void)state;
    tsuya_de00_histogram *histogram = calloc(1, sizeof *histogram);
    assert_non_null(histogram);
    assert_true(isnan(tsuya_de00_quantile(histogram, 0.5)));
    for (int k = 0; k < 1000; ++k) {
        histogram->count[k]++;
        histogram->pixels++;
    }
    assert_true(fabs(tsuya_de00_quantile(histogram, 0.5) - 10.0) < 0.03 && fabs(tsuya_de00_quantile(histogram, 0.95) - 19.0) < 0.03);
    free(histogram);
    tsuya_image render, photo, map, picture;
    const double gain[3] = {1, 1, 2};
    tsuya_compare_options options = {.gain = {1.0, 1.0, 1.0}};
    fill_pattern(&render);
    make_photo(&photo, &render, gain);
    tsuya_comparison r = compare(&map, &render, &photo, NULL, &options);
    assert_ok(tsuya_compare_picture(&picture, &r, &map, &render, &photo));
    int width = W / 2 + 20 + 2 + W / 50;
    assert_true(picture.height_px == H && picture.width_px == 3 * width + 2 * (2 + width / 60));
    const uint8_t *left = tsuya_image_u8(&picture, 10, 10), *middle = tsuya_image_u8(&picture, width + 2 + width / 60 + 10, 10);
    assert_true(abs(left[0] - middle[0]) <= 1 && abs(left[1] - middle[1]) <= 1 && left[2] > middle[2] + 30);
    tsuya_image_free(&render);
    tsuya_image_free(&photo);
    tsuya_image_free(&map);
    tsuya_image_free(&picture);
}

static void test_refusals(void **state)
{
    (void)state;
    tsuya_image render, photo, wide;
    const double one[3] = {1, 1, 1};
    tsuya_compare_options options = tsuya_compare_options_default();
    tsuya_context context = tsuya_context_default();
    tsuya_comparison r;
    fill_pattern(&render);
    make_photo(&photo, &render, one);
    assert_ok(tsuya_image_create(&wide, W, 2 * H, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    assert_fails(tsuya_compare(&r, NULL, NULL, &render, &wide, NULL, &options, "wide.jpg", &context), "wide.jpg");
    for (int k = 0; k < W * H; ++k) {
        tsuya_image_f32(&render, k % W, k / W)[3] = 0.0f;
    }
    assert_fails(tsuya_compare(&r, NULL, NULL, &render, &photo, NULL, &options, "empty.jpg", &context), "empty.jpg");
    tsuya_image_free(&render);
    tsuya_image_free(&photo);
    tsuya_image_free(&wide);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_gain_is_recovered),     cmocka_unit_test(test_known_difference),
        cmocka_unit_test(test_structure_and_size),    cmocka_unit_test(test_quantiles_and_picture),
        cmocka_unit_test(test_refusals),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
