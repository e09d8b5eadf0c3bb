/* YAML files read by a schema (libyaml behind one adapter).
 *
 * The schema is a table of keys; the reader refuses unknown keys (naming the nearest known one), wrong types and missing
 * keys with file, line and key.  Strings and arrays live in the caller's arena.  Anchors, aliases, a second
 * document and files above 16 MiB are refused. */
#ifndef TSUYA_CORE_YAML_H
#define TSUYA_CORE_YAML_H

#include "core/memory.h"

typedef enum tsuya_yaml_kind {
    TSUYA_YAML_TEXT,    /* const char *, NULL where absent */
    TSUYA_YAML_NUMBER,  /* double, NaN where absent; must be finite */
    TSUYA_YAML_INT,     /* int, INT_MIN where absent */
    TSUYA_YAML_BOOL,    /* bool, false where absent */
    TSUYA_YAML_RECORD,  /* embedded struct of `fields`, with `presence_offset` a bool in the parent */
    TSUYA_YAML_RECORDS, /* tsuya_yaml_list of structs of `fields`, `size` bytes each */
    TSUYA_YAML_NUMBERS, /* tsuya_yaml_list of double */
    TSUYA_YAML_TEXTS,   /* tsuya_yaml_list of const char * */
    TSUYA_YAML_TEXT_LISTS, /* tsuya_yaml_list of tsuya_yaml_list of const char * (scalars as written) */
} tsuya_yaml_kind;

typedef struct tsuya_yaml_list {
    void *item;
    int count;
} tsuya_yaml_list;

typedef struct tsuya_yaml_field {
    const char *key; /* NULL ends the table */
    tsuya_yaml_kind kind;
    size_t offset;
    bool required;
    const struct tsuya_yaml_field *fields; /* RECORD, RECORDS */
    size_t size;                           /* RECORD, RECORDS: bytes of the struct */
    size_t presence_offset;                /* RECORD: offset in the parent of a bool that says it was there */
} tsuya_yaml_field;

/* Fills `record` (size bytes) from a file whose top level is a mapping. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_yaml_load(void *record, size_t size, const tsuya_yaml_field *fields,
                                                        const char *path, tsuya_arena *arena);
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_yaml_parse(void *record, size_t size, const tsuya_yaml_field *fields,
                                                         const char *text, const char *name_for_messages, tsuya_arena *arena);

#endif
