/* Analytic clouds with known truth. */
#ifndef TSUYA_TESTS_CLOUDS_H
#define TSUYA_TESTS_CLOUDS_H

#include "core/context.h"
#include "core/mesh.h"

enum { CLOUD_SEED = 20 };

static inline void cloud_set(tsuya_mesh *cloud, size_t v, tsuya_vec3 p, tsuya_vec3 n)
{
    cloud->position[3 * v] = (float)p.x;
    cloud->position[3 * v + 1] = (float)p.y;
    cloud->position[3 * v + 2] = (float)p.z;
    cloud->normal[3 * v] = (float)n.x;
    cloud->normal[3 * v + 1] = (float)n.y;
    cloud->normal[3 * v + 2] = (float)n.z;
    cloud->evidence[v] = 4.0f;
    cloud->sigma[v] = 0.001f;
    cloud->color[3 * v] = 200;
}

static inline double cloud_random(size_t v, uint64_t counter) { return tsuya_random_uniform(CLOUD_SEED, v, counter); }
static inline double cloud_normal(size_t v, uint64_t counter) { return tsuya_random_normal(CLOUD_SEED, v, counter); }

enum { CLOUD_ARRAYS = TSUYA_MESH_NORMAL | TSUYA_MESH_EVIDENCE | TSUYA_MESH_SIGMA | TSUYA_MESH_COLOR };

/* Unit sphere, even (Fibonacci) points, `noise` along the normal. */
static inline tsuya_status cloud_sphere(tsuya_mesh *cloud, size_t count, double noise)
{
    TSUYA_TRY(tsuya_mesh_create(cloud, count, 0, CLOUD_ARRAYS));
    for (size_t v = 0; v < count; v++) {
        double z = 1.0 - (2.0 * (double)v + 1.0) / (double)count, r = sqrt(1.0 - z * z);
        double phi = (double)v * M_PI * (3.0 - sqrt(5.0));
        tsuya_vec3 n = {r * cos(phi), r * sin(phi), z};
        cloud_set(cloud, v, tsuya_vec3_scale(n, 1.0 + noise * cloud_normal(v, 0)), n);
    }
    return TSUYA_OK;
}

static inline double wavy(double x, double y) { return 0.06 * sin(7.0 * x) * cos(5.0 * y); }
static inline tsuya_vec3 wavy_normal(double x, double y)
{
    return tsuya_vec3_unit((tsuya_vec3){-0.42 * cos(7.0 * x) * cos(5.0 * y), 0.3 * sin(7.0 * x) * sin(5.0 * y), 1.0});
}

/* side² points on the wavy sheet over the unit square, jittered by a third of the spacing 1 / side; those for which `leave`
 * says yes are moved onto the first corner, so that they are duplicates. */
static inline tsuya_status cloud_sheet(tsuya_mesh *cloud, size_t side, double lift, double facing,
                                       bool (*leave)(double x, double y))
{
    TSUYA_TRY(tsuya_mesh_create(cloud, side * side, 0, CLOUD_ARRAYS));
    for (size_t v = 0; v < side * side; v++) {
        double x = ((double)(v % side) + 0.5 + 0.66 * (cloud_random(v, 0) - 0.5)) / (double)side;
        double y = ((double)(v / side) + 0.5 + 0.66 * (cloud_random(v, 1) - 0.5)) / (double)side;
        if (leave && leave(x, y)) {
            x = y = 0.5 / (double)side;
        }
        cloud_set(cloud, v, (tsuya_vec3){x, y, wavy(x, y) + lift}, tsuya_vec3_scale(wavy_normal(x, y), facing));
    }
    return TSUYA_OK;
}

/* a := a and b, b is freed. */
static inline tsuya_status cloud_join(tsuya_mesh *a, tsuya_mesh *b)
{
    tsuya_mesh both;
    TSUYA_TRY(tsuya_mesh_create(&both, a->vertex_count + b->vertex_count, 0, CLOUD_ARRAYS));
    for (size_t v = 0; v < both.vertex_count; v++) {
        const tsuya_mesh *from = v < a->vertex_count ? a : b;
        size_t i = v < a->vertex_count ? v : v - a->vertex_count;
        cloud_set(&both, v, tsuya_mesh_position(from, i),
                  (tsuya_vec3){from->normal[3 * i], from->normal[3 * i + 1], from->normal[3 * i + 2]});
    }
    tsuya_mesh_free(a);
    tsuya_mesh_free(b);
    *a = both;
    *b = (tsuya_mesh){0};
    return TSUYA_OK;
}

#endif
