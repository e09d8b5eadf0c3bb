/* Normals of a cloud that has none: plane of the neighbours, then one side for all (Hoppe, DeRose, Duchamp, McDonald &
 * Stuetzle, "Surface reconstruction from unorganized points", SIGGRAPH 1992).  The spanning tree is Kruskal's, over a
 * union-find whose links know whether their two ends point the same way. */
#include "core/memory.h"
#include "reconstruct/cloud_clean.h"
#include "reconstruct/pcl_adapter.h"

#include <stdlib.h>

enum { BLOCK = 1 << 16, K = 17 /* the point itself and 16 */, LINKS = 6 };

typedef struct link {
    float weight; /* 1 − |cos| of the two normals */
    uint32_t a, b;
} link;

typedef struct forest {
    uint32_t *parent;
    uint8_t *flip; /* against the parent */
} forest;

static int compare_links(const void *a, const void *b)
{
    const link *p = a, *q = b;
    if (p->weight != q->weight) {
        return p->weight < q->weight ? -1 : 1;
    }
    return p->a != q->a ? (p->a < q->a ? -1 : 1) : (p->b > q->b) - (p->b < q->b);
}

static tsuya_vec3 normal_of(const tsuya_mesh *cloud, size_t v)
{
    return (tsuya_vec3){cloud->normal[3 * v], cloud->normal[3 * v + 1], cloud->normal[3 * v + 2]};
}

/* Root of v and whether v is turned against it; halves the path as it goes. */
static uint32_t find_root(forest *f, uint32_t v, uint8_t *flip)
{
    *flip = 0;
    while (f->parent[v] != v) {
        uint32_t up = f->parent[v];
        f->flip[v] = f->flip[v] ^ (f->parent[up] != up ? f->flip[up] : 0);
        f->parent[v] = f->parent[up];
        *flip ^= f->flip[v];
        v = f->parent[v];
    }
    return v;
}

static void plane_normal(tsuya_mesh *cloud, size_t v, const uint32_t *index)
{
    tsuya_vec3 mean = {0, 0, 0};
    for (int k = 0; k < K; k++) {
        mean = tsuya_vec3_mad(mean, 1.0 / K, tsuya_mesh_position(cloud, index[k]));
    }
    tsuya_mat3 covariance = {{{0}}}, vectors;
    for (int k = 0; k < K; k++) {
        tsuya_vec3 d = tsuya_vec3_sub(tsuya_mesh_position(cloud, index[k]), mean);
        const double x[3] = {d.x, d.y, d.z};
        for (int i = 0; i < 3; i++) {
            for (int j = 0; j < 3; j++) {
                covariance.e[i][j] += x[i] * x[j];
            }
        }
    }
    double values[3];
    tsuya_mat3_eigen_symmetric(covariance, values, &vectors);
    for (size_t i = 0; i < 3; i++) {
        cloud->normal[3 * v + i] = (float)vectors.e[i][0];
    }
}

/* Planes' normals, and LINKS links a point. */
static tsuya_status fit_planes(tsuya_mesh *cloud, link *links, const tsuya_context *context)
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
#pragma omp parallel for num_threads(context->threads)
        for (size_t v = begin; v < end; v++) {
            plane_normal(cloud, v, index + (v - begin) * K);
            for (size_t k = 0; k < LINKS; k++) {
                links[v * LINKS + k] = (link){0.0f, (uint32_t)v, index[(v - begin) * K + k + 1]};
            }
        }
    }
done:
    tsuya_pcl_tree_free(tree);
    tsuya_free(index);
    tsuya_free(distance2);
    return status;
}

static void join(forest *f, const tsuya_mesh *cloud, const link *l)
{
    uint8_t flip_a, flip_b;
    uint32_t a = find_root(f, l->a, &flip_a), b = find_root(f, l->b, &flip_b);
    if (a != b) {
        uint8_t opposed = tsuya_vec3_dot(normal_of(cloud, l->a), normal_of(cloud, l->b)) < 0.0;
        uint32_t low = a < b ? a : b, high = a < b ? b : a;
        f->parent[high] = low;
        f->flip[high] = flip_a ^ flip_b ^ opposed;
    }
}

/* Turns every part so that its normals, on the whole, leave its centroid. */
static void orient(tsuya_mesh *cloud, forest *f, tsuya_vec3 *sum, double *count, double *outward)
{
    uint8_t flip;
    for (uint32_t v = 0; v < cloud->vertex_count; v++) {
        uint32_t root = find_root(f, v, &flip);
        sum[root] = tsuya_vec3_add(sum[root], tsuya_mesh_position(cloud, v));
        count[root] += 1.0;
    }
    for (int pass = 0; pass < 2; pass++) {
        for (uint32_t v = 0; v < cloud->vertex_count; v++) {
            uint32_t root = find_root(f, v, &flip);
            tsuya_vec3 out = tsuya_vec3_mad(tsuya_mesh_position(cloud, v), -1.0 / count[root], sum[root]);
            double along = tsuya_vec3_dot(normal_of(cloud, v), out) * (flip ? -1.0 : 1.0);
            if (pass == 0) {
                outward[root] += along;
            } else if (flip != (outward[root] < 0.0)) {
                for (size_t k = 0; k < 3; k++) {
                    cloud->normal[3 * (size_t)v + k] = -cloud->normal[3 * (size_t)v + k];
                }
            }
        }
    }
}

tsuya_status tsuya_cloud_estimate_normals(tsuya_mesh *cloud, const tsuya_context *context)
{
    size_t n = cloud->vertex_count;
    if (n < K) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "a cloud of %zu points without normals; at least %d are needed", n, K);
    }
    tsuya_status status = TSUYA_OK;
    link *links = NULL;
    forest f = {NULL, NULL};
    tsuya_vec3 *sum = NULL;
    double *count = NULL, *outward = NULL;
    TSUYA_GOTO_DONE(status, tsuya_mesh_add_arrays(cloud, TSUYA_MESH_NORMAL));
    TSUYA_NEW(status, links, n * LINKS);
    TSUYA_NEW(status, f.parent, n);
    TSUYA_NEW(status, f.flip, n);
    TSUYA_NEW(status, sum, n);
    TSUYA_NEW(status, count, n);
    TSUYA_NEW(status, outward, n);
    TSUYA_GOTO_DONE(status, fit_planes(cloud, links, context));
    for (size_t l = 0; l < n * LINKS; l++) {
        double cosine = tsuya_vec3_dot(normal_of(cloud, links[l].a), normal_of(cloud, links[l].b));
        links[l].weight = (float)(1.0 - fabs(cosine));
    }
    for (uint32_t v = 0; v < n; v++) {
        f.parent[v] = v;
    }
    qsort(links, n * LINKS, sizeof *links, compare_links);
    for (size_t l = 0; l < n * LINKS; l++) {
        join(&f, cloud, &links[l]);
    }
    orient(cloud, &f, sum, count, outward);
done:
    tsuya_free(links);
    tsuya_free(f.parent);
    tsuya_free(f.flip);
    tsuya_free(sum);
    tsuya_free(count);
    tsuya_free(outward);
    return status;
}
