#include "reconstruct/silhouette.h"

#include "core/camera.h"
#include "core/file.h"
#include "core/memory.h"
#include "core/order.h"
#include "core/raster.h"
#include "reconstruct/view_mask.h"


static void compare(tsuya_silhouette_view *out, const tsuya_raster *raster, const tsuya_image *mask)
{
    size_t both = 0, either = 0, drawn = 0, white = 0;
    for (int y = 0; y < raster->height_px; y++) {
        for (int x = 0; x < raster->width_px; x++) {
            bool m = raster->depth[(size_t)y * (size_t)raster->width_px + (size_t)x] > 0.0f;
            bool w = *tsuya_image_u8(mask, x, y) >= 128;
            both += m && w;
            either += m || w;
            drawn += m;
            white += w;
        }
    }
    out->iou = either ? (double)both / (double)either : 1.0;
    out->covered = white ? (double)both / (double)white : 1.0;
    out->inside = drawn ? (double)both / (double)drawn : 1.0;
}

/* Adds a view's figures; a view without a mask adds nothing. */
static tsuya_status add_view(tsuya_silhouette_info *info, const tsuya_mesh *mesh, const char *workspace, const tsuya_view *view,
                             const tsuya_camera *camera, const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    tsuya_image mask = {0};
    tsuya_raster raster = {0};
    TSUYA_GOTO_DONE(status, tsuya_view_mask_load(&mask, workspace, view->name, camera));
    if (mask.data) {
        TSUYA_GOTO_DONE(status, tsuya_raster_create(&raster, camera->width_px, camera->height_px));
        TSUYA_GOTO_DONE(status, tsuya_raster_draw(&raster, mesh, camera, view->camera_from_world, context));
        tsuya_silhouette_view *out = &info->view[info->count];
        out->name = tsuya_strdup(view->name);
        if (!out->name) {
            status = TSUYA_ERROR_MEMORY;
            goto done;
        }
        compare(out, &raster, &mask);
        info->count++;
    }
done:
    tsuya_image_free(&mask);
    tsuya_raster_free(&raster);
    return status;
}

static tsuya_status summarise(tsuya_silhouette_info *info)
{
    double *sorted = tsuya_calloc((size_t)info->count, sizeof *sorted);
    if (!sorted) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int i = 0; i < info->count; i++) {
        sorted[i] = info->view[i].iou;
    }
    tsuya_sort_doubles(sorted, (size_t)info->count);
    info->iou_min = sorted[0];
    info->iou_median = 0.5 * (sorted[(info->count - 1) / 2] + sorted[info->count / 2]);
    tsuya_free(sorted);
    return TSUYA_OK;
}

tsuya_status tsuya_silhouette(tsuya_silhouette_info *info, const tsuya_mesh *mesh, const char *workspace,
                              const tsuya_context *context)
{
    *info = (tsuya_silhouette_info){0};
    tsuya_status status = TSUYA_OK;
    tsuya_sparse_model model = {0};
    char *sparse = tsuya_path_join(workspace, "sparse");
    if (!sparse) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_GOTO_DONE(status, tsuya_sparse_model_load(&model, sparse));
    TSUYA_NEW(status, info->view, (size_t)model.view_count);
    for (int i = 0; i < model.view_count; i++) {
        const tsuya_view *view = &model.view[i];
        TSUYA_GOTO_DONE(status, add_view(info, mesh, workspace, view, &model.camera[view->camera], context));
        tsuya_progress_update(context, "silhouettes", i + 1.0, model.view_count, view->name);
    }
    if (info->count == 0) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s/masks: no NAME.png for any of the %d photographs", workspace,
                            model.view_count);
        goto done;
    }
    status = summarise(info);
done:
    tsuya_free(sparse);
    tsuya_sparse_model_free(&model);
    if (status != TSUYA_OK) {
        tsuya_silhouette_info_free(info);
    }
    return status;
}

void tsuya_silhouette_info_free(tsuya_silhouette_info *info)
{
    for (int i = 0; i < info->count; i++) {
        tsuya_free(info->view[i].name);
    }
    tsuya_free(info->view);
    *info = (tsuya_silhouette_info){0};
}

void tsuya_silhouette_info_to_json(tsuya_json *object, const tsuya_silhouette_info *info)
{
    tsuya_json_set_number(object, "iou_median", info->iou_median);
    tsuya_json_set_number(object, "iou_min", info->iou_min);
    tsuya_json *views = tsuya_json_set_array(object, "views");
    for (int i = 0; i < info->count; i++) {
        tsuya_json *view = tsuya_json_add_object(views);
        tsuya_json_set_text(view, "name", info->view[i].name);
        tsuya_json_set_number(view, "iou", info->view[i].iou);
        tsuya_json_set_number(view, "covered", info->view[i].covered);
        tsuya_json_set_number(view, "inside", info->view[i].inside);
    }
}
