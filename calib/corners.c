#include "calib/corners.h"

#include "calib/board.h"
#include "core/file.h"
#include "core/order.h"
#include "core/table.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static int compare_names(const void *a, const void *b)
{
    return strcmp(*(char *const *)a, *(char *const *)b);
}

tsuya_status tsuya_corner_set_create(tsuya_corner_set *set, const char *const *names, int count)
{
    *set = (tsuya_corner_set){0};
    set->photo = tsuya_calloc((size_t)count, sizeof *set->photo);
    if (!set->photo) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int i = 0; i < count; i++) {
        set->photo[i] = tsuya_strdup(names[i]);
        set->photo_count++;
        if (!set->photo[i]) {
            tsuya_corner_set_free(set);
            return TSUYA_ERROR_MEMORY;
        }
    }
    qsort(set->photo, (size_t)count, sizeof *set->photo, compare_names);
    return TSUYA_OK;
}

tsuya_status tsuya_corner_set_add(tsuya_corner_set *set, tsuya_corner corner)
{
    if (set->count == set->capacity) {
        int capacity = set->capacity ? 2 * set->capacity : 256;
        tsuya_corner *grown = tsuya_realloc(set->corner, (size_t)capacity, sizeof *grown);
        if (!grown) {
            return TSUYA_ERROR_MEMORY;
        }
        set->corner = grown;
        set->capacity = capacity;
    }
    set->corner[set->count++] = corner;
    return TSUYA_OK;
}

static int compare_corners(const void *pa, const void *pb)
{
    const tsuya_corner *a = pa, *b = pb;
    int order[3] = {a->photo - b->photo, (a->tag_id > b->tag_id) - (a->tag_id < b->tag_id), a->corner - b->corner};
    return order[0] ? order[0] : order[1] ? order[1] : order[2];
}

void tsuya_corner_set_sort(tsuya_corner_set *set)
{
    if (set->count) {
        qsort(set->corner, (size_t)set->count, sizeof *set->corner, compare_corners);
    }
}

void tsuya_corner_set_free(tsuya_corner_set *set)
{
    for (int i = 0; i < set->photo_count; i++) {
        tsuya_free(set->photo[i]);
    }
    tsuya_free(set->photo);
    tsuya_free(set->corner);
    *set = (tsuya_corner_set){0};
}

typedef struct columns { int name, id, corner, x, y, sigma; } columns;

static tsuya_status read_row(tsuya_corner *out, const tsuya_table *t, size_t row, const columns *c, int width_px, int height_px)
{
    double id = tsuya_table_at(t, row, c->id), corner = tsuya_table_at(t, row, c->corner);
    *out = (tsuya_corner){.x_px = tsuya_table_at(t, row, c->x), .y_px = tsuya_table_at(t, row, c->y),
                          .sigma_px = tsuya_table_at(t, row, c->sigma)};
    if (id != floor(id) || id < 0 || id > 1e9) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: tag_id: %g is given; a whole number from 0 is expected", t->path, t->line[row], id);
    }
    if (corner != 0 && corner != 1 && corner != 2 && corner != 3) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: corner: %g is given; 0, 1, 2 or 3 is expected", t->path, t->line[row], corner);
    }
    if (!(out->sigma_px > 0.0)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: sigma_px: %g is given; a positive number is expected", t->path, t->line[row], out->sigma_px);
    }
    if (width_px && (out->x_px < -0.5 || out->y_px < -0.5 || out->x_px > width_px - 0.5 || out->y_px > height_px - 0.5)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: (%g, %g) lies outside the image of %d x %d", t->path, t->line[row], out->x_px, out->y_px,
                          width_px, height_px);
    }
    out->tag_id = (int)id;
    out->corner = (int)corner;
    return TSUYA_OK;
}

/* Distinct names of a text column, in byte order. */
static tsuya_status take_names(tsuya_corner_set *set, const tsuya_table *t, int column)
{
    const char **name = tsuya_calloc(t->row_count, sizeof *name);
    if (!name) {
        return TSUYA_ERROR_MEMORY;
    }
    for (size_t r = 0; r < t->row_count; r++) {
        name[r] = t->text[r * (size_t)t->column_count + (size_t)column];
    }
    qsort(name, t->row_count, sizeof *name, compare_names);
    int count = 0;
    for (size_t r = 0; r < t->row_count; r++) {
        if (r == 0 || strcmp(name[r], name[r - 1]) != 0) {
            name[count++] = name[r];
        }
    }
    tsuya_status status = tsuya_corner_set_create(set, name, count);
    tsuya_free(name);
    return status;
}

static tsuya_status refuse_twins(const tsuya_corner_set *set, const char *path)
{
    for (int i = 1; i < set->count; i++) {
        const tsuya_corner *c = &set->corner[i];
        if (compare_corners(c - 1, c) == 0) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %s: corner %d of tag %d occurs twice", path, set->photo[c->photo], c->corner, c->tag_id);
        }
    }
    return TSUYA_OK;
}

static tsuya_status take_rows(tsuya_corner_set *set, const tsuya_table *t, const columns *c, int width_px, int height_px)
{
    for (size_t r = 0; r < t->row_count; r++) {
        tsuya_corner corner;
        TSUYA_TRY(read_row(&corner, t, r, c, width_px, height_px));
        char *name = t->text[r * (size_t)t->column_count + (size_t)c->name];
        char **found = bsearch(&name, set->photo, (size_t)set->photo_count, sizeof *set->photo, compare_names);
        corner.photo = (int)(found - set->photo);
        TSUYA_TRY(tsuya_corner_set_add(set, corner));
    }
    tsuya_corner_set_sort(set);
    return refuse_twins(set, t->path);
}

tsuya_status tsuya_corner_set_load(tsuya_corner_set *set, const char *path, int width_px, int height_px)
{
    static const char *const names[] = {"filename", "tag_id", "corner", "x_px", "y_px", "sigma_px", NULL};
    static const char *const text[] = {"filename", NULL};
    tsuya_table_options options = {.required = names, .known = names, .text = text, .vnlog = true};
    tsuya_table t;
    *set = (tsuya_corner_set){0};
    TSUYA_TRY(tsuya_table_load(&t, path, &options));
    columns c = {tsuya_table_column(&t, names[0]), tsuya_table_column(&t, names[1]), tsuya_table_column(&t, names[2]),
                 tsuya_table_column(&t, names[3]), tsuya_table_column(&t, names[4]), tsuya_table_column(&t, names[5])};
    tsuya_status status = t.row_count ? TSUYA_OK : tsuya_fail(TSUYA_ERROR_INPUT, "%s: no corners", path);
    if (status == TSUYA_OK) {
        status = take_names(set, &t, c.name);
    }
    if (status == TSUYA_OK) {
        status = take_rows(set, &t, &c, width_px, height_px);
    }
    tsuya_table_free(&t);
    if (status != TSUYA_OK) {
        tsuya_corner_set_free(set);
    }
    return status;
}

/* vnlog separates by white space, so a name with some cannot be kept as it is. */
static tsuya_status check_names(const tsuya_corner_set *set)
{
    for (int i = 0; i < set->photo_count; i++) {
        if (!set->photo[i][0] || strpbrk(set->photo[i], " \t\r\n") || set->photo[i][0] == '#' || strcmp(set->photo[i], "-") == 0) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "'%s': a vnlog file cannot keep this name; names without white space are accepted", set->photo[i]);
        }
    }
    return TSUYA_OK;
}

tsuya_status tsuya_corner_set_save(const tsuya_corner_set *set, const char *path)
{
    TSUYA_TRY(check_names(set));
    tsuya_file_writer writer;
    TSUYA_TRY(tsuya_file_begin(&writer, path));
    fprintf(writer.stream, "# filename tag_id corner x_px y_px sigma_px\n");
    for (int i = 0; i < set->count; i++) {
        const tsuya_corner *c = &set->corner[i];
        fprintf(writer.stream, "%s %d %d %.4f %.4f %.4f\n", set->photo[c->photo], c->tag_id, c->corner, c->x_px, c->y_px,
                c->sigma_px < 1e-4 ? 1e-4 : c->sigma_px);
    }
    return tsuya_file_commit(&writer);
}

static tsuya_status median_sigma(double *sigma, const tsuya_corner_set *set)
{
    double *all = tsuya_calloc((size_t)set->count, sizeof *all);
    if (!all) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int i = 0; i < set->count; i++) {
        all[i] = set->corner[i].sigma_px;
    }
    tsuya_sort_doubles(all, (size_t)set->count);
    *sigma = set->count ? all[set->count / 2] : 1.0;
    tsuya_free(all);
    return TSUYA_OK;
}

/* One photograph's corners, each at its place of the grid; −1: not seen. */
static void place_on_grid(int *at, const tsuya_corner_set *set, int begin, int end, const tsuya_board *board)
{
    const tsuya_board_plate *p = &board->plate[0];
    for (int i = 0; i < 4 * p->cols * p->rows; i++) {
        at[i] = -1;
    }
    for (int i = begin; i < end; i++) {
        const tsuya_corner *c = &set->corner[i];
        int tag = tsuya_board_find(board, c->tag_id);
        if (tag >= 0) {
            int x = 2 * (tag % p->cols) + (c->corner == 1 || c->corner == 2), y = 2 * (tag / p->cols) + (c->corner >= 2);
            at[y * 2 * p->cols + x] = i;
        }
    }
}

tsuya_status tsuya_corner_set_save_grid(const tsuya_corner_set *set, const tsuya_board *board, const char *path)
{
    const tsuya_board_plate *p = &board->plate[0];
    double typical;
    tsuya_file_writer writer;
    TSUYA_TRY(check_names(set));
    TSUYA_TRY(median_sigma(&typical, set));
    int cells = 4 * p->cols * p->rows, *at = tsuya_calloc((size_t)cells, sizeof *at);
    tsuya_status status = at ? tsuya_file_begin(&writer, path) : TSUYA_ERROR_MEMORY;
    if (status != TSUYA_OK) {
        tsuya_free(at);
        return status;
    }
    fprintf(writer.stream, "# filename x y level\n");
    for (int begin = 0, end; begin < set->count; begin = end) {
        const char *name = set->photo[set->corner[begin].photo];
        for (end = begin; end < set->count && set->corner[end].photo == set->corner[begin].photo; end++) {
        }
        place_on_grid(at, set, begin, end, board);
        for (int i = 0; i < cells; i++) {
            if (at[i] < 0) {
                fprintf(writer.stream, "%s - - -\n", name);
            } else {
                const tsuya_corner *c = &set->corner[at[i]];
                fprintf(writer.stream, "%s %.4f %.4f %d\n", name, c->x_px, c->y_px, (int)fmax(rint(log2(c->sigma_px / typical)), 0.0));
            }
        }
    }
    tsuya_free(at);
    return tsuya_file_commit(&writer);
}
