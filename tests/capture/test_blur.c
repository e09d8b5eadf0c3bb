/* Widths of edges against edges of known width. */
#include "support.h"

#include "capture/check.h"

#include <math.h>

/* Stripes every 48 px whose gradient points along `angle`, each a step blurred by a Gaussian (its integral, erf) or by a box
 * of the camera's path (its integral, a ramp), integrated over the pixel's centre; plus white noise. */
static void stripes(tsuya_image *image, double angle_rad, double gaussian_px, double box_px, double noise, uint64_t seed)
{
    enum { SIDE = 512, PERIOD = 48 };
    assert_ok(tsuya_image_create(image, SIDE, SIDE, 1, TSUYA_SAMPLE_F32, TSUYA_ENCODING_SRGB));
    for (int y = 0; y < SIDE; y++) {
        for (int x = 0; x < SIDE; x++) {
            double s = x * cos(angle_rad) + y * sin(angle_rad) + 4.0 * PERIOD * PERIOD, value = 0.0;
            for (int k = -1; k <= 2; k++) {
                double d = s - PERIOD * (floor(s / PERIOD) + k);
                double step = box_px > 0.0 ? fmin(fmax(d / box_px + 0.5, 0.0), 1.0) : 0.5 * (1.0 + erf(d / (sqrt(2.0) * gaussian_px)));
                value += (((long long)floor(s / PERIOD) + k) % 2 ? 1.0 : -1.0) * step;
            }
            double base = (long long)(floor(s / PERIOD) - 2) % 2 ? 0.75 : 0.25;
            uint64_t counter = (uint64_t)(y * SIDE + x);
            *tsuya_image_f32(image, x, y) = (float)(base + 0.5 * value + noise * tsuya_random_normal(seed, 7, counter));
        }
    }
}

static double measured(double angle_rad, double gaussian_px, double box_px, double noise)
{
    tsuya_image image = {0};
    tsuya_blur blur;
    tsuya_context context = tsuya_context_default();
    stripes(&image, angle_rad, gaussian_px, box_px, noise, 3);
    assert_ok(tsuya_blur_measure(&blur, &image, NULL, &context));
    tsuya_image_free(&image);
    return blur.worst_px;
}

static void known_gaussian_widths_are_found(void **state)
{
    (void)state;
    static const double sigma[] = {0.6, 1.0, 1.5, 2.0, 3.0, 4.0};
    for (size_t i = 0; i < sizeof sigma / sizeof sigma[0]; i++) {
        for (int turn = 0; turn < 8; turn++) {
            double found = measured(turn * M_PI / 8.0 + 0.05, sigma[i], 0.0, 0.004);
            if (fabs(found - sigma[i]) > 0.1 + 0.08 * sigma[i]) {
                fail_msg("sigma %.2f px at %d/8 turn: %.3f px found", sigma[i], turn, found);
            }
        }
    }
}

/* A box of length L under a Gaussian of variance t has the gradient erf(L / sqrt(8 t)) / L on its crest; two of them give the
 * width that a Gaussian edge of the same ratio would have. */
static double box_reading(double length_px)
{
    double fine = 0.64 + 1.0 / 3.0, coarse = 5.76 + 1.0 / 3.0;
    double ratio = erf(length_px / sqrt(8.0 * fine)) / erf(length_px / sqrt(8.0 * coarse)), r2 = ratio * ratio;
    return sqrt((coarse - r2 * fine) / (r2 - 1.0));
}

static void a_path_reads_as_its_flat_crest_says(void **state)
{
    (void)state;
    for (double box = 4.0; box <= 8.0; box += 2.0) {
        double found = measured(0.3, 0.0, box, 0.002), expected = box_reading(box);
        if (fabs(found - expected) > 0.15 * expected) {
            fail_msg("box of %.0f px: %.3f px found, %.3f expected", box, found, expected);
        }
    }
}

static void noise_alone_has_no_edges(void **state)
{
    (void)state;
    tsuya_image image;
    tsuya_blur blur;
    tsuya_context context = tsuya_context_default();
    assert_ok(tsuya_image_create(&image, 512, 512, 1, TSUYA_SAMPLE_F32, TSUYA_ENCODING_SRGB));
    for (int y = 0; y < 512; y++) {
        for (int x = 0; x < 512; x++) {
            *tsuya_image_f32(&image, x, y) = (float)(0.5 + 0.03 * tsuya_random_normal(1, 2, (uint64_t)(y * 512 + x)));
        }
    }
    assert_ok(tsuya_blur_measure(&blur, &image, NULL, &context));
    assert_true(isnan(blur.worst_px));
    tsuya_image_free(&image);
}

static void edges_outside_the_mask_do_not_count(void **state)
{
    (void)state;
    tsuya_image image, mask;
    tsuya_blur whole, masked;
    tsuya_context context = tsuya_context_default();
    stripes(&image, 0.0, 1.0, 0.0, 0.0, 1);
    assert_ok(tsuya_image_create(&mask, image.width_px, image.height_px, 1, TSUYA_SAMPLE_U8, TSUYA_ENCODING_DATA));
    for (int y = 200; y < 300; y++) {
        memset(tsuya_image_u8(&mask, 0, y), 255, (size_t)mask.width_px);
    }
    assert_ok(tsuya_blur_measure(&whole, &image, NULL, &context));
    assert_ok(tsuya_blur_measure(&masked, &image, &mask, &context));
    assert_in_range(masked.edges[0], 1, whole.edges[0] / 4);
    tsuya_image_free(&image);
    tsuya_image_free(&mask);
}

static void threads_do_not_matter(void **state)
{
    (void)state;
    tsuya_image image;
    tsuya_blur one, four;
    tsuya_context context = tsuya_context_default();
    stripes(&image, 1.0, 1.3, 0.0, 0.01, 5);
    context.threads = 1;
    assert_ok(tsuya_blur_measure(&one, &image, NULL, &context));
    context.threads = 4;
    assert_ok(tsuya_blur_measure(&four, &image, NULL, &context));
    assert_memory_equal(&one, &four, sizeof one);
    tsuya_image_free(&image);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(known_gaussian_widths_are_found), cmocka_unit_test(a_path_reads_as_its_flat_crest_says),
        cmocka_unit_test(noise_alone_has_no_edges),        cmocka_unit_test(edges_outside_the_mask_do_not_count),
        cmocka_unit_test(threads_do_not_matter),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
