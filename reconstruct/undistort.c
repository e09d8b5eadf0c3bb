#include "reconstruct/undistort.h"

#include "core/file.h"

#include <math.h>
#include <string.h>

tsuya_status tsuya_undistort(tsuya_image *out, const tsuya_image *in, const tsuya_camera *pinhole, const tsuya_camera *lens)
{
    TSUYA_TRY(tsuya_image_create(out, pinhole->width_px, pinhole->height_px, in->channels, TSUYA_SAMPLE_F32, in->encoding));
    double sx = (double)in->width_px / lens->width_px, sy = (double)in->height_px / lens->height_px;
#pragma omp parallel for
    for (int y = 0; y < out->height_px; y++) {
        for (int x = 0; x < out->width_px; x++) {
            tsuya_vec3 ray = {(x - pinhole->cx_px) / pinhole->fx_px, (y - pinhole->cy_px) / pinhole->fy_px, 1.0};
            tsuya_vec2 pixel;
            if (tsuya_camera_project(lens, ray, &pixel) && pixel.x > -0.5 && pixel.y > -0.5 && pixel.x < lens->width_px - 0.5
                && pixel.y < lens->height_px - 0.5) {
                tsuya_image_sample_bilinear(in, (pixel.x + 0.5) * sx - 0.5, (pixel.y + 0.5) * sy - 0.5, tsuya_image_f32(out, x, y));
            }
        }
    }
    return TSUYA_OK;
}

static tsuya_status undistort_mask(const char *path, const char *mask_path, const tsuya_camera *pinhole, const tsuya_camera *lens)
{
    tsuya_image mask = {0}, smooth = {0}, kept = {0};
    tsuya_status status;
    TSUYA_GOTO_DONE(status, tsuya_image_load(&mask, mask_path));
    TSUYA_GOTO_DONE(status, tsuya_undistort(&smooth, &mask, pinhole, lens));
    TSUYA_GOTO_DONE(status, tsuya_image_create(&kept, pinhole->width_px, pinhole->height_px, 1, TSUYA_SAMPLE_U8, TSUYA_ENCODING_DATA));
    for (int y = 0; y < kept.height_px; y++) {
        for (int x = 0; x < kept.width_px; x++) {
            *tsuya_image_u8(&kept, x, y) = *tsuya_image_f32(&smooth, x, y) >= 0.5f ? 255 : 0;
        }
    }
    TSUYA_GOTO_DONE(status, tsuya_image_save(&kept, path, NULL));
done:
    tsuya_image_free(&mask);
    tsuya_image_free(&smooth);
    tsuya_image_free(&kept);
    return status;
}

static const tsuya_photo *find_photo(const tsuya_photo_set *photos, const char *name)
{
    for (int i = 0; i < photos->count; i++) {
        if (strcmp(photos->photo[i].name, name) == 0) {
            return &photos->photo[i];
        }
    }
    return NULL;
}

tsuya_status tsuya_undistort_masks(const char *workspace, const tsuya_sparse_model *dense, const tsuya_sparse_model *sparse,
                                   const tsuya_photo_set *photos, const tsuya_context *context)
{
    tsuya_failure failure = {0};
    char folder[4096];
    snprintf(folder, sizeof folder, "%s/masks", workspace);
    TSUYA_TRY(tsuya_folder_make(folder));
#pragma omp parallel for schedule(dynamic) num_threads(context->threads)
    for (int v = 0; v < dense->view_count; v++) {
        const tsuya_view *view = &dense->view[v];
        const tsuya_photo *photo = find_photo(photos, view->name);
        int original = tsuya_sparse_model_find(sparse, view->name);
        if (!photo || !photo->mask_path || original < 0) {
            continue;
        }
        char path[8192];
        snprintf(path, sizeof path, "%s/%s.png", folder, view->name);
        tsuya_status status = undistort_mask(path, photo->mask_path, &dense->camera[view->camera], &sparse->camera[sparse->view[original].camera]);
#pragma omp critical(tsuya_undistort)
        tsuya_failure_keep(&failure, (size_t)v, status);
    }
    return tsuya_failure_raise(&failure);
}
