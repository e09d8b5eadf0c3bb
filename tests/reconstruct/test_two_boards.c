/* Ten photographs of a phone with two flat boards of tags and a box: one reconstruction, metric by the boards; distances between
 * their tags, and how flat the dense points of each board lie. */
#include "support.h"

#include "app/calib_scale.h"
#include "calib/calibrate.h"
#include "calib/detect.h"
#include "core/mesh.h"
#include "core/process.h"
#include "reconstruct/reconstruct.h"

static const char *const FOLDER = "calib/two_boards";
static const double NEAR_M = 0.008; /* of the board: what stands on it lies farther off */

static void calibrate(const tsuya_photo_set *photos, const char *board_path, const char *camera, const tsuya_context *context)
{
    tsuya_board board;
    tsuya_corner_set corners;
    tsuya_detect_info detected;
    tsuya_calibration c;
    tsuya_calibrate_options options = tsuya_calibrate_options_default();
    const char *path[64];
    assert_true(photos->count <= 64);
    for (int i = 0; i < photos->count; i++) {
        path[i] = photos->photo[i].path;
    }
    assert_ok(tsuya_board_load(&board, board_path));
    assert_ok(tsuya_detect_photos(&corners, &detected, &board, path, photos->count, context));
    assert_ok(tsuya_calibrate(&c, &board, &corners, detected.width_px, detected.height_px, &options, context));
    assert_ok(tsuya_cameramodel_save(&c.solve.camera, tsuya_pose_identity(), camera));
    tsuya_calibration_free(&c);
    tsuya_detect_info_free(&detected);
    tsuya_corner_set_free(&corners);
    tsuya_board_free(&board);
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

/* Root mean square distance from the plane z = a x + b y + c through the points, whose slope is small. */
static double flatness(const tsuya_vec3 *p, size_t count)
{
    double m[3][4] = {{0}};
    for (size_t i = 0; i < count; i++) {
        const double row[3] = {p[i].x, p[i].y, 1.0};
        for (int r = 0; r < 3; r++) {
            for (int c = 0; c < 3; c++) {
                m[r][c] += row[r] * row[c];
            }
            m[r][3] += row[r] * p[i].z;
        }
    }
    for (int i = 0; i < 3; i++) { /* symmetric positive definite: no pivoting */
        for (int r = 0; r < 3; r++) {
            double f = r == i ? 0.0 : m[r][i] / m[i][i];
            for (int c = i; c < 4; c++) {
                m[r][c] -= f * m[i][c];
            }
        }
    }
    double sum = 0.0, a = m[0][3] / m[0][0], b = m[1][3] / m[1][1], c = m[2][3] / m[2][2];
    for (size_t i = 0; i < count; i++) {
        double e = p[i].z - a * p[i].x - b * p[i].y - c;
        sum += e * e;
    }
    return sqrt(sum / (double)count);
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
    calibrate(&set, board, camera, &context);
    assert_ok(tsuya_calib_scale_from_board(&scale, board, &set, &context));
    options.photos = photos;
    options.output = output;
    options.camera_model = camera;
    options.scale = &scale.input;
    assert_ok(tsuya_reconstruct(&info, &options, &context));
    assert_int_equal(info.registered, set.count);
    const tsuya_json *figures = tsuya_json_member(info.parts, "scale");
    double spacing = tsuya_json_number_or(tsuya_json_member(figures, "spacing_rms_m"), NAN);
    print_message("two_boards: distances between tags %.3f mm RMS, held-out tags %.3f mm\n", 1e3 * spacing, 1e3 * info.scale_rms_m);
    assert_true(spacing <= 3e-4);
    snprintf(path, sizeof path, "%.4000s/sparse/0", output);
    assert_ok(tsuya_sparse_model_load(&model, path));
    assert_ok(tsuya_scale_find(&metric, &found, &model, &scale.input));
    assert_near(metric.scale, 1.0, 1e-6);
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
