/* Two boards of tags in ten photographs of a phone, reconstructed by COLMAP and made metric by the boards: distances between
 * tags, tags held out, and the angle between the boards against what is known of them. */
#include "support.h"

#include "app/calib_scale.h"
#include "calib/calibrate.h"
#include "calib/detect.h"
#include "core/process.h"
#include "reconstruct/sparse_steps.h"

static const char *const FOLDER = "calib/two_boards";

static void calibrate(const tsuya_photo_set *photos, const char *board_path, const tsuya_context *context)
{
    tsuya_board board;
    tsuya_corner_set corners;
    tsuya_detect_info detected;
    tsuya_calibration c;
    tsuya_calibrate_options options = tsuya_calibrate_options_default();
    const char *path[64];
    for (int i = 0; i < photos->count; i++) {
        path[i] = photos->photo[i].path;
    }
    assert_ok(tsuya_board_load(&board, board_path));
    assert_ok(tsuya_detect_photos(&corners, &detected, &board, path, photos->count, context));
    assert_ok(tsuya_calibrate(&c, &board, &corners, detected.width_px, detected.height_px, &options, context));
    assert_ok(tsuya_cameramodel_save(&c.solve.camera, tsuya_pose_identity(), test_path("camera.cameramodel")));
    tsuya_calibration_free(&c);
    tsuya_detect_info_free(&detected);
    tsuya_corner_set_free(&corners);
    tsuya_board_free(&board);
}

static void test_two_boards(void **state)
{
    (void)state;
    const char *folder = test_data(FOLDER);
    if (!folder || !tsuya_process_available("colmap")) {
        skip();
    }
    char board[TEST_PATH], photos[TEST_PATH], camera[TEST_PATH], output[TEST_PATH];
    snprintf(board, sizeof board, "%s/boards.yaml", folder);
    snprintf(photos, sizeof photos, "%s", folder);
    snprintf(camera, sizeof camera, "%s", test_path("camera.cameramodel"));
    snprintf(output, sizeof output, "%s", test_path("shape"));
    tsuya_context context = tsuya_context_default();
    tsuya_calib_scale scale;
    tsuya_hash none = {"0"};
    tsuya_reconstruct_options options = tsuya_reconstruct_options_default();
    tsuya_reconstruct_info info = {0};
    tsuya_reconstruction r = {.options = &options, .context = &context, .info = &info};
    assert_ok(tsuya_photo_set_load(&r.photos, photos, NULL));
    calibrate(&r.photos, board, &context);
    assert_ok(tsuya_calib_scale_from_board(&scale, board, &r.photos, &context));
    options.photos = photos;
    options.output = output;
    options.camera_model = camera;
    options.scale = &scale.input;
    assert_ok(tsuya_folder_make(output));
    assert_ok(tsuya_arena_create(&r.arena, 1 << 16));
    assert_ok(tsuya_steps_load(&r.steps, output, none));
    assert_ok(tsuya_colmap_create(&r.colmap, output, photos, &context));
    assert_ok(tsuya_sparse_steps(&r));
    const tsuya_json *figures = tsuya_step_figures(&r.steps, "scale");
    double spacing, rms, angle = 0.0;
    assert_ok(tsuya_json_get_number(&spacing, figures, "spacing_rms_m"));
    assert_ok(tsuya_json_get_number(&rms, figures, "scale_rms_m"));
    assert_ok(tsuya_json_get_number(&angle, tsuya_json_element(tsuya_json_member(figures, "plates"), 1), "angle_deg"));
    printf("two_boards: distances between tags %.3f mm RMS, held-out tags %.3f mm, angle %.2f deg\n", 1e3 * spacing, 1e3 * rms, angle);
    assert_true(spacing <= 3e-4);
    assert_true(rms <= 5e-4);
    assert_near(angle, 93.8, 0.3);
    tsuya_steps_free(&r.steps);
    tsuya_photo_set_free(&r.photos);
    tsuya_arena_free(r.arena);
    tsuya_calib_scale_free(&scale);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_two_boards)};
    int result = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return result;
}
