#include "app/calib_run.h"

#include "app/calib_drift.h"
#include "calib/mrcal_inputs.h"
#include "core/file.h"
#include "core/photo.h"

#include <stdlib.h>
#include <string.h>

typedef struct run {
    const tsuya_calib_input *input;
    const tsuya_context *context;
    tsuya_board board;
    tsuya_corner_set corners;
    tsuya_detect_info detected;
    tsuya_calibration calibration;
    tsuya_photo_set photos;  /* of a folder */
    const char **path;       /* of the photographs */
    int path_count;
    int width_px, height_px;
    double focal_px;         /* EXIF, 0 where absent */
    double seconds_tags;
} run;

static tsuya_status take_folder(run *r, const char *folder)
{
    TSUYA_TRY(tsuya_photo_set_load(&r->photos, folder, NULL));
    r->path_count = r->photos.count;
    r->path = tsuya_calloc((size_t)r->path_count, sizeof *r->path);
    if (!r->path) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int i = 0; i < r->path_count; i++) {
        r->path[i] = r->photos.photo[i].path;
    }
    r->focal_px = tsuya_photo_focal_px(&r->photos.photo[0]);
    return TSUYA_OK;
}

static int compare_names(const void *a, const void *b)
{
    return strcmp(tsuya_path_name(*(const char *const *)a), tsuya_path_name(*(const char *const *)b));
}

static tsuya_status take_files(run *r)
{
    tsuya_photo photo;
    r->path_count = r->input->photo_count;
    r->path = tsuya_calloc((size_t)r->path_count, sizeof *r->path);
    if (!r->path) {
        return TSUYA_ERROR_MEMORY;
    }
    memcpy(r->path, r->input->photos, (size_t)r->path_count * sizeof *r->path);
    qsort(r->path, (size_t)r->path_count, sizeof *r->path, compare_names);
    TSUYA_TRY(tsuya_photo_load(&photo, r->path[0]));
    r->focal_px = tsuya_photo_focal_px(&photo);
    tsuya_photo_free(&photo);
    return TSUYA_OK;
}

static tsuya_status find_corners(run *r)
{
    const tsuya_calib_input *in = r->input;
    if (in->corners) {
        r->width_px = in->width_px;
        r->height_px = in->height_px;
        return tsuya_corner_set_load(&r->corners, in->corners, in->width_px, in->height_px);
    }
    bool folder = in->photo_count == 1 && tsuya_path_is_folder(in->photos[0]);
    TSUYA_TRY(folder ? take_folder(r, in->photos[0]) : take_files(r));
    double start_s = tsuya_clock_s();
    TSUYA_TRY(tsuya_detect_photos(&r->corners, &r->detected, &r->board, r->path, r->path_count, r->context));
    r->seconds_tags = tsuya_clock_s() - start_s;
    r->width_px = r->detected.width_px;
    r->height_px = r->detected.height_px;
    if (r->corners.count == 0) {
        int foreign = 0;
        for (int i = 0; i < r->path_count; i++) {
            foreign += r->detected.report[i].rejected.foreign;
        }
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: none of its tags (%s, border of %d) is seen in %d photographs%s", in->board, r->board.family,
                          r->board.border_bits, r->path_count,
                          foreign ? "; tags with other ids are: is this the right board file?" : "; Kalibr's grids have border_bits: 2");
    }
    return TSUYA_OK;
}

/* The same camera in others' words: COLMAP's line (pixel centres at ½) and OpenCV's matrix. */
static void set_exports(tsuya_json *figures, const tsuya_camera *k)
{
    char line[512];
    if (k->lens == TSUYA_LENS_SPLINED_STEREOGRAPHIC) { /* neither has it */
        tsuya_json_set_text(figures, "opencv", NULL);
        tsuya_json_set_text(figures, "colmap", NULL);
        return;
    }
    tsuya_json *opencv = tsuya_json_set_object(figures, "opencv");
    double matrix[9] = {k->fx_px, 0, k->cx_px, 0, k->fy_px, k->cy_px, 0, 0, 1};
    int n = tsuya_lens_parameters(k) - 4;
    tsuya_json_set_numbers(opencv, "camera_matrix", matrix, 9);
    tsuya_json_set_numbers(opencv, "dist_coeffs", k->distortion, n);
    const double *d = k->distortion;
    int used = snprintf(line, sizeof line, "%s %d %d %.10g %.10g %.10g %.10g", k->lens == TSUYA_LENS_PINHOLE ? "PINHOLE" : n == 4 ? "OPENCV" : "FULL_OPENCV",
                        k->width_px, k->height_px, k->fx_px, k->fy_px, k->cx_px + 0.5, k->cy_px + 0.5);
    if (n == 4) {
        snprintf(line + used, sizeof line - (size_t)used, " %.10g %.10g %.10g %.10g", d[0], d[1], d[2], d[3]);
    } else if (n == 5 || n == 8) {
        snprintf(line + used, sizeof line - (size_t)used, " %.10g %.10g %.10g %.10g %.10g %.10g %.10g %.10g", d[0], d[1], d[2], d[3], d[4], d[5], d[6], d[7]);
    }
    tsuya_json_set_text(figures, "colmap", n <= 8 ? line : NULL);
}

/* What the detection saw, beside what the solve made of it; photographs that are blurred are named. */
static void set_detection(tsuya_json *figures, const run *r)
{
    if (!r->detected.report) {
        return;
    }
    double typical = INFINITY;
    for (int i = 0; i < r->corners.photo_count; i++) {
        double b = r->detected.report[i].blur_px;
        typical = isfinite(b) ? fmin(typical, b) : typical;
    }
    tsuya_json *list = tsuya_json_set_array(figures, "tags"), *blurred = tsuya_json_set_array(figures, "blurred");
    for (int i = 0; i < r->corners.photo_count; i++) {
        const tsuya_detect_report *d = &r->detected.report[i];
        tsuya_json *o = tsuya_json_add_object(list);
        tsuya_json_set_text(o, "name", r->corners.photo[i]);
        tsuya_json_set_number(o, "tags", d->tags);
        tsuya_json_set_number(o, "blur_px", d->blur_px);
        tsuya_json_set_number(o, "blur_p90_px", d->blur_high_px);
        tsuya_json_set_number(o, "foreign_ids", d->rejected.foreign);
        tsuya_json_set_number(o, "seen_twice", d->rejected.twice);
        tsuya_json_set_number(o, "misplaced", d->rejected.misplaced);
        tsuya_json_set_number(o, "edges_failed", d->rejected.edges);
        if (d->blur_high_px > fmax(1.9 * typical, 1.0)) {
            tsuya_json_add_text(blurred, r->corners.photo[i]);
        }
    }
    tsuya_json_set_number(figures, "tone_gamma", r->detected.look.gamma);
    tsuya_json_set_number(figures, "tone_sharpening", r->detected.look.sharpening);
}

/* Corners as the solve used them: without the edges' bias. */
static void correct_corners(run *r)
{
    for (int i = 0; i < r->corners.count; i++) {
        tsuya_corner *c = &r->corners.corner[i];
        c->x_px -= r->calibration.solve.edge_bias * c->spread_x_px;
        c->y_px -= r->calibration.solve.edge_bias * c->spread_y_px;
    }
}

static tsuya_status write_file(run *r, const char *name, tsuya_status (*write)(run *r, const char *path))
{
    char *path = tsuya_path_join(r->input->folder, name);
    tsuya_status status = path ? write(r, path) : TSUYA_ERROR_MEMORY;
    tsuya_free(path);
    return status;
}

static tsuya_status write_corners(run *r, const char *path) { return tsuya_corner_set_save(&r->corners, path); }

static tsuya_status write_uncertainty(run *r, const char *path) { return tsuya_calib_uncertainty_save(&r->calibration, path); }

static tsuya_status write_grid(run *r, const char *path) { return tsuya_corner_set_save_grid(&r->corners, &r->board, path); }

static tsuya_status write_page(run *r, const char *path)
{
    return tsuya_calib_page(path, r->input->folder, &r->calibration, &r->corners, r->path, r->detected.report ? &r->detected : NULL);
}

/* An even grid is mrcal's own kind of board: its warp, and what its tools need to compute uncertainty. */
static tsuya_status write_inputs(run *r, tsuya_json *figures)
{
    tsuya_mrcal_board board;
    TSUYA_TRY(tsuya_mrcal_board_solve(&board, &r->calibration.solve));
    tsuya_json *o = tsuya_json_set_object(figures, "board_warp");
    tsuya_json_set_numbers(o, "middle_m", board.warp_m, 2);
    tsuya_json_set_number(o, "rms_px", board.rms_px);
    tsuya_json_set_number(o, "rms_flat_px", board.rms_flat_px);
    tsuya_status status = tsuya_mrcal_inputs_add(r->input->model, &board);
    tsuya_mrcal_board_free(&board);
    return status;
}

static tsuya_status write_all(run *r, tsuya_json *figures, double start_s)
{
    TSUYA_TRY(tsuya_cameramodel_save(&r->calibration.solve.camera, tsuya_pose_identity(), r->input->model));
    correct_corners(r);
    TSUYA_TRY(write_file(r, "corners.vnl", write_corners));
    TSUYA_TRY(write_file(r, "uncertainty.vnl", write_uncertainty));
    if (tsuya_board_even_grid(&r->board)) {
        TSUYA_TRY(write_file(r, "corners_mrcal.vnl", write_grid));
    }
    TSUYA_TRY(write_file(r, "calib.html", write_page));
    tsuya_calibration_to_json(figures, &r->calibration, &r->corners);
    set_exports(figures, &r->calibration.solve.camera);
    set_detection(figures, r);
    if (tsuya_board_even_grid(&r->board)) {
        TSUYA_TRY(write_inputs(r, figures));
    }
    tsuya_json *stages = tsuya_json_set_object(figures, "stages");
    tsuya_json_set_number(stages, "tags", r->seconds_tags);
    tsuya_json_set_number(stages, "solve", r->calibration.seconds);
    tsuya_json_set_number(figures, "seconds", tsuya_clock_s() - start_s);
    tsuya_json_set_number(figures, "peak_mb", tsuya_peak_memory_mb());
    char *path = tsuya_path_join(r->input->folder, "calib.json");
    tsuya_status status = path ? tsuya_json_save(figures, path) : TSUYA_ERROR_MEMORY;
    tsuya_free(path);
    return status;
}

static void warn(const tsuya_calibration *c)
{
    for (int i = 0; i < c->advice_count; i++) {
        tsuya_warn("%s", c->advice[i]);
    }
}

tsuya_status tsuya_calib_run(tsuya_json *figures, const tsuya_calib_input *input, const tsuya_context *context)
{
    run r = {.input = input, .context = context};
    double start_s = tsuya_clock_s();
    tsuya_calibrate_options options = input->options;
    tsuya_status status = tsuya_board_load(&r.board, input->board);
    if (status == TSUYA_OK) {
        status = find_corners(&r);
    }
    if (status == TSUYA_OK) {
        options.focal_px = options.focal_px > 0.0 ? options.focal_px : r.focal_px;
        status = tsuya_calibrate(&r.calibration, &r.board, &r.corners, r.width_px, r.height_px, &options, context);
    }
    if (status == TSUYA_OK) {
        warn(&r.calibration);
        status = write_all(&r, figures, start_s);
    }
    tsuya_calibration_free(&r.calibration);
    tsuya_detect_info_free(&r.detected);
    tsuya_corner_set_free(&r.corners);
    tsuya_photo_set_free(&r.photos);
    tsuya_free(r.path);
    tsuya_board_free(&r.board);
    return status;
}
