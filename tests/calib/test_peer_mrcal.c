/* The same even grid through mrcal's own program: the projections agree.  The truth's lens stands in corners_scene.h. */
#include "corners_scene.h"

#include "calib/mrcal_inputs.h"
#include "core/process.h"

enum { PHOTOS = 24, TAGS = 5 };
static const double TAG_M = 0.024, NOISE_PX = 0.1;

/* Corners of one sigma; every fourth photograph lacks some tags. */
static void make_corners(tsuya_corner_set *set, const tsuya_board *board, uint64_t seed)
{
    corners_scene s = corners_scene_default();
    char name[PHOTOS][16];
    const char *names[PHOTOS];
    s.seed = seed;
    s.distance_m = 0.55;
    s.spread_px = 330;
    for (int p = 0; p < PHOTOS; p++) {
        snprintf(name[p], sizeof name[p], "p%02d.png", p);
        names[p] = name[p];
    }
    assert_ok(tsuya_corner_set_create(set, names, PHOTOS));
    for (int p = 0; p < PHOTOS; p++) {
        tsuya_pose pose = scene_pose(&s, p);
        for (int k = 0; k < 4 * board->tag_count; k++) {
            tsuya_vec2 q = scene_pixel(tsuya_pose_apply(pose, tsuya_board_corner(board, k / 4, k % 4)));
            q.x += NOISE_PX * tsuya_random_normal(5, (uint64_t)p, 2 * (uint64_t)k);
            q.y += NOISE_PX * tsuya_random_normal(5, (uint64_t)p, 2 * (uint64_t)k + 1);
            bool inside = q.x > 0 && q.y > 0 && q.x < SCENE_WIDTH - 1 && q.y < SCENE_HEIGHT - 1, covered = p % 4 == 1 && k / 4 % 7 == 3;
            if (inside && !covered) {
                assert_ok(tsuya_corner_set_add(set, (tsuya_corner){.photo = p, .tag_id = board->tag[k / 4].id, .corner = k % 4, .x_px = q.x, .y_px = q.y,
                                                                   .sigma_px = NOISE_PX}));
            }
        }
    }
    tsuya_corner_set_sort(set);
}

/* mrcal's first poses are its own: of planes that stand askew it now and then takes the wrong one of two, throws all corners of that
 * photograph away and then fails to say its uncertainty.  That is no matter of agreement: false. */
static bool run_peer(tsuya_camera *camera, const char *options)
{
    char command[3 * TEST_PATH], *output = NULL;
    tsuya_process_info info;
    snprintf(command, sizeof command,
             "cd %s && mrcal-calibrate-cameras --corners-cache corners.vnl --lensmodel LENSMODEL_OPENCV4 --focal 1520 --imagersize %d %d --object-spacing %g "
             "--object-width-n %d --object-height-n %d %s 'p*.png' 2>&1", test_folder(), SCENE_WIDTH, SCENE_HEIGHT, TAG_M, 2 * TAGS, 2 * TAGS, options);
    const char *argv[] = {"sh", "-c", command, NULL};
    assert_ok(tsuya_process_capture(&output, &info, argv, NULL));
    bool astray = strstr(output, "not positive definite") != NULL;
    if (info.exit_code != 0 && !astray) {
        fail_msg("mrcal-calibrate-cameras:\n%s", output);
    }
    tsuya_free(output);
    if (info.exit_code == 0) {
        assert_ok(tsuya_cameramodel_load(camera, NULL, test_path("camera-0.cameramodel")));
    }
    return info.exit_code == 0;
}

static double difference(const tsuya_calibration *c, const tsuya_camera *peer, double distance_m)
{
    tsuya_projection_map map;
    tsuya_projection_stats stats;
    assert_ok(tsuya_projection_map_create(&map, 41, 31));
    tsuya_projection_cover(&map, &c->solve);
    assert_ok(tsuya_projection_difference(&map, NULL, &c->solve.camera, peer, distance_m));
    assert_ok(tsuya_projection_summary(&stats, &map));
    tsuya_projection_map_free(&map);
    return stats.max;
}

static void test_projections_agree(void **state)
{
    (void)state;
    if (!tsuya_process_available("mrcal-calibrate-cameras")) {
        printf("mrcal-calibrate-cameras (Debian's mrcal) is not here\n");
        skip();
    }
    tsuya_board board;
    tsuya_corner_set corners;
    tsuya_calibration c;
    tsuya_camera peer;
    tsuya_context context = tsuya_context_default();
    tsuya_calibrate_options options = tsuya_calibrate_options_default();
    options.lens_given = true;
    options.lens = TSUYA_LENS_OPENCV4;
    assert_ok(tsuya_board_grid(&board, "tag36h11", 1, TAGS, TAGS, TAG_M, TAG_M, 0));
    assert_true(tsuya_board_even_grid(&board));
    int compared = 0;
    for (uint64_t seed = 1; seed <= 12 && compared < 2; seed++) {
        make_corners(&corners, &board, seed);
        assert_ok(tsuya_corner_set_save_grid(&corners, &board, test_path("corners.vnl")));
        if (run_peer(&peer, "--skip-calobject-warp-solve")) {
            assert_ok(tsuya_calibrate(&c, &board, &corners, SCENE_WIDTH, SCENE_HEIGHT, &options, &context));
            double near = difference(&c, &peer, c.distance_m), far = difference(&c, &peer, INFINITY);
            printf("scene %d: mrcal-calibrate-cameras fx %.3f, ours %.3f +- %.3f; projections differ by %.4f px at most at the board, %.4f at infinity (covered)\n",
                   (int)seed, peer.fx_px, c.solve.camera.fx_px, sqrt(c.covariance.intrinsics[0]), near, far);
            assert_true(near <= 0.02 && far <= 0.02);
            tsuya_calibration_free(&c);
            compared++;
        }
        tsuya_corner_set_free(&corners);
    }
    assert_int_equal(compared, 2);
    tsuya_board_free(&board);
}

static tsuya_calibration calibrated(const tsuya_board *board, const tsuya_corner_set *corners)
{
    tsuya_calibration c;
    tsuya_context context = tsuya_context_default();
    tsuya_calibrate_options options = tsuya_calibrate_options_default();
    options.lens_given = true;
    options.lens = TSUYA_LENS_OPENCV4;
    assert_ok(tsuya_calibrate(&c, board, corners, SCENE_WIDTH, SCENE_HEIGHT, &options, &context));
    return c;
}

/* A bent board's warp comes back, and a flat one's is nothing. */
static void test_warp(void **state)
{
    (void)state;
    tsuya_board board;
    tsuya_corner_set corners;
    tsuya_mrcal_board even;
    corners_scene s = corners_scene_default();
    assert_ok(tsuya_board_grid(&board, "tag36h11", 1, TAGS, TAGS, TAG_M, TAG_M, 0));
    for (int k = 0; k < 2; k++) {
        s.bulge_m = k ? 0.001 : 0.0;
        scene_corners(&corners, &s, &board);
        tsuya_calibration c = calibrated(&board, &corners);
        assert_ok(tsuya_mrcal_board_solve(&even, &c.solve));
        printf("bulge %g mm: warp %.3f, %.3f mm, rms %.4f px (flat %.4f)\n", 1e3 * s.bulge_m, 1e3 * even.warp_m[0], 1e3 * even.warp_m[1], even.rms_px, even.rms_flat_px);
        /* The scene's parabola reaches 12 cm from the middle, the board's edge lies at 10.8 cm. */
        double want = s.bulge_m * 0.5 * (0.108 / 0.12) * (0.108 / 0.12);
        assert_near(even.warp_m[0], want, 4e-5);
        assert_near(even.warp_m[1], want, 4e-5);
        assert_true(even.rms_px <= even.rms_flat_px);
        tsuya_mrcal_board_free(&even);
        tsuya_calibration_free(&c);
        tsuya_corner_set_free(&corners);
    }
    tsuya_board_free(&board);
}

static void ask_mrcal(double uncertainty[2], double *moved)
{
    char script[2 * TEST_PATH], *output = NULL;
    tsuya_process_info info;
    snprintf(script, sizeof script,
             "import mrcal,numpy\n"
             "def u(path):\n"
             "  m=mrcal.cameramodel(path)\n"
             "  v=0.55*mrcal.unproject(numpy.array((799.5,599.5)),*m.intrinsics(),normalize=True)\n"
             "  return float(mrcal.projection_uncertainty(v,m,what='worstdirection-stdev'))\n"
             "o=mrcal.cameramodel('%s/ours.cameramodel').optimization_inputs()\nb=o['intrinsics'].copy()\nmrcal.optimize(**o)\n"
             "print('uncertainty',u('%s/ours.cameramodel'),u('%s/camera-0.cameramodel'),float(abs(o['intrinsics']-b).max()))", test_folder(), test_folder(), test_folder());
    const char *argv[] = {"/usr/bin/python3", "-c", script, NULL};
    assert_ok(tsuya_process_capture(&output, &info, argv, NULL));
    const char *said = strstr(output, "uncertainty ");
    if (!said || sscanf(said, "uncertainty %lf %lf %lf", &uncertainty[0], &uncertainty[1], moved) != 3) {
        fail_msg("mrcal:\n%s", output);
    }
    tsuya_free(output);
}

/* mrcal reads the inputs back, finds them at their optimum, and computes from them the uncertainty that it finds for its own solve
 * of the same corners. */
static void test_inputs(void **state)
{
    (void)state;
    tsuya_board board;
    tsuya_corner_set corners;
    tsuya_mrcal_board even;
    tsuya_camera peer, again;
    double uncertainty[2], moved;
    assert_ok(tsuya_board_grid(&board, "tag36h11", 1, TAGS, TAGS, TAG_M, TAG_M, 0));
    make_corners(&corners, &board, 1);
    tsuya_calibration c = calibrated(&board, &corners);
    assert_ok(tsuya_mrcal_board_solve(&even, &c.solve));
    assert_ok(tsuya_cameramodel_save(&c.solve.camera, tsuya_pose_identity(), test_path("ours.cameramodel")));
    assert_ok(tsuya_mrcal_inputs_add(test_path("ours.cameramodel"), &even));
    assert_ok(tsuya_cameramodel_load(&again, NULL, test_path("ours.cameramodel"))); /* our reader passes over them */
    assert_near(again.fx_px, c.solve.camera.fx_px, 1e-9);
    if (tsuya_process_available("mrcal-calibrate-cameras")) {
        assert_ok(tsuya_corner_set_save_grid(&corners, &board, test_path("corners.vnl")));
        assert_true(run_peer(&peer, ""));
        ask_mrcal(uncertainty, &moved);
        printf("mrcal's uncertainty at the centre, 0.55 m: %.4f px from our inputs, %.4f from its own solve; solved again, nothing moves by more than %.2g\n",
               uncertainty[0], uncertainty[1], moved);
        assert_true(moved < 1e-3);
        assert_near(uncertainty[0] / uncertainty[1], 1.0, 0.1);
    }
    tsuya_mrcal_board_free(&even);
    tsuya_calibration_free(&c);
    tsuya_corner_set_free(&corners);
    tsuya_board_free(&board);
}

static void test_uneven_boards_have_no_grid(void **state)
{
    (void)state;
    tsuya_board board;
    assert_ok(tsuya_board_grid(&board, "tag36h11", 1, 4, 3, 0.03, 0.009, 0));
    assert_false(tsuya_board_even_grid(&board));
    tsuya_board_free(&board);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_projections_agree), cmocka_unit_test(test_warp), cmocka_unit_test(test_inputs),
                                       cmocka_unit_test(test_uneven_boards_have_no_grid)};
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    if (!getenv("TSUYA_KEEP")) {
        test_folder_remove();
    }
    return failed;
}
