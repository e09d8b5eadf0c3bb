/* Cuts a mesh along an iso-line of a field on its vertices, as Kazhdan's SurfaceTrimmer does, so that a hem is a smooth
 * line and not a saw. */
#include "core/memory.h"
#include "core/mesh_arrays.h"
#include "reconstruct/mesh_topology.h"

#include <stdlib.h>
#include <string.h>

/* A cut edge: inside end first. */
typedef struct crossing {
    uint32_t inside, outside;
} crossing;

typedef struct cutter {
    const tsuya_mesh *mesh;
    const float *field;
    float level;
    crossing *crossing; /* sorted, without repetition */
    size_t crossing_count;
    uint32_t *triangle; /* new triangles; vertices from vertex_count on are crossings */
    size_t triangle_count;
} cutter;

static int compare_crossings(const void *a, const void *b)
{
    const crossing *p = a, *q = b;
    if (p->inside != q->inside) {
        return p->inside < q->inside ? -1 : 1;
    }
    return (p->outside > q->outside) - (p->outside < q->outside);
}

static bool is_inside(const cutter *c, uint32_t v) { return c->field[v] < c->level; }

/* A NULL `out` counts only. */
static size_t list_crossings(const cutter *c, crossing *out)
{
    size_t count = 0;
    for (size_t t = 0; t < c->mesh->triangle_count; t++) {
        for (size_t k = 0; k < 3; k++) {
            uint32_t a = c->mesh->triangle[3 * t + k], b = c->mesh->triangle[3 * t + (k + 1) % 3];
            if (is_inside(c, a) != is_inside(c, b)) {
                if (out) {
                    out[count] = is_inside(c, a) ? (crossing){a, b} : (crossing){b, a};
                }
                count++;
            }
        }
    }
    return count;
}

static tsuya_status find_crossings(cutter *c)
{
    size_t listed = list_crossings(c, NULL);
    c->crossing = tsuya_calloc(listed, sizeof *c->crossing);
    if (!c->crossing) {
        return TSUYA_ERROR_MEMORY;
    }
    list_crossings(c, c->crossing);
    qsort(c->crossing, listed, sizeof *c->crossing, compare_crossings);
    for (size_t k = 0; k < listed; k++) {
        if (k == 0 || compare_crossings(&c->crossing[k], &c->crossing[c->crossing_count - 1]) != 0) {
            c->crossing[c->crossing_count++] = c->crossing[k];
        }
    }
    return TSUYA_OK;
}

static uint32_t vertex_of_crossing(const cutter *c, uint32_t inside, uint32_t outside)
{
    const crossing key = {inside, outside};
    const crossing *found = bsearch(&key, c->crossing, c->crossing_count, sizeof key, compare_crossings);
    return (uint32_t)(c->mesh->vertex_count + (size_t)(found - c->crossing));
}

static void emit(cutter *c, uint32_t a, uint32_t b, uint32_t d)
{
    uint32_t *t = c->triangle + 3 * c->triangle_count++;
    t[0] = a;
    t[1] = b;
    t[2] = d;
}

static void cut_triangle(cutter *c, const uint32_t i[3])
{
    int inside = is_inside(c, i[0]) + is_inside(c, i[1]) + is_inside(c, i[2]);
    if (inside == 3) {
        emit(c, i[0], i[1], i[2]);
    }
    if (inside == 0 || inside == 3) {
        return;
    }
    int lone = 0; /* the corner that is alone on its side comes first */
    while (is_inside(c, i[lone]) != (inside == 1)) {
        lone++;
    }
    uint32_t a = i[lone], b = i[(lone + 1) % 3], d = i[(lone + 2) % 3];
    if (inside == 1) {
        emit(c, a, vertex_of_crossing(c, a, b), vertex_of_crossing(c, a, d));
    } else {
        uint32_t ab = vertex_of_crossing(c, b, a), ad = vertex_of_crossing(c, d, a);
        emit(c, ab, b, d);
        emit(c, ab, d, ad);
    }
}

/* Value of each array at the crossings, behind the old vertices' values. */
static void interpolate(tsuya_mesh *out, const cutter *c)
{
    size_t old = c->mesh->vertex_count;
    for (int a = 0; a < TSUYA_MESH_ARRAY_COUNT; a++) {
        const tsuya_mesh_array *array = &tsuya_mesh_arrays[a];
        void *to = tsuya_mesh_array_data(out, array);
        if (!to) {
            continue;
        }
        memcpy(to, tsuya_mesh_array_data(c->mesh, array), old * tsuya_mesh_array_stride(array));
        for (size_t k = 0; k < c->crossing_count; k++) {
            size_t in = c->crossing[k].inside, beyond = c->crossing[k].outside;
            float t = (c->level - c->field[in]) / (c->field[beyond] - c->field[in]);
            for (size_t i = 0, n = (size_t)array->components; i < n; i++) {
                if (array->bytes) {
                    ((uint8_t *)to)[(old + k) * n + i] = ((uint8_t *)to)[in * n + i];
                } else {
                    float *f = to;
                    f[(old + k) * n + i] = f[in * n + i] + t * (f[beyond * n + i] - f[in * n + i]);
                }
            }
        }
    }
}

static unsigned flags_of(const tsuya_mesh *mesh)
{
    unsigned flags = 0;
    for (int a = 0; a < TSUYA_MESH_ARRAY_COUNT; a++) {
        flags |= tsuya_mesh_array_data(mesh, &tsuya_mesh_arrays[a]) ? tsuya_mesh_arrays[a].flag : 0;
    }
    return flags;
}

static void renormalise(tsuya_mesh *mesh)
{
    for (size_t v = 0; mesh->normal && v < mesh->vertex_count; v++) {
        float *n = mesh->normal + 3 * v;
        tsuya_vec3 unit = tsuya_vec3_unit((tsuya_vec3){n[0], n[1], n[2]});
        n[0] = (float)unit.x;
        n[1] = (float)unit.y;
        n[2] = (float)unit.z;
    }
}

tsuya_status tsuya_mesh_cut(tsuya_mesh *mesh, const float *field, float level)
{
    tsuya_status status = TSUYA_OK;
    cutter c = {.mesh = mesh, .field = field, .level = level};
    tsuya_mesh out = {0};
    uint8_t *keep = NULL;
    TSUYA_GOTO_DONE(status, find_crossings(&c));
    TSUYA_NEW(status, c.triangle, 6 * mesh->triangle_count); /* two for one at most */
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        cut_triangle(&c, mesh->triangle + 3 * t);
    }
    TSUYA_GOTO_DONE(status, tsuya_mesh_create(&out, mesh->vertex_count + c.crossing_count, c.triangle_count, flags_of(mesh)));
    interpolate(&out, &c);
    renormalise(&out);
    if (c.triangle_count > 0) {
        memcpy(out.triangle, c.triangle, 3 * c.triangle_count * sizeof *c.triangle);
    }
    TSUYA_NEW(status, keep, out.vertex_count);
    memset(keep, 1, out.vertex_count);
    TSUYA_GOTO_DONE(status, tsuya_mesh_filter(&out, keep, true));
    tsuya_mesh_free(mesh);
    *mesh = out;
    out = (tsuya_mesh){0};
done:
    tsuya_free(c.crossing);
    tsuya_free(c.triangle);
    tsuya_free(keep);
    tsuya_mesh_free(&out);
    return status;
}
