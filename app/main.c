/* tsuya: one program, a table of commands. */
#include "app/command.h"
#include "app/terminal.h"
#include "core/table.h"

#include <stdio.h>
#include <string.h>

static void print_commands(FILE *stream)
{
    fprintf(stream, "Example:\n  tsuya demo\n\nUsage: tsuya COMMAND [OPTION...]\n\n"
                    "Digitises draped garments: photographs to a mesh that shines like the cloth.\n\nCommands:\n");
    for (const tsuya_command *c = tsuya_commands; c->name; c++) {
        fprintf(stream, "  %-17s %s\n", c->name, c->summary);
    }
    fprintf(stream, "\n'tsuya COMMAND --help' explains one; --version prints the version.\n"
                    "Data and summaries go to stdout, progress and messages to stderr.\n"
                    "Exit status: 0 success, 1 failure, 2 wrong usage.\n");
}

static int run_command(const tsuya_command *command, int words, int argc, char **argv)
{
    static char name[64];
    snprintf(name, sizeof name, "tsuya %s", command->name);
    argv[words] = name;
    return command->run(argc - words, argv + words);
}

static int word_count(const char *name) { return strchr(name, ' ') ? 2 : 1; }

static bool is_command(const char *name, int argc, char **argv)
{
    if (word_count(name) == 1) {
        return strcmp(argv[1], name) == 0;
    }
    size_t first = strcspn(name, " ");
    return strlen(argv[1]) == first && strncmp(argv[1], name, first) == 0 && argc > 2 && strcmp(argv[2], name + first + 1) == 0;
}

/* "capture" alone: lists what begins with it. */
static bool list_group(const char *word)
{
    bool found = false;
    size_t length = strlen(word);
    for (const tsuya_command *c = tsuya_commands; c->name; c++) {
        if (strncmp(c->name, word, length) == 0 && c->name[length] == ' ') {
            fprintf(stderr, "%s  %-17s %s\n", found ? "" : "Commands:\n", c->name, c->summary);
            found = true;
        }
    }
    return found;
}

static int refuse_command(int argc, char **argv)
{
    char typed[160];
    bool two_words = argc > 2 && argv[2][0] != '-';
    snprintf(typed, sizeof typed, "%.60s%s%.60s", argv[1], two_words ? " " : "", two_words ? argv[2] : "");
    const char *names[64] = {0};
    int count = 0;
    for (const tsuya_command *c = tsuya_commands; c->name; c++) {
        names[count++] = c->name;
    }
    const char *nearest = tsuya_nearest_name(typed, names);
    if (!nearest) {
        nearest = tsuya_nearest_name(argv[1], names);
    }
    if (!nearest && list_group(argv[1])) {
        tsuya_terminal_say("'%s' needs a second word", argv[1]);
        return TSUYA_EXIT_USAGE;
    }
    tsuya_terminal_say("unknown command '%s'%s%s%s; 'tsuya --help' lists them", typed, nearest ? ", did you mean '" : "",
                       nearest ? nearest : "", nearest ? "'?" : "");
    return TSUYA_EXIT_USAGE;
}

int main(int argc, char **argv)
{
    tsuya_terminal_open();
    if (argc < 2) {
        print_commands(stderr);
        return TSUYA_EXIT_USAGE;
    }
    if (strcmp(argv[1], "--help") == 0 || strcmp(argv[1], "-h") == 0 || strcmp(argv[1], "help") == 0) {
        print_commands(stdout);
        return TSUYA_EXIT_OK;
    }
    if (strcmp(argv[1], "--version") == 0) {
        printf("tsuya %s\n", TSUYA_VERSION);
        return TSUYA_EXIT_OK;
    }
    for (const tsuya_command *c = tsuya_commands; c->name; c++) {
        if (is_command(c->name, argc, argv)) {
            return run_command(c, word_count(c->name), argc, argv);
        }
    }
    return refuse_command(argc, argv);
}
