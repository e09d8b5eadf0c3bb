/* Exact matching against a plain double loop, the guides, and the database's order of images. */
#include "tests/support.h"

#include "core/context.h"
#include "core/memory.h"
#include "reconstruct/matching.h"
#include "reconstruct/undistort.h"

#include <sqlite3.h>

enum { A = 301, B = 1203 };

/* Descriptors of length 512; b holds noisy copies of half of a, elsewhere, and other features. */
static void make_features(tsuya_sift *f, int count, uint64_t stream)
{
    f->count = count;
    f->position = tsuya_calloc((size_t)count, sizeof *f->position);
    f->descriptor = tsuya_calloc((size_t)count * TSUYA_DESCRIPTOR_LENGTH, 1);
    assert_true(f->position && f->descriptor);
    for (int i = 0; i < count; i++) {
        f->position[i] = (tsuya_sift_position){(float)(1000.0 * tsuya_random_uniform(stream, 1, (uint64_t)i)),
                                               (float)(800.0 * tsuya_random_uniform(stream, 2, (uint64_t)i))};
        double v[TSUYA_DESCRIPTOR_LENGTH], norm = 0.0;
        for (int k = 0; k < TSUYA_DESCRIPTOR_LENGTH; k++) {
            double u = tsuya_random_uniform(stream, 3, (uint64_t)(i * TSUYA_DESCRIPTOR_LENGTH + k));
            v[k] = u * u;
            norm += v[k] * v[k];
        }
        for (int k = 0; k < TSUYA_DESCRIPTOR_LENGTH; k++) {
            f->descriptor[i * TSUYA_DESCRIPTOR_LENGTH + k] = (uint8_t)lround(fmin(512.0 * v[k] / sqrt(norm), 255.0));
        }
    }
}

static int place_of(int i)
{
    return (i * 7 + 11) % B;
}

static void copy_half(tsuya_sift *b, const tsuya_sift *a)
{
    for (int i = 0; i < a->count; i += 2) {
        uint8_t *to = b->descriptor + (size_t)place_of(i) * TSUYA_DESCRIPTOR_LENGTH;
        for (int k = 0; k < TSUYA_DESCRIPTOR_LENGTH; k++) {
            int noisy = a->descriptor[(size_t)i * TSUYA_DESCRIPTOR_LENGTH + (size_t)k] + (k % 3) - 1;
            to[k] = (uint8_t)(noisy < 0 ? 0 : noisy > 255 ? 255 : noisy);
        }
    }
}

static double angle(const tsuya_sift *a, int i, const tsuya_sift *b, int j)
{
    double sum = 0.0;
    for (int k = 0; k < TSUYA_DESCRIPTOR_LENGTH; k++) {
        sum += (double)a->descriptor[i * TSUYA_DESCRIPTOR_LENGTH + k] * (double)b->descriptor[j * TSUYA_DESCRIPTOR_LENGTH + k];
    }
    return acos(fmin(sum / (512.0 * 512.0), 1.0));
}

/* The nearest of feature i of a in b that is distinct, −1 for none. */
static int nearest_plain(const tsuya_sift *a, int i, const tsuya_sift *b)
{
    double best = INFINITY, second = INFINITY;
    int index = -1;
    for (int j = 0; j < b->count; j++) {
        double d = angle(a, i, b, j);
        if (d < best) {
            second = best;
            best = d;
            index = j;
        } else if (d < second) {
            second = d;
        }
    }
    return best <= 0.7 && best < 0.8 * second ? index : -1;
}

static void test_same_as_the_plain_loop(void **state)
{
    (void)state;
    tsuya_sift a, b;
    make_features(&a, A, 1);
    make_features(&b, B, 2);
    copy_half(&b, &a);
    for (int threads = 1; threads <= 3; threads++) {
        tsuya_match *match;
        int count, next = 0;
        assert_ok(tsuya_match_features(&match, &count, &a, &b, NULL, threads));
        for (int i = 0; i < A; i++) {
            int j = nearest_plain(&a, i, &b);
            if (j >= 0 && nearest_plain(&b, j, &a) == i) {
                assert_true(next < count);
                assert_int_equal(match[next].a, i);
                assert_int_equal(match[next].b, j);
                next++;
            }
        }
        assert_int_equal(next, count);
        assert_true(count >= A / 2);
        tsuya_free(match);
    }
    tsuya_sift_free(&a);
    tsuya_sift_free(&b);
}

/* Two cameras look at points; every feature is the same to the eye, so that only the epipolar line tells them apart. */
static void test_epipolar_lines_lead(void **state)
{
    (void)state;
    enum { POINTS = 40 };
    tsuya_camera camera = {.lens = TSUYA_LENS_OPENCV4, .width_px = 1000, .height_px = 800, .fx_px = 900, .fy_px = 900, .cx_px = 499.5, .cy_px = 399.5,
                           .distortion = {-0.1, 0.02, 1e-3, -5e-4}};
    tsuya_vec3 up = tsuya_vec3_make(0, 1, 0), aim = tsuya_vec3_make(0, 0, 0);
    tsuya_pose pose_a = tsuya_pose_look_at(tsuya_vec3_make(0.0, 0.0, 3.0), aim, up), pose_b = tsuya_pose_look_at(tsuya_vec3_make(0.7, 0.1, 2.9), aim, up);
    tsuya_sift a, b;
    make_features(&a, 2 * POINTS, 3);
    make_features(&b, 2 * POINTS, 4);
    for (int i = 0; i < POINTS; i++) {
        tsuya_vec3 p = tsuya_vec3_make(0.1 * tsuya_random_normal(5, 1, (uint64_t)i), -0.8 + 1.6 * i / POINTS, 0.1 * tsuya_random_normal(5, 2, (uint64_t)i));
        tsuya_vec2 pixel;
        assert_true(tsuya_camera_project(&camera, tsuya_pose_apply(pose_a, p), &pixel));
        a.position[i] = (tsuya_sift_position){(float)(pixel.x + 0.5), (float)(pixel.y + 0.5)};
        assert_true(tsuya_camera_project(&camera, tsuya_pose_apply(pose_b, p), &pixel));
        b.position[i] = (tsuya_sift_position){(float)(pixel.x + 0.5), (float)(pixel.y + 0.5)};
        memcpy(b.descriptor + (size_t)i * TSUYA_DESCRIPTOR_LENGTH, a.descriptor, TSUYA_DESCRIPTOR_LENGTH);
        memcpy(a.descriptor + (size_t)i * TSUYA_DESCRIPTOR_LENGTH, a.descriptor, TSUYA_DESCRIPTOR_LENGTH);
    }
    tsuya_match *match;
    int count;
    assert_ok(tsuya_match_features(&match, &count, &a, &b, NULL, 1));
    for (int i = 0; i < count; i++) {
        assert_true(match[i].a >= POINTS && match[i].b >= POINTS);
    }
    tsuya_free(match);
    tsuya_sift_undistort(&a, &camera);
    tsuya_sift_undistort(&b, &camera);
    tsuya_guide guide = tsuya_guide_of_poses(pose_a, pose_b, 0.5 / 900.0);
    assert_ok(tsuya_match_features(&match, &count, &a, &b, &guide, 2));
    int right = 0;
    for (int i = 0; i < count; i++) {
        right += match[i].a < POINTS && match[i].a == match[i].b;
        assert_true(match[i].a >= POINTS || match[i].a == match[i].b);
    }
    assert_true(right >= POINTS * 8 / 10);
    tsuya_free(match);
    tsuya_sift_free(&a);
    tsuya_sift_free(&b);
}

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
        cmocka_unit_test(test_same_as_the_plain_loop),      cmocka_unit_test(test_epipolar_lines_lead),
        cmocka_unit_test(test_images_are_numbered_by_name), cmocka_unit_test(test_damaged_features_are_refused),
        cmocka_unit_test(test_two_views_come_back), cmocka_unit_test(test_branch_and_merge),
        cmocka_unit_test(test_lens_that_does_not_reach_its_corners),
    };
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
