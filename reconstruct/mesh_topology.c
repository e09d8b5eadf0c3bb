#include "reconstruct/mesh_topology.h"

#include "core/memory.h"

#include <stdlib.h>
#include <string.h>

static uint64_t edge_key(uint32_t a, uint32_t b) { return a < b ? (uint64_t)a << 32 | b : (uint64_t)b << 32 | a; }

/* LSD radix sort over 16-bit digits. */
static tsuya_status sort_keys(uint64_t *key, size_t count)
{
    enum { DIGITS = 1 << 16 };
    tsuya_status status = TSUYA_OK;
    uint64_t *other = NULL;
    size_t *start = NULL;
    TSUYA_NEW(status, other, count);
    TSUYA_NEW(status, start, DIGITS + 1);
    for (int shift = 0; shift < 64; shift += 16) {
        memset(start, 0, (DIGITS + 1) * sizeof *start);
        for (size_t k = 0; k < count; k++) {
            start[(key[k] >> shift & 0xffff) + 1]++;
        }
        for (size_t d = 0; d < DIGITS; d++) {
            start[d + 1] += start[d];
        }
        for (size_t k = 0; k < count; k++) {
            other[start[key[k] >> shift & 0xffff]++] = key[k];
        }
        memcpy(key, other, count * sizeof *key);
    }
done:
    tsuya_free(other);
    tsuya_free(start);
    return status;
}

tsuya_status tsuya_mesh_boundary(uint32_t **pairs, size_t *count, const tsuya_mesh *mesh)
{
    tsuya_status status = TSUYA_OK;
    uint64_t *key;
    size_t n = 3 * mesh->triangle_count;
    *pairs = NULL;
    *count = 0;
    TSUYA_NEW(status, key, n);
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        const uint32_t *i = mesh->triangle + 3 * t;
        for (size_t k = 0; k < 3; k++) {
            key[3 * t + k] = edge_key(i[k], i[(k + 1) % 3]);
        }
    }
    TSUYA_GOTO_DONE(status, sort_keys(key, n));
    size_t single = 0;
    for (size_t k = 0; k < n; k++) {
        if ((k == 0 || key[k] != key[k - 1]) && (k + 1 == n || key[k] != key[k + 1])) {
            key[single++] = key[k]; /* never ahead of k, and key[k − 1] is compared before it is overwritten */
        }
    }
    TSUYA_NEW(status, *pairs, 2 * single);
    for (size_t k = 0; k < single; k++) {
        (*pairs)[2 * k] = (uint32_t)(key[k] >> 32);
        (*pairs)[2 * k + 1] = (uint32_t)key[k];
    }
    *count = single;
done:
    tsuya_free(key);
    return status;
}

static uint32_t find_root(uint32_t *parent, uint32_t v)
{
    while (parent[v] != v) {
        v = parent[v] = parent[parent[v]];
    }
    return v;
}

void tsuya_mesh_parts(uint32_t *part, const tsuya_mesh *mesh, const uint8_t *use)
{
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        part[v] = !use || use[v] ? v : UINT32_MAX;
    }
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        for (size_t k = 0; k < 3; k++) {
            uint32_t a = mesh->triangle[3 * t + k], b = mesh->triangle[3 * t + (k + 1) % 3];
            if (part[a] != UINT32_MAX && part[b] != UINT32_MAX) {
                uint32_t ra = find_root(part, a), rb = find_root(part, b);
                part[ra > rb ? ra : rb] = ra < rb ? ra : rb;
            }
        }
    }
    for (uint32_t v = 0; v < mesh->vertex_count; v++) {
        part[v] = part[v] != UINT32_MAX ? find_root(part, v) : UINT32_MAX;
    }
}

static double triangle_area(const tsuya_mesh *mesh, size_t t)
{
    const uint32_t *i = mesh->triangle + 3 * t;
    tsuya_vec3 a = tsuya_mesh_position(mesh, i[0]);
    return 0.5 * tsuya_vec3_norm(tsuya_vec3_cross(tsuya_vec3_sub(tsuya_mesh_position(mesh, i[1]), a),
                                                  tsuya_vec3_sub(tsuya_mesh_position(mesh, i[2]), a)));
}

tsuya_status tsuya_mesh_drop_islands(tsuya_mesh *mesh, double fraction, size_t *parts_left)
{
    tsuya_status status = TSUYA_OK;
    uint32_t *part = NULL;
    double *area = NULL, largest = 0.0;
    uint8_t *keep = NULL;
    size_t left = 0;
    TSUYA_NEW(status, part, mesh->vertex_count);
    TSUYA_NEW(status, area, mesh->vertex_count);
    TSUYA_NEW(status, keep, mesh->vertex_count);
    tsuya_mesh_parts(part, mesh, NULL);
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        area[part[mesh->triangle[3 * t]]] += triangle_area(mesh, t);
    }
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        largest = fmax(largest, area[v]);
    }
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        keep[v] = area[part[v]] > 0.0 && area[part[v]] >= fraction * largest;
        left += keep[v] && part[v] == v;
    }
    status = tsuya_mesh_filter(mesh, keep, true);
    if (parts_left) {
        *parts_left = left;
    }
done:
    tsuya_free(part);
    tsuya_free(area);
    tsuya_free(keep);
    return status;
}

/* ---- smoothing ---- */

typedef struct smoother {
    tsuya_mesh *mesh;
    const uint32_t *boundary;
    size_t boundary_count;
    const uint8_t *on_boundary;
    tsuya_vec3 *sum;
    uint32_t *count;
} smoother;

static void add_neighbour(const smoother *s, uint32_t v, uint32_t neighbour)
{
    s->sum[v] = tsuya_vec3_add(s->sum[v], tsuya_mesh_position(s->mesh, neighbour));
    s->count[v]++;
}

/* One step towards (factor > 0) or from (< 0) the mean of the neighbours. */
static void smooth_step(const smoother *s, double factor)
{
    tsuya_mesh *mesh = s->mesh;
    memset(s->sum, 0, mesh->vertex_count * sizeof *s->sum);
    memset(s->count, 0, mesh->vertex_count * sizeof *s->count);
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        for (size_t k = 0; k < 3; k++) {
            uint32_t v = mesh->triangle[3 * t + k];
            if (!s->on_boundary[v]) {
                add_neighbour(s, v, mesh->triangle[3 * t + (k + 1) % 3]);
                add_neighbour(s, v, mesh->triangle[3 * t + (k + 2) % 3]);
            }
        }
    }
    for (size_t e = 0; e < s->boundary_count; e++) {
        add_neighbour(s, s->boundary[2 * e], s->boundary[2 * e + 1]);
        add_neighbour(s, s->boundary[2 * e + 1], s->boundary[2 * e]);
    }
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        if (s->count[v] > 0) {
            tsuya_vec3 p = tsuya_mesh_position(mesh, v);
            tsuya_vec3 to = tsuya_vec3_sub(tsuya_vec3_scale(s->sum[v], 1.0 / s->count[v]), p);
            p = tsuya_vec3_mad(p, factor, to);
            mesh->position[3 * v] = (float)p.x;
            mesh->position[3 * v + 1] = (float)p.y;
            mesh->position[3 * v + 2] = (float)p.z;
        }
    }
}

tsuya_status tsuya_mesh_smooth(tsuya_mesh *mesh, int iterations)
{
    tsuya_status status = TSUYA_OK;
    uint32_t *boundary = NULL;
    uint8_t *on_boundary = NULL;
    smoother s = {.mesh = mesh};
    TSUYA_GOTO_DONE(status, tsuya_mesh_boundary(&boundary, &s.boundary_count, mesh));
    TSUYA_NEW(status, on_boundary, mesh->vertex_count);
    TSUYA_NEW(status, s.sum, mesh->vertex_count);
    TSUYA_NEW(status, s.count, mesh->vertex_count);
    for (size_t e = 0; e < 2 * s.boundary_count; e++) {
        on_boundary[boundary[e]] = 1;
    }
    s.boundary = boundary;
    s.on_boundary = on_boundary;
    for (int i = 0; i < iterations; i++) {
        smooth_step(&s, 0.5);
        smooth_step(&s, -0.53);
    }
done:
    tsuya_free(boundary);
    tsuya_free(on_boundary);
    tsuya_free(s.sum);
    tsuya_free(s.count);
    return status;
}
