/* Ten photographs of a phone with two flat boards of tags and a box: one reconstruction, metric by the boards; distances between
 * their tags, tags held out, the angle between the boards, and how flat the dense points of each board lie. */
#include "support.h"

#include "app/calib_run.h"
#include "app/calib_scale.h"
#include "core/mesh.h"
#include "core/process.h"
#include "reconstruct/reconstruct.h"

static const char *const FOLDER = "calib/two_boards";
static const double NEAR_M = 0.008; /* of the board: what stands on it lies farther off */

static void calibrate(const char *photos, const char *board, const char *camera, const tsuya_context *context)
{
    tsuya_json *figures = tsuya_json_create_object();
    tsuya_calib_input input = {.board = board, .photos = &photos, .photo_count = 1, .folder = test_folder(), .model = camera,
                               .options = tsuya_calibrate_options_default()};
    assert_non_null(figures);
    assert_ok(tsuya_calib_run(figures, &input, context));
    tsuya_json_free(figures);
}

/* Photographs that show the tag. */
static int seen_in(const tsuya_scale_input *input, int tag)
{
    int n = 0;
    for (int i = 0; i < input->sighting_count; i++) {
        n += input->sighting[i].point == 4 * tag;
    }
    return n;
}

/* Inside the square of a tag of the plate that three photographs show: nothing stands there. */
static bool on_a_tag(const tsuya_scale_input *input, const int *seen, int plate, tsuya_vec3 p)
{
    for (int t = 0; t < input->tag_count; t++) {
        const tsuya_vec3 *c = input->tag[t].corner_m;
        bool inside = input->tag[t].plate == plate && seen[t] >= 3;
        int sign = 0;
        for (int k = 0; inside && k < 4; k++) {
            tsuya_vec3 a = c[k], b = c[(k + 1) % 4];
            double side = (b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x);
            sign += side > 0.0 ? 1 : -1;
        }
        if (inside && abs(sign) == 4) {
            return true;
        }
    }
    return false;
}

/* Root mean square distance from the plane through the points. */
static double flatness(const tsuya_vec3 *p, size_t count)
{
    tsuya_vec3 middle = {0, 0, 0};
    tsuya_mat3 spread = {{{0}}}, axes;
    double variance[3];
    for (size_t i = 0; i < count; i++) {
        middle = tsuya_vec3_mad(middle, 1.0 / (double)count, p[i]);
    }
    for (size_t i = 0; i < count; i++) {
        tsuya_vec3 d = tsuya_vec3_sub(p[i], middle);
        double e[3] = {d.x, d.y, d.z};
        for (int k = 0; k < 9; k++) {
            spread.e[k / 3][k % 3] += e[k / 3] * e[k % 3] / (double)count;
        }
    }
    tsuya_mat3_eigen_symmetric(spread, variance, &axes);
    return sqrt(variance[0]);
}

static void assert_flat(const tsuya_mesh *cloud, const tsuya_scale_input *input, int plate, tsuya_pose plate_from_world)
{
    tsuya_vec3 *near = calloc(cloud->vertex_count, sizeof *near);
    int *seen = calloc((size_t)input->tag_count, sizeof *seen);
    size_t count = 0;
    assert_true(near && seen);
    for (int t = 0; t < input->tag_count; t++) {
        seen[t] = seen_in(input, t);
    }
    for (size_t v = 0; v < cloud->vertex_count; v++) {
        tsuya_vec3 p = tsuya_pose_apply(plate_from_world, tsuya_mesh_position(cloud, v));
        if (fabs(p.z) <= NEAR_M && on_a_tag(input, seen, plate, p)) {
            near[count++] = p;
        }
    }
    assert_true(count >= 1000);
    double rms = flatness(near, count);
    print_message("two_boards: %s: %zu dense points on its tags, flat to %.3f mm RMS\n", input->plate[plate], count, 1e3 * rms);
    assert_true(rms <= 5e-4);
    free(near);
    free(seen);
}

static void both_boards_are_flat_and_to_scale(void **state)
{
    (void)state;
    char board[TEST_PATH], photos[TEST_PATH], camera[TEST_PATH], output[TEST_PATH], path[TEST_PATH];
    tsuya_context context = tsuya_context_default();
    tsuya_calib_scale scale;
    tsuya_photo_set set;
    tsuya_reconstruct_options options = tsuya_reconstruct_options_default();
    tsuya_reconstruct_info info;
    tsuya_sparse_model model;
    tsuya_similarity metric;
    tsuya_scale_info found;
    tsuya_mesh cloud;
    context.threads = 2;
    snprintf(board, sizeof board, "%s/boards.yaml", test_data(FOLDER));
    snprintf(photos, sizeof photos, "%s", test_data(FOLDER));
    snprintf(camera, sizeof camera, "%s", test_path("camera.cameramodel"));
    snprintf(output, sizeof output, "%s", test_path("shape"));
    assert_ok(tsuya_photo_set_load(&set, photos, NULL));
    calibrate(photos, board, camera, &context);
    assert_ok(tsuya_calib_scale_from_board(&scale, board, &set, &context));
    options.photos = photos;
    options.output = output;
    options.camera_model = camera;
    options.scale = &scale.input;
    assert_ok(tsuya_reconstruct(&info, &options, &context));
    assert_int_equal(info.registered, set.count);
    const tsuya_json *figures = tsuya_json_member(info.parts, "scale");
    double spacing = tsuya_json_number_or(tsuya_json_member(figures, "spacing_rms_m"), NAN);
    double angle = tsuya_json_number_or(tsuya_json_member(tsuya_json_element(tsuya_json_member(figures, "plates"), 1), "angle_deg"), NAN);
    print_message("two_boards: distances between tags %.3f mm RMS, held-out tags %.3f mm, angle %.2f degrees\n", 1e3 * spacing, 1e3 * info.scale_rms_m, angle);
    assert_true(spacing <= 3e-4);
    assert_true(info.scale_rms_m <= 5e-4);
    assert_near(angle, 93.8, 0.3);
    snprintf(path, sizeof path, "%.4000s/sparse/0", output);
    assert_ok(tsuya_sparse_model_load(&model, path));
    assert_ok(tsuya_scale_find(&metric, &found, &model, &scale.input));
    assert_near(metric.scale, 1.0, 1e-6);
    tsuya_sparse_model_free(&model);
    snprintf(path, sizeof path, "%.4000s/dense/sparse", output); /* the lens does not reach the corners: no reason to lose more */
    assert_ok(tsuya_sparse_model_load(&model, path));
    assert_true(model.camera[0].width_px >= 2900 && model.camera[0].height_px >= 2900);
    snprintf(path, sizeof path, "%.4000s/cloud.ply", output);
    assert_ok(tsuya_ply_load(&cloud, path));
    for (int k = 0; k < scale.input.plate_count; k++) {
        assert_flat(&cloud, &scale.input, k, found.plate[k].plate_from_reference);
    }
    tsuya_mesh_free(&cloud);
    tsuya_sparse_model_free(&model);
    tsuya_reconstruct_info_free(&info);
    tsuya_calib_scale_free(&scale);
    tsuya_photo_set_free(&set);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(both_boards_are_flat_and_to_scale),
    };
    if (!test_data(FOLDER) || !tsuya_process_available("colmap")) {
        print_message("skipped: no %s, or no colmap\n", FOLDER);
        return TEST_SKIPPED;
    }
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return failed;
}
