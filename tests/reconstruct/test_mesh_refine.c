/* Long edges split: the surface stays, no crack opens, no edge is too long. */
#include "reconstruct/mesh_refine.h"
#include "reconstruct/mesh_topology.h"
#include "core/memory.h"
#include "support.h"

#include <math.h>

static double longest_edge(const tsuya_mesh *m)
{
    double longest = 0.0;
    for (size_t t = 0; t < m->triangle_count; t++) {
        for (size_t k = 0; k < 3; k++) {
            tsuya_vec3 a = tsuya_mesh_position(m, m->triangle[3 * t + k]), b = tsuya_mesh_position(m, m->triangle[3 * t + (k + 1) % 3]);
            longest = fmax(longest, tsuya_vec3_norm(tsuya_vec3_sub(a, b)));
        }
    }
    return longest;
}

/* A tetrahedron with corners of different sizes: closed, so it must stay closed. */
static void make_tetrahedron(tsuya_mesh *m)
{
    static const float position[12] = {0, 0, 0, 3, 0, 0, 0, 1, 0, 0, 0, 0.4f};
    static const uint32_t triangle[12] = {0, 2, 1, 0, 1, 3, 0, 3, 2, 1, 2, 3};
    assert_ok(tsuya_mesh_create(m, 4, 4, TSUYA_MESH_COLOR | TSUYA_MESH_SIGMA | TSUYA_MESH_EVIDENCE | TSUYA_MESH_MATERIAL));
    memcpy(m->position, position, sizeof position);
    memcpy(m->triangle, triangle, sizeof triangle);
    for (size_t v = 0; v < 4; v++) {
        m->color[3 * v] = (uint8_t)(60 * v);
        m->sigma[v] = m->position[3 * v]; /* linear in x: must stay so */
        m->evidence[v] = v == 1 ? 5.0f : 0.0f; /* seen at one corner only */
        m->material[v] = 2;
    }
    assert_ok(tsuya_mesh_compute_normals(m));
}

static void test_surface_stays_closed_and_in_place(void **state)
{
    (void)state;
    tsuya_mesh m;
    uint32_t *boundary;
    size_t edges;
    make_tetrahedron(&m);
    double area = tsuya_mesh_area(&m);
    assert_ok(tsuya_mesh_refine(&m, 0.11));
    assert_true(longest_edge(&m) <= 0.11);
    assert_true(m.triangle_count > 500);
    assert_true(fabs(tsuya_mesh_area(&m) - area) < 1e-5 * area);
    assert_ok(tsuya_mesh_boundary(&boundary, &edges, &m));
    assert_int_equal(edges, 0);
    tsuya_free(boundary);
    assert_int_equal(m.vertex_count - 3 * m.triangle_count / 2 + m.triangle_count, 2); /* Euler */
    for (size_t v = 0; v < m.vertex_count; v++) {
        const float *n = m.normal + 3 * v;
        assert_true(fabs((double)(m.sigma[v] - m.position[3 * v])) < 1e-5);
        assert_true(m.evidence[v] == (v == 1 ? 5.0f : 0.0f));
        assert_true(fabs((double)(n[0] * n[0] + n[1] * n[1] + n[2] * n[2]) - 1.0) < 1e-5);
        assert_int_equal(m.material[v], 2);
    }
    tsuya_mesh_free(&m);
}

static void test_nothing_to_do(void **state)
{
    (void)state;
    tsuya_mesh m;
    make_tetrahedron(&m);
    assert_ok(tsuya_mesh_refine(&m, 10.0));
    assert_int_equal(m.vertex_count, 4);
    assert_int_equal(m.triangle_count, 4);
    m.triangle_count = 0;
    assert_ok(tsuya_mesh_refine(&m, 0.1));
    assert_int_equal(m.vertex_count, 4);
    tsuya_mesh_free(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_surface_stays_closed_and_in_place),
        cmocka_unit_test(test_nothing_to_do),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
