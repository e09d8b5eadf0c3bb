/* COLMAP killed in each of its steps, and a disk that fills up at any size: one clear line, and the run that follows makes what an
 * undisturbed one makes, byte for byte. */
#include "support.h"

#include "core/memory.h"
#include "core/process.h"
#include "reconstruct/reconstruct.h"
#include "scene_workspace.h"

#include <signal.h>
#include <sys/resource.h>

enum { WIDTH = 240, VIEWS = 6, LEAST_BYTES = 4096, MOST_BYTES = 1 << 28 };

static const char *const RESULTS[] = {"sparse/0/images.bin", "sparse/0/points3D.bin", "dense/images/view03.png", "cloud.ply", "mesh.ply"};

/* A `colmap` before the real one: it ends the step that the file `kill` names while it is at work, and a full disk is an error
 * for it and no signal. */
static void stand_before_colmap(void)
{
    char script[2 * TEST_PATH];
    tsuya_file_writer writer;
    const char *path = getenv("PATH");
    assert_ok(tsuya_folder_make(test_path("bin")));
    assert_ok(tsuya_file_begin(&writer, test_path("bin/colmap")));
    fprintf(writer.stream,
            "#!/bin/sh\n"
            "trap '' XFSZ\n"
            "PATH='%s'\n"
            "if [ \"$1\" = \"$(cat '%s' 2>/dev/null)\" ] && [ \"$2\" != -h ]; then\n"
            "    colmap \"$@\" &\n"
            "    sleep 0.3\n"
            "    kill -9 $! 2>/dev/null\n"
            "    kill -9 $$\n"
            "fi\n"
            "exec colmap \"$@\"\n",
            path, test_path("kill"));
    assert_ok(tsuya_file_commit(&writer));
    assert_int_equal(chmod(test_path("bin/colmap"), 0755), 0);
    snprintf(script, sizeof script, "%s:%s", test_path("bin"), path);
    assert_int_equal(setenv("PATH", script, 1), 0);
}

static void kill_in(const char *step)
{
    tsuya_file_writer writer;
    assert_ok(tsuya_file_begin(&writer, test_path("kill")));
    fprintf(writer.stream, "%s\n", step);
    assert_ok(tsuya_file_commit(&writer));
}

static tsuya_status reconstruct(tsuya_reconstruct_info *info, const char *name, const char *poses)
{
    char output[64];
    tsuya_context context = tsuya_context_default();
    tsuya_reconstruct_options options = tsuya_reconstruct_options_default();
    context.threads = 2;
    snprintf(output, sizeof output, "out/%s", name);
    options.photos = test_path("scene/images");
    options.poses = poses;
    options.output = test_path(output);
    options.dense_long_side_px = WIDTH / 2;
    return tsuya_reconstruct(info, &options, &context);
}

static void finish(const char *name, const char *poses)
{
    tsuya_reconstruct_info info;
    assert_ok(reconstruct(&info, name, poses));
    tsuya_reconstruct_info_free(&info);
}

static void assert_same_results(const char *name, const char *undisturbed)
{
    for (size_t i = 0; i < sizeof RESULTS / sizeof *RESULTS; i++) {
        tsuya_hash a, b;
        char path[TEST_PATH];
        snprintf(path, sizeof path, "out/%s/%s", name, RESULTS[i]);
        assert_ok(tsuya_hash_file(&a, test_path(path)));
        snprintf(path, sizeof path, "out/%s/%s", undisturbed, RESULTS[i]);
        assert_ok(tsuya_hash_file(&b, test_path(path)));
        if (strcmp(a.hex, b.hex) != 0) {
            fail_msg("%s of %s differs from an undisturbed run's", RESULTS[i], name);
        }
    }
}

static void killed_in_each(const char *name, const char *poses, const char *const *step, size_t count)
{
    for (size_t i = 0; i < count; i++) {
        char line[128];
        tsuya_reconstruct_info info;
        kill_in(step[i]);
        tsuya_status status = reconstruct(&info, name, poses);
        snprintf(line, sizeof line, "colmap %s: ended by signal 9", step[i]);
        assert_fails(status, line);
    }
    kill_in("nothing");
    finish(name, poses);
}

static void colmap_is_killed_in_each_step(void **state)
{
    (void)state;
    static const char *const steps[] = {"feature_extractor", "matches_importer", "mapper", "bundle_adjuster", "image_undistorter"};
    finish("plain", NULL);
    killed_in_each("killed", NULL, steps, sizeof steps / sizeof *steps);
    assert_same_results("killed", "plain");
}

static void colmap_is_killed_with_known_poses(void **state)
{
    (void)state;
    static const char *const steps[] = {"point_triangulator", "image_undistorter"};
    char poses[TEST_PATH];
    snprintf(poses, sizeof poses, "%s", test_path("scene/sparse"));
    finish("posed", poses);
    killed_in_each("posed-killed", poses, steps, sizeof steps / sizeof *steps);
    assert_same_results("posed-killed", "posed");
}

/* Nothing may be left behind that a later run takes for whole. */
static void fill_up(const char *name)
{
    struct rlimit before, small;
    tsuya_reconstruct_info info;
    tsuya_status status = TSUYA_ERROR_IO;
    int failed = 0;
    assert_int_equal(getrlimit(RLIMIT_FSIZE, &before), 0);
    signal(SIGXFSZ, SIG_IGN);
    small = before;
    for (rlim_t bytes = LEAST_BYTES; status != TSUYA_OK && bytes < MOST_BYTES; bytes *= 2) {
        small.rlim_cur = bytes;
        assert_int_equal(setrlimit(RLIMIT_FSIZE, &small), 0);
        status = reconstruct(&info, name, NULL);
        assert_int_equal(setrlimit(RLIMIT_FSIZE, &before), 0);
        if (status != TSUYA_OK) {
            failed++;
            print_message("%9lu bytes: %s\n", (unsigned long)bytes, tsuya_reason());
            assert_true(strchr(tsuya_reason(), '\n') == NULL && strstr(tsuya_reason(), name));
        }
    }
    signal(SIGXFSZ, SIG_DFL);
    assert_ok(status);
    tsuya_reconstruct_info_free(&info);
    assert_true(failed >= 5);
    assert_same_results(name, "plain");
}

static void the_disk_fills_up_from_the_start(void **state)
{
    (void)state;
    fill_up("full");
}

/* The database is the largest file of all: the later steps meet a full disk only where it is there already. */
static void the_disk_fills_up_behind_the_matches(void **state)
{
    (void)state;
    tsuya_reconstruct_info info;
    kill_in("mapper");
    assert_fails(reconstruct(&info, "full-later", NULL), "colmap mapper: ended by signal 9");
    kill_in("nothing");
    fill_up("full-later");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(colmap_is_killed_in_each_step),
        cmocka_unit_test(colmap_is_killed_with_known_poses),
        cmocka_unit_test(the_disk_fills_up_from_the_start),
        cmocka_unit_test(the_disk_fills_up_behind_the_matches),
    };
    scene_pictures scene;
    if (!tsuya_process_available("colmap")) {
        print_message("skipped: no colmap\n");
        return TEST_SKIPPED;
    }
    if (!scene_create(&scene, SCENE_SHEET, WIDTH, VIEWS, 0.004) || scene_workspace_write(&scene, test_path("scene"), false) != TSUYA_OK) {
        return 1;
    }
    scene_free(&scene);
    stand_before_colmap();
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return failed;
}
