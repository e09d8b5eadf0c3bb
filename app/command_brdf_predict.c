/* tsuya brdf predict */
#include "app/brdf_arguments.h"
#include "app/brdf_plot.h"
#include "app/command.h"
#include "brdf/fit.h"
#include "brdf/predict.h"
#include "core/file.h"

#include <math.h>
#include <string.h>

enum { KEY_FIBRE = 1, KEY_WEFT, KEY_WEAVE, KEY_CRIMP, KEY_SPREAD, KEY_TURN, KEY_INDEX, KEY_METAL, KEY_COLOR, KEY_NAME };

typedef struct predict_input {
    const char *weave, *weft, *samples, *output;
    tsuya_predict_options options;
} predict_input;

static const struct argp_option predict_options[] = {
    {"fibre", KEY_FIBRE, "SECTION", 0, "circle, ellipse, triangle (default), rounded-triangle, trilobal, hollow or ribbon", 0},
    {"weft-fibre", KEY_WEFT, "SECTION", 0, "The weft's, where it differs", 0},
    {"weave", KEY_WEAVE, "WEAVE", 0, "plain, twill-N/M, satin-N (default satin-5), satin-N/S, sateen-N/S, or a draft FILE.wif", 0},
    {"crimp", KEY_CRIMP, "DEG", 0, "Steepest rise of a yarn where it dives (default 30)", 0},
    {"spread", KEY_SPREAD, "DEG", 0, "Spread of the fibres' directions along the yarn, one standard deviation (default 4; spun yarn about 12)", 0},
    {"turn", KEY_TURN, "DEG", 0, "Spread of the section's turn about the fibre (default 10)", 0},
    {"index", KEY_INDEX, "ETA", 0, "Refractive index (default 1.54, polyester and silk)", 0},
    {"metal", KEY_METAL, "COLOR", 0, "Mirror reflectance of metal-wrapped yarn instead: \"#rrggbb\" or \"r,g,b\" in linear light", 0},
    {"color", KEY_COLOR, "COLOR", 0, "Dye under the surface (default black)", 0},
    {"name", KEY_NAME, "NAME", 0, "Name of the material (default: fibre and weave)", 0},
    {"output", 'o', "PATH", 0, "MATERIAL.json, or a folder (default: the current one)", 0},
    {0},
};

static error_t parse_predict(int key, char *arg, struct argp_state *state)
{
    predict_input *input = state->input;
    tsuya_predict_yarn *warp = &input->options.warp;
    switch (key) {
    case KEY_FIBRE: warp->section = arg; return 0;
    case KEY_WEFT: input->weft = arg; return 0;
    case KEY_WEAVE: input->weave = arg; return 0;
    case KEY_CRIMP: warp->crimp_deg = tsuya_argument_number(state, "--crimp", arg, 0.0, 80.0); return 0;
    case KEY_SPREAD: warp->along_deg = tsuya_argument_number(state, "--spread", arg, 0.5, 60.0); return 0;
    case KEY_TURN: warp->turn_deg = tsuya_argument_number(state, "--turn", arg, 0.5, 180.0); return 0;
    case KEY_INDEX: warp->eta = tsuya_argument_number(state, "--index", arg, 1.01, 4.0); return 0;
    case KEY_METAL: tsuya_brdf_parse_color(warp->metal, "--metal", arg, state); return 0;
    case KEY_COLOR: tsuya_brdf_parse_color(input->options.dye, "--color", arg, state); return 0;
    case KEY_NAME: input->options.name = arg; return 0;
    case 'o': input->output = arg; return 0;
    case ARGP_KEY_ARG:
        if (input->samples) {
            argp_error(state, "'%s': one table of samples only", arg);
        }
        input->samples = arg;
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const tsuya_syntax predict_syntax = {
    .arguments = "[SAMPLES.csv]",
    .example = "tsuya brdf predict --fibre triangle --weave satin-8/3 -o satin.json",
    .doc = "Reflectance from the fibre's cross-section and the weave alone: the distribution of facet normals is the section's across the yarn and the "
           "yarn's path along it. Given measured samples, predicted.png shows both side by side.",
    .options = predict_options,
    .parse = parse_predict,
};

static tsuya_status compare(tsuya_json *out, const char *folder, const tsuya_material *m, const predict_input *input)
{
    tsuya_samples s;
    tsuya_plot_data data = {0};
    tsuya_predict_match match;
    char *path = NULL;
    TSUYA_TRY(tsuya_samples_load(&s, input->samples));
    tsuya_status status = TSUYA_OK;
    tsuya_brdf_picture picture = {.material = m, .samples = &s, .bench = tsuya_plot_bench_default(), .title = input->options.name, .scale = 1.0};
    if (s.channel_count != 3) {
        TSUYA_GOTO_DONE(status, tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d channels; the prediction has r, g, b", input->samples, s.channel_count));
    }
    tsuya_plot_bench_of(&picture.bench, &s);
    TSUYA_GOTO_DONE(status, tsuya_plot_data_create(&data, &picture));
    TSUYA_GOTO_DONE(status, tsuya_predict_hold_against(&match, m, &s));
    if (match.error_cbrt < 0.99 * match.error_body_alone) {
        picture.scale = match.scale;
        picture.body = match.body[data.sample_channel];
    } else { /* next to such a body the prediction would not be seen at all */
        tsuya_warn("%s: the prediction explains no more of it than a dull cloth does, e_cbrt %.3g of %.3g; predicted.png shows it without a body. Are fibre, weave and "
                   "the side that is up (satin, sateen) this cloth's?",
                   input->samples, match.error_cbrt, match.error_body_alone);
        picture.scale = match.scale_without_body;
    }
    path = tsuya_path_join(folder, "predicted.png");
    TSUYA_GOTO_DONE(status, path ? tsuya_plot_pair(path, &picture, &data) : TSUYA_ERROR_MEMORY);
    tsuya_json_set_number(out, "scale", match.scale);
    tsuya_json_set_numbers(out, "body", match.body, 3);
    tsuya_json_set_number(out, "error_cbrt", match.error_cbrt);
    tsuya_json_set_number(out, "error_cbrt_without_body", match.error_without_body);
    tsuya_json_set_number(out, "error_cbrt_body_alone", match.error_body_alone);
    tsuya_json_set_text(out, "picture", path);
done:
    tsuya_free(path);
    tsuya_plot_data_free(&data);
    tsuya_samples_free(&s);
    return status;
}

static tsuya_status predict(predict_input *input, const tsuya_common *common)
{
    tsuya_draft draft = {0};
    tsuya_material *material = NULL;
    tsuya_json *out = tsuya_json_create_object();
    char *folder = NULL, *file = NULL, name[128];
    double density[TSUYA_PREDICT_BINS], share;
    tsuya_status status = out ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    if (!out) {
        return status;
    }
    snprintf(name, sizeof name, "%.40s %.60s", input->options.warp.section, tsuya_path_name(input->weave));
    input->options.name = input->options.name ? input->options.name : name;
    input->options.weft = input->options.warp;
    input->options.weft.section = input->weft ? input->weft : input->options.warp.section;
    TSUYA_GOTO_DONE(status, tsuya_draft_create(&draft, input->weave));
    TSUYA_GOTO_DONE(status, tsuya_predict(&material, &draft, &input->options));
    TSUYA_GOTO_DONE(status, tsuya_command_output(&folder, &file, input->output, ".json", "material.json"));
    TSUYA_GOTO_DONE(status, tsuya_material_save(material, file));
    tsuya_predict_along(density, &share, &draft, true, &input->options.warp);
    tsuya_json_set_text(out, "material", file);
    tsuya_json_set_number(out, "ends", draft.ends);
    tsuya_json_set_number(out, "picks", draft.picks);
    tsuya_json_set_number(out, "warp_share", share);
    if (input->samples) {
        TSUYA_GOTO_DONE(status, compare(out, folder, material, input));
    }
    status = tsuya_command_figures(common, out);
done:
    tsuya_json_free(out);
    tsuya_material_free(material);
    tsuya_draft_free(&draft);
    tsuya_free(folder);
    tsuya_free(file);
    return status;
}

int tsuya_command_brdf_predict(int argc, char **argv)
{
    tsuya_common common;
    predict_input input = {.weave = "satin-5", .options = tsuya_predict_options_default()};
    input.options.name = NULL;
    tsuya_command_parse(&predict_syntax, &common, &input, argc, argv);
    tsuya_command_context(&common);
    tsuya_status status = predict(&input, &common);
    return status == TSUYA_OK ? TSUYA_EXIT_OK : tsuya_command_failed(status);
}
