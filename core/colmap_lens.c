#include "core/colmap_lens.h"

#include "core/memory.h"

#include <inttypes.h>

const tsuya_colmap_lens tsuya_colmap_lenses[TSUYA_COLMAP_LENS_COUNT] = {
    {0, "SIMPLE_PINHOLE", TSUYA_LENS_SIMPLE_PINHOLE, 3}, {1, "PINHOLE", TSUYA_LENS_PINHOLE, 4},
    {2, "SIMPLE_RADIAL", TSUYA_LENS_SIMPLE_RADIAL, 4},   {3, "RADIAL", TSUYA_LENS_RADIAL, 5},
    {4, "OPENCV", TSUYA_LENS_OPENCV4, 8},                {6, "FULL_OPENCV", TSUYA_LENS_OPENCV8, 12},
};

static bool one_focal(tsuya_lens lens)
{
    return lens == TSUYA_LENS_SIMPLE_PINHOLE || lens == TSUYA_LENS_SIMPLE_RADIAL || lens == TSUYA_LENS_RADIAL;
}

void tsuya_colmap_camera(tsuya_camera *camera, const tsuya_colmap_lens *entry, const double *p)
{
    camera->lens = entry->lens;
    int used = one_focal(entry->lens) ? 1 : 2;
    camera->fx_px = p[0];
    camera->fy_px = p[used - 1];
    camera->cx_px = p[used] - 0.5;
    camera->cy_px = p[used + 1] - 0.5;
    for (int i = used + 2; i < entry->parameters; i++) {
        camera->distortion[i - used - 2] = p[i];
    }
}

/* OPENCV5 is FULL_OPENCV with zeros. */
const tsuya_colmap_lens *tsuya_colmap_parameters(double *p, const tsuya_camera *camera)
{
    tsuya_lens lens = camera->lens == TSUYA_LENS_OPENCV5 ? TSUYA_LENS_OPENCV8 : camera->lens;
    for (int e = 0; e < TSUYA_COLMAP_LENS_COUNT; e++) {
        if (tsuya_colmap_lenses[e].lens == lens) {
            int used = one_focal(lens) ? 1 : 2;
            p[0] = camera->fx_px;
            if (used == 2) {
                p[1] = camera->fy_px;
            }
            p[used] = camera->cx_px + 0.5;
            p[used + 1] = camera->cy_px + 0.5;
            for (int i = used + 2; i < tsuya_colmap_lenses[e].parameters; i++) {
                p[i] = camera->distortion[i - used - 2];
            }
            return &tsuya_colmap_lenses[e];
        }
    }
    (void)tsuya_fail(TSUYA_ERROR_INPUT, "COLMAP has no lens model for %s; at most OPENCV8 can be written", camera->lens == TSUYA_LENS_OPENCV12
                     ? "thin prism terms (OPENCV12)" : "control points (SPLINED_STEREOGRAPHIC)");
    return NULL;
}

tsuya_status tsuya_colmap_open(tsuya_colmap_reader *r, const char *path)
{
    size_t size;
    *r = (tsuya_colmap_reader){.path = path};
    TSUYA_TRY(tsuya_file_load(&r->bytes, &size, path, (size_t)16 << 30));
    r->at = r->bytes;
    r->end = r->bytes + size;
    return TSUYA_OK;
}

tsuya_status tsuya_colmap_check_camera(const tsuya_colmap_reader *r, const tsuya_camera *camera, uint64_t width, uint64_t height)
{
    if (width < 1 || height < 1 || width > LARGEST_SIDE || height > LARGEST_SIDE) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: an image of %" PRIu64 " x %" PRIu64 " pixels; 1 … 65535 a side are accepted", r->path, width, height);
    }
    if (!(camera->fx_px > 0.0) || !(camera->fy_px > 0.0)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: focal length %g px; it must be positive", r->path, camera->fx_px);
    }
    return TSUYA_OK;
}

tsuya_status tsuya_colmap_new_cameras(tsuya_sparse_model *model, size_t count)
{
    model->camera = tsuya_calloc(count, sizeof *model->camera);
    model->camera_id = tsuya_calloc(count, sizeof *model->camera_id);
    return model->camera && model->camera_id ? TSUYA_OK : TSUYA_ERROR_MEMORY;
}
