/* tsuya calib camera, tsuya calib compare */
#include "app/calib_drift.h"
#include "app/calib_run.h"
#include "app/command.h"
#include "core/file.h"

#include <math.h>
#include <string.h>

enum { KEY_BOARD = 1, KEY_CORNERS, KEY_IMAGER, KEY_LENS, KEY_TOLERANCE, KEY_DISTANCE, MAP_COLS = 41, MAP_ROWS = 31 };

typedef struct camera_input {
    tsuya_calib_input calib;
    const char *photo[TSUYA_CALIB_MOST_PHOTOS + 1], *output;
} camera_input;

static const struct argp_option camera_options[] = {
    {"board", KEY_BOARD, "BOARD.yaml", 0, "The board: a grid, listed tags, or Kalibr's aprilgrid", 0},
    {"corners", KEY_CORNERS, "FILE", 0, "Corners (vnlog: filename tag_id corner x_px y_px sigma_px) instead of photographs", 0},
    {"imager", KEY_IMAGER, "W,H", 0, "Image size of --corners, px", 0},
    {"lens", KEY_LENS, "MODEL", 0, "PINHOLE, OPENCV4, OPENCV5, OPENCV8, OPENCV12 or SPLINED_STEREOGRAPHIC (default: the smallest that cross-validates)", 0},
    {"tolerance", KEY_TOLERANCE, "PX", 0, "Two halves of the photographs must agree within this, p90 (default 0.5)", 0},
    {"output", 'o', "PATH", 0, "Folder, or CAM.cameramodel (default: the current folder)", 0},
    {0},
};

static void parse_lens(struct argp_state *state, tsuya_calibrate_options *options, const char *name)
{
    options->lens_given = true;
    if (strncmp(name, "LENSMODEL_", 10) == 0) {
        name += 10;
    }
    if (!tsuya_lens_from_name(&options->lens, name)) {
        argp_error(state, "--lens: '%s' is unknown; PINHOLE, OPENCV4, OPENCV5, OPENCV8, OPENCV12 and SPLINED_STEREOGRAPHIC are accepted", name);
    }
}

static void check_camera(struct argp_state *state, const tsuya_calib_input *c)
{
    if (!c->board) {
        argp_error(state, "--board is missing");
    } else if (c->corners && c->photo_count) {
        argp_error(state, "either PHOTOS or --corners");
    } else if (c->corners && !c->width_px) {
        argp_error(state, "--corners needs --imager W,H");
    } else if (!c->corners && !c->photo_count) {
        argp_error(state, "PHOTOS is missing: a folder, or files");
    }
}

static error_t parse_camera(int key, char *arg, struct argp_state *state)
{
    camera_input *input = state->input;
    tsuya_calib_input *c = &input->calib;
    switch (key) {
    case KEY_BOARD: c->board = arg; return 0;
    case KEY_CORNERS: c->corners = arg; return 0;
    case KEY_LENS: parse_lens(state, &c->options, arg); return 0;
    case KEY_TOLERANCE: c->options.tolerance_px = tsuya_argument_number(state, "--tolerance", arg, 1e-3, 100.0); return 0;
    case 'o': input->output = arg; return 0;
    case KEY_IMAGER:
        if (!tsuya_parse_size(&c->width_px, &c->height_px, arg)) {
            argp_error(state, "--imager: '%s' is not W,H", arg);
        }
        return 0;
    case ARGP_KEY_ARG:
        if (c->photo_count == TSUYA_CALIB_MOST_PHOTOS) {
            argp_error(state, "more than %d photographs", TSUYA_CALIB_MOST_PHOTOS);
        }
        input->photo[c->photo_count++] = arg;
        return 0;
    case ARGP_KEY_END: check_camera(state, c); return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const tsuya_syntax camera_syntax = {
    .arguments = "PHOTOS...",
    .example = "tsuya calib camera --board board.yaml board-photos/ -o calib/",
    .doc = "Finds the board's tags, calibrates with mrcal, and chooses the smallest lens model that cross-validates: camera.cameramodel, calib.json, "
           "corners.vnl, uncertainty.vnl, calib.html. PHOTOS is a folder or a list of files. Says what to photograph next where the camera is not known well.",
    .options = camera_options,
    .parse = parse_camera,
};

int tsuya_command_calib_camera(int argc, char **argv)
{
    static camera_input input;
    tsuya_common common;
    input = (camera_input){.calib = {.options = tsuya_calibrate_options_default()}};
    tsuya_command_parse(&camera_syntax, &common, &input, argc, argv);
    tsuya_context context = tsuya_command_context(&common);
    input.calib.photos = input.photo;
    char *folder, *file;
    tsuya_json *figures = tsuya_json_create_object();
    tsuya_status status = figures ? tsuya_command_output(&folder, &file, input.output, ".cameramodel", "camera.cameramodel") : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        input.calib.folder = folder;
        input.calib.model = file;
        status = tsuya_calib_run(figures, &input.calib, &context);
        tsuya_free(folder);
        tsuya_free(file);
    }
    if (status == TSUYA_OK) {
        status = tsuya_command_figures(&common, figures);
    }
    tsuya_json_free(figures);
    return status == TSUYA_OK ? TSUYA_EXIT_OK : tsuya_command_failed(status);
}

typedef struct compare_input {
    const char *model[2], *output;
    double distance_m;
} compare_input;

static const struct argp_option compare_options[] = {
    {"distance", KEY_DISTANCE, "M", 0, "Distance at which projections are compared, metres (default: infinity)", 0},
    {"output", 'o', "PATH", 0, "Picture of the difference (compare.png), or the folder for it", 0},
    {0},
};

static error_t parse_compare(int key, char *arg, struct argp_state *state)
{
    compare_input *input = state->input;
    switch (key) {
    case KEY_DISTANCE: input->distance_m = tsuya_argument_number(state, "--distance", arg, 1e-3, 1e6); return 0;
    case 'o': input->output = arg; return 0;
    case ARGP_KEY_ARG:
        if (input->model[1]) {
            argp_error(state, "'%s': two camera models only", arg);
        }
        input->model[input->model[0] ? 1 : 0] = arg;
        return 0;
    case ARGP_KEY_END:
        if (!input->model[1]) {
            argp_error(state, "two camera models are needed: A.cameramodel B.cameramodel");
        }
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const tsuya_syntax compare_syntax = {
    .arguments = "A.cameramodel B.cameramodel",
    .example = "tsuya calib compare calib/camera.cameramodel later/camera.cameramodel",
    .doc = "Projection difference of two calibrations over the image, px, after the motion between them is taken out. Where uncertainty.vnl lies beside both, "
           "it decides whether the camera has drifted.",
    .options = compare_options,
    .parse = parse_compare,
};

/* Covered by the corners.vnl beside a model; `there` false without one. */
static tsuya_status cover_beside(bool *there, tsuya_projection_map *map, const char *model, const tsuya_camera *camera)
{
    tsuya_corner_set corners;
    char *folder = tsuya_path_folder(model), *path = folder ? tsuya_path_join(folder, "corners.vnl") : NULL;
    tsuya_status status = path ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    *there = path && tsuya_path_exists(path);
    if (*there) {
        status = tsuya_corner_set_load(&corners, path, camera->width_px, camera->height_px);
    }
    if (*there && status == TSUYA_OK) {
        tsuya_projection_cover_corners(map, &corners, camera->width_px, camera->height_px);
        tsuya_corner_set_free(&corners);
    }
    tsuya_free(path);
    tsuya_free(folder);
    return status;
}

/* Models are held against each other, and aligned, where both saw their boards: beyond, lenses that fit alike run apart by
 * hundreds of pixels.  Where that is not known, in the image's middle. */
static tsuya_status cover_both(tsuya_json *figures, tsuya_projection_map *map, const compare_input *input, const tsuya_camera camera[2])
{
    tsuya_projection_map other;
    bool there[2] = {false, false};
    TSUYA_TRY(tsuya_projection_map_create(&other, map->cols, map->rows));
    tsuya_status status = cover_beside(&there[0], map, input->model[0], &camera[0]);
    if (status == TSUYA_OK) {
        status = cover_beside(&there[1], &other, input->model[1], &camera[1]);
    }
    if (there[0] && there[1]) {
        for (int i = 0; i < map->cols * map->rows; i++) {
            map->covered[i] &= other.covered[i];
        }
    } else {
        tsuya_projection_cover_middle(map, camera[0].width_px, camera[0].height_px);
    }
    tsuya_json_set_text(figures, "compared", there[0] && there[1] ? "where both saw the board" : "in the image's middle: no corners.vnl beside both models");
    tsuya_projection_map_free(&other);
    return status;
}

static tsuya_status save_picture(const compare_input *input, const tsuya_projection_map *map, const tsuya_camera *camera, double high)
{
    tsuya_image picture = {0};
    char *folder, *file;
    TSUYA_TRY(tsuya_command_output(&folder, &file, input->output, ".png", "compare.png"));
    tsuya_status status = tsuya_calib_map_picture(&picture, map, camera, fmax(high, 1e-9));
    if (status == TSUYA_OK) {
        status = tsuya_image_save(&picture, file, NULL);
    }
    tsuya_image_free(&picture);
    tsuya_free(folder);
    tsuya_free(file);
    return status;
}

static tsuya_status compare(tsuya_json *figures, const compare_input *input)
{
    tsuya_camera camera[2];
    tsuya_projection_map map = {0};
    tsuya_projection_stats stats;
    tsuya_pose motion;
    for (int i = 0; i < 2; i++) {
        TSUYA_TRY(tsuya_cameramodel_load(&camera[i], NULL, input->model[i]));
    }
    TSUYA_TRY(tsuya_projection_map_create(&map, MAP_COLS, MAP_ROWS));
    tsuya_status status = cover_both(figures, &map, input, camera);
    if (status == TSUYA_OK) {
        status = tsuya_projection_difference(&map, &motion, &camera[0], &camera[1], input->distance_m);
    }
    if (status == TSUYA_OK) {
        status = tsuya_projection_summary(&stats, &map);
    }
    if (status == TSUYA_OK) {
        int which;
        tsuya_json *d = tsuya_json_set_object(figures, "difference_px");
        tsuya_json_set_number(d, "mean", stats.mean);
        tsuya_json_set_number(d, "p90", stats.p90);
        tsuya_json_set_number(d, "max", stats.max);
        tsuya_json_set_number(d, "center", tsuya_projection_center(&map));
        tsuya_json_set_number(d, "corner", tsuya_projection_corner(&which, &map));
        if (isfinite(input->distance_m)) {
            tsuya_json_set_number(figures, "distance_m", input->distance_m);
        }
        tsuya_json_set_number(figures, "rotation_deg", tsuya_deg_from_rad(tsuya_mat3_rotation_angle_rad(motion.rotation)));
        tsuya_json_set_number(figures, "translation_m", tsuya_vec3_norm(motion.translation));
        status = tsuya_calib_drift(figures, &map, input->model, camera, input->distance_m);
        if (status == TSUYA_OK && input->output) {
            status = save_picture(input, &map, &camera[0], stats.max);
        }
    }
    tsuya_projection_map_free(&map);
    return status;
}

int tsuya_command_calib_compare(int argc, char **argv)
{
    tsuya_common common;
    compare_input input = {.distance_m = INFINITY};
    tsuya_command_parse(&compare_syntax, &common, &input, argc, argv);
    tsuya_json *figures = tsuya_json_create_object();
    tsuya_status status = figures ? compare(figures, &input) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        status = tsuya_command_figures(&common, figures);
    }
    tsuya_json_free(figures);
    return status == TSUYA_OK ? TSUYA_EXIT_OK : tsuya_command_failed(status);
}
