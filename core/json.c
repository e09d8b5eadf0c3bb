/* cJSON behind core/json.h: a tsuya_json is a cJSON item. */
#include "core/json.h"

#include "core/file.h"

#include <cjson/cJSON.h>
#include <limits.h>
#include <math.h>
#include <pthread.h>
#include <stdlib.h>
#include <string.h>

enum { LARGEST_FILE = 256 << 20, DEEPEST = 200 };

/* A setter ran out of memory; the next print or save in this thread says so. */
static _Thread_local bool short_of_memory;

static cJSON *item_of(const tsuya_json *value)
{
    return (cJSON *)(uintptr_t)value;
}

static tsuya_json *value_of(cJSON *item)
{
    return (tsuya_json *)item;
}

/* cJSON reports a lack of memory and bad text alike; this tells them apart. */
static _Thread_local bool allocation_failed;

static void *allocate(size_t bytes)
{
    void *memory = tsuya_calloc(bytes, 1);
    allocation_failed = allocation_failed || !memory;
    return memory;
}

static void install_hooks(void)
{
    cJSON_Hooks hooks = {.malloc_fn = allocate, .free_fn = tsuya_free};
    cJSON_InitHooks(&hooks);
}

static void install_hooks_once(void)
{
    static pthread_once_t once = PTHREAD_ONCE_INIT;
    pthread_once(&once, install_hooks);
}

/* Deepest nesting of brackets outside strings. */
static int nesting_of(const char *text)
{
    int depth = 0, deepest = 0;
    bool inside = false;
    for (; *text; text++) {
        if (inside) {
            if (*text == '\\' && text[1]) {
                text++;
            } else if (*text == '"') {
                inside = false;
            }
        } else if (*text == '"') {
            inside = true;
        } else if (*text == '[' || *text == '{') {
            deepest = ++depth > deepest ? depth : deepest;
        } else if (*text == ']' || *text == '}') {
            depth--;
        }
    }
    return deepest;
}

tsuya_status tsuya_json_parse(tsuya_json **root, const char *text, const char *name)
{
    *root = NULL;
    install_hooks_once();
    int depth = nesting_of(text);
    if (depth > DEEPEST) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: nested %d deep, at most %d is accepted", name, depth, DEEPEST);
    }
    const char *end = NULL;
    allocation_failed = false;
    cJSON *item = cJSON_ParseWithOpts(text, &end, 1);
    if (!item && allocation_failed) {
        return TSUYA_ERROR_MEMORY;
    }
    if (!item) {
        int line = 1;
        for (const char *p = text; end && p < end && *p; p++) {
            line += *p == '\n';
        }
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: not JSON near \"%.20s\"", name, line, end ? end : "");
    }
    if (!cJSON_IsObject(item) && !cJSON_IsArray(item)) {
        cJSON_Delete(item);
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: a JSON object or array was expected", name);
    }
    item->string = tsuya_strdup(name); /* a root has no key: its place keeps the file's name for messages */
    if (!item->string) {
        cJSON_Delete(item);
        return TSUYA_ERROR_MEMORY;
    }
    *root = value_of(item);
    return TSUYA_OK;
}

tsuya_status tsuya_json_load(tsuya_json **root, const char *path)
{
    char *text;
    size_t size;
    *root = NULL;
    TSUYA_TRY(tsuya_file_load(&text, &size, path, LARGEST_FILE));
    tsuya_status status = strlen(text) == size ? tsuya_json_parse(root, text, path)
                                               : tsuya_fail(TSUYA_ERROR_INPUT, "%s: not JSON: a NUL byte at %zu", path, strlen(text));
    tsuya_free(text);
    return status;
}

void tsuya_json_free(tsuya_json *root)
{
    cJSON_Delete(item_of(root));
}

const tsuya_json *tsuya_json_member(const tsuya_json *object, const char *key)
{
    return cJSON_IsObject(item_of(object)) ? value_of(cJSON_GetObjectItemCaseSensitive(item_of(object), key)) : NULL;
}

const tsuya_json *tsuya_json_element(const tsuya_json *array, int index)
{
    return cJSON_IsArray(item_of(array)) && index >= 0 ? value_of(cJSON_GetArrayItem(item_of(array), index)) : NULL;
}

static bool is_container(const tsuya_json *value)
{
    return cJSON_IsArray(item_of(value)) || cJSON_IsObject(item_of(value));
}

int tsuya_json_count(const tsuya_json *value)
{
    return is_container(value) ? cJSON_GetArraySize(item_of(value)) : 0;
}

const char *tsuya_json_key(const tsuya_json *member)
{
    const cJSON *item = item_of(member);
    return item && item->string ? item->string : "";
}

const tsuya_json *tsuya_json_first(const tsuya_json *value)
{
    return is_container(value) ? value_of(item_of(value)->child) : NULL;
}

const tsuya_json *tsuya_json_next(const tsuya_json *value)
{
    return value ? value_of(item_of(value)->next) : NULL;
}

bool tsuya_json_is_null(const tsuya_json *value) { return cJSON_IsNull(item_of(value)); }
bool tsuya_json_is_number(const tsuya_json *value) { return cJSON_IsNumber(item_of(value)) && isfinite(item_of(value)->valuedouble); }
bool tsuya_json_is_text(const tsuya_json *value) { return cJSON_IsString(item_of(value)); }
bool tsuya_json_is_array(const tsuya_json *value) { return cJSON_IsArray(item_of(value)); }
bool tsuya_json_is_object(const tsuya_json *value) { return cJSON_IsObject(item_of(value)); }

/* The root's key is the file's name, a member's is its own, so messages read "calib.json: photos_used: …". */
static tsuya_status fail_member(const tsuya_json *object, const char *key, const char *expected)
{
    const char *where = tsuya_json_key(object);
    const char *found = tsuya_json_member(object, key) ? "" : " and is missing";
    return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %s: expected %s%s", where[0] ? where : "JSON", key, expected, found);
}

tsuya_status tsuya_json_get_number(double *number, const tsuya_json *object, const char *key)
{
    const tsuya_json *value = tsuya_json_member(object, key);
    if (!tsuya_json_is_number(value)) {
        return fail_member(object, key, "a number");
    }
    *number = item_of(value)->valuedouble;
    return TSUYA_OK;
}

tsuya_status tsuya_json_get_int(int *number, const tsuya_json *object, const char *key)
{
    double value = tsuya_json_number_or(tsuya_json_member(object, key), NAN);
    if (!(value == floor(value)) || fabs(value) > INT_MAX) {
        return fail_member(object, key, "a whole number");
    }
    *number = (int)value;
    return TSUYA_OK;
}

tsuya_status tsuya_json_get_bool(bool *flag, const tsuya_json *object, const char *key)
{
    const tsuya_json *value = tsuya_json_member(object, key);
    if (!cJSON_IsBool(item_of(value))) {
        return fail_member(object, key, "true or false");
    }
    *flag = cJSON_IsTrue(item_of(value));
    return TSUYA_OK;
}

tsuya_status tsuya_json_get_text(const char **text, const tsuya_json *object, const char *key)
{
    const tsuya_json *value = tsuya_json_member(object, key);
    if (!tsuya_json_is_text(value)) {
        return fail_member(object, key, "a text");
    }
    *text = item_of(value)->valuestring;
    return TSUYA_OK;
}

tsuya_status tsuya_json_get_numbers(double *numbers, int count, const tsuya_json *object, const char *key)
{
    char expected[64];
    snprintf(expected, sizeof expected, "an array of %d numbers", count);
    const tsuya_json *array = tsuya_json_member(object, key);
    if (!tsuya_json_is_array(array) || tsuya_json_count(array) != count) {
        return fail_member(object, key, expected);
    }
    const tsuya_json *value = tsuya_json_first(array);
    for (int i = 0; i < count; i++, value = tsuya_json_next(value)) {
        if (!tsuya_json_is_number(value)) {
            return fail_member(object, key, expected);
        }
        numbers[i] = item_of(value)->valuedouble;
    }
    return TSUYA_OK;
}

double tsuya_json_number_or(const tsuya_json *value, double fallback)
{
    return tsuya_json_is_number(value) ? item_of(value)->valuedouble : fallback;
}

const char *tsuya_json_text_or(const tsuya_json *value, const char *fallback)
{
    return tsuya_json_is_text(value) ? item_of(value)->valuestring : fallback;
}

static cJSON *made(cJSON *item)
{
    if (!item) {
        short_of_memory = true;
    }
    return item;
}

tsuya_json *tsuya_json_create_object(void)
{
    install_hooks_once();
    return value_of(made(cJSON_CreateObject()));
}

/* Puts `item` under the key, in the place of an older one; NULL when memory is short. */
static tsuya_json *put(tsuya_json *object, const char *key, cJSON *item)
{
    if (!object || !made(item)) {
        cJSON_Delete(item);
        return NULL;
    }
    cJSON *parent = item_of(object);
    bool fine = cJSON_GetObjectItemCaseSensitive(parent, key) ? cJSON_ReplaceItemInObjectCaseSensitive(parent, key, item)
                                                              : cJSON_AddItemToObject(parent, key, item);
    if (!fine) {
        short_of_memory = true;
        cJSON_Delete(item);
        return NULL;
    }
    return value_of(item);
}

static cJSON *number_item(double number)
{
    return isfinite(number) ? cJSON_CreateNumber(number) : cJSON_CreateNull();
}

void tsuya_json_set_number(tsuya_json *object, const char *key, double number) { put(object, key, number_item(number)); }
void tsuya_json_set_bool(tsuya_json *object, const char *key, bool flag) { put(object, key, cJSON_CreateBool(flag)); }
void tsuya_json_set_null(tsuya_json *object, const char *key) { put(object, key, cJSON_CreateNull()); }
void tsuya_json_set_text(tsuya_json *object, const char *key, const char *text)
{
    put(object, key, text ? cJSON_CreateString(text) : cJSON_CreateNull());
}

void tsuya_json_set_numbers(tsuya_json *object, const char *key, const double *numbers, int count)
{
    tsuya_json *array = tsuya_json_set_array(object, key);
    for (int i = 0; i < count; i++) {
        tsuya_json_add_number(array, numbers[i]);
    }
}

tsuya_json *tsuya_json_set_object(tsuya_json *object, const char *key) { return put(object, key, cJSON_CreateObject()); }
tsuya_json *tsuya_json_set_array(tsuya_json *object, const char *key) { return put(object, key, cJSON_CreateArray()); }

void tsuya_json_set_copy(tsuya_json *object, const char *key, const tsuya_json *value)
{
    put(object, key, cJSON_Duplicate(item_of(value), 1));
}

void tsuya_json_remove(tsuya_json *object, const char *key)
{
    cJSON_DeleteItemFromObjectCaseSensitive(item_of(object), key);
}

static tsuya_json *append(tsuya_json *array, cJSON *item)
{
    if (!array || !made(item) || !cJSON_AddItemToArray(item_of(array), item)) {
        cJSON_Delete(item);
        return NULL;
    }
    return value_of(item);
}

void tsuya_json_add_number(tsuya_json *array, double number) { append(array, number_item(number)); }
void tsuya_json_add_text(tsuya_json *array, const char *text) { append(array, cJSON_CreateString(text)); }
tsuya_json *tsuya_json_add_object(tsuya_json *array) { return append(array, cJSON_CreateObject()); }
tsuya_json *tsuya_json_add_array(tsuya_json *array) { return append(array, cJSON_CreateArray()); }

/* cJSON prints with tabs and its own number format; both are ours here, so that files are the same everywhere. */
static void print_text(FILE *stream, const char *text)
{
    fputc('"', stream);
    for (; *text; text++) {
        unsigned char c = (unsigned char)*text;
        switch (c) {
        case '"': fputs("\\\"", stream); break;
        case '\\': fputs("\\\\", stream); break;
        case '\n': fputs("\\n", stream); break;
        case '\r': fputs("\\r", stream); break;
        case '\t': fputs("\\t", stream); break;
        default:
            if (c < 0x20) {
                fprintf(stream, "\\u%04x", c);
            } else {
                fputc(c, stream);
            }
        }
    }
    fputc('"', stream);
}

static void print_number(FILE *stream, double number)
{
    char text[40];
    for (int digits = 15; digits <= 17; digits++) { /* the shortest that reads back the same */
        snprintf(text, sizeof text, "%.*g", digits, number);
        if (strtod(text, NULL) == number) {
            break;
        }
    }
    fputs(text, stream);
}

/* Arrays of plain numbers stay on one line. */
static bool is_flat(const cJSON *item)
{
    for (const cJSON *child = item->child; child; child = child->next) {
        if (cJSON_IsArray(child) || cJSON_IsObject(child)) {
            return false;
        }
    }
    return cJSON_IsArray(item);
}

static void print_item(FILE *stream, const cJSON *item, int depth)
{
    if (cJSON_IsString(item)) {
        print_text(stream, item->valuestring);
    } else if (cJSON_IsNumber(item)) {
        print_number(stream, item->valuedouble);
    } else if (cJSON_IsBool(item)) {
        fputs(cJSON_IsTrue(item) ? "true" : "false", stream);
    } else if (cJSON_IsNull(item)) {
        fputs("null", stream);
    } else {
        bool object = cJSON_IsObject(item), flat = is_flat(item);
        fputc(object ? '{' : '[', stream);
        for (const cJSON *child = item->child; child; child = child->next) {
            if (flat) {
                fputs(child == item->child ? "" : " ", stream);
            } else {
                fprintf(stream, "\n%*s", 2 * (depth + 1), "");
            }
            if (object) {
                print_text(stream, child->string ? child->string : "");
                fputs(": ", stream);
            }
            print_item(stream, child, depth + 1);
            fputs(child->next ? "," : "", stream);
        }
        if (item->child && !flat) {
            fprintf(stream, "\n%*s", 2 * depth, "");
        }
        fputc(object ? '}' : ']', stream);
    }
}

tsuya_status tsuya_json_print(char **text, const tsuya_json *root)
{
    *text = NULL;
    if (!root || short_of_memory) {
        short_of_memory = false;
        return tsuya_fail(TSUYA_ERROR_MEMORY, "out of memory while building a JSON document");
    }
    char *memory = NULL;
    size_t size = 0;
    FILE *stream = open_memstream(&memory, &size);
    if (!stream) {
        return tsuya_fail(TSUYA_ERROR_MEMORY, "out of memory while printing JSON");
    }
    print_item(stream, item_of(root), 0);
    fputc('\n', stream);
    bool failed = ferror(stream) != 0;
    if (fclose(stream) != 0 || failed || !memory) {
        free(memory);
        return tsuya_fail(TSUYA_ERROR_MEMORY, "out of memory while printing JSON");
    }
    *text = tsuya_strdup(memory); /* so that tsuya_free fits it */
    free(memory);
    return *text ? TSUYA_OK : TSUYA_ERROR_MEMORY;
}

tsuya_status tsuya_json_save(const tsuya_json *root, const char *path)
{
    char *text;
    TSUYA_TRY(tsuya_json_print(&text, root));
    tsuya_status status = tsuya_file_write(path, text, strlen(text));
    tsuya_free(text);
    return status;
}
