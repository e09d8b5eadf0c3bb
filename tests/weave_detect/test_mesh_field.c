/* The weft field lifted from photographs, against the true one: a sheared sheet on a cylinder, a cone, a draped sheet. */
#include "support.h"

#include "core/memory.h"
#include "scene_surface.h"
#include "weave_detect/mesh_field.h"

#include <math.h>

enum { VIEWS = 12 };

static int compare_doubles(const void *a, const void *b)
{
    double x = *(const double *)a, y = *(const double *)b;
    return (x > y) - (x < y);
}

static double dot3(const float *a, const float *b) { return (double)(a[0] * b[0] + a[1] * b[1] + a[2] * b[2]); }

typedef struct figures {
    double median_deg, p90_deg, right_family, covered;
    int flips;
} figures;

/* Over vertices of confidence ≥ 0.5; a flip is an edge between two of them across which the weft changes its sign. */
static void hold_against(figures *f, const tsuya_mesh *mesh, const tsuya_mesh *truth)
{
    double *error = tsuya_calloc(mesh->vertex_count, sizeof *error);
    size_t count = 0, wrong = 0;
    assert_non_null(error);
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        double along = dot3(mesh->weft + 3 * v, mesh->normal + 3 * v), length = dot3(mesh->weft + 3 * v, mesh->weft + 3 * v);
        assert_true(fabs(length - 1.0) < 1e-3 && fabs(along) < 1e-3);
        assert_true(mesh->weave_confidence[v] >= 0.0f && mesh->weave_confidence[v] <= 1.0f);
        if (mesh->weave_confidence[v] >= 0.5f) {
            error[count] = acos(fmin(fabs(dot3(mesh->weft + 3 * v, truth->weft + 3 * v)), 1.0)) * 180.0 / M_PI;
            wrong += error[count++] > 45.0;
        }
    }
    assert_true(count > 0);
    f->flips = 0;
    for (size_t t = 0; t < mesh->triangle_count; t++) {
        for (int k = 0; k < 3; k++) {
            size_t a = mesh->triangle[3 * t + (size_t)k], b = mesh->triangle[3 * t + (size_t)(k + 1) % 3];
            bool both = mesh->weave_confidence[a] >= 0.5f && mesh->weave_confidence[b] >= 0.5f;
            f->flips += both && dot3(mesh->weft + 3 * a, mesh->weft + 3 * b) < 0.0;
        }
    }
    qsort(error, count, sizeof *error, compare_doubles);
    f->median_deg = error[count / 2];
    f->p90_deg = error[(size_t)(0.9 * (double)(count - 1))];
    f->right_family = 1.0 - (double)wrong / (double)count;
    f->covered = (double)count / (double)mesh->vertex_count;
    tsuya_free(error);
}

static void run(surface_kind kind)
{
    tsuya_mesh mesh, truth;
    tsuya_weave_mesh_info info;
    tsuya_weave_mesh_options options = tsuya_weave_mesh_options_default();
    figures f;
    tsuya_hash hash[2];
    char folder[TEST_PATH];
    snprintf(folder, sizeof folder, "%s", test_path(surface_name(kind)));
    surface_photograph(&truth, kind, VIEWS, folder);
    options.workspace = folder;
    options.has_weft = true;
    options.weft = (tsuya_vec3){1, 0, 0};
    for (int threads = 1; threads <= 2; threads++) {
        tsuya_context context = tsuya_context_default();
        context.threads = threads;
        assert_ok(tsuya_mesh_copy(&mesh, &truth));
        assert_ok(tsuya_weave_mesh(&mesh, &info, &options, &context));
        hash[threads - 1] = tsuya_hash_bytes(mesh.weft, 3 * mesh.vertex_count * sizeof(float));
        if (threads == 1) {
            tsuya_mesh_free(&mesh);
        }
    }
    assert_string_equal(hash[0].hex, hash[1].hex);
    hold_against(&f, &mesh, &truth);
    printf("%s: weft %.3f degrees median, %.3f p90, family right on %.2f %%, covered %.1f %%, %d flips, %d singularities, shear %.1f, %zu patches, %.0f %% sure\n",
           surface_name(kind), f.median_deg, f.p90_deg, 100.0 * f.right_family, 100.0 * f.covered, f.flips, info.singularities,
           info.shear_deg_median, info.patches, 100.0 * info.patches_sure);
    assert_true(info.threads_seen);
    assert_true(f.median_deg <= 1.5);
    assert_true(f.p90_deg <= 4.0);
    assert_true(f.right_family >= 0.99);
    assert_int_equal(f.flips, 0);
    assert_true(f.covered >= 0.3);
    tsuya_mesh_free(&mesh);
    tsuya_mesh_free(&truth);
}

static void test_sheared_cylinder(void **state)
{
    (void)state;
    run(SURFACE_CYLINDER);
}

static void test_cone(void **state)
{
    (void)state;
    run(SURFACE_CONE);
}

static void test_drape(void **state)
{
    (void)state;
    run(SURFACE_DRAPE);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_sheared_cylinder), cmocka_unit_test(test_cone), cmocka_unit_test(test_drape)};
    int result = cmocka_run_group_tests(tests, NULL, NULL);
    if (result == 0) {
        test_folder_remove();
    } else {
        fprintf(stderr, "kept for a look: %s\n", test_folder());
    }
    return result;
}
