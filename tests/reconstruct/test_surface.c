#include "support.h"

#include "clouds.h"
#include "core/memory.h"
#include "reconstruct/mesh_topology.h"
#include "reconstruct/surface.h"

static tsuya_context context_of(int threads)
{
    tsuya_context context = tsuya_context_default();
    context.threads = threads;
    return context;
}

/* Without the splitting of long edges: what is held against shapes here are the vertices that the decimation left. */
static tsuya_surface_options geometry_options(void)
{
    tsuya_surface_options options = tsuya_surface_options_default();
    options.color_spacings = 0.0;
    return options;
}

static tsuya_status surface_of(tsuya_mesh *mesh, tsuya_surface_info *info, const tsuya_mesh *cloud,
                               const tsuya_surface_options *options, int threads)
{
    tsuya_context context = context_of(threads);
    tsuya_surface_options plain = geometry_options();
    return tsuya_surface_make(mesh, info, cloud, options ? options : &plain, &context);
}

static void check_whole(const tsuya_mesh *mesh, const tsuya_surface_info *info)
{
    assert_int_equal(mesh->vertex_count, info->vertices);
    assert_int_equal(mesh->triangle_count, info->triangles);
    assert_true(info->triangles > 0);
    assert_non_null(mesh->normal);
    assert_non_null(mesh->evidence);
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        const float *n = mesh->normal + 3 * v;
        assert_true(fabsf(n[0] * n[0] + n[1] * n[1] + n[2] * n[2] - 1.0f) < 1e-3f);
        assert_true(mesh->evidence[v] >= 0.0f && isfinite(mesh->evidence[v]));
    }
}

/* Largest and 95th percentile of how far the vertices stand from the unit sphere. */
static void sphere_error(double *p95, double *most, const tsuya_mesh *mesh)
{
    size_t above = 0;
    *most = 0.0;
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        *most = fmax(*most, fabs(tsuya_vec3_norm(tsuya_mesh_position(mesh, v)) - 1.0));
    }
    for (*p95 = 0.0;; *p95 += *most / 100.0, above = 0) {
        for (size_t v = 0; v < mesh->vertex_count; v++) {
            above += fabs(tsuya_vec3_norm(tsuya_mesh_position(mesh, v)) - 1.0) > *p95;
        }
        if (20 * above <= mesh->vertex_count) {
            return;
        }
    }
}

static void a_sphere_comes_back_closed(void **state)
{
    (void)state;
    tsuya_mesh cloud, mesh;
    tsuya_surface_info info;
    double p95, most;
    assert_ok(cloud_sphere(&cloud, 6000, 0.0));
    assert_ok(surface_of(&mesh, &info, &cloud, NULL, 2));
    check_whole(&mesh, &info);
    sphere_error(&p95, &most, &mesh);
    print_message("sphere: spacing %.4f, depth %d, error p95 %.2f, max %.2f spacings, %zu of %zu triangles\n", info.spacing,
                  info.poisson_depth, p95 / info.spacing, most / info.spacing, info.triangles, info.triangles_before);
    assert_true(fabs(info.spacing / sqrt(4.0 * M_PI / 6000.0) - 1.0) < 0.15);
    assert_int_equal(info.boundary_edges, 0);
    assert_int_equal(info.components, 1);
    assert_true(info.bridged_fraction == 0.0 && info.trimmed_fraction < 1e-6);
    assert_true(p95 < 0.25 * info.spacing && most < 0.6 * info.spacing);
    assert_true(info.simplification_p95 <= info.tolerance && info.simplification_max < 3.0 * info.tolerance);
    assert_true(info.triangles < info.triangles_before / 2);
    assert_true(fabs(tsuya_mesh_area(&mesh) / (4.0 * M_PI) - 1.0) < 0.02);
    for (size_t v = 0; v < mesh.vertex_count; v++) { /* outwards, attributes carried */
        const float *n = mesh.normal + 3 * v, *p = mesh.position + 3 * v;
        assert_true(n[0] * p[0] + n[1] * p[1] + n[2] * p[2] > 0.9f);
        assert_true(fabsf(mesh.evidence[v] - 4.0f) < 1e-3f && fabsf(mesh.sigma[v] - 0.001f) < 1e-6f);
        assert_int_equal(mesh.color[3 * v], 200);
    }
    tsuya_mesh_free(&mesh);
    tsuya_mesh_free(&cloud);
}

/* The same cloud with what a job uses: no edge so long that colours between its ends are lost, and still closed. */
static void a_coloured_mesh_keeps_short_edges(void **state)
{
    (void)state;
    tsuya_mesh cloud, mesh;
    tsuya_surface_info info;
    tsuya_surface_options options = tsuya_surface_options_default();
    double longest = 0.0;
    assert_ok(cloud_sphere(&cloud, 6000, 0.0));
    options.tolerance = 0.05; /* of a radius of 1: large triangles */
    assert_ok(surface_of(&mesh, &info, &cloud, &options, 2));
    check_whole(&mesh, &info);
    for (size_t i = 0; i < 3 * mesh.triangle_count; i++) {
        uint32_t a = mesh.triangle[i], b = mesh.triangle[i % 3 == 2 ? i - 2 : i + 1];
        longest = fmax(longest, tsuya_vec3_norm(tsuya_vec3_sub(tsuya_mesh_position(&mesh, a), tsuya_mesh_position(&mesh, b))));
    }
    assert_true(longest <= options.color_spacings * info.spacing);
    assert_int_equal(info.boundary_edges, 0);
    tsuya_mesh_free(&mesh);
    tsuya_mesh_free(&cloud);
}

static void noise_outliers_and_duplicates_do_little_harm(void **state)
{
    (void)state;
    tsuya_mesh cloud, stray, mesh;
    tsuya_surface_info info;
    double p95, most, noise = 0.02;
    assert_ok(cloud_sphere(&cloud, 6000, noise));
    assert_ok(cloud_sphere(&stray, 900, 0.0));
    for (size_t v = 0; v < 300; v++) {
        tsuya_vec3 p = {3.0 * cloud_random(v, 7) - 1.5, 3.0 * cloud_random(v, 8) - 1.5, 3.0 * cloud_random(v, 9) - 1.5};
        cloud_set(&stray, v, p, tsuya_vec3_unit((tsuya_vec3){cloud_normal(v, 10), cloud_normal(v, 12), cloud_normal(v, 14)}));
    }
    for (size_t v = 300; v < 900; v++) { /* the same points again, up to five times */
        size_t from = v % 120;
        cloud_set(&stray, v, tsuya_mesh_position(&cloud, from),
                  (tsuya_vec3){cloud.normal[3 * from], cloud.normal[3 * from + 1], cloud.normal[3 * from + 2]});
    }
    assert_ok(cloud_join(&cloud, &stray));
    assert_ok(surface_of(&mesh, &info, &cloud, NULL, 2));
    check_whole(&mesh, &info);
    sphere_error(&p95, &most, &mesh);
    print_message("noise of %.2f spacings, 5 %% outliers: error p95 %.2f, max %.2f spacings; %zu of %zu points kept, %zu parts\n",
                  noise / info.spacing, p95 / info.spacing, most / info.spacing, info.points_kept, info.points_in,
                  info.components);
    assert_true(info.points_kept <= 6300 && info.points_kept > 5700);
    assert_true(info.points_outlying >= 150);
    assert_int_equal(info.components, 1);
    assert_true(p95 < 2.0 * noise);
    tsuya_mesh_free(&mesh);
    tsuya_mesh_free(&cloud);
}

/* Distance in the ground plane from the unit square's border, positive inside. */
static double from_hem(double x, double y) { return fmin(fmin(x, 1.0 - x), fmin(y, 1.0 - y)); }

static void an_open_sheet_keeps_its_hem(void **state)
{
    (void)state;
    enum { SIDE = 80 };
    tsuya_mesh cloud, mesh;
    tsuya_surface_info info;
    uint32_t *boundary;
    size_t count;
    double worst = 0.0, height = 0.0, missing = 0.0;
    assert_ok(cloud_sheet(&cloud, SIDE, 0.0, 1.0, NULL));
    assert_ok(surface_of(&mesh, &info, &cloud, NULL, 2));
    check_whole(&mesh, &info);
    assert_ok(tsuya_mesh_boundary(&boundary, &count, &mesh));
    for (size_t v = 0; v < mesh.vertex_count; v++) {
        tsuya_vec3 p = tsuya_mesh_position(&mesh, v);
        worst = fmax(worst, -from_hem(p.x, p.y));
        if (from_hem(p.x, p.y) > 0.0) {
            height = fmax(height, fabs(p.z - wavy(p.x, p.y)));
        }
        assert_true(mesh.normal[3 * v + 2] > 0.5f);
    }
    for (size_t e = 0; e < 2 * count; e++) {
        tsuya_vec3 p = tsuya_mesh_position(&mesh, boundary[e]);
        worst = fmax(worst, fabs(from_hem(p.x, p.y)));
    }
    for (int k = 0; k < 400; k++) { /* every place of the hem has the mesh's border near */
        double s = (k % 100 + 0.5) / 100.0, nearest = INFINITY;
        tsuya_vec3 hem = {k < 100 ? s : k < 200 ? 1.0 : k < 300 ? s : 0.0, k < 100 ? 0.0 : k < 200 ? s : k < 300 ? 1.0 : s, 0.0};
        for (size_t e = 0; e < count; e++) {
            tsuya_vec3 a = tsuya_mesh_position(&mesh, boundary[2 * e]), b = tsuya_mesh_position(&mesh, boundary[2 * e + 1]);
            tsuya_vec2 along = {b.x - a.x, b.y - a.y}, to = {hem.x - a.x, hem.y - a.y};
            double m = (to.x * along.x + to.y * along.y) / fmax(along.x * along.x + along.y * along.y, 1e-30);
            m = fmin(fmax(m, 0.0), 1.0);
            nearest = fmin(nearest, hypot(to.x - m * along.x, to.y - m * along.y));
        }
        missing = fmax(missing, nearest);
    }
    print_message("open sheet: hem within %.2f spacings, hem missed by at most %.2f, heights within %.2f; %zu boundary edges\n",
                  worst * SIDE, missing * SIDE, height * SIDE, count);
    assert_true(worst < 2.0 / SIDE && missing < 2.0 / SIDE && height < 0.5 / SIDE);
    assert_int_equal(info.components, 1);
    assert_int_equal(info.boundary_edges, count);
    assert_true(fabs(tsuya_mesh_area(&mesh) - 1.07) < 0.08);
    tsuya_free(boundary);
    tsuya_mesh_free(&mesh);
    tsuya_mesh_free(&cloud);
}

/* Two layers of cloth, back to back, six spacings apart. */
static void thin_layers_do_not_fuse(void **state)
{
    (void)state;
    enum { SIDE = 70 };
    double apart = 6.0 / SIDE;
    tsuya_mesh cloud, other, mesh;
    tsuya_surface_info info;
    assert_ok(cloud_sheet(&cloud, SIDE, apart, 1.0, NULL));
    assert_ok(cloud_sheet(&other, SIDE, 0.0, -1.0, NULL));
    assert_ok(cloud_join(&cloud, &other));
    assert_ok(surface_of(&mesh, &info, &cloud, NULL, 2));
    check_whole(&mesh, &info);
    size_t between = 0, upper = 0, lower = 0;
    for (size_t v = 0; v < mesh.vertex_count; v++) {
        tsuya_vec3 p = tsuya_mesh_position(&mesh, v);
        double h = p.z - wavy(p.x, p.y);
        if (from_hem(p.x, p.y) > 2.0 / SIDE) {
            bool near_upper = fabs(h - apart) < 0.5 / SIDE, near_lower = fabs(h) < 0.5 / SIDE;
            upper += near_upper;
            lower += near_lower;
            between += !near_upper && !near_lower;
        }
        assert_true(from_hem(p.x, p.y) > -2.0 / SIDE);
    }
    print_message("layers 6 spacings apart: %zu vertices above, %zu below, %zu between; %zu parts\n", upper, lower, between,
                  info.components);
    assert_true(upper > 20 && lower > 20);
    assert_int_equal(between, 0);
    tsuya_mesh_free(&mesh);
    tsuya_mesh_free(&cloud);
}

static bool crease(double x, double y) { return fabs(x - 0.5) < 2.5 / 80 && y > 0.25 && y < 0.75; }
static bool wide_hole(double x, double y) { return hypot(x - 0.5, y - 0.5) < 12.0 / 80; }

/* Share of the hole's centre line or area that the mesh covers, by vertices within a spacing; and its evidence. */
static double covered(const tsuya_mesh *mesh, bool (*hole)(double, double), bool *measured)
{
    int total = 0, with = 0;
    *measured = false;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        for (size_t k = 0; k < 3; k++) {
            size_t v = mesh->triangle[3 * t + k];
            *measured = *measured || (crease(mesh->position[3 * v], mesh->position[3 * v + 1]) &&
                                      fabs((double)mesh->position[3 * v] - 0.5) < 0.5 / 80 && mesh->evidence[v] > 0.0f);
        }
    }
    for (int i = 0; i < 200; i++) {
        for (int j = 0; j < 200; j++) {
            tsuya_vec2 p = {(i + 0.5) / 200, (j + 0.5) / 200};
            if (!hole(p.x, p.y)) {
                continue;
            }
            total++;
            for (size_t t = 0; t < mesh->triangle_count; t++) {
                tsuya_vec3 c[3];
                int left = 0;
                for (size_t k = 0; k < 3; k++) {
                    c[k] = tsuya_mesh_position(mesh, mesh->triangle[3 * t + k]);
                }
                for (int k = 0; k < 3; k++) {
                    tsuya_vec3 a = c[k], b = c[(k + 1) % 3];
                    left += (b.x - a.x) * (p.y - a.y) - (b.y - a.y) * (p.x - a.x) >= 0.0;
                }
                if (left == 3) {
                    with++;
                    break;
                }
            }
        }
    }
    return (double)with / total;
}

static void creases_are_bridged_and_wide_holes_stay(void **state)
{
    (void)state;
    tsuya_mesh cloud, mesh;
    tsuya_surface_info info;
    bool measured;
    assert_ok(cloud_sheet(&cloud, 80, 0.0, 1.0, crease));
    assert_ok(surface_of(&mesh, &info, &cloud, NULL, 2));
    double over_crease = covered(&mesh, crease, &measured);
    print_message("crease 5 spacings wide: %.0f %% covered, bridged share %.4f of the area (hole: %.4f)\n", 100.0 * over_crease,
                  info.bridged_fraction, 5.0 / 80 * 0.5);
    assert_true(over_crease > 0.99);
    assert_false(measured);
    assert_true(info.bridged_fraction > 0.002 && info.bridged_fraction < 0.05);
    tsuya_mesh_free(&mesh);
    tsuya_mesh_free(&cloud);

    assert_ok(cloud_sheet(&cloud, 80, 0.0, 1.0, wide_hole));
    assert_ok(surface_of(&mesh, &info, &cloud, NULL, 2));
    double over_hole = covered(&mesh, wide_hole, &measured);
    tsuya_mesh_free(&mesh);
    tsuya_surface_options options = geometry_options();
    options.close_holes = 20.0 / 80;
    assert_ok(surface_of(&mesh, &info, &cloud, &options, 2));
    double closed = covered(&mesh, wide_hole, &measured);
    print_message("hole 24 spacings wide: %.0f %% covered, when asked to close %.0f %%\n", 100.0 * over_hole, 100.0 * closed);
    assert_true(over_hole < 0.45 && closed > 0.99);
    assert_true(info.bridged_fraction > 0.03);
    tsuya_mesh_free(&mesh);
    tsuya_mesh_free(&cloud);
}

static void normals_are_found_where_there_are_none(void **state)
{
    (void)state;
    tsuya_mesh cloud, mesh;
    tsuya_surface_info info;
    double p95, most;
    assert_ok(cloud_sphere(&cloud, 3000, 0.001));
    tsuya_free(cloud.normal);
    cloud.normal = NULL;
    assert_ok(surface_of(&mesh, &info, &cloud, NULL, 2));
    check_whole(&mesh, &info);
    sphere_error(&p95, &most, &mesh);
    assert_true(most < info.spacing);
    assert_int_equal(info.boundary_edges, 0);
    for (size_t v = 0; v < mesh.vertex_count; v++) {
        const float *n = mesh.normal + 3 * v, *p = mesh.position + 3 * v;
        assert_true(n[0] * p[0] + n[1] * p[1] + n[2] * p[2] > 0.8f);
    }
    tsuya_mesh_free(&mesh);
    tsuya_mesh_free(&cloud);
}

static void thinning_keeps_the_surface(void **state)
{
    (void)state;
    tsuya_mesh cloud, mesh;
    tsuya_surface_info info;
    double p95, most;
    tsuya_surface_options options = geometry_options();
    options.thin = 0.08;
    assert_ok(cloud_sphere(&cloud, 12000, 0.01));
    assert_ok(surface_of(&mesh, &info, &cloud, &options, 2));
    sphere_error(&p95, &most, &mesh);
    assert_true(info.points_kept < 5000 && info.points_kept > 1000);
    assert_true(p95 < 0.01);
    tsuya_mesh_free(&mesh);
    options.thin = 0.0;
    options.tolerance = -1.0;
    assert_ok(surface_of(&mesh, &info, &cloud, &options, 2));
    assert_true(info.triangles > 8000 && info.tolerance == 0.0);
    tsuya_mesh_free(&mesh);
    tsuya_mesh_free(&cloud);
}

static void the_number_of_threads_changes_no_byte(void **state)
{
    (void)state;
    tsuya_mesh cloud, one, many;
    tsuya_surface_info info;
    assert_ok(cloud_sheet(&cloud, 50, 0.0, 1.0, NULL));
    assert_ok(surface_of(&one, &info, &cloud, NULL, 1));
    for (int threads = 2; threads <= 5; threads += 3) {
        assert_ok(surface_of(&many, &info, &cloud, NULL, threads));
        assert_int_equal(one.vertex_count, many.vertex_count);
        assert_int_equal(one.triangle_count, many.triangle_count);
        assert_memory_equal(one.position, many.position, 12 * one.vertex_count);
        assert_memory_equal(one.normal, many.normal, 12 * one.vertex_count);
        assert_memory_equal(one.evidence, many.evidence, 4 * one.vertex_count);
        assert_memory_equal(one.sigma, many.sigma, 4 * one.vertex_count);
        assert_memory_equal(one.color, many.color, 3 * one.vertex_count);
        assert_memory_equal(one.triangle, many.triangle, 12 * one.triangle_count);
        tsuya_mesh_free(&many);
    }
    tsuya_mesh_free(&one);
    tsuya_mesh_free(&cloud);
}

static void clouds_that_hold_no_surface_are_refused(void **state)
{
    (void)state;
    tsuya_mesh cloud, mesh;
    tsuya_surface_info info;
    assert_ok(cloud_sphere(&cloud, 3, 0.0));
    assert_fails(surface_of(&mesh, &info, &cloud, NULL, 1), "3 points");
    tsuya_mesh_free(&cloud);
    assert_ok(cloud_sphere(&cloud, 0, 0.0));
    assert_fails(surface_of(&mesh, &info, &cloud, NULL, 1), "0 points");
    tsuya_mesh_free(&cloud);

    assert_ok(cloud_sphere(&cloud, 500, 0.0));
    cloud.position[3 * 123 + 1] = NAN;
    assert_fails(surface_of(&mesh, &info, &cloud, NULL, 1), "point 123");
    cloud.position[3 * 123 + 1] = INFINITY;
    assert_fails(surface_of(&mesh, &info, &cloud, NULL, 1), "point 123");
    cloud.position[3 * 123 + 1] = 0.0f;
    cloud.normal[3 * 77] = NAN;
    assert_fails(surface_of(&mesh, &info, &cloud, NULL, 1), "point 77");
    cloud.normal[3 * 77] = 0.0f;
    cloud.evidence[55] = NAN;
    assert_fails(surface_of(&mesh, &info, &cloud, NULL, 1), "point 55");
    for (size_t v = 0; v < cloud.vertex_count; v++) {
        cloud_set(&cloud, v, (tsuya_vec3){1, 2, 3}, (tsuya_vec3){0, 0, 1});
    }
    assert_fails(surface_of(&mesh, &info, &cloud, NULL, 1), "1 points");
    for (size_t v = 0; v < cloud.vertex_count; v++) {
        cloud_set(&cloud, v, (tsuya_vec3){(double)v, 0, 0}, (tsuya_vec3){0, 0, 0});
    }
    assert_fails(surface_of(&mesh, &info, &cloud, NULL, 1), "0 points");
    for (size_t v = 0; v < cloud.vertex_count; v++) {
        cloud_set(&cloud, v, (tsuya_vec3){1.0 + 1e-6 * (double)v, 0, 0}, (tsuya_vec3){0, 0, 1});
    }
    tsuya_status status = surface_of(&mesh, &info, &cloud, NULL, 1); /* a line has no surface, whatever comes of it */
    assert_true(status == TSUYA_OK || status == TSUYA_ERROR_INPUT || status == TSUYA_ERROR_NUMERIC);
    tsuya_mesh_free(&mesh);
    tsuya_mesh_free(&cloud);

    tsuya_surface_options options = geometry_options();
    options.depth = 99;
    assert_ok(cloud_sphere(&cloud, 100, 0.0));
    assert_fails(surface_of(&mesh, &info, &cloud, &options, 1), "depth 99");
    options.depth = 0;
    options.tolerance = NAN;
    assert_fails(surface_of(&mesh, &info, &cloud, &options, 1), "tolerance");
    options.tolerance = 0.0;
    options.min_evidence = 5.0;
    assert_fails(surface_of(&mesh, &info, &cloud, &options, 1), "0 points");
    tsuya_mesh_free(&cloud);
}

static void interruption_is_passed_on(void **state)
{
    (void)state;
    tsuya_mesh cloud, mesh;
    tsuya_surface_info info;
    assert_ok(cloud_sphere(&cloud, 500, 0.0));
    tsuya_interrupt();
    assert_int_equal(surface_of(&mesh, &info, &cloud, NULL, 1), TSUYA_ERROR_INTERRUPTED);
    tsuya_interrupt_clear();
    assert_null(mesh.position);
    tsuya_mesh_free(&cloud);
}

static void every_allocation_may_fail(void **state)
{
    (void)state;
    tsuya_mesh cloud, mesh;
    tsuya_surface_info info;
    tsuya_surface_options options = geometry_options();
    options.depth = 4;
    assert_ok(cloud_sphere(&cloud, 200, 0.0));
    tsuya_memory_fail_at(0);
    assert_ok(surface_of(&mesh, &info, &cloud, &options, 1));
    uint64_t count = tsuya_memory_fail_at(0);
    tsuya_mesh_free(&mesh);
    for (uint64_t n = 1; n <= count; n++) {
        tsuya_memory_fail_at(n);
        assert_int_equal(surface_of(&mesh, &info, &cloud, &options, 1), TSUYA_ERROR_MEMORY);
        assert_null(mesh.position);
    }
    tsuya_memory_fail_at(0);
    tsuya_mesh_free(&cloud);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_sphere_comes_back_closed),
        cmocka_unit_test(a_coloured_mesh_keeps_short_edges),
        cmocka_unit_test(noise_outliers_and_duplicates_do_little_harm),
        cmocka_unit_test(an_open_sheet_keeps_its_hem),
        cmocka_unit_test(thin_layers_do_not_fuse),
        cmocka_unit_test(creases_are_bridged_and_wide_holes_stay),
        cmocka_unit_test(normals_are_found_where_there_are_none),
        cmocka_unit_test(thinning_keeps_the_surface),
        cmocka_unit_test(the_number_of_threads_changes_no_byte),
        cmocka_unit_test(clouds_that_hold_no_surface_are_refused),
        cmocka_unit_test(interruption_is_passed_on),
        cmocka_unit_test(every_allocation_may_fail),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
