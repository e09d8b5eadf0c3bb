/* Writes PLY 1.0 (Turk, "The PLY polygon file format", 1994). */
#include "core/file.h"
#include "core/mesh.h"
#include "core/mesh_arrays.h"

#include <string.h>

_Static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__, "rows are written as they lie in memory");

static tsuya_status check_mesh(const tsuya_mesh *mesh, const char *path, const tsuya_ply_save_options *options)
{
    for (size_t k = 0; k < 3 * mesh->vertex_count; k++) {
        if (!isfinite(mesh->position[k])) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: vertex %zu has a position of %g; finite ones can be written", path,
                              k / 3, (double)mesh->position[k]);
        }
    }
    for (size_t k = 0; k < 3 * mesh->triangle_count; k++) {
        if (mesh->triangle[k] >= mesh->vertex_count) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: triangle %zu names vertex %u of %zu", path, k / 3, mesh->triangle[k],
                              mesh->vertex_count);
        }
    }
    for (int c = 0; c < options->comment_count; c++) {
        if (strpbrk(options->comment[c], "\r\n")) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: comment %d has a line break; one line is accepted", path, c);
        }
    }
    return TSUYA_OK;
}

static void write_header(FILE *f, const tsuya_mesh *mesh, const tsuya_ply_save_options *options)
{
    fprintf(f, "ply\nformat %s 1.0\n", options->ascii ? "ascii" : "binary_little_endian");
    for (int c = 0; c < options->comment_count; c++) {
        fprintf(f, "comment %s\n", options->comment[c]);
    }
    fprintf(f, "element vertex %zu\n", mesh->vertex_count);
    for (int a = 0; a < TSUYA_MESH_ARRAY_COUNT; a++) {
        const tsuya_mesh_array *array = &tsuya_mesh_arrays[a];
        for (int k = 0; tsuya_mesh_array_data(mesh, array) && k < array->components; k++) {
            fprintf(f, "property %s %s\n", array->bytes ? "uchar" : "float", array->property[k]);
        }
    }
    if (mesh->triangle_count > 0) {
        fprintf(f, "element face %zu\nproperty list uchar %s vertex_indices\n", mesh->triangle_count,
                mesh->vertex_count > INT32_MAX ? "uint" : "int");
    }
    fprintf(f, "end_header\n");
}

static void write_vertex_binary(FILE *f, const tsuya_mesh *mesh, size_t v)
{
    for (int a = 0; a < TSUYA_MESH_ARRAY_COUNT; a++) {
        const char *data = tsuya_mesh_array_data(mesh, &tsuya_mesh_arrays[a]);
        if (data) {
            size_t stride = tsuya_mesh_array_stride(&tsuya_mesh_arrays[a]);
            fwrite_unlocked(data + v * stride, stride, 1, f);
        }
    }
}

static void write_vertex_ascii(FILE *f, const tsuya_mesh *mesh, size_t v)
{
    for (int a = 0; a < TSUYA_MESH_ARRAY_COUNT; a++) {
        const tsuya_mesh_array *array = &tsuya_mesh_arrays[a];
        const void *data = tsuya_mesh_array_data(mesh, array);
        for (int k = 0; data && k < array->components; k++) {
            size_t i = v * (size_t)array->components + (size_t)k;
            const char *separator = a + k > 0 ? " " : "";
            if (array->bytes) {
                fprintf(f, "%s%d", separator, ((const uint8_t *)data)[i]);
            } else {
                fprintf(f, "%s%.9g", separator, (double)((const float *)data)[i]);
            }
        }
    }
    fputc('\n', f);
}

static void write_triangle(FILE *f, const uint32_t *i, bool ascii)
{
    if (ascii) {
        fprintf(f, "3 %u %u %u\n", i[0], i[1], i[2]);
    } else {
        fputc_unlocked(3, f);
        fwrite_unlocked(i, sizeof *i, 3, f);
    }
}

tsuya_status tsuya_ply_save(const tsuya_mesh *mesh, const char *path, const tsuya_ply_save_options *options)
{
    static const tsuya_ply_save_options plain = {0};
    options = options ? options : &plain;
    TSUYA_TRY(check_mesh(mesh, path, options));
    tsuya_file_writer writer;
    TSUYA_TRY(tsuya_file_begin(&writer, path));
    write_header(writer.stream, mesh, options);
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        if (options->ascii) {
            write_vertex_ascii(writer.stream, mesh, v);
        } else {
            write_vertex_binary(writer.stream, mesh, v);
        }
    }
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        write_triangle(writer.stream, mesh->triangle + 3 * t, options->ascii);
    }
    return tsuya_file_commit(&writer);
}
