/* tsuya demo [DIR] */
#include "app/command.h"
#include "app/runner.h"
#include "app/terminal.h"
#include "app/truth.h"
#include "capture/simulate.h"
#include "core/file.h"

#include <stdio.h>
#include <string.h>

/* What is made: docs/capture.md explains the keys.  Another text makes an earlier demo's photographs anew. */
static const char QUICK[] =
    "# The scene of `tsuya demo`, 6: `tsuya capture simulate scene.yaml -o DIR` makes the same photographs.\n"
    "camera: {size: [800, 600], focal_px: 1006, distortion: [-0.04, 0.01, 0, 0], f_number: 22, bayer: true, blur_px: 0.6, spp: 4, full_well_e: 500000, "
    "jpeg_quality: 97}\n"
    "views:\n"
    "  - {count: 6, elevation_deg: 8, azimuth_deg: 90, sweep_deg: 130, distance_m: 0.95}\n"
    "  - {count: 4, elevation_deg: 35, azimuth_deg: 90, sweep_deg: 110, distance_m: 0.95}\n"
    "  - {count: 6, elevation_deg: 8, azimuth_deg: 270, sweep_deg: 130, distance_m: 0.95}\n"
    "  - {count: 4, elevation_deg: 35, azimuth_deg: 270, sweep_deg: 110, distance_m: 0.95}\n"
    "  - {count: 8, px_per_thread: 1.5}\n"
    "  - {count: 18, px_per_thread: 4.3}\n"
    "cloth: {kind: karaori, fabric: karaori, reflectance: satin, side_m: 0.5, spacing_m: 0.011, weft_mm: 0.5, warp_mm: 0.47}\n";
/* The same camera read out five times as finely, and a sheet that is draped in finer cells. */
static const char FULL[] =
    "# The scene of `tsuya demo --quality full`, 6: `tsuya capture simulate scene.yaml -o DIR` makes the same photographs.\n"
    "camera: {size: [4000, 3000], focal_px: 5030, distortion: [-0.04, 0.01, 0, 0], f_number: 22, bayer: true, blur_px: 0.6, spp: 4, full_well_e: 50000, "
    "jpeg_quality: 97}\n"
    "views:\n"
    "  - {count: 15, elevation_deg: 8, azimuth_deg: 90, sweep_deg: 130, distance_m: 0.95}\n"
    "  - {count: 11, elevation_deg: 35, azimuth_deg: 90, sweep_deg: 110, distance_m: 0.95}\n"
    "  - {count: 15, elevation_deg: 8, azimuth_deg: 270, sweep_deg: 130, distance_m: 0.95}\n"
    "  - {count: 11, elevation_deg: 35, azimuth_deg: 270, sweep_deg: 110, distance_m: 0.95}\n"
    "  - {count: 8, px_per_thread: 8}\n"
    "cloth: {kind: karaori, fabric: karaori, reflectance: satin, side_m: 0.5, spacing_m: 0.008, weft_mm: 0.6, warp_mm: 0.55}\n";
static const char BOTH[] =
    "name: demo\n"
    "seed: 1\n"
    "stand: {kind: bar, radius_m: 0.015, height_m: 0.6, length_m: 0.6}\n"
    "mat: {cols: 9, rows: 9, tag_mm: 60, gap_mm: 15, first_id: 100}\n"
    "board: {cols: 8, rows: 5, tag_mm: 30, gap_mm: 9, photos: 20}\n"
    "goniometer: {azimuth_step_deg: 45, tilt_step_deg: 3, dye: [0.02, 0.02, 0.02], photos: true, photo_step_deg: 9, photo_scale: 0.2}\n"
    "lamps_measured: true\n";

typedef struct demo_input {
    const char *folder;
    bool full;
} demo_input;

enum { KEY_QUALITY = 500, SCENE_MOST = 4096 };
static const struct argp_option demo_options[] = {
    {"quality", KEY_QUALITY, "quick|full", 0, "quick (default): 46 photographs of half a megapixel; full: 60 of 12, which takes hours", 0},
    {0},
};

static error_t parse_demo(int key, char *arg, struct argp_state *state)
{
    demo_input *input = state->input;
    if (key == KEY_QUALITY) {
        input->full = strcmp(arg, "full") == 0;
        if (!input->full && strcmp(arg, "quick") != 0) {
            argp_error(state, "--quality: '%s'; quick or full is accepted", arg);
        }
        return 0;
    }
    if (key != ARGP_KEY_ARG) {
        return ARGP_ERR_UNKNOWN;
    }
    if (input->folder) {
        argp_error(state, "'%s': one folder only", arg);
    }
    input->folder = arg;
    return 0;
}

static const tsuya_syntax demo_syntax = {
    .options = demo_options,
    .arguments = "[DIR]",
    .example = "tsuya demo demo",
    .doc = "Drapes, photographs and measures a cloth by computation, runs the whole job on those files alone, and holds the result "
           "against the truth.\vDIR (default: demo) is new or of an earlier demo. Results: DIR/report/index.html, DIR/demo.json; the "
           "photographs in DIR/photos, the truth in DIR/truth.",
    .parse = parse_demo,
};

/* Times beside errors: seconds by stage, and the highest memory. */
static void add_costs(tsuya_json *figures, const tsuya_json *result, double photographs_s, double seconds)
{
    double peak_mb = tsuya_peak_memory_mb();
    tsuya_json *stages = tsuya_json_set_object(figures, "stages");
    tsuya_json_set_number(stages, "photographs", photographs_s);
    const tsuya_json *list = tsuya_json_member(result, "stages");
    for (const tsuya_json *s = tsuya_json_first(list); s; s = tsuya_json_next(s)) {
        double stage_mb = tsuya_json_number_or(tsuya_json_member(s, "peak_mb"), 0.0);
        tsuya_json_set_number(stages, tsuya_json_key(s), tsuya_json_number_or(tsuya_json_member(s, "seconds"), 0.0));
        peak_mb = stage_mb > peak_mb ? stage_mb : peak_mb;
    }
    tsuya_json_set_number(figures, "seconds", seconds);
    tsuya_json_set_number(figures, "peak_mb", peak_mb);
}

static tsuya_status compare(tsuya_json *figures, const tsuya_job *job, const char *folder, const tsuya_context *context)
{
    tsuya_state state;
    char *truth = tsuya_path_join(folder, "truth");
    if (!truth) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_status status = tsuya_state_load(&state, job->folder, job->name);
    if (status == TSUYA_OK) {
        status = tsuya_truth_compare(figures, job, &state, truth, context);
        tsuya_state_free(&state);
    }
    tsuya_free(truth);
    return status;
}

/* The job, the comparison, and the report once more so that it holds the comparison. */
static tsuya_status run_job(tsuya_json *figures, const char *folder, double photographs_s, double start_s, const tsuya_context *context)
{
    tsuya_job job = {0};
    tsuya_json *result = tsuya_json_create_object(), *again = tsuya_json_create_object();
    tsuya_runner_options options = tsuya_runner_options_default();
    char *path = tsuya_path_join(folder, "JOB.yaml"), *demo = tsuya_path_join(folder, "demo.json");
    tsuya_status status = result && again && path && demo ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    TSUYA_GOTO_DONE(status, status);
    TSUYA_GOTO_DONE(status, tsuya_job_load(&job, path, NULL));
    TSUYA_GOTO_DONE(status, tsuya_runner_run(result, &job, &options, context));
    TSUYA_GOTO_DONE(status, compare(figures, &job, folder, context));
    add_costs(figures, result, photographs_s, tsuya_clock_s() - start_s);
    TSUYA_GOTO_DONE(status, tsuya_json_save(figures, demo));
    TSUYA_GOTO_DONE(status, tsuya_runner_run(again, &job, &options, context));
    tsuya_terminal_log("report: %s/report/index.html", job.folder);
done:
    tsuya_job_free(&job);
    tsuya_json_free(result);
    tsuya_json_free(again);
    tsuya_free(path);
    tsuya_free(demo);
    return status;
}

/* Made and whole: the last file that is written holds the same scene. */
static bool is_made(const char *path, const char *scene)
{
    char *text;
    size_t size;
    if (!tsuya_path_exists(path) || tsuya_file_load(&text, &size, path, SCENE_MOST) != TSUYA_OK) {
        return false;
    }
    bool same = size == strlen(scene) && memcmp(text, scene, size) == 0;
    tsuya_free(text);
    return same;
}

static tsuya_status photograph(const char *folder, bool full, const tsuya_context *context)
{
    tsuya_simulate_scene scene = {0};
    tsuya_simulate_info info;
    char text[SCENE_MOST];
    snprintf(text, sizeof text, "%s%s", full ? FULL : QUICK, BOTH);
    char *path = tsuya_path_join(folder, "scene.yaml"), *whole = tsuya_path_join(folder, "truth/scene.yaml");
    tsuya_status status = path && whole ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK && !is_made(whole, text)) {
        TSUYA_GOTO_DONE(status, tsuya_file_write(path, text, strlen(text)));
        TSUYA_GOTO_DONE(status, tsuya_simulate_scene_load(&scene, path));
        TSUYA_GOTO_DONE(status, tsuya_simulate(&info, &scene, folder, context));
        status = tsuya_file_write(whole, text, strlen(text));
    }
done:
    tsuya_simulate_scene_free(&scene);
    tsuya_free(path);
    tsuya_free(whole);
    return status;
}

static tsuya_status demo(tsuya_json *figures, const char *folder, bool full, const tsuya_context *context)
{
    tsuya_lock lock;
    double start_s = tsuya_clock_s();
    TSUYA_TRY(tsuya_folder_make(folder));
    TSUYA_TRY(tsuya_lock_take(&lock, folder));
    tsuya_status status = photograph(folder, full, context);
    tsuya_lock_release(&lock); /* the job takes it for itself */
    if (status == TSUYA_OK) {
        status = run_job(figures, folder, tsuya_clock_s() - start_s, start_s, context);
    }
    return status;
}

int tsuya_command_demo(int argc, char **argv)
{
    tsuya_common common;
    demo_input input = {.folder = NULL};
    tsuya_command_parse(&demo_syntax, &common, &input, argc, argv);
    tsuya_context context = tsuya_command_context(&common);
    tsuya_json *figures = tsuya_json_create_object();
    tsuya_status status = figures ? demo(figures, input.folder ? input.folder : "demo", input.full, &context) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        status = tsuya_command_figures(&common, figures);
    }
    tsuya_json_free(figures);
    return status == TSUYA_OK ? TSUYA_EXIT_OK : tsuya_command_failed(status);
}
