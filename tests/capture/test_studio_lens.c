/* A job's own board photographs give back the lens that they were taken through, as well as the calibration says it knows it: sixteen rooms. */
#include "support.h"

#include "calib/calibrate.h"
#include "calib/detect.h"
#include "calib/projection.h"
#include "capture/simulate.h"
#include "core/dense.h"
#include "core/context.h"

#include <math.h>

static const char SCENE[] =
    "seed: %d\n"
    "cloth: {kind: closed, side_m: 0.3, spacing_m: 0.03}\n"
    "camera: {size: [640, 480], focal_px: 700, center_px: [323.5, 236], distortion: [-0.12, 0.04, 0.0005, -0.0004], f_number: 16, blur_px: 0.6, bayer: true, format: %s}\n"
    "views: [{count: 3, distance_m: 3}]\nhold_out: 0\n"
    "board: {cols: 8, rows: 5, tag_mm: 30, gap_mm: 9, photos: 18}\n";

static void detect_all(tsuya_corner_set *corners, const tsuya_board *board, const char *folder, const tsuya_context *context)
{
    tsuya_arena *arena;
    tsuya_detect_info info;
    char **name;
    const char *path[64];
    int count;
    assert_ok(tsuya_arena_create(&arena, 1 << 14));
    assert_ok(tsuya_folder_list(&name, &count, folder, arena));
    for (int i = 0; i < count; i++) {
        path[i] = tsuya_arena_printf(arena, "%s/%s", folder, name[i]);
    }
    assert_ok(tsuya_detect_photos(corners, &info, board, path, count, context));
    tsuya_detect_info_free(&info);
    tsuya_arena_free(arena);
}

enum { LENS = 8 /* fx fy cx cy k1 k2 p1 p2 */, DRAWS = 100 };

static void set_lens(tsuya_camera *camera, const double p[LENS])
{
    camera->fx_px = p[0], camera->fy_px = p[1], camera->cx_px = p[2], camera->cy_px = p[3];
    memcpy(camera->distortion, p + 4, 4 * sizeof *p);
}

static void get_lens(double p[LENS], const tsuya_camera *camera)
{
    const double all[LENS] = {camera->fx_px, camera->fy_px, camera->cx_px, camera->cy_px, camera->distortion[0], camera->distortion[1], camera->distortion[2], camera->distortion[3]};
    memcpy(p, all, sizeof all);
}

/* Mean square of how far two lenses lie apart over the cells under boards; the largest ratio to the sigma there. */
static double apart(double *worst, const tsuya_calibration *c, const tsuya_camera *other)
{
    tsuya_projection_map off;
    double squares = 0.0;
    int n = 0;
    assert_ok(tsuya_projection_map_create(&off, c->sigma.cols, c->sigma.rows));
    assert_ok(tsuya_projection_difference(&off, NULL, other, &c->solve.camera, c->distance_m));
    *worst = 0.0;
    for (int k = 0; k < off.cols * off.rows; k++) {
        if (c->sigma.covered[k] && isfinite(off.value[k]) && isfinite(c->sigma.value[k])) {
            squares += off.value[k] * off.value[k];
            *worst = fmax(*worst, off.value[k] / c->sigma.value[k]);
            n++;
        }
    }
    assert_true(n > off.cols * off.rows / 2);
    tsuya_projection_map_free(&off);
    return squares / n;
}

/* The same as the calibration's covariance has it: lenses drawn from it. */
static double predicted(double *worst, const tsuya_calibration *c)
{
    double root[LENS * LENS], at[LENS], sum = 0.0, own;
    assert_int_equal(c->covariance.n, LENS);
    memcpy(root, c->covariance.intrinsics, sizeof root);
    assert_true(tsuya_dense_cholesky(root, LENS));
    *worst = 0.0;
    for (int d = 0; d < DRAWS; d++) {
        tsuya_camera drawn = c->solve.camera;
        get_lens(at, &drawn);
        for (int i = 0; i < LENS; i++) {
            for (int k = 0; k <= i; k++) {
                at[i] += root[i * LENS + k] * tsuya_random_normal(5, (uint64_t)d, (uint64_t)k);
            }
        }
        set_lens(&drawn, at);
        sum += apart(&own, c, &drawn) / DRAWS;
        *worst += own / DRAWS;
    }
    return sum;
}

typedef struct outcome { double off, predicted, worst, focal_sigmas; } outcome; /* off, predicted: mean squares */

static outcome lens_comes_back(int seed, const char *format)
{
    char text[1024], folder[TEST_PATH], path[TEST_PATH];
    tsuya_simulate_scene scene;
    tsuya_simulate_info info;
    tsuya_board board;
    tsuya_camera truth;
    tsuya_pose pose;
    tsuya_corner_set corners = {0};
    tsuya_calibration calibration;
    tsuya_context context = tsuya_context_default();
    tsuya_calibrate_options options = tsuya_calibrate_options_default();
    outcome o;
    double usual;
    snprintf(text, sizeof text, SCENE, seed, format);
    snprintf(folder, sizeof folder, "%s/%s%d", test_folder(), format, seed);
    assert_ok(tsuya_file_write(test_path("scene.yaml"), text, strlen(text)));
    assert_ok(tsuya_simulate_scene_load(&scene, test_path("scene.yaml")));
    assert_ok(tsuya_simulate(&info, &scene, folder, &context));
    assert_int_equal(info.board_photos, 18);
    tsuya_simulate_scene_free(&scene);
    snprintf(path, sizeof path, "%s/truth/camera.cameramodel", folder);
    assert_ok(tsuya_cameramodel_load(&truth, &pose, path));
    snprintf(path, sizeof path, "%s/board.yaml", folder);
    assert_ok(tsuya_board_load(&board, path));
    snprintf(path, sizeof path, "%s/board", folder);
    detect_all(&corners, &board, path, &context);
    options.lens_given = true;
    options.lens = TSUYA_LENS_OPENCV4;
    assert_ok(tsuya_calibrate(&calibration, &board, &corners, 640, 480, &options, &context));
    o.off = apart(&o.worst, &calibration, &truth);
    o.predicted = predicted(&usual, &calibration);
    o.focal_sigmas = (calibration.solve.camera.fx_px - truth.fx_px) / sqrt(calibration.covariance.intrinsics[0]);
    print_message("%s, room %d: lens off by %.4f px rms, predicted %.4f; largest ratio to a sigma %.1f (%.1f of drawn lenses); focal length %+.2f sigmas\n", format, seed,
                  sqrt(o.off), sqrt(o.predicted), o.worst, usual, o.focal_sigmas);
    /* Errors of one calibration hang together, so that they count as few: two sigmas of one normal number, which are 1.7 of what is drawn;
     * four at the worst place of sixteen rooms. */
    assert_true(o.off < 3.0 * o.predicted);
    assert_true(o.worst < 4.0);
    assert_true(fabs(calibration.solve.camera.fx_px / truth.fx_px - 1.0) < 1e-3);
    tsuya_calibration_free(&calibration);
    tsuya_corner_set_free(&corners);
    tsuya_board_free(&board);
    return o;
}

/* Over rooms together the errors are as large as predicted, and focal lengths err to both sides. */
static void lenses_come_back(const char *format, int first, int rooms)
{
    double off = 0.0, sigma = 0.0, focal = 0.0;
    for (int i = 0; i < rooms; i++) {
        outcome o = lens_comes_back(first + i, format);
        off += o.off / rooms;
        sigma += o.predicted / rooms;
        focal += o.focal_sigmas / rooms;
    }
    print_message("%s, %d rooms: lenses off by %.4f px rms, predicted %.4f (ratio %.2f); focal lengths %+.2f sigmas in the mean\n", format, rooms, sqrt(off), sqrt(sigma),
                  sqrt(off / sigma), focal);
    assert_true(off < 1.35 * 1.35 * sigma && off > 0.6 * 0.6 * sigma);
    assert_true(fabs(focal) < 2.5 / sqrt(rooms));
}

static void from_16_bits(void **state)
{
    (void)state;
    lenses_come_back("tif", 3, 12);
}

static void from_jpeg(void **state)
{
    (void)state;
    lenses_come_back("jpg", 3, 4);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(from_16_bits), cmocka_unit_test(from_jpeg)};
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
