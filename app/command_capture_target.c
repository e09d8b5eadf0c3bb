/* tsuya capture target */
#include "app/command.h"
#include "capture/target.h"
#include "core/file.h"
#include "core/memory.h"

#include <string.h>

enum { KEY_FAMILY = 1, KEY_BORDER, KEY_COLS, KEY_ROWS, KEY_TAG, KEY_GAP, KEY_FIRST, KEY_KIND, KEY_SIZE };

/* Numbers that were not given are the kind's own: 0. */
typedef struct target_input { tsuya_target_options options; const char *output; } target_input;

static const struct argp_option options[] = {
    {"kind", KEY_KIND, "NAME", 0, "grid (default), mat (of a turntable: a ring of tags around the axis, with degrees) or bar (tags at both ends of a ruler)", 0},
    {"size-mm", KEY_SIZE, "MM", 0, "Diameter of a mat (default 190), or between the first and last tag's middles of a bar (default 240)", 0},
    {"family", KEY_FAMILY, "NAME", 0, "tag36h11 (default), tag25h9, tagStandard41h12, ...", 0},
    {"border-bits", KEY_BORDER, "N", 0, "Black border, cells: 1 (default) or 2 as on Kalibr's grids", 0},
    {"cols", KEY_COLS, "N", 0, "Tags along x (default 8)", 0},
    {"rows", KEY_ROWS, "N", 0, "Tags along y (default 5)", 0},
    {"tag-mm", KEY_TAG, "MM", 0, "Edge of a tag (default 30; mat 18, bar 20)", 0},
    {"gap-mm", KEY_GAP, "MM", 0, "Between the tags' edges (default 9; mat and bar 6)", 0},
    {"first-id", KEY_FIRST, "ID", 0, "Of the tag at the lower left (default 0)", 0},
    {"output", 'o', "PATH", 0, "Folder, or BOARD.pdf (default: target.pdf); board.yaml goes beside it", 0},
    {0},
};

static void parse_kind(struct argp_state *state, tsuya_target_options *o, const char *name)
{
    static const char *const kinds[] = {"grid", "mat", "bar"};
    for (int i = 0; i < 3; i++) {
        if (strcmp(name, kinds[i]) == 0) {
            o->kind = (tsuya_target_kind)i;
            return;
        }
    }
    argp_error(state, "--kind: '%s' is unknown; grid, mat and bar are accepted", name);
}

static void finish(struct argp_state *state, tsuya_target_options *o)
{
    tsuya_target_options own = tsuya_target_options_of(o->kind);
    if (o->kind != TSUYA_TARGET_GRID && (o->cols || o->rows)) {
        argp_error(state, "--cols and --rows belong to a grid; a mat and a bar have --size-mm");
    } else if (o->kind == TSUYA_TARGET_GRID && o->size_mm > 0.0) {
        argp_error(state, "--size-mm belongs to a mat or a bar; a grid has --cols and --rows");
    }
    o->cols = o->cols ? o->cols : own.cols;
    o->rows = o->rows ? o->rows : own.rows;
    o->tag_mm = o->tag_mm > 0.0 ? o->tag_mm : own.tag_mm;
    o->gap_mm = o->gap_mm > 0.0 ? o->gap_mm : own.gap_mm;
    o->size_mm = o->size_mm > 0.0 ? o->size_mm : own.size_mm;
    o->margin_mm = own.margin_mm;
}

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
    case KEY_KIND: parse_kind(state, o, arg); return 0;
    case KEY_SIZE: o->size_mm = tsuya_argument_number(state, "--size-mm", arg, 10.0, 3000.0); return 0;
    case ARGP_KEY_END: finish(state, o); return 0;
    case 'o': input->output = arg; return 0;
    default: return ARGP_ERR_UNKNOWN;
    }
}

static const tsuya_syntax syntax = {
    .arguments = "",
    .example = "tsuya capture target --cols 8 --rows 5 --tag-mm 30 -o board.pdf",
    .doc = "Draws a board of AprilTags, a turntable's mat or a scale bar, exact in millimetres, with a ruler to check the printer, and the board.yaml that calib camera reads. Print at "
           "100 %, glue it to something flat, and measure the ruler.",
    .options = options,
    .parse = parse,
};

int tsuya_command_capture_target(int argc, char **argv)
{
    tsuya_common common;
    target_input input = {.options = {.family = tsuya_target_options_default().family, .border_bits = 1}};
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
        tsuya_json_set_number(figures, "tags", tsuya_target_tags(NULL, 0, &input.options));
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
