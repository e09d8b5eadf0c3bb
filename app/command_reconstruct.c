/* tsuya reconstruct PHOTOS */
#include "app/command.h"
#include "app/truth.h"
#include "core/file.h"
#include "reconstruct/reconstruct.h"

#include <string.h>

enum { KEY_PHOTOS = 1, KEY_MASKS, KEY_CAMERA, KEY_POSES, KEY_HOLD_OUT, KEY_DENSE, KEY_SOURCES, KEY_TOLERANCE, KEY_TRUTH, LIST = 1024 };

typedef struct reconstruct_input {
    tsuya_reconstruct_options options;
    const char *hold_out[LIST + 1], *truth;
} reconstruct_input;

static const struct argp_option reconstruct_options[] = {
    {"photos", KEY_PHOTOS, "FOLDER", 0, "The photographs, as an option", 0},
    {"masks", KEY_MASKS, "FOLDER", 0, "NAME.png or NAME.jpg.png; white keeps, black is ignored", 0},
    {"camera", KEY_CAMERA, "CAM.cameramodel", 0, "Calibrated camera, kept as it is (default: focal length from EXIF, refined)", 0},
    {"poses", KEY_POSES, "FOLDER", 0, "COLMAP model of known poses, kept as they are, with their frame and unit", 0},
    {"hold-out", KEY_HOLD_OUT, "NAME", 0, "Place this photograph, but use it for no depth, colour or surface; repeatable", 0},
    {"dense-px", KEY_DENSE, "N", 0, "Longer side of the depth maps (default: half the photographs' above 1600 px, else full)", 0},
    {"sources", KEY_SOURCES, "N", 0, "Neighbours that a depth map is compared with (default 5)", 0},
    {"tolerance", KEY_TOLERANCE, "T", 0, "Of the mesh's decimation, in its unit (default: half the points' spacing)", 0},
    {"truth", KEY_TRUTH, "MESH.ply", 0, "Hold the surface against this one, in the same frame (known poses)", 0},
    {"output", 'o', "FOLDER", 0, "Where to write (default: the current folder)", 0},
    {0},
};

static error_t parse_reconstruct(int key, char *arg, struct argp_state *state)
{
    reconstruct_input *input = state->input;
    tsuya_reconstruct_options *o = &input->options;
    switch (key) {
    case KEY_PHOTOS:
    case ARGP_KEY_ARG:
        if (o->photos) {
            argp_error(state, "'%s': one folder of photographs only", arg);
        }
        o->photos = arg;
        return 0;
    case KEY_MASKS: o->masks = arg; return 0;
    case KEY_CAMERA: o->camera_model = arg; return 0;
    case KEY_POSES: o->poses = arg; return 0;
    case KEY_HOLD_OUT: tsuya_argument_append(state, input->hold_out, LIST, arg); return 0;
    case KEY_DENSE: o->dense_long_side_px = tsuya_argument_int(state, "--dense-px", arg, 64, 65535); return 0;
    case KEY_SOURCES: o->source_views = tsuya_argument_int(state, "--sources", arg, 1, 12); return 0;
    case KEY_TOLERANCE: o->tolerance = tsuya_argument_number(state, "--tolerance", arg, 1e-12, 1e12); return 0;
    case KEY_TRUTH: input->truth = arg; return 0;
    case 'o': o->output = arg; return 0;
    case ARGP_KEY_END:
        if (!o->photos) {
            argp_error(state, "PHOTOS is missing");
        }
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const tsuya_syntax reconstruct_syntax = {
    .arguments = "PHOTOS",
    .example = "tsuya reconstruct demo/photos --masks demo/masks -o out/shape",
    .doc = "Finds the cameras (COLMAP), a depth map for every photograph, and the surface: cloud.ply, mesh.ply, reconstruct.json, and "
           "COLMAP's folders. A later run in the same folder goes on where it was.",
    .options = reconstruct_options,
    .parse = parse_reconstruct,
};

static tsuya_status reconstruct(tsuya_json *figures, reconstruct_input *input, const tsuya_context *context)
{
    tsuya_reconstruct_info info = {0};
    tsuya_lock lock;
    TSUYA_TRY(tsuya_folder_make(input->options.output));
    TSUYA_TRY(tsuya_lock_take(&lock, input->options.output));
    tsuya_status status = tsuya_reconstruct(&info, &input->options, context);
    if (status == TSUYA_OK) {
        tsuya_reconstruct_info_to_json(figures, &info);
        if (input->truth) {
            status = tsuya_truth_compare_surface(figures, input->options.output, input->truth, info.gsd, context);
        }
        tsuya_reconstruct_info_free(&info);
    }
    tsuya_lock_release(&lock);
    return status;
}

int tsuya_command_reconstruct(int argc, char **argv)
{
    tsuya_common common;
    reconstruct_input input = {.options = tsuya_reconstruct_options_default()};
    input.options.output = ".";
    tsuya_command_parse(&reconstruct_syntax, &common, &input, argc, argv);
    tsuya_context context = tsuya_command_context(&common);
    input.options.hold_out = input.hold_out;
    while (input.hold_out[input.options.hold_out_count]) {
        input.options.hold_out_count++;
    }
    tsuya_json *figures = tsuya_json_create_object();
    tsuya_status status = figures ? reconstruct(figures, &input, &context) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        status = tsuya_command_figures(&common, figures);
    }
    tsuya_json_free(figures);
    return status == TSUYA_OK ? TSUYA_EXIT_OK : tsuya_command_failed(status);
}
