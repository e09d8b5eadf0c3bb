/* tsuya capture simulate SCENE.yaml */
#include "app/command.h"
#include "capture/simulate.h"
#include "core/file.h"

typedef struct simulate_input { const char *scene, *output; } simulate_input;

static const struct argp_option options[] = {{"output", 'o', "DIR", 0, "Job folder, new or of an earlier simulation (default: the scene's name)", 0}, {0}};

static error_t parse(int key, char *arg, struct argp_state *state)
{
    simulate_input *input = state->input;
    switch (key) {
    case 'o': input->output = arg; return 0;
    case ARGP_KEY_ARG:
        if (input->scene) {
            argp_error(state, "'%s': one scene only", arg);
        }
        input->scene = arg;
        return 0;
    case ARGP_KEY_NO_ARGS: argp_error(state, "a SCENE.yaml is missing"); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const tsuya_syntax syntax = {
    .arguments = "SCENE.yaml",
    .example = "tsuya capture simulate docs/examples/scene.yaml -o simulated",
    .doc = "Drapes a cloth, photographs it and a board in a virtual studio, and leaves a job folder with JOB.yaml and the truth beside it.\v"
           "The scene's seed decides every random choice. Keys of a scene: docs/capture.md.",
    .options = options,
    .parse = parse,
};

static void fill(tsuya_json *figures, const tsuya_simulate_info *info, double seconds)
{
    tsuya_json_set_number(figures, "photos", info->photos);
    tsuya_json_set_number(figures, "board_photos", info->board_photos);
    tsuya_json_set_number(figures, "swatch_photos", info->swatch_photos);
    tsuya_json_set_number(figures, "vertices", (double)info->vertices);
    tsuya_json_set_number(figures, "drape_steps", info->drape_steps);
    tsuya_json_set_bool(figures, "at_rest", info->at_rest);
    tsuya_json *stages = tsuya_json_set_object(figures, "stages");
    tsuya_json_set_number(stages, "drape", info->drape_s);
    tsuya_json_set_number(stages, "photographs", info->photos_s);
    tsuya_json_set_number(stages, "board", info->board_s);
    tsuya_json_set_number(stages, "swatch", info->swatch_s);
    tsuya_json_set_number(figures, "seconds", seconds);
    tsuya_json_set_number(figures, "peak_mb", tsuya_peak_memory_mb());
}

int tsuya_command_capture_simulate(int argc, char **argv)
{
    tsuya_common common;
    simulate_input input = {0};
    tsuya_command_parse(&syntax, &common, &input, argc, argv);
    tsuya_context context = tsuya_command_context(&common);
    tsuya_simulate_scene scene = {0};
    tsuya_simulate_info info;
    double start_s = tsuya_clock_s();
    tsuya_json *figures = tsuya_json_create_object();
    tsuya_status status = figures ? tsuya_simulate_scene_load(&scene, input.scene) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        status = tsuya_simulate(&info, &scene, input.output ? input.output : scene.name, &context);
        tsuya_simulate_scene_free(&scene);
    }
    if (status == TSUYA_OK) {
        fill(figures, &info, tsuya_clock_s() - start_s);
        status = tsuya_command_figures(&common, figures);
    }
    tsuya_json_free(figures);
    return status == TSUYA_OK ? TSUYA_EXIT_OK : tsuya_command_failed(status);
}
