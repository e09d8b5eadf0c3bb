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

static bool is_white(const tsuya_image *mask, int x, int y) { return tsuya_image_get(mask, x, y, 0) >= 0.5f; }

/* At least half of the patch is white, by a grid of 16 × 16 looks. */
static bool kept_by_mask(const tsuya_image *mask, int x0, int y0, int n)
{
    int white = 0;
    if (!mask || !mask->data) {
        return true;
    }
    for (int k = 0; k < 256; k++) {
        white += is_white(mask, x0 + (2 * (k % 16) + 1) * n / 32, y0 + (2 * (k / 16) + 1) * n / 32);
    }
    return white >= 128;
}

/* What a patch says is said of its middle. */
static bool middle_is_kept(const tsuya_image *mask, int x, int y) { return !mask || !mask->data || is_white(mask, x, y); }

/* Windows of twice the patch's side stand a side apart; the last of a row stands flush with the image's rim. */
typedef struct patch_job {
    const tsuya_image *grey, *mask;
    tsuya_patch_grid *grid;
    tsuya_finding *finding; /* NULL: the image has no room for windows */
    int window_columns, window_rows;
    bool following; /* else: finding */
} patch_job;

static int window_start(int index, int patch_px, int length_px) { return index * patch_px < length_px - 2 * patch_px ? index * patch_px : length_px - 2 * patch_px; }

static void copy_values(float *values, const tsuya_image *grey, int x0, int y0, int n)
{
    for (int y = 0; y < n; y++) {
        memcpy(values + (size_t)y * (size_t)n, tsuya_image_f32(grey, x0, y0 + y), (size_t)n * sizeof *values);
    }
}

static void find_in_row(const patch_job *job, tsuya_detector *detector, float *values, int row)
{
    int n = job->grid->patch_px, y0 = window_start(row, n, job->grey->height_px);
    for (int column = 0; column < job->window_columns; column++) {
        int x0 = window_start(column, n, job->grey->width_px);
        tsuya_finding *finding = &job->finding[(size_t)row * (size_t)job->window_columns + (size_t)column];
        *finding = (tsuya_finding){.empty = true, .none_probability = 1.0f};
        if (kept_by_mask(job->mask, x0, y0, 2 * n)) {
            copy_values(values, job->grey, x0, y0, 2 * n);
            tsuya_detector_find(detector, finding, values);
        }
    }
}

/* The windows that hold a patch along one axis: at most three. */
static int windows_around(int index[3], int start_px, int patch_px, int length_px, int count)
{
    int found = 0, first = start_px / patch_px - 1;
    for (int k = first < 0 ? 0 : first; k < count && found < 3; k++) {
        int window = window_start(k, patch_px, length_px);
        if (window > start_px) {
            break;
        }
        if (window + 2 * patch_px >= start_px + patch_px) {
            index[found++] = k;
        }
    }
    return found;
}

/* The two surest windows that hold a patch. */
static int choose_windows(const tsuya_finding *best[2], const patch_job *job, int x0, int y0)
{
    int columns[3], rows[3], n = job->grid->patch_px, count = 0;
    int across = job->finding ? windows_around(columns, x0, n, job->grey->width_px, job->window_columns) : 0;
    int down = job->finding ? windows_around(rows, y0, n, job->grey->height_px, job->window_rows) : 0;
    for (int j = 0; j < down; j++) {
        for (int i = 0; i < across; i++) {
            const tsuya_finding *f = &job->finding[(size_t)rows[j] * (size_t)job->window_columns + (size_t)columns[i]];
            int place = count < 2 ? count++ : 2;
            while (place > 0 && f->belief > best[place - 1]->belief) {
                if (place < 2) {
                    best[place] = best[place - 1];
                }
                place--;
            }
            if (place < 2) {
                best[place] = f;
            }
        }
    }
    return count;
}

static void follow_in_row(const patch_job *job, tsuya_detector *detector, float *values, int row)
{
    tsuya_patch_grid *grid = job->grid;
    int n = grid->patch_px, y0 = row * grid->step_px;
    for (int column = 0; column < grid->columns; column++) {
        int x0 = column * grid->step_px;
        const tsuya_finding *best[2];
        tsuya_patch *patch = &grid->patch[(size_t)row * (size_t)grid->columns + (size_t)column];
        patch->x_px = x0 + 0.5 * (n - 1);
        patch->y_px = y0 + 0.5 * (n - 1);
        if (kept_by_mask(job->mask, x0, y0, n) && middle_is_kept(job->mask, x0 + n / 2, y0 + n / 2)) {
            copy_values(values, job->grey, x0, y0, n);
            tsuya_detector_follow(detector, &patch->threads, best, choose_windows(best, job, x0, y0), values);
        }
    }
}

static tsuya_status run_rows(const patch_job *job, const tsuya_context *context)
{
    tsuya_failure failure = {0};
    int rows = job->following ? job->grid->rows : job->window_rows, n = job->following ? job->grid->patch_px : 2 * job->grid->patch_px, done = 0;
#pragma omp parallel num_threads(context->threads)
    {
        tsuya_detector *detector = NULL;
        float *values = tsuya_calloc((size_t)n * (size_t)n, sizeof *values);
        tsuya_status status = values ? tsuya_detector_create(&detector, n, NULL) : TSUYA_ERROR_MEMORY;
#pragma omp for schedule(dynamic, 1)
        for (int row = 0; row < rows; row++) {
            if (status == TSUYA_OK) {
                (job->following ? follow_in_row : find_in_row)(job, detector, values, row);
            }
            tsuya_status own = status == TSUYA_OK ? tsuya_check_interrupt() : status;
#pragma omp critical(tsuya_weave_rows)
            {
                if (own != TSUYA_OK) {
                    tsuya_failure_keep(&failure, (size_t)row, own);
                }
                tsuya_progress_update(context, job->following ? "threads" : "weave", ++done, rows, NULL);
            }
        }
        tsuya_detector_free(detector);
        tsuya_free(values);
    }
    return tsuya_failure_raise(&failure);
}

static tsuya_status find_windows(patch_job *job, const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    int n = job->grid->patch_px, w = job->grey->width_px, h = job->grey->height_px;
    if (2 * n > 512 || w < 2 * n || h < 2 * n) {
        return TSUYA_OK;
    }
    job->window_columns = (w - 2 * n + n - 1) / n + 1;
    job->window_rows = (h - 2 * n + n - 1) / n + 1;
    TSUYA_NEW(status, job->finding, (size_t)job->window_columns * (size_t)job->window_rows);
    TSUYA_GOTO_DONE(status, run_rows(job, context));
    TSUYA_GOTO_DONE(status, tsuya_findings_pool(job->finding, job->window_columns, job->window_rows));
done:
    return status;
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
    patch_job job = {0};
    *grid = (tsuya_patch_grid){.patch_px = options->patch_px, .step_px = options->step_px};
    TSUYA_TRY(check_options(image, mask, options));
    grid->columns = (image->width_px - options->patch_px) / options->step_px + 1;
    grid->rows = (image->height_px - options->patch_px) / options->step_px + 1;
    TSUYA_NEW(status, grid->patch, tsuya_patch_count(grid));
    TSUYA_GOTO_DONE(status, tsuya_image_grey(&grey, image, TSUYA_SAMPLE_F32));
    job = (patch_job){.grey = &grey, .mask = mask, .grid = grid};
    TSUYA_GOTO_DONE(status, find_windows(&job, context));
    job.following = true;
    TSUYA_GOTO_DONE(status, run_rows(&job, context));
    tsuya_patches_label(grid, options->weft_deg);
done:
    tsuya_free(job.finding);
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

static void write_threads(FILE *stream, const tsuya_threads *t)
{
    write_family(stream, &t->a, false);
    write_family(stream, &t->b, false);
    write_family(stream, &t->a, true);
    write_family(stream, &t->b, true);
    fprintf(stream, ",%.4f", t->confidence);
}

static void write_kind(FILE *stream, const tsuya_threads *t)
{
    fprintf(stream, ",%s,", tsuya_weave_kind_name(t->kind));
    if (t->kind == TSUYA_WEAVE_TWILL) {
        fprintf(stream, "%.2f", tsuya_deg_from_rad(t->diagonal_rad));
    }
}

/* A row a patch: its centre, and what `write` says of its threads in the columns `names`. */
static tsuya_status save_rows(const tsuya_patch_grid *grid, const char *path, const char *names, void (*write)(FILE *stream, const tsuya_threads *threads))
{
    tsuya_file_writer writer;
    TSUYA_TRY(tsuya_file_begin(&writer, path));
    fprintf(writer.stream, "x_px,y_px,%s\n", names);
    for (size_t i = 0; i < tsuya_patch_count(grid); i++) {
        fprintf(writer.stream, "%.1f,%.1f", grid->patch[i].x_px, grid->patch[i].y_px);
        write(writer.stream, &grid->patch[i].threads);
        fputc('\n', writer.stream);
    }
    return tsuya_file_commit(&writer);
}

tsuya_status tsuya_patches_save(const tsuya_patch_grid *grid, const char *path)
{
    return save_rows(grid, path, "weft_deg,warp_deg,period_weft_px,period_warp_px,confidence", write_threads);
}

tsuya_status tsuya_patches_save_kinds(const tsuya_patch_grid *grid, const char *path)
{
    return save_rows(grid, path, "kind,diagonal_deg", write_kind);
}
