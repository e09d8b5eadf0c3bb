/* tsuya capture target */
#include "app/command.h"
#include "capture/target.h"
#include "core/file.h"
#include "core/memory.h"

enum { KEY_FAMILY = 1, KEY_BORDER, KEY_COLS, KEY_ROWS, KEY_TAG, KEY_GAP, KEY_FIRST };

typedef struct target_input { tsuya_target_options options; const char *output; } target_input;

static const struct argp_option options[] = {
    {"family", KEY_FAMILY, "NAME", 0, "tag36h11 (default), tag25h9, tagStandard41h12, ...", 0},
    {"border-bits", KEY_BORDER, "N", 0, "Black border, cells: 1 (default) or 2 as on Kalibr's grids", 0},
    {"cols", KEY_COLS, "N", 0, "Tags along x (default 8)", 0},
    {"rows", KEY_ROWS, "N", 0, "Tags along y (default 5; 1 makes a scale bar)", 0},
    {"tag-mm", KEY_TAG, "MM", 0, "Edge of a tag (default 30)", 0},
    {"gap-mm", KEY_GAP, "MM", 0, "Between the tags' edges (default 9)", 0},
    {"first-id", KEY_FIRST, "ID", 0, "Of the tag at the lower left (default 0)", 0},
    {"output", 'o', "PATH", 0, "Folder, or BOARD.pdf (default: target.pdf); board.yaml goes beside it", 0},
    {0},
};

static error_t parse(int key, char *arg, struct argp_state *state)
{
    target_input *input = state->input;
    tsuya_target_options *o = &input->options;
    switch (key) {
    case KEY_FAMILY: o->family = arg; return 0;
    case KEY_BORDER: o->border_bits = tsuya_argument_int(state, "--border-bits", arg, 1, 2); return 0;
    case KEY_COLS: o->cols = tsuya_argument_int(state, "--cols", arg, 1, 100); return 0;
    case KEY_ROWS: o->rows = tsuya_argument_int(state, "--rows", arg, 1, 100); return 0;
    case KEY_TAG: o->tag_mm = tsuya_argument_number(state, "--tag-mm", arg, 1.0, 1000.0); return 0;
    case KEY_GAP: o->gap_mm = tsuya_argument_number(state, "--gap-mm", arg, 0.1, 1000.0); return 0;
    case KEY_FIRST: o->first_id = tsuya_argument_int(state, "--first-id", arg, 0, 100000); return 0;
    case 'o': input->output = arg; return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const tsuya_syntax syntax = {
    .arguments = "",
    .example = "tsuya capture target --cols 8 --rows 5 --tag-mm 30 -o board.pdf",
    .doc = "Draws a board of AprilTags, exact in millimetres, with a ruler to check the printer, and the board.yaml that calib camera reads. Print at "
           "100 %, glue it to something flat, and measure the ruler.",
    .options = options,
    .parse = parse,
};

int tsuya_command_capture_target(int argc, char **argv)
{
    tsuya_common common;
    target_input input = {.options = tsuya_target_options_default()};
    tsuya_command_parse(&syntax, &common, &input, argc, argv);
    char *folder = NULL, *file = NULL, *yaml = NULL;
    tsuya_json *figures = tsuya_json_create_object();
    tsuya_status status = figures ? tsuya_command_output(&folder, &file, input.output, ".pdf", "target.pdf") : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        yaml = tsuya_path_join(folder, "board.yaml");
        status = yaml ? tsuya_target_save(file, yaml, &input.options) : TSUYA_ERROR_MEMORY;
    }
    if (status == TSUYA_OK) {
        tsuya_target_page page = tsuya_target_page_of(&input.options);
        tsuya_json_set_number(figures, "tags", input.options.cols * input.options.rows);
        tsuya_json_set_number(figures, "width_mm", page.width_mm);
        tsuya_json_set_number(figures, "height_mm", page.height_mm);
        status = tsuya_command_figures(&common, figures);
    }
    tsuya_free(yaml);
    tsuya_free(folder);
    tsuya_free(file);
    tsuya_json_free(figures);
    return status == TSUYA_OK ? TSUYA_EXIT_OK : tsuya_command_failed(status);
}
