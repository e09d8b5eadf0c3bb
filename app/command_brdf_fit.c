/* tsuya brdf fit SAMPLES.csv */
#include "app/brdf_figures.h"
#include "app/brdf_samples.h"
#include "app/command.h"
#include "core/file.h"

#include <math.h>
#include <string.h>

enum { KEY_MODEL = 1, KEY_TOLERANCE, KEY_NAME };

typedef struct fit_input {
    const char *output;
    tsuya_samples_source samples;
    tsuya_fit_options options;
} fit_input;

static const struct argp_option fit_options[] = {
    {"model", KEY_MODEL, "MODEL", 0, "auto (default), lambert, ggx, ggx-aniso, ward, ashikhmin, tanaka, yarn, ndf or nurbs3", 0},
    {"tolerance", KEY_TOLERANCE, "E", 0, "auto: the cheapest model whose error on held-out samples (cube roots) is at most E; without it "
                                         "the one with the lowest", 0},
    {"name", KEY_NAME, "NAME", 0, "Name of the material (default: of the table)", 0},
    {"with", TSUYA_KEY_WITH, "SPECTRA.csv", 0, TSUYA_BRDF_WITH_HELP, 0},
    {"channels", TSUYA_KEY_CHANNELS, "own|rgb", 0, TSUYA_BRDF_CHANNELS_HELP, 0},
    {"output", 'o', "PATH", 0, "MATERIAL.json, or a folder (default: the current one)", 0},
    {0},
};

static error_t parse_fit(int key, char *arg, struct argp_state *state)
{
    fit_input *input = state->input;
    switch (key) {
    case KEY_MODEL: input->options.model = arg; return 0;
    case KEY_TOLERANCE: input->options.tolerance = tsuya_argument_number(state, "--tolerance", arg, 0.0, 10.0); return 0;
    case KEY_NAME: input->options.name = arg; return 0;
    case TSUYA_KEY_WITH: input->samples.radiometer = arg; return 0;
    case TSUYA_KEY_CHANNELS:
        if (!tsuya_brdf_channels_known(arg)) {
            argp_error(state, "--channels %s: expected own or rgb", arg);
        }
        input->samples.channels = arg;
        return 0;
    case 'o': input->output = arg; return 0;
    case ARGP_KEY_ARG:
        if (input->samples.path) {
            argp_error(state, "'%s': one table of samples only", arg);
        }
        input->samples.path = arg;
        return 0;
    case ARGP_KEY_END:
        if (!input->samples.path) {
            argp_error(state, "SAMPLES.csv is missing");
        }
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const tsuya_syntax fit_syntax = {
    .arguments = "SAMPLES.csv",
    .example = "tsuya brdf fit satin.csv -o satin.json",
    .doc = "Fits a material to measured reflectance: a table of directions or of a goniometer's stage angles (docs/brdf.md), or a Klems "
           "matrix (.xml). Writes the material, and fit.json with its errors beside it.",
    .options = fit_options,
    .parse = parse_fit,
};

/* NAME of FOLDER/NAME.csv in `text`. */
static const char *name_of(char *text, size_t size, const char *path)
{
    const char *name = tsuya_path_name(path), *extension = tsuya_path_extension(path);
    snprintf(text, size, "%.*s", (int)(strlen(name) - strlen(extension)), name);
    return text;
}

static tsuya_status save(const tsuya_material *material, const tsuya_json *figures, const char *folder, const char *file)
{
    char *path = tsuya_path_join(folder, "fit.json");
    tsuya_status status = path ? tsuya_material_save(material, file) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        status = tsuya_json_save(figures, path);
    }
    tsuya_free(path);
    return status;
}

static tsuya_status fit(fit_input *input, const tsuya_common *common)
{
    tsuya_context context = tsuya_command_context(common);
    tsuya_samples samples = {0};
    tsuya_material *material = NULL;
    tsuya_join_info joined;
    tsuya_fit_info info, candidates[TSUYA_FIT_MODELS];
    tsuya_json *figures = NULL;
    char *folder = NULL, *file = NULL, name[256];
    int count = 0;
    tsuya_status status;
    input->options.name = input->options.name ? input->options.name : name_of(name, sizeof name, input->samples.path);
    TSUYA_GOTO_DONE(status, tsuya_brdf_samples(&samples, &joined, &input->samples, &context));
    TSUYA_GOTO_DONE(status, tsuya_command_output(&folder, &file, input->output, ".json", "material.json"));
    TSUYA_GOTO_DONE(status, tsuya_brdf_fit(&material, &info, candidates, &count, &samples, &input->options, &context));
    figures = tsuya_json_create_object();
    if (!figures) {
        TSUYA_GOTO_DONE(status, TSUYA_ERROR_MEMORY);
    }
    tsuya_brdf_figures(figures, &info);
    tsuya_brdf_candidates(figures, candidates, count);
    tsuya_brdf_joined(figures, &joined);
    if (!isnan(input->options.tolerance) && !(info.heldout.cbrt <= input->options.tolerance)) {
        tsuya_warn("%s: no model reaches --tolerance %g on held-out samples; the best, %s, has %.4g", input->samples.path, input->options.tolerance,
                   info.model, info.heldout.cbrt);
    }
    TSUYA_GOTO_DONE(status, save(material, figures, folder, file));
    status = tsuya_command_figures(common, figures);
done:
    tsuya_json_free(figures);
    tsuya_material_free(material);
    tsuya_samples_free(&samples);
    tsuya_free(folder);
    tsuya_free(file);
    return status;
}

int tsuya_command_brdf_fit(int argc, char **argv)
{
    tsuya_common common;
    fit_input input = {.options = {.model = "auto", .tolerance = NAN}};
    tsuya_command_parse(&fit_syntax, &common, &input, argc, argv);
    tsuya_status status = fit(&input, &common);
    return status == TSUYA_OK ? TSUYA_EXIT_OK : tsuya_command_failed(status);
}
