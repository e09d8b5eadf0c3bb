#include "support.h"

#include "clouds.h"
#include "core/memory.h"
#include "core/shapes.h"
#include "reconstruct/cloud_clean.h"
#include "reconstruct/silhouette.h"
#include "reconstruct/view_mask.h"
#include "workspace.h"

static const workspace_options plain = {.spoiled = -1, .masks = true};

static tsuya_status silhouette_of(tsuya_silhouette_info *info, double radius, const char *workspace, int threads)
{
    tsuya_context context = tsuya_context_default();
    context.threads = threads;
    tsuya_mesh mesh;
    TSUYA_TRY(shape_sphere(&mesh, (tsuya_vec3){0, 0, 0}, radius, 100, 200));
    tsuya_status status = tsuya_silhouette(info, &mesh, workspace, &context);
    tsuya_mesh_free(&mesh);
    return status;
}

static void a_sphere_fills_its_silhouettes(void **state)
{
    (void)state;
    const char *folder = test_path("dense");
    tsuya_silhouette_info info;
    workspace_make(folder, &plain);
    assert_ok(silhouette_of(&info, 1.0, folder, 2));
    print_message("unit sphere: IoU median %.4f, min %.4f\n", info.iou_median, info.iou_min);
    assert_int_equal(info.count, WORKSPACE_VIEWS);
    assert_true(info.iou_min > 0.99 && info.iou_median >= info.iou_min);
    for (int i = 1; i < info.count; i++) {
        assert_true(strcmp(info.view[i - 1].name, info.view[i].name) < 0);
    }
    tsuya_silhouette_info_free(&info);
}

/* The silhouette of a sphere of radius r at distance 4 is a cone of sin = r / 4. */
static void a_smaller_mesh_covers_its_share(void **state)
{
    (void)state;
    const char *folder = test_path("dense");
    tsuya_silhouette_info info;
    double small = 0.8 / sqrt(16.0 - 0.64), full = 1.0 / sqrt(15.0), share = small * small / (full * full);
    workspace_make(folder, &plain);
    assert_ok(silhouette_of(&info, 0.8, folder, 1));
    for (int i = 0; i < info.count; i++) {
        assert_true(fabs(info.view[i].iou - share) < 0.015 && fabs(info.view[i].covered - share) < 0.015);
        assert_true(info.view[i].inside == 1.0);
    }
    tsuya_silhouette_info_free(&info);
    assert_ok(silhouette_of(&info, 1.2, folder, 1));
    assert_true(info.view[0].covered == 1.0 && info.view[0].inside < 0.75);
    tsuya_json *json = tsuya_json_create_object();
    tsuya_silhouette_info_to_json(json, &info);
    assert_int_equal(tsuya_json_count(tsuya_json_member(json, "views")), WORKSPACE_VIEWS);
    tsuya_json_free(json);
    tsuya_silhouette_info_free(&info);
}

static void missing_and_wrong_masks_are_named(void **state)
{
    (void)state;
    const char *folder = test_path("dense");
    tsuya_silhouette_info info;
    tsuya_image small;
    workspace_options without = plain;
    without.masks = false;
    workspace_make(folder, &without);
    assert_fails(silhouette_of(&info, 1.0, folder, 1), "no NAME.png for any of the 10");
    assert_null(info.view);
    assert_ok(tsuya_image_create(&small, 20, 20, 1, TSUYA_SAMPLE_U8, TSUYA_ENCODING_DATA));
    assert_ok(tsuya_image_save(&small, test_path("dense/masks/view03.png.png"), NULL));
    tsuya_image_free(&small);
    assert_fails(silhouette_of(&info, 1.0, folder, 1), "view03.png.png: 20 × 20");
    assert_int_not_equal(silhouette_of(&info, 1.0, test_path("nowhere"), 1), TSUYA_OK);
}

static void points_outside_the_hull_are_marked(void **state)
{
    (void)state;
    const char *folder = test_path("dense");
    tsuya_context context = tsuya_context_default();
    tsuya_mesh cloud;
    uint8_t keep[600], again[600];
    workspace_make(folder, &plain);
    assert_ok(cloud_sphere(&cloud, 600, 0.0));
    for (size_t v = 0; v < 600; v++) { /* every third on a larger sphere */
        for (size_t k = 0; k < 3 && v % 3 == 0; k++) {
            cloud.position[3 * v + k] *= 1.25f;
        }
    }
    memset(keep, 1, sizeof keep);
    memset(again, 1, sizeof again);
    assert_ok(tsuya_cloud_mark_outside_hull(keep, &cloud, folder, 3, &context));
    context.threads = 1;
    assert_ok(tsuya_cloud_mark_outside_hull(again, &cloud, folder, 3, &context));
    assert_memory_equal(keep, again, sizeof keep);
    size_t outside = 0;
    for (size_t v = 0; v < 600; v++) {
        assert_true(v % 3 == 0 || keep[v]);
        outside += !keep[v];
    }
    print_message("visual hull: %zu of 200 points beyond the sphere found\n", outside);
    assert_true(outside > 120); /* near the poles the ten views leave room */
    tsuya_mesh_free(&cloud);
}

static void distances_to_marks_are_exact(void **state)
{
    (void)state;
    enum { W = 23, H = 17 };
    uint16_t map[W * H];
    for (uint64_t trial = 0; trial < 20; trial++) {
        bool mark[W * H];
        for (size_t p = 0; p < W * H; p++) {
            mark[p] = tsuya_random_u64(3, trial, p) % 60 == 0 && trial > 0;
            map[p] = mark[p];
        }
        tsuya_distance_to_marked(map, W, H);
        for (int p = 0; p < W * H; p++) {
            int nearest = UINT16_MAX;
            for (int q = 0; q < W * H; q++) {
                int dx = abs(p % W - q % W), dy = abs(p / W - q / W), d = dx > dy ? dx : dy;
                nearest = mark[q] && d < nearest ? d : nearest;
            }
            assert_int_equal(map[p], nearest);
        }
    }
}

static tsuya_status hull_and_silhouette(const tsuya_mesh *cloud, const tsuya_mesh *mesh, const char *folder)
{
    tsuya_context context = tsuya_context_default();
    uint8_t keep[50];
    tsuya_silhouette_info info;
    context.threads = 1;
    TSUYA_TRY(tsuya_cloud_mark_outside_hull(keep, cloud, folder, 3, &context));
    TSUYA_TRY(tsuya_silhouette(&info, mesh, folder, &context));
    tsuya_silhouette_info_free(&info);
    return TSUYA_OK;
}

static void every_allocation_may_fail(void **state)
{
    (void)state;
    const char *folder = test_path("dense");
    tsuya_mesh cloud, mesh;
    workspace_make(folder, &plain);
    assert_ok(cloud_sphere(&cloud, 50, 0.0));
    assert_ok(shape_sphere(&mesh, (tsuya_vec3){0, 0, 0}, 1.0, 6, 8));
    tsuya_memory_fail_at(0);
    assert_ok(hull_and_silhouette(&cloud, &mesh, folder));
    uint64_t count = tsuya_memory_fail_at(0);
    for (uint64_t n = 1; n <= count; n++) {
        tsuya_memory_fail_at(n);
        assert_int_equal(hull_and_silhouette(&cloud, &mesh, folder), TSUYA_ERROR_MEMORY);
    }
    tsuya_memory_fail_at(0);
    tsuya_mesh_free(&cloud);
    tsuya_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_sphere_fills_its_silhouettes),
        cmocka_unit_test(a_smaller_mesh_covers_its_share),
        cmocka_unit_test(missing_and_wrong_masks_are_named),
        cmocka_unit_test(points_outside_the_hull_are_marked),
        cmocka_unit_test(distances_to_marks_are_exact),
        cmocka_unit_test(every_allocation_may_fail),
    };
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
