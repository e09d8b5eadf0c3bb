#include "support.h"

#include "clouds.h"
#include "core/memory.h"
#include "core/shapes.h"
#include "reconstruct/mesh_distance.h"

/* Distance to a triangle by brute force: minimum over a fine grid of barycentric weights is never below the true one. */
static double grid_distance(const tsuya_mesh *mesh, tsuya_vec3 p, int steps)
{
    double best = INFINITY;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        tsuya_vec3 c[3];
        for (size_t k = 0; k < 3; k++) {
            c[k] = tsuya_mesh_position(mesh, mesh->triangle[3 * t + k]);
        }
        for (int i = 0; i <= steps; i++) {
            for (int j = 0; i + j <= steps; j++) {
                tsuya_vec3 q = tsuya_vec3_mad(tsuya_vec3_mad(c[0], (double)i / steps, tsuya_vec3_sub(c[1], c[0])),
                                              (double)j / steps, tsuya_vec3_sub(c[2], c[0]));
                best = fmin(best, tsuya_vec3_norm(tsuya_vec3_sub(q, p)));
            }
        }
    }
    return best;
}

static tsuya_vec3 random_point(size_t v, double size)
{
    return (tsuya_vec3){size * cloud_normal(v, 20), size * cloud_normal(v, 22), size * cloud_normal(v, 24)};
}

static void distances_agree_with_a_fine_grid(void **state)
{
    (void)state;
    enum { STEPS = 60 };
    tsuya_mesh mesh;
    assert_ok(tsuya_mesh_create(&mesh, 36, 12, 0));
    for (size_t v = 0; v < 36; v++) {
        tsuya_vec3 p = random_point(v, 1.0);
        mesh.position[3 * v] = (float)p.x;
        mesh.position[3 * v + 1] = (float)p.y;
        mesh.position[3 * v + 2] = (float)p.z;
        mesh.triangle[v] = (uint32_t)v;
    }
    mesh.triangle[4] = mesh.triangle[3]; /* a segment */
    mesh.triangle[7] = mesh.triangle[8] = mesh.triangle[6]; /* a point */
    tsuya_mesh_tree *tree;
    assert_ok(tsuya_mesh_tree_create(&tree, &mesh));
    for (size_t q = 0; q < 200; q++) {
        tsuya_vec3 p = random_point(1000 + q, 2.0);
        tsuya_mesh_hit hit = tsuya_mesh_tree_closest(tree, p, INFINITY);
        double grid = grid_distance(&mesh, p, STEPS);
        assert_true(hit.distance <= grid + 1e-12 && hit.distance > grid - 0.1);
        assert_true(fabs(tsuya_vec3_norm(tsuya_vec3_sub(hit.closest, p)) - hit.distance) < 1e-12);
        tsuya_mesh alone = mesh;
        alone.triangle = mesh.triangle + 3 * (size_t)hit.triangle;
        alone.triangle_count = 1;
        assert_true(grid_distance(&alone, hit.closest, STEPS) < 0.1);
        assert_true(tsuya_mesh_tree_closest(tree, p, 0.999 * hit.distance).triangle == UINT32_MAX);
        assert_true(tsuya_mesh_tree_closest(tree, p, 1.001 * hit.distance + 1e-9).triangle == hit.triangle);
    }
    tsuya_mesh_tree_free(tree);
    tsuya_mesh_free(&mesh);
}

static void points_around_a_sphere_are_as_far_as_their_radius_says(void **state)
{
    (void)state;
    enum { COUNT = 5000 };
    tsuya_mesh mesh;
    float *point = tsuya_calloc(COUNT, 3 * sizeof *point), *distance = tsuya_calloc(COUNT, 2 * sizeof *distance);
    assert_non_null(point);
    assert_non_null(distance);
    for (size_t v = 0; v < COUNT; v++) {
        tsuya_vec3 p = random_point(v, 1.0);
        point[3 * v] = (float)p.x;
        point[3 * v + 1] = (float)p.y;
        point[3 * v + 2] = (float)p.z;
    }
    assert_ok(shape_sphere(&mesh, (tsuya_vec3){0, 0, 0}, 1.0, 200, 400));
    for (int threads = 1; threads <= 3; threads += 2) {
        tsuya_context context = tsuya_context_default();
        context.threads = threads;
        assert_ok(tsuya_mesh_distances(distance + (threads > 1 ? COUNT : 0), &mesh, point, COUNT, &context));
    }
    assert_memory_equal(distance, distance + COUNT, COUNT * sizeof *distance);
    for (size_t v = 0; v < COUNT; v++) {
        double r = sqrt((double)(point[3 * v] * point[3 * v] + point[3 * v + 1] * point[3 * v + 1] +
                                 point[3 * v + 2] * point[3 * v + 2]));
        assert_true(fabs((double)distance[v] - fabs(r - 1.0)) < 2e-4);
    }
    tsuya_free(point);
    tsuya_free(distance);
    tsuya_mesh_free(&mesh);
}

static void equal_triangles_and_none_are_no_trouble(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_mesh_tree *tree;
    assert_ok(tsuya_mesh_create(&mesh, 3, 1000, 0)); /* a thousand times the same point */
    assert_ok(tsuya_mesh_tree_create(&tree, &mesh));
    tsuya_mesh_hit hit = tsuya_mesh_tree_closest(tree, (tsuya_vec3){3, 4, 0}, INFINITY);
    assert_true(hit.distance == 5.0);
    tsuya_mesh_tree_free(tree);
    mesh.triangle_count = 0;
    assert_fails(tsuya_mesh_tree_create(&tree, &mesh), "0 triangles");
    mesh.triangle_count = 1000;
    for (uint64_t n = 1; n <= 3; n++) {
        tsuya_memory_fail_at(n);
        assert_int_equal(tsuya_mesh_tree_create(&tree, &mesh), TSUYA_ERROR_MEMORY);
    }
    tsuya_memory_fail_at(0);
    tsuya_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(distances_agree_with_a_fine_grid),
        cmocka_unit_test(points_around_a_sphere_are_as_far_as_their_radius_says),
        cmocka_unit_test(equal_triangles_and_none_are_no_trouble),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
