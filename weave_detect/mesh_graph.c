#include "weave_detect/mesh_graph.h"

#include "core/memory.h"
#include "weave_detect/votes.h"

#include <stdlib.h>
#include <string.h>

static const double COTANGENT_LEAST = 0.05, COTANGENT_MOST = 5.0;
static const double FOLD_COS = 0.5; /* normals of neighbours 60 degrees apart: a crease */

typedef struct half_edge {
    uint32_t from, to;
    float cotangent;
} half_edge;

static int compare_half_edges(const void *a, const void *b)
{
    const half_edge *x = a, *y = b;
    if (x->from != y->from) {
        return x->from < y->from ? -1 : 1;
    }
    return x->to < y->to ? -1 : x->to > y->to;
}

static double cotangent(tsuya_vec3 apex, tsuya_vec3 p, tsuya_vec3 q)
{
    tsuya_vec3 u = tsuya_vec3_sub(p, apex), v = tsuya_vec3_sub(q, apex);
    double sine = tsuya_vec3_norm(tsuya_vec3_cross(u, v));
    double value = sine > 0.0 ? tsuya_vec3_dot(u, v) / sine : COTANGENT_MOST;
    return fmin(fmax(value, -COTANGENT_MOST), COTANGENT_MOST);
}

/* Both directions of every triangle's edges, sorted. */
static void list_half_edges(half_edge *list, float *area, const tsuya_mesh *mesh)
{
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        const uint32_t *v = mesh->triangle + 3 * t;
        tsuya_vec3 p[3];
        for (int k = 0; k < 3; k++) {
            p[k] = tsuya_mesh_position(mesh, v[k]);
        }
        double third = tsuya_vec3_norm(tsuya_vec3_cross(tsuya_vec3_sub(p[1], p[0]), tsuya_vec3_sub(p[2], p[0]))) / 6.0;
        for (int k = 0; k < 3; k++) {
            int i = (k + 1) % 3, j = (k + 2) % 3;
            float half = (float)(0.5 * cotangent(p[k], p[i], p[j]));
            list[6 * t + 2 * (size_t)k] = (half_edge){v[i], v[j], half};
            list[6 * t + 2 * (size_t)k + 1] = (half_edge){v[j], v[i], half};
            area[v[k]] += (float)third;
        }
    }
    qsort(list, 6 * mesh->triangle_count, sizeof *list, compare_half_edges);
}

static tsuya_vec3 normal_of(const tsuya_mesh *mesh, uint32_t v)
{
    const float *n = mesh->normal + 3 * (size_t)v;
    return (tsuya_vec3){(double)n[0], (double)n[1], (double)n[2]};
}

/* Turns a vector by the smallest rotation that takes unit `from` to unit `to`. */
static tsuya_vec3 carry(tsuya_vec3 vector, tsuya_vec3 from, tsuya_vec3 to)
{
    tsuya_vec3 axis = tsuya_vec3_cross(from, to);
    double cosine = tsuya_vec3_dot(from, to);
    if (cosine < -0.999999) {
        return vector; /* a fold back onto itself: no rotation is the smallest */
    }
    tsuya_vec3 turned = tsuya_vec3_mad(tsuya_vec3_scale(vector, cosine), 1.0, tsuya_vec3_cross(axis, vector));
    return tsuya_vec3_mad(turned, tsuya_vec3_dot(axis, vector) / (1.0 + cosine), axis);
}

static void set_transport(tsuya_mesh_graph *graph, const tsuya_mesh *mesh, uint32_t v, uint32_t entry)
{
    uint32_t other = graph->neighbour[entry];
    tsuya_vec3 n = normal_of(mesh, v), m = normal_of(mesh, other), first, second, theirs, unused;
    tsuya_tangent_basis(&first, &second, n);
    tsuya_tangent_basis(&theirs, &unused, m);
    tsuya_vec3 here = carry(theirs, m, n);
    graph->turn_rad[entry] = (float)atan2(tsuya_vec3_dot(here, second), tsuya_vec3_dot(here, first));
    double cosine = tsuya_vec3_dot(n, m);
    double fold = cosine > FOLD_COS ? 1.0 : fmax(0.02, (1.0 + cosine) / (1.0 + FOLD_COS) * 0.2);
    graph->weight[entry] = (float)(fold * fmin(fmax((double)graph->weight[entry], COTANGENT_LEAST), COTANGENT_MOST));
}

/* Runs of equal (from, to) become one entry; a run of one is a rim. */
static void fill(tsuya_mesh_graph *graph, const half_edge *list, size_t count)
{
    uint32_t entry = 0;
    uint32_t vertex = 0;
    for (size_t i = 0; i < count;) {
        size_t j = i;
        double sum = 0.0;
        while (j < count && list[j].from == list[i].from && list[j].to == list[i].to) {
            sum += (double)list[j++].cotangent;
        }
        while (vertex <= list[i].from) {
            graph->start[vertex++] = entry;
        }
        if (list[i].from != list[i].to) {
            graph->neighbour[entry] = list[i].to;
            graph->weight[entry++] = (float)sum;
            graph->rim[list[i].from] |= j - i == 1;
        }
        i = j;
    }
    while (vertex <= graph->vertex_count) {
        graph->start[vertex++] = entry;
    }
}

tsuya_status tsuya_mesh_graph_create(tsuya_mesh_graph *graph, const tsuya_mesh *mesh)
{
    tsuya_status status = TSUYA_OK;
    half_edge *list = NULL;
    size_t halves = 6 * mesh->triangle_count;
    *graph = (tsuya_mesh_graph){.vertex_count = mesh->vertex_count};
    TSUYA_NEW(status, list, halves);
    TSUYA_NEW(status, graph->start, mesh->vertex_count + 1);
    TSUYA_NEW(status, graph->neighbour, halves);
    TSUYA_NEW(status, graph->turn_rad, halves);
    TSUYA_NEW(status, graph->weight, halves);
    TSUYA_NEW(status, graph->area, mesh->vertex_count);
    TSUYA_NEW(status, graph->rim, mesh->vertex_count);
    list_half_edges(list, graph->area, mesh);
    fill(graph, list, halves);
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        for (uint32_t e = graph->start[v]; e < graph->start[v + 1]; e++) {
            set_transport(graph, mesh, v, e);
        }
    }
done:
    tsuya_free(list);
    if (status != TSUYA_OK) {
        tsuya_mesh_graph_free(graph);
    }
    return status;
}

void tsuya_mesh_graph_free(tsuya_mesh_graph *graph)
{
    tsuya_free(graph->start);
    tsuya_free(graph->neighbour);
    tsuya_free(graph->turn_rad);
    tsuya_free(graph->weight);
    tsuya_free(graph->area);
    tsuya_free(graph->rim);
    *graph = (tsuya_mesh_graph){0};
}

uint32_t tsuya_mesh_graph_find(const tsuya_mesh_graph *graph, uint32_t v, uint32_t neighbour)
{
    for (uint32_t e = graph->start[v]; e < graph->start[v + 1]; e++) {
        if (graph->neighbour[e] == neighbour) {
            return e;
        }
    }
    return UINT32_MAX;
}
