/* Visual hull (Laurentini 1994): a point of the object falls on white in every mask that sees it. */
#include "core/camera.h"
#include "core/file.h"
#include "core/memory.h"
#include "reconstruct/cloud_clean.h"
#include "reconstruct/view_mask.h"

#include <string.h>

enum { VIEWS_AGAINST = 2 };

/* Distance to white, per pixel; NULL where the view has no mask. */
static tsuya_status distance_to_white(uint16_t **distance, const char *workspace, const tsuya_view *view,
                                      const tsuya_camera *camera)
{
    *distance = NULL;
    tsuya_image mask;
    TSUYA_TRY(tsuya_view_mask_load(&mask, workspace, view->name, camera));
    if (!mask.data) {
        return TSUYA_OK;
    }
    tsuya_status status = TSUYA_OK;
    size_t w = (size_t)camera->width_px;
    TSUYA_NEW(status, *distance, w * (size_t)camera->height_px);
    for (int y = 0; y < mask.height_px; y++) {
        for (int x = 0; x < mask.width_px; x++) {
            (*distance)[(size_t)y * w + (size_t)x] = *tsuya_image_u8(&mask, x, y) >= 128;
        }
    }
    tsuya_distance_to_marked(*distance, mask.width_px, mask.height_px);
done:
    tsuya_image_free(&mask);
    return status;
}

static void count_outside(uint8_t *against, const tsuya_mesh *cloud, const uint16_t *distance, int margin_px,
                          const tsuya_view *view, const tsuya_camera *camera, int threads)
{
#pragma omp parallel for num_threads(threads)
    for (size_t v = 0; v < cloud->vertex_count; v++) {
        tsuya_vec2 pixel;
        tsuya_vec3 p = tsuya_pose_apply(view->camera_from_world, tsuya_mesh_position(cloud, v));
        if (against[v] < UINT8_MAX && tsuya_camera_project(camera, p, &pixel) && pixel.x > -0.5 && pixel.y > -0.5 &&
            pixel.x < camera->width_px - 0.5 && pixel.y < camera->height_px - 0.5) {
            size_t at = (size_t)lrint(pixel.y) * (size_t)camera->width_px + (size_t)lrint(pixel.x);
            against[v] = (uint8_t)(against[v] + (distance[at] > margin_px));
        }
    }
}

tsuya_status tsuya_cloud_mark_outside_hull(uint8_t *keep, const tsuya_mesh *cloud, const char *workspace, int margin_px,
                                           const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    tsuya_sparse_model model = {0};
    uint8_t *against = NULL;
    uint16_t *distance = NULL;
    char *sparse = tsuya_path_join(workspace, "sparse");
    if (!sparse) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_GOTO_DONE(status, tsuya_sparse_model_load(&model, sparse));
    TSUYA_NEW(status, against, cloud->vertex_count);
    for (int i = 0; i < model.view_count; i++) {
        const tsuya_view *view = &model.view[i];
        const tsuya_camera *camera = &model.camera[view->camera];
        TSUYA_GOTO_DONE(status, tsuya_check_interrupt());
        TSUYA_GOTO_DONE(status, distance_to_white(&distance, workspace, view, camera));
        if (distance) {
            count_outside(against, cloud, distance, margin_px, view, camera, context->threads);
        }
        tsuya_free(distance);
        distance = NULL;
        tsuya_progress_update(context, "visual hull", i + 1.0, model.view_count, view->name);
    }
    for (size_t v = 0; v < cloud->vertex_count; v++) {
        keep[v] = keep[v] && against[v] < VIEWS_AGAINST;
    }
done:
    tsuya_free(sparse);
    tsuya_free(against);
    tsuya_free(distance);
    tsuya_sparse_model_free(&model);
    return status;
}
