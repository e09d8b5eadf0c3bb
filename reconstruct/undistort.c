#include "reconstruct/undistort.h"

#include "core/file.h"
#include "core/memory.h"

#include <assert.h>
#include <math.h>
#include <string.h>

enum { BORDER = 64 };
static const double LEAST_SCALE = 0.2, SCALE_STEP = 0.02;

/* The edges of the image, from corner to corner, as it goes round. */
static tsuya_vec2 on_border(const tsuya_camera *lens, int i)
{
    double t = (double)(i % BORDER) / BORDER, w = lens->width_px, h = lens->height_px;
    const tsuya_vec2 at[4] = {{t * w, 0.0}, {w, t * h}, {w - t * w, h}, {0.0, h - t * h}};
    return (tsuya_vec2){at[i / BORDER].x - 0.5, at[i / BORDER].y - 0.5};
}

static bool reaches_border(const tsuya_camera *lens)
{
    tsuya_vec3 ray;
    bool reaches = true;
    for (int i = 0; i < 4 * BORDER && reaches; i++) {
        reaches = tsuya_camera_unproject(lens, on_border(lens, i), &ray);
    }
    return reaches;
}

/* Every pixel of a pinhole of the lens' focal length, `scale` times its size, lies before the fold of its distortion. */
static bool holds(const tsuya_camera *lens, double scale)
{
    for (int i = 0; i < 4 * BORDER; i++) {
        tsuya_vec2 border = on_border(lens, i), pixel;
        tsuya_vec3 ray = {scale * (border.x - lens->cx_px) / lens->fx_px, scale * (border.y - lens->cy_px) / lens->fy_px, 1.0}, back;
        if (!tsuya_camera_project(lens, ray, &pixel) || !tsuya_camera_unproject(lens, pixel, &back) || !(back.z > 0.0)
            || hypot(back.x / back.z - ray.x, back.y / back.z - ray.y) > 1e-6) {
            return false;
        }
    }
    return true;
}

double tsuya_undistort_scale(const tsuya_sparse_model *model)
{
    double scale = 0.0;
    for (int c = 0; c < model->camera_count; c++) {
        if (!reaches_border(&model->camera[c])) {
            double own = 1.0;
            while (own > LEAST_SCALE && !holds(&model->camera[c], own)) {
                own -= SCALE_STEP;
            }
            scale = scale > 0.0 ? fmin(scale, own) : own;
        }
    }
    return scale;
}

/* Lanczos' kernel of three lobes, for PHASES places between two pixels, each six weights of sum 1. */
enum { TAPS = 6, PHASES = 2048 };
typedef struct lanczos { float weight[PHASES + 1][TAPS]; } lanczos;

static double sinc(double x) { return fabs(x) < 1e-12 ? 1.0 : sin(M_PI * x) / (M_PI * x); }

static lanczos *create_lanczos(void)
{
    lanczos *l = tsuya_calloc(1, sizeof *l);
    for (int p = 0; l && p <= PHASES; p++) {
        double sum = 0.0, w[TAPS];
        for (int k = 0; k < TAPS; k++) {
            double x = k - 2 - (double)p / PHASES;
            w[k] = fabs(x) < 3.0 ? sinc(x) * sinc(x / 3.0) : 0.0;
            sum += w[k];
        }
        for (int k = 0; k < TAPS; k++) {
            l->weight[p][k] = (float)(w[k] / sum);
        }
    }
    return l;
}

static int between(int i, int count) { return i < 0 ? 0 : i >= count ? count - 1 : i; }

/* Edges clamped. */
static void sample_lanczos(const lanczos *l, const tsuya_image *in, double x, double y, float *out)
{
    const int x0 = (int)floor(x), y0 = (int)floor(y), channels = in->channels;
    const float *wx = l->weight[(int)lrint((x - x0) * PHASES)], *wy = l->weight[(int)lrint((y - y0) * PHASES)];
    int column[TAPS];
    for (int k = 0; k < TAPS; k++) {
        column[k] = channels * between(x0 - 2 + k, in->width_px);
    }
    for (int j = 0; j < TAPS; j++) {
        const float *row = tsuya_image_f32(in, 0, between(y0 - 2 + j, in->height_px));
        for (int c = 0; c < channels; c++) {
            float sum = 0.0f;
            for (int k = 0; k < TAPS; k++) {
                sum += wx[k] * row[column[k] + c];
            }
            out[c] += wy[j] * sum;
        }
    }
}

tsuya_status tsuya_undistort(tsuya_image *out, const tsuya_image *in, const tsuya_camera *pinhole, const tsuya_camera *lens, tsuya_resample how, int threads)
{
    lanczos *kernel = NULL;
    assert(how == TSUYA_RESAMPLE_LINEAR || in->sample == TSUYA_SAMPLE_F32);
    if (how == TSUYA_RESAMPLE_LANCZOS && !(kernel = create_lanczos())) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_status status = tsuya_image_create(out, pinhole->width_px, pinhole->height_px, in->channels, TSUYA_SAMPLE_F32, in->encoding);
    double sx = (double)in->width_px / lens->width_px, sy = (double)in->height_px / lens->height_px;
    const int rows = status == TSUYA_OK ? out->height_px : 0;
#pragma omp parallel for num_threads(threads)
    for (int y = 0; y < rows; y++) {
        for (int x = 0; x < out->width_px; x++) {
            tsuya_vec3 ray = {(x - pinhole->cx_px) / pinhole->fx_px, (y - pinhole->cy_px) / pinhole->fy_px, 1.0};
            tsuya_vec2 pixel;
            if (!tsuya_camera_project(lens, ray, &pixel) || !(pixel.x > -0.5 && pixel.y > -0.5 && pixel.x < lens->width_px - 0.5 && pixel.y < lens->height_px - 0.5)) {
                continue;
            }
            pixel = (tsuya_vec2){(pixel.x + 0.5) * sx - 0.5, (pixel.y + 0.5) * sy - 0.5};
            if (kernel) {
                sample_lanczos(kernel, in, pixel.x, pixel.y, tsuya_image_f32(out, x, y));
            } else {
                tsuya_image_sample_bilinear(in, pixel.x, pixel.y, tsuya_image_f32(out, x, y));
            }
        }
    }
    tsuya_free(kernel);
    return status;
}

tsuya_status tsuya_undistort_mask(const char *path, const char *mask_path, const tsuya_camera *pinhole, const tsuya_camera *lens, int threads)
{
    tsuya_image mask = {0}, smooth = {0}, kept = {0};
    tsuya_status status;
    TSUYA_GOTO_DONE(status, tsuya_image_load(&mask, mask_path));
    TSUYA_GOTO_DONE(status, tsuya_undistort(&smooth, &mask, pinhole, lens, TSUYA_RESAMPLE_LINEAR, threads));
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
        tsuya_status status =
            tsuya_undistort_mask(path, photo->mask_path, &dense->camera[view->camera], &sparse->camera[sparse->view[original].camera], 1);
#pragma omp critical(tsuya_undistort)
        tsuya_failure_keep(&failure, (size_t)v, status);
    }
    return tsuya_failure_raise(&failure);
}
