/* 300 calibrations with a known truth: the sigma that is stated against the one that is observed. */
#include "corners_scene.h"

enum { RUNS = 300, PLACES = 5 };

typedef struct tally { double observed, predicted, pose_observed[2], pose_predicted[2]; } tally;

/* Squared projection error of the estimated camera at the map's centre and corners, the motion taken out as the uncertainty
 * takes it out.  The error in the worst direction is λ₁ of its covariance, so errors are gathered as 2 × 2 sums. */
typedef struct sums { double xx, xy, yy, predicted; } sums;

static void place_errors(sums place[PLACES], const tsuya_calibration *c, const tsuya_camera *truth)
{
    const tsuya_projection_map *m = &c->sigma;
    const int cell[PLACES] = {m->rows / 2 * m->cols + m->cols / 2, 0, m->cols - 1, (m->rows - 1) * m->cols, m->rows * m->cols - 1};
    tsuya_projection_map map;
    tsuya_pose motion;
    assert_ok(tsuya_projection_map_create(&map, m->cols, m->rows));
    memcpy(map.covered, m->covered, (size_t)m->cols * (size_t)m->rows * sizeof *map.covered);
    assert_ok(tsuya_projection_difference(&map, &motion, &c->solve.camera, truth, c->distance_m));
    for (int i = 0; i < PLACES; i++) {
        tsuya_vec3 ray;
        tsuya_vec2 q, want = tsuya_projection_pixel(&map, &c->solve.camera, cell[i]);
        assert_true(tsuya_camera_unproject(&c->solve.camera, want, &ray));
        assert_true(tsuya_camera_project(truth, tsuya_pose_apply(motion, tsuya_vec3_scale(ray, c->distance_m)), &q));
        place[i].xx += (q.x - want.x) * (q.x - want.x) / RUNS;
        place[i].xy += (q.x - want.x) * (q.y - want.y) / RUNS;
        place[i].yy += (q.y - want.y) * (q.y - want.y) / RUNS;
        place[i].predicted += m->value[cell[i]] * m->value[cell[i]] / RUNS;
    }
    tsuya_projection_map_free(&map);
}

/* The first photograph's pose: rotation and translation, squares summed over the axes. */
static void pose_errors(tally *t, const tsuya_calibration *c, tsuya_pose truth)
{
    tsuya_pose e = c->solve.view[0].camera_from_plate;
    double turn = tsuya_mat3_rotation_angle_rad(tsuya_mat3_multiply(e.rotation, tsuya_mat3_transpose(truth.rotation)));
    double move = tsuya_vec3_norm(tsuya_vec3_sub(e.translation, truth.translation));
    const double *p = c->covariance.pose;
    t->pose_observed[0] += turn * turn / RUNS;
    t->pose_observed[1] += move * move / RUNS;
    t->pose_predicted[0] += (p[0] + p[7] + p[14]) / RUNS;
    t->pose_predicted[1] += (p[21] + p[28] + p[35]) / RUNS;
}

static void run(corners_scene s, const char *title, double low, double high)
{
    tsuya_board board;
    tsuya_context context = tsuya_context_default();
    tsuya_calibrate_options options = tsuya_calibrate_options_default();
    const tsuya_camera truth = {.lens = TSUYA_LENS_OPENCV4, .width_px = SCENE_WIDTH, .height_px = SCENE_HEIGHT, .fx_px = SCENE_FOCAL, .fy_px = SCENE_FOCAL,
                                .cx_px = SCENE_CX, .cy_px = SCENE_CY, .distortion = {SCENE_K1, SCENE_K2}};
    sums place[PLACES] = {{0}};
    tally t = {0};
    scene_board(&board);
    tsuya_pose pose = scene_pose(&s, 0);
    options.lens_given = true;
    options.lens = TSUYA_LENS_OPENCV4;
#pragma omp parallel for schedule(dynamic)
    for (int i = 0; i < RUNS; i++) {
        corners_scene one = s;
        tsuya_corner_set corners;
        tsuya_calibration c;
        one.noise_seed = 1 + (uint64_t)i;
        scene_corners(&corners, &one, &board);
        assert_ok(tsuya_calibrate(&c, &board, &corners, SCENE_WIDTH, SCENE_HEIGHT, &options, &context));
#pragma omp critical
        {
            place_errors(place, &c, &truth);
            pose_errors(&t, &c, pose);
        }
        tsuya_calibration_free(&c);
        tsuya_corner_set_free(&corners);
    }
    printf("%s: predicted over observed sigma\n", title);
    for (int i = 0; i < PLACES; i++) {
        double middle = 0.5 * (place[i].xx + place[i].yy), worst = middle + hypot(0.5 * (place[i].xx - place[i].yy), place[i].xy);
        double ratio = sqrt(place[i].predicted / worst);
        printf("  %-12s %.3f (observed %.4f px)\n", i ? "corner" : "centre", ratio, sqrt(worst));
        assert_true(ratio >= low && ratio <= high);
    }
    for (int i = 0; i < 2; i++) {
        double ratio = sqrt(t.pose_predicted[i] / t.pose_observed[i]);
        printf("  %-12s %.3f (observed %.3g)\n", i ? "position, m" : "turn, rad", ratio, sqrt(t.pose_observed[i]));
        assert_true(ratio >= low && ratio <= high);
    }
    tsuya_board_free(&board);
}

static void test_independent(void **state)
{
    (void)state;
    run(corners_scene_default(), "independent corners", 0.9, 1.1);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_independent)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
