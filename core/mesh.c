#include "core/mesh.h"

#include "core/memory.h"
#include "core/mesh_arrays.h"

#include <stdlib.h>
#include <string.h>

const tsuya_mesh_array tsuya_mesh_arrays[TSUYA_MESH_ARRAY_COUNT] = {
    {0, offsetof(tsuya_mesh, position), 3, false, {"x", "y", "z"}},
    {TSUYA_MESH_NORMAL, offsetof(tsuya_mesh, normal), 3, false, {"nx", "ny", "nz"}},
    {TSUYA_MESH_COLOR, offsetof(tsuya_mesh, color), 3, true, {"red", "green", "blue"}},
    {TSUYA_MESH_WEFT, offsetof(tsuya_mesh, weft), 3, false, {"weft_x", "weft_y", "weft_z"}},
    {TSUYA_MESH_CONFIDENCE, offsetof(tsuya_mesh, weave_confidence), 1, false, {"weave_confidence"}},
    {TSUYA_MESH_SHEAR, offsetof(tsuya_mesh, shear_deg), 1, false, {"shear_deg"}},
    {TSUYA_MESH_THREADS, offsetof(tsuya_mesh, threads_per_m), 2, false, {"weft_threads_per_m", "warp_threads_per_m"}},
    {TSUYA_MESH_EVIDENCE, offsetof(tsuya_mesh, evidence), 1, false, {"evidence"}},
    {TSUYA_MESH_SIGMA, offsetof(tsuya_mesh, sigma), 1, false, {"sigma"}},
    {TSUYA_MESH_MATERIAL, offsetof(tsuya_mesh, material), 1, true, {"material"}},
};

tsuya_status tsuya_mesh_create(tsuya_mesh *mesh, size_t vertex_count, size_t triangle_count, unsigned optional_arrays)
{
    *mesh = (tsuya_mesh){0};
    if (vertex_count >= UINT32_MAX || triangle_count >= UINT32_MAX) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "mesh of %zu vertices and %zu triangles: fewer than %u of each are possible",
                          vertex_count, triangle_count, UINT32_MAX);
    }
    mesh->position = tsuya_calloc(vertex_count, 3 * sizeof(float));
    if (!mesh->position) {
        return TSUYA_ERROR_MEMORY;
    }
    mesh->vertex_count = vertex_count;
    tsuya_status status = tsuya_mesh_add_arrays(mesh, optional_arrays);
    if (status == TSUYA_OK && triangle_count > 0) {
        mesh->triangle = tsuya_calloc(triangle_count, 3 * sizeof(uint32_t));
        status = mesh->triangle ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    }
    if (status != TSUYA_OK) {
        tsuya_mesh_free(mesh);
        return status;
    }
    mesh->triangle_count = triangle_count;
    return TSUYA_OK;
}

tsuya_status tsuya_mesh_add_arrays(tsuya_mesh *mesh, unsigned optional_arrays)
{
    for (int a = 0; a < TSUYA_MESH_ARRAY_COUNT; a++) {
        const tsuya_mesh_array *array = &tsuya_mesh_arrays[a];
        void **slot = tsuya_mesh_array_slot(mesh, array);
        if ((array->flag & optional_arrays) && !*slot) {
            *slot = tsuya_calloc(mesh->vertex_count, tsuya_mesh_array_stride(array));
            if (!*slot) {
                return TSUYA_ERROR_MEMORY;
            }
        }
    }
    return TSUYA_OK;
}

tsuya_status tsuya_mesh_copy(tsuya_mesh *copy, const tsuya_mesh *mesh)
{
    unsigned flags = 0;
    for (int a = 0; a < TSUYA_MESH_ARRAY_COUNT; a++) {
        flags |= tsuya_mesh_array_data(mesh, &tsuya_mesh_arrays[a]) ? tsuya_mesh_arrays[a].flag : 0;
    }
    TSUYA_TRY(tsuya_mesh_create(copy, mesh->vertex_count, mesh->triangle_count, flags));
    for (int a = 0; a < TSUYA_MESH_ARRAY_COUNT; a++) {
        const tsuya_mesh_array *array = &tsuya_mesh_arrays[a];
        const void *from = tsuya_mesh_array_data(mesh, array);
        if (from) {
            memcpy(tsuya_mesh_array_data(copy, array), from, mesh->vertex_count * tsuya_mesh_array_stride(array));
        }
    }
    if (mesh->triangle_count > 0) {
        memcpy(copy->triangle, mesh->triangle, 3 * mesh->triangle_count * sizeof *copy->triangle);
    }
    return TSUYA_OK;
}

void tsuya_mesh_free(tsuya_mesh *mesh)
{
    for (int a = 0; a < TSUYA_MESH_ARRAY_COUNT; a++) {
        tsuya_free(tsuya_mesh_array_data(mesh, &tsuya_mesh_arrays[a]));
    }
    tsuya_free(mesh->triangle);
    *mesh = (tsuya_mesh){0};
}

/* Twice the area, along the normal. */
static tsuya_vec3 triangle_cross(const tsuya_mesh *mesh, size_t t)
{
    const uint32_t *i = mesh->triangle + 3 * t;
    tsuya_vec3 a = tsuya_mesh_position(mesh, i[0]);
    return tsuya_vec3_cross(tsuya_vec3_sub(tsuya_mesh_position(mesh, i[1]), a),
                            tsuya_vec3_sub(tsuya_mesh_position(mesh, i[2]), a));
}

tsuya_status tsuya_mesh_compute_normals(tsuya_mesh *mesh)
{
    TSUYA_TRY(tsuya_mesh_add_arrays(mesh, TSUYA_MESH_NORMAL));
    tsuya_vec3 *sum = tsuya_calloc(mesh->vertex_count, sizeof *sum);
    if (!sum) {
        return TSUYA_ERROR_MEMORY;
    }
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        tsuya_vec3 cross = triangle_cross(mesh, t);
        for (int k = 0; k < 3; k++) {
            uint32_t v = mesh->triangle[3 * t + k];
            sum[v] = tsuya_vec3_add(sum[v], cross);
        }
    }
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        tsuya_vec3 n = tsuya_vec3_unit(sum[v]);
        mesh->normal[3 * v] = (float)n.x;
        mesh->normal[3 * v + 1] = (float)n.y;
        mesh->normal[3 * v + 2] = (float)n.z;
    }
    tsuya_free(sum);
    return TSUYA_OK;
}

void tsuya_mesh_bounds(const tsuya_mesh *mesh, tsuya_vec3 *low, tsuya_vec3 *high)
{
    *low = (tsuya_vec3){INFINITY, INFINITY, INFINITY};
    *high = (tsuya_vec3){-INFINITY, -INFINITY, -INFINITY};
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        tsuya_vec3 p = tsuya_mesh_position(mesh, v);
        *low = (tsuya_vec3){fmin(low->x, p.x), fmin(low->y, p.y), fmin(low->z, p.z)};
        *high = (tsuya_vec3){fmax(high->x, p.x), fmax(high->y, p.y), fmax(high->z, p.z)};
    }
}

double tsuya_mesh_mean_edge(const tsuya_mesh *mesh)
{
    double sum = 0.0;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        const uint32_t *i = mesh->triangle + 3 * t;
        for (int k = 0; k < 3; k++) {
            sum += tsuya_vec3_norm(
                tsuya_vec3_sub(tsuya_mesh_position(mesh, i[k]), tsuya_mesh_position(mesh, i[(k + 1) % 3])));
        }
    }
    return mesh->triangle_count ? sum / (3.0 * (double)mesh->triangle_count) : 0.0;
}

double tsuya_mesh_area(const tsuya_mesh *mesh)
{
    double sum = 0.0;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        sum += 0.5 * tsuya_vec3_norm(triangle_cross(mesh, t));
    }
    return sum;
}

/* Moves kept vertices to the front; `renumber` holds each one's new index. */
static void compact_vertices(tsuya_mesh *mesh, const uint32_t *renumber, size_t kept)
{
    for (int a = 0; a < TSUYA_MESH_ARRAY_COUNT; a++) {
        char *data = tsuya_mesh_array_data(mesh, &tsuya_mesh_arrays[a]);
        size_t stride = tsuya_mesh_array_stride(&tsuya_mesh_arrays[a]);
        for (size_t v = 0; data && v < mesh->vertex_count; v++) {
            if (renumber[v] != UINT32_MAX && renumber[v] != v) {
                memcpy(data + renumber[v] * stride, data + v * stride, stride);
            }
        }
    }
    mesh->vertex_count = kept;
}

tsuya_status tsuya_mesh_filter(tsuya_mesh *mesh, const uint8_t *keep_vertex, bool drop_lonely)
{
    uint32_t *renumber = tsuya_calloc(mesh->vertex_count, sizeof *renumber);
    if (!renumber) {
        return TSUYA_ERROR_MEMORY;
    }
    size_t triangles = 0;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        const uint32_t *i = mesh->triangle + 3 * t;
        if (keep_vertex[i[0]] && keep_vertex[i[1]] && keep_vertex[i[2]]) {
            memmove(mesh->triangle + 3 * triangles++, i, 3 * sizeof *i);
        }
    }
    mesh->triangle_count = triangles;
    for (size_t k = 0; drop_lonely && k < 3 * triangles; k++) {
        renumber[mesh->triangle[k]] = 1;
    }
    uint32_t kept = 0;
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        bool keep = keep_vertex[v] && (!drop_lonely || renumber[v]);
        renumber[v] = keep ? kept++ : UINT32_MAX;
    }
    for (size_t k = 0; k < 3 * triangles; k++) {
        mesh->triangle[k] = renumber[mesh->triangle[k]];
    }
    compact_vertices(mesh, renumber, kept);
    tsuya_free(renumber);
    return TSUYA_OK;
}

static int compare_sides(const void *a, const void *b)
{
    const tsuya_side *x = a, *y = b;
    if (x->low != y->low) {
        return x->low < y->low ? -1 : 1;
    }
    if (x->high != y->high) {
        return x->high < y->high ? -1 : 1;
    }
    return (x->corner > y->corner) - (x->corner < y->corner);
}

size_t tsuya_mesh_sides(tsuya_side *side, const uint32_t *triangle, size_t triangle_count)
{
    size_t count = 3 * triangle_count, edges = 0;
    for (size_t c = 0; c < count; c++) {
        size_t first = c - c % 3;
        uint32_t a = triangle[first + (c % 3 + 1) % 3], b = triangle[first + (c % 3 + 2) % 3];
        side[c] = (tsuya_side){a < b ? a : b, a < b ? b : a, (uint32_t)c};
    }
    qsort(side, count, sizeof *side, compare_sides);
    for (size_t i = 0; i < count; i++) {
        edges += i == 0 || !tsuya_side_same_edge(&side[i], &side[i - 1]);
    }
    return edges;
}
