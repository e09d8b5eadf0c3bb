/* tsuya weave image PHOTO, tsuya weave mesh MESH.ply */
#include "app/command.h"
#include "app/weave_maps.h"
#include "app/weave_truth.h"
#include "core/file.h"
#include "weave_detect/mesh_field.h"
#include "weave_detect/patches.h"

#include <math.h>
#include <string.h>

enum { KEY_PATCH = 1, KEY_STEP, KEY_MASK, KEY_WEFT, KEY_WORKSPACE, KEY_HOLD_OUT, KEY_TRUTH, KEY_SCALE, KEY_NO_OVERLAY, KEY_MAPS, LIST = 1024 };

typedef struct image_input {
    tsuya_patch_options options;
    const char *photo, *mask, *output;
    double px_per_cm;
    bool no_overlay;
} image_input;

static const struct argp_option image_options[] = {
    {"patch-px", KEY_PATCH, "N", 0, "Side of a patch (default 64; even, 16 to 512)", 0},
    {"step-px", KEY_STEP, "N", 0, "From one patch to the next (default 32)", 0},
    {"mask", KEY_MASK, "MASK.png", 0, "White keeps, black is ignored", 0},
    {"weft-deg", KEY_WEFT, "DEG", 0, "Roughly where the weft runs, counter-clockwise from the horizontal (default: not known)", 0},
    {"px-per-cm", KEY_SCALE, "N", 0, "Scale of the photograph: adds threads per cm to the summary", 0},
    {"no-overlay", KEY_NO_OVERLAY, NULL, 0, "Write no picture", 0},
    {"output", 'o', "PATH", 0, "PATCHES.csv, its picture beside it; or a folder (default: the current folder)", 0},
    {0},
};

static error_t parse_image(int key, char *arg, struct argp_state *state)
{
    image_input *input = state->input;
    switch (key) {
    case KEY_PATCH: input->options.patch_px = tsuya_argument_int(state, "--patch-px", arg, 16, 512); return 0;
    case KEY_STEP: input->options.step_px = tsuya_argument_int(state, "--step-px", arg, 1, 65535); return 0;
    case KEY_MASK: input->mask = arg; return 0;
    case KEY_WEFT: input->options.weft_deg = tsuya_argument_number(state, "--weft-deg", arg, -360.0, 360.0); return 0;
    case KEY_SCALE: input->px_per_cm = tsuya_argument_number(state, "--px-per-cm", arg, 1e-6, 1e9); return 0;
    case KEY_NO_OVERLAY: input->no_overlay = true; return 0;
    case 'o': input->output = arg; return 0;
    case ARGP_KEY_ARG:
        if (input->photo) {
            argp_error(state, "'%s': one PHOTO only", arg);
        }
        input->photo = arg;
        return 0;
    case ARGP_KEY_END:
        if (!input->photo) {
            argp_error(state, "PHOTO is missing");
        }
        if (input->options.patch_px % 2 != 0) {
            argp_error(state, "--patch-px %d: an even number is accepted", input->options.patch_px);
        }
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const tsuya_syntax image_syntax = {
    .arguments = "PHOTO",
    .example = "tsuya weave image cloth.jpg -o out/patches.csv",
    .doc = "Finds the two thread directions of every patch: patches.csv (angles in degrees counter-clockwise from +x with y up, periods "
           "in pixels, confidence as a probability, the kind of weave) and a picture with the threads drawn on the photograph.",
    .options = image_options,
    .parse = parse_image,
};

/* A companion of the table: its name with another ending. */
static char *beside(const char *csv, const char *ending)
{
    size_t stem = strlen(csv) - strlen(tsuya_path_extension(csv)), size = strlen(ending) + 1;
    char *path = tsuya_calloc(stem + size, 1);
    if (path) {
        memcpy(path, csv, stem);
        memcpy(path + stem, ending, size);
    }
    return path;
}

static tsuya_status save_overlay(const char *csv, const tsuya_image *photo, const tsuya_patch_grid *grid)
{
    tsuya_image picture = {0};
    char *path = beside(csv, ".png");
    tsuya_status status = path ? tsuya_patches_overlay(&picture, photo, grid) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        status = tsuya_image_save(&picture, path, NULL);
    }
    tsuya_free(path);
    tsuya_image_free(&picture);
    return status;
}

static tsuya_status weave_image(tsuya_json *figures, const image_input *input, const tsuya_context *context)
{
    tsuya_image photo = {0}, mask = {0};
    tsuya_patch_grid grid = {0};
    char *folder = NULL, *csv = NULL, *kinds = NULL;
    tsuya_status status;
    TSUYA_GOTO_DONE(status, tsuya_image_load(&photo, input->photo));
    if (input->mask) {
        TSUYA_GOTO_DONE(status, tsuya_image_load(&mask, input->mask));
    }
    TSUYA_GOTO_DONE(status, tsuya_command_output(&folder, &csv, input->output, ".csv", "patches.csv"));
    double begin = tsuya_clock_s();
    status = tsuya_patches_detect(&grid, &photo, &mask, &input->options, context);
    if (status == TSUYA_ERROR_INPUT) {
        char reason[TSUYA_REASON_SIZE];
        snprintf(reason, sizeof reason, "%s", tsuya_reason());
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: %s", input->photo, reason);
    }
    TSUYA_GOTO_DONE(status, status);
    tsuya_patches_to_json(figures, &grid, input->px_per_cm);
    tsuya_json_set_number(figures, "seconds", tsuya_clock_s() - begin);
    TSUYA_GOTO_DONE(status, tsuya_patches_save(&grid, csv));
    kinds = beside(csv, ".kinds.csv");
    TSUYA_GOTO_DONE(status, kinds ? tsuya_patches_save_kinds(&grid, kinds) : TSUYA_ERROR_MEMORY);
    if (!input->no_overlay) {
        TSUYA_GOTO_DONE(status, save_overlay(csv, &photo, &grid));
    }
done:
    tsuya_image_free(&photo);
    tsuya_image_free(&mask);
    tsuya_patches_free(&grid);
    tsuya_free(folder);
    tsuya_free(csv);
    tsuya_free(kinds);
    return status;
}

static int finish(const tsuya_common *common, tsuya_json *figures, tsuya_status status)
{
    if (status == TSUYA_OK) {
        status = tsuya_command_figures(common, figures);
    }
    tsuya_json_free(figures);
    return status == TSUYA_OK ? TSUYA_EXIT_OK : tsuya_command_failed(status);
}

int tsuya_command_weave_image(int argc, char **argv)
{
    tsuya_common common;
    image_input input = {.options = tsuya_patch_options_default()};
    tsuya_command_parse(&image_syntax, &common, &input, argc, argv);
    tsuya_context context = tsuya_command_context(&common);
    tsuya_json *figures = tsuya_json_create_object();
    return finish(&common, figures, figures ? weave_image(figures, &input, &context) : TSUYA_ERROR_MEMORY);
}

typedef struct mesh_input {
    tsuya_weave_mesh_options options;
    const char *mesh, *output, *truth, *hold_out[LIST + 1];
    bool maps;
} mesh_input;

static const struct argp_option mesh_options[] = {
    {"workspace", KEY_WORKSPACE, "FOLDER", 0, "COLMAP's dense folder: images/ and sparse/ (default: dense beside MESH.ply)", 0},
    {"patch-px", KEY_PATCH, "N", 0, "Side of a patch (default 64; even, 16 to 512)", 0},
    {"step-px", KEY_STEP, "N", 0, "From one patch to the next (default 32)", 0},
    {"weft", KEY_WEFT, "X,Y,Z", 0, "Roughly where the weft runs, world frame (default: not known)", 0},
    {"hold-out", KEY_HOLD_OUT, "NAME", 0, "A photograph that does not vote; repeatable", 0},
    {"truth", KEY_TRUTH, "TRUE.ply", 0, "Hold the field against this mesh's weft, in the same frame", 0},
    {"maps", KEY_MAPS, NULL, 0, "Also write shear.ply, weft_threads.ply and warp_threads.ply: the surface coloured by shear and by thread density", 0},
    {"output", 'o', "PATH", 0, "WEAVE.ply, weave.json beside it; or a folder (default: the current folder)", 0},
    {0},
};

static void parse_weft(struct argp_state *state, tsuya_weave_mesh_options *o, const char *text)
{
    char tail;
    tsuya_vec3 *w = &o->weft;
    if (sscanf(text, "%lf,%lf,%lf%c", &w->x, &w->y, &w->z, &tail) != 3 || !(tsuya_vec3_norm(*w) > 1e-9) || !isfinite(tsuya_vec3_norm(*w))) {
        argp_error(state, "--weft: '%s' is no direction X,Y,Z", text);
    }
    *w = tsuya_vec3_unit(*w);
    o->has_weft = true;
}

static error_t parse_mesh(int key, char *arg, struct argp_state *state)
{
    mesh_input *input = state->input;
    switch (key) {
    case KEY_WORKSPACE: input->options.workspace = arg; return 0;
    case KEY_PATCH: input->options.patch_px = tsuya_argument_int(state, "--patch-px", arg, 16, 512); return 0;
    case KEY_STEP: input->options.step_px = tsuya_argument_int(state, "--step-px", arg, 1, 65535); return 0;
    case KEY_WEFT: parse_weft(state, &input->options, arg); return 0;
    case KEY_HOLD_OUT: tsuya_argument_append(state, input->hold_out, LIST, arg); return 0;
    case KEY_TRUTH: input->truth = arg; return 0;
    case KEY_MAPS: input->maps = true; return 0;
    case 'o': input->output = arg; return 0;
    case ARGP_KEY_ARG:
        if (input->mesh) {
            argp_error(state, "'%s': one MESH.ply only", arg);
        }
        input->mesh = arg;
        return 0;
    case ARGP_KEY_END:
        if (!input->mesh) {
            argp_error(state, "MESH.ply is missing");
        }
        if (input->options.patch_px % 2 != 0) {
            argp_error(state, "--patch-px %d: an even number is accepted", input->options.patch_px);
        }
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const tsuya_syntax mesh_syntax = {
    .arguments = "MESH.ply",
    .example = "tsuya weave mesh demo/reconstruct/mesh.ply -o out/weave",
    .doc = "Lifts the threads of all photographs to one weft field on the surface: weave.ply (weft_x weft_y weft_z weave_confidence shear_deg "
           "weft_threads_per_m warp_threads_per_m) and weave.json.",
    .options = mesh_options,
    .parse = parse_mesh,
};

static tsuya_status save_mesh(tsuya_json *figures, const tsuya_mesh *mesh, const char *output, bool maps)
{
    char *folder = NULL, *ply = NULL, *json = NULL;
    tsuya_status status = tsuya_command_output(&folder, &ply, output, ".ply", "weave.ply");
    if (status == TSUYA_OK) {
        status = tsuya_ply_save(mesh, ply, NULL);
    }
    if (status == TSUYA_OK && maps) {
        status = tsuya_weave_maps_save(figures, mesh, folder);
    }
    if (status == TSUYA_OK) {
        json = tsuya_path_join(folder, "weave.json");
        status = json ? tsuya_json_save(figures, json) : TSUYA_ERROR_MEMORY;
    }
    tsuya_free(folder);
    tsuya_free(ply);
    tsuya_free(json);
    return status;
}

static tsuya_status weave_mesh(tsuya_json *figures, mesh_input *input, const tsuya_context *context)
{
    tsuya_mesh mesh = {0};
    tsuya_weave_mesh_info info = {0};
    char *folder = tsuya_path_folder(input->mesh), *workspace = folder ? tsuya_path_join(folder, "dense") : NULL;
    tsuya_status status = workspace ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    TSUYA_GOTO_DONE(status, status);
    if (!input->options.workspace) {
        input->options.workspace = workspace;
    }
    TSUYA_GOTO_DONE(status, tsuya_ply_load(&mesh, input->mesh));
    if (mesh.triangle_count == 0) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: no triangles; a surface is accepted", input->mesh);
        goto done;
    }
    TSUYA_GOTO_DONE(status, tsuya_weave_mesh(&mesh, &info, &input->options, context));
    tsuya_weave_mesh_info_to_json(figures, &info);
    if (input->truth) {
        TSUYA_GOTO_DONE(status, tsuya_weave_truth(figures, &mesh, input->truth));
    }
    TSUYA_GOTO_DONE(status, save_mesh(figures, &mesh, input->output, input->maps));
done:
    tsuya_weave_mesh_info_free(&info);
    tsuya_mesh_free(&mesh);
    tsuya_free(folder);
    tsuya_free(workspace);
    return status;
}

int tsuya_command_weave_mesh(int argc, char **argv)
{
    tsuya_common common;
    mesh_input input = {.options = tsuya_weave_mesh_options_default()};
    tsuya_command_parse(&mesh_syntax, &common, &input, argc, argv);
    tsuya_context context = tsuya_command_context(&common);
    input.options.hold_out = input.hold_out;
    while (input.hold_out[input.options.hold_out_count]) {
        input.options.hold_out_count++;
    }
    tsuya_json *figures = tsuya_json_create_object();
    return finish(&common, figures, figures ? weave_mesh(figures, &input, &context) : TSUYA_ERROR_MEMORY);
}
