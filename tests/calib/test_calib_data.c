/* Calibration from real photographs and corners (shared data), against the references that came with them. */
#include "support.h"

#include "calib/calibrate.h"
#include "calib/detect.h"
#include "core/table.h"

typedef struct loaded {
    tsuya_arena *arena;
    const char *path[128];
    int count;
} loaded;

/* Photographs of a folder, every `step`-th. */
static void list_photos(loaded *l, const char *folder, int step)
{
    char **names;
    int n;
    *l = (loaded){0};
    assert_ok(tsuya_arena_create(&l->arena, 1 << 14));
    assert_ok(tsuya_folder_list(&names, &n, folder, l->arena));
    for (int i = 0, k = 0; i < n; i++) {
        if (strstr(names[i], ".png") || strstr(names[i], ".jpg")) {
            if (k++ % step == 0) {
                l->path[l->count++] = tsuya_arena_printf(l->arena, "%s/%s", folder, names[i]);
            }
        }
    }
}

static void grid_of_88(tsuya_board *board)
{
    assert_ok(tsuya_board_parse(board, "{target_type: aprilgrid, tagCols: 6, tagRows: 6, tagSize: 0.088, tagSpacing: 0.3}", "grid"));
}

static void report(const char *name, const tsuya_calibration *c)
{
    int which;
    const tsuya_camera *k = &c->solve.camera;
    const tsuya_calibrate_trial *t = &c->trial[c->chosen];
    printf("%s: %s, %.4f px, %d photographs, %d corners, %d left out, fx %.2f ± %.2f fy %.2f cx %.2f cy %.2f, cross p90 %.3f (infinity %.3f), "
           "uncertainty %.3f corner %.3f (infinity %.3f, %.3f), photographs scatter %.2f, tags %.2f, %.1f s\n",
           name, tsuya_lens_name(k->lens), c->solve.rms_px, c->photos_used, c->solve.observation_count, c->solve.outliers, k->fx_px,
           sqrt(c->covariance.intrinsics[0]), k->fy_px, k->cx_px, k->cy_px, t->cross.p90, t->cross_infinity.p90, tsuya_projection_center(&c->sigma),
           tsuya_projection_corner(&which, &c->sigma), tsuya_projection_center(&c->sigma_infinity), tsuya_projection_corner(&which, &c->sigma_infinity),
           c->covariance.photo_factor, c->covariance.tag_factor, c->seconds);
}

/* Robot's colour camera: 608.3, 610.9 px, 0.21 px per coordinate. */
static void test_d435i(void **state)
{
    (void)state;
    const char *folder = test_data("calib/d435i_aprilgrid/cam0");
    if (!folder) {
        skip();
    }
    loaded l;
    tsuya_board board;
    tsuya_corner_set corners;
    tsuya_detect_info detected;
    tsuya_calibration c;
    tsuya_context context = tsuya_context_default();
    tsuya_calibrate_options options = tsuya_calibrate_options_default();
    list_photos(&l, folder, 1);
    grid_of_88(&board);
    assert_ok(tsuya_detect_photos(&corners, &detected, &board, l.path, l.count, &context));
    assert_ok(tsuya_calibrate(&c, &board, &corners, detected.width_px, detected.height_px, &options, &context));
    report("d435i_aprilgrid", &c);
    assert_true(c.photos_used >= 29);
    assert_true(c.solve.rms_px <= 0.20);
    assert_true(fabs(c.solve.camera.fx_px / 608.3 - 1.0) <= 0.005);
    assert_true(fabs(c.solve.camera.fy_px / 610.9 - 1.0) <= 0.005);
    assert_true(c.cross_validates);
    assert_true(c.trial[c.chosen].cross.p90 <= 0.5);
    tsuya_calibration_free(&c);
    tsuya_detect_info_free(&detected);
    tsuya_corner_set_free(&corners);
    tsuya_board_free(&board);
    tsuya_arena_free(l.arena);
}

/* Corners of Kalibr's kind of file: #ts,…,kp_x,kp_y,p_x,p_y,p_z,tag_id,corner_idx */
static void read_corners(tsuya_corner_set *set, const char *folder)
{
    char **names, line[512];
    const char *kept[256];
    int n, count = 0;
    tsuya_arena *arena;
    assert_ok(tsuya_arena_create(&arena, 1 << 14));
    assert_ok(tsuya_folder_list(&names, &n, folder, arena));
    for (int i = 0; i < n; i++) {
        if (strstr(names[i], ".csv")) {
            kept[count++] = names[i];
        }
    }
    assert_ok(tsuya_corner_set_create(set, kept, count));
    for (int i = 0; i < count; i++) {
        FILE *f = fopen(tsuya_arena_printf(arena, "%s/%s", folder, set->photo[i]), "r");
        assert_non_null(f);
        while (fgets(line, sizeof line, f)) {
            double x, y;
            int id, corner;
            if (sscanf(line, "%*[^,],%*[^,],%*[^,],%*[^,],%*[^,],%lf,%lf,%*[^,],%*[^,],%*[^,],%d,%d", &x, &y, &id, &corner) == 4) {
                assert_ok(tsuya_corner_set_add(set, (tsuya_corner){.photo = i, .tag_id = id, .corner = corner, .x_px = x, .y_px = y, .sigma_px = 0.1}));
            }
        }
        fclose(f);
    }
    tsuya_corner_set_sort(set);
    tsuya_arena_free(arena);
}

static void test_euroc(void **state)
{
    (void)state;
    const char *folder = test_data("calib/euroc_cam0");
    if (!folder) {
        skip();
    }
    tsuya_board board;
    tsuya_corner_set corners;
    tsuya_calibration c;
    tsuya_context context = tsuya_context_default();
    tsuya_calibrate_options options = tsuya_calibrate_options_default();
    tsuya_projection_map map;
    tsuya_projection_stats near, far;
    const tsuya_camera published = {.lens = TSUYA_LENS_OPENCV4, .width_px = 752, .height_px = 480, .fx_px = 458.654, .fy_px = 457.296, .cx_px = 367.215,
                                    .cy_px = 248.375, .distortion = {-0.28340811, 0.07395907, 0.00019359, 1.76187114e-05}};
    grid_of_88(&board);
    read_corners(&corners, folder);
    assert_ok(tsuya_calibrate(&c, &board, &corners, 752, 480, &options, &context));
    report("euroc_cam0", &c);
    assert_ok(tsuya_projection_map_create(&map, 41, 31));
    tsuya_projection_cover(&map, &c.solve);
    assert_ok(tsuya_projection_difference(&map, NULL, &c.solve.camera, &published, 1.2));
    assert_ok(tsuya_projection_summary(&near, &map));
    assert_ok(tsuya_projection_difference(&map, NULL, &c.solve.camera, &published, INFINITY));
    assert_ok(tsuya_projection_summary(&far, &map));
    printf("  against the published model: mean %.3f px at 1.2 m, %.3f px at infinity\n", near.mean, far.mean);
    assert_true(c.solve.rms_px <= 0.364);
    assert_true(near.mean <= 0.5);
    assert_true(far.mean <= 1.0);
    /* The stated sigma tells near from far as the difference does. */
    double sigma = tsuya_projection_center(&c.sigma), sigma_far = tsuya_projection_center(&c.sigma_infinity);
    assert_true(sigma_far > sigma);
    assert_near(sigma_far / sigma, far.mean / near.mean, 0.5 * far.mean / near.mean);
    tsuya_projection_map_free(&map);
    tsuya_calibration_free(&c);
    tsuya_corner_set_free(&corners);
    tsuya_board_free(&board);
}

/* RMS per coordinate of the mean residuals of tags whose four corners are used. */
static double tag_means(const tsuya_solve *s)
{
    double squares = 0.0;
    int count = 0;
    for (int i = 0; i + 3 < s->observation_count; i++) {
        const tsuya_solve_observation *o = &s->observation[i];
        tsuya_vec2 sum = {0, 0};
        bool whole = o->corner == 0;
        for (int k = 0; k < 4 && whole; k++) {
            whole = o[k].tag == o->tag && o[k].view == o->view && !o[k].outlier;
            sum = (tsuya_vec2){sum.x + 0.25 * o[k].residual_px.x, sum.y + 0.25 * o[k].residual_px.y};
        }
        squares += whole ? sum.x * sum.x + sum.y * sum.y : 0.0;
        count += whole ? 2 : 0;
    }
    return sqrt(squares / count);
}

/* Mean sigma of the corners of the photographs that motion blurred, and of the others. */
static void sigmas_by_blur(double sigma_px[2], const tsuya_corner_set *corners, const tsuya_detect_info *detected)
{
    int count[2] = {0, 0};
    sigma_px[0] = sigma_px[1] = 0.0;
    for (int i = 0; i < corners->count; i++) {
        int blurred = detected->report[corners->corner[i].photo].blur_high_px > 1.1;
        sigma_px[blurred] += corners->corner[i].sigma_px;
        count[blurred]++;
    }
    for (int k = 0; k < 2; k++) {
        assert_true(count[k] > 0);
        sigma_px[k] /= count[k];
    }
}

/* Two plates on black cloth, a phone in the hand: seven of ten photographs are blurred by motion. */
static void test_two_boards(void **state)
{
    (void)state;
    const char *folder = test_data("calib/two_boards"), *file = test_data("calib/two_boards/boards.yaml");
    if (!folder || !file) {
        skip();
    }
    loaded l;
    tsuya_board board;
    tsuya_corner_set corners;
    tsuya_detect_info detected;
    tsuya_calibration c;
    tsuya_context context = tsuya_context_default();
    tsuya_calibrate_options options = tsuya_calibrate_options_default();
    int tags = 0;
    list_photos(&l, folder, 1);
    assert_ok(tsuya_board_load(&board, file));
    assert_ok(tsuya_detect_photos(&corners, &detected, &board, l.path, l.count, &context));
    assert_ok(tsuya_calibrate(&c, &board, &corners, detected.width_px, detected.height_px, &options, &context));
    report("two_boards", &c);
    for (int i = 0; i < l.count; i++) {
        tags += detected.report[i].tags;
    }
    printf("  %d tags, means %.3f px, %.2f +- %.2f degrees\n", tags, tag_means(&c.solve), c.plate[0].angle_deg, c.plate[0].angle_sd_deg);
    double sigma_px[2];
    sigmas_by_blur(sigma_px, &corners, &detected);
    printf("  corners' sigma: %.4f px in the sharp photographs, %.4f in the blurred\n", sigma_px[0], sigma_px[1]);
    assert_true(sigma_px[1] > 1.2 * sigma_px[0]); /* they count less, and are not dropped */
    assert_true(tag_means(&c.solve) <= 0.22);
    assert_true(tags >= 1000);
    assert_int_equal(c.photos_used, 10);
    assert_true(c.solve.rms_px <= 0.38);
    assert_true(c.solve.outliers <= 0.05 * c.solve.observation_count);
    assert_near(c.plate[0].angle_deg, 93.8, 0.3);
    assert_near(c.solve.camera.fx_px / 3070.0, 1.0, 0.01);
    assert_true(tsuya_projection_center(&c.sigma_infinity) > 0.08); /* halves differ by 0.8 px there */
    tsuya_calibration_free(&c);
    tsuya_detect_info_free(&detected);
    tsuya_corner_set_free(&corners);
    tsuya_board_free(&board);
    tsuya_arena_free(l.arena);
}

/* A heavy fisheye in 16 bits. */
static void test_fisheye(void **state)
{
    (void)state;
    const char *path = test_data("calib/kalibr_grids/TUM_VI.png");
    if (!path) {
        skip();
    }
    tsuya_board board;
    tsuya_corner_set corners;
    tsuya_detect_info detected;
    tsuya_context context = tsuya_context_default();
    grid_of_88(&board);
    assert_ok(tsuya_detect_photos(&corners, &detected, &board, &path, 1, &context));
    printf("TUM_VI.png: %d tags, %d corners\n", detected.report[0].tags, corners.count);
    assert_true(detected.report[0].tags >= 29);
    assert_true(corners.count >= 100);
    tsuya_detect_info_free(&detected);
    tsuya_corner_set_free(&corners);
    tsuya_board_free(&board);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_two_boards), cmocka_unit_test(test_fisheye), cmocka_unit_test(test_d435i),
                                       cmocka_unit_test(test_euroc)};
    return test_data("calib") ? cmocka_run_group_tests(tests, NULL, NULL) : TEST_SKIPPED;
}
