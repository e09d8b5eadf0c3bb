/* Corners of synthetic tags: error against the truth and the Cramér–Rao bound, beside the plain library's, and its time. */
#include "tag_field.h"

#include "calib/refine_kernel.h"
#include "capture/studio_sensor.h"

#include <omp.h>

/* The profile of refine.h as it is written there, with the mathematical library's own functions. */
static double profile(const double p[EDGE_PARAMETERS], double u, double depth, double stray, double stray_wide)
{
    double off = p[EDGE_OFFSET] + p[EDGE_SLOPE] * u + p[EDGE_BOW] * (u * u - 1.0 / 3.0) - depth, lift = 0.055 * (p[EDGE_TONE] - 1.0) / 1.4;
    double black = p[EDGE_BLACK] + p[EDGE_BLACK_SLOPE] * u, white = p[EDGE_WHITE] + p[EDGE_WHITE_SLOPE] * u, blur = p[EDGE_BLUR];
    double plain = stray + (1.0 - stray) * 0.5 * erfc(-off / blur * M_SQRT1_2), wide = stray_wide + (1.0 - stray_wide) * 0.5 * erfc(-off / sqrt(blur * blur + 1.0) * M_SQRT1_2);
    double share = (1.0 + p[EDGE_SHARPENING]) * plain - p[EDGE_SHARPENING] * wide;
    return (1.0 + lift) * pow((black + (white - black) * share) * (1.0 + p[EDGE_ARC] * (u * u - 1.0 / 3.0)), 1.0 / p[EDGE_TONE]) - lift;
}

/* Sums of the pixels against the profile and its differences. */
static void hold_sums(double tone, double sharpening, int count, bool learn)
{
    static tsuya_edge_pixels s;
    double p[EDGE_PARAMETERS] = {0.13, -0.07, 0.04, 0.75, 0.81, -0.05, 0.09, 0.02, 0.07, tone, sharpening};
    int size = learn ? EDGE_PARAMETERS : EDGE_TONE;
    tsuya_edge_normal sum, want = {0};
    s.count = count;
    for (int i = 0; i < count; i++) {
        double g[EDGE_PARAMETERS], u = tsuya_random_uniform(3, 1, (uint64_t)i) * 2.0 - 1.0, d = tsuya_random_uniform(3, 2, (uint64_t)i) * 9.0 - 4.5;
        s.u[i] = (float)u, s.depth[i] = (float)d, s.grey[i] = (float)tsuya_random_uniform(3, 3, (uint64_t)i);
        s.stray[i] = i % 3 ? 0.0f : (float)(0.3 * tsuya_random_uniform(3, 4, (uint64_t)i));
        s.stray_wide[i] = 0.5f * s.stray[i] + 0.02f;
        const double stray = (double)s.stray[i], wide = (double)s.stray_wide[i];
        double r = (double)s.grey[i] - profile(p, (double)s.u[i], (double)s.depth[i], stray, wide);
        for (int a = 0; a < size; a++) {
            double up[EDGE_PARAMETERS], down[EDGE_PARAMETERS];
            memcpy(up, p, sizeof up), memcpy(down, p, sizeof down);
            up[a] += 1e-5, down[a] -= 1e-5;
            g[a] = (profile(up, (double)s.u[i], (double)s.depth[i], stray, wide) - profile(down, (double)s.u[i], (double)s.depth[i], stray, wide)) / 2e-5;
            want.g[a] += g[a] * r;
            for (int b = 0; b <= a; b++) {
                want.h[a][b] += g[a] * g[b];
            }
        }
        want.squares += r * r;
    }
    tsuya_edge_normal_sum(&sum, p, &s, learn);
    assert_near(sum.squares / want.squares, 1.0, 1e-5);
    for (int a = 0; a < size; a++) {
        assert_near(sum.g[a], want.g[a], 1e-5 * sqrt(want.h[a][a] * want.squares) + 1e-6);
        for (int b = 0; b <= a; b++) {
            assert_near(sum.h[a][b], want.h[a][b], 1e-5 * sqrt(want.h[a][a] * want.h[b][b]) + 1e-6);
        }
    }
}

static void test_sums(void **state)
{
    (void)state;
    for (int count = 1; count < 20; count++) { /* whole groups of pixels and rests */
        hold_sums(1.0, 0.0, count, false);
        hold_sums(2.4, 0.3, count, true);
    }
    hold_sums(1.0, 0.0, 1031, false);
    hold_sums(1.0, 0.0, 1031, true);
    hold_sums(1.0, 0.3, 1031, false);
    hold_sums(2.4, 0.0, 1031, false);
    hold_sums(2.4, 0.4, 1031, false);
    hold_sums(0.6, 0.4, 1031, true);
}

static void test_accuracy(void **state)
{
    (void)state;
    field f;
    tsuya_image light;
    scene_look look = scene_look_default();
    make_field(&f, &light, &look, "tag36h11", 1, 72, 96);
    score library, s = compare(&library, "noise 2/255", &f, &light, &look, "tag36h11", 1);
    /* The library's first pixel begins at (0.5, 0.5): without the shift every corner would be off by half a pixel. */
    assert_true(tsuya_tag_pixel(0.5) == 0.0);
    assert_true(s.library_bias < 0.02);
    assert_int_equal(s.found, TAGS);
    assert_int_equal(s.dropped, 0);
    assert_true(s.rms <= 0.020);
    assert_true(s.bias <= 0.005);
    assert_true(s.rms <= 2.5 * s.bound);
    assert_true(s.sigma_ratio > 0.8 && s.sigma_ratio < 1.25);
    assert_true(s.seconds <= library.seconds); /* four tenths of it */
    look.noise = 8.0 / 255.0;
    s = compare(NULL, "noise 8/255", &f, &light, &look, "tag36h11", 1);
    assert_int_equal(s.found, TAGS);
    assert_int_equal(s.dropped, 0);
    assert_true(s.rms <= 0.050);
    assert_true(s.bias <= 0.005);
    look.noise = 2.0 / 255.0;
    look.srgb = true;
    s = compare(&library, "noise 2/255, sRGB", &f, &light, &look, "tag36h11", 1);
    assert_int_equal(s.found, TAGS);
    assert_true(s.rms <= 0.025);
    assert_true(s.bias <= 0.005);
    assert_true(fabs(s.outward) <= 0.010);
    assert_true(s.look.sharpening == 0.0 && fabs(s.look.gamma - 2.4) < 0.15);
    assert_true(s.seconds <= library.seconds);
    tsuya_image_free(&light);
    free_boards(&f);
}

/* Kalibr's border and a family with a white rim take the same road. */
static void test_families(void **state)
{
    (void)state;
    field f;
    tsuya_image light;
    scene_look look = scene_look_default();
    make_field(&f, &light, &look, "tag36h11", 2, 72, 96);
    score s = compare(NULL, "border of two", &f, &light, &look, "tag36h11", 2);
    assert_int_equal(s.found, TAGS);
    assert_true(s.rms <= 0.020 && s.bias <= 0.005);
    tsuya_image_free(&light);
    free_boards(&f);
}

/* The light behind a colour filter's mosaic and its interpolation: the luminance of what that makes of grey. */
static void mosaic(tsuya_image *out, const tsuya_image *light)
{
    assert_ok(tsuya_image_copy(out, light));
    for (int y = 0; y < light->height_px; y++) {
        for (int x = 0; x < light->width_px; x++) {
            float rgb[3];
            tsuya_studio_demosaic(rgb, (const float *)light->data, light->width_px, light->height_px, x, y);
            *tsuya_image_f32(out, x, y) = 0.2126f * rgb[0] + 0.7152f * rgb[1] + 0.0722f * rgb[2];
        }
    }
}

/* It sharpens, which is told from a tone curve; small tags are no farther off than large ones. */
static void test_mosaic(void **state)
{
    (void)state;
    const double side_px[2][2] = {{40, 48}, {72, 96}};
    double outward[2];
    for (int i = 0; i < 2; i++) {
        field f;
        tsuya_image light, seen;
        scene_look look = scene_look_default();
        look.srgb = true;
        look.noise = 1.0 / 255.0;
        make_field(&f, &light, &look, "tag36h11", 1, side_px[i][0], side_px[i][1]);
        mosaic(&seen, &light);
        score s = compare(NULL, i ? "behind a mosaic, large" : "behind a mosaic, small", &f, &seen, &look, "tag36h11", 1);
        assert_true(s.found >= TAGS - 2);
        assert_true(s.look.sharpening >= 0.2 && s.look.gamma == 2.4);
        outward[i] = s.outward;
        tsuya_image_free(&light);
        tsuya_image_free(&seen);
        free_boards(&f);
    }
    assert_true(fabs(outward[0]) < 0.006 && fabs(outward[1]) < 0.01);
}

/* Motion of four pixels: edges across it are uncertain and say so. */
static void test_motion(void **state)
{
    (void)state;
    field f;
    tsuya_image light;
    scene_look look = scene_look_default();
    look.motion_px[0] = 4.0;
    make_field(&f, &light, &look, "tag36h11", 1, 72, 96);
    score s = compare(NULL, "motion of 4 px", &f, &light, &look, "tag36h11", 1);
    assert_int_equal(s.found, TAGS);
    assert_true(s.bias <= 0.010);
    assert_true(s.sigma_ratio > 0.7 && s.sigma_ratio < 1.5);
    tsuya_image_free(&light);
    free_boards(&f);
}

int main(void)
{
    omp_set_num_threads(1); /* times are the processor's, which threads that wait use too */
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_sums), cmocka_unit_test(test_accuracy), cmocka_unit_test(test_families), cmocka_unit_test(test_mosaic), cmocka_unit_test(test_motion)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
