#include "app/command.h"

#include "app/terminal.h"
#include "core/file.h"
#include "core/table.h"

#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { KEY_THREADS = 0x1000, KEY_SEED, KEY_JSON, KEY_QUIET, KEY_HELP, KEY_VERSION, MAX_NAMES = 64 };

static const struct argp_option common_options[] = {
    {0, 0, 0, 0, "Every command:", -1},
    {"threads", KEY_THREADS, "N", 0, "Threads to use (default: all cores); no result depends on it", 0},
    {"seed", KEY_SEED, "N", 0, "Seed of every random choice (default 1)", 0},
    {"json", KEY_JSON, "FILE", 0, "Write the figures of the summary to FILE ('-': to stdout, instead of the summary)", 0},
    {"quiet", KEY_QUIET, 0, 0, "No progress and no notes; warnings and errors stay", 0},
    {"help", KEY_HELP, 0, 0, "Print this help", 0},
    {"version", KEY_VERSION, 0, 0, "Print the version", 0},
    {0},
};

typedef struct parse_state {
    const tsuya_syntax *syntax;
    tsuya_common *common;
    void *input;
} parse_state;

int tsuya_argument_int(struct argp_state *state, const char *option, const char *text, int low, int high)
{
    long long value;
    if (!tsuya_parse_int(&value, text) || value < low || value > high) {
        argp_error(state, "%s: '%s' is not a whole number from %d to %d", option, text, low, high);
        return low;
    }
    return (int)value;
}

double tsuya_argument_number(struct argp_state *state, const char *option, const char *text, double low, double high)
{
    double value;
    if (!tsuya_parse_number(&value, text) || value < low || value > high) {
        argp_error(state, "%s: '%s' is not a number from %g to %g", option, text, low, high);
        return low;
    }
    return value;
}

void tsuya_argument_append(struct argp_state *state, const char **list, int capacity, const char *value)
{
    for (int i = 0; i < capacity; i++) {
        if (!list[i]) {
            list[i] = value;
            return;
        }
    }
    argp_error(state, "'%s': more than %d of a kind", value, capacity);
}

bool tsuya_parse_size(int *width_px, int *height_px, const char *text)
{
    char copy[64];
    if (strlen(text) >= sizeof copy) {
        return false;
    }
    strcpy(copy, text);
    char *separator = strpbrk(copy, "x,");
    if (!separator) {
        return false;
    }
    *separator = '\0';
    long long width, height;
    if (!tsuya_parse_int(&width, copy) || !tsuya_parse_int(&height, separator + 1) || width < 1 || height < 1 ||
        width > 65535 || height > 65535) {
        return false;
    }
    *width_px = (int)width;
    *height_px = (int)height;
    return true;
}

static void print_help(const tsuya_syntax *syntax, struct argp_state *state)
{
    printf("Example:\n  %s\n\n", syntax->example);
    argp_state_help(state, stdout, ARGP_HELP_USAGE | ARGP_HELP_LONG | ARGP_HELP_DOC);
    printf("\n");
    exit(TSUYA_EXIT_OK);
}

static error_t parse_seed(struct argp_state *state, tsuya_common *common, const char *text)
{
    long long value;
    if (!tsuya_parse_int(&value, text) || value < 0) {
        argp_error(state, "--seed: '%s' is not a whole number from 0", text);
    } else {
        common->seed = (uint64_t)value;
    }
    return 0;
}

static error_t parse_common(int key, char *arg, struct argp_state *state)
{
    parse_state *parse = state->input;
    switch (key) {
    case ARGP_KEY_INIT:
        if (parse->syntax->parse) {
            state->child_inputs[0] = parse->input;
        }
        return 0;
    case KEY_THREADS: parse->common->threads = tsuya_argument_int(state, "--threads", arg, 1, 1024); return 0;
    case KEY_SEED: return parse_seed(state, parse->common, arg);
    case KEY_JSON: parse->common->json_path = arg; return 0;
    case KEY_QUIET: parse->common->quiet = true; return 0;
    case KEY_HELP: print_help(parse->syntax, state); return 0;
    case KEY_VERSION: printf("tsuya %s\n", TSUYA_VERSION); exit(TSUYA_EXIT_OK);
    default: return ARGP_ERR_UNKNOWN;
    }
}

static int gather_names(const char **names, int count, const struct argp_option *options)
{
    for (const struct argp_option *o = options; o && (o->name || o->key || o->doc || o->group); o++) {
        if (o->name && count < MAX_NAMES) {
            names[count++] = o->name;
        }
    }
    return count;
}

static bool option_wants_value(const struct argp_option *options, const char *name)
{
    for (const struct argp_option *o = options; o && (o->name || o->key || o->doc || o->group); o++) {
        if (o->name && strcmp(o->name, name) == 0) {
            return o->arg != NULL && !(o->flags & OPTION_ARG_OPTIONAL);
        }
    }
    return false;
}

/* getopt would only say "unrecognized option". */
static void refuse_unknown_options(const tsuya_syntax *syntax, int argc, char **argv)
{
    const char *names[MAX_NAMES + 1] = {0};
    int count = gather_names(names, gather_names(names, 0, common_options), syntax->options);
    for (int i = 1; i < argc && strcmp(argv[i], "--") != 0; i++) {
        if (strncmp(argv[i], "--", 2) != 0) {
            continue;
        }
        char name[128];
        size_t length = strcspn(argv[i] + 2, "=");
        if (length >= sizeof name) {
            length = sizeof name - 1;
        }
        memcpy(name, argv[i] + 2, length);
        name[length] = '\0';
        bool known = false;
        for (int n = 0; n < count && !known; n++) {
            known = strncmp(names[n], name, length) == 0;
        }
        if (!known) {
            const char *nearest = tsuya_nearest_name(name, names);
            tsuya_terminal_say("unknown option '--%s'%s%s%s; '%s --help' lists them", name,
                               nearest ? ", did you mean '--" : "", nearest ? nearest : "", nearest ? "'?" : "", argv[0]);
            exit(TSUYA_EXIT_USAGE);
        }
        if (!strchr(argv[i], '=') && (option_wants_value(common_options, name) || option_wants_value(syntax->options, name))) {
            i++;
        }
    }
}

void tsuya_command_parse(const tsuya_syntax *syntax, tsuya_common *common, void *input, int argc, char **argv)
{
    *common = (tsuya_common){.seed = tsuya_context_default().seed};
    refuse_unknown_options(syntax, argc, argv);
    struct argp own = {.options = syntax->options, .parser = syntax->parse};
    struct argp_child children[] = {{.argp = &own, .group = -2}, {0}};
    struct argp root = {
        .options = common_options,
        .parser = parse_common,
        .args_doc = syntax->arguments,
        .doc = syntax->doc,
        .children = syntax->parse ? children : NULL,
    };
    parse_state parse = {syntax, common, input};
    argp_err_exit_status = TSUYA_EXIT_USAGE;
    argp_parse(&root, argc, argv, ARGP_NO_HELP, NULL, &parse);
    tsuya_terminal_set_quiet(common->quiet);
}

tsuya_context tsuya_command_context(const tsuya_common *common)
{
    tsuya_context context = tsuya_context_default();
    context.seed = common->seed;
    context.progress = tsuya_terminal_progress;
    if (common->threads > 0) {
        context.threads = common->threads;
    }
    omp_set_num_threads(context.threads);
    return context;
}

static void print_value(const tsuya_json *value)
{
    if (tsuya_json_is_number(value)) {
        printf("%.6g", tsuya_json_number_or(value, 0.0));
    } else if (tsuya_json_is_array(value)) {
        const char *gap = "";
        for (const tsuya_json *e = tsuya_json_first(value); e; e = tsuya_json_next(e), gap = " ") {
            printf("%s", gap);
            print_value(e);
        }
    } else {
        printf("%s", tsuya_json_text_or(value, "-"));
    }
}

/* One line a figure; what is nested reads "accuracy_m.median". */
static void print_figures(const tsuya_json *object, const char *prefix)
{
    for (const tsuya_json *m = tsuya_json_first(object); m; m = tsuya_json_next(m)) {
        char name[160];
        bool flag;
        snprintf(name, sizeof name, "%s%s%s", prefix, prefix[0] ? "." : "", tsuya_json_key(m));
        if (tsuya_json_is_object(m)) {
            print_figures(m, name);
        } else if (tsuya_json_is_array(m) && tsuya_json_is_object(tsuya_json_first(m))) {
            printf("%-36s %d entries\n", name, tsuya_json_count(m));
        } else if (tsuya_json_is_number(m) || tsuya_json_is_text(m) || tsuya_json_is_null(m) || tsuya_json_is_array(m)) {
            printf("%-36s ", name);
            print_value(m);
            printf("\n");
        } else if (tsuya_json_get_bool(&flag, object, tsuya_json_key(m)) == TSUYA_OK) {
            printf("%-36s %s\n", name, flag ? "yes" : "no");
        }
    }
}

tsuya_status tsuya_command_figures(const tsuya_common *common, const tsuya_json *figures)
{
    tsuya_terminal_end_line();
    if (common->json_path && strcmp(common->json_path, "-") == 0) {
        char *text;
        TSUYA_TRY(tsuya_json_print(&text, figures));
        fputs(text, stdout);
        tsuya_free(text);
    } else {
        print_figures(figures, "");
        if (common->json_path) {
            TSUYA_TRY(tsuya_json_save(figures, common->json_path));
        }
    }
    if (fflush(stdout) != 0) {
        return tsuya_fail_errno("stdout", "write");
    }
    return TSUYA_OK;
}

int tsuya_command_failed(tsuya_status status)
{
    if (status == TSUYA_ERROR_INTERRUPTED) {
        tsuya_terminal_say("interrupted; finished work is kept");
    } else {
        tsuya_terminal_say("%s", tsuya_reason());
    }
    return TSUYA_EXIT_FAILURE;
}

tsuya_status tsuya_command_output(char **folder, char **file, const char *path, const char *extension,
                                  const char *default_name)
{
    bool names_file = path && strcmp(tsuya_path_extension(path), extension) == 0;
    *folder = names_file ? tsuya_path_folder(path) : tsuya_strdup(path ? path : ".");
    *file = NULL;
    if (*folder) {
        *file = names_file ? tsuya_strdup(path) : tsuya_path_join(*folder, default_name);
    }
    if (!*file) {
        tsuya_free(*folder);
        *folder = NULL;
        return TSUYA_ERROR_MEMORY;
    }
    return tsuya_folder_make(*folder);
}
