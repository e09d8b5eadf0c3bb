/* tsuya capture check PHOTOS */
#include "app/capture_page.h"
#include "app/command.h"
#include "app/terminal.h"
#include "capture/check.h"

#include <math.h>
#include <poll.h>
#include <stdio.h>
#include <sys/inotify.h>
#include <unistd.h>

enum { KEY_MASKS = 1, KEY_HTML, KEY_WATCH, KEY_TARGET, SETTLE_MS = 400 };

static const double WANDERS_EV = 0.6; /* of the exposure over a session: worth a word */

typedef struct check_input {
    const char *photos, *masks, *html, *target;
    bool watch;
} check_input;

static const struct argp_option check_options[] = {
    {"masks", KEY_MASKS, "FOLDER", 0, "NAME.png or NAME.jpg.png; white is judged, black is ignored", 0},
    {"target", KEY_TARGET, "FILE", 0, "board.yaml of tags that lie in the scene: counts them, and tells by them who was zoomed or focused anew", 0},
    {"html", KEY_HTML, "FILE", 0, "One page for the record", 0},
    {"watch", KEY_WATCH, NULL, 0, "Stay and look at photographs as they arrive, until interrupted (Ctrl-C); files are kept up to date", 0},
    {0},
};

static error_t parse_check(int key, char *arg, struct argp_state *state)
{
    check_input *input = state->input;
    switch (key) {
    case KEY_MASKS: input->masks = arg; return 0;
    case KEY_TARGET: input->target = arg; return 0;
    case KEY_HTML: input->html = arg; return 0;
    case KEY_WATCH: input->watch = true; return 0;
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
           "length, the same view twice, or showing nothing that another one shows; and which views are missing, in the order of what they would "
           "cover.\vColumns: width of the edges in pixels in the worst "
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

static void print_head(bool tags)
{
    printf("%-28s %8s %8s %8s %8s %8s %8s%s\n", "photograph", "edge px", "clip %", "EV", "red EV", "blue EV", "overlaps", tags ? "     tags" : "");
}

static void print_row(const tsuya_checked_photo *p)
{
    printf("%-28s ", p->photo.name);
    cell("%8.2f", p->blur.worst_px);
    cell(" %8.2f", p->readable ? 100.0 * fmax(p->bright_clipped[0], fmax(p->bright_clipped[1], p->bright_clipped[2])) : NAN);
    cell(" %8.2f", p->exposure_ev);
    cell(" %8.2f", p->red_ev);
    cell(" %8.2f", p->blue_ev);
    printf(" %8d", p->neighbours);
    if (p->tags >= 0) {
        printf(" %8d", p->tags);
    }
    printf("%s\n", p->fault_count ? "  again" : "");
}

static void print_advice(const tsuya_check *check)
{
    printf(check->again ? "\ntake again:\n" : "\nnothing to take again\n");
    for (int i = 0; i < check->count; i++) {
        for (int k = 0; k < check->photo[i].fault_count; k++) {
            printf("  %s: %s\n", check->photo[i].photo.name, check->photo[i].fault[k]);
        }
    }
    if (tsuya_check_blindness(check)) {
        printf("\n%s\n", tsuya_check_blindness(check));
    }
    if (check->wander_ev > WANDERS_EV) {
        printf("\nexposure wanders by %.1f EV over the session: fix time, aperture, ISO and the lamps\n", check->wander_ev);
    }
    if (check->placed == 0) {
        printf("\nviews: too little is shared to say which are missing\n");
        return;
    }
    printf("\nviews: %d of %d placed, %.0f %% of the directions covered%s\n", check->placed, check->count, 100.0 * check->covered,
           check->missing_count ? "; missing, best first:" : "");
    for (int k = 0; k < check->missing_count; k++) {
        char where[320];
        tsuya_check_missing_text(where, sizeof where, check, &check->missing[k]);
        printf("  %s (+%.1f %%)\n", where, 100.0 * check->missing[k].gain);
    }
}

static bool figures_to_stdout(const tsuya_common *common) { return common->json_path && common->json_path[0] == '-' && common->json_path[1] == '\0'; }

/* --json and --html. */
static tsuya_status save(const tsuya_common *common, const check_input *input, const tsuya_check *check)
{
    tsuya_status status = TSUYA_OK;
    tsuya_json *figures = NULL;
    if (common->json_path) {
        figures = tsuya_json_create_object();
        if (!figures) {
            return TSUYA_ERROR_MEMORY;
        }
        tsuya_check_to_json(figures, check);
        status = figures_to_stdout(common) ? tsuya_command_figures(common, figures) : tsuya_json_save(figures, common->json_path);
    }
    if (status == TSUYA_OK && input->html) {
        status = tsuya_capture_page(check, input->photos, input->html);
    }
    tsuya_json_free(figures);
    return status;
}

static tsuya_status check_once(const tsuya_common *common, const check_input *input, const tsuya_check_options *options, const tsuya_context *context)
{
    tsuya_check check;
    TSUYA_TRY(tsuya_check_session(&check, input->photos, input->masks, options, context));
    tsuya_terminal_end_line();
    if (!figures_to_stdout(common)) {
        print_head(input->target != NULL);
        for (int i = 0; i < check.count; i++) {
            print_row(&check.photo[i]);
        }
        print_advice(&check);
    }
    tsuya_status status = save(common, input, &check);
    tsuya_check_free(&check);
    return status;
}

/* What arrived, and what the session now lacks. */
static tsuya_status look(tsuya_check_watch *watch, const tsuya_common *common, const check_input *input, const tsuya_context *context)
{
    int read;
    TSUYA_TRY(tsuya_check_watch_refresh(watch, &read, context));
    const tsuya_check *check = tsuya_check_watch_result(watch);
    tsuya_terminal_end_line();
    if (read == 0 || check->count == 0) {
        return check->count > 0 ? save(common, input, check) : TSUYA_OK;
    }
    if (!figures_to_stdout(common)) {
        print_head(input->target != NULL);
        for (int i = 0; i < check->count; i++) {
            if (tsuya_check_watch_is_new(watch, i)) {
                print_row(&check->photo[i]);
            }
        }
        print_advice(check);
        printf("\n");
    }
    fflush(stdout);
    return save(common, input, check);
}

/* Waits for a change and then for quiet; false: interrupted. */
static bool wait_for_change(int descriptor)
{
    char events[4096];
    struct pollfd p = {.fd = descriptor, .events = POLLIN};
    bool changed = false;
    while (!tsuya_interrupted()) {
        int n = poll(&p, 1, changed ? SETTLE_MS : 1000);
        if (n == 0 && changed) {
            return true;
        }
        if (n > 0) {
            changed = read(descriptor, events, sizeof events) > 0 || changed;
        }
    }
    return false;
}

static tsuya_status watch_folder(const tsuya_common *common, const check_input *input, const tsuya_check_options *options, const tsuya_context *context)
{
    const uint32_t what = IN_CLOSE_WRITE | IN_MOVED_TO | IN_MOVED_FROM | IN_DELETE;
    tsuya_check_watch *watch = NULL;
    TSUYA_TRY(tsuya_check_watch_create(&watch, input->photos, input->masks, options));
    int descriptor = inotify_init1(IN_CLOEXEC);
    tsuya_status status = TSUYA_OK;
    if (descriptor < 0 || inotify_add_watch(descriptor, input->photos, what) < 0 ||
        (input->masks && inotify_add_watch(descriptor, input->masks, what) < 0)) {
        status = tsuya_fail_errno(input->photos, "watching for photographs");
    }
    while (status == TSUYA_OK) {
        status = look(watch, common, input, context);
        if (status == TSUYA_OK && !wait_for_change(descriptor)) {
            break;
        }
    }
    if (status == TSUYA_ERROR_INTERRUPTED) {
        status = TSUYA_OK; /* that is how a watch ends */
    }
    if (descriptor >= 0) {
        close(descriptor);
    }
    tsuya_check_watch_free(watch);
    return status;
}

int tsuya_command_capture_check(int argc, char **argv)
{
    tsuya_common common;
    check_input input = {0};
    tsuya_command_parse(&check_syntax, &common, &input, argc, argv);
    tsuya_context context = tsuya_command_context(&common);
    tsuya_check_options options = tsuya_check_options_default();
    options.target = input.target;
    tsuya_status status = input.watch ? watch_folder(&common, &input, &options, &context) : check_once(&common, &input, &options, &context);
    return status == TSUYA_OK ? TSUYA_EXIT_OK : tsuya_command_failed(status);
}
