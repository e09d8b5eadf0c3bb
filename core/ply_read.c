/* Reads PLY 1.0 (Turk, "The PLY polygon file format", 1994).  The file is hostile until shown otherwise: every count is
 * held against the bytes that are left before memory is taken for it. */
#include "core/memory.h"
#include "core/mesh.h"
#include "core/mesh_arrays.h"
#include "core/ply_header.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>

enum { BUFFER_SIZE = 1 << 18, TOKEN_SIZE = 64, LIST_MAX = 255 };

/* Where a vertex property goes; array NULL: passed over. */
typedef struct target {
    const tsuya_mesh_array *array;
    int component;
} target;

typedef struct reader {
    const char *path;
    FILE *stream;
    ply_header header;
    uint64_t left; /* bytes of the body not yet taken */
    uint8_t *buffer;
    size_t begin, end; /* of the bytes read ahead */
    int line;          /* ASCII */
    target target[PLY_PROPERTIES_MAX];
    size_t triangle_capacity;
} reader;

static tsuya_status fail_truncated(const reader *r, const ply_element *element, uint64_t row)
{
    if (ferror(r->stream)) {
        return tsuya_fail_errno(r->path, "reading");
    }
    return tsuya_fail(TSUYA_ERROR_INPUT, "%s: the file ends inside %s %llu of %llu", r->path, element->name,
                      (unsigned long long)row, (unsigned long long)element->count);
}

/* At least `size` bytes in the buffer, or what the file has. */
static size_t refill(reader *r, size_t size)
{
    size_t have = r->end - r->begin;
    if (have < size) {
        memmove(r->buffer, r->buffer + r->begin, have);
        r->begin = 0;
        r->end = have + fread(r->buffer + have, 1, BUFFER_SIZE - have, r->stream);
        have = r->end;
    }
    return have;
}

static bool take_binary(reader *r, double *number, ply_type type)
{
    size_t size = (size_t)tsuya_ply_type_size(type);
    if (refill(r, size) < size) {
        return false;
    }
    uint8_t b[8];
    bool swap = (r->header.format == PLY_BIG) != (__BYTE_ORDER__ == __ORDER_BIG_ENDIAN__);
    for (size_t k = 0; k < size; k++) {
        b[swap ? size - 1 - k : k] = r->buffer[r->begin + k];
    }
    r->begin += size;
    r->left -= size;
    union { int8_t i8; uint8_t u8; int16_t i16; uint16_t u16; int32_t i32; uint32_t u32; float f32; double f64; } v;
    memcpy(&v, b, size);
    switch (type) {
    case PLY_I8: *number = v.i8; break;
    case PLY_U8: *number = v.u8; break;
    case PLY_I16: *number = v.i16; break;
    case PLY_U16: *number = v.u16; break;
    case PLY_I32: *number = v.i32; break;
    case PLY_U32: *number = v.u32; break;
    case PLY_F32: *number = (double)v.f32; break;
    default: *number = v.f64; break;
    }
    return true;
}

static bool is_space(uint8_t c) { return c == ' ' || c == '\n' || c == '\r' || c == '\t'; }

/* Next word; empty at the end of the file; cut when it is longer than a number can be. */
static void take_token(reader *r, char token[TOKEN_SIZE])
{
    size_t length = 0;
    while (refill(r, 1) > 0) {
        uint8_t c = r->buffer[r->begin];
        if (is_space(c) && length > 0) {
            break;
        }
        r->begin++;
        r->left--;
        r->line += c == '\n';
        if (!is_space(c) && length < TOKEN_SIZE - 1) {
            token[length++] = (char)c;
        }
    }
    token[length] = '\0';
}

static tsuya_status take_number(reader *r, double *number, ply_type type, const ply_element *element, uint64_t row)
{
    if (r->header.format != PLY_ASCII) {
        return take_binary(r, number, type) ? TSUYA_OK : fail_truncated(r, element, row);
    }
    char token[TOKEN_SIZE], *end;
    take_token(r, token);
    if (token[0] == '\0') {
        return fail_truncated(r, element, row);
    }
    *number = strtod(token, &end);
    if (*end != '\0') {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: %.20s in %s %llu is no number", r->path, r->line, token,
                          element->name, (unsigned long long)row);
    }
    return TSUYA_OK;
}

/* Smallest number of bytes that a row can have. */
static uint64_t row_bytes_min(const reader *r, const ply_element *element)
{
    uint64_t bytes = 0;
    for (int p = 0; p < element->property_count; p++) {
        const ply_property *property = &r->header.property[element->first_property + p];
        bool list = property->count_type != PLY_NONE;
        bytes += r->header.format == PLY_ASCII ? 2 : (uint64_t)tsuya_ply_type_size(list ? property->count_type : property->type);
    }
    return bytes;
}

static tsuya_status check_counts(const reader *r)
{
    uint64_t left = r->left + (r->header.format == PLY_ASCII); /* the last line may lack its end */
    for (int e = 0; e < r->header.element_count; e++) {
        const ply_element *element = &r->header.element[e];
        uint64_t row = row_bytes_min(r, element);
        if (row > 0 && element->count > left / row) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: element %s counts %llu, but the file's last %llu bytes hold at most %llu",
                              r->path, element->name, (unsigned long long)element->count, (unsigned long long)left,
                              (unsigned long long)(left / row));
        }
        left -= row * element->count;
    }
    return TSUYA_OK;
}

static tsuya_status take_list_count(reader *r, uint64_t *count, const ply_property *property, const ply_element *element,
                                    uint64_t row)
{
    double number;
    TSUYA_TRY(take_number(r, &number, property->count_type, element, row));
    if (!(number >= 0.0 && number <= (double)UINT32_MAX && number == floor(number))) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %s of %s %llu has a length of %g; a whole number from 0 is accepted", r->path,
                          property->name, element->name, (unsigned long long)row, number);
    }
    *count = (uint64_t)number;
    return TSUYA_OK;
}

static tsuya_status skip_property(reader *r, const ply_property *property, const ply_element *element, uint64_t row)
{
    uint64_t count = 1;
    double number;
    if (property->count_type != PLY_NONE) {
        TSUYA_TRY(take_list_count(r, &count, property, element, row));
    }
    for (uint64_t k = 0; k < count; k++) {
        TSUYA_TRY(take_number(r, &number, property->type, element, row));
    }
    return TSUYA_OK;
}

static tsuya_status skip_element(reader *r, const ply_element *element)
{
    for (uint64_t row = 0; element->property_count > 0 && row < element->count; row++) {
        for (int p = 0; p < element->property_count; p++) {
            TSUYA_TRY(skip_property(r, &r->header.property[element->first_property + p], element, row));
        }
    }
    return TSUYA_OK;
}

static int find_property(const reader *r, const ply_element *element, const char *name)
{
    for (int p = element->first_property; p < element->first_property + element->property_count; p++) {
        if (strcmp(r->header.property[p].name, name) == 0) {
            return p;
        }
    }
    return -1;
}

/* The property of one component of an array, −1 where the file has none. */
static int find_component(const reader *r, const ply_element *element, const tsuya_mesh_array *array, int k)
{
    int p = find_property(r, element, array->property[k]);
    if (p < 0 && array->flag == TSUYA_MESH_COLOR) {
        static const char *const older[3] = {"diffuse_red", "diffuse_green", "diffuse_blue"};
        p = find_property(r, element, older[k]);
    }
    return p;
}

/* An optional array counts as there when all its components are. */
static tsuya_status choose_targets(reader *r, const ply_element *element, unsigned *flags)
{
    for (int a = 0; a < TSUYA_MESH_ARRAY_COUNT; a++) {
        const tsuya_mesh_array *array = &tsuya_mesh_arrays[a];
        int property[3];
        bool whole = true;
        for (int k = 0; k < array->components; k++) {
            property[k] = find_component(r, element, array, k);
            whole = whole && property[k] >= 0;
            if (property[k] < 0 && array->flag == 0) {
                return tsuya_fail(TSUYA_ERROR_INPUT, "%s: vertices have no property %s", r->path, array->property[k]);
            }
            if (property[k] >= 0 && r->header.property[property[k]].count_type != PLY_NONE) {
                return tsuya_fail(TSUYA_ERROR_INPUT, "%s: vertex property %s is a list; a number is accepted", r->path,
                                  array->property[k]);
            }
        }
        for (int k = 0; whole && k < array->components; k++) {
            r->target[property[k]] = (target){array, k};
        }
        *flags |= whole ? array->flag : 0;
    }
    return TSUYA_OK;
}

/* Float colours span 0 … 1 and 16-bit ones 0 … 65535, as other programs write them. */
static uint8_t byte_from_number(double number, ply_type type, bool color)
{
    double scale = !color ? 1.0 : type >= PLY_F32 ? 255.0 : type == PLY_U16 ? 255.0 / 65535.0 : 1.0;
    double v = floor(number * scale + 0.5);
    return (uint8_t)(v < 0.0 ? 0.0 : v > 255.0 ? 255.0 : v);
}

static tsuya_status store(const reader *r, tsuya_mesh *mesh, int p, uint64_t row, double number)
{
    const tsuya_mesh_array *array = r->target[p].array;
    size_t i = (size_t)row * (size_t)array->components + (size_t)r->target[p].component;
    if (!(fabs(number) <= 3.4028234663852886e38)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: vertex %llu: %s is %g; finite single-precision numbers are accepted", r->path,
                          (unsigned long long)row, r->header.property[p].name, number);
    }
    void *data = tsuya_mesh_array_data(mesh, array);
    if (array->bytes) {
        ((uint8_t *)data)[i] = byte_from_number(number, r->header.property[p].type, array->flag == TSUYA_MESH_COLOR);
    } else {
        ((float *)data)[i] = (float)number;
    }
    return TSUYA_OK;
}

static tsuya_status read_vertices(reader *r, tsuya_mesh *mesh, const ply_element *element)
{
    for (uint64_t row = 0; row < element->count; row++) {
        for (int p = element->first_property; p < element->first_property + element->property_count; p++) {
            const ply_property *property = &r->header.property[p];
            if (!r->target[p].array) {
                TSUYA_TRY(skip_property(r, property, element, row));
                continue;
            }
            double number;
            TSUYA_TRY(take_number(r, &number, property->type, element, row));
            TSUYA_TRY(store(r, mesh, p, row, number));
        }
    }
    return TSUYA_OK;
}

static tsuya_status append_triangle(reader *r, tsuya_mesh *mesh, uint32_t a, uint32_t b, uint32_t c)
{
    if (mesh->triangle_count == r->triangle_capacity) {
        size_t capacity = r->triangle_capacity + r->triangle_capacity / 2 + 16;
        uint32_t *larger = tsuya_realloc(mesh->triangle, capacity, 3 * sizeof *larger);
        if (!larger) {
            return TSUYA_ERROR_MEMORY;
        }
        mesh->triangle = larger;
        r->triangle_capacity = capacity;
    }
    if (mesh->triangle_count + 1 >= UINT32_MAX) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: more than %u triangles", r->path, UINT32_MAX - 1);
    }
    uint32_t *t = mesh->triangle + 3 * mesh->triangle_count++;
    t[0] = a;
    t[1] = b;
    t[2] = c;
    return TSUYA_OK;
}

static tsuya_status read_face(reader *r, tsuya_mesh *mesh, const ply_property *property, const ply_element *element,
                              uint64_t row)
{
    uint64_t count = 0;
    uint32_t first = 0, previous = 0;
    TSUYA_TRY(take_list_count(r, &count, property, element, row));
    if (count < 3 || count > LIST_MAX) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: face %llu has %llu corners; 3 to %d are accepted", r->path,
                          (unsigned long long)row, (unsigned long long)count, LIST_MAX);
    }
    for (uint64_t k = 0; k < count; k++) {
        double number;
        TSUYA_TRY(take_number(r, &number, property->type, element, row));
        if (!(number >= 0.0 && number < (double)mesh->vertex_count && number == floor(number))) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: face %llu names vertex %g; 0 to %lld are there", r->path,
                              (unsigned long long)row, number, (long long)mesh->vertex_count - 1);
        }
        uint32_t corner = (uint32_t)number;
        if (k >= 2) {
            TSUYA_TRY(append_triangle(r, mesh, first, previous, corner));
        }
        first = k == 0 ? corner : first;
        previous = corner;
    }
    return TSUYA_OK;
}

static tsuya_status read_faces(reader *r, tsuya_mesh *mesh, const ply_element *element)
{
    int corners = find_property(r, element, "vertex_indices");
    corners = corners >= 0 ? corners : find_property(r, element, "vertex_index");
    if (corners < 0 || r->header.property[corners].count_type == PLY_NONE || r->header.property[corners].type >= PLY_F32) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: faces need a list of whole numbers vertex_indices", r->path);
    }
    for (uint64_t row = 0; row < element->count; row++) {
        for (int p = element->first_property; p < element->first_property + element->property_count; p++) {
            const ply_property *property = &r->header.property[p];
            TSUYA_TRY(p == corners ? read_face(r, mesh, property, element, row) : skip_property(r, property, element, row));
        }
    }
    return TSUYA_OK;
}

static tsuya_status read_body(reader *r, tsuya_mesh *mesh)
{
    const ply_element *vertices = NULL;
    for (int e = 0; e < r->header.element_count; e++) {
        vertices = strcmp(r->header.element[e].name, "vertex") == 0 ? &r->header.element[e] : vertices;
    }
    if (!vertices) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: there is no element vertex", r->path);
    }
    unsigned flags = 0;
    TSUYA_TRY(choose_targets(r, vertices, &flags));
    TSUYA_TRY(check_counts(r));
    TSUYA_TRY(tsuya_mesh_create(mesh, vertices->count, 0, flags));
    for (int e = 0; e < r->header.element_count; e++) {
        const ply_element *element = &r->header.element[e];
        if (element == vertices) {
            TSUYA_TRY(read_vertices(r, mesh, element));
        } else if (strcmp(element->name, "face") == 0 && element->count > 0) {
            TSUYA_TRY(read_faces(r, mesh, element));
        } else {
            TSUYA_TRY(skip_element(r, element));
        }
    }
    return TSUYA_OK;
}

static tsuya_status open_file(reader *r)
{
    r->stream = fopen(r->path, "rb");
    if (!r->stream) {
        return tsuya_fail_errno(r->path, "opening");
    }
    struct stat about;
    if (fstat(fileno(r->stream), &about) != 0) {
        return tsuya_fail_errno(r->path, "opening");
    }
    if (!S_ISREG(about.st_mode)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: not a regular file", r->path);
    }
    TSUYA_TRY(tsuya_ply_header_read(&r->header, r->stream, r->path));
    r->left = (uint64_t)about.st_size > r->header.bytes ? (uint64_t)about.st_size - r->header.bytes : 0;
    r->line = r->header.lines + 1;
    return TSUYA_OK;
}

tsuya_status tsuya_ply_load(tsuya_mesh *mesh, const char *path)
{
    *mesh = (tsuya_mesh){0};
    tsuya_status status = TSUYA_OK;
    reader *r;
    TSUYA_NEW(status, r, 1);
    r->path = path;
    TSUYA_NEW(status, r->buffer, BUFFER_SIZE);
    TSUYA_GOTO_DONE(status, open_file(r));
    TSUYA_GOTO_DONE(status, read_body(r, mesh));
done:
    if (r && r->stream) {
        fclose(r->stream);
    }
    tsuya_free(r ? r->buffer : NULL);
    tsuya_free(r);
    if (status != TSUYA_OK) {
        tsuya_mesh_free(mesh);
    }
    return status;
}
