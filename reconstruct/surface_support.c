#include "reconstruct/surface_support.h"

#include "core/memory.h"
#include "reconstruct/mesh_topology.h"
#include "reconstruct/pcl_adapter.h"

#include <string.h>

enum { BLOCK = 1 << 16, K = 8 };

typedef struct measure {
    tsuya_mesh *mesh;
    const tsuya_mesh *cloud;
    const float *spacing;
    double median, reach;
    float *gap;
} measure;

/* Spacing around a point of the cloud, kept near the median so that stragglers do not support half the scene. */
static double local_spacing(const measure *m, uint32_t point)
{
    return fmin(fmax((double)m->spacing[point], 0.5 * m->median), 3.0 * m->median);
}

static double normal_dot(const measure *m, size_t v, uint32_t point)
{
    const float *a = m->mesh->normal + 3 * v, *b = m->cloud->normal + 3 * (size_t)point;
    return (double)a[0] * (double)b[0] + (double)a[1] * (double)b[1] + (double)a[2] * (double)b[2];
}

/* Gaussian mean of the like neighbours' attributes. */
static void carry(const measure *m, size_t v, const uint32_t *index, const float *distance2)
{
    const tsuya_mesh *cloud = m->cloud;
    double total = 0.0, evidence = 0.0, sigma = 0.0, color[3] = {0.0, 0.0, 0.0};
    for (int k = 0; k < K; k++) {
        size_t p = index[k];
        double s = local_spacing(m, index[k]), w = exp(-0.5 * (double)distance2[k] / (s * s));
        if (normal_dot(m, v, index[k]) <= 0.0) {
            continue;
        }
        total += w;
        evidence += w * (cloud->evidence ? (double)cloud->evidence[p] : 1.0);
        sigma += w * (cloud->sigma ? (double)cloud->sigma[p] : 0.0);
        for (size_t c = 0; cloud->color && c < 3; c++) {
            color[c] += w * (double)cloud->color[3 * p + c];
        }
    }
    if (!(total > 0.0)) {
        return;
    }
    m->mesh->evidence[v] = (float)(evidence / total);
    if (cloud->sigma) {
        m->mesh->sigma[v] = (float)(sigma / total);
    }
    for (size_t c = 0; cloud->color && c < 3; c++) {
        m->mesh->color[3 * v + c] = (uint8_t)floor(color[c] / total + 0.5);
    }
}

static void measure_vertex(const measure *m, size_t v, const uint32_t *index, const float *distance2)
{
    double nearest = INFINITY;
    for (int k = 0; k < K; k++) {
        if (normal_dot(m, v, index[k]) > 0.0) {
            nearest = fmin(nearest, sqrt((double)distance2[k]) / local_spacing(m, index[k]));
        }
    }
    if (!isfinite(nearest)) { /* at least as far as the farthest that was looked at */
        nearest = fmax(sqrt((double)distance2[K - 1]) / local_spacing(m, index[K - 1]), 2.0 * m->reach);
    }
    m->gap[v] = (float)nearest;
    m->mesh->evidence[v] = 0.0f;
    for (size_t c = 0; m->cloud->color && c < 3; c++) {
        m->mesh->color[3 * v + c] = m->cloud->color[3 * (size_t)index[0] + c];
    }
    if (m->cloud->sigma) {
        m->mesh->sigma[v] = m->cloud->sigma[index[0]] + (float)(nearest * m->median);
    }
    if (nearest < m->reach) {
        carry(m, v, index, distance2);
    }
}

tsuya_status tsuya_surface_measure(tsuya_mesh *mesh, float *gap, const tsuya_mesh *cloud, const float *spacing,
                                   double median_spacing, double reach, const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    const measure m = {mesh, cloud, spacing, median_spacing, reach, gap};
    tsuya_pcl_tree *tree = NULL;
    uint32_t *index = NULL;
    float *distance2 = NULL;
    TSUYA_GOTO_DONE(status, tsuya_mesh_add_arrays(mesh, TSUYA_MESH_EVIDENCE | (cloud->color ? TSUYA_MESH_COLOR : 0) |
                                                            (cloud->sigma ? TSUYA_MESH_SIGMA : 0)));
    TSUYA_NEW(status, index, (size_t)BLOCK * K);
    TSUYA_NEW(status, distance2, (size_t)BLOCK * K);
    TSUYA_GOTO_DONE(status, tsuya_pcl_tree_create(&tree, cloud->position, cloud->vertex_count));
    for (size_t begin = 0; begin < mesh->vertex_count; begin += BLOCK) {
        size_t end = begin + BLOCK < mesh->vertex_count ? begin + BLOCK : mesh->vertex_count;
        TSUYA_GOTO_DONE(status, tsuya_check_interrupt());
        TSUYA_GOTO_DONE(status, tsuya_pcl_nearest(index, distance2, tree, mesh->position + 3 * begin, end - begin, K,
                                                  context->threads));
#pragma omp parallel for num_threads(context->threads)
        for (size_t v = begin; v < end; v++) {
            measure_vertex(&m, v, index + (v - begin) * K, distance2 + (v - begin) * K);
        }
        tsuya_progress_update(context, "evidence", (double)end, (double)mesh->vertex_count, NULL);
    }
done:
    tsuya_pcl_tree_free(tree);
    tsuya_free(index);
    tsuya_free(distance2);
    return status;
}

tsuya_status tsuya_surface_smooth_gap(float *gap, const tsuya_mesh *mesh, float most, int iterations)
{
    tsuya_status status = TSUYA_OK;
    float *sum = NULL;
    uint32_t *count = NULL;
    TSUYA_NEW(status, sum, mesh->vertex_count);
    TSUYA_NEW(status, count, mesh->vertex_count);
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        gap[v] = fminf(gap[v], most);
    }
    for (int i = 0; i < iterations; i++) {
        memset(sum, 0, mesh->vertex_count * sizeof *sum);
        memset(count, 0, mesh->vertex_count * sizeof *count);
        for (size_t t = 0; t < mesh->triangle_count; t++) {
            const uint32_t *v = mesh->triangle + 3 * t;
            for (size_t k = 0; k < 3; k++) {
                sum[v[k]] += gap[v[(k + 1) % 3]] + gap[v[(k + 2) % 3]];
                count[v[k]] += 2;
            }
        }
        for (size_t v = 0; v < mesh->vertex_count; v++) {
            gap[v] = count[v] > 0 ? 0.5f * (gap[v] + sum[v] / (float)count[v]) : gap[v];
        }
    }
done:
    tsuya_free(sum);
    tsuya_free(count);
    return status;
}

tsuya_status tsuya_surface_bridge(float *gap, const tsuya_mesh *mesh, float trim, float bridge)
{
    tsuya_status status = TSUYA_OK;
    uint8_t *open = NULL;
    uint32_t *part = NULL, *boundary = NULL;
    float *most = NULL;
    size_t boundary_count;
    TSUYA_NEW(status, open, mesh->vertex_count);
    TSUYA_NEW(status, part, mesh->vertex_count);
    TSUYA_NEW(status, most, mesh->vertex_count);
    TSUYA_GOTO_DONE(status, tsuya_mesh_boundary(&boundary, &boundary_count, mesh));
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        open[v] = !(gap[v] < trim);
    }
    tsuya_mesh_parts(part, mesh, open);
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        if (open[v]) {
            most[part[v]] = fmaxf(most[part[v]], gap[v]);
        }
    }
    for (size_t e = 0; e < 2 * boundary_count; e++) {
        if (open[boundary[e]]) {
            most[part[boundary[e]]] = INFINITY;
        }
    }
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        if (open[v] && most[part[v]] < bridge) {
            gap[v] = 0.0f;
        }
    }
done:
    tsuya_free(open);
    tsuya_free(part);
    tsuya_free(most);
    tsuya_free(boundary);
    return status;
}
