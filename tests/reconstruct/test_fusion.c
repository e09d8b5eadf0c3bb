/* The two stages on workspaces on disk: stereo (files, resume, hold-out, faults) and fusion (truth, sigma, layers). */
#include "support.h"

#include "core/image.h"
#include "core/memory.h"
#include "core/order.h"
#include "core/process.h"
#include "reconstruct/fusion.h"
#include "reconstruct/stereo.h"
#include "scene_workspace.h"

static tsuya_context context_of(int threads)
{
    tsuya_context context = tsuya_context_default();
    context.threads = threads;
    return context;
}

/* Scenes are drawn and solved once and shared by the tests that only look. */
typedef struct solved { scene_pictures scene; const char *folder; tsuya_stereo_info info; } solved;

static const char *fresh_workspace(const char *name)
{
    static char kept[8][TEST_PATH];
    static int turn;
    char *folder = kept[turn++ % 8];
    snprintf(folder, TEST_PATH, "%s/%s", test_folder(), name);
    assert_int_equal(tsuya_folder_remove(folder), TSUYA_OK);
    assert_int_equal(tsuya_folder_make(folder), TSUYA_OK);
    return folder;
}

static tsuya_status run_stereo(tsuya_stereo_info *info, const char *folder, int threads)
{
    tsuya_context context = context_of(threads);
    tsuya_stereo_options options = tsuya_stereo_options_default();
    options.workspace = folder;
    return tsuya_stereo(info, &options, &context);
}

static tsuya_status run_fusion(tsuya_mesh *cloud, tsuya_fusion_info *info, const char *folder, int threads)
{
    tsuya_context context = context_of(threads);
    tsuya_fusion_options options = tsuya_fusion_options_default();
    options.workspace = folder;
    return tsuya_fusion(cloud, info, &options, &context);
}

static solved *solved_scene(scene_kind kind)
{
    static solved kept[SCENE_KIND_COUNT];
    solved *s = &kept[kind];
    if (!s->folder) {
        int views = kind == SCENE_SLAB ? 10 : 6;
        assert_true(scene_create(&s->scene, kind, 200, views, 0.004));
        s->folder = fresh_workspace(scene_name(kind));
        assert_int_equal(scene_workspace_write(&s->scene, s->folder, kind != SCENE_SHEET), TSUYA_OK);
        if (run_stereo(&s->info, s->folder, 2) != TSUYA_OK) {
            fail_msg("%s", tsuya_reason());
        }
    }
    return s;
}

typedef struct cloud_errors { double median, p90, honest; } cloud_errors;

/* Distances of the cloud from the true surface; share that lies within two sigma. */
static cloud_errors measure_cloud(const tsuya_mesh *cloud, scene_kind kind)
{
    double *error = tsuya_calloc(cloud->vertex_count, sizeof *error);
    size_t within = 0;
    assert_non_null(error);
    for (size_t i = 0; i < cloud->vertex_count; i++) {
        error[i] = scene_distance_m(kind, tsuya_mesh_position(cloud, i));
        within += error[i] <= 2.0 * cloud->sigma[i];
        assert_true(cloud->sigma[i] > 0.0f && isfinite(cloud->sigma[i]));
        assert_true(cloud->evidence[i] >= 3.0f || (cloud->evidence[i] >= 0.0f && cloud->sigma[i] > 0.0003f)); /* measured, or helped */
    }
    tsuya_sort_doubles(error, cloud->vertex_count);
    cloud_errors e = {error[cloud->vertex_count / 2], error[cloud->vertex_count * 9 / 10],
                      (double)within / (double)cloud->vertex_count};
    tsuya_free(error);
    return e;
}

static void check_cloud(scene_kind kind, double least_points)
{
    solved *s = solved_scene(kind);
    tsuya_mesh cloud;
    tsuya_fusion_info info;
    if (run_fusion(&cloud, &info, s->folder, 2) != TSUYA_OK) {
        fail_msg("%s", tsuya_reason());
    }
    double gsd = scene_gsd_m(&s->scene);
    cloud_errors e = measure_cloud(&cloud, kind);
    print_message("%-8s %zu points, median %.3f p90 %.3f gsd, %.3f within two sigma (median sigma %.3f gsd), %.2f views\n",
                  scene_name(kind), cloud.vertex_count, e.median / gsd, e.p90 / gsd, e.honest, info.median_sigma / gsd,
                  info.mean_views);
    assert_true(e.median <= 0.25 * gsd);
    assert_true(e.p90 <= 1.0 * gsd);
    assert_true(e.honest >= 0.85);
    assert_true(info.median_sigma <= 0.5 * gsd);
    assert_true((double)cloud.vertex_count >= least_points);
    assert_true(info.gsd > 0.6 * gsd && info.gsd < 1.1 * gsd); /* at the target; the cylinder is nearer */
    assert_null(cloud.weft);
    tsuya_mesh_free(&cloud);
}

static void sheet_becomes_a_cloud(void **state)
{
    (void)state;
    check_cloud(SCENE_SHEET, 20000);
}

static void cylinder_becomes_a_cloud(void **state)
{
    (void)state;
    check_cloud(SCENE_CYLINDER, 15000);
}

/* Two layers six pixels apart, seen from both sides, stay two layers with their own normals. */
static void thin_layers_stay_apart(void **state)
{
    (void)state;
    solved *s = solved_scene(SCENE_SLAB);
    tsuya_mesh cloud;
    tsuya_fusion_info info;
    size_t front = 0, back = 0, turned = 0;
    assert_int_equal(run_fusion(&cloud, &info, s->folder, 2), TSUYA_OK);
    for (size_t i = 0; i < cloud.vertex_count; i++) {
        double z = cloud.position[3 * i + 2];
        if (fabs(cloud.position[3 * i]) < 0.28 && fabs(cloud.position[3 * i + 1]) < 0.2) {
            front += z > 0;
            back += z < 0;
            turned += z * cloud.normal[3 * i + 2] < 0;
        }
    }
    assert_true(front > 5000 && back > 5000);
    assert_int_equal(turned, 0);
    tsuya_mesh_free(&cloud);
    check_cloud(SCENE_SLAB, 10000);
}

static void fusion_does_not_depend_on_threads(void **state)
{
    (void)state;
    solved *s = solved_scene(SCENE_CYLINDER);
    tsuya_mesh one, two;
    tsuya_fusion_info info;
    assert_int_equal(run_fusion(&one, &info, s->folder, 1), TSUYA_OK);
    assert_int_equal(run_fusion(&two, &info, s->folder, 3), TSUYA_OK);
    assert_int_equal(one.vertex_count, two.vertex_count);
    assert_memory_equal(one.position, two.position, 3 * one.vertex_count * sizeof(float));
    assert_memory_equal(one.sigma, two.sigma, one.vertex_count * sizeof(float));
    tsuya_mesh_free(&one);
    tsuya_mesh_free(&two);
}

/* ---- the stereo stage's files ---- */

static const char *small_workspace(const char *name, int views)
{
    scene_pictures scene;
    const char *folder = fresh_workspace(name);
    assert_true(scene_create(&scene, SCENE_SHEET, 96, views, 0.004));
    assert_int_equal(scene_workspace_write(&scene, folder, false), TSUYA_OK);
    scene_free(&scene);
    return folder;
}

static const char *in(const char *folder, const char *path)
{
    static char buffer[8][TEST_PATH];
    static int turn;
    char *full = buffer[turn++ % 8];
    snprintf(full, TEST_PATH, "%s/%s", folder, path);
    return full;
}

static void resume_passes_over_what_is_finished(void **state)
{
    (void)state;
    const char *folder = small_workspace("resume", 4);
    tsuya_stereo_info info;
    tsuya_hash whole, again;
    assert_int_equal(run_stereo(&info, folder, 2), TSUYA_OK);
    assert_int_equal(info.views, 4);
    assert_int_equal(info.maps_resumed, 0);
    assert_int_equal(tsuya_hash_folder(&whole, in(folder, "stereo")), TSUYA_OK);

    assert_int_equal(run_stereo(&info, folder, 1), TSUYA_OK);
    assert_int_equal(info.maps_resumed, 12);

    /* Cut off between a map and its stamp, and a map that vanished: only these are made again, to the same bytes. */
    assert_int_equal(unlink(in(folder, "stereo/stamps/view01.png.geometric.txt")), 0);
    assert_int_equal(unlink(in(folder, "stereo/depth_maps/view02.png.photometric.bin")), 0);
    assert_int_equal(run_stereo(&info, folder, 1), TSUYA_OK);
    assert_int_equal(info.maps_resumed, 10);
    assert_int_equal(tsuya_hash_folder(&again, in(folder, "stereo")), TSUYA_OK);
    assert_string_equal(whole.hex, again.hex);
}

static void other_options_are_other_maps(void **state)
{
    (void)state;
    const char *folder = small_workspace("options", 4);
    const char *const held[] = {"view03.png"};
    tsuya_context context = context_of(2);
    tsuya_stereo_options options = tsuya_stereo_options_default();
    tsuya_stereo_info info;
    options.workspace = folder;
    options.long_side_px = 64;
    options.hold_out = held;
    options.hold_out_count = 1;
    assert_int_equal(tsuya_stereo(&info, &options, &context), TSUYA_OK);
    assert_int_equal(info.views, 3);
    assert_int_equal(info.views_skipped, 0);
    assert_int_equal(info.width_px, 64);
    assert_int_equal(info.height_px, 48);
    assert_true(info.source_views == 2.0);
    assert_false(tsuya_path_exists(in(folder, "stereo/depth_maps/view03.png.photometric.bin")));
    char *lists = NULL;
    size_t size;
    assert_int_equal(tsuya_file_load(&lists, &size, in(folder, "stereo/patch-match.cfg"), 4096), TSUYA_OK);
    assert_null(strstr(lists, "view03"));
    assert_non_null(strstr(lists, "view00.png\nview0"));
    tsuya_free(lists);
    options.long_side_px = 0;
    assert_int_equal(tsuya_stereo(&info, &options, &context), TSUYA_OK);
    assert_int_equal(info.maps_resumed, 0);
    assert_int_equal(info.width_px, 96);
}

static void colmap_fuses_our_maps(void **state)
{
    (void)state;
    if (!tsuya_process_available("colmap")) {
        skip();
    }
    solved *s = solved_scene(SCENE_CYLINDER);
    const char *out = in(s->folder, "colmap.ply");
    const char *const argv[] = {"colmap", "stereo_fusion", "--workspace_path", s->folder, "--workspace_format", "COLMAP",
                                "--input_type", "geometric", "--output_path", out, NULL};
    const char *const environment[] = {"QT_QPA_PLATFORM=offscreen", NULL};
    tsuya_process_options options = {.log_path = in(s->folder, "colmap.log"), .environment = environment};
    tsuya_process_info info;
    tsuya_mesh cloud;
    if (tsuya_process_run(&info, argv, &options) != TSUYA_OK) {
        fail_msg("%s", tsuya_reason());
    }
    assert_int_equal(tsuya_ply_load(&cloud, out), TSUYA_OK);
    print_message("colmap stereo_fusion: %zu points\n", cloud.vertex_count);
    assert_true(cloud.vertex_count > 5000);
    size_t near = 0;
    for (size_t i = 0; i < cloud.vertex_count; i++) {
        near += scene_distance_m(SCENE_CYLINDER, tsuya_mesh_position(&cloud, i)) < 2.0 * scene_gsd_m(&s->scene);
    }
    assert_true((double)near > 0.95 * (double)cloud.vertex_count);
    tsuya_mesh_free(&cloud);
}

/* ---- faults ---- */

static void assert_fails_naming(tsuya_status expected, const char *folder, const char *part)
{
    tsuya_stereo_info info;
    assert_int_equal(run_stereo(&info, folder, 2), expected);
    if (!strstr(tsuya_reason(), part)) {
        fail_msg("\"%s\" does not name \"%s\"", tsuya_reason(), part);
    }
}

static void faults_are_named(void **state)
{
    (void)state;
    const char *folder = small_workspace("faults", 3);
    tsuya_image wrong;
    assert_int_equal(tsuya_image_create(&wrong, 50, 40, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB), TSUYA_OK);
    assert_int_equal(tsuya_image_save(&wrong, in(folder, "images/view01.png"), NULL), TSUYA_OK);
    tsuya_image_free(&wrong);
    assert_fails_naming(TSUYA_ERROR_INPUT, folder, "view01.png: is 50 x 40");
    assert_int_equal(tsuya_file_write(in(folder, "images/view01.png"), "not a picture", 13), TSUYA_OK);
    assert_fails_naming(TSUYA_ERROR_INPUT, folder, "view01.png");
    assert_int_equal(unlink(in(folder, "images/view01.png")), 0);
    assert_fails_naming(TSUYA_ERROR_IO, folder, "view01.png");
    assert_int_equal(tsuya_folder_remove(in(folder, "sparse")), TSUYA_OK);
    tsuya_stereo_info info;
    assert_int_not_equal(run_stereo(&info, folder, 2), TSUYA_OK);
}

static void broken_maps_are_refused(void **state)
{
    (void)state;
    const char *folder = small_workspace("broken", 4);
    tsuya_stereo_info info;
    tsuya_fusion_info fusion_info;
    tsuya_mesh cloud;
    assert_int_equal(run_fusion(&cloud, &fusion_info, folder, 2), TSUYA_ERROR_INPUT);
    assert_non_null(strstr(tsuya_reason(), "no geometric map of view00.png"));
    assert_int_equal(run_stereo(&info, folder, 2), TSUYA_OK);
    assert_int_equal(run_fusion(&cloud, &fusion_info, folder, 2), TSUYA_OK);
    tsuya_mesh_free(&cloud);
    assert_int_equal(tsuya_file_write(in(folder, "stereo/depth_maps/view01.png.geometric.bin"), "96&72&1&", 8), TSUYA_OK);
    assert_int_not_equal(run_fusion(&cloud, &fusion_info, folder, 2), TSUYA_OK);
    assert_non_null(strstr(tsuya_reason(), "view01.png.geometric.bin"));
    float nan_map[4] = {NAN, 1, 1, 1};
    assert_int_equal(tsuya_colmap_map_save(in(folder, "stereo/depth_maps/view01.png.geometric.bin"), 2, 2, 1, nan_map), TSUYA_OK);
    assert_int_equal(run_fusion(&cloud, &fusion_info, folder, 2), TSUYA_ERROR_INPUT);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sheet_becomes_a_cloud),
        cmocka_unit_test(cylinder_becomes_a_cloud),
        cmocka_unit_test(thin_layers_stay_apart),
        cmocka_unit_test(fusion_does_not_depend_on_threads),
        cmocka_unit_test(resume_passes_over_what_is_finished),
        cmocka_unit_test(other_options_are_other_maps),
        cmocka_unit_test(colmap_fuses_our_maps),
        cmocka_unit_test(faults_are_named),
        cmocka_unit_test(broken_maps_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
