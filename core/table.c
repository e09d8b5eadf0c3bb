#include "core/table.h"

#include "core/file.h"

#include <errno.h>
#include <locale.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { MOST_COLUMNS = 4096, LONGEST_NUMBER = 63 };
static const size_t LARGEST_FILE = (size_t)4 << 30;

bool tsuya_parse_number(double *number, const char *text)
{
    static const char ALLOWED[] = "+-.0123456789eE";
    size_t length = strlen(text);
    if (length == 0 || length > LONGEST_NUMBER || strspn(text, ALLOWED) != length) {
        return false; /* no hexadecimal, no nan, no inf, no blanks */
    }
    static locale_t plain;
    if (!plain) { /* a race only makes it twice */
        plain = newlocale(LC_ALL_MASK, "C", (locale_t)0);
    }
    char *end;
    double value = plain ? strtod_l(text, &end, plain) : strtod(text, &end);
    if (*end != '\0' || !isfinite(value)) {
        return false;
    }
    *number = value;
    return true;
}

bool tsuya_parse_int(long long *number, const char *text)
{
    char *end;
    if (!(text[0] == '-' || text[0] == '+' || (text[0] >= '0' && text[0] <= '9'))) {
        return false;
    }
    errno = 0;
    long long value = strtoll(text, &end, 10);
    if (end == text || *end != '\0' || errno != 0) {
        return false;
    }
    *number = value;
    return true;
}

enum { LONGEST_WORD = 63 };

/* Levenshtein distance of two short words. */
static int edit_distance(const char *a, const char *b)
{
    int row[LONGEST_WORD + 2];
    int columns = (int)strnlen(b, LONGEST_WORD);
    for (int j = 0; j <= columns; j++) {
        row[j] = j;
    }
    for (int i = 0; a[i] && i < LONGEST_WORD; i++) {
        int diagonal = row[0];
        row[0] = i + 1;
        for (int j = 0; j < columns; j++) {
            int replaced = diagonal + (a[i] != b[j]);
            diagonal = row[j + 1];
            int shorter = (row[j] < row[j + 1] ? row[j] : row[j + 1]) + 1;
            row[j + 1] = replaced < shorter ? replaced : shorter;
        }
    }
    return row[columns];
}

/* One word begins with the other: "theta_i" for "theta_i_deg". */
static bool is_beginning(const char *a, const char *b)
{
    size_t length = strnlen(a, strlen(b));
    return length >= 3 && strncmp(a, b, length) == 0;
}

const char *tsuya_nearest_name(const char *name, const char *const *names)
{
    const char *best = NULL;
    int least = 0, most = (int)strlen(name);
    most = most < 4 ? 1 : most / 2;
    for (; *names; names++) {
        int distance = edit_distance(name, *names);
        if ((distance <= most || is_beginning(name, *names)) && (!best || distance < least)) {
            best = *names;
            least = distance;
        }
    }
    return best;
}

typedef struct parser {
    const char *name;
    char *at;
    int line;
    bool vnlog;
    size_t row_capacity, key_capacity;
    char **cell; /* of the current line */
    int cell_count;
} parser;

/* The next line, cut in place; NULL at the end. */
static char *next_line(parser *p)
{
    char *line = p->at;
    if (*line == '\0') {
        return NULL;
    }
    char *end = strchr(line, '\n');
    p->at = end ? end + 1 : line + strlen(line);
    end = end ? end : p->at;
    *end = '\0';
    if (end > line && end[-1] == '\r') {
        end[-1] = '\0';
    }
    p->line++;
    return line;
}

static char *trimmed(char *text)
{
    text += strspn(text, " \t");
    for (size_t length = strlen(text); length > 0 && (text[length - 1] == ' ' || text[length - 1] == '\t'); length--) {
        text[length - 1] = '\0';
    }
    return text;
}

static tsuya_status add_cell(parser *p, char *text)
{
    if (p->cell_count == MOST_COLUMNS) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: more than %d columns", p->name, p->line, MOST_COLUMNS);
    }
    p->cell[p->cell_count++] = text;
    return TSUYA_OK;
}

/* A quoted cell, cut in place; returns what follows its closing quote, NULL where that is missing. */
static char *unquote(char *at)
{
    char *out = at;
    for (char *in = at + 1; *in; in++) {
        if (*in == '"' && in[1] == '"') {
            in++;
        } else if (*in == '"') {
            *out = '\0';
            return in + 1;
        }
        *out++ = *in;
    }
    return NULL;
}

static tsuya_status split_commas(parser *p, char *line)
{
    p->cell_count = 0;
    for (char *at = line;;) {
        at += strspn(at, " \t");
        char *cell = at, *after;
        bool quoted = *at == '"';
        if (quoted) {
            after = unquote(at);
            after = after ? after + strspn(after, " \t") : NULL;
            if (!after || (*after != ',' && *after != '\0')) {
                return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: a quoted cell without its closing quote", p->name, p->line);
            }
        } else {
            after = at + strcspn(at, ",");
        }
        bool last = *after == '\0';
        *after = '\0';
        TSUYA_TRY(add_cell(p, quoted ? cell : trimmed(cell)));
        if (last) {
            return TSUYA_OK;
        }
        at = after + 1;
    }
}

static tsuya_status split_blanks(parser *p, char *line)
{
    char *rest;
    p->cell_count = 0;
    for (char *word = strtok_r(line, " \t", &rest); word; word = strtok_r(NULL, " \t", &rest)) {
        TSUYA_TRY(add_cell(p, word));
    }
    return TSUYA_OK;
}

static tsuya_status keep_comment(tsuya_table *table, parser *p, char *comment)
{
    char *equals = strchr(comment, '=');
    if (!equals) {
        return TSUYA_OK;
    }
    if ((size_t)table->key_count == p->key_capacity) {
        size_t capacity = p->key_capacity * 2 + 8;
        char **key = tsuya_realloc(table->key, capacity, sizeof *key);
        if (!key) {
            return TSUYA_ERROR_MEMORY;
        }
        table->key = key;
        char **value = tsuya_realloc(table->key_value, capacity, sizeof *value);
        if (!value) {
            return TSUYA_ERROR_MEMORY;
        }
        table->key_value = value;
        p->key_capacity = capacity;
    }
    *equals = '\0';
    char *key = tsuya_strdup(trimmed(comment)), *value = tsuya_strdup(trimmed(equals + 1));
    table->key[table->key_count] = key;
    table->key_value[table->key_count++] = value;
    return key && value ? TSUYA_OK : TSUYA_ERROR_MEMORY;
}

/* One comment may carry several key=value pairs: "# light_theta_deg=30 light_phi_deg=0". */
static tsuya_status keep_comments(tsuya_table *table, parser *p, char *comment)
{
    bool all_pairs = true;
    int words = 0;
    for (const char *at = comment + strspn(comment, " \t"); *at; at += strspn(at, " \t")) {
        size_t length = strcspn(at, " \t");
        const char *equals = memchr(at, '=', length);
        all_pairs &= equals && equals > at && equals + 1 < at + length;
        words++;
        at += length;
    }
    if (!all_pairs || words < 2) {
        return keep_comment(table, p, comment);
    }
    char *rest;
    for (char *word = strtok_r(comment, " \t", &rest); word; word = strtok_r(NULL, " \t", &rest)) {
        TSUYA_TRY(keep_comment(table, p, word));
    }
    return TSUYA_OK;
}

static bool listed(const char *name, const char *const *names)
{
    for (; names && *names; names++) {
        if (strcmp(*names, name) == 0) {
            return true;
        }
    }
    return false;
}

static tsuya_status check_known(const parser *p, const char *name, const tsuya_table_options *options)
{
    if (!options->known || listed(name, options->known) || listed(name, options->required) || listed(name, options->text)
        || (options->known_name && options->known_name(name))) {
        return TSUYA_OK;
    }
    const char *near = tsuya_nearest_name(name, options->known);
    return near ? tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: unknown column \"%s\"; did you mean \"%s\"?", p->name, p->line, name, near)
                : tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: unknown column \"%s\"", p->name, p->line, name);
}

static tsuya_status take_header(tsuya_table *table, parser *p, const tsuya_table_options *options)
{
    table->column = tsuya_calloc((size_t)p->cell_count, sizeof *table->column);
    if (!table->column) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int i = 0; i < p->cell_count; i++) {
        if (tsuya_table_column(table, p->cell[i]) >= 0 || p->cell[i][0] == '\0') {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: column \"%s\" occurs twice or has no name", p->name, p->line, p->cell[i]);
        }
        if (!(table->column[i] = tsuya_strdup(p->cell[i]))) {
            return TSUYA_ERROR_MEMORY;
        }
        table->column_count++;
        TSUYA_TRY(check_known(p, p->cell[i], options));
    }
    for (const char *const *name = options->required; name && *name; name++) {
        if (tsuya_table_column(table, *name) < 0) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: column \"%s\" is missing", p->name, p->line, *name);
        }
    }
    return TSUYA_OK;
}

static tsuya_status grow_rows(tsuya_table *table, parser *p)
{
    size_t capacity = p->row_capacity * 2 + 64, columns = (size_t)table->column_count;
    double *value = tsuya_realloc(table->value, capacity, columns * sizeof *value);
    if (!value) {
        return TSUYA_ERROR_MEMORY;
    }
    table->value = value;
    char **text = tsuya_realloc(table->text, capacity, columns * sizeof *text);
    if (!text) {
        return TSUYA_ERROR_MEMORY;
    }
    memset(text + table->row_count * columns, 0, (capacity - table->row_count) * columns * sizeof *text);
    table->text = text;
    int *line = tsuya_realloc(table->line, capacity, sizeof *line);
    if (!line) {
        return TSUYA_ERROR_MEMORY;
    }
    table->line = line;
    p->row_capacity = capacity;
    return TSUYA_OK;
}

static tsuya_status take_row(tsuya_table *table, parser *p, const tsuya_table_options *options)
{
    if (p->cell_count != table->column_count) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: %d cells, the header has %d columns", p->name, p->line, p->cell_count,
                          table->column_count);
    }
    if (table->row_count == p->row_capacity) {
        TSUYA_TRY(grow_rows(table, p));
    }
    size_t base = table->row_count * (size_t)table->column_count;
    table->line[table->row_count++] = p->line;
    for (int i = 0; i < p->cell_count; i++) {
        double *value = &table->value[base + (size_t)i];
        const char *cell = p->cell[i];
        *value = NAN;
        if (listed(table->column[i], options->text)) {
            if (!(table->text[base + (size_t)i] = tsuya_strdup(cell))) {
                return TSUYA_ERROR_MEMORY;
            }
        } else if (!((cell[0] == '\0' || (p->vnlog && strcmp(cell, "-") == 0)) && options->allow_empty) && !tsuya_parse_number(value, cell)) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: column %s: \"%.40s\"; a finite number is expected", p->name, p->line,
                              table->column[i], cell);
        }
    }
    return TSUYA_OK;
}

static tsuya_status take_line(tsuya_table *table, parser *p, char *line, const tsuya_table_options *options)
{
    char *start = line + strspn(line, " \t");
    if (*start == '\0') {
        return TSUYA_OK;
    }
    if (*start == '#') {
        bool header = p->vnlog && !table->column && start[1] != '#' && start[1] != '!' && start[1 + strspn(start + 1, " \t")] != '\0';
        if (!header) {
            return keep_comments(table, p, start + 1);
        }
        TSUYA_TRY(split_blanks(p, start + 1));
        return take_header(table, p, options);
    }
    TSUYA_TRY(p->vnlog ? split_blanks(p, start) : split_commas(p, start));
    if (table->column) {
        return take_row(table, p, options);
    }
    return p->vnlog ? tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: a header \"# name name …\" is expected first", p->name, p->line)
                    : take_header(table, p, options);
}

/* Cuts `text` in place. */
static tsuya_status parse(tsuya_table *table, char *text, const char *name, const tsuya_table_options *options)
{
    static const tsuya_table_options NONE;
    options = options ? options : &NONE;
    tsuya_status status = TSUYA_OK;
    parser p = {.name = name, .at = text, .vnlog = options->vnlog};
    *table = (tsuya_table){0};
    if (strncmp(text, "\xef\xbb\xbf", 3) == 0) {
        p.at += 3;
    }
    TSUYA_NEW(status, p.cell, MOST_COLUMNS);
    if (!(table->path = tsuya_strdup(name))) {
        status = TSUYA_ERROR_MEMORY;
        goto done;
    }
    for (char *line; (line = next_line(&p));) {
        TSUYA_GOTO_DONE(status, take_line(table, &p, line, options));
    }
    if (!table->column) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: no header; a first line with the columns' names is expected", name);
    }
done:
    tsuya_free(p.cell);
    if (status != TSUYA_OK) {
        tsuya_table_free(table);
    }
    return status;
}

tsuya_status tsuya_table_parse(tsuya_table *table, const char *text, const char *name, const tsuya_table_options *options)
{
    *table = (tsuya_table){0};
    char *copy = tsuya_strdup(text);
    if (!copy) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_status status = parse(table, copy, name, options);
    tsuya_free(copy);
    return status;
}

tsuya_status tsuya_table_load(tsuya_table *table, const char *path, const tsuya_table_options *options)
{
    char *text;
    size_t size;
    *table = (tsuya_table){0};
    TSUYA_TRY(tsuya_file_load(&text, &size, path, LARGEST_FILE));
    tsuya_status status = strlen(text) == size ? parse(table, text, path, options)
                                               : tsuya_fail(TSUYA_ERROR_INPUT, "%s: a NUL byte at %zu; a text table is expected", path, strlen(text));
    tsuya_free(text);
    return status;
}

void tsuya_table_free(tsuya_table *table)
{
    for (int i = 0; i < table->column_count; i++) {
        tsuya_free(table->column[i]);
    }
    for (size_t i = 0; table->text && i < table->row_count * (size_t)table->column_count; i++) {
        tsuya_free(table->text[i]);
    }
    for (int i = 0; i < table->key_count; i++) {
        tsuya_free(table->key[i]);
        tsuya_free(table->key_value[i]);
    }
    tsuya_free(table->column);
    tsuya_free(table->value);
    tsuya_free(table->text);
    tsuya_free(table->line);
    tsuya_free(table->key);
    tsuya_free(table->key_value);
    tsuya_free(table->path);
    *table = (tsuya_table){0};
}

int tsuya_table_column(const tsuya_table *table, const char *name)
{
    for (int i = 0; i < table->column_count; i++) {
        if (strcmp(table->column[i], name) == 0) {
            return i;
        }
    }
    return -1;
}

const char *tsuya_table_key(const tsuya_table *table, const char *key)
{
    for (int i = 0; i < table->key_count; i++) {
        if (strcmp(table->key[i], key) == 0) {
            return table->key_value[i];
        }
    }
    return NULL;
}
