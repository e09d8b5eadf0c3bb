/* COLMAP's sparse models: the parts read, ids turned into indices.
 *
 * COLMAP puts the centre of the first pixel at (0.5, 0.5).  colmap_lens.c shifts principal points, the readers and the
 * writer shift observations, and nothing else does. */
#include "core/colmap_lens.h"

#include "core/memory.h"

#include <inttypes.h>
#include <stdlib.h>

static int compare_views(const void *a, const void *b)
{
    return strcmp(((const tsuya_view *)a)->name, ((const tsuya_view *)b)->name);
}

typedef struct id_index {
    uint64_t id;
    int64_t index;
} id_index;

static int compare_ids(const void *a, const void *b)
{
    uint64_t x = ((const id_index *)a)->id, y = ((const id_index *)b)->id;
    return x < y ? -1 : x > y;
}

static int64_t find_id(const id_index *list, size_t count, uint64_t id)
{
    id_index wanted = {id, 0};
    const id_index *found = count ? bsearch(&wanted, list, count, sizeof *list, compare_ids) : NULL;
    return found ? found->index : -1;
}

static tsuya_status link_cameras(tsuya_sparse_model *model, const char *folder)
{
    for (int v = 0; v < model->view_count; v++) {
        tsuya_view *view = &model->view[v];
        view->camera = -1;
        for (int c = 0; c < model->camera_count; c++) {
            view->camera = model->camera_id[c] == view->camera_id ? c : view->camera;
        }
        if (view->camera < 0) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: image %s names camera %u, which does not exist", folder, view->name, view->camera_id);
        }
        if (v > 0 && strcmp(view->name, model->view[v - 1].name) == 0) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: image %s occurs twice", folder, view->name);
        }
    }
    return TSUYA_OK;
}

/* Ids become indices. A reference to a point that is not there (an empty points3D beside images that had tracks) becomes −1;
 * a track that names what does not exist is refused. */
static tsuya_status link_points(tsuya_sparse_model *model, const char *folder)
{
    tsuya_status status = TSUYA_OK;
    id_index *points = NULL, *views = NULL;
    TSUYA_NEW(status, points, model->point_count);
    TSUYA_NEW(status, views, (size_t)model->view_count);
    for (size_t i = 0; i < model->point_count; i++) {
        points[i] = (id_index){model->point[i].point_id, (int64_t)i};
    }
    for (int i = 0; i < model->view_count; i++) {
        views[i] = (id_index){model->view[i].image_id, i};
    }
    qsort(points, model->point_count, sizeof *points, compare_ids);
    qsort(views, (size_t)model->view_count, sizeof *views, compare_ids);
    for (int v = 0; v < model->view_count; v++) {
        for (int k = 0; k < model->view[v].observation_count; k++) {
            tsuya_observation *observation = &model->view[v].observation[k];
            observation->point = observation->point == -1 ? -1 : find_id(points, model->point_count, (uint64_t)observation->point);
        }
    }
    for (size_t i = 0; i < model->point_count; i++) {
        tsuya_point *point = &model->point[i];
        for (int k = 0; k < point->track_count; k++) {
            int64_t view = find_id(views, (size_t)model->view_count, (uint32_t)point->track[k].view);
            int observation = point->track[k].observation;
            if (view < 0 || observation < 0 || observation >= model->view[view].observation_count) {
                status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: point %" PRIu64 " is seen in image %u, observation %d, which does not exist", folder,
                                    point->point_id, (uint32_t)point->track[k].view, observation);
                goto done;
            }
            point->track[k].view = (int)view;
        }
    }
done:
    tsuya_free(points);
    tsuya_free(views);
    return status;
}

static tsuya_status read_part(tsuya_sparse_model *model, const char *folder, const char *stem, tsuya_colmap_part_reader binary, tsuya_colmap_part_reader text,
                              bool required)
{
    char path[LONGEST_NAME];
    for (int kind = 0; kind < 2; kind++) {
        snprintf(path, sizeof path, "%s/%s.%s", folder, stem, kind == 0 ? "bin" : "txt");
        if (!tsuya_path_exists(path)) {
            continue;
        }
        tsuya_colmap_reader r;
        TSUYA_TRY(tsuya_colmap_open(&r, path));
        tsuya_status status = (kind == 0 ? binary : text)(&r, model);
        tsuya_free(r.bytes);
        return status;
    }
    return required ? tsuya_fail(TSUYA_ERROR_INPUT, "%s: no %s.bin and no %s.txt; a COLMAP sparse model was expected", folder, stem, stem)
                    : TSUYA_OK;
}

tsuya_status tsuya_sparse_model_load(tsuya_sparse_model *model, const char *folder)
{
    *model = (tsuya_sparse_model){0};
    tsuya_status status;
    TSUYA_GOTO_DONE(status, read_part(model, folder, "cameras", tsuya_colmap_cameras_binary, tsuya_colmap_cameras_text, true));
    TSUYA_GOTO_DONE(status, read_part(model, folder, "images", tsuya_colmap_views_binary, tsuya_colmap_views_text, true));
    TSUYA_GOTO_DONE(status, read_part(model, folder, "points3D", tsuya_colmap_points_binary, tsuya_colmap_points_text, false));
    qsort(model->view, (size_t)model->view_count, sizeof *model->view, compare_views);
    TSUYA_GOTO_DONE(status, link_cameras(model, folder));
    TSUYA_GOTO_DONE(status, link_points(model, folder));
done:
    if (status != TSUYA_OK) {
        tsuya_sparse_model_free(model);
    }
    return status;
}

void tsuya_sparse_model_free(tsuya_sparse_model *model)
{
    for (int v = 0; v < model->view_count; v++) {
        tsuya_free(model->view[v].name);
        tsuya_free(model->view[v].observation);
    }
    for (size_t i = 0; i < model->point_count; i++) {
        tsuya_free(model->point[i].track);
    }
    tsuya_free(model->camera);
    tsuya_free(model->camera_id);
    tsuya_free(model->view);
    tsuya_free(model->point);
    *model = (tsuya_sparse_model){0};
}

int tsuya_sparse_model_find(const tsuya_sparse_model *model, const char *name)
{
    int low = 0, high = model->view_count - 1;
    while (low <= high) {
        int middle = low + (high - low) / 2, order = strcmp(model->view[middle].name, name);
        if (order == 0) {
            return middle;
        }
        low = order < 0 ? middle + 1 : low;
        high = order < 0 ? high : middle - 1;
    }
    return -1;
}

void tsuya_sparse_model_transform(tsuya_sparse_model *model, tsuya_similarity s)
{
    for (int v = 0; v < model->view_count; v++) {
        /* x_cam = R x_old + t and x_new = s Q x_old + q, so s x_cam = R Qᵀ (x_new − q) + s t: cameras keep their pixels. */
        tsuya_pose *pose = &model->view[v].camera_from_world;
        tsuya_mat3 rotation = tsuya_mat3_multiply(pose->rotation, tsuya_mat3_transpose(s.rotation));
        pose->translation = tsuya_vec3_sub(tsuya_vec3_scale(pose->translation, s.scale), tsuya_mat3_apply(rotation, s.translation));
        pose->rotation = rotation;
    }
    for (size_t i = 0; i < model->point_count; i++) {
        model->point[i].position = tsuya_similarity_apply(s, model->point[i].position);
    }
}
