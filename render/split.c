#include "render/split.h"

#include "core/memory.h"

#include <math.h>
#include <string.h>

/* edge[corner]: number of the edge across it; returns how many there are. */
static uint32_t number_edges(uint32_t *edge, tsuya_side *list, const tsuya_mesh *mesh)
{
    size_t edges = tsuya_mesh_sides(list, mesh->triangle, mesh->triangle_count);
    uint32_t number = 0;
    for (size_t s = 0; s < 3 * mesh->triangle_count; s++) {
        number += s > 0 && !tsuya_side_same_edge(&list[s], &list[s - 1]);
        edge[list[s].corner] = number;
    }
    return (uint32_t)edges;
}

typedef struct cutting {
    const tsuya_mesh *mesh;
    const uint32_t *edge;
    uint32_t edges;
    int n;
} cutting;

static size_t inner_count(int n) { return (size_t)(n - 1) * (size_t)(n - 2) / 2; }

/* The vertex at i/n towards the second corner and j/n towards the third. */
static uint32_t vertex_at(const cutting *c, size_t triangle, int i, int j)
{
    const uint32_t *v = c->mesh->triangle + 3 * triangle;
    int n = c->n, k = n - i - j;
    if (i == n || j == n || k == n) {
        return i == n ? v[1] : j == n ? v[2] : v[0];
    }
    int at = j == 0 ? 0 : k == 0 ? 1 : i == 0 ? 2 : -1;
    if (at >= 0) {
        int step = at == 0 ? i : at == 1 ? j : k; /* from the side's first corner */
        step = v[at] < v[(at + 1) % 3] ? step : n - step;
        return (uint32_t)c->mesh->vertex_count + c->edge[3 * triangle + (size_t)(at + 2) % 3] * (uint32_t)(n - 1) + (uint32_t)(step - 1);
    }
    size_t row = (size_t)(j - 1), before = row * (size_t)(n - 2) - row * (row - 1) / 2; /* rows above hold n − 2, n − 3, … */
    return (uint32_t)(c->mesh->vertex_count + (size_t)c->edges * (size_t)(n - 1) + triangle * inner_count(n) + before + (size_t)(i - 1));
}

static void set_place(tsuya_split_place *place, const uint32_t v[3], double a, double b, double c)
{
    const double w[3] = {a, b, c};
    int first = a > 0.0 ? 0 : b > 0.0 ? 1 : 2;
    for (int k = 0; k < 3; k++) {
        place->corner[k] = w[k] > 0.0 ? v[k] : v[first];
        place->weight[k] = (float)w[k];
    }
}

static void cut_triangle(tsuya_mesh *fine, tsuya_split_place *place, const cutting *c, size_t t)
{
    int n = c->n;
    uint32_t *out = fine->triangle + 3 * t * (size_t)(n * n);
    const uint32_t *v = c->mesh->triangle + 3 * t;
    for (int j = 0; j <= n; j++) {
        for (int i = 0; i + j <= n; i++) {
            uint32_t a = vertex_at(c, t, i, j);
            set_place(&place[a], v, (n - i - j) / (double)n, i / (double)n, j / (double)n);
            if (i + j == n) {
                continue;
            }
            uint32_t b = vertex_at(c, t, i + 1, j), d = vertex_at(c, t, i, j + 1);
            memcpy(out, (const uint32_t[3]){a, b, d}, 3 * sizeof *out);
            out += 3;
            if (i + j < n - 1) {
                memcpy(out, (const uint32_t[3]){b, vertex_at(c, t, i + 1, j + 1), d}, 3 * sizeof *out);
                out += 3;
            }
        }
    }
}

static void interpolate(float *to, const float *from, int width, const tsuya_split_place *p)
{
    for (int c = 0; c < width; c++) {
        double sum = 0.0;
        for (int k = 0; k < 3; k++) {
            sum += (double)(p->weight[k] * from[(size_t)width * p->corner[k] + (size_t)c]);
        }
        to[c] = (float)sum;
    }
}

/* A direction, of which the sign may or may not tell. */
static void interpolate_unit(float to[3], const float *from, const tsuya_split_place *p, bool any_sign)
{
    tsuya_vec3 sum = {0, 0, 0}, first = {0, 0, 0};
    for (int k = 0; k < 3; k++) {
        const float *f = from + 3 * (size_t)p->corner[k];
        tsuya_vec3 d = {f[0], f[1], f[2]};
        first = tsuya_vec3_norm(first) > 0.0 ? first : d;
        sum = tsuya_vec3_mad(sum, any_sign && tsuya_vec3_dot(d, first) < 0.0 ? -(double)p->weight[k] : (double)p->weight[k], d);
    }
    double length = tsuya_vec3_norm(sum);
    sum = length > 1e-6 ? tsuya_vec3_scale(sum, 1.0 / length) : first;
    to[0] = (float)sum.x;
    to[1] = (float)sum.y;
    to[2] = (float)sum.z;
}

static void fill_vertex(tsuya_mesh *fine, const tsuya_mesh *mesh, size_t v, const tsuya_split_place *p)
{
    const struct { float *to; const float *from; int width; } scalar[] = {
        {fine->position, mesh->position, 3}, {fine->weave_confidence, mesh->weave_confidence, 1}, {fine->shear_deg, mesh->shear_deg, 1},
        {fine->threads_per_m, mesh->threads_per_m, 2}, {fine->evidence, mesh->evidence, 1}, {fine->sigma, mesh->sigma, 1},
    };
    for (size_t k = 0; k < sizeof scalar / sizeof *scalar; k++) {
        if (scalar[k].from) {
            interpolate(scalar[k].to + (size_t)scalar[k].width * v, scalar[k].from, scalar[k].width, p);
        }
    }
    if (mesh->normal) {
        interpolate_unit(fine->normal + 3 * v, mesh->normal, p, false);
    }
    if (mesh->weft) {
        interpolate_unit(fine->weft + 3 * v, mesh->weft, p, true);
    }
    int nearest = p->weight[1] > p->weight[0] ? 1 : 0;
    nearest = p->weight[2] > p->weight[nearest] ? 2 : nearest;
    if (mesh->material) {
        fine->material[v] = mesh->material[p->corner[nearest]];
    }
    for (size_t c = 0; mesh->color && c < 3; c++) {
        double sum = 0.0;
        for (int k = 0; k < 3; k++) {
            sum += (double)p->weight[k] * mesh->color[3 * (size_t)p->corner[k] + c];
        }
        fine->color[3 * v + c] = (uint8_t)lround(sum);
    }
}

static unsigned arrays_of(const tsuya_mesh *m)
{
    return (m->normal ? TSUYA_MESH_NORMAL : 0U) | (m->color ? TSUYA_MESH_COLOR : 0U) | (m->weft ? TSUYA_MESH_WEFT : 0U) |
           (m->weave_confidence ? TSUYA_MESH_CONFIDENCE : 0U) | (m->shear_deg ? TSUYA_MESH_SHEAR : 0U) | (m->threads_per_m ? TSUYA_MESH_THREADS : 0U) |
           (m->evidence ? TSUYA_MESH_EVIDENCE : 0U) | (m->sigma ? TSUYA_MESH_SIGMA : 0U) | (m->material ? TSUYA_MESH_MATERIAL : 0U);
}

tsuya_status tsuya_mesh_split(tsuya_mesh *fine, tsuya_split_place **place, const tsuya_mesh *mesh, int n)
{
    tsuya_status status = TSUYA_OK;
    tsuya_side *list = NULL;
    uint32_t *edge = NULL;
    *fine = (tsuya_mesh){0};
    *place = NULL;
    TSUYA_NEW(status, list, 3 * mesh->triangle_count);
    TSUYA_NEW(status, edge, 3 * mesh->triangle_count);
    cutting c = {mesh, edge, number_edges(edge, list, mesh), n};
    size_t vertices = mesh->vertex_count + (size_t)c.edges * (size_t)(n - 1) + (n > 2 ? mesh->triangle_count * inner_count(n) : 0);
    if (n < 1 || n > 64 || vertices >= UINT32_MAX) {
        TSUYA_GOTO_DONE(status, tsuya_fail(TSUYA_ERROR_INPUT, "a mesh of %zu triangles cut into %d × %d each: too many", mesh->triangle_count, n, n));
    }
    TSUYA_GOTO_DONE(status, tsuya_mesh_create(fine, vertices, mesh->triangle_count * (size_t)(n * n), arrays_of(mesh)));
    TSUYA_NEW(status, *place, vertices);
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        (*place)[v] = (tsuya_split_place){{v, v, v}, {1.0f, 0.0f, 0.0f}};
    }
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        cut_triangle(fine, *place, &c, t);
    }
    for (size_t v = 0; v < vertices; v++) {
        fill_vertex(fine, mesh, v, &(*place)[v]);
    }
done:
    tsuya_free(list);
    tsuya_free(edge);
    if (status != TSUYA_OK) {
        tsuya_mesh_free(fine);
        tsuya_free(*place);
        *place = NULL;
    }
    return status;
}
