#include "reconstruct/cloud_clean.h"

#include "core/memory.h"
#include "core/order.h"
#include "reconstruct/pcl_adapter.h"

#include <stdlib.h>
#include <string.h>

enum { BLOCK = 1 << 16, K = TSUYA_CLOUD_NEIGHBOURS + 1 /* the point itself comes first */ };

static tsuya_vec3 normal_of(const tsuya_mesh *cloud, size_t v)
{
    return (tsuya_vec3){cloud->normal[3 * v], cloud->normal[3 * v + 1], cloud->normal[3 * v + 2]};
}

/* Called for a block of points [begin, end) with the K nearest of each. */
typedef void (*block_work)(void *user, size_t begin, size_t end, const uint32_t *index, const float *distance2);

/* The neighbours of all points of the cloud, block by block, so that memory stays small. */
static tsuya_status for_neighbours(const tsuya_mesh *cloud, const char *label, block_work work, void *user,
                                   const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    tsuya_pcl_tree *tree = NULL;
    uint32_t *index = NULL;
    float *distance2 = NULL;
    TSUYA_NEW(status, index, (size_t)BLOCK * K);
    TSUYA_NEW(status, distance2, (size_t)BLOCK * K);
    TSUYA_GOTO_DONE(status, tsuya_pcl_tree_create(&tree, cloud->position, cloud->vertex_count));
    for (size_t begin = 0; begin < cloud->vertex_count; begin += BLOCK) {
        size_t end = begin + BLOCK < cloud->vertex_count ? begin + BLOCK : cloud->vertex_count;
        TSUYA_GOTO_DONE(status, tsuya_check_interrupt());
        TSUYA_GOTO_DONE(status, tsuya_pcl_nearest(index, distance2, tree, cloud->position + 3 * begin, end - begin, K,
                                                  context->threads));
        work(user, begin, end, index, distance2);
        tsuya_progress_update(context, label, (double)end, (double)cloud->vertex_count, NULL);
    }
done:
    tsuya_pcl_tree_free(tree);
    tsuya_free(index);
    tsuya_free(distance2);
    return status;
}

/* ---- thinning ---- */

typedef struct cell_entry {
    int64_t x, y, z;
    uint32_t point;
} cell_entry;

static int compare_cells(const void *a, const void *b)
{
    const cell_entry *p = a, *q = b;
    if (p->x != q->x) {
        return p->x < q->x ? -1 : 1;
    }
    if (p->y != q->y) {
        return p->y < q->y ? -1 : 1;
    }
    if (p->z != q->z) {
        return p->z < q->z ? -1 : 1;
    }
    return (p->point > q->point) - (p->point < q->point);
}

static int64_t cell_of(float x, double cell)
{
    if (cell > 0.0) {
        return (int64_t)floor(fmin(fmax((double)x / cell, -9e18), 9e18));
    }
    x = x + 0.0f; /* one zero */
    int32_t bits;
    memcpy(&bits, &x, sizeof bits);
    return bits;
}

/* Means of the members of a cell that lie on the side of its first one (side > 0) or on the other (side < 0); false where
 * there is none.  Written over the place of the group's first member. */
static bool merge_side(tsuya_mesh *cloud, const cell_entry *entry, size_t count, int side)
{
    tsuya_vec3 position = {0, 0, 0}, normal = {0, 0, 0}, color = {0, 0, 0};
    double evidence = 0.0, sigma = 0.0;
    size_t members = 0, target = 0;
    for (size_t e = 0; e < count; e++) {
        size_t v = entry[e].point;
        bool same = !cloud->normal || tsuya_vec3_dot(normal_of(cloud, v), normal_of(cloud, entry[0].point)) >= 0.0;
        if (same != (side > 0)) {
            continue;
        }
        target = members++ == 0 ? v : target;
        position = tsuya_vec3_add(position, tsuya_mesh_position(cloud, v));
        normal = cloud->normal ? tsuya_vec3_add(normal, normal_of(cloud, v)) : normal;
        const uint8_t *c = cloud->color ? cloud->color + 3 * v : (const uint8_t[3]){0};
        color = tsuya_vec3_add(color, (tsuya_vec3){c[0], c[1], c[2]});
        evidence += cloud->evidence ? (double)cloud->evidence[v] : 0.0;
        sigma += cloud->sigma ? (double)cloud->sigma[v] : 0.0;
    }
    if (members < 2) {
        return members == 1; /* stays as it is, bit for bit */
    }
    double scale = 1.0 / (double)members;
    normal = tsuya_vec3_unit(normal);
    const double p[3] = {position.x, position.y, position.z}, n[3] = {normal.x, normal.y, normal.z};
    const double rgb[3] = {color.x, color.y, color.z};
    for (size_t k = 0; k < 3; k++) {
        cloud->position[3 * target + k] = (float)(p[k] * scale);
        if (cloud->normal) {
            cloud->normal[3 * target + k] = (float)n[k];
        }
        if (cloud->color) {
            cloud->color[3 * target + k] = (uint8_t)floor(rgb[k] * scale + 0.5);
        }
    }
    if (cloud->evidence) {
        cloud->evidence[target] = (float)(evidence * scale);
    }
    if (cloud->sigma) {
        cloud->sigma[target] = (float)(sigma * scale);
    }
    return true;
}

static void keep_first(uint8_t *keep, const tsuya_mesh *cloud, const cell_entry *entry, size_t count)
{
    keep[entry[0].point] = 1;
    for (size_t e = 1; cloud->normal && e < count; e++) {
        if (tsuya_vec3_dot(normal_of(cloud, entry[e].point), normal_of(cloud, entry[0].point)) < 0.0) {
            keep[entry[e].point] = 1;
            return;
        }
    }
}

tsuya_status tsuya_cloud_thin(tsuya_mesh *cloud, double cell)
{
    tsuya_status status = TSUYA_OK;
    cell_entry *entry = NULL;
    uint8_t *keep = NULL;
    TSUYA_NEW(status, entry, cloud->vertex_count);
    TSUYA_NEW(status, keep, cloud->vertex_count);
    for (size_t v = 0; v < cloud->vertex_count; v++) {
        const float *p = cloud->position + 3 * v;
        entry[v] = (cell_entry){cell_of(p[0], cell), cell_of(p[1], cell), cell_of(p[2], cell), (uint32_t)v};
    }
    qsort(entry, cloud->vertex_count, sizeof *entry, compare_cells);
    for (size_t begin = 0, end; begin < cloud->vertex_count; begin = end) {
        for (end = begin + 1; end < cloud->vertex_count; end++) {
            const cell_entry *a = &entry[begin], *b = &entry[end];
            if (a->x != b->x || a->y != b->y || a->z != b->z) {
                break;
            }
        }
        keep_first(keep, cloud, entry + begin, end - begin);
        /* the other side first: it is told by the first member's normal, which the near side's mean replaces */
        merge_side(cloud, entry + begin, end - begin, -1);
        merge_side(cloud, entry + begin, end - begin, 1);
    }
    status = tsuya_mesh_filter(cloud, keep, false);
done:
    tsuya_free(entry);
    tsuya_free(keep);
    return status;
}

/* ---- spacing and outliers ---- */

static void spacing_block(void *user, size_t begin, size_t end, const uint32_t *index, const float *distance2)
{
    (void)index;
    float *spacing = user;
    for (size_t v = begin; v < end; v++) {
        double d = sqrt((double)distance2[(v - begin) * K + K - 1]);
        spacing[v] = (float)(d * sqrt(M_PI / TSUYA_CLOUD_NEIGHBOURS));
    }
}

tsuya_status tsuya_cloud_spacing(float *spacing, double *median, const tsuya_mesh *cloud, const tsuya_context *context)
{
    TSUYA_TRY(for_neighbours(cloud, "spacing", spacing_block, spacing, context));
    float *sorted = tsuya_calloc(cloud->vertex_count, sizeof *sorted);
    if (!sorted) {
        return TSUYA_ERROR_MEMORY;
    }
    memcpy(sorted, spacing, cloud->vertex_count * sizeof *sorted);
    tsuya_sort_floats(sorted, cloud->vertex_count);
    *median = (double)sorted[cloud->vertex_count / 2];
    tsuya_free(sorted);
    return TSUYA_OK;
}

typedef struct outlier_work {
    const tsuya_mesh *cloud;
    double *mean_distance;
    uint8_t *keep;
} outlier_work;

static void outlier_block(void *user, size_t begin, size_t end, const uint32_t *index, const float *distance2)
{
    const outlier_work *w = user;
    for (size_t v = begin; v < end; v++) {
        double sum = 0.0;
        int opposed = 0;
        for (size_t k = 1; k < K; k++) {
            size_t at = (v - begin) * K + k;
            sum += sqrt((double)distance2[at]);
            opposed += tsuya_vec3_dot(normal_of(w->cloud, v), normal_of(w->cloud, index[at])) < 0.0;
        }
        w->mean_distance[v] = sum / TSUYA_CLOUD_NEIGHBOURS;
        w->keep[v] = 4 * opposed < 3 * TSUYA_CLOUD_NEIGHBOURS;
    }
}

tsuya_status tsuya_cloud_mark_outliers(uint8_t *keep, const tsuya_mesh *cloud, double sigmas, const tsuya_context *context)
{
    double *mean_distance = tsuya_calloc(cloud->vertex_count, sizeof *mean_distance);
    if (!mean_distance) {
        return TSUYA_ERROR_MEMORY;
    }
    outlier_work work = {cloud, mean_distance, keep};
    tsuya_status status = for_neighbours(cloud, "outliers", outlier_block, &work, context);
    double sum = 0.0, squares = 0.0, n = (double)cloud->vertex_count;
    for (size_t v = 0; v < cloud->vertex_count; v++) {
        sum += mean_distance[v];
        squares += mean_distance[v] * mean_distance[v];
    }
    double mean = sum / n, deviation = sqrt(fmax(squares / n - mean * mean, 0.0));
    for (size_t v = 0; v < cloud->vertex_count && sigmas > 0.0; v++) {
        keep[v] = keep[v] && mean_distance[v] <= mean + sigmas * deviation;
    }
    tsuya_free(mean_distance);
    return status;
}
