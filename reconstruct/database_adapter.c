#include "reconstruct/database_adapter.h"

#include "core/colmap_lens.h"
#include "core/memory.h"

#include <sqlite3.h>
#include <stdlib.h>

/* COLMAP packs a pair of image ids into one number (base/database.h). */
static const int64_t LARGEST_IMAGE_ID = 2147483647;

static tsuya_status fail_sqlite(sqlite3 *base, const char *path)
{
    tsuya_status status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: not COLMAP's database, or damaged: %s", path, base ? sqlite3_errmsg(base) : "cannot be opened");
    sqlite3_close(base);
    return status;
}

static tsuya_status open_base(sqlite3 **base, const char *path, int flags)
{
    return sqlite3_open_v2(path, base, flags, NULL) == SQLITE_OK ? TSUYA_OK : fail_sqlite(*base, path);
}

static int compare_images(const void *a, const void *b)
{
    return strcmp(((const tsuya_database_image *)a)->name, ((const tsuya_database_image *)b)->name);
}

static tsuya_status read_images(tsuya_database *d, sqlite3 *base, const char *path)
{
    sqlite3_stmt *query = NULL;
    tsuya_status status = TSUYA_OK;
    int capacity = 0;
    if (sqlite3_prepare_v2(base, "SELECT i.image_id, i.camera_id, i.name, k.rows FROM images i LEFT JOIN keypoints k ON i.image_id = k.image_id",
                           -1, &query, NULL) != SQLITE_OK) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: not COLMAP's database: %s", path, sqlite3_errmsg(base));
    }
    while (sqlite3_step(query) == SQLITE_ROW) {
        if (d->image_count == capacity) {
            capacity = capacity * 2 + 64;
            tsuya_database_image *grown = tsuya_realloc(d->image, (size_t)capacity, sizeof *grown);
            if (!grown) {
                status = TSUYA_ERROR_MEMORY;
                break;
            }
            d->image = grown;
        }
        const char *name = (const char *)sqlite3_column_text(query, 2);
        tsuya_database_image *image = &d->image[d->image_count];
        *image = (tsuya_database_image){.image_id = (uint32_t)sqlite3_column_int64(query, 0), .camera_id = (uint32_t)sqlite3_column_int64(query, 1),
                                        .features = sqlite3_column_int(query, 3), .name = tsuya_strdup(name ? name : "")};
        if (!image->name) {
            status = TSUYA_ERROR_MEMORY;
            break;
        }
        d->image_count++;
    }
    sqlite3_finalize(query);
    if (d->image_count > 0) {
        qsort(d->image, (size_t)d->image_count, sizeof *d->image, compare_images);
    }
    return status;
}

static int index_of(const tsuya_database *d, int64_t id)
{
    for (int i = 0; i < d->image_count; i++) {
        if (d->image[i].image_id == id) {
            return i;
        }
    }
    return -1;
}

static int compare_pairs(const void *a, const void *b)
{
    const tsuya_database_pair *x = a, *y = b;
    return x->a != y->a ? x->a - y->a : x->b - y->b;
}

static tsuya_status read_pairs(tsuya_database *d, sqlite3 *base, const char *path)
{
    sqlite3_stmt *query = NULL;
    tsuya_status status = TSUYA_OK;
    int capacity = 0;
    if (sqlite3_prepare_v2(base, "SELECT pair_id, rows FROM two_view_geometries WHERE rows > 0", -1, &query, NULL) != SQLITE_OK) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: not COLMAP's database: %s", path, sqlite3_errmsg(base));
    }
    while (sqlite3_step(query) == SQLITE_ROW) {
        int64_t pair = sqlite3_column_int64(query, 0);
        int a = index_of(d, (pair - pair % LARGEST_IMAGE_ID) / LARGEST_IMAGE_ID), b = index_of(d, pair % LARGEST_IMAGE_ID);
        if (a < 0 || b < 0 || a == b) {
            continue;
        }
        if (d->pair_count == capacity) {
            capacity = capacity * 2 + 256;
            tsuya_database_pair *grown = tsuya_realloc(d->pair, (size_t)capacity, sizeof *grown);
            if (!grown) {
                status = TSUYA_ERROR_MEMORY;
                break;
            }
            d->pair = grown;
        }
        d->pair[d->pair_count++] = (tsuya_database_pair){a < b ? a : b, a < b ? b : a, sqlite3_column_int(query, 1)};
    }
    sqlite3_finalize(query);
    if (d->pair_count > 0) {
        qsort(d->pair, (size_t)d->pair_count, sizeof *d->pair, compare_pairs);
    }
    return status;
}

tsuya_status tsuya_database_load(tsuya_database *database, const char *path)
{
    sqlite3 *base;
    *database = (tsuya_database){0};
    TSUYA_TRY(open_base(&base, path, SQLITE_OPEN_READONLY));
    tsuya_status status = read_images(database, base, path);
    if (status == TSUYA_OK) {
        status = read_pairs(database, base, path);
    }
    sqlite3_close(base);
    if (status != TSUYA_OK) {
        tsuya_database_free(database);
    }
    return status;
}

void tsuya_database_free(tsuya_database *database)
{
    for (int i = 0; i < database->image_count; i++) {
        tsuya_free(database->image[i].name);
    }
    tsuya_free(database->image);
    tsuya_free(database->pair);
    *database = (tsuya_database){0};
}

tsuya_status tsuya_database_clear_matches(const char *path)
{
    sqlite3 *base;
    TSUYA_TRY(open_base(&base, path, SQLITE_OPEN_READWRITE));
    if (sqlite3_exec(base, "DELETE FROM matches; DELETE FROM two_view_geometries;", NULL, NULL, NULL) != SQLITE_OK) {
        return fail_sqlite(base, path);
    }
    sqlite3_close(base);
    return TSUYA_OK;
}

/* Another database becomes `other` within `base`. */
static tsuya_status attach(sqlite3 *base, const char *path, const char *other_path)
{
    char *sql = sqlite3_mprintf("ATTACH DATABASE %Q AS other", other_path);
    int result = sql ? sqlite3_exec(base, sql, NULL, NULL, NULL) : SQLITE_NOMEM;
    sqlite3_free(sql);
    return result == SQLITE_OK ? TSUYA_OK : fail_sqlite(base, path);
}

/* The statement of a table's or an index's making, run in the database at hand. */
static int make_alike(void *base, int columns, char **value, char **name)
{
    (void)columns;
    (void)name;
    return sqlite3_exec(base, value[0], NULL, NULL, NULL) != SQLITE_OK;
}

tsuya_status tsuya_database_branch(const char *path, const char *base_path)
{
    static const char *const SCHEMA =
        "SELECT sql FROM other.sqlite_master WHERE sql IS NOT NULL AND name NOT LIKE 'sqlite_%' ORDER BY type = 'index'";
    static const char *const COPY =
        "INSERT INTO cameras SELECT * FROM other.cameras; INSERT INTO images SELECT * FROM other.images;"
        "INSERT INTO keypoints SELECT * FROM other.keypoints; COMMIT;";
    char sql[64];
    sqlite3 *base;
    sqlite3_stmt *query = NULL;
    TSUYA_TRY(open_base(&base, path, SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE));
    TSUYA_TRY(attach(base, path, base_path));
    bool fine = sqlite3_prepare_v2(base, "PRAGMA other.user_version", -1, &query, NULL) == SQLITE_OK && sqlite3_step(query) == SQLITE_ROW;
    snprintf(sql, sizeof sql, "PRAGMA user_version = %d; BEGIN", fine ? sqlite3_column_int(query, 0) : 0);
    sqlite3_finalize(query);
    if (!fine || sqlite3_exec(base, sql, NULL, NULL, NULL) != SQLITE_OK || sqlite3_exec(base, SCHEMA, make_alike, base, NULL) != SQLITE_OK ||
        sqlite3_exec(base, COPY, NULL, NULL, NULL) != SQLITE_OK) {
        return fail_sqlite(base, path);
    }
    sqlite3_close(base);
    return TSUYA_OK;
}

tsuya_status tsuya_database_merge(const char *base_path, const char *branch)
{
    static const char *const COPY =
        "BEGIN; INSERT OR REPLACE INTO matches SELECT * FROM other.matches;"
        "INSERT OR REPLACE INTO two_view_geometries SELECT * FROM other.two_view_geometries; COMMIT;";
    sqlite3 *base;
    TSUYA_TRY(open_base(&base, base_path, SQLITE_OPEN_READWRITE));
    TSUYA_TRY(attach(base, base_path, branch));
    if (sqlite3_exec(base, COPY, NULL, NULL, NULL) != SQLITE_OK) {
        return fail_sqlite(base, base_path);
    }
    sqlite3_close(base);
    return TSUYA_OK;
}

tsuya_status tsuya_database_sort_images(const char *path)
{
    static const char *const SQL =
        "PRAGMA foreign_keys = OFF; BEGIN;"
        "CREATE TEMP TABLE renumbered AS SELECT image_id AS old_id, ROW_NUMBER() OVER (ORDER BY name) AS new_id FROM images;"
        "CREATE TEMP TABLE sorted_images AS SELECT * FROM images;"
        "CREATE TEMP TABLE sorted_keypoints AS SELECT * FROM keypoints;"
        "CREATE TEMP TABLE sorted_descriptors AS SELECT * FROM descriptors;"
        "DELETE FROM keypoints; DELETE FROM descriptors; DELETE FROM images;"
        "UPDATE sorted_images SET image_id = (SELECT new_id FROM renumbered WHERE old_id = image_id);"
        "UPDATE sorted_keypoints SET image_id = (SELECT new_id FROM renumbered WHERE old_id = image_id);"
        "UPDATE sorted_descriptors SET image_id = (SELECT new_id FROM renumbered WHERE old_id = image_id);"
        "INSERT INTO images SELECT * FROM sorted_images ORDER BY image_id;"
        "INSERT INTO keypoints SELECT * FROM sorted_keypoints ORDER BY image_id;"
        "INSERT INTO descriptors SELECT * FROM sorted_descriptors ORDER BY image_id;"
        "COMMIT;";
    sqlite3 *base;
    TSUYA_TRY(open_base(&base, path, SQLITE_OPEN_READWRITE));
    if (sqlite3_exec(base, SQL, NULL, NULL, NULL) != SQLITE_OK) {
        return fail_sqlite(base, path);
    }
    sqlite3_close(base);
    return TSUYA_OK;
}

/* One row of the statement, whose first column is a number of rows, the second of columns, the third a blob. */
static tsuya_status read_matrix(void **out, int *rows, int *columns, size_t size, sqlite3 *base, const char *path, const char *table, uint32_t id)
{
    char sql[128];
    sqlite3_stmt *query = NULL;
    tsuya_status status = TSUYA_OK;
    *out = NULL;
    *rows = *columns = 0;
    snprintf(sql, sizeof sql, "SELECT rows, cols, data FROM %s WHERE image_id = %u", table, id);
    if (sqlite3_prepare_v2(base, sql, -1, &query, NULL) != SQLITE_OK) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: not COLMAP's database: %s", path, sqlite3_errmsg(base));
    }
    if (sqlite3_step(query) == SQLITE_ROW && sqlite3_column_int(query, 0) > 0) {
        *rows = sqlite3_column_int(query, 0);
        *columns = sqlite3_column_int(query, 1);
        const void *data = sqlite3_column_blob(query, 2);
        size_t bytes = (size_t)sqlite3_column_bytes(query, 2);
        if (*columns < 2 || *columns > 256 || bytes != (size_t)*rows * (size_t)*columns * size) {
            status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: %s of image %u are damaged: %d x %d values in %zu bytes", path, table, id, *rows, *columns, bytes);
        } else {
            *out = tsuya_realloc(NULL, bytes, 1);
            status = *out ? TSUYA_OK : TSUYA_ERROR_MEMORY;
        }
        if (*out) {
            memcpy(*out, data, bytes);
        }
    }
    sqlite3_finalize(query);
    return status;
}

tsuya_status tsuya_sift_load(tsuya_sift *features, const char *path, uint32_t image_id)
{
    sqlite3 *base;
    void *keypoint = NULL, *descriptor = NULL;
    int rows, columns, described, length;
    *features = (tsuya_sift){0};
    TSUYA_TRY(open_base(&base, path, SQLITE_OPEN_READONLY));
    tsuya_status status = read_matrix(&keypoint, &rows, &columns, sizeof(float), base, path, "keypoints", image_id);
    if (status == TSUYA_OK) {
        status = read_matrix(&descriptor, &described, &length, 1, base, path, "descriptors", image_id);
    }
    sqlite3_close(base);
    if (status == TSUYA_OK && (rows != described || (rows > 0 && length != TSUYA_DESCRIPTOR_LENGTH))) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: image %u has %d keypoints and %d descriptors of length %d; expected as many, of length %d", path,
                            image_id, rows, described, length, TSUYA_DESCRIPTOR_LENGTH);
    }
    if (status == TSUYA_OK && rows > 0) {
        features->position = tsuya_calloc((size_t)rows, sizeof *features->position);
        status = features->position ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    }
    for (int i = 0; status == TSUYA_OK && i < rows; i++) {
        const float *k = (const float *)keypoint + (size_t)i * (size_t)columns;
        features->position[i] = (tsuya_sift_position){k[0], k[1]};
    }
    tsuya_free(keypoint);
    features->descriptor = descriptor;
    features->count = rows;
    if (status != TSUYA_OK) {
        tsuya_sift_free(features);
    }
    return status;
}

static int64_t pair_id(uint32_t image_a, uint32_t image_b)
{
    return (int64_t)image_a * LARGEST_IMAGE_ID + (int64_t)image_b;
}

static void read_nine(double nine[9], sqlite3_stmt *query, int column)
{
    const void *data = sqlite3_column_blob(query, column);
    if (data && sqlite3_column_bytes(query, column) == 9 * (int)sizeof(double)) {
        memcpy(nine, data, 9 * sizeof(double));
    }
}

tsuya_status tsuya_two_view_load(tsuya_two_view *pair, const char *path, uint32_t image_a, uint32_t image_b)
{
    sqlite3 *base;
    sqlite3_stmt *query = NULL;
    *pair = (tsuya_two_view){.image_a = image_a, .image_b = image_b};
    TSUYA_TRY(open_base(&base, path, SQLITE_OPEN_READONLY));
    if (sqlite3_prepare_v2(base, "SELECT rows, config, F, E, H FROM two_view_geometries WHERE pair_id = ?1 AND rows > 0", -1, &query, NULL) != SQLITE_OK) {
        return fail_sqlite(base, path);
    }
    sqlite3_bind_int64(query, 1, pair_id(image_a, image_b));
    if (sqlite3_step(query) == SQLITE_ROW) {
        pair->match_count = sqlite3_column_int(query, 0);
        pair->kind = sqlite3_column_int(query, 1);
        read_nine(pair->fundamental, query, 2);
        read_nine(pair->essential, query, 3);
        read_nine(pair->homography, query, 4);
    }
    sqlite3_finalize(query);
    sqlite3_close(base);
    return TSUYA_OK;
}

tsuya_status tsuya_two_views_save(const char *path, const tsuya_two_view *pair, int count)
{
    sqlite3 *base;
    sqlite3_stmt *query = NULL;
    TSUYA_TRY(open_base(&base, path, SQLITE_OPEN_READWRITE));
    bool fine = sqlite3_exec(base, "BEGIN", NULL, NULL, NULL) == SQLITE_OK &&
                sqlite3_prepare_v2(base, "INSERT OR REPLACE INTO two_view_geometries (pair_id, rows, cols, data, config, F, E, H) "
                                         "VALUES (?1, ?2, 2, ?3, ?4, ?5, ?6, ?7)", -1, &query, NULL) == SQLITE_OK;
    for (int i = 0; fine && i < count; i++) {
        const tsuya_two_view *p = &pair[i];
        sqlite3_bind_int64(query, 1, pair_id(p->image_a, p->image_b));
        sqlite3_bind_int(query, 2, p->match_count);
        sqlite3_bind_blob(query, 3, p->match, p->match_count * (int)sizeof *p->match, SQLITE_STATIC);
        sqlite3_bind_int(query, 4, p->kind);
        sqlite3_bind_blob(query, 5, p->fundamental, sizeof p->fundamental, SQLITE_STATIC);
        sqlite3_bind_blob(query, 6, p->essential, sizeof p->essential, SQLITE_STATIC);
        sqlite3_bind_blob(query, 7, p->homography, sizeof p->homography, SQLITE_STATIC);
        fine = sqlite3_step(query) == SQLITE_DONE && sqlite3_reset(query) == SQLITE_OK;
    }
    sqlite3_finalize(query);
    if (!fine || sqlite3_exec(base, "COMMIT", NULL, NULL, NULL) != SQLITE_OK) {
        return fail_sqlite(base, path);
    }
    sqlite3_close(base);
    return TSUYA_OK;
}

/* Runs a statement whose ?1 … are the camera's model, width, height, parameters and then two ids. */
static tsuya_status run_camera(int64_t *last, const char *path, const char *sql, const tsuya_camera *camera, uint32_t id)
{
    double p[12] = {0};
    const tsuya_colmap_lens *lens = tsuya_colmap_parameters(p, camera);
    if (!lens) {
        return TSUYA_ERROR_INPUT;
    }
    sqlite3 *base;
    sqlite3_stmt *query = NULL;
    TSUYA_TRY(open_base(&base, path, SQLITE_OPEN_READWRITE));
    if (sqlite3_prepare_v2(base, sql, -1, &query, NULL) != SQLITE_OK) {
        return fail_sqlite(base, path);
    }
    sqlite3_bind_int(query, 1, lens->id);
    sqlite3_bind_int(query, 2, camera->width_px);
    sqlite3_bind_int(query, 3, camera->height_px);
    sqlite3_bind_blob(query, 4, p, lens->parameters * (int)sizeof *p, SQLITE_TRANSIENT);
    sqlite3_bind_int64(query, 5, id); /* out of range where the statement has no ?5: ignored */
    bool fine = sqlite3_step(query) == SQLITE_DONE;
    sqlite3_finalize(query);
    if (!fine) {
        return fail_sqlite(base, path);
    }
    if (last) {
        *last = sqlite3_last_insert_rowid(base);
    }
    sqlite3_close(base);
    return TSUYA_OK;
}

tsuya_status tsuya_database_set_camera(const char *path, uint32_t camera_id, const tsuya_camera *camera)
{
    return run_camera(NULL, path, "UPDATE cameras SET model = ?1, width = ?2, height = ?3, params = ?4, prior_focal_length = 1 WHERE camera_id = ?5",
                      camera, camera_id);
}

tsuya_status tsuya_database_add_camera(uint32_t *camera_id, const char *path, const tsuya_camera *camera)
{
    int64_t row = 0;
    TSUYA_TRY(run_camera(&row, path, "INSERT INTO cameras (model, width, height, params, prior_focal_length) VALUES (?1, ?2, ?3, ?4, 1)", camera, 0));
    *camera_id = (uint32_t)row;
    return TSUYA_OK;
}

tsuya_status tsuya_database_assign_camera(const char *path, uint32_t image_id, uint32_t camera_id)
{
    sqlite3 *base;
    char sql[128];
    snprintf(sql, sizeof sql, "UPDATE images SET camera_id = %u WHERE image_id = %u", camera_id, image_id);
    TSUYA_TRY(open_base(&base, path, SQLITE_OPEN_READWRITE));
    if (sqlite3_exec(base, sql, NULL, NULL, NULL) != SQLITE_OK) {
        return fail_sqlite(base, path);
    }
    sqlite3_close(base);
    return TSUYA_OK;
}
