/* tsuya calib light */
#include "app/calib_light.h"
#include "app/command.h"

#include <string.h>

enum { KEY_BOARD = 1, KEY_CAMERA, KEY_COLOR, KEY_LINEAR, KEY_REFLECTANCE, KEY_BALL, KEY_LAMPS, KEY_WHITE };

typedef struct light_input {
    tsuya_calib_light_input light;
    const char *photo[TSUYA_CALIB_MOST_PHOTOS + 1], *ball[TSUYA_LAMP_BALLS + 1], *output;
} light_input;

static const struct argp_option options[] = {
    {"board", KEY_BOARD, "BOARD.yaml", 0, "The plate with tags; of several plates the first is the world and lies still", 0},
    {"camera", KEY_CAMERA, "CAM.cameramodel", 0, "The camera, as tsuya calib camera wrote it", 0},
    {"color", KEY_COLOR, "COLOR.json", 0, "Vignetting and colour, as tsuya calib color wrote them (default: a vignetting is estimated beside the lamp)", 0},
    {"linear", KEY_LINEAR, NULL, 0, "Integer files hold linear light (default: sRGB, but camera raw, whose light is linear as it is)", 0},
    {"reflectance", KEY_REFLECTANCE, "R", 0, "Of the plate's white (default 0.85)", 0},
    {"ball", KEY_BALL, "TEXT", 0, "A mirror ball that lies on the first plate instead: \"X,Y,DIAMETER\" in its millimetres, or \"X,Y,DIAMETER; PHOTO PHOTO\" "
                                  "where only these show it there; repeatable", 0},
    {"lamps", KEY_LAMPS, "N", 0, "With --ball: so many lamps shine at once (1 to 4), each a highlight in every ball (default 1)", 0},
    {"white", KEY_WHITE, NULL, 0, "With --ball: the tags' white is the light meter beside the balls, and one lamp is estimated from both", 0},
    {"output", 'o', "PATH", 0, "Folder, or FILE.json (default: light.json); the picture of the residuals goes beside it", 0},
    {0},
};

static void check(struct argp_state *state, light_input *input)
{
    tsuya_calib_light_input *l = &input->light;
    if (!l->board) {
        argp_error(state, "--board is missing");
    } else if (!l->camera) {
        argp_error(state, "--camera is missing");
    } else if (!l->photo_count) {
        argp_error(state, "PHOTOS is missing: a folder, or files; or several folders, each lit by one lamp");
    }
    while (l->balls < TSUYA_LAMP_BALLS && input->ball[l->balls]) {
        l->balls++;
    }
    if (l->lamps > 1 && (l->white || !l->balls)) {
        argp_error(state, "--lamps belongs to --ball alone: white cannot tell lamps apart that shine at once");
    }
    if (l->white && !l->balls) {
        argp_error(state, "--white belongs to --ball: without balls the tags' white is the light meter as it is");
    }
}

static error_t parse(int key, char *arg, struct argp_state *state)
{
    light_input *input = state->input;
    tsuya_calib_light_input *l = &input->light;
    switch (key) {
    case KEY_BOARD: l->board = arg; return 0;
    case KEY_CAMERA: l->camera = arg; return 0;
    case KEY_COLOR: l->color = arg; return 0;
    case KEY_LINEAR: l->linear = true; return 0;
    case KEY_REFLECTANCE: l->reflectance = tsuya_argument_number(state, "--reflectance", arg, 0.01, 1.0); return 0;
    case KEY_BALL: tsuya_argument_append(state, input->ball, TSUYA_LAMP_BALLS, arg); return 0;
    case KEY_LAMPS: l->lamps = tsuya_argument_int(state, "--lamps", arg, 1, TSUYA_LAMPS_MOST); return 0;
    case KEY_WHITE: l->white = true; return 0;
    case 'o': input->output = arg; return 0;
    case ARGP_KEY_ARG:
        if (l->photo_count == TSUYA_CALIB_MOST_PHOTOS) {
            argp_error(state, "more than %d photographs", TSUYA_CALIB_MOST_PHOTOS);
        }
        for (size_t n = strlen(arg); n > 1 && arg[n - 1] == '/'; n--) { /* a folder's name is its lamp's */
            arg[n - 1] = '\0';
        }
        input->photo[l->photo_count++] = arg;
        return 0;
    case ARGP_KEY_END: check(state, input); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const tsuya_syntax syntax = {
    .arguments = "PHOTOS...",
    .example = "tsuya calib light --board plate.yaml --camera calib/camera.cameramodel plate-photos/ -o light.json",
    .doc = "Position, direction and falloff of a lamp, for tsuya render, from photographs of a matte plate with tags that is tilted about, or of mirror balls on "
           "one. With one plate the camera stands still, and the world is where the plate lay in the first photograph; with several the first is the world. "
           "Several folders: each holds what one lamp lit alone, and is named after it.",
    .options = options,
    .parse = parse,
};

int tsuya_command_calib_light(int argc, char **argv)
{
    static light_input input;
    tsuya_common common;
    input = (light_input){.light = {.reflectance = tsuya_lamp_options_default().reflectance, .lamps = 1}};
    tsuya_command_parse(&syntax, &common, &input, argc, argv);
    tsuya_context context = tsuya_command_context(&common);
    char *folder = NULL, *file = NULL;
    tsuya_json *figures = tsuya_json_create_object();
    tsuya_status status = figures ? tsuya_command_output(&folder, &file, input.output, ".json", "light.json") : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        input.light.photos = input.photo;
        input.light.ball = input.ball;
        input.light.file = file;
        status = tsuya_calib_light(figures, &input.light, &context);
    }
    if (status == TSUYA_OK) {
        status = tsuya_command_figures(&common, figures);
    }
    tsuya_free(folder);
    tsuya_free(file);
    tsuya_json_free(figures);
    return status == TSUYA_OK ? TSUYA_EXIT_OK : tsuya_command_failed(status);
}
