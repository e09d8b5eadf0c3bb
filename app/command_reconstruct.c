/* tsuya reconstruct PHOTOS */
#include "app/calib_scale.h"
#include "app/command.h"
#include "app/truth.h"
#include "core/file.h"
#include "reconstruct/reconstruct.h"

#include <string.h>

enum { KEY_PHOTOS = 1, KEY_MASKS, KEY_CAMERA, KEY_POSES, KEY_HOLD_OUT, KEY_DENSE, KEY_SOURCES, KEY_TOLERANCE, KEY_TRUTH, KEY_SCALE, KEY_DISTANCE, LIST = 1024 };

typedef struct reconstruct_input {
    tsuya_reconstruct_options options;
    const char *hold_out[LIST + 1], *distance[LIST + 1], *truth, *board;
} reconstruct_input;

static const struct argp_option reconstruct_options[] = {
    {"photos", KEY_PHOTOS, "FOLDER", 0, "The photographs, as an option", 0},
    {"masks", KEY_MASKS, "FOLDER", 0, "NAME.png or NAME.jpg.png; white keeps, black is ignored", 0},
    {"camera", KEY_CAMERA, "CAM.cameramodel", 0, "Calibrated camera, kept as it is (default: focal length from EXIF, refined)", 0},
    {"poses", KEY_POSES, "FOLDER", 0, "Known poses, kept as they are, with their frame and unit: a COLMAP model, or a .cameramodel for each photograph or each camera of a rig", 0},
    {"scale", KEY_SCALE, "BOARD.yaml", 0, "Tags that stand in the photographs: metres, and the frame of the first plate", 0},
    {"distance", KEY_DISTANCE, "TEXT", 0, "A length for the scale, \"METRES; PHOTO X,Y X,Y; PHOTO X,Y X,Y\": both ends' pixels in two photographs or more; repeatable", 0},
    {"hold-out", KEY_HOLD_OUT, "NAME", 0, "Place this photograph, but use it for no depth, colour or surface; repeatable", 0},
    {"dense-px", KEY_DENSE, "N", 0, "Longer side of the depth maps (default: half the photographs' above 1600 px, else full)", 0},
    {"sources", KEY_SOURCES, "N", 0, "Neighbours that a depth map is compared with (default 5)", 0},
    {"tolerance", KEY_TOLERANCE, "T", 0, "Error wanted of the surface, as 0.5mm, or a number in the reconstruction's unit: chooses size and neighbours of the depth maps and the mesh", 0},
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
    case KEY_TOLERANCE:
        if (!tsuya_parse_length(&o->tolerance, &o->tolerance_in_metres, arg)) {
            argp_error(state, "--tolerance: '%s' is not a length such as 0.5mm, 0.05cm, 0.0005m, or a number above 0", arg);
        }
        return 0;
    case KEY_TRUTH: input->truth = arg; return 0;
    case KEY_SCALE: input->board = arg; return 0;
    case KEY_DISTANCE: tsuya_argument_append(state, input->distance, LIST, arg); return 0;
    case 'o': o->output = arg; return 0;
    case ARGP_KEY_END:
        if (!o->photos) {
            argp_error(state, "PHOTOS is missing");
        } else if (input->board && input->distance[0]) {
            argp_error(state, "either --scale or --distance");
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

static tsuya_status find_scale(tsuya_calib_scale *scale, const reconstruct_input *input, const tsuya_context *context)
{
    tsuya_photo_set photos;
    tsuya_yaml_list list[LIST], distances = {list, 0};
    tsuya_arena *arena;
    TSUYA_TRY(tsuya_photo_set_load(&photos, input->options.photos, NULL));
    tsuya_status status = tsuya_arena_create(&arena, 1 << 14);
    if (status == TSUYA_OK) {
        for (; status == TSUYA_OK && input->distance[distances.count]; distances.count++) {
            status = tsuya_calib_scale_split(&list[distances.count], input->distance[distances.count], arena);
        }
        if (status == TSUYA_OK) {
            status = input->board ? tsuya_calib_scale_from_board(scale, input->board, &photos, context)
                                  : tsuya_calib_scale_from_distances(scale, &distances, "--distance", &photos);
        }
        tsuya_arena_free(arena);
    }
    tsuya_photo_set_free(&photos);
    return status;
}

static tsuya_status reconstruct(tsuya_json *figures, reconstruct_input *input, const tsuya_context *context)
{
    tsuya_reconstruct_info info = {0};
    tsuya_lock lock;
    tsuya_calib_scale scale = {0};
    tsuya_status status = TSUYA_OK;
    TSUYA_TRY(tsuya_folder_make(input->options.output));
    TSUYA_TRY(tsuya_lock_take(&lock, input->options.output));
    if (input->board || input->distance[0]) {
        status = find_scale(&scale, input, context);
        input->options.scale = &scale.input;
    }
    if (status == TSUYA_OK) {
        status = tsuya_reconstruct(&info, &input->options, context);
    }
    tsuya_calib_scale_free(&scale);
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
