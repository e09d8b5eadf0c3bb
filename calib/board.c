#include "calib/board.h"

#include "core/file.h"
#include "core/table.h"
#include "core/yaml.h"

#include <limits.h>
#include <string.h>

enum { MOST_TAGS = 100000, LARGEST_FILE = 16 << 20 };

static const char *const families[] = {"tag36h11", "tag25h9", "tag16h5", "tag36h10", "tagStandard41h12", "tagStandard52h13", NULL};

/* Every form of the file in one record; `build` tells them apart. */
typedef struct board_tag_record {
    int id;
    double x_mm, y_mm, size_mm;
} board_tag_record;

typedef struct board_plate_record {
    const char *name;
    tsuya_yaml_list tags;
    int cols, rows, first_id;
    double tag_mm, gap_mm;
} board_plate_record;

typedef struct board_record {
    const char *family, *target_type;
    int border_bits, tag_cols, tag_rows, code_offset;
    double tag_size, tag_spacing;
    tsuya_yaml_list boards;
    board_plate_record grid;
} board_record;

static const tsuya_yaml_field tag_fields[] = {
    {.key = "id", .kind = TSUYA_YAML_INT, .offset = offsetof(board_tag_record, id), .required = true},
    {.key = "x_mm", .kind = TSUYA_YAML_NUMBER, .offset = offsetof(board_tag_record, x_mm), .required = true},
    {.key = "y_mm", .kind = TSUYA_YAML_NUMBER, .offset = offsetof(board_tag_record, y_mm), .required = true},
    {.key = "size_mm", .kind = TSUYA_YAML_NUMBER, .offset = offsetof(board_tag_record, size_mm), .required = true},
    {0},
};

static const tsuya_yaml_field plate_fields[] = {
    {.key = "name", .kind = TSUYA_YAML_TEXT, .offset = offsetof(board_plate_record, name)},
    {.key = "tags", .kind = TSUYA_YAML_RECORDS, .offset = offsetof(board_plate_record, tags), .fields = tag_fields,
     .size = sizeof(board_tag_record)},
    {.key = "cols", .kind = TSUYA_YAML_INT, .offset = offsetof(board_plate_record, cols)},
    {.key = "rows", .kind = TSUYA_YAML_INT, .offset = offsetof(board_plate_record, rows)},
    {.key = "tag_mm", .kind = TSUYA_YAML_NUMBER, .offset = offsetof(board_plate_record, tag_mm)},
    {.key = "gap_mm", .kind = TSUYA_YAML_NUMBER, .offset = offsetof(board_plate_record, gap_mm)},
    {.key = "first_id", .kind = TSUYA_YAML_INT, .offset = offsetof(board_plate_record, first_id)},
    {0},
};

static const tsuya_yaml_field board_fields[] = {
    {.key = "family", .kind = TSUYA_YAML_TEXT, .offset = offsetof(board_record, family)},
    {.key = "border_bits", .kind = TSUYA_YAML_INT, .offset = offsetof(board_record, border_bits)},
    {.key = "boards", .kind = TSUYA_YAML_RECORDS, .offset = offsetof(board_record, boards), .fields = plate_fields,
     .size = sizeof(board_plate_record)},
    {.key = "cols", .kind = TSUYA_YAML_INT, .offset = offsetof(board_record, grid.cols)},
    {.key = "rows", .kind = TSUYA_YAML_INT, .offset = offsetof(board_record, grid.rows)},
    {.key = "tag_mm", .kind = TSUYA_YAML_NUMBER, .offset = offsetof(board_record, grid.tag_mm)},
    {.key = "gap_mm", .kind = TSUYA_YAML_NUMBER, .offset = offsetof(board_record, grid.gap_mm)},
    {.key = "first_id", .kind = TSUYA_YAML_INT, .offset = offsetof(board_record, grid.first_id)},
    {.key = "target_type", .kind = TSUYA_YAML_TEXT, .offset = offsetof(board_record, target_type)},
    {.key = "tagCols", .kind = TSUYA_YAML_INT, .offset = offsetof(board_record, tag_cols)},
    {.key = "tagRows", .kind = TSUYA_YAML_INT, .offset = offsetof(board_record, tag_rows)},
    {.key = "tagSize", .kind = TSUYA_YAML_NUMBER, .offset = offsetof(board_record, tag_size)},
    {.key = "tagSpacing", .kind = TSUYA_YAML_NUMBER, .offset = offsetof(board_record, tag_spacing)},
    {.key = "codeOffset", .kind = TSUYA_YAML_INT, .offset = offsetof(board_record, code_offset)},
    {0},
};

typedef struct builder {
    tsuya_board *board;
    const char *name; /* for messages */
} builder;

static tsuya_status complain(const builder *b, const char *key, double value, const char *wanted)
{
    return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %s: %g is given; %s", b->name, key, value, wanted);
}

static tsuya_status check_grid(const builder *b, const board_plate_record *g)
{
    if (g->cols == INT_MIN || g->rows == INT_MIN || isnan(g->tag_mm) || isnan(g->gap_mm)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: a grid needs cols, rows, tag_mm and gap_mm; a list of plates stands under boards:", b->name);
    }
    if (g->cols < 1 || g->rows < 1 || (long long)g->cols * g->rows > MOST_TAGS) {
        return complain(b, g->cols < 1 ? "cols" : "rows", g->cols < 1 ? g->cols : g->rows, "1 or more, at most 100000 tags in all");
    }
    if (!(g->tag_mm > 0.0) || g->tag_mm > 1e5) {
        return complain(b, "tag_mm", g->tag_mm, "a positive edge in millimetres is expected");
    }
    if (!(g->gap_mm >= 0.0) || g->gap_mm > 1e5) {
        return complain(b, "gap_mm", g->gap_mm, "the space between edges, 0 or more millimetres, is expected");
    }
    return TSUYA_OK;
}

static void place_tag(tsuya_board_tag *tag, int id, int plate, double left_m, double bottom_m, double size_m)
{
    *tag = (tsuya_board_tag){.id = id, .plate = plate};
    for (int c = 0; c < 4; c++) {
        tag->corner_m[c] = (tsuya_vec2){left_m + (c == 1 || c == 2 ? size_m : 0.0), bottom_m + (c >= 2 ? size_m : 0.0)};
    }
}

static void add_grid(builder *b, tsuya_board_plate *plate, const board_plate_record *g)
{
    tsuya_board *board = b->board;
    int index = (int)(plate - board->plate);
    plate->cols = g->cols;
    plate->rows = g->rows;
    plate->tag_m = 1e-3 * g->tag_mm;
    plate->gap_m = 1e-3 * g->gap_mm;
    plate->first_id = g->first_id == INT_MIN ? 0 : g->first_id;
    double step_m = plate->tag_m + plate->gap_m;
    for (int i = 0; i < g->cols * g->rows; i++) {
        place_tag(&board->tag[board->tag_count++], plate->first_id + i, index, step_m * (i % g->cols), step_m * (i / g->cols), plate->tag_m);
    }
}

static tsuya_status add_listed(builder *b, const board_plate_record *p, int index)
{
    tsuya_board *board = b->board;
    const board_tag_record *tag = p->tags.item;
    for (int i = 0; i < p->tags.count; i++) {
        if (!(tag[i].size_mm > 0.0)) {
            return complain(b, "size_mm", tag[i].size_mm, "a positive edge in millimetres is expected");
        }
        double half_m = 0.5e-3 * tag[i].size_mm;
        place_tag(&board->tag[board->tag_count++], tag[i].id, index, 1e-3 * tag[i].x_mm - half_m, 1e-3 * tag[i].y_mm - half_m, 2.0 * half_m);
    }
    return TSUYA_OK;
}

static tsuya_status check_family(const builder *b)
{
    const tsuya_board *board = b->board;
    for (int i = 0; families[i]; i++) {
        if (strcmp(families[i], board->family) == 0) {
            bool classic = strncmp(board->family, "tagStandard", 11) != 0;
            if (board->border_bits < 1 || board->border_bits > (classic ? 2 : 1)) {
                return complain(b, "border_bits", board->border_bits, classic ? "1 or 2 is accepted" : "this family has a border of 1");
            }
            return TSUYA_OK;
        }
    }
    const char *near = tsuya_nearest_name(board->family, families);
    return tsuya_fail(TSUYA_ERROR_INPUT, "%s: family: '%s' is unknown%s%s; tag36h11, tag25h9, tag16h5, tag36h10, tagStandard41h12 and "
                      "tagStandard52h13 are accepted", b->name, board->family, near ? "; did you mean " : "", near ? near : "");
}

static tsuya_status check_ids(const builder *b)
{
    const tsuya_board *board = b->board;
    for (int i = 0; i < board->tag_count; i++) {
        if (board->tag[i].id < 0) {
            return complain(b, "id", board->tag[i].id, "ids are 0 or more");
        }
        int first = tsuya_board_find(board, board->tag[i].id);
        if (first != i) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: tag id %d occurs twice (plates %s and %s)", b->name, board->tag[i].id,
                              board->plate[board->tag[first].plate].name, board->plate[board->tag[i].plate].name);
        }
    }
    return TSUYA_OK;
}

static tsuya_status build_plates(builder *b, const board_plate_record *plate, int count)
{
    tsuya_board *board = b->board;
    long long tags = 0;
    for (int p = 0; p < count; p++) {
        if (plate[p].tags.count == 0) {
            TSUYA_TRY(check_grid(b, &plate[p]));
        } else if (plate[p].cols != INT_MIN || plate[p].rows != INT_MIN) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: plate %d has tags: and cols:; either a list or a grid is expected", b->name, p + 1);
        }
        tags += plate[p].tags.count ? plate[p].tags.count : (long long)plate[p].cols * plate[p].rows;
    }
    if (tags > MOST_TAGS) {
        return complain(b, "tags", (double)tags, "at most 100000 tags are accepted");
    }
    board->plate = tsuya_arena_alloc(board->arena, count, sizeof *board->plate);
    board->tag = tsuya_arena_alloc(board->arena, (size_t)tags, sizeof *board->tag);
    if (!board->plate || !board->tag) {
        return TSUYA_ERROR_MEMORY;
    }
    board->plate_count = count;
    for (int p = 0; p < count; p++) {
        tsuya_board_plate *out = &board->plate[p];
        out->name = plate[p].name ? plate[p].name : tsuya_arena_printf(board->arena, "plate%d", p + 1);
        if (!out->name) {
            return TSUYA_ERROR_MEMORY;
        }
        out->first_tag = board->tag_count;
        if (plate[p].tags.count) {
            TSUYA_TRY(add_listed(b, &plate[p], p));
        } else {
            add_grid(b, out, &plate[p]);
        }
        out->tag_count = board->tag_count - out->first_tag;
    }
    return check_ids(b);
}

static tsuya_status build_kalibr(builder *b, const board_record *r)
{
    if (strcmp(r->target_type, "aprilgrid") != 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: target_type: '%s'; 'aprilgrid' is accepted", b->name, r->target_type);
    }
    if (isnan(r->tag_spacing)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: tagSpacing is missing: space between tags over tagSize", b->name);
    }
    board_plate_record grid = {.name = "aprilgrid", .cols = r->tag_cols, .rows = r->tag_rows, .tag_mm = 1e3 * r->tag_size,
                               .gap_mm = 1e3 * r->tag_size * r->tag_spacing, .first_id = r->code_offset};
    b->board->family = "tag36h11";
    b->board->border_bits = r->border_bits == INT_MIN ? 2 : r->border_bits;
    TSUYA_TRY(check_family(b));
    return build_plates(b, &grid, 1);
}

static tsuya_status build(builder *b, const board_record *r)
{
    if (r->target_type) {
        return build_kalibr(b, r);
    }
    if (!r->family) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: key \"family\" is missing (tag36h11, …), or target_type: aprilgrid for Kalibr's form", b->name);
    }
    b->board->family = r->family;
    b->board->border_bits = r->border_bits == INT_MIN ? 1 : r->border_bits;
    TSUYA_TRY(check_family(b));
    if (r->boards.count) {
        if (r->grid.cols != INT_MIN || r->grid.rows != INT_MIN) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: cols:, rows: and boards: together; either one grid or a list of plates is expected", b->name);
        }
        return build_plates(b, r->boards.item, r->boards.count);
    }
    board_plate_record grid = r->grid;
    grid.name = "board";
    return build_plates(b, &grid, 1);
}

tsuya_status tsuya_board_parse(tsuya_board *board, const char *text, const char *name)
{
    *board = (tsuya_board){0};
    TSUYA_TRY(tsuya_arena_create(&board->arena, 1 << 14));
    board_record record;
    builder b = {board, name};
    tsuya_status status = tsuya_yaml_parse(&record, sizeof record, board_fields, text, name, board->arena);
    if (status == TSUYA_OK) {
        record.grid.tags = (tsuya_yaml_list){0};
        status = build(&b, &record);
    }
    if (status != TSUYA_OK) {
        tsuya_board_free(board);
    }
    return status;
}

tsuya_status tsuya_board_load(tsuya_board *board, const char *path)
{
    char *text;
    size_t size;
    *board = (tsuya_board){0};
    TSUYA_TRY(tsuya_file_load(&text, &size, path, LARGEST_FILE));
    tsuya_status status = tsuya_board_parse(board, text, path);
    tsuya_free(text);
    return status;
}

tsuya_status tsuya_board_grid(tsuya_board *board, const char *family, int border_bits, int cols, int rows, double tag_m, double gap_m,
                              int first_id)
{
    *board = (tsuya_board){0};
    TSUYA_TRY(tsuya_arena_create(&board->arena, 1 << 14));
    builder b = {board, "board"};
    board_plate_record grid = {.name = "board", .cols = cols, .rows = rows, .tag_mm = 1e3 * tag_m, .gap_mm = 1e3 * gap_m, .first_id = first_id};
    board->family = tsuya_arena_printf(board->arena, "%s", family);
    board->border_bits = border_bits;
    tsuya_status status = board->family ? check_family(&b) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        status = build_plates(&b, &grid, 1);
    }
    if (status != TSUYA_OK) {
        tsuya_board_free(board);
    }
    return status;
}

void tsuya_board_free(tsuya_board *board)
{
    tsuya_arena_free(board->arena);
    *board = (tsuya_board){0};
}

bool tsuya_board_even_grid(const tsuya_board *board)
{
    const tsuya_board_plate *p = board->plate;
    return board->plate_count == 1 && p->cols > 0 && p->rows > 0 && fabs(p->gap_m - p->tag_m) < 1e-9 * p->tag_m;
}

int tsuya_board_find(const tsuya_board *board, int id)
{
    for (int p = 0; p < board->plate_count; p++) {
        const tsuya_board_plate *plate = &board->plate[p];
        if (plate->cols > 0) {
            int offset = id - plate->first_id;
            if (offset >= 0 && offset < plate->tag_count) {
                return plate->first_tag + offset;
            }
            continue;
        }
        for (int i = plate->first_tag; i < plate->first_tag + plate->tag_count; i++) {
            if (board->tag[i].id == id) {
                return i;
            }
        }
    }
    return -1;
}
