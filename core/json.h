/* JSON documents (cJSON behind one adapter).
 *
 * A value borrowed from a document lives as long as the document.  Getters say what is missing or of the wrong type with
 * the file's name and the path of the value ("calib.json: photos_used: expected a number"). Files above 256 MiB and
 * nesting above 200 are refused. NaN and infinities are written as null. */
#ifndef TSUYA_CORE_JSON_H
#define TSUYA_CORE_JSON_H

#include "core/status.h"

#include <stdbool.h>

typedef struct tsuya_json tsuya_json; /* a value inside a document, or the document (its root) */

TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_json_load(tsuya_json **root, const char *path);
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_json_parse(tsuya_json **root, const char *text, const char *name_for_messages);
TSUYA_API void tsuya_json_free(tsuya_json *root);

/* NULL when there is no such member or element. */
TSUYA_API const tsuya_json *tsuya_json_member(const tsuya_json *object, const char *key);
TSUYA_API const tsuya_json *tsuya_json_element(const tsuya_json *array, int index);
TSUYA_API int tsuya_json_count(const tsuya_json *array_or_object); /* 0 for others */
TSUYA_API const char *tsuya_json_key(const tsuya_json *member);    /* "" outside objects */
TSUYA_API const tsuya_json *tsuya_json_first(const tsuya_json *array_or_object); /* iteration, linear time */
TSUYA_API const tsuya_json *tsuya_json_next(const tsuya_json *value);
TSUYA_API bool tsuya_json_is_null(const tsuya_json *value);
TSUYA_API bool tsuya_json_is_number(const tsuya_json *value);
TSUYA_API bool tsuya_json_is_text(const tsuya_json *value);
TSUYA_API bool tsuya_json_is_array(const tsuya_json *value);
TSUYA_API bool tsuya_json_is_object(const tsuya_json *value);

TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_json_get_number(double *number, const tsuya_json *object, const char *key);
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_json_get_int(int *number, const tsuya_json *object, const char *key);
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_json_get_bool(bool *flag, const tsuya_json *object, const char *key);
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_json_get_text(const char **text, const tsuya_json *object, const char *key);
/* Exactly `count` numbers. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_json_get_numbers(double *numbers, int count, const tsuya_json *object, const char *key);
/* The value itself as a number or text; the fallback where it is of another kind or NULL. */
TSUYA_API double tsuya_json_number_or(const tsuya_json *value, double fallback);
TSUYA_API const char *tsuya_json_text_or(const tsuya_json *value, const char *fallback);

/* Building.  Setters never fail by themselves: a shortage of memory is kept and reported by save or print.
 * On an existing key they replace. add_* appends to an array. The returned children are borrowed. */
TSUYA_API tsuya_json *tsuya_json_create_object(void);
TSUYA_API void tsuya_json_set_number(tsuya_json *object, const char *key, double number);
TSUYA_API void tsuya_json_set_bool(tsuya_json *object, const char *key, bool flag);
TSUYA_API void tsuya_json_set_text(tsuya_json *object, const char *key, const char *text); /* NULL text: null */
TSUYA_API void tsuya_json_set_null(tsuya_json *object, const char *key);
TSUYA_API void tsuya_json_set_numbers(tsuya_json *object, const char *key, const double *numbers, int count);
TSUYA_API tsuya_json *tsuya_json_set_object(tsuya_json *object, const char *key);
TSUYA_API tsuya_json *tsuya_json_set_array(tsuya_json *object, const char *key);
TSUYA_API void tsuya_json_set_copy(tsuya_json *object, const char *key, const tsuya_json *value);
TSUYA_API void tsuya_json_remove(tsuya_json *object, const char *key);
TSUYA_API void tsuya_json_add_number(tsuya_json *array, double number);
TSUYA_API void tsuya_json_add_text(tsuya_json *array, const char *text);
TSUYA_API tsuya_json *tsuya_json_add_object(tsuya_json *array);
TSUYA_API tsuya_json *tsuya_json_add_array(tsuya_json *array);

/* Indented text with a newline at the end; doubles in the shortest form that reads back the same.  tsuya_free. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_json_print(char **text, const tsuya_json *root);
/* Atomic. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_json_save(const tsuya_json *root, const char *path);

#endif
