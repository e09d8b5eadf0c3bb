/* Corners of synthetic tags: error against the truth and the Cramér–Rao bound, beside the plain library's, and its time. */
#include "tag_field.h"

static void test_accuracy(void **state)
{
    (void)state;
    field f;
    tsuya_image light;
    scene_look look = scene_look_default();
    make_field(&f, &light, &look, "tag36h11", 1, 72, 96);
    score s = compare(NULL, "noise 2/255", &f, &light, &look, "tag36h11", 1);
    /* The library's first pixel begins at (0.5, 0.5): without the shift every corner would be off by half a pixel. */
    assert_true(tsuya_tag_pixel(0.5) == 0.0);
    assert_true(s.library_bias < 0.02);
    assert_int_equal(s.found, TAGS);
    assert_int_equal(s.dropped, 0);
    assert_true(s.rms <= 0.020);
    assert_true(s.bias <= 0.005);
    assert_true(s.rms <= 2.5 * s.bound);
    assert_true(s.sigma_ratio > 0.8 && s.sigma_ratio < 1.25);
    look.noise = 8.0 / 255.0;
    s = compare(NULL, "noise 8/255", &f, &light, &look, "tag36h11", 1);
    assert_int_equal(s.found, TAGS);
    assert_int_equal(s.dropped, 0);
    assert_true(s.rms <= 0.050);
    assert_true(s.bias <= 0.005);
    look.noise = 2.0 / 255.0;
    look.srgb = true;
    s = compare(NULL, "noise 2/255, sRGB", &f, &light, &look, "tag36h11", 1);
    assert_int_equal(s.found, TAGS);
    assert_true(s.rms <= 0.025);
    assert_true(s.bias <= 0.005);
    assert_true(fabs(s.outward) <= 0.010);
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
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_accuracy), cmocka_unit_test(test_families), cmocka_unit_test(test_motion)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
