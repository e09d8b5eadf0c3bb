#include "weave_detect/patches.h"

#include "core/file.h"
#include "core/geometry.h"
#include "core/memory.h"
#include "weave_detect/detector.h"
#include "weave_detect/label.h"

#include <omp.h>
#include <string.h>

tsuya_patch_options tsuya_patch_options_default(void)
{
    return (tsuya_patch_options){.patch_px = 64, .step_px = 32, .weft_deg = NAN};
}

void tsuya_patches_free(tsuya_patch_grid *grid)
{
    tsuya_free(grid->patch);
    *grid = (tsuya_patch_grid){0};
}

/* At least half of the patch is white, by a grid of 16 × 16 looks. */
static bool kept_by_mask(const tsuya_image *mask, int x0, int y0, int n)
{
    int white = 0;
    if (!mask || !mask->data) {
        return true;
    }
    for (int k = 0; k < 256; k++) {
        int x = x0 + (2 * (k % 16) + 1) * n / 32, y = y0 + (2 * (k / 16) + 1) * n / 32;
        white += tsuya_image_get(mask, x, y, 0) >= 0.5f;
    }
    return white >= 128;
}

typedef struct row_job {
    const tsuya_image *grey, *mask;
    tsuya_patch_grid *grid;
} row_job;

static tsuya_status detect_row(const row_job *job, tsuya_detector *detector, float *values, int row)
{
    tsuya_patch_grid *grid = job->grid;
    int n = grid->patch_px, y0 = row * grid->step_px;
    for (int column = 0; column < grid->columns; column++) {
        int x0 = column * grid->step_px;
        tsuya_patch *patch = &grid->patch[(size_t)row * (size_t)grid->columns + (size_t)column];
        patch->x_px = x0 + 0.5 * (n - 1);
        patch->y_px = y0 + 0.5 * (n - 1);
        if (!kept_by_mask(job->mask, x0, y0, n)) {
            continue;
        }
        for (int y = 0; y < n; y++) {
            memcpy(values + (size_t)y * (size_t)n, tsuya_image_f32(job->grey, x0, y0 + y), (size_t)n * sizeof *values);
        }
        tsuya_detector_run(detector, &patch->threads, values);
    }
    return tsuya_check_interrupt();
}

static tsuya_status detect_rows(const row_job *job, const tsuya_context *context)
{
    tsuya_failure failure = {0};
    int rows = job->grid->rows, n = job->grid->patch_px, done = 0;
#pragma omp parallel num_threads(context->threads)
    {
        tsuya_detector *detector = NULL;
        float *values = tsuya_calloc((size_t)n * (size_t)n, sizeof *values);
        tsuya_status status = values ? tsuya_detector_create(&detector, n, NULL) : TSUYA_ERROR_MEMORY;
#pragma omp for schedule(dynamic, 1)
        for (int row = 0; row < rows; row++) {
            tsuya_status own = status == TSUYA_OK ? detect_row(job, detector, values, row) : status;
#pragma omp critical(tsuya_weave_rows)
            {
                if (own != TSUYA_OK) {
                    tsuya_failure_keep(&failure, (size_t)row, own);
                }
                tsuya_progress_update(context, "threads", ++done, rows, NULL);
            }
        }
        tsuya_detector_free(detector);
        tsuya_free(values);
    }
    return tsuya_failure_raise(&failure);
}

static tsuya_status check_options(const tsuya_image *image, const tsuya_image *mask, const tsuya_patch_options *o)
{
    if (o->patch_px < 16 || o->patch_px > 512 || o->patch_px % 2 != 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "a patch of %d px; even sizes from 16 to 512 are accepted", o->patch_px);
    }
    if (o->step_px < 1) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "a step of %d px; 1 or more is accepted", o->step_px);
    }
    if (image->width_px < o->patch_px || image->height_px < o->patch_px) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "a photograph of %d × %d px is smaller than one patch of %d px; give --patch-px",
                          image->width_px, image->height_px, o->patch_px);
    }
    if (mask && mask->data && (mask->width_px != image->width_px || mask->height_px != image->height_px)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "a mask of %d × %d px for a photograph of %d × %d px; the same size is accepted",
                          mask->width_px, mask->height_px, image->width_px, image->height_px);
    }
    return TSUYA_OK;
}

tsuya_status tsuya_patches_detect(tsuya_patch_grid *grid, const tsuya_image *image, const tsuya_image *mask,
                                  const tsuya_patch_options *options, const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    tsuya_image grey = {0};
    *grid = (tsuya_patch_grid){.patch_px = options->patch_px, .step_px = options->step_px};
    TSUYA_TRY(check_options(image, mask, options));
    grid->columns = (image->width_px - options->patch_px) / options->step_px + 1;
    grid->rows = (image->height_px - options->patch_px) / options->step_px + 1;
    TSUYA_NEW(status, grid->patch, tsuya_patch_count(grid));
    TSUYA_GOTO_DONE(status, tsuya_image_grey(&grey, image, TSUYA_SAMPLE_F32));
    row_job job = {&grey, mask, grid};
    TSUYA_GOTO_DONE(status, detect_rows(&job, context));
    tsuya_patches_label(grid, options->weft_deg);
done:
    tsuya_image_free(&grey);
    if (status != TSUYA_OK) {
        tsuya_patches_free(grid);
    }
    return status;
}

static void write_family(FILE *stream, const tsuya_thread_family *family, bool period)
{
    if (family->seen) {
        fprintf(stream, ",%.4f", period ? family->period_px : tsuya_deg_from_rad(family->angle_rad));
    } else {
        fputc(',', stream);
    }
}

tsuya_status tsuya_patches_save(const tsuya_patch_grid *grid, const char *path)
{
    tsuya_file_writer writer;
    TSUYA_TRY(tsuya_file_begin(&writer, path));
    fputs("x_px,y_px,weft_deg,warp_deg,period_weft_px,period_warp_px,confidence\n", writer.stream);
    for (size_t i = 0; i < tsuya_patch_count(grid); i++) {
        const tsuya_patch *p = &grid->patch[i];
        fprintf(writer.stream, "%.1f,%.1f", p->x_px, p->y_px);
        write_family(writer.stream, &p->threads.a, false);
        write_family(writer.stream, &p->threads.b, false);
        write_family(writer.stream, &p->threads.a, true);
        write_family(writer.stream, &p->threads.b, true);
        fprintf(writer.stream, ",%.4f\n", p->threads.confidence);
    }
    return tsuya_file_commit(&writer);
}
