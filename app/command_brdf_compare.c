/* tsuya brdf compare SAMPLES.csv */
#include "app/brdf_figures.h"
#include "app/brdf_plot.h"
#include "app/brdf_samples.h"
#include "app/command.h"
#include "app/terminal.h"
#include "core/file.h"

#include <math.h>
#include <string.h>

enum { KEY_TRUTH = 1, TRUTHS = 8 };

typedef struct compare_input {
    const char *output, *truth[TRUTHS + 1];
    tsuya_samples_source samples;
} compare_input;

static const struct argp_option compare_options[] = {
    {"truth", KEY_TRUTH, "TABLE.csv", 0, "Samples that no model is fitted to, to hold every model against; repeatable", 0},
    {"with", TSUYA_KEY_WITH, "SPECTRA.csv", 0, TSUYA_BRDF_WITH_HELP, 0},
    {"channels", TSUYA_KEY_CHANNELS, "own|rgb", 0, TSUYA_BRDF_CHANNELS_HELP, 0},
    {"output", 'o', "PATH", 0, "Table as PATH.csv and its picture PATH.png, or a folder for compare.csv (default: the current one)", 0},
    {0},
};

static error_t parse_compare(int key, char *arg, struct argp_state *state)
{
    compare_input *input = state->input;
    switch (key) {
    case KEY_TRUTH: tsuya_argument_append(state, input->truth, TRUTHS, arg); return 0;
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

static const tsuya_syntax compare_syntax = {
    .arguments = "SAMPLES.csv",
    .example = "tsuya brdf compare satin.csv -o satin/",
    .doc = "Fits every model to the same samples and prints the error on held-out samples beside time and size; writes the same as a table and as a "
           "picture.",
    .options = compare_options,
    .parse = parse_compare,
};

typedef struct row {
    tsuya_fit_info info;
    double truth[TRUTHS]; /* e_cbrt */
} row;

static tsuya_status hold_against(double *error, const tsuya_material *material, const tsuya_samples *truth)
{
    double *predicted = tsuya_calloc((size_t)truth->count * (size_t)truth->channel_count, sizeof *predicted);
    if (!predicted) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_material_predict(predicted, material, truth);
    *error = tsuya_samples_error(truth, predicted, -1).cbrt;
    tsuya_free(predicted);
    return TSUYA_OK;
}

static tsuya_status fill_row(row *r, const tsuya_samples *samples, const tsuya_samples *truth, int truths, const char *model,
                             const tsuya_context *context)
{
    tsuya_fit_options options = {.name = model, .model = model, .tolerance = NAN};
    tsuya_material *material;
    TSUYA_TRY(tsuya_brdf_fit(&material, &r->info, NULL, NULL, samples, &options, context));
    tsuya_status status = TSUYA_OK;
    for (int k = 0; k < truths && status == TSUYA_OK; ++k) {
        status = hold_against(&r->truth[k], material, &truth[k]);
    }
    tsuya_material_free(material);
    return status;
}

static void print_head(FILE *f, const char *gap, const compare_input *input)
{
    fprintf(f, "model%sfit_cbrt%stilts_cbrt%sazimuth_cbrt%sheldout_cbrt%sheldout_log%seval_ns%sbytes%sseconds%sreciprocity%sfurnace", gap, gap, gap, gap, gap, gap, gap, gap, gap, gap);
    for (int k = 0; input->truth[k]; ++k) {
        fprintf(f, "%s%s", gap, tsuya_path_name(input->truth[k]));
    }
    fprintf(f, "\n");
}

static void print_number(FILE *f, const char *gap, const char *format, double value)
{
    fprintf(f, "%s", gap);
    if (isfinite(value)) {
        fprintf(f, format, value);
    }
}

static void print_row(FILE *f, const char *gap, const row *r, int truths)
{
    const tsuya_fit_info *i = &r->info;
    fprintf(f, "%s", i->model);
    const double errors[] = {i->fit.cbrt, i->heldout_tilts.cbrt, i->heldout_azimuth.cbrt, i->heldout.cbrt, i->heldout.log};
    for (int k = 0; k < 5; ++k) {
        print_number(f, gap, "%.4f", errors[k]);
    }
    print_number(f, gap, "%.2f", i->eval_ns);
    print_number(f, gap, "%.0f", (double)i->bytes);
    print_number(f, gap, "%.2f", i->seconds);
    print_number(f, gap, "%.2g", i->reciprocity_deficit);
    print_number(f, gap, "%.4f", i->furnace);
    for (int k = 0; k < truths; ++k) {
        print_number(f, gap, "%.4f", r->truth[k]);
    }
    fprintf(f, "\n");
}

static tsuya_status write_csv(const char *file, const row *rows, int count, int truths, const compare_input *input)
{
    tsuya_file_writer writer;
    TSUYA_TRY(tsuya_file_begin(&writer, file));
    print_head(writer.stream, ",", input);
    for (int k = 0; k < count; ++k) {
        print_row(writer.stream, ",", &rows[k], truths);
    }
    return tsuya_file_commit(&writer);
}

static tsuya_status report(const row *rows, int count, int truths, const compare_input *input, const tsuya_common *common)
{
    tsuya_terminal_end_line();
    bool json_on_stdout = common->json_path && strcmp(common->json_path, "-") == 0;
    if (!json_on_stdout) {
        print_head(stdout, "\t", input);
        for (int k = 0; k < count; ++k) {
            print_row(stdout, "\t", &rows[k], truths);
        }
    }
    if (!common->json_path) {
        return TSUYA_OK;
    }
    tsuya_json *figures = tsuya_json_create_object();
    if (!figures) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_json *models = tsuya_json_set_array(figures, "models");
    for (int k = 0; k < count; ++k) {
        tsuya_json *one = tsuya_json_add_object(models);
        tsuya_brdf_figures(one, &rows[k].info);
        tsuya_json *truth = tsuya_json_set_object(one, "error_truth");
        for (int t = 0; t < truths; ++t) {
            tsuya_json_set_number(truth, tsuya_path_name(input->truth[t]), rows[k].truth[t]);
        }
    }
    tsuya_status status = json_on_stdout ? tsuya_command_figures(common, figures) : tsuya_json_save(figures, common->json_path);
    tsuya_json_free(figures);
    return status;
}

/* The errors that some model has, model by model; returns how many. */
static int errors(double *value, const char **name, const row *rows, int count, int truths, const compare_input *input)
{
    static const char *const own_name[3] = {"fit", "held-out tilts", "held-out azimuth"};
    double all[3 + TRUTHS][TSUYA_FIT_MODELS];
    int series = 0;
    for (int s = 0; s < 3 + truths; ++s) {
        bool any = false;
        for (int m = 0; m < count; ++m) {
            const tsuya_fit_info *i = &rows[m].info;
            const double own[3] = {i->fit.cbrt, i->heldout_tilts.cbrt, i->heldout_azimuth.cbrt};
            all[series][m] = s < 3 ? own[s] : rows[m].truth[s - 3];
            any |= isfinite(all[series][m]);
        }
        name[series] = s < 3 ? own_name[s] : tsuya_path_name(input->truth[s - 3]);
        series += any;
    }
    for (int m = 0; m < count; ++m) {
        for (int s = 0; s < series; ++s) {
            value[m * series + s] = all[s][m];
        }
    }
    return series;
}

/* compare.png beside compare.csv */
static tsuya_status draw(const char *csv, const row *rows, int count, int truths, const compare_input *input)
{
    const char *model[TSUYA_FIT_MODELS], *name[3 + TRUTHS];
    double value[TSUYA_FIT_MODELS * (3 + TRUTHS)], ns[TSUYA_FIT_MODELS];
    int series = errors(value, name, rows, count, truths, input), stem = (int)(strlen(csv) - strlen(tsuya_path_extension(csv)));
    for (int m = 0; m < count; ++m) {
        model[m] = rows[m].info.model;
        ns[m] = rows[m].info.eval_ns;
    }
    char *path = tsuya_calloc((size_t)stem + 5, 1);
    if (!path) {
        return TSUYA_ERROR_MEMORY;
    }
    snprintf(path, (size_t)stem + 5, "%.*s.png", stem, csv);
    tsuya_status status = tsuya_plot_errors(path, &(tsuya_plot_bars){count, series, model, name, value, ns});
    tsuya_free(path);
    return status;
}

static tsuya_status load_all(tsuya_samples *samples, tsuya_samples *truth, int *truths, const compare_input *input, const tsuya_context *context)
{
    tsuya_join_info joined;
    TSUYA_TRY(tsuya_brdf_samples(samples, &joined, &input->samples, context));
    for (*truths = 0; input->truth[*truths]; ++*truths) {
        tsuya_samples_source source = {.path = input->truth[*truths], .channels = input->samples.channels};
        TSUYA_TRY(tsuya_brdf_samples(&truth[*truths], &joined, &source, context));
        if (truth[*truths].channel_count != samples->channel_count) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d channels; %s has %d", input->truth[*truths], truth[*truths].channel_count,
                              input->samples.path, samples->channel_count);
        }
    }
    return TSUYA_OK;
}

static tsuya_status compare(const compare_input *input, const tsuya_common *common)
{
    tsuya_context context = tsuya_command_context(common);
    tsuya_samples samples = {0}, truth[TRUTHS] = {{0}};
    row rows[TSUYA_FIT_MODELS];
    char *folder = NULL, *file = NULL;
    int truths = 0, count = 0;
    const char *const *names = tsuya_fit_model_names();
    tsuya_status status;
    TSUYA_GOTO_DONE(status, load_all(&samples, truth, &truths, input, &context));
    TSUYA_GOTO_DONE(status, tsuya_command_output(&folder, &file, input->output, ".csv", "compare.csv"));
    for (int k = 1; names[k]; ++k, ++count) {
        tsuya_progress_update(&context, "compare", count, TSUYA_FIT_MODELS, names[k]);
        TSUYA_GOTO_DONE(status, fill_row(&rows[count], &samples, truth, truths, names[k], &context));
    }
    TSUYA_GOTO_DONE(status, write_csv(file, rows, count, truths, input));
    TSUYA_GOTO_DONE(status, draw(file, rows, count, truths, input));
    status = report(rows, count, truths, input, common);
done:
    for (int k = 0; k < TRUTHS; ++k) {
        tsuya_samples_free(&truth[k]);
    }
    tsuya_samples_free(&samples);
    tsuya_free(folder);
    tsuya_free(file);
    return status;
}

int tsuya_command_brdf_compare(int argc, char **argv)
{
    tsuya_common common;
    compare_input input = {0};
    tsuya_command_parse(&compare_syntax, &common, &input, argc, argv);
    tsuya_status status = compare(&input, &common);
    return status == TSUYA_OK ? TSUYA_EXIT_OK : tsuya_command_failed(status);
}
