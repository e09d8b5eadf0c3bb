/* The weft field lifted from photographs, against the true one: a sheared sheet on a cylinder, a cone, a draped sheet. */
#include "support.h"

#include "core/memory.h"
#include "core/order.h"
#include "scene_surface.h"
#include "weave_detect/mesh_field.h"

#include <math.h>

enum { VIEWS = 12 };

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
    tsuya_sort_doubles(error, count);
    f->median_deg = error[count / 2];
    f->p90_deg = error[(size_t)(0.9 * (double)(count - 1))];
    f->right_family = 1.0 - (double)wrong / (double)count;
    f->covered = (double)count / (double)mesh->vertex_count;
    tsuya_free(error);
}

/* Two cuts meet: within 2 cm of the seam, left of it and right of it, the field is each one's own. */
static void check_seam(const tsuya_mesh *mesh, const tsuya_mesh *truth)
{
    double *error = tsuya_calloc(mesh->vertex_count, sizeof *error);
    size_t count = 0;
    assert_non_null(error);
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        double off = fabs((double)mesh->position[3 * v] - SURFACE_SEAM_M);
        double cosine = fabs(dot3(mesh->weft + 3 * v, truth->weft + 3 * v)), miss = acos(fmin(cosine, 1.0)) * 180.0 / M_PI;
        if (off > 0.005 && off < 0.025) {
            error[count++] = fmin(miss, fabs(90.0 - miss)); /* which family is the weft is judged elsewhere */
        }
    }
    tsuya_sort_doubles(error, count);
    printf("beside the seam: %.2f degrees median, %.2f at 80 %% over %zu vertices\n", error[count / 2], error[8 * count / 10], count);
    assert_true(error[count / 2] <= 2.0);
    assert_true(error[8 * count / 10] <= 6.0);
    tsuya_free(error);
}

/* Shear and thread counts of the cloth that was drawn: 6.2 mm a pick, 7.13 mm an end; the cylinder's is sheared by atan 0.16. */
static void check_cloth(const tsuya_mesh *mesh, surface_kind kind)
{
    double sum[3] = {0.0}, skew = kind == SURFACE_CYLINDER ? 0.16 : 0.0;
    size_t count = 0;
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        if (mesh->weave_confidence[v] >= 0.5f) {
            sum[0] += (double)mesh->shear_deg[v];
            sum[1] += (double)mesh->threads_per_m[2 * v];
            sum[2] += (double)mesh->threads_per_m[2 * v + 1];
            count++;
        }
    }
    for (int k = 0; k < 3; k++) {
        sum[k] /= (double)count;
    }
    printf("shear %.2f degrees, %.1f and %.1f threads a metre\n", sum[0], sum[1], sum[2]);
    assert_true(fabs(sum[0] - atan(skew) * 180.0 / M_PI) < 0.6);
    double stretch = kind == SURFACE_CYLINDER || kind == SURFACE_CONE ? 0.0 : 0.04; /* waves are put on a flat sheet */
    assert_true(fabs(sum[1] * 0.0062 - 1.0) < 0.03 + stretch);
    assert_true(fabs(sum[2] * 1.15 * 0.0062 / sqrt(1.0 + skew * skew) - 1.0) < 0.03 + stretch);
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
            tsuya_weave_mesh_info_free(&info);
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
    assert_int_equal(info.singularities, 0);
    check_cloth(&mesh, kind);
    if (kind == SURFACE_SEAM) {
        check_seam(&mesh, &truth);
    }
    tsuya_weave_mesh_info_free(&info);
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

static void test_seam(void **state)
{
    (void)state;
    run(SURFACE_SEAM);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_sheared_cylinder), cmocka_unit_test(test_cone), cmocka_unit_test(test_drape),
                                       cmocka_unit_test(test_seam)};
    int result = cmocka_run_group_tests(tests, NULL, NULL);
    if (result == 0) {
        test_folder_remove();
    } else {
        fprintf(stderr, "kept for a look: %s\n", test_folder());
    }
    return result;
}
