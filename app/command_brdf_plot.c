/* tsuya brdf plot [MATERIAL.json] [SAMPLES.csv] */
#include "app/brdf_plot.h"
#include "app/brdf_samples.h"
#include "app/command.h"
#include "brdf/fit.h"
#include "core/file.h"
#include "core/table.h"

#include <math.h>
#include <string.h>

enum { KEY_FIGURE = 1, KEY_CHANNEL, KEY_LIGHT, KEY_VIEW, KEY_MODEL, FIGURES = 3 };

typedef struct plot_input {
    const char *material, *output, *figure, *channel, *model;
    tsuya_samples_source samples;
    tsuya_plot_bench bench;
    bool light, view;
} plot_input;

typedef struct figure {
    const char *name;
    tsuya_status (*draw)(const char *path, const tsuya_brdf_picture *picture, const tsuya_plot_data *data);
} figure;

static const figure figures[FIGURES] = {{"curves", tsuya_plot_curves}, {"surface", tsuya_plot_surface}, {"polar", tsuya_plot_polar}};
static const char *const figure_names[] = {"curves", "surface", "polar", "all", NULL};

static const struct argp_option plot_options[] = {
    {"figure", KEY_FIGURE, "NAME", 0, "curves (intensity against tilt, one an azimuth), surface (over the half vector's plane), polar, or all (default)", 0},
    {"channel", KEY_CHANNEL, "NAME", 0, "Channel to draw: r, g, b or nm550 (default: g, or the middle one)", 0},
    {"light", KEY_LIGHT, "THETA,PHI", 0, "Lamp's polar angle and azimuth on the bench, degrees (default: the table's, else 30,0)", 0},
    {"view", KEY_VIEW, "THETA,PHI", 0, "Camera's (default: the table's, else 30,180)", 0},
    {"model", KEY_MODEL, "MODEL", 0, "Model that is fitted where only samples are given (default auto)", 0},
    {"with", TSUYA_KEY_WITH, "SPECTRA.csv", 0, TSUYA_BRDF_WITH_HELP, 0},
    {"channels", TSUYA_KEY_CHANNELS, "own|rgb", 0, TSUYA_BRDF_CHANNELS_HELP, 0},
    {"output", 'o', "PATH", 0, "PATH.png for the first figure, the others beside it, or a folder (default: the current one)", 0},
    {0},
};

static void parse_angles(struct argp_state *state, double angles[2], const char *option, const char *text)
{
    char first[64];
    const char *comma = strchr(text, ',');
    if (!comma || (size_t)(comma - text) >= sizeof first) {
        argp_error(state, "%s %s: expected THETA,PHI in degrees", option, text);
        return;
    }
    snprintf(first, sizeof first, "%.*s", (int)(comma - text), text);
    angles[0] = tsuya_argument_number(state, option, first, 0.0, 89.0);
    angles[1] = tsuya_argument_number(state, option, comma + 1, -360.0, 360.0);
}

static void parse_name(struct argp_state *state, plot_input *input, const char *arg)
{
    bool material = strcmp(tsuya_path_extension(arg), ".json") == 0;
    const char **slot = material ? &input->material : &input->samples.path;
    if (*slot) {
        argp_error(state, "'%s': one %s only", arg, material ? "MATERIAL.json" : "table of samples");
    }
    *slot = arg;
}

static error_t parse_plot(int key, char *arg, struct argp_state *state)
{
    plot_input *input = state->input;
    switch (key) {
    case KEY_FIGURE: {
        bool known = false;
        for (int k = 0; figure_names[k]; ++k) {
            known |= strcmp(arg, figure_names[k]) == 0;
        }
        if (!known) {
            argp_error(state, "--figure %s: expected curves, surface, polar or all", arg);
        }
        input->figure = arg;
        return 0;
    }
    case KEY_CHANNEL: input->channel = arg; return 0;
    case KEY_LIGHT: parse_angles(state, input->bench.light_deg, "--light", arg); input->light = true; return 0;
    case KEY_VIEW: parse_angles(state, input->bench.view_deg, "--view", arg); input->view = true; return 0;
    case KEY_MODEL: input->model = arg; return 0;
    case TSUYA_KEY_WITH: input->samples.radiometer = arg; return 0;
    case TSUYA_KEY_CHANNELS:
        if (!tsuya_brdf_channels_known(arg)) {
            argp_error(state, "--channels %s: expected own or rgb", arg);
        }
        input->samples.channels = arg;
        return 0;
    case 'o': input->output = arg; return 0;
    case ARGP_KEY_ARG: parse_name(state, input, arg); return 0;
    case ARGP_KEY_END:
        if (!input->samples.path && !input->material) {
            argp_error(state, "MATERIAL.json or SAMPLES.csv is missing");
        }
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const tsuya_syntax plot_syntax = {
    .arguments = "[MATERIAL.json] [SAMPLES.csv]",
    .example = "tsuya brdf plot demo/brdf/default-silk.json -o silk.png",
    .doc = "Draws a material's reflected intensity on a bench whose lamp and camera stand still, as curves over the stage's tilt, as a surface and as "
           "polar diagrams; measured samples are drawn on top as points. Given samples alone, a model is fitted to them first.",
    .options = plot_options,
    .parse = parse_plot,
};

/* FOLDER/STEM-NAME.png of FOLDER/STEM.png; the first figure has the name itself, and in a folder every figure its own. */
static char *figure_path(const char *folder, const char *file, const char *name, bool first, bool named)
{
    char text[512];
    const char *stem = tsuya_path_name(file);
    if (named && first) {
        return tsuya_strdup(file);
    }
    if (named) {
        snprintf(text, sizeof text, "%.*s-%s.png", (int)(strlen(stem) - strlen(tsuya_path_extension(stem))), stem, name);
    } else {
        snprintf(text, sizeof text, "%s.png", name);
    }
    return tsuya_path_join(folder, text);
}

static tsuya_status draw_all(tsuya_json *list, const plot_input *input, const tsuya_brdf_picture *picture, const tsuya_plot_data *data)
{
    char *folder, *file;
    bool named = input->output && strcmp(tsuya_path_extension(input->output), ".png") == 0, first = true;
    TSUYA_TRY(tsuya_command_output(&folder, &file, input->output, ".png", "curves.png"));
    tsuya_status status = TSUYA_OK;
    for (int k = 0; k < FIGURES && status == TSUYA_OK; ++k) {
        if (strcmp(input->figure, "all") != 0 && strcmp(input->figure, figures[k].name) != 0) {
            continue;
        }
        char *path = figure_path(folder, file, figures[k].name, first, named);
        first = false;
        status = path ? figures[k].draw(path, picture, data) : TSUYA_ERROR_MEMORY;
        tsuya_json_add_text(list, path ? path : "");
        tsuya_free(path);
    }
    tsuya_free(folder);
    tsuya_free(file);
    return status;
}

/* Error of the drawn material on the drawn samples, where their channels are the same. */
static double error_of(const tsuya_material *m, const tsuya_samples *s)
{
    tsuya_material_info info = tsuya_material_get_info(m);
    bool same = info.channel_count == s->channel_count;
    for (int c = 0; same && c < info.channel_count; ++c) {
        same = strcmp(info.channel[c], s->channel[c]) == 0;
    }
    double *predicted = same ? tsuya_calloc((size_t)s->count * (size_t)s->channel_count, sizeof *predicted) : NULL, error = NAN;
    if (predicted) {
        tsuya_material_predict(predicted, m, s);
        error = tsuya_samples_error(s, predicted, -1).cbrt;
    }
    tsuya_free(predicted);
    return error;
}

static void set_bench(plot_input *input, const tsuya_samples *samples)
{
    tsuya_plot_bench bench = tsuya_plot_bench_default();
    if (samples->count > 0) {
        tsuya_plot_bench_of(&bench, samples);
    }
    for (int k = 0; k < 2; ++k) {
        input->bench.light_deg[k] = input->light ? input->bench.light_deg[k] : bench.light_deg[k];
        input->bench.view_deg[k] = input->view ? input->bench.view_deg[k] : bench.view_deg[k];
    }
}

static tsuya_status load(tsuya_material **material, tsuya_samples *samples, const plot_input *input, const tsuya_context *context)
{
    tsuya_join_info joined;
    if (input->samples.path) {
        TSUYA_TRY(tsuya_brdf_samples(samples, &joined, &input->samples, context));
    }
    if (input->material) {
        return tsuya_material_load(material, input->material);
    }
    tsuya_fit_info info;
    tsuya_fit_options options = {.name = tsuya_path_name(input->samples.path), .model = input->model, .tolerance = NAN};
    return tsuya_brdf_fit(material, &info, NULL, NULL, samples, &options, context);
}

static tsuya_status plot(plot_input *input, const tsuya_common *common)
{
    tsuya_context context = tsuya_command_context(common);
    tsuya_samples samples = {0};
    tsuya_material *material = NULL;
    tsuya_plot_data data = {0};
    tsuya_json *out = NULL;
    tsuya_status status;
    TSUYA_GOTO_DONE(status, load(&material, &samples, input, &context));
    set_bench(input, &samples);
    tsuya_brdf_picture picture = {.material = material, .samples = samples.count ? &samples : NULL, .bench = input->bench, .channel = input->channel,
                                  .title = tsuya_material_get_info(material).name, .scale = 1.0};
    TSUYA_GOTO_DONE(status, tsuya_plot_data_create(&data, &picture));
    out = tsuya_json_create_object();
    if (!out) {
        TSUYA_GOTO_DONE(status, TSUYA_ERROR_MEMORY);
    }
    tsuya_json_set_text(out, "model", tsuya_material_get_info(material).model);
    tsuya_json_set_text(out, "channel", data.channel);
    TSUYA_GOTO_DONE(status, draw_all(tsuya_json_set_array(out, "pictures"), input, &picture, &data));
    if (samples.count) {
        tsuya_json_set_number(out, "points", data.count);
        tsuya_json_set_number(out, "points_elsewhere", data.left_out);
        tsuya_json_set_number(out, "error_cbrt", error_of(material, &samples));
    }
    status = tsuya_command_figures(common, out);
done:
    tsuya_json_free(out);
    tsuya_plot_data_free(&data);
    tsuya_material_free(material);
    tsuya_samples_free(&samples);
    return status;
}

int tsuya_command_brdf_plot(int argc, char **argv)
{
    tsuya_common common;
    plot_input input = {.figure = "all", .model = "auto"};
    tsuya_command_parse(&plot_syntax, &common, &input, argc, argv);
    tsuya_status status = plot(&input, &common);
    return status == TSUYA_OK ? TSUYA_EXIT_OK : tsuya_command_failed(status);
}
