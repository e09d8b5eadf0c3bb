/* tsuya render MESH.ply */
#include "app/command.h"
#include "app/terminal.h"
#include "core/file.h"
#include "render/render.h"

#include <math.h>
#include <string.h>
#include <unistd.h>

enum {
    KEY_MATERIAL = 1, KEY_LIGHTS, KEY_CAMERA, KEY_TURNTABLE, KEY_SIZE, KEY_ELEVATION, KEY_UP, KEY_COLOR, KEY_SPP, KEY_NOISE,
    KEY_BOUNCES, KEY_DETAIL, KEY_TOLERANCE, KEY_EXPOSURE, KEY_REFERENCE, KEY_LIKE, KEY_MASK, KEY_GAIN, KEY_TRANSMISSION, KEY_WHITE, LIST = 256,
};

typedef struct render_input {
    tsuya_render_options options;
    const char *material[LIST + 1], *camera[LIST + 1], *photo[LIST + 1], *mask[LIST + 1];
    const char *output;
    bool turntable;
} render_input;

static const struct argp_option render_options[] = {
    {"material", KEY_MATERIAL, "[NAME=]MAT.json", 0, "Material, in the order of the mesh's material index; repeatable (default: a built-in silk)", 0},
    {"lights", KEY_LIGHTS, "LIGHTS.json", 0, "Lamps: a file, daylight, torch, halogen or led (default: a soft studio that stands with the camera)", 0},
    {"camera", KEY_CAMERA, "CAM.cameramodel", 0, "Camera, its extrinsics are the pose; repeatable", 0},
    {"turntable", KEY_TURNTABLE, "N", 0, "N views around the object (default 1, where no camera is given)", 0},
    {"size", KEY_SIZE, "WxH", 0, "Picture of the turntable (default 1280x960)", 0},
    {"elevation", KEY_ELEVATION, "DEG", 0, "Height of the turntable's camera (default 15)", 0},
    {"up", KEY_UP, "X,Y,Z", 0, "Axis of the turntable (default 0,0,1)", 0},
    {"color", KEY_COLOR, "COLOR", 0, "Dye the cloth: a name, #rrggbb, r,g,b (linear), lab(L,a,b), SPECTRUM.csv (nm,reflectance), photographs or material", 0},
    {"transmission", KEY_TRANSMISSION, "R,G,B", 0, "Share of the light that thin cloth lets through, spread evenly (default: none)", 0},
    {"spp", KEY_SPP, "N", 0, "Samples a pixel (default 64)", 0},
    {"noise", KEY_NOISE, "E", 0, "Stop a pixel at this relative error; --spp is then the most it gets", 0},
    {"tolerance", KEY_TOLERANCE, "E", 0, "Render each material by the cheapest model that, at the size of a pixel, is off by at most E on cube roots (default 0: by its own)", 0},
    {"detail", KEY_DETAIL, "PX", 0, "Leave out triangles smaller than half a pixel, as far as no vertex is off by more than PX (default 0.1; 0: never)", 0},
    {"bounces", KEY_BOUNCES, "N", 0, "Reflections along a path (default 4; 1: lamps only)", 0},
    {"exposure", KEY_EXPOSURE, "EV", 0, "Of the PNGs (default: a white card in the place of the cloth shows display white)", 0},
    {"white", KEY_WHITE, "d65|lamps", 0, "What the PNGs show as white: D65 (default), or the lamps, as an eye sees that has adapted to them", 0},
    {"reference", KEY_REFERENCE, "REF.exr", 0, "Compare the first picture with this one", 0},
    {"like", KEY_LIKE, "PHOTO", 0, "Compare with this photograph; repeatable, in the order of the cameras", 0},
    {"mask", KEY_MASK, "MASK.png", 0, "What to compare of the photograph (white); repeatable, in the order of the photographs", 0},
    {"gain", KEY_GAIN, "R,G,B", 0, "Exposure and white balance of the comparison (default: fitted to each photograph)", 0},
    {"output", 'o', "PATH", 0, "Folder; with one view also PICTURE.exr, companions beside it (default: the current folder)", 0},
    {0},
};

static void parse_up(struct argp_state *state, tsuya_vec3 *up, const char *text)
{
    char tail;
    if (sscanf(text, "%lf,%lf,%lf%c", &up->x, &up->y, &up->z, &tail) != 3 || !(tsuya_vec3_norm(*up) > 1e-9) ||
        !isfinite(tsuya_vec3_norm(*up))) {
        argp_error(state, "--up: '%s' is not X,Y,Z with a length", text);
    }
}

static void parse_gain(struct argp_state *state, double gain[3], const char *text)
{
    char tail;
    if (sscanf(text, "%lf,%lf,%lf%c", &gain[0], &gain[1], &gain[2], &tail) != 3 || !(fmin(gain[0], fmin(gain[1], gain[2])) > 0.0) ||
        !isfinite(gain[0] + gain[1] + gain[2])) {
        argp_error(state, "--gain: '%s' is not R,G,B with three numbers above 0", text);
    }
}

static void parse_transmission(struct argp_state *state, double share[3], const char *text)
{
    char tail;
    if (sscanf(text, "%lf,%lf,%lf%c", &share[0], &share[1], &share[2], &tail) != 3) {
        argp_error(state, "--transmission: '%s' is not R,G,B with three numbers in [0, 1]", text);
    }
    for (int c = 0; c < 3; c++) {
        if (!(share[c] >= 0.0 && share[c] <= 1.0)) {
            argp_error(state, "--transmission: '%s' is not R,G,B with three numbers in [0, 1]", text);
        }
    }
}

static int count(const char *const *list)
{
    int n = 0;
    while (list[n]) {
        n++;
    }
    return n;
}

static const char *without_name(const char *text)
{
    const char *equals = strchr(text, '=');
    return equals ? equals + 1 : text;
}

static error_t parse_end(struct argp_state *state, const render_input *input)
{
    if (!input->options.mesh_path) {
        argp_error(state, "MESH.ply is missing");
    }
    if (input->turntable && input->camera[0]) {
        argp_error(state, "--turntable and --camera exclude each other");
    }
    int cameras = count(input->camera), photos = count(input->photo), masks = count(input->mask);
    if (photos > 0 && photos != cameras) {
        argp_error(state, "%d --like for %d --camera; one photograph a camera is needed", photos, cameras);
    }
    if (masks > 0 && masks != photos) {
        argp_error(state, "%d --mask for %d --like; one mask a photograph is needed", masks, photos);
    }
    return 0;
}

static error_t parse_render(int key, char *arg, struct argp_state *state)
{
    render_input *input = state->input;
    tsuya_render_options *o = &input->options;
    switch (key) {
    case KEY_MATERIAL: tsuya_argument_append(state, input->material, LIST, without_name(arg)); return 0;
    case KEY_LIGHTS: o->lights_path = arg; return 0;
    case KEY_CAMERA: tsuya_argument_append(state, input->camera, LIST, arg); return 0;
    case KEY_TURNTABLE:
        o->views = tsuya_argument_int(state, "--turntable", arg, 1, 3600);
        input->turntable = true;
        return 0;
    case KEY_SIZE:
        if (!tsuya_parse_size(&o->width_px, &o->height_px, arg)) {
            argp_error(state, "--size: '%s' is not WxH in px", arg);
        }
        return 0;
    case KEY_ELEVATION: o->elevation_deg = tsuya_argument_number(state, "--elevation", arg, -89.0, 89.0); return 0;
    case KEY_UP: parse_up(state, &o->up, arg); return 0;
    case KEY_COLOR:
        o->color = arg;
        if (tsuya_render_check_color(arg) != TSUYA_OK) {
            argp_error(state, "--color: %s", tsuya_reason());
        }
        return 0;
    case KEY_SPP: o->spp = tsuya_argument_int(state, "--spp", arg, 1, 1 << 20); return 0;
    case KEY_NOISE: o->noise = tsuya_argument_number(state, "--noise", arg, 1e-4, 1.0); return 0;
    case KEY_TOLERANCE: o->tolerance = tsuya_argument_number(state, "--tolerance", arg, 0.0, 1.0); return 0;
    case KEY_DETAIL: o->detail_px = tsuya_argument_number(state, "--detail", arg, 0.0, 10.0); return 0;
    case KEY_BOUNCES: o->bounces = tsuya_argument_int(state, "--bounces", arg, 1, 64); return 0;
    case KEY_EXPOSURE: o->exposure_ev = tsuya_argument_number(state, "--exposure", arg, -40.0, 40.0); return 0;
    case KEY_WHITE:
        if (strcmp(arg, "d65") != 0 && strcmp(arg, "lamps") != 0) {
            argp_error(state, "--white: '%s' is not d65 or lamps", arg);
        }
        o->adapt_to_lamps = strcmp(arg, "lamps") == 0;
        return 0;
    case KEY_REFERENCE: o->reference_path = arg; return 0;
    case KEY_LIKE: tsuya_argument_append(state, input->photo, LIST, arg); return 0;
    case KEY_MASK: tsuya_argument_append(state, input->mask, LIST, arg); return 0;
    case KEY_GAIN: parse_gain(state, o->gain, arg); return 0;
    case KEY_TRANSMISSION: parse_transmission(state, o->transmission, arg); return 0;
    case 'o': input->output = arg; return 0;
    case ARGP_KEY_ARG:
        if (o->mesh_path) {
            argp_error(state, "'%s': one MESH.ply only", arg);
        }
        o->mesh_path = arg;
        return 0;
    case ARGP_KEY_END: return parse_end(state, input);
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const tsuya_syntax render_syntax = {
    .arguments = "MESH.ply",
    .example = "tsuya render demo/weave/weave.ply --turntable 4 --size 640x480 --color '#7a1f2b' -o out/pictures",
    .doc = "Shades a mesh with its weft field and materials, and writes frame_000.exr (linear radiance), frame_000.png … and "
           "render.json.",
    .options = render_options,
    .parse = parse_render,
};

static bool ends_with(const char *text, const char *end)
{
    size_t length = strlen(text), tail = strlen(end);
    return length >= tail && strcmp(text + length - tail, end) == 0;
}

/* The one picture and its companions, from their folder to their names. */
static tsuya_status move_picture(const char *folder, const char *target)
{
    static const char *const extensions[] = {".exr", ".compare.png", ".png", ".json"};
    tsuya_arena *arena;
    char **names;
    int name_count;
    size_t stem = strlen(target) - strlen(tsuya_path_extension(target));
    TSUYA_TRY(tsuya_arena_create(&arena, 1 << 12));
    tsuya_status status = tsuya_folder_list(&names, &name_count, folder, arena);
    for (int i = 0; status == TSUYA_OK && i < name_count; i++) {
        int e = 0;
        while (e < 4 && !ends_with(names[i], extensions[e])) {
            e++;
        }
        if (e < 4) {
            const char *from = tsuya_arena_printf(arena, "%s/%s", folder, names[i]);
            const char *to = tsuya_arena_printf(arena, "%.*s%s", (int)stem, target, extensions[e]);
            status = from && to ? tsuya_file_rename_into_place(from, to) : TSUYA_ERROR_MEMORY;
        }
    }
    tsuya_arena_free(arena);
    return status == TSUYA_OK ? tsuya_folder_remove(folder) : status;
}

/* Renders into a folder of its own beside the target, so that nothing there is taken for a frame of this render. */
static tsuya_status render_to_file(tsuya_render_info *info, render_input *input, const tsuya_context *context)
{
    char name[64];
    char *folder = tsuya_path_folder(input->output);
    snprintf(name, sizeof name, ".render-%ld", (long)getpid());
    char *inner = folder ? tsuya_path_join(folder, name) : NULL;
    tsuya_status status = inner ? tsuya_folder_make(inner) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        input->options.output_folder = inner;
        status = tsuya_render(info, &input->options, context);
        if (status == TSUYA_OK) {
            status = move_picture(inner, input->output);
        } else {
            tsuya_failure failure = {0};
            tsuya_failure_keep(&failure, 0, status);
            status = tsuya_folder_remove(inner) == TSUYA_OK ? tsuya_failure_raise(&failure) : status;
        }
    }
    tsuya_free(inner);
    tsuya_free(folder);
    return status;
}

static tsuya_status render(tsuya_render_info *info, render_input *input, const tsuya_context *context)
{
    int pictures = input->options.camera_count > 0 ? input->options.camera_count : input->options.views;
    const char *extension = input->output ? tsuya_path_extension(input->output) : "";
    if (strcmp(extension, ".exr") == 0 || strcmp(extension, ".png") == 0) {
        if (pictures != 1) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "-o %s: one file for %d pictures; give a folder", input->output, pictures);
        }
        return render_to_file(info, input, context);
    }
    input->options.output_folder = input->output ? input->output : ".";
    TSUYA_TRY(tsuya_folder_make(input->options.output_folder));
    return tsuya_render(info, &input->options, context);
}

int tsuya_command_render(int argc, char **argv)
{
    tsuya_common common;
    render_input input = {.options = tsuya_render_options_default()};
    tsuya_command_parse(&render_syntax, &common, &input, argc, argv);
    tsuya_context context = tsuya_command_context(&common);
    input.options.material_path = input.material;
    input.options.material_count = count(input.material);
    input.options.camera_path = input.camera;
    input.options.camera_count = count(input.camera);
    input.options.photo_path = input.photo[0] ? input.photo : NULL;
    input.options.mask_path = input.mask[0] ? input.mask : NULL;
    tsuya_render_info info = {0};
    tsuya_json *figures = tsuya_json_create_object();
    tsuya_status status = figures ? render(&info, &input, &context) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        tsuya_render_info_to_json(figures, &info);
        status = tsuya_command_figures(&common, figures);
    }
    tsuya_json_free(figures);
    return status == TSUYA_OK ? TSUYA_EXIT_OK : tsuya_command_failed(status);
}
