/* tsuya brdf plan */
#include "app/brdf_plot.h"
#include "app/command.h"
#include "brdf/fit.h"
#include "brdf/plan.h"
#include "brdf/predict.h"
#include "core/file.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { KEY_FIBRE = 1, KEY_WEAVE, KEY_READINGS, KEY_AZIMUTH, KEY_TILT, KEY_MOST, KEY_NOISE };

typedef struct plan_input {
    const char *fibre, *weave, *material, *samples, *output;
    tsuya_plan_options options;
} plan_input;

static const struct argp_option plan_options[] = {
    {"fibre", KEY_FIBRE, "SECTION", 0, "Predict from this cross-section (default triangle), as tsuya brdf predict does, and", 0},
    {"weave", KEY_WEAVE, "WEAVE", 0, "this weave (default satin-5), where neither material nor readings are given", 0},
    {"readings", KEY_READINGS, "N", 0, "Readings to choose (default 132; with readings so far 33)", 0},
    {"azimuth-step", KEY_AZIMUTH, "DEG", 0, "Azimuths that the stage can take (default every 7.5°)", 0},
    {"tilt-step", KEY_TILT, "DEG", 0, "Tilts that it can take (default every 1.5°)", 0},
    {"tilt-most", KEY_MOST, "DEG", 0, "Largest tilt to either side (default 48)", 0},
    {"noise", KEY_NOISE, "E", 0, "Relative noise of a reading (default 0.01)", 0},
    {"output", 'o', "PATH", 0, "PATH.csv, or a folder for plan.csv (default: the current one)", 0},
    {0},
};

static error_t parse_plan(int key, char *arg, struct argp_state *state)
{
    plan_input *input = state->input;
    switch (key) {
    case KEY_FIBRE: input->fibre = arg; return 0;
    case KEY_WEAVE: input->weave = arg; return 0;
    case KEY_READINGS: input->options.readings = tsuya_argument_int(state, "--readings", arg, 1, 8000); return 0;
    case KEY_AZIMUTH: input->options.azimuth_step_deg = tsuya_argument_number(state, "--azimuth-step", arg, 0.1, 180.0); return 0;
    case KEY_TILT: input->options.tilt_step_deg = tsuya_argument_number(state, "--tilt-step", arg, 0.1, 45.0); return 0;
    case KEY_MOST: input->options.tilt_most_deg = tsuya_argument_number(state, "--tilt-most", arg, 1.0, 89.0); return 0;
    case KEY_NOISE: input->options.noise = tsuya_argument_number(state, "--noise", arg, 1e-5, 1.0); return 0;
    case 'o': input->output = arg; return 0;
    case ARGP_KEY_ARG: {
        const char **slot = strcmp(tsuya_path_extension(arg), ".json") == 0 ? &input->material : &input->samples;
        if (*slot) {
            argp_error(state, "'%s': one MATERIAL.json and one table of readings at most", arg);
        }
        *slot = arg;
        return 0;
    }
    case ARGP_KEY_END:
        if ((input->fibre || input->weave) && (input->material || input->samples)) {
            argp_error(state, "--fibre and --weave predict; a material or readings take their place");
        }
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const tsuya_syntax plan_syntax = {
    .arguments = "[MATERIAL.json] [READINGS.csv]",
    .example = "tsuya brdf plan --fibre triangle --weave satin-5 --readings 66 -o plan.csv",
    .doc = "Chooses the stage angles whose readings lower the expected error over all positions of the bench most: from names of fibre and weave, from a "
           "material, or from the readings so far, to which a model is fitted. Writes azimuth_deg,tilt_deg,gain, by azimuth and tilt.",
    .options = plan_options,
    .parse = parse_plan,
};

static tsuya_status guess(tsuya_material **m, const plan_input *input, const tsuya_samples *taken, const tsuya_context *context)
{
    if (input->material) {
        return tsuya_material_load(m, input->material);
    }
    if (taken->count > 0) {
        tsuya_fit_info info;
        tsuya_fit_options options = {.name = tsuya_path_name(input->samples), .model = "yarn", .tolerance = NAN};
        return tsuya_brdf_fit(m, &info, NULL, NULL, taken, &options, context);
    }
    tsuya_predict_options options = tsuya_predict_options_default();
    tsuya_draft draft;
    options.warp.section = options.weft.section = input->fibre ? input->fibre : options.warp.section;
    TSUYA_TRY(tsuya_draft_create(&draft, input->weave ? input->weave : "satin-5"));
    tsuya_status status = tsuya_predict(m, &draft, &options);
    tsuya_draft_free(&draft);
    return status;
}

static int by_place(const void *a, const void *b)
{
    const tsuya_plan_reading *p = a, *q = b;
    return p->azimuth_deg != q->azimuth_deg ? (p->azimuth_deg > q->azimuth_deg) - (p->azimuth_deg < q->azimuth_deg)
                                            : (p->tilt_deg > q->tilt_deg) - (p->tilt_deg < q->tilt_deg);
}

static tsuya_status write_plan(const char *file, const tsuya_plan_reading *r, const tsuya_plan_options *o)
{
    tsuya_file_writer w;
    TSUYA_TRY(tsuya_file_begin(&w, file));
    fprintf(w.stream, "# light_theta_deg=%.6g\n# light_phi_deg=%.6g\n# view_theta_deg=%.6g\n# view_phi_deg=%.6g\nazimuth_deg,tilt_deg,gain\n", o->light_deg[0],
            o->light_deg[1], o->view_deg[0], o->view_deg[1]);
    for (int k = 0; k < o->readings; ++k) {
        fprintf(w.stream, "%.6g,%.6g,%.4g\n", r[k].azimuth_deg, r[k].tilt_deg, r[k].gain);
    }
    return tsuya_file_commit(&w);
}

static tsuya_status plan(plan_input *input, const tsuya_common *common)
{
    tsuya_context context = tsuya_command_context(common);
    tsuya_material *m = NULL;
    tsuya_samples taken = {0};
    tsuya_plan_info info;
    tsuya_plan_reading *chosen = NULL;
    tsuya_plot_bench bench = tsuya_plot_bench_default();
    tsuya_json *out = NULL;
    char *folder = NULL, *file = NULL;
    tsuya_status status = TSUYA_OK;
    if (input->samples) {
        TSUYA_GOTO_DONE(status, tsuya_samples_load(&taken, input->samples));
        tsuya_plot_bench_of(&bench, &taken);
    }
    memcpy(input->options.light_deg, bench.light_deg, sizeof bench.light_deg);
    memcpy(input->options.view_deg, bench.view_deg, sizeof bench.view_deg);
    input->options.readings = input->options.readings ? input->options.readings : input->samples ? 33 : 132;
    TSUYA_GOTO_DONE(status, guess(&m, input, &taken, &context));
    TSUYA_NEW(status, chosen, (size_t)input->options.readings);
    TSUYA_GOTO_DONE(status, tsuya_plan(chosen, &info, m, input->samples ? &taken : NULL, &input->options));
    qsort(chosen, (size_t)input->options.readings, sizeof *chosen, by_place);
    TSUYA_GOTO_DONE(status, tsuya_command_output(&folder, &file, input->output, ".csv", "plan.csv"));
    TSUYA_GOTO_DONE(status, write_plan(file, chosen, &input->options));
    out = tsuya_json_create_object();
    if (!out) {
        TSUYA_GOTO_DONE(status, TSUYA_ERROR_MEMORY);
    }
    tsuya_json_set_text(out, "plan", file);
    tsuya_json_set_number(out, "readings", input->options.readings);
    tsuya_json_set_number(out, "taken", taken.count);
    tsuya_json_set_number(out, "positions", info.positions);
    tsuya_json_set_number(out, "expected_before", info.expected_before);
    tsuya_json_set_number(out, "expected_after", info.expected_after);
    status = tsuya_command_figures(common, out);
done:
    tsuya_json_free(out);
    tsuya_free(chosen);
    tsuya_free(folder);
    tsuya_free(file);
    tsuya_samples_free(&taken);
    tsuya_material_free(m);
    return status;
}

int tsuya_command_brdf_plan(int argc, char **argv)
{
    tsuya_common common;
    plan_input input = {.options = tsuya_plan_options_default()};
    input.options.readings = 0;
    tsuya_command_parse(&plan_syntax, &common, &input, argc, argv);
    tsuya_status status = plan(&input, &common);
    return status == TSUYA_OK ? TSUYA_EXIT_OK : tsuya_command_failed(status);
}
