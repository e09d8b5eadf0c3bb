#include "core/ply_header.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

enum { LINE_SIZE = 4096, HEADER_LINES_MAX = 65536, WORDS_MAX = 6 };

static const struct {
    const char *name, *alias;
    ply_type type;
    int size;
} types[] = {
    {"char", "int8", PLY_I8, 1},     {"uchar", "uint8", PLY_U8, 1},     {"short", "int16", PLY_I16, 2},
    {"ushort", "uint16", PLY_U16, 2}, {"int", "int32", PLY_I32, 4},      {"uint", "uint32", PLY_U32, 4},
    {"float", "float32", PLY_F32, 4}, {"double", "float64", PLY_F64, 8},
};

int tsuya_ply_type_size(ply_type type)
{
    for (size_t t = 0; t < sizeof types / sizeof *types; t++) {
        if (types[t].type == type) {
            return types[t].size;
        }
    }
    return 0;
}

static ply_type type_of_name(const char *name)
{
    for (size_t t = 0; t < sizeof types / sizeof *types; t++) {
        if (strcmp(name, types[t].name) == 0 || strcmp(name, types[t].alias) == 0) {
            return types[t].type;
        }
    }
    return PLY_NONE;
}

/* One line without its end ("\n" or "\r\n"); *got is false at the end of the file. Overlong lines are cut: only comments
 * may be that long, and what is cut from another line fails as an unknown word. */
static tsuya_status read_line(char line[LINE_SIZE], bool *got, ply_header *header, FILE *stream, const char *path)
{
    size_t length = 0;
    int c;
    while ((c = getc(stream)) != EOF && c != '\n') {
        header->bytes++;
        if (length < LINE_SIZE - 1) {
            line[length++] = (char)c;
        }
    }
    if (ferror(stream)) {
        return tsuya_fail_errno(path, "reading the header");
    }
    header->bytes += c == '\n';
    header->lines++;
    if (length > 0 && line[length - 1] == '\r') {
        length--;
    }
    line[length] = '\0';
    *got = c == '\n';
    return TSUYA_OK;
}

static int split(char *line, char *word[WORDS_MAX])
{
    int count = 0;
    char *state = NULL;
    for (char *w = strtok_r(line, " \t", &state); w && count < WORDS_MAX; w = strtok_r(NULL, " \t", &state)) {
        word[count++] = w;
    }
    return count;
}

static tsuya_status copy_name(char name[PLY_NAME_SIZE], const char *word, const ply_header *header, const char *path)
{
    if (strlen(word) >= PLY_NAME_SIZE) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: the name %.20s… is longer than %d characters", path,
                          header->lines, word, PLY_NAME_SIZE - 1);
    }
    strcpy(name, word);
    return TSUYA_OK;
}

static tsuya_status parse_element(ply_header *header, char **word, int words, const char *path)
{
    if (words != 3) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: an element needs a name and a count", path, header->lines);
    }
    char *end = word[2];
    errno = 0;
    unsigned long long count = word[2][0] >= '0' && word[2][0] <= '9' ? strtoull(word[2], &end, 10) : 0;
    if (end == word[2] || *end != '\0' || errno != 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: %.40s is no count of element %.40s; a whole number from 0 is", path,
                          header->lines, word[2], word[1]);
    }
    if (header->element_count == PLY_ELEMENTS_MAX) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: more than %d elements", path, header->lines, PLY_ELEMENTS_MAX);
    }
    for (int e = 0; e < header->element_count; e++) {
        if (strcmp(header->element[e].name, word[1]) == 0) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: element %s stands there twice", path, header->lines, word[1]);
        }
    }
    ply_element *element = &header->element[header->element_count++];
    element->count = count;
    element->first_property = header->property_count;
    return copy_name(element->name, word[1], header, path);
}

static tsuya_status parse_property(ply_header *header, char **word, int words, const char *path)
{
    bool list = words > 1 && strcmp(word[1], "list") == 0;
    if (header->element_count == 0 || words != (list ? 5 : 3)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: a property belongs to an element and reads \"property TYPE NAME\" "
                          "or \"property list TYPE TYPE NAME\"", path, header->lines);
    }
    if (header->property_count == PLY_PROPERTIES_MAX) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: more than %d properties", path, header->lines, PLY_PROPERTIES_MAX);
    }
    ply_element *element = &header->element[header->element_count - 1];
    ply_property property = {.type = type_of_name(word[list ? 3 : 1]),
                             .count_type = list ? type_of_name(word[2]) : PLY_NONE};
    bool count_is_whole = !list || (property.count_type != PLY_NONE && property.count_type < PLY_F32);
    if (property.type == PLY_NONE || !count_is_whole) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: %.20s is no type here; char uchar short ushort int uint%s", path,
                          header->lines, count_is_whole ? word[list ? 3 : 1] : word[2],
                          count_is_whole ? " float double are" : " are");
    }
    TSUYA_TRY(copy_name(property.name, word[words - 1], header, path));
    for (int p = element->first_property; p < header->property_count; p++) {
        if (strcmp(header->property[p].name, property.name) == 0) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: property %s of %s stands there twice", path, header->lines,
                              property.name, element->name);
        }
    }
    header->property[header->property_count++] = property;
    element->property_count++;
    return TSUYA_OK;
}

static tsuya_status parse_format(ply_header *header, char **word, int words, const char *path)
{
    static const char *const names[] = {"ascii", "binary_little_endian", "binary_big_endian"};
    for (int f = 0; words == 3 && strcmp(word[2], "1.0") == 0 && f < 3; f++) {
        if (strcmp(word[1], names[f]) == 0) {
            header->format = (ply_format)f;
            return TSUYA_OK;
        }
    }
    return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: unknown PLY format; ascii, binary_little_endian or binary_big_endian "
                      "and 1.0 are accepted", path, header->lines);
}

/* *done at end_header. */
static tsuya_status parse_line(ply_header *header, bool *done, char *line, const char *path)
{
    char *word[WORDS_MAX];
    int words = split(line, word);
    if (words == 0 || strcmp(word[0], "comment") == 0 || strcmp(word[0], "obj_info") == 0) {
        return TSUYA_OK;
    }
    if (strcmp(word[0], "element") == 0) {
        return parse_element(header, word, words, path);
    }
    if (strcmp(word[0], "property") == 0) {
        return parse_property(header, word, words, path);
    }
    if (strcmp(word[0], "end_header") == 0) {
        *done = true;
        return TSUYA_OK;
    }
    return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: %.40s is no keyword of a PLY header", path, header->lines, word[0]);
}

tsuya_status tsuya_ply_header_read(ply_header *header, FILE *stream, const char *path)
{
    *header = (ply_header){0};
    char line[LINE_SIZE], *word[WORDS_MAX];
    bool got, done = false;
    TSUYA_TRY(read_line(line, &got, header, stream, path));
    if (!got || strcmp(line, "ply") != 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: not a PLY file: the first line is not \"ply\"", path);
    }
    TSUYA_TRY(read_line(line, &got, header, stream, path));
    int words = split(line, word);
    if (words == 0 || strcmp(word[0], "format") != 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line 2: \"format\" is expected", path);
    }
    TSUYA_TRY(parse_format(header, word, words, path));
    while (!done) {
        TSUYA_TRY(read_line(line, &got, header, stream, path));
        if (!got || header->lines > HEADER_LINES_MAX) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: the header has no end_header line%s", path,
                              got ? " within its first 65536 lines" : " (the file is cut off)");
        }
        TSUYA_TRY(parse_line(header, &done, line, path));
    }
    return TSUYA_OK;
}
