/* CSV tables with a header and units in the column names, and vnlog (the same with spaces and a "# name name" header).
 *
 * `# key=value` comment lines before or between rows are kept.  Errors name the file, line (row) and column.  NaN and
 * infinities are refused unless allowed; an empty cell is NaN and refused unless its column is allowed to be empty. */
#ifndef TSUYA_CORE_TABLE_H
#define TSUYA_CORE_TABLE_H

#include "core/status.h"

#include <stdbool.h>

typedef struct tsuya_table {
    char **column; /* names, in the file's order */
    int column_count;
    size_t row_count;
    double *value; /* row_count × column_count; NaN in text columns and empty cells */
    char **text;   /* row_count × column_count; NULL in numeric cells */
    int *line;     /* row_count: line in the file */
    char **key, **key_value;
    int key_count;
    char *path;
} tsuya_table;

typedef struct tsuya_table_options {
    const char *const *required;      /* NULL-terminated names that must be there */
    const char *const *known;         /* NULL-terminated; when given, any other name is an error with the nearest one */
    bool (*known_name)(const char *); /* further names that are accepted (nm390 …); may be NULL */
    const char *const *text;          /* NULL-terminated: columns of text */
    bool allow_empty;                 /* empty numeric cells */
    bool vnlog;
} tsuya_table_options;

TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_table_load(tsuya_table *table, const char *path, const tsuya_table_options *options);
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_table_parse(tsuya_table *table, const char *text, const char *name_for_messages,
                                                          const tsuya_table_options *options);
TSUYA_API void tsuya_table_free(tsuya_table *table);
TSUYA_API int tsuya_table_column(const tsuya_table *table, const char *name); /* −1 where missing */
TSUYA_API const char *tsuya_table_key(const tsuya_table *table, const char *key); /* NULL where missing */
static inline double tsuya_table_at(const tsuya_table *t, size_t row, int column)
{
    return t->value[row * (size_t)t->column_count + (size_t)column];
}

/* A whole text as a finite number; false on anything else ("1e5x", "", "nan"). */
TSUYA_API bool tsuya_parse_number(double *number, const char *text);
TSUYA_API bool tsuya_parse_int(long long *number, const char *text);
/* The nearest of NULL-terminated `names` by edit distance, for messages; one that begins with `name` or that `name` begins
 * with counts as near; NULL when none is. */
TSUYA_API const char *tsuya_nearest_name(const char *name, const char *const *names);

#endif
