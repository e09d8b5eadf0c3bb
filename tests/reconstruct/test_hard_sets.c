/* Sets of photographs that are not all good, and a disk that fills up: what can be made is made, the rest is said. */
#include "support.h"

#include "core/image.h"
#include "core/memory.h"
#include "core/process.h"
#include "reconstruct/reconstruct.h"
#include "reconstruct/stereo.h"
#include "scene_workspace.h"

#include <signal.h>
#include <sys/resource.h>

enum { WIDTH = 320, VIEWS = 9, BLUR_PX = 4 };

static void blur(scene_view *v)
{
    const int width = v->camera.width_px, height = v->camera.height_px;
    float *out = tsuya_calloc((size_t)width * (size_t)height, sizeof *out);
    assert_non_null(out);
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            float sum = 0.0f;
            int count = 0;
            for (int k = -BLUR_PX; k <= BLUR_PX; k++) { /* the camera moved sideways */
                if (x + k >= 0 && x + k < width) {
                    sum += v->grey[y * width + x + k];
                    count++;
                }
            }
            out[y * width + x] = sum / (float)count;
        }
    }
    tsuya_free(v->grey);
    v->grey = out;
}

/* Another subject in front of the same camera: cells of noise. */
static void replace_by_noise(scene_view *v)
{
    const int width = v->camera.width_px;
    for (int i = 0; i < width * v->camera.height_px; i++) {
        uint64_t cell = (uint64_t)(i / width / 6 * width + i % width / 6);
        v->grey[i] = (float)tsuya_random_uniform(99, 3, cell);
    }
}

static void reconstruct(tsuya_reconstruct_info *info, const scene_pictures *scene, const char *folder)
{
    char photos[TEST_PATH], output[TEST_PATH];
    tsuya_context context = tsuya_context_default();
    tsuya_reconstruct_options options = tsuya_reconstruct_options_default();
    context.threads = 2;
    assert_ok(scene_workspace_write(scene, folder, false));
    snprintf(photos, sizeof photos, "%.2000s/images", folder);
    snprintf(output, sizeof output, "%.2000s/out", folder);
    options.photos = photos;
    options.output = output;
    options.dense_long_side_px = WIDTH / 2;
    assert_ok(tsuya_reconstruct(info, &options, &context));
}

static void a_blurred_third_does_not_stop_the_others(void **state)
{
    (void)state;
    scene_pictures scene;
    tsuya_reconstruct_info info;
    if (!tsuya_process_available("colmap")) {
        skip();
    }
    assert_true(scene_create(&scene, SCENE_SHEET, WIDTH, VIEWS, 0.004));
    for (int v = 1; v < VIEWS; v += 3) {
        blur(&scene.view[v]);
    }
    reconstruct(&info, &scene, test_path("blurred"));
    print_message("blurred third: %d of %d placed, %.2f px, %zu points\n", info.registered, info.photos, info.reprojection_px, info.points);
    assert_true(info.registered >= VIEWS - VIEWS / 3);
    assert_true(info.points > 3000);
    tsuya_reconstruct_info_free(&info);
    scene_free(&scene);
}

static void a_photograph_of_something_else_is_left_out(void **state)
{
    (void)state;
    scene_pictures scene;
    tsuya_reconstruct_info info;
    if (!tsuya_process_available("colmap")) {
        skip();
    }
    assert_true(scene_create(&scene, SCENE_SHEET, WIDTH, VIEWS, 0.004));
    replace_by_noise(&scene.view[4]);
    reconstruct(&info, &scene, test_path("foreign"));
    print_message("one of something else: %d of %d placed, %.2f px, %zu points\n", info.registered, info.photos, info.reprojection_px, info.points);
    assert_int_equal(info.registered, VIEWS - 1);
    assert_true(info.points > 3000);
    tsuya_reconstruct_info_free(&info);
    scene_free(&scene);
}

/* Two subjects in one folder: the larger group is kept, the other named with where it would join. */
static void two_subjects_fall_apart(void **state)
{
    (void)state;
    scene_pictures scene, other;
    tsuya_reconstruct_info info;
    if (!tsuya_process_available("colmap")) {
        skip();
    }
    assert_true(scene_create(&scene, SCENE_SHEET, WIDTH, VIEWS, 0.004));
    assert_true(scene_create(&other, SCENE_CYLINDER, WIDTH, VIEWS, 0.004));
    for (int v = 5; v < VIEWS; v++) {
        float *grey = scene.view[v].grey;
        scene.view[v].grey = other.view[v].grey;
        other.view[v].grey = grey;
    }
    reconstruct(&info, &scene, test_path("two"));
    const tsuya_json *groups = tsuya_json_member(tsuya_json_member(info.parts, "mapping"), "groups");
    print_message("two subjects: %d models, %d of %d placed\n", info.models, info.registered, info.photos);
    assert_int_equal(info.registered, 5);
    if (info.models > 1) {
        const tsuya_json *join = tsuya_json_member(tsuya_json_first(groups), "join");
        assert_int_equal(tsuya_json_count(groups), info.models - 1);
        assert_true(strcmp(tsuya_json_text_or(tsuya_json_member(join, "from"), "x"), "view05.png") < 0);
        assert_true(strcmp(tsuya_json_text_or(tsuya_json_member(join, "to"), ""), "view05.png") >= 0);
    }
    tsuya_reconstruct_info_free(&info);
    scene_free(&scene);
    scene_free(&other);
}

static tsuya_status stereo(tsuya_stereo_info *info, const char *folder)
{
    tsuya_context context = tsuya_context_default();
    tsuya_stereo_options options = tsuya_stereo_options_default();
    context.threads = 2;
    options.workspace = folder;
    return tsuya_stereo(info, &options, &context);
}

static void assert_same_file(const char *name)
{
    tsuya_hash a, b;
    char path[TEST_PATH];
    snprintf(path, sizeof path, "full/stereo/%s", name);
    assert_ok(tsuya_hash_file(&a, test_path(path)));
    snprintf(path, sizeof path, "roomy/stereo/%s", name);
    assert_ok(tsuya_hash_file(&b, test_path(path)));
    assert_string_equal(a.hex, b.hex);
}

/* Files cannot grow past a limit, as on a full disk: the file is named, nothing half is left, and with room again the run
 * goes on to what it would have made at once. */
static void a_full_disk_is_said_and_survived(void **state)
{
    (void)state;
    scene_pictures scene;
    tsuya_stereo_info info;
    struct rlimit before, small;
    assert_true(scene_create(&scene, SCENE_SHEET, 96, 4, 0.004));
    assert_ok(scene_workspace_write(&scene, test_path("full"), false));
    assert_ok(scene_workspace_write(&scene, test_path("roomy"), false));
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    small = before;
    small.rlim_cur = 30000; /* the depth map fits, the normals do not */
    void (*handler)(int) = signal(SIGXFSZ, SIG_IGN);
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &small), 0);
    tsuya_status status = stereo(&info, test_path("full"));
    assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
    signal(SIGXFSZ, handler);
    assert_fails(status, "view00.png.photometric.bin");
    assert_false(tsuya_path_exists(test_path("full/stereo/normal_maps/view00.png.photometric.bin")));
    assert_ok(stereo(&info, test_path("full")));
    assert_int_equal(info.maps_resumed, 0);
    assert_ok(stereo(&info, test_path("roomy")));
    for (int v = 0; v < scene.view_count; v++) {
        char name[64];
        snprintf(name, sizeof name, "depth_maps/view%02d.png.geometric.bin", v);
        assert_same_file(name);
        snprintf(name, sizeof name, "normal_maps/view%02d.png.geometric.bin", v);
        assert_same_file(name);
    }
    scene_free(&scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_full_disk_is_said_and_survived),
        cmocka_unit_test(two_subjects_fall_apart),
        cmocka_unit_test(a_photograph_of_something_else_is_left_out),
        cmocka_unit_test(a_blurred_third_does_not_stop_the_others),
    };
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return failed;
}
