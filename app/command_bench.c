/* tsuya bench: runs the bench programs that lie beside this one, gathers their points of error against cost, draws them. */
#include "app/bench_picture.h"
#include "app/command.h"
#include "app/terminal.h"
#include "core/file.h"
#include "core/memory.h"
#include "core/process.h"

#include <string.h>
#include <unistd.h>

typedef struct bench_stage { const char *name, *room; } bench_stage;

static const bench_stage stages[] = {
    {"capture", "capture"}, {"calib", "calib"}, {"reconstruct", "reconstruct"},
    {"weave", "weave_detect"}, {"brdf", "brdf"}, {"render", "render"},
};
enum { STAGES = sizeof stages / sizeof *stages };

typedef struct bench_input { const char *stage, *output; } bench_input;

static const struct argp_option options[] = {
    {"output", 'o', "FOLDER", 0, "Gets bench.csv, and of each stage STAGE.txt and STAGE.svg (default: the current folder)", 0},
    {0},
};

static error_t parse(int key, char *arg, struct argp_state *state)
{
    bench_input *input = state->input;
    switch (key) {
    case 'o': input->output = arg; return 0;
    case ARGP_KEY_ARG:
        for (int k = 0; k < STAGES && state->arg_num == 0; k++) {
            input->stage = strcmp(arg, stages[k].name) == 0 ? stages[k].name : input->stage;
        }
        if (!input->stage || state->arg_num > 0) {
            argp_error(state, "'%s': expected one of capture, calib, reconstruct, weave, brdf, render", arg);
        }
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const tsuya_syntax syntax = {
    .arguments = "[STAGE]",
    .example = "tsuya bench weave -o bench",
    .doc = "Speed against error, stage by stage (capture, calib, reconstruct, weave, brdf, render), with the peers that are installed in the same "
           "run. Takes minutes a stage; times are worth comparing only within one run.",
    .options = options,
    .parse = parse,
};

typedef struct bench_run {
    tsuya_bench_points points;
    tsuya_json *figures;
    const char *folder;
    const tsuya_common *common;
} bench_run;

/* An installed program has its benches in ../libexec/tsuya, one in its build folder in ../tests/ROOM. */
static char *find_program(const bench_stage *stage)
{
    char self[4096], path[4400];
    ssize_t length = readlink("/proc/self/exe", self, sizeof self - 1);
    if (length <= 0) {
        return NULL;
    }
    self[length] = '\0';
    *strrchr(self, '/') = '\0';
    snprintf(path, sizeof path, "%s/../libexec/tsuya/bench_%s", self, stage->name);
    if (access(path, X_OK) != 0) {
        snprintf(path, sizeof path, "%s/../tests/%s/bench_%s", self, stage->room, stage->name);
    }
    return access(path, X_OK) == 0 ? tsuya_strdup(path) : NULL;
}

typedef struct bench_lines { bench_run *run; const char *stage; tsuya_status status; } bench_lines;

static void take_line(void *user, const char *line)
{
    bench_lines *lines = user;
    if (strncmp(line, "point,", 6) != 0) {
        tsuya_terminal_log("%s", line);
    } else if (lines->status == TSUYA_OK) {
        lines->status = tsuya_bench_points_add(&lines->run->points, lines->stage, line + 6);
    }
}

static tsuya_status run_stage(bench_run *run, const bench_stage *stage, const char *program)
{
    char name[64];
    bench_lines lines = {run, stage->name, TSUYA_OK};
    tsuya_process_info info = {0};
    snprintf(name, sizeof name, "%s.txt", stage->name);
    char *log = tsuya_path_join(run->folder, name);
    if (!log) {
        return TSUYA_ERROR_MEMORY;
    }
    unlink(log);
    const char *argv[] = {program, NULL};
    tsuya_process_options process = {.log_path = log, .line = take_line, .line_user = &lines};
    size_t before = run->points.count;
    tsuya_terminal_log("bench %s", stage->name);
    tsuya_status status = tsuya_process_run(&info, argv, &process);
    tsuya_free(log);
    status = status == TSUYA_OK ? lines.status : status;
    tsuya_json *figures = tsuya_json_set_object(run->figures, stage->name);
    tsuya_json_set_number(figures, "points", (double)(run->points.count - before));
    tsuya_json_set_number(figures, "seconds", info.seconds);
    tsuya_json_set_number(figures, "peak_mb", info.peak_mb);
    tsuya_status drawn = run->points.count > before ? tsuya_bench_picture(&run->points, stage->name, run->folder) : TSUYA_OK;
    return status == TSUYA_OK ? drawn : status;
}

/* Every stage that is asked for; one that fails does not keep the others from being measured. */
static tsuya_status run_stages(bench_run *run, const char *only)
{
    tsuya_status status = TSUYA_OK;
    int ran = 0;
    for (int k = 0; k < STAGES; k++) {
        if (only && strcmp(only, stages[k].name) != 0) {
            continue;
        }
        char *program = find_program(&stages[k]);
        if (program) {
            tsuya_status ended = run_stage(run, &stages[k], program);
            tsuya_free(program);
            ran++;
            if (ended == TSUYA_ERROR_INTERRUPTED) {
                return ended;
            }
            if (ended != TSUYA_OK) {
                status = ended;
                tsuya_terminal_say("bench %s: %s", stages[k].name, tsuya_reason());
            }
        } else if (only) {
            return tsuya_fail(TSUYA_ERROR_UNAVAILABLE, "bench %s: no program bench_%s beside this one; expected in ../libexec/tsuya", only, only);
        }
    }
    return ran > 0 ? status : tsuya_fail(TSUYA_ERROR_UNAVAILABLE, "bench: no bench programs beside this one; expected in ../libexec/tsuya");
}

int tsuya_command_bench(int argc, char **argv)
{
    tsuya_common common;
    bench_input input = {0};
    tsuya_command_parse(&syntax, &common, &input, argc, argv);
    bench_run run = {.figures = tsuya_json_create_object(), .folder = input.output ? input.output : ".", .common = &common};
    tsuya_status status = run.figures ? tsuya_folder_make(run.folder) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        status = run_stages(&run, input.stage);
    }
    if (run.points.count > 0) {
        tsuya_status saved = tsuya_bench_points_save(&run.points, run.folder);
        status = status == TSUYA_OK ? saved : status;
    }
    if (status == TSUYA_OK) {
        status = tsuya_command_figures(&common, run.figures);
    }
    tsuya_bench_points_free(&run.points);
    tsuya_json_free(run.figures);
    return status == TSUYA_OK ? TSUYA_EXIT_OK : tsuya_command_failed(status);
}
