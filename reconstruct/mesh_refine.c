/* Every edge that is too long is split in the same way for the triangles on both its sides, so no crack opens: each pass
 * replaces a triangle by two, three or four, by how many of its edges are split (red-green refinement without the memory of
 * Bank, Sherman & Weiser 1983, which is not needed where nothing is coarsened again). */
#include "reconstruct/mesh_refine.h"

#include "core/memory.h"
#include "core/mesh_arrays.h"

#include <stdlib.h>
#include <string.h>

typedef struct edge {
    uint32_t a, b; /* a < b */
} edge;

typedef struct refiner {
    const tsuya_mesh *mesh;
    double longest;
    edge *edge; /* to split; sorted, each once */
    size_t edge_count;
} refiner;

static int compare_edges(const void *x, const void *y)
{
    const edge *p = x, *q = y;
    if (p->a != q->a) {
        return p->a < q->a ? -1 : 1;
    }
    return (p->b > q->b) - (p->b < q->b);
}

static edge edge_of(const tsuya_mesh *mesh, size_t triangle, int side)
{
    uint32_t a = mesh->triangle[3 * triangle + (size_t)side], b = mesh->triangle[3 * triangle + (size_t)(side + 1) % 3];
    return a < b ? (edge){a, b} : (edge){b, a};
}

static bool too_long(const refiner *r, edge e)
{
    return tsuya_vec3_norm(tsuya_vec3_sub(tsuya_mesh_position(r->mesh, e.a), tsuya_mesh_position(r->mesh, e.b))) > r->longest;
}

static tsuya_status list_edges(refiner *r)
{
    tsuya_status status = TSUYA_OK;
    size_t listed = 0;
    r->edge_count = 0;
    TSUYA_NEW(status, r->edge, 3 * r->mesh->triangle_count);
    for (size_t t = 0; t < r->mesh->triangle_count; t++) {
        for (int k = 0; k < 3; k++) {
            edge e = edge_of(r->mesh, t, k);
            if (too_long(r, e)) {
                r->edge[listed++] = e;
            }
        }
    }
    qsort(r->edge, listed, sizeof *r->edge, compare_edges);
    for (size_t i = 0; i < listed; i++) {
        if (i == 0 || compare_edges(&r->edge[i], &r->edge[i - 1]) != 0) {
            r->edge[r->edge_count++] = r->edge[i];
        }
    }
done:
    return status;
}

/* The new vertex in the middle of a side; UINT32_MAX where it stays whole. */
static uint32_t middle(const refiner *r, size_t triangle, int side)
{
    edge e = edge_of(r->mesh, triangle, side);
    const edge *found = bsearch(&e, r->edge, r->edge_count, sizeof e, compare_edges);
    return found ? (uint32_t)(r->mesh->vertex_count + (size_t)(found - r->edge)) : UINT32_MAX;
}

static void write_middle(tsuya_mesh *out, const tsuya_mesh_array *array, size_t vertex, edge e)
{
    for (int k = 0; k < array->components; k++) {
        size_t n = (size_t)array->components, i = n * vertex + (size_t)k, a = n * e.a + (size_t)k, b = n * e.b + (size_t)k;
        if (array->flag == TSUYA_MESH_MATERIAL) {
            out->material[i] = out->material[a];
        } else if (array->bytes) {
            uint8_t *value = tsuya_mesh_array_data(out, array);
            value[i] = (uint8_t)((value[a] + value[b] + 1) / 2);
        } else {
            float *value = tsuya_mesh_array_data(out, array);
            bool least = array->flag == TSUYA_MESH_EVIDENCE; /* beside what nobody saw nothing more was seen */
            value[i] = least ? (value[a] < value[b] ? value[a] : value[b]) : 0.5f * (value[a] + value[b]);
        }
    }
    if (array->flag == TSUYA_MESH_NORMAL || array->flag == TSUYA_MESH_WEFT) {
        float *value = (float *)tsuya_mesh_array_data(out, array) + 3 * vertex;
        tsuya_vec3 unit = tsuya_vec3_unit((tsuya_vec3){value[0], value[1], value[2]});
        value[0] = (float)unit.x;
        value[1] = (float)unit.y;
        value[2] = (float)unit.z;
    }
}

static void write_vertices(tsuya_mesh *out, const refiner *r)
{
    for (int i = 0; i < TSUYA_MESH_ARRAY_COUNT; i++) {
        const tsuya_mesh_array *array = &tsuya_mesh_arrays[i];
        if (tsuya_mesh_array_data(out, array)) {
            memcpy(tsuya_mesh_array_data(out, array), tsuya_mesh_array_data(r->mesh, array),
                   r->mesh->vertex_count * tsuya_mesh_array_stride(array));
            for (size_t k = 0; k < r->edge_count; k++) {
                write_middle(out, array, r->mesh->vertex_count + k, r->edge[k]);
            }
        }
    }
}

static void add_triangle(tsuya_mesh *out, uint32_t a, uint32_t b, uint32_t c)
{
    uint32_t *t = out->triangle + 3 * out->triangle_count++;
    t[0] = a;
    t[1] = b;
    t[2] = c;
}

static void split(tsuya_mesh *out, const uint32_t corner[3], const uint32_t mid[3])
{
    int count = (mid[0] != UINT32_MAX) + (mid[1] != UINT32_MAX) + (mid[2] != UINT32_MAX), k = 0;
    if (count == 0) {
        add_triangle(out, corner[0], corner[1], corner[2]);
        return;
    }
    if (count == 3) {
        for (int i = 0; i < 3; i++) {
            add_triangle(out, corner[i], mid[i], mid[(i + 2) % 3]);
        }
        add_triangle(out, mid[0], mid[1], mid[2]);
        return;
    }
    while (count == 1 ? mid[k] == UINT32_MAX : mid[k] != UINT32_MAX) {
        k++; /* the one side that differs from the others */
    }
    uint32_t a = corner[k], b = corner[(k + 1) % 3], c = corner[(k + 2) % 3];
    if (count == 1) {
        add_triangle(out, a, mid[k], c);
        add_triangle(out, mid[k], b, c);
    } else {
        uint32_t bc = mid[(k + 1) % 3], ca = mid[(k + 2) % 3];
        add_triangle(out, c, ca, bc);
        add_triangle(out, a, b, bc);
        add_triangle(out, a, bc, ca);
    }
}

static unsigned arrays_of(const tsuya_mesh *mesh)
{
    unsigned flags = 0;
    for (int i = 0; i < TSUYA_MESH_ARRAY_COUNT; i++) {
        flags |= tsuya_mesh_array_data(mesh, &tsuya_mesh_arrays[i]) ? tsuya_mesh_arrays[i].flag : 0;
    }
    return flags;
}

static tsuya_status refine_once(tsuya_mesh *out, const refiner *r)
{
    size_t vertices = r->mesh->vertex_count + r->edge_count, triangles = r->mesh->triangle_count + 3 * r->edge_count;
    if (vertices >= UINT32_MAX) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "mesh: edges of at most %g would need %zu vertices; below 2^32 are accepted", r->longest, vertices);
    }
    TSUYA_TRY(tsuya_mesh_create(out, vertices, triangles, arrays_of(r->mesh)));
    write_vertices(out, r);
    out->triangle_count = 0;
    for (size_t t = 0; t < r->mesh->triangle_count; t++) {
        uint32_t mid[3] = {middle(r, t, 0), middle(r, t, 1), middle(r, t, 2)};
        split(out, r->mesh->triangle + 3 * t, mid);
    }
    return TSUYA_OK;
}

tsuya_status tsuya_mesh_refine(tsuya_mesh *mesh, double longest)
{
    for (;;) {
        refiner r = {.mesh = mesh, .longest = longest};
        tsuya_mesh finer = {0};
        tsuya_status status = mesh->triangle_count > 0 ? list_edges(&r) : TSUYA_OK;
        bool any = status == TSUYA_OK && r.edge_count > 0;
        if (any) {
            status = refine_once(&finer, &r);
        }
        tsuya_free(r.edge);
        if (!any || status != TSUYA_OK) {
            return status;
        }
        tsuya_mesh_free(mesh);
        *mesh = finer;
    }
}
