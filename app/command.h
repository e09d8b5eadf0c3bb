/* The commands of the program: a table, and what they all share (argp options, help, figures). */
#ifndef TSUYA_APP_COMMAND_H
#define TSUYA_APP_COMMAND_H

#include "core/context.h"
#include "core/json.h"

#include <argp.h>

enum { TSUYA_EXIT_OK = 0, TSUYA_EXIT_FAILURE = 1, TSUYA_EXIT_USAGE = 2 };

typedef struct tsuya_command {
    const char *name;    /* one or two words: "run", "weave image" */
    const char *summary; /* one line for the list of commands */
    int (*run)(int argc, char **argv); /* argv[0] is "tsuya NAME"; returns the exit code */
} tsuya_command;

/* Options that every command has. */
typedef struct tsuya_common {
    int threads; /* 0: all cores */
    uint64_t seed;
    const char *json_path; /* NULL: none; "-": stdout, instead of the summary */
    bool quiet;
} tsuya_common;

typedef struct tsuya_syntax {
    const char *arguments; /* "MESH.ply" */
    const char *example;   /* opens the help; runs as it stands (after `tsuya demo` where it names demo/) */
    const char *doc;
    const struct argp_option *options; /* the command's own; NULL: none */
    argp_parser_t parse;               /* sees `input` as state->input */
} tsuya_syntax;

/* Parses argv; leaves the program with TSUYA_EXIT_USAGE on errors (naming the nearest known option) and with
 * TSUYA_EXIT_OK after --help and --version. */
void tsuya_command_parse(const tsuya_syntax *syntax, tsuya_common *common, void *input, int argc, char **argv);

/* Values of options; leave with TSUYA_EXIT_USAGE and name option, value and range. */
int tsuya_argument_int(struct argp_state *state, const char *option, const char *text, int low, int high);
double tsuya_argument_number(struct argp_state *state, const char *option, const char *text, double low, double high);
/* "WxH" or "W,H" */
bool tsuya_parse_size(int *width_px, int *height_px, const char *text);
/* Appends to a NULL-terminated list in static storage of `capacity` entries; usage error when it is full. */
void tsuya_argument_append(struct argp_state *state, const char **list, int capacity, const char *value);

tsuya_context tsuya_command_context(const tsuya_common *common);
/* The summary on stdout and --json.  `lead`: JSON keys in the order of the summary come as they stand in `figures`. */
tsuya_status tsuya_command_figures(const tsuya_common *common, const tsuya_json *figures) TSUYA_MUST_CHECK;
/* Says the reason of a failure; the exit code. */
int tsuya_command_failed(tsuya_status status);

/* `-o PATH` of stage commands: a PATH with `extension` names the main file, any other a folder, NULL the current folder.
 * Fresh strings (tsuya_free); the folder is made. */
TSUYA_MUST_CHECK tsuya_status tsuya_command_output(char **folder, char **file, const char *path, const char *extension,
                                                   const char *default_name);

extern const tsuya_command tsuya_commands[]; /* ends with a NULL name */

int tsuya_command_demo(int argc, char **argv);
int tsuya_command_run(int argc, char **argv);
int tsuya_command_capture_check(int argc, char **argv);
int tsuya_command_capture_simulate(int argc, char **argv);
int tsuya_command_capture_target(int argc, char **argv);
int tsuya_command_calib_camera(int argc, char **argv);
int tsuya_command_calib_compare(int argc, char **argv);
int tsuya_command_calib_color(int argc, char **argv);
int tsuya_command_calib_light(int argc, char **argv);
int tsuya_command_reconstruct(int argc, char **argv);
int tsuya_command_weave_image(int argc, char **argv);
int tsuya_command_weave_mesh(int argc, char **argv);
int tsuya_command_brdf_eval(int argc, char **argv);
int tsuya_command_brdf_fit(int argc, char **argv);
int tsuya_command_brdf_compare(int argc, char **argv);
int tsuya_command_brdf_gather(int argc, char **argv);
int tsuya_command_brdf_export(int argc, char **argv);
int tsuya_command_brdf_plan(int argc, char **argv);
int tsuya_command_brdf_plot(int argc, char **argv);
int tsuya_command_brdf_predict(int argc, char **argv);
int tsuya_command_render(int argc, char **argv);
int tsuya_command_bench(int argc, char **argv);

#endif
