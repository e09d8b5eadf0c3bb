/* Levels of detail: what is left out of finely cut spheres, held against the sphere itself. */
#include "support.h"

#include "core/context.h"
#include "core/memory.h"

#include "render/detail.h"

#include "render_scenes.h"

enum { ROWS = 160, POINTS = 20000 };
static const double radius = 0.5;

/* A camera at `distance` whose pixel, there, is `edges` mean edges of the mesh wide. */
static tsuya_detail_view view_of(const tsuya_mesh *mesh, double distance, double edges)
{
    return (tsuya_detail_view){{distance + radius, 0, 0}, edges * tsuya_mesh_mean_edge(mesh) / distance};
}

static void simplify(tsuya_mesh *coarse, tsuya_detail_info *info, const tsuya_mesh *mesh, tsuya_detail_view view, double distance_px, int threads)
{
    tsuya_context context = tsuya_context_default();
    tsuya_detail_options options = tsuya_detail_options_default();
    context.threads = threads;
    options.distance_px = distance_px;
    assert_ok(tsuya_mesh_detail(coarse, info, mesh, &view, 1, &options, &context));
}

static tsuya_vec3 at(const float *array, const uint32_t *v, const double b[3])
{
    double sum[3] = {0, 0, 0};
    for (int k = 0; k < 9; ++k) {
        sum[k % 3] += b[k / 3] * (double)array[3 * (size_t)v[k / 3] + (size_t)(k % 3)];
    }
    return (tsuya_vec3){sum[0], sum[1], sum[2]};
}

/* Anywhere on the simplified surface, not only where it was measured. */
static void test_a_sphere_stays_one(void **state)
{
    (void)state;
    tsuya_mesh mesh, coarse;
    tsuya_detail_info info;
    scene_sphere(&mesh, radius, ROWS, false);
    tsuya_detail_view view = view_of(&mesh, 10.0, 6.0);
    double pixel = view.pixel_rad * 10.0, worst = 0.0, worst_deg = 0.0;
    simplify(&coarse, &info, &mesh, view, 0.1, 2);
    assert_int_equal(info.triangles_before, mesh.triangle_count);
    assert_int_equal(info.triangles_after, coarse.triangle_count);
    print_message("%zu of %zu triangles; vertices off by %.3f px, normals %.2f, weft %.2f degrees\n", info.triangles_after, info.triangles_before,
                  info.distance_px, info.normal_deg, info.weft_deg);
    assert_true(coarse.triangle_count < mesh.triangle_count / 3);
    assert_true(info.distance_px <= 0.1 && info.normal_deg <= 1.0 && info.weft_deg <= 1.0);
    for (uint64_t k = 0; k < POINTS; ++k) {
        const uint32_t *v = coarse.triangle + 3 * (size_t)(tsuya_random_uniform(1, 1, k) * (double)coarse.triangle_count);
        double s = sqrt(tsuya_random_uniform(1, 2, k)), t = tsuya_random_uniform(1, 3, k);
        const double b[3] = {1.0 - s, s * (1.0 - t), s * t};
        tsuya_vec3 p = at(coarse.position, v, b), n = tsuya_vec3_unit(at(coarse.normal, v, b));
        worst = fmax(worst, fabs(tsuya_vec3_norm(p) - radius));
        worst_deg = fmax(worst_deg, tsuya_deg_from_rad(acos(fmin(1.0, tsuya_vec3_dot(n, tsuya_vec3_unit(p))))));
    }
    print_message("anywhere: %.3f px, %.2f degrees\n", worst / pixel, worst_deg);
    assert_true(worst <= 0.2 * pixel && worst_deg <= 1.5);
    tsuya_mesh_free(&coarse);
    tsuya_mesh_free(&mesh);
}

static void test_near_views_keep_everything(void **state)
{
    (void)state;
    tsuya_mesh mesh, coarse;
    tsuya_detail_info info;
    scene_sphere(&mesh, radius, ROWS, false);
    simplify(&coarse, &info, &mesh, view_of(&mesh, 10.0, 1.0), 0.1, 2);
    assert_int_equal(info.triangles_after, mesh.triangle_count);
    assert_int_equal(coarse.vertex_count, 0);
    simplify(&coarse, &info, &mesh, view_of(&mesh, 10.0, 20.0), 0.0, 2);
    assert_int_equal(coarse.vertex_count, 0);
    tsuya_detail_view inside = {{0.1, 0, 0}, 0.1}; /* as near as can be to some patch */
    simplify(&coarse, &info, &mesh, inside, 0.1, 2);
    assert_true(info.triangles_after <= mesh.triangle_count);
    tsuya_mesh_free(&coarse);
    tsuya_mesh_free(&mesh);
}

/* Stripes of colour, two materials, a weft that turns by 90 degrees: they stay where they are. */
static void test_what_the_vertices_carry_stays(void **state)
{
    (void)state;
    tsuya_mesh mesh, coarse;
    tsuya_detail_info info;
    scene_plane(&mesh, 1.0, 200);
    assert_ok(tsuya_mesh_add_arrays(&mesh, TSUYA_MESH_COLOR | TSUYA_MESH_MATERIAL));
    for (size_t v = 0; v < mesh.vertex_count; ++v) {
        double x = mesh.position[3 * v];
        mesh.color[3 * v] = x > 0.2 ? 200 : 50;
        mesh.material[v] = x < -0.2;
        mesh.weft[3 * v] = mesh.position[3 * v + 1] > 0.0f ? 1.0f : 0.0f;
        mesh.weft[3 * v + 1] = 1.0f - mesh.weft[3 * v];
    }
    tsuya_detail_view above = {{0, 0, 10}, 0.005};
    simplify(&coarse, &info, &mesh, above, 0.1, 2);
    print_message("%zu of %zu triangles of a plane with edges\n", info.triangles_after, info.triangles_before);
    assert_true(info.triangles_after < info.triangles_before);
    assert_true(info.color <= 3.0 && info.weft_deg <= 1.0);
    const double third[3] = {1.0 / 3.0, 1.0 / 3.0, 1.0 / 3.0};
    for (size_t t = 0; t < coarse.triangle_count; ++t) { /* no triangle mixes what two columns of vertices would not have mixed */
        const uint32_t *v = coarse.triangle + 3 * t;
        tsuya_vec3 p = at(coarse.position, v, third);
        for (int k = 0; k < 3; ++k) {
            assert_true(fabs(p.x - 0.2) < 0.011 || coarse.color[3 * (size_t)v[k]] == (p.x > 0.2 ? 200 : 50));
            assert_true(fabs(p.x + 0.2) < 0.011 || coarse.material[v[k]] == (p.x < -0.2));
            assert_true(fabs(p.y) < 0.011 || coarse.weft[3 * (size_t)v[k]] == (p.y > 0.0 ? 1.0f : 0.0f));
        }
    }
    tsuya_mesh_free(&coarse);
    tsuya_mesh_free(&mesh);
}

static void test_any_number_of_threads(void **state)
{
    (void)state;
    tsuya_mesh mesh, coarse[2];
    tsuya_detail_info info;
    scene_drape(&mesh, 150);
    for (int k = 0; k < 2; ++k) {
        simplify(&coarse[k], &info, &mesh, view_of(&mesh, 10.0, 8.0), 0.2, 1 + 2 * k);
    }
    assert_true(coarse[0].triangle_count > 0 && coarse[0].triangle_count < mesh.triangle_count);
    assert_int_equal(coarse[0].triangle_count, coarse[1].triangle_count);
    assert_memory_equal(coarse[0].triangle, coarse[1].triangle, 3 * coarse[0].triangle_count * sizeof *coarse[0].triangle);
    tsuya_mesh_free(&coarse[0]);
    tsuya_mesh_free(&coarse[1]);
    tsuya_mesh_free(&mesh);
}

/* A reason for each allocation that fails, in this thread's name, and nothing left behind. */
static void test_every_allocation_may_fail(void **state)
{
    (void)state;
    tsuya_mesh mesh, coarse;
    tsuya_detail_info info;
    tsuya_context context = tsuya_context_default();
    tsuya_detail_options options = tsuya_detail_options_default();
    uint64_t refused = 0;
    context.threads = 1;
    scene_sphere(&mesh, radius, 40, false);
    tsuya_detail_view view = view_of(&mesh, 10.0, 6.0);
    for (uint64_t n = 1;; ++n) {
        assert_int_equal(tsuya_fail(TSUYA_ERROR_INPUT, "another"), TSUYA_ERROR_INPUT);
        tsuya_memory_fail_at(n);
        tsuya_status status = tsuya_mesh_detail(&coarse, &info, &mesh, &view, 1, &options, &context);
        tsuya_memory_fail_at(0);
        if (status == TSUYA_OK) {
            break;
        }
        assert_int_equal(status, TSUYA_ERROR_MEMORY);
        assert_string_not_equal(tsuya_reason(), "another");
        assert_null(coarse.position);
        ++refused;
    }
    print_message("%u allocations\n", (unsigned)refused);
    assert_true(refused > 10);
    tsuya_mesh_free(&coarse);
    tsuya_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_a_sphere_stays_one),
        cmocka_unit_test(test_near_views_keep_everything),
        cmocka_unit_test(test_what_the_vertices_carry_stays),
        cmocka_unit_test(test_any_number_of_threads),
        cmocka_unit_test(test_every_allocation_may_fail),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
