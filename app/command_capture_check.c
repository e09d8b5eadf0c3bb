/* tsuya capture check PHOTOS */
#include "app/command.h"
#include "app/terminal.h"
#include "capture/check.h"

#include <math.h>
#include <stdio.h>

enum { KEY_MASKS = 1 };

typedef struct check_input {
    const char *photos, *masks;
} check_input;

static const struct argp_option check_options[] = {
    {"masks", KEY_MASKS, "FOLDER", 0, "NAME.png or NAME.jpg.png; white is judged, black is ignored", 0},
    {0},
};

static error_t parse_check(int key, char *arg, struct argp_state *state)
{
    check_input *input = state->input;
    switch (key) {
    case KEY_MASKS: input->masks = arg; return 0;
    case ARGP_KEY_ARG:
        if (input->photos) {
            argp_error(state, "'%s': one folder of photographs only", arg);
        }
        input->photos = arg;
        return 0;
    case ARGP_KEY_END:
        if (!input->photos) {
            argp_error(state, "PHOTOS is missing");
        }
        return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const tsuya_syntax check_syntax = {
    .arguments = "PHOTOS",
    .example = "tsuya capture check demo/photos --masks demo/masks",
    .doc = "Says which photographs to take again: blurred, clipped, darker or of another colour than the others, at another focal "
           "length, the same view twice, or showing nothing that another one shows.\vColumns: width of the edges in pixels in the worst "
           "direction; highest clipped share of a channel; exposure, red and blue against the session in EV; photographs that share enough "
           "with this one. A finding is no failure: the exit status is 0.",
    .options = check_options,
    .parse = parse_check,
};

static void cell(const char *format, double value)
{
    if (isfinite(value)) {
        printf(format, value);
    } else {
        printf("       –");
    }
}

static void print_table(const tsuya_check *check)
{
    printf("%-28s %8s %8s %8s %8s %8s %8s\n", "photograph", "edge px", "clip %", "EV", "red EV", "blue EV", "overlaps");
    for (int i = 0; i < check->count; i++) {
        const tsuya_checked_photo *p = &check->photo[i];
        printf("%-28s ", p->photo.name);
        cell("%8.2f", p->blur.worst_px);
        cell(" %8.2f", p->readable ? 100.0 * fmax(p->bright_clipped[0], fmax(p->bright_clipped[1], p->bright_clipped[2])) : NAN);
        cell(" %8.2f", p->exposure_ev);
        cell(" %8.2f", p->red_ev);
        cell(" %8.2f", p->blue_ev);
        printf(" %8d%s\n", p->neighbours, p->fault_count ? "  again" : "");
    }
    printf(check->again ? "\ntake again:\n" : "\nnothing to take again\n");
    for (int i = 0; i < check->count; i++) {
        for (int k = 0; k < check->photo[i].fault_count; k++) {
            printf("  %s: %s\n", check->photo[i].photo.name, check->photo[i].fault[k]);
        }
    }
}

static tsuya_status report(const tsuya_common *common, const tsuya_check *check)
{
    tsuya_json *figures = tsuya_json_create_object();
    if (!figures) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_status status = TSUYA_OK;
    tsuya_check_to_json(figures, check);
    tsuya_terminal_end_line();
    if (common->json_path && common->json_path[0] == '-' && common->json_path[1] == '\0') {
        status = tsuya_command_figures(common, figures);
    } else {
        print_table(check);
        if (common->json_path) {
            status = tsuya_json_save(figures, common->json_path);
        }
    }
    tsuya_json_free(figures);
    return status;
}

int tsuya_command_capture_check(int argc, char **argv)
{
    tsuya_common common;
    check_input input = {0};
    tsuya_command_parse(&check_syntax, &common, &input, argc, argv);
    tsuya_context context = tsuya_command_context(&common);
    tsuya_check_options options = tsuya_check_options_default();
    tsuya_check check;
    tsuya_status status = tsuya_check_session(&check, input.photos, input.masks, &options, &context);
    if (status == TSUYA_OK) {
        status = report(&common, &check);
        tsuya_check_free(&check);
    }
    return status == TSUYA_OK ? TSUYA_EXIT_OK : tsuya_command_failed(status);
}
