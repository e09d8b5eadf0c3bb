/* tsuya run JOB.yaml */
#include "app/command.h"
#include "app/job_files.h"
#include "app/runner.h"
#include "app/terminal.h"
#include "core/table.h"

#include <stdio.h>

enum { KEY_FROM = 1, KEY_TO, KEY_DRY_RUN, KEY_FORCE };

typedef struct run_input {
    const char *path, *folder;
    tsuya_runner_options options;
} run_input;

static const struct argp_option run_options[] = {
    {"output", 'o', "DIR", 0, "Job folder (default: the folder of JOB.yaml)", 0},
    {"from", KEY_FROM, "STAGE", 0, "Begin with STAGE; the ones before must be finished, and are used as they are", 0},
    {"to", KEY_TO, "STAGE", 0, "End with STAGE", 0},
    {"dry-run", KEY_DRY_RUN, 0, 0, "Say which stages would run and why; write nothing", 0},
    {"force", KEY_FORCE, 0, 0, "Run the stages even where nothing changed", 0},
    {0},
};

static int stage_argument(struct argp_state *state, const char *option, const char *text)
{
    int index = tsuya_stage_find(text);
    if (index < 0) {
        const char *names[TSUYA_STAGE_COUNT + 1] = {0};
        for (int i = 0; i < TSUYA_STAGE_COUNT; i++) {
            names[i] = tsuya_stages[i].name;
        }
        const char *nearest = tsuya_nearest_name(text, names);
        argp_error(state, "%s: '%s' is no stage%s%s%s; stages: capture calib reconstruct weave brdf render report", option, text,
                   nearest ? ", did you mean '" : "", nearest ? nearest : "", nearest ? "'?" : "");
    }
    return index;
}

static error_t parse_run(int key, char *arg, struct argp_state *state)
{
    run_input *input = state->input;
    switch (key) {
    case 'o': input->folder = arg; return 0;
    case KEY_FROM: input->options.from = stage_argument(state, "--from", arg); return 0;
    case KEY_TO: input->options.to = stage_argument(state, "--to", arg); return 0;
    case KEY_DRY_RUN: input->options.dry_run = true; return 0;
    case KEY_FORCE: input->options.force = true; return 0;
    case ARGP_KEY_ARG:
        if (input->path) {
            argp_error(state, "'%s': one JOB.yaml only", arg);
        }
        input->path = arg;
        return 0;
    case ARGP_KEY_END:
        if (!input->path) {
            argp_error(state, "JOB.yaml is missing");
        }
        if (input->options.from > input->options.to) {
            argp_error(state, "--from %s comes after --to %s", tsuya_stages[input->options.from].name, tsuya_stages[input->options.to].name);
        }
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const tsuya_syntax run_syntax = {
    .arguments = "JOB.yaml",
    .example = "tsuya run docs/examples/asclepius/JOB.yaml -o out/asclepius",
    .doc = "Runs the stages of a job in order: capture calib reconstruct weave brdf render report. A stage runs again only "
           "if the hashes of its inputs, its options or its version changed; killing the program loses at most the running "
           "stage's work.\vThe keys of JOB.yaml are explained in docs/job.md. Results: DIR/report/index.html, and the "
           "folders of the stages beside it.",
    .options = run_options,
    .parse = parse_run,
};

int tsuya_command_run(int argc, char **argv)
{
    tsuya_common common;
    run_input input = {.options = tsuya_runner_options_default()};
    tsuya_command_parse(&run_syntax, &common, &input, argc, argv);
    tsuya_context context = tsuya_command_context(&common);
    tsuya_job job = {0};
    tsuya_json *result = tsuya_json_create_object();
    tsuya_status status = result ? tsuya_job_load(&job, input.path, input.folder) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        bool measured = input.options.to >= tsuya_stage_find("brdf"), rendered = input.options.to >= tsuya_stage_find("render");
        status = measured ? tsuya_job_check_files(&job, rendered) : TSUYA_OK;
    }
    if (status == TSUYA_OK) {
        status = tsuya_runner_run(result, &job, &input.options, &context);
    }
    if (status == TSUYA_OK && !input.options.dry_run) {
        status = tsuya_command_figures(&common, result);
        if (input.options.to == TSUYA_STAGE_COUNT - 1) {
            tsuya_terminal_log("report: %s/report/index.html", job.folder);
        }
    }
    tsuya_job_free(&job);
    tsuya_json_free(result);
    return status == TSUYA_OK ? TSUYA_EXIT_OK : tsuya_command_failed(status);
}
