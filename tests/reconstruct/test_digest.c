/* A detail finds the whole it is of by its largest features, and photographs that hang together cost nothing. */
#include "tests/support.h"

#include "core/context.h"
#include "core/memory.h"
#include "reconstruct/digest.h"

#include <sqlite3.h>

enum { PHOTOS = 5, FEATURES = 900, SHARED = 60, LENGTH = TSUYA_DESCRIPTOR_LENGTH };
static const char *const NAME[PHOTOS] = {"a.jpg", "b.jpg", "c.jpg", "detail.jpg", "other.jpg"};

typedef struct set {
    uint8_t *descriptor; /* PHOTOS × FEATURES × LENGTH */
    float *place;        /* PHOTOS × FEATURES × 2 */
    tsuya_photo photo[PHOTOS];
    tsuya_photo_set photos;
    tsuya_pairs pairs;
    const char *base;
} set;

static void draw_descriptor(uint8_t *to, uint64_t number)
{
    double v[LENGTH], norm = 0.0;
    for (int k = 0; k < LENGTH; k++) {
        v[k] = tsuya_random_uniform(5, number, (uint64_t)k);
        v[k] *= v[k];
        norm += v[k] * v[k];
    }
    for (int k = 0; k < LENGTH; k++) {
        to[k] = (uint8_t)lround(fmin(512.0 * v[k] / sqrt(norm), 255.0));
    }
}

static void step(sqlite3 *base, const char *sql, int id, int columns, const void *data, size_t size)
{
    sqlite3_stmt *query;
    assert_int_equal(sqlite3_prepare_v2(base, sql, -1, &query, NULL), SQLITE_OK);
    sqlite3_bind_int(query, 1, id);
    sqlite3_bind_int(query, 2, FEATURES);
    sqlite3_bind_int(query, 3, columns);
    sqlite3_bind_blob(query, 4, data, (int)size, SQLITE_STATIC);
    assert_int_equal(sqlite3_step(query), SQLITE_DONE);
    sqlite3_finalize(query);
}

/* The largest features, the last, of the detail are among the smaller ones of b. */
static void make(set *s, const char *name)
{
    sqlite3 *base;
    char sql[256];
    *s = (set){.descriptor = tsuya_calloc(PHOTOS * FEATURES * LENGTH, 1), .place = tsuya_calloc((size_t)PHOTOS * FEATURES * 2, sizeof(float)), .base = test_path(name)};
    assert_true(s->descriptor && s->place);
    for (int i = 0; i < PHOTOS * FEATURES; i++) {
        draw_descriptor(s->descriptor + (size_t)i * LENGTH, (uint64_t)i);
    }
    for (int k = 0; k < SHARED; k++) {
        memcpy(s->descriptor + (size_t)(3 * FEATURES + FEATURES - 1 - k) * LENGTH, s->descriptor + (size_t)(FEATURES + 5 * k) * LENGTH, LENGTH);
    }
    assert_int_equal(sqlite3_open(s->base, &base), SQLITE_OK);
    assert_int_equal(sqlite3_exec(base, "CREATE TABLE images (image_id INTEGER PRIMARY KEY, name TEXT UNIQUE, camera_id INTEGER);"
                                        "CREATE TABLE keypoints (image_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);"
                                        "CREATE TABLE descriptors (image_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB);"
                                        "CREATE TABLE two_view_geometries (pair_id INTEGER PRIMARY KEY, rows INTEGER, cols INTEGER, data BLOB, "
                                        "config INTEGER, F BLOB, E BLOB, H BLOB);", NULL, NULL, NULL), SQLITE_OK);
    for (int i = 0; i < PHOTOS; i++) {
        snprintf(sql, sizeof sql, "INSERT INTO images VALUES (%d, '%s', 1)", i + 1, NAME[i]);
        assert_int_equal(sqlite3_exec(base, sql, NULL, NULL, NULL), SQLITE_OK);
        step(base, "INSERT INTO keypoints VALUES (?1, ?2, ?3, ?4)", i + 1, 2, s->place + (size_t)i * FEATURES * 2, FEATURES * 2 * sizeof(float));
        step(base, "INSERT INTO descriptors VALUES (?1, ?2, ?3, ?4)", i + 1, LENGTH, s->descriptor + (size_t)i * FEATURES * LENGTH, (size_t)FEATURES * LENGTH);
        s->photo[i] = (tsuya_photo){.name = (char *)(uintptr_t)NAME[i]};
    }
    sqlite3_close(base);
    s->photos = (tsuya_photo_set){.photo = s->photo, .count = PHOTOS};
    s->pairs = (tsuya_pairs){.photo_count = PHOTOS, .chosen = tsuya_calloc(PHOTOS * PHOTOS, 1)};
    assert_non_null(s->pairs.chosen);
}

/* Verified pairs a–b and b–c, and how many of a–detail. */
static int digest(set *s, int inliers_of_detail)
{
    tsuya_match match[200] = {{0, 0}};
    tsuya_two_view two[3] = {{.image_a = 1, .image_b = 2, .kind = TSUYA_TWO_VIEW_CALIBRATED, .match = match, .match_count = 200},
                             {.image_a = 2, .image_b = 3, .kind = TSUYA_TWO_VIEW_CALIBRATED, .match = match, .match_count = 200},
                             {.image_a = 1, .image_b = 4, .kind = TSUYA_TWO_VIEW_CALIBRATED, .match = match, .match_count = inliers_of_detail}};
    tsuya_database database;
    tsuya_context context = tsuya_context_default();
    int added = -1;
    assert_ok(tsuya_two_views_save(s->base, two, 3));
    assert_ok(tsuya_database_load(&database, s->base));
    assert_ok(tsuya_digest_pairs(&s->pairs, &added, &database, s->base, &s->photos, &context));
    tsuya_database_free(&database);
    return added;
}

static void drop(set *s)
{
    tsuya_free(s->descriptor);
    tsuya_free(s->place);
    tsuya_free(s->pairs.chosen);
}

static void test_detail_finds_its_whole(void **state)
{
    (void)state;
    set s;
    make(&s, "loose.db");
    assert_int_equal(digest(&s, 20), 1);
    assert_int_equal(s.pairs.count, 1);
    assert_true(s.pairs.chosen[1 * PHOTOS + 3] && s.pairs.chosen[3 * PHOTOS + 1]);
    drop(&s);
}

static void test_what_hangs_together_is_left_alone(void **state)
{
    (void)state;
    set s;
    make(&s, "tied.db");
    assert_int_equal(digest(&s, 80), 0); /* other.jpg is compared and resembles none */
    drop(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_detail_finds_its_whole), cmocka_unit_test(test_what_hangs_together_is_left_alone)};
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
