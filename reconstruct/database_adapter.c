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
