/* COLMAP's binary model files (scene/reconstruction.cc): little-endian, packed. */
#include "core/colmap_lens.h"

#include "core/memory.h"

#include <inttypes.h>

static void take(tsuya_colmap_reader *r, void *out, size_t size)
{
    if (tsuya_colmap_left(r) < size) {
        r->failed = true;
        memset(out, 0, size);
        return;
    }
    memcpy(out, r->at, size);
    r->at += size;
}

static uint64_t take_u64(tsuya_colmap_reader *r)
{
    uint64_t value;
    take(r, &value, sizeof value);
    return value;
}

static uint32_t take_u32(tsuya_colmap_reader *r)
{
    uint32_t value;
    take(r, &value, sizeof value);
    return value;
}

static double take_f64(tsuya_colmap_reader *r)
{
    double value;
    take(r, &value, sizeof value);
    r->failed |= !isfinite(value);
    return value;
}

static tsuya_status damaged(const tsuya_colmap_reader *r, const char *what, uint64_t index)
{
    return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %s %" PRIu64 ": truncated or not a finite number", r->path, what, index);
}

/* A count of items of at least `smallest` bytes each must fit into what is left of the file. */
static tsuya_status take_count(tsuya_colmap_reader *r, size_t *count, size_t smallest, const char *what)
{
    uint64_t value = take_u64(r);
    *count = 0;
    if (r->failed || value > tsuya_colmap_left(r) / smallest) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: says %" PRIu64 " %s, more than the file can hold", r->path, value, what);
    }
    *count = (size_t)value;
    return TSUYA_OK;
}

tsuya_status tsuya_colmap_cameras_binary(tsuya_colmap_reader *r, tsuya_sparse_model *model)
{
    size_t count;
    TSUYA_TRY(take_count(r, &count, 24 + 3 * sizeof(double), "cameras"));
    TSUYA_TRY(tsuya_colmap_new_cameras(model, count));
    for (size_t i = 0; i < count; i++) {
        tsuya_camera *camera = &model->camera[i];
        model->camera_id[i] = take_u32(r);
        int id = (int)take_u32(r);
        uint64_t width = take_u64(r), height = take_u64(r);
        const tsuya_colmap_lens *entry = NULL;
        for (int e = 0; e < TSUYA_COLMAP_LENS_COUNT; e++) {
            entry = tsuya_colmap_lenses[e].id == id ? &tsuya_colmap_lenses[e] : entry;
        }
        if (!entry && !r->failed) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: camera %u has lens model %d; SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV and "
                              "FULL_OPENCV are accepted", r->path, model->camera_id[i], id);
        }
        double p[12] = {0};
        for (int k = 0; entry && k < entry->parameters; k++) {
            p[k] = take_f64(r);
        }
        if (r->failed) {
            return damaged(r, "camera", i);
        }
        tsuya_colmap_camera(camera, entry, p);
        TSUYA_TRY(tsuya_colmap_check_camera(r, camera, width, height));
        camera->width_px = (int)width;
        camera->height_px = (int)height;
        model->camera_count++;
    }
    return TSUYA_OK;
}

static tsuya_status take_name(tsuya_colmap_reader *r, char **name)
{
    const char *end = memchr(r->at, '\0', tsuya_colmap_left(r) < LONGEST_NAME ? tsuya_colmap_left(r) : LONGEST_NAME);
    if (!end || end == r->at) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: an image without a name", r->path);
    }
    *name = tsuya_strdup(r->at);
    r->at = end + 1;
    return *name ? TSUYA_OK : TSUYA_ERROR_MEMORY;
}

static tsuya_status read_view_binary(tsuya_colmap_reader *r, tsuya_view *view, uint64_t index)
{
    view->image_id = take_u32(r);
    tsuya_quaternion q = {take_f64(r), 0, 0, 0};
    q.x = take_f64(r);
    q.y = take_f64(r);
    q.z = take_f64(r);
    view->camera_from_world.rotation = tsuya_mat3_from_quaternion(q);
    view->camera_from_world.translation.x = take_f64(r);
    view->camera_from_world.translation.y = take_f64(r);
    view->camera_from_world.translation.z = take_f64(r);
    view->camera_id = take_u32(r);
    if (r->failed) {
        return damaged(r, "image", index);
    }
    TSUYA_TRY(take_name(r, &view->name));
    size_t count;
    TSUYA_TRY(take_count(r, &count, 24, "observations"));
    if (count > INT32_MAX || !(view->observation = tsuya_calloc(count, sizeof *view->observation))) {
        return TSUYA_ERROR_MEMORY;
    }
    view->observation_count = (int)count;
    for (size_t k = 0; k < count; k++) {
        view->observation[k].x_px = (float)(take_f64(r) - 0.5);
        view->observation[k].y_px = (float)(take_f64(r) - 0.5);
        view->observation[k].point = (int64_t)take_u64(r); /* an id until link_points */
    }
    return r->failed ? damaged(r, "image", index) : TSUYA_OK;
}

tsuya_status tsuya_colmap_views_binary(tsuya_colmap_reader *r, tsuya_sparse_model *model)
{
    size_t count;
    TSUYA_TRY(take_count(r, &count, 74, "images"));
    if (count > INT32_MAX || !(model->view = tsuya_calloc(count, sizeof *model->view))) {
        return TSUYA_ERROR_MEMORY;
    }
    for (size_t i = 0; i < count; i++) {
        model->view_count++;
        TSUYA_TRY(read_view_binary(r, &model->view[i], i));
    }
    return TSUYA_OK;
}

tsuya_status tsuya_colmap_points_binary(tsuya_colmap_reader *r, tsuya_sparse_model *model)
{
    size_t count;
    TSUYA_TRY(take_count(r, &count, 51, "points"));
    if (!(model->point = tsuya_calloc(count, sizeof *model->point))) {
        return TSUYA_ERROR_MEMORY;
    }
    for (size_t i = 0; i < count; i++) {
        tsuya_point *point = &model->point[i];
        model->point_count++;
        point->point_id = take_u64(r);
        point->position.x = take_f64(r);
        point->position.y = take_f64(r);
        point->position.z = take_f64(r);
        take(r, point->color, 3);
        point->error_px = take_f64(r);
        size_t tracks;
        TSUYA_TRY(take_count(r, &tracks, 8, "track elements"));
        if (tracks > INT32_MAX || !(point->track = tsuya_calloc(tracks, sizeof *point->track))) {
            return TSUYA_ERROR_MEMORY;
        }
        point->track_count = (int)tracks;
        for (size_t k = 0; k < tracks; k++) {
            point->track[k].view = (int)take_u32(r); /* an image id until link_points */
            point->track[k].observation = (int)take_u32(r);
        }
        if (r->failed) {
            return damaged(r, "point", i);
        }
    }
    return TSUYA_OK;
}
