/* libyaml behind core/yaml.h.
 *
 * Not libcyaml, which sits on the same parser: it has no sequence inside a sequence (CYAML_ERR_SEQUENCE_IN_SEQUENCE; a job's
 * `scale: {distances: [[…]]}` is one) and tells lines and unknown keys only in its log. */
#include "core/yaml.h"

#include "core/file.h"
#include "core/table.h"

#include <limits.h>
#include <math.h>
#include <string.h>
#include <yaml.h>

enum { LARGEST_FILE = 16 << 20, MOST_FIELDS = 128, DEEPEST = 64 };

typedef struct loader {
    yaml_document_t document;
    const char *name;
    tsuya_arena *arena;
} loader;

static int line_of(const yaml_node_t *node)
{
    return (int)node->start_mark.line + 1;
}

static yaml_node_t *node_at(loader *l, int index)
{
    return yaml_document_get_node(&l->document, index);
}

static const char *text_of(const yaml_node_t *node)
{
    return node->type == YAML_SCALAR_NODE ? (const char *)node->data.scalar.value : "";
}

static tsuya_status fail_kind(const loader *l, const yaml_node_t *node, const char *key, const char *expected)
{
    const char *kind = node->type == YAML_SEQUENCE_NODE ? "a list" : node->type == YAML_MAPPING_NODE ? "a mapping" : text_of(node);
    return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: %s: %s is expected, not \"%.60s\"", l->name, line_of(node), key, expected, kind);
}

static tsuya_status take_text(loader *l, yaml_node_t *node, const char *key, const char **text)
{
    if (node->type != YAML_SCALAR_NODE) {
        return fail_kind(l, node, key, "a text");
    }
    if (strlen(text_of(node)) != node->data.scalar.length) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: %s: a text without NUL bytes is expected", l->name, line_of(node), key);
    }
    *text = tsuya_arena_printf(l->arena, "%s", text_of(node));
    return *text ? TSUYA_OK : TSUYA_ERROR_MEMORY;
}

static tsuya_status take_number(loader *l, yaml_node_t *node, const char *key, double *number)
{
    return tsuya_parse_number(number, text_of(node)) ? TSUYA_OK : fail_kind(l, node, key, "a number");
}

static tsuya_status take_int(loader *l, yaml_node_t *node, const char *key, int *number)
{
    long long value;
    if (!tsuya_parse_int(&value, text_of(node)) || value > INT_MAX || value <= INT_MIN) {
        return fail_kind(l, node, key, "a whole number");
    }
    *number = (int)value;
    return TSUYA_OK;
}

static tsuya_status take_bool(loader *l, yaml_node_t *node, const char *key, bool *flag)
{
    if (strcmp(text_of(node), "true") != 0 && strcmp(text_of(node), "false") != 0) {
        return fail_kind(l, node, key, "true or false");
    }
    *flag = text_of(node)[0] == 't';
    return TSUYA_OK;
}

static tsuya_status take_mapping(loader *l, yaml_node_t *node, void *record, size_t size, const tsuya_yaml_field *fields);
static tsuya_status take_value(loader *l, yaml_node_t *node, const tsuya_yaml_field *field, void *place);

/* A list whose items are of `item` bytes each and read as `kind`. */
static tsuya_status take_list(loader *l, yaml_node_t *node, const tsuya_yaml_field *field, tsuya_yaml_kind kind, size_t item,
                              tsuya_yaml_list *list)
{
    if (node->type != YAML_SEQUENCE_NODE) {
        return fail_kind(l, node, field->key, "a list");
    }
    size_t count = (size_t)(node->data.sequence.items.top - node->data.sequence.items.start);
    list->item = tsuya_arena_alloc(l->arena, count, item);
    if (!list->item) {
        return TSUYA_ERROR_MEMORY;
    }
    list->count = (int)count;
    tsuya_yaml_field one = *field;
    one.kind = kind;
    for (size_t i = 0; i < count; i++) {
        char *place = (char *)list->item + i * item;
        yaml_node_t *child = node_at(l, node->data.sequence.items.start[i]);
        TSUYA_TRY(kind == TSUYA_YAML_RECORD ? take_mapping(l, child, place, item, field->fields) : take_value(l, child, &one, place));
    }
    return TSUYA_OK;
}

static tsuya_status take_value(loader *l, yaml_node_t *node, const tsuya_yaml_field *field, void *place)
{
    switch (field->kind) {
    case TSUYA_YAML_TEXT: return take_text(l, node, field->key, place);
    case TSUYA_YAML_NUMBER: return take_number(l, node, field->key, place);
    case TSUYA_YAML_INT: return take_int(l, node, field->key, place);
    case TSUYA_YAML_BOOL: return take_bool(l, node, field->key, place);
    case TSUYA_YAML_RECORD: return take_mapping(l, node, place, field->size, field->fields);
    case TSUYA_YAML_RECORDS: return take_list(l, node, field, TSUYA_YAML_RECORD, field->size, place);
    case TSUYA_YAML_NUMBERS: return take_list(l, node, field, TSUYA_YAML_NUMBER, sizeof(double), place);
    case TSUYA_YAML_TEXTS: return take_list(l, node, field, TSUYA_YAML_TEXT, sizeof(const char *), place);
    case TSUYA_YAML_TEXT_LISTS: return take_list(l, node, field, TSUYA_YAML_TEXTS, sizeof(tsuya_yaml_list), place);
    }
    return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %s: a kind of value that the reader does not know", l->name, field->key);
}

static tsuya_status fail_unknown(const loader *l, const yaml_node_t *node, const tsuya_yaml_field *fields)
{
    const char *names[MOST_FIELDS + 1];
    int count = 0;
    for (; fields[count].key && count < MOST_FIELDS; count++) {
        names[count] = fields[count].key;
    }
    names[count] = NULL;
    const char *near = tsuya_nearest_name(text_of(node), names);
    return near ? tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: unknown key \"%.60s\"; did you mean \"%s\"?", l->name, line_of(node), text_of(node), near)
                : tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: unknown key \"%.60s\"", l->name, line_of(node), text_of(node));
}

static void set_absent(void *record, size_t size, const tsuya_yaml_field *fields)
{
    memset(record, 0, size);
    for (const tsuya_yaml_field *field = fields; field->key; field++) {
        char *place = (char *)record + field->offset;
        if (field->kind == TSUYA_YAML_NUMBER) {
            *(double *)place = NAN;
        } else if (field->kind == TSUYA_YAML_INT) {
            *(int *)place = INT_MIN;
        } else if (field->kind == TSUYA_YAML_RECORD) {
            set_absent(place, field->size, field->fields);
        }
    }
}

static tsuya_status take_mapping(loader *l, yaml_node_t *node, void *record, size_t size, const tsuya_yaml_field *fields)
{
    bool seen[MOST_FIELDS] = {false};
    set_absent(record, size, fields);
    if (node->type != YAML_MAPPING_NODE) {
        return fail_kind(l, node, "the value", "a mapping of keys");
    }
    for (yaml_node_pair_t *pair = node->data.mapping.pairs.start; pair < node->data.mapping.pairs.top; pair++) {
        yaml_node_t *key = node_at(l, pair->key), *value = node_at(l, pair->value);
        int i = 0;
        while (fields[i].key && strcmp(fields[i].key, text_of(key)) != 0) {
            i++;
        }
        if (!fields[i].key || i >= MOST_FIELDS) {
            return fail_unknown(l, key, fields);
        }
        if (seen[i]) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: key \"%s\" occurs twice", l->name, line_of(key), fields[i].key);
        }
        seen[i] = true;
        TSUYA_TRY(take_value(l, value, &fields[i], (char *)record + fields[i].offset));
        if (fields[i].kind == TSUYA_YAML_RECORD) {
            *(bool *)((char *)record + fields[i].presence_offset) = true;
        }
    }
    for (int i = 0; fields[i].key; i++) {
        if (fields[i].required && !seen[i]) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: key \"%s\" is missing", l->name, line_of(node), fields[i].key);
        }
    }
    return TSUYA_OK;
}

typedef struct stream_check {
    int documents, depth;
} stream_check;

/* Aliases let a small file stand for a large tree, or for one without end; libyaml's time grows with the square of the depth;
 * a second document would be passed over. */
static tsuya_status check_event(stream_check *check, const yaml_event_t *event, const char *name)
{
    const yaml_char_t *anchor = event->type == YAML_SCALAR_EVENT         ? event->data.scalar.anchor
                              : event->type == YAML_SEQUENCE_START_EVENT ? event->data.sequence_start.anchor
                              : event->type == YAML_MAPPING_START_EVENT  ? event->data.mapping_start.anchor
                                                                         : NULL;
    int line = (int)event->start_mark.line + 1;
    if (anchor) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: an anchor (&%.40s); values written out are accepted", name, line, (const char *)anchor);
    }
    if (event->type == YAML_ALIAS_EVENT) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: an alias (*name); values written out are accepted", name, line);
    }
    check->depth += event->type == YAML_SEQUENCE_START_EVENT || event->type == YAML_MAPPING_START_EVENT;
    check->depth -= event->type == YAML_SEQUENCE_END_EVENT || event->type == YAML_MAPPING_END_EVENT;
    if (check->depth > DEEPEST) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: nested more than %d deep", name, line, DEEPEST);
    }
    check->documents += event->type == YAML_DOCUMENT_START_EVENT;
    if (check->documents > 1) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: a second document; one is accepted", name, line);
    }
    return TSUYA_OK;
}

static tsuya_status check_stream(const char *text, size_t size, const char *name)
{
    yaml_parser_t parser;
    yaml_event_t event;
    tsuya_status status = TSUYA_OK;
    stream_check check = {0};
    if (!yaml_parser_initialize(&parser)) {
        return tsuya_fail(TSUYA_ERROR_MEMORY, "%s: out of memory", name);
    }
    yaml_parser_set_input_string(&parser, (const unsigned char *)text, size);
    for (bool more = true; more && status == TSUYA_OK;) {
        if (!yaml_parser_parse(&parser, &event)) {
            break; /* the loader says what is wrong */
        }
        status = check_event(&check, &event, name);
        more = event.type != YAML_STREAM_END_EVENT;
        yaml_event_delete(&event);
    }
    yaml_parser_delete(&parser);
    return status;
}

static tsuya_status parse(void *record, size_t size, const tsuya_yaml_field *fields, const char *text, size_t length, const char *name,
                          tsuya_arena *arena)
{
    loader l = {.name = name, .arena = arena};
    yaml_parser_t parser;
    TSUYA_TRY(check_stream(text, length, name));
    if (!yaml_parser_initialize(&parser)) {
        return tsuya_fail(TSUYA_ERROR_MEMORY, "%s: out of memory", name);
    }
    yaml_parser_set_input_string(&parser, (const unsigned char *)text, length);
    tsuya_status status;
    if (!yaml_parser_load(&parser, &l.document)) {
        status = tsuya_fail(parser.error == YAML_MEMORY_ERROR ? TSUYA_ERROR_MEMORY : TSUYA_ERROR_INPUT, "%s: line %d: not YAML: %s", name,
                            (int)parser.problem_mark.line + 1, parser.problem ? parser.problem : "damaged");
        yaml_parser_delete(&parser);
        return status;
    }
    yaml_node_t *root = yaml_document_get_root_node(&l.document);
    status = root ? take_mapping(&l, root, record, size, fields) : tsuya_fail(TSUYA_ERROR_INPUT, "%s: empty; a mapping of keys is expected", name);
    yaml_document_delete(&l.document);
    yaml_parser_delete(&parser);
    return status;
}

tsuya_status tsuya_yaml_parse(void *record, size_t size, const tsuya_yaml_field *fields, const char *text, const char *name, tsuya_arena *arena)
{
    return parse(record, size, fields, text, strlen(text), name, arena);
}

tsuya_status tsuya_yaml_load(void *record, size_t size, const tsuya_yaml_field *fields, const char *path, tsuya_arena *arena)
{
    char *text;
    size_t length;
    TSUYA_TRY(tsuya_file_load(&text, &length, path, LARGEST_FILE));
    tsuya_status status = parse(record, size, fields, text, length, path, arena);
    tsuya_free(text);
    return status;
}
