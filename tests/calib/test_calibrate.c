/* Photographs that hardly determine a camera, from corners with a known truth: said, not averaged away. */
#include "corners_scene.h"

#include "calib/mrcal_adapter.h"

static tsuya_status run(tsuya_calibration *c, const corners_scene *s)
{
    tsuya_board board;
    tsuya_corner_set corners;
    tsuya_context context = tsuya_context_default();
    tsuya_calibrate_options options = tsuya_calibrate_options_default();
    static tsuya_board kept; /* the solve borrows it */
    scene_board(&board);
    scene_corners(&corners, s, &board);
    tsuya_board_free(&kept);
    kept = board;
    tsuya_status status = tsuya_calibrate(c, &kept, &corners, SCENE_WIDTH, SCENE_HEIGHT, &options, &context);
    tsuya_corner_set_free(&corners);
    if (status == TSUYA_OK) {
        printf("  %s %.3f px fx %.1f ± %.2f, centre %.3f, scatter %.2f %.2f\n", tsuya_lens_name(c->solve.camera.lens), c->solve.rms_px, c->solve.camera.fx_px,
               sqrt(c->covariance.intrinsics[0]), tsuya_projection_center(&c->sigma_infinity), c->covariance.photo_factor, c->covariance.tag_factor);
        for (int i = 0; i < c->advice_count; i++) {
            printf("    %s\n", c->advice[i]);
        }
    } else {
        printf("  %s\n", tsuya_reason());
    }
    return status;
}

static bool advised(const tsuya_calibration *c, const char *part)
{
    for (int i = 0; i < c->advice_count; i++) {
        if (strstr(c->advice[i], part)) {
            return true;
        }
    }
    return false;
}

/* The truth lies within a few of the stated sigmas. */
static void assert_honest(const tsuya_calibration *c)
{
    const tsuya_camera *k = &c->solve.camera;
    int n = c->covariance.n;
    assert_true(fabs(k->fx_px - SCENE_FOCAL) <= 4.0 * sqrt(c->covariance.intrinsics[0]));
    assert_true(fabs(k->cx_px - SCENE_CX) <= 4.0 * sqrt(c->covariance.intrinsics[2 * (n + 1)]));
}

static void test_plain(void **state)
{
    (void)state;
    corners_scene s = corners_scene_default();
    tsuya_calibration c;
    assert_ok(run(&c, &s));
    assert_true(c.cross_validates);
    assert_honest(&c);
    assert_true(c.covariance.photo_factor > 0.75 && c.covariance.photo_factor < 1.3);
    tsuya_calibration_free(&c);
}

/* Our normal equations against mrcal's derivatives and CHOLMOD, where both have the same parameters. */
static void test_cholmod(void **state)
{
    (void)state;
    corners_scene s = corners_scene_default();
    tsuya_calibration c;
    tsuya_covariance ours;
    double theirs[16 * 16];
    assert_ok(run(&c, &s));
    assert_ok(tsuya_mrcal_covariance(theirs, NULL, &c.solve, 0));
    assert_ok(tsuya_covariance_estimate(&ours, &c.solve, false));
    for (int i = 0; i < ours.n; i++) {
        double a = sqrt(ours.intrinsics[i * (ours.n + 1)]), b = sqrt(c.solve.variance * theirs[i * (ours.n + 1)]);
        assert_true(a >= 0.9999 * b && a <= 1.1 * b); /* the tags' size is free here */
    }
    tsuya_covariance_free(&ours);
    tsuya_calibration_free(&c);
}

/* core's spline is mrcal's. */
static void test_projection_is_mrcals(void **state)
{
    (void)state;
    tsuya_camera k = {.lens = TSUYA_LENS_SPLINED_STEREOGRAPHIC, .width_px = 640, .height_px = 480, .fx_px = 300, .fy_px = 310, .cx_px = 322, .cy_px = 236,
                      .spline = {.nx = 11, .ny = 9, .fov_x_deg = 130}};
    for (int i = 0; i < 2 * 11 * 9; i++) {
        k.spline.point[i] = 0.03 * (tsuya_random_uniform(3, 0, (uint64_t)i) - 0.5);
    }
    tsuya_vec2 reach = tsuya_lens_spline_reach(&k.spline);
    int seen = 0;
    for (int i = 0; i < 400; i++) {
        tsuya_vec2 u = {2.4 * reach.x * (tsuya_random_uniform(4, 0, 2 * (uint64_t)i) - 0.5), 2.4 * reach.y * (tsuya_random_uniform(4, 0, 2 * (uint64_t)i + 1) - 0.5)}, ours, theirs;
        tsuya_vec3 ray = tsuya_vec3_scale(tsuya_stereographic_ray(u), 1.7), back;
        double by_point[6];
        bool within = fabs(u.x) <= reach.x && fabs(u.y) <= reach.y;
        assert_int_equal(tsuya_camera_project(&k, ray, &ours), within && ray.z > 0.0);
        if (within && ray.z > 0.0) {
            assert_true(tsuya_mrcal_project(&theirs, by_point, NULL, &k, ray));
            assert_near(ours.x, theirs.x, 1e-9);
            assert_near(ours.y, theirs.y, 1e-9);
            assert_true(tsuya_camera_unproject(&k, ours, &back));
            assert_near(tsuya_vec3_norm(tsuya_vec3_sub(back, tsuya_stereographic_ray(u))), 0.0, 1e-9);
            seen++;
        }
    }
    assert_true(seen > 150);
}

static void test_frontal(void **state)
{
    (void)state;
    corners_scene s = corners_scene_default();
    tsuya_calibration c;
    s.tilt_deg = 1.0;
    if (run(&c, &s) == TSUYA_OK) {
        assert_true(advised(&c, "tilt"));
        assert_honest(&c);
        tsuya_calibration_free(&c);
    } else {
        assert_non_null(strstr(tsuya_reason(), "tilt"));
    }
}

static void test_few(void **state)
{
    (void)state;
    corners_scene s = corners_scene_default();
    tsuya_calibration c;
    for (s.photos = 1; s.photos <= 2; s.photos++) {
        if (run(&c, &s) == TSUYA_OK) {
            assert_true(advised(&c, "take 15 or more"));
            assert_honest(&c);
            tsuya_calibration_free(&c);
        } else {
            assert_non_null(strstr(tsuya_reason(), "photographs"));
        }
    }
}

static void test_edge_only(void **state)
{
    (void)state;
    corners_scene s = corners_scene_default();
    tsuya_calibration c;
    s.side_px = 520;
    s.spread_px = 60;
    assert_ok(run(&c, &s));
    assert_true(advised(&c, "cover"));
    assert_true(advised(&c, "left corner is the least certain place"));
    assert_honest(&c);
    tsuya_calibration_free(&c);
}

/* Errors that all corners of a photograph share, and a bent board: sigma grows with them. */
static void test_common_errors(void **state)
{
    (void)state;
    corners_scene s = corners_scene_default();
    tsuya_calibration c;
    s.common_px = 0.6;
    assert_ok(run(&c, &s));
    assert_true(c.covariance.photo_factor > 1.5);
    assert_true(advised(&c, "disagree"));
    assert_honest(&c);
    tsuya_calibration_free(&c);
    s.common_px = 0.0;
    s.ripple_m = 0.001;
    assert_ok(run(&c, &s));
    assert_true(hypot(c.covariance.photo_factor, c.covariance.tag_factor) > 1.5);
    tsuya_calibration_free(&c);
}

/* A bent board's bends come back; a flat one stays flat. */
static void test_bent(void **state)
{
    (void)state;
    corners_scene s = corners_scene_default();
    tsuya_calibration c;
    assert_ok(run(&c, &s));
    assert_false(c.solve.bent);
    tsuya_calibration_free(&c);
    s.bulge_m = 0.003;
    assert_ok(run(&c, &s));
    assert_true(c.solve.bent);
    /* The scene's parabola reaches 12 cm to either side of (12, 12) cm; the plate's corners, from 0 to 24 cm, as far. */
    assert_near(c.solve.shape[0].bend_m[0], 0.0015, 3e-5);
    assert_near(c.solve.shape[0].bend_m[1], 0.0015, 3e-5);
    assert_near(c.solve.shape[0].bend_m[2], 0.0, 3e-5);
    assert_true(c.covariance.photo_factor < 1.3);
    assert_honest(&c);
    tsuya_calibration_free(&c);
}

/* Two calibrations of one camera agree where both saw the board, within what their uncertainties allow. */
static void test_compare(void **state)
{
    (void)state;
    tsuya_board board;
    tsuya_camera camera[2];
    double sigma[2];
    tsuya_corner_set corners;
    tsuya_projection_map map;
    tsuya_projection_stats stats;
    scene_board(&board);
    assert_ok(tsuya_projection_map_create(&map, 41, 31));
    for (int i = 0; i < 2; i++) {
        corners_scene s = corners_scene_default();
        tsuya_calibration c;
        s.seed = 5 + (uint64_t)i;
        assert_ok(run(&c, &s));
        camera[i] = c.solve.camera;
        sigma[i] = tsuya_projection_center(&c.sigma_infinity);
        tsuya_calibration_free(&c);
        scene_corners(&corners, &s, &board);
        tsuya_projection_cover_corners(&map, &corners, SCENE_WIDTH, SCENE_HEIGHT);
        tsuya_corner_set_free(&corners);
    }
    assert_ok(tsuya_projection_difference(&map, NULL, &camera[0], &camera[1], INFINITY));
    assert_ok(tsuya_projection_summary(&stats, &map));
    printf("  compared: mean %.3f max %.3f centre %.3f, sigmas %.3f %.3f\n", stats.mean, stats.max, tsuya_projection_center(&map), sigma[0], sigma[1]);
    assert_true(tsuya_projection_center(&map) <= 3.0 * hypot(sigma[0], sigma[1]));
    camera[1].fx_px *= 1.01;
    assert_ok(tsuya_projection_difference(&map, NULL, &camera[0], &camera[1], INFINITY));
    assert_ok(tsuya_projection_summary(&stats, &map));
    assert_true(stats.p90 > 1.0);
    tsuya_projection_map_free(&map);
    tsuya_board_free(&board);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_plain), cmocka_unit_test(test_cholmod), cmocka_unit_test(test_projection_is_mrcals), cmocka_unit_test(test_frontal), cmocka_unit_test(test_few),
                                       cmocka_unit_test(test_edge_only), cmocka_unit_test(test_common_errors), cmocka_unit_test(test_bent),
                                       cmocka_unit_test(test_compare)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
