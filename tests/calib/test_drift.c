/* Two calibrations of one camera have not drifted; one whose lens moved has, though its middle stays where it was. */
#include "support.h"

#include "app/calib_drift.h"
#include "core/file.h"
#include "corners_scene.h"

#include <math.h>

static tsuya_camera camera[2];
static char model[2][TEST_PATH];
static tsuya_projection_map map;

static int make_both(void **state)
{
    (void)state;
    tsuya_board board;
    tsuya_context context = tsuya_context_default();
    tsuya_calibrate_options options = tsuya_calibrate_options_default();
    scene_board(&board);
    assert_ok(tsuya_projection_map_create(&map, 41, 31));
    for (int i = 0; i < 2; i++) {
        corners_scene s = corners_scene_default();
        tsuya_calibration c;
        tsuya_corner_set corners;
        char path[2 * TEST_PATH];
        s.seed = 5 + (uint64_t)i;
        scene_corners(&corners, &s, &board);
        assert_ok(tsuya_calibrate(&c, &board, &corners, SCENE_WIDTH, SCENE_HEIGHT, &options, &context));
        camera[i] = c.solve.camera;
        tsuya_projection_cover_corners(&map, &corners, SCENE_WIDTH, SCENE_HEIGHT);
        snprintf(path, sizeof path, "%s", test_path(i ? "later" : "first"));
        assert_ok(tsuya_folder_make(path));
        snprintf(model[i], TEST_PATH, "%.2000s/camera.cameramodel", path);
        snprintf(path, sizeof path, "%s", test_path(i ? "later/uncertainty.vnl" : "first/uncertainty.vnl"));
        assert_ok(tsuya_calib_uncertainty_save(&c, path));
        tsuya_calibration_free(&c);
        tsuya_corner_set_free(&corners);
    }
    tsuya_board_free(&board);
    return 0;
}

static void assert_drift(const tsuya_camera *other, const char *expected, const char *title)
{
    const tsuya_camera both[2] = {camera[0], *other};
    const char *const models[2] = {model[0], model[1]};
    tsuya_json *figures = tsuya_json_create_object();
    const char *drift;
    assert_ok(tsuya_projection_difference(&map, NULL, &both[0], &both[1], INFINITY));
    assert_ok(tsuya_calib_drift(figures, &map, models, both, INFINITY));
    assert_ok(tsuya_json_get_text(&drift, figures, "drift"));
    double ratio = tsuya_json_number_or(tsuya_json_member(figures, "difference_over_uncertainty"), NAN);
    printf("%s: %.3f px in the middle, %.2f of the uncertainty over the image (%.3f px): %s\n", title, tsuya_projection_center(&map), ratio,
           tsuya_json_number_or(tsuya_json_member(figures, "uncertainty_px"), NAN), drift);
    assert_string_equal(drift, expected);
    tsuya_json_free(figures);
}

static void test_the_same_camera(void **state)
{
    (void)state;
    assert_drift(&camera[1], "no", "the same camera");
}

static void test_a_lens_that_moved(void **state)
{
    (void)state;
    tsuya_camera longer = camera[1], aside = camera[1];
    longer.fx_px *= 1.003;
    longer.fy_px *= 1.003;
    aside.cx_px += 12.0;
    assert_drift(&longer, "yes", "focal length + 0.3 %");
    assert_drift(&aside, "yes", "lens moved by 12 px");
}

static void test_what_cannot_be_told(void **state)
{
    (void)state;
    const char *const alone[2] = {model[0], "/nonexistent/camera.cameramodel"};
    tsuya_json *figures = tsuya_json_create_object();
    const char *drift;
    assert_ok(tsuya_calib_drift(figures, &map, alone, camera, INFINITY));
    assert_ok(tsuya_json_get_text(&drift, figures, "drift"));
    assert_string_equal(drift, "unknown: no uncertainty.vnl beside both models");
    tsuya_json_free(figures);
    char bad[TEST_PATH];
    snprintf(bad, sizeof bad, "%s", test_path("bad.cameramodel"));
    const char *const broken[2] = {bad, model[1]};
    static const char text[] = "# x_px y_px sigma_px sigma_infinity_px\n10 10 0.1 -1\n";
    assert_ok(tsuya_file_write(test_path("uncertainty.vnl"), text, sizeof text - 1));
    figures = tsuya_json_create_object();
    assert_fails(tsuya_calib_drift(figures, &map, broken, camera, INFINITY), "an uncertainty is positive");
    tsuya_json_free(figures);
}

static int tear_down(void **state)
{
    tsuya_projection_map_free(&map);
    return test_folder_tear_down(state);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_the_same_camera), cmocka_unit_test(test_a_lens_that_moved), cmocka_unit_test(test_what_cannot_be_told)};
    return cmocka_run_group_tests(tests, make_both, tear_down);
}
