/* COLMAP's database: the order of images, damaged features, two-view geometries; and the scale at which photographs are undistorted. */
#include "tests/support.h"

#include "reconstruct/database_adapter.h"
#include "reconstruct/undistort.h"

#include <sqlite3.h>

static void run_sql(const char *path, const char *sql)
{
    sqlite3 *base;
    assert_int_equal(sqlite3_open(path, &base), SQLITE_OK);
    assert_int_equal(sqlite3_exec(base, sql, NULL, NULL, NULL), SQLITE_OK);
    sqlite3_close(base);
}

static const char *make_database(const char *name)
{
    const char *path = test_path(name);
    run_sql(path, "CREATE TABLE images (image_id INTEGER PRIMARY KEY, name TEXT UNIQUE, camera_id INTEGER);"
                  "CREATE TABLE keypoints (image_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);"
                  "CREATE TABLE descriptors (image_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);"
                  "CREATE TABLE two_view_geometries (pair_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB, config INTEGER, F BLOB, E BLOB, H BLOB);"
                  "CREATE TABLE cameras (camera_id INTEGER PRIMARY KEY, model INTEGER);"
                  "CREATE TABLE matches (pair_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);"
                  "INSERT INTO images VALUES (1, 'c.jpg', 1), (2, 'a.jpg', 1), (3, 'b.jpg', 1);"
                  "INSERT INTO keypoints VALUES (1, 1, 2, x'0000803f00000040'), (2, 0, 2, x''), (3, 0, 2, x'');"
                  "INSERT INTO descriptors VALUES (1, 1, 128, zeroblob(128)), (2, 0, 128, x''), (3, 0, 128, x'');");
    return path;
}

static void test_images_are_numbered_by_name(void **state)
{
    (void)state;
    const char *path = make_database("sorted.db");
    tsuya_database database;
    tsuya_sift f;
    assert_ok(tsuya_database_sort_images(path));
    assert_ok(tsuya_database_load(&database, path));
    assert_int_equal(database.image_count, 3);
    for (int i = 0; i < 3; i++) {
        assert_int_equal(database.image[i].image_id, i + 1);
        assert_int_equal(database.image[i].name[0], 'a' + i);
    }
    tsuya_database_free(&database);
    assert_ok(tsuya_sift_load(&f, path, 3)); /* c.jpg's features went along */
    assert_int_equal(f.count, 1);
    assert_true(f.position[0].x == 1.0F && f.position[0].y == 2.0F);
    tsuya_sift_free(&f);
}

static void test_damaged_features_are_refused(void **state)
{
    (void)state;
    const char *path = make_database("damaged.db");
    tsuya_sift f;
    run_sql(path, "UPDATE descriptors SET rows = 2000000000 WHERE image_id = 1");
    assert_int_equal(tsuya_sift_load(&f, path, 1), TSUYA_ERROR_INPUT);
    run_sql(path, "UPDATE descriptors SET rows = 1, cols = 64, data = zeroblob(64) WHERE image_id = 1");
    assert_int_equal(tsuya_sift_load(&f, path, 1), TSUYA_ERROR_INPUT);
    run_sql(path, "UPDATE descriptors SET rows = -1 WHERE image_id = 1");
    assert_int_equal(tsuya_sift_load(&f, path, 1), TSUYA_ERROR_INPUT);
}

static void test_two_views_come_back(void **state)
{
    (void)state;
    const char *path = make_database("pairs.db");
    tsuya_match match[] = {{0, 0}};
    tsuya_two_view saved = {.image_a = 1, .image_b = 3, .kind = TSUYA_TWO_VIEW_CALIBRATED, .essential = {1, 2, 3, 4, 5, 6, 7, 8, 9}, .match = match,
                            .match_count = 1}, read;
    assert_ok(tsuya_two_views_save(path, &saved, 1));
    assert_ok(tsuya_two_view_load(&read, path, 1, 3));
    assert_int_equal(read.kind, TSUYA_TWO_VIEW_CALIBRATED);
    assert_int_equal(read.match_count, 1);
    assert_memory_equal(read.essential, saved.essential, sizeof saved.essential);
    assert_ok(tsuya_two_view_load(&read, path, 1, 2));
    assert_int_equal(read.kind, 0);
}

/* A lens that folds over before its image's corners leaves pinholes that stay before the fold; any other is left to COLMAP. */
static void test_lens_that_does_not_reach_its_corners(void **state)
{
    (void)state;
    tsuya_camera lens = {.lens = TSUYA_LENS_OPENCV4, .width_px = 3024, .height_px = 3024, .fx_px = 3084, .fy_px = 3080, .cx_px = 1503, .cy_px = 1436};
    tsuya_sparse_model model = {.camera = &lens, .camera_count = 1};
    assert_near(tsuya_undistort_scale(&model), 0.0, 0.0);
    lens.distortion[0] = -0.3;
    lens.distortion[1] = 0.1;
    assert_near(tsuya_undistort_scale(&model), 0.0, 0.0);
    lens.distortion[0] = 0.2085; /* of a phone whose board was never in the corners: folds at 0.80, the corner is at 0.71 */
    lens.distortion[1] = -0.67;
    assert_near(tsuya_undistort_scale(&model), 1.0, 0.0);
    lens.distortion[1] = -1.5; /* at 0.57 */
    double scale = tsuya_undistort_scale(&model), corner = hypot(1520.5 / 3084, 1588.5 / 3080), fold = 0.0;
    while (1 + 3 * 0.2085 * fold * fold - 5 * 1.5 * pow(fold, 4) > 0.0) {
        fold += 1e-4;
    }
    assert_true(scale * corner <= fold && (scale + 0.03) * corner > fold);
}

static void test_branch_and_merge(void **state)
{
    (void)state;
    const char *path = make_database("base.db");
    char branch[256];
    snprintf(branch, sizeof branch, "%s.branch", path);
    tsuya_match match[] = {{0, 0}};
    tsuya_two_view saved = {.image_a = 1, .image_b = 3, .kind = TSUYA_TWO_VIEW_CALIBRATED, .match = match, .match_count = 1}, read;
    tsuya_database database;
    assert_ok(tsuya_database_branch(branch, path));
    assert_ok(tsuya_two_views_save(branch, &saved, 1));
    assert_ok(tsuya_two_view_load(&read, path, 1, 3));
    assert_int_equal(read.kind, 0); /* not yet in the base */
    assert_ok(tsuya_database_merge(path, branch));
    assert_ok(tsuya_two_view_load(&read, path, 1, 3));
    assert_int_equal(read.kind, TSUYA_TWO_VIEW_CALIBRATED);
    assert_int_equal(read.match_count, 1);
    assert_ok(tsuya_database_load(&database, branch));
    assert_int_equal(database.image_count, 3);
    tsuya_database_free(&database);
    assert_int_equal(tsuya_database_branch(branch, path), TSUYA_ERROR_INPUT); /* there already */
    assert_int_equal(tsuya_database_merge(path, "no/such.db"), TSUYA_ERROR_INPUT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_images_are_numbered_by_name), cmocka_unit_test(test_damaged_features_are_refused),
        cmocka_unit_test(test_two_views_come_back), cmocka_unit_test(test_branch_and_merge),
        cmocka_unit_test(test_lens_that_does_not_reach_its_corners),
    };
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
