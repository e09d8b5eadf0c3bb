#include "support.h"

#include "core/memory.h"
#include "core/shapes.h"

enum { EVERYTHING = TSUYA_MESH_NORMAL | TSUYA_MESH_COLOR | TSUYA_MESH_WEFT | TSUYA_MESH_CONFIDENCE | TSUYA_MESH_EVIDENCE | TSUYA_MESH_SHEAR | TSUYA_MESH_THREADS |
                    TSUYA_MESH_MATERIAL | TSUYA_MESH_SIGMA };

static void sphere_has_the_area_bounds_and_normals_of_a_sphere(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    assert_int_equal(shape_sphere(&mesh, (tsuya_vec3){1, 2, 3}, 2.0, 100, 200), TSUYA_OK);
    assert_true(fabs(tsuya_mesh_area(&mesh) / (16.0 * M_PI) - 1.0) < 1e-3);
    tsuya_vec3 low, high;
    tsuya_mesh_bounds(&mesh, &low, &high);
    assert_true(fabs(low.z - 1.0) < 1e-6 && fabs(high.z - 5.0) < 1e-6 && fabs(low.x + 1.0) < 1e-6 && fabs(high.y - 4.0) < 1e-6);
    assert_int_equal(tsuya_mesh_compute_normals(&mesh), TSUYA_OK);
    double worst = 1.0;
    for (size_t v = 0; v < mesh.vertex_count; v++) {
        tsuya_vec3 n = {mesh.normal[3 * v], mesh.normal[3 * v + 1], mesh.normal[3 * v + 2]};
        tsuya_vec3 out = tsuya_vec3_unit(tsuya_vec3_sub(tsuya_mesh_position(&mesh, v), (tsuya_vec3){1, 2, 3}));
        if (fabs(out.z) < 0.99) { /* the poles' vertices are many, each with one triangle of its own */
            worst = fmin(worst, tsuya_vec3_dot(n, out));
        }
        assert_true(fabs(tsuya_vec3_norm(n) - 1.0) < 1e-5);
    }
    assert_true(worst > 0.999);
    tsuya_mesh_free(&mesh);
}

static void empty_mesh_has_no_extent(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_vec3 low, high;
    assert_int_equal(tsuya_mesh_create(&mesh, 0, 0, EVERYTHING), TSUYA_OK);
    tsuya_mesh_bounds(&mesh, &low, &high);
    assert_true(low.x > high.x);
    assert_true(tsuya_mesh_mean_edge(&mesh) == 0.0 && tsuya_mesh_area(&mesh) == 0.0);
    assert_int_equal(tsuya_mesh_compute_normals(&mesh), TSUYA_OK);
    assert_int_equal(tsuya_mesh_filter(&mesh, NULL, true), TSUYA_OK);
    tsuya_mesh_free(&mesh);
}

static void lonely_and_degenerate_parts_get_no_normal(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    assert_int_equal(tsuya_mesh_create(&mesh, 5, 2, 0), TSUYA_OK);
    const float p[15] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 5, 5, 5, 6, 6, 6};
    const uint32_t t[6] = {0, 1, 2, 3, 3, 0};
    memcpy(mesh.position, p, sizeof p);
    memcpy(mesh.triangle, t, sizeof t);
    assert_int_equal(tsuya_mesh_compute_normals(&mesh), TSUYA_OK);
    const float expected[15] = {0, 0, 1, 0, 0, 1, 0, 0, 1, 0, 0, 0, 0, 0, 0};
    assert_memory_equal(mesh.normal, expected, sizeof expected);
    tsuya_mesh_free(&mesh);
}

static void mark_vertices(tsuya_mesh *mesh)
{
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        mesh->evidence[v] = mesh->sigma[v] = mesh->weave_confidence[v] = (float)v;
        mesh->material[v] = mesh->color[3 * v] = (uint8_t)v;
        mesh->weft[3 * v + 1] = mesh->normal[3 * v + 2] = (float)v;
    }
}

static void filter_keeps_order_and_carries_every_array(void **state)
{
    (void)state;
    tsuya_mesh mesh, copy;
    assert_int_equal(shape_sphere(&mesh, (tsuya_vec3){0, 0, 0}, 1.0, 6, 8), TSUYA_OK);
    assert_int_equal(tsuya_mesh_add_arrays(&mesh, EVERYTHING), TSUYA_OK);
    mark_vertices(&mesh);
    assert_int_equal(tsuya_mesh_copy(&copy, &mesh), TSUYA_OK);
    uint8_t keep[7 * 8];
    for (size_t v = 0; v < mesh.vertex_count; v++) {
        keep[v] = mesh.position[3 * v + 2] > -0.1f && v != 3;
    }
    assert_int_equal(tsuya_mesh_filter(&mesh, keep, true), TSUYA_OK);
    assert_true(mesh.triangle_count > 0 && mesh.vertex_count < copy.vertex_count);
    for (size_t v = 0; v < mesh.vertex_count; v++) {
        size_t old = (size_t)mesh.evidence[v];
        assert_true(keep[old]);
        assert_true(v == 0 || mesh.evidence[v] > mesh.evidence[v - 1]);
        assert_memory_equal(mesh.position + 3 * v, copy.position + 3 * old, 3 * sizeof(float));
        assert_true(mesh.sigma[v] == (float)old && mesh.material[v] == old && mesh.color[3 * v] == old);
        assert_true(mesh.weft[3 * v + 1] == (float)old && mesh.normal[3 * v + 2] == (float)old);
    }
    for (size_t k = 0; k < 3 * mesh.triangle_count; k++) {
        assert_true(mesh.triangle[k] < mesh.vertex_count);
    }
    tsuya_mesh_free(&mesh);
    tsuya_mesh_free(&copy);
}

static void sizes_beyond_the_index_are_refused(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    assert_int_equal(tsuya_mesh_create(&mesh, (size_t)UINT32_MAX, 0, 0), TSUYA_ERROR_INPUT);
    assert_int_equal(tsuya_mesh_create(&mesh, 1, SIZE_MAX, 0), TSUYA_ERROR_INPUT);
    tsuya_mesh_free(&mesh);
}

static tsuya_status everything(void)
{
    tsuya_mesh mesh = {0}, copy = {0};
    tsuya_status status;
    uint8_t keep[3] = {1, 1, 0};
    TSUYA_GOTO_DONE(status, tsuya_mesh_create(&mesh, 3, 1, EVERYTHING & ~TSUYA_MESH_NORMAL));
    TSUYA_GOTO_DONE(status, tsuya_mesh_compute_normals(&mesh));
    TSUYA_GOTO_DONE(status, tsuya_mesh_copy(&copy, &mesh));
    TSUYA_GOTO_DONE(status, tsuya_mesh_filter(&copy, keep, false));
done:
    tsuya_mesh_free(&mesh);
    tsuya_mesh_free(&copy);
    return status;
}

static void every_allocation_may_fail(void **state)
{
    (void)state;
    tsuya_memory_fail_at(0);
    assert_int_equal(everything(), TSUYA_OK);
    uint64_t count = tsuya_memory_fail_at(0);
    assert_true(count > 10);
    for (uint64_t n = 1; n <= count; n++) {
        tsuya_memory_fail_at(n);
        assert_int_equal(everything(), TSUYA_ERROR_MEMORY);
    }
    tsuya_memory_fail_at(0);
}

/* A tetrahedron and a triangle hung on one of its edges: eight edges, that edge with three sides, in order. */
static void test_sides(void **state)
{
    (void)state;
    const uint32_t triangle[] = {0, 1, 2, 0, 3, 1, 1, 3, 2, 2, 3, 0, 0, 1, 4};
    tsuya_side side[15];
    bool met[15] = {false};
    assert_int_equal(tsuya_mesh_sides(side, triangle, 5), 8);
    for (int i = 0; i < 15; i++) {
        uint32_t c = side[i].corner, first = c - c % 3, a = triangle[first + (c % 3 + 1) % 3], b = triangle[first + (c % 3 + 2) % 3];
        assert_true(c < 15 && !met[c] && side[i].low < side[i].high);
        met[c] = true;
        assert_int_equal(side[i].low + side[i].high, a + b);
        assert_true(side[i].low == a || side[i].low == b);
        assert_true(i == 0 || side[i - 1].low < side[i].low || (side[i - 1].low == side[i].low && side[i - 1].high <= side[i].high));
    }
    assert_true(tsuya_side_same_edge(&side[0], &side[2]) && !tsuya_side_same_edge(&side[2], &side[3])); /* 0–1 */
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sides),
        cmocka_unit_test(sphere_has_the_area_bounds_and_normals_of_a_sphere),
        cmocka_unit_test(empty_mesh_has_no_extent),
        cmocka_unit_test(lonely_and_degenerate_parts_get_no_normal),
        cmocka_unit_test(filter_keeps_order_and_carries_every_array),
        cmocka_unit_test(sizes_beyond_the_index_are_refused),
        cmocka_unit_test(every_allocation_may_fail),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
