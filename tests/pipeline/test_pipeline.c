/* The whole job on real photographs, reduced: what it finds, what it leaves behind, and that neither threads nor a kill in
 * the middle change the result. */
#include "support.h"

#include "core/camera.h"
#include "core/image.h"
#include "core/json.h"
#include "core/mesh.h"
#include "core/process.h"
#include "pipeline/reduced.h"

#include <fcntl.h>
#include <math.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <time.h>

enum { PHOTOS = 12, FIRST = 8, POSED = 5, POSED_FIRST = 14 };

extern char **environ;

static const char *data;
static char job_folder[TEST_PATH];
static tsuya_json *job_result;

static pid_t start(const char *const argv[], const char *log)
{
    posix_spawn_file_actions_t actions;
    pid_t pid;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDOUT_FILENO, log, O_WRONLY | O_CREAT | O_APPEND, 0644);
    posix_spawn_file_actions_adddup2(&actions, STDOUT_FILENO, STDERR_FILENO);
    assert_int_equal(posix_spawn(&pid, TSUYA_PROGRAM, &actions, NULL, (char *const *)argv, environ), 0);
    posix_spawn_file_actions_destroy(&actions);
    return pid;
}

static int finish(pid_t pid)
{
    int status;
    assert_int_equal(waitpid(pid, &status, 0), pid);
    return status;
}

static void show_log(const char *log)
{
    char *text;
    size_t size;
    if (tsuya_file_load(&text, &size, log, 1 << 24) == TSUYA_OK) {
        fprintf(stderr, "%s", text);
        tsuya_free(text);
    }
}

static void run_to_end(const char *const argv[])
{
    const char *log = test_path("run.log");
    remove(log);
    int status = finish(start(argv, log));
    if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
        show_log(log);
        fail_msg("%s: exit %d", argv[1], WEXITSTATUS(status));
    }
}

static const tsuya_json *member(const tsuya_json *object, const char *first, const char *second)
{
    return tsuya_json_member(tsuya_json_member(object, first), second);
}

static double number(const tsuya_json *object, const char *first, const char *second)
{
    return tsuya_json_number_or(member(object, first, second), NAN);
}

static const char *in_job(const char *folder, const char *name)
{
    static char path[4][TEST_PATH];
    static int turn;
    char *p = path[turn++ % 4];
    snprintf(p, TEST_PATH, "%s/%s", folder, name);
    return p;
}

static void run_whole_job(void)
{
    static const char render[] = "render:\n  - {name: turntable, views: 4, size: [180, 240], color: \"#7a1f2b\"}\n";
    char yaml[TEST_PATH], json[TEST_PATH];
    snprintf(job_folder, sizeof job_folder, "%s", test_path("job"));
    assert_ok(reduced_job_write(test_path("input"), data, FIRST, PHOTOS, 2, render));
    snprintf(yaml, sizeof yaml, "%s", test_path("input/JOB.yaml"));
    snprintf(json, sizeof json, "%s", test_path("result.json"));
    const char *argv[] = {"tsuya", "run", yaml, "-o", job_folder, "--json", json, NULL};
    run_to_end(argv);
    assert_ok(tsuya_json_load(&job_result, json));
}

static void test_photographs_are_placed(void **state)
{
    (void)state;
    assert_float_equal(number(job_result, "reconstruct", "photos"), PHOTOS, 0.0);
    assert_true(number(job_result, "reconstruct", "registered") >= PHOTOS - 1);
    assert_true(number(job_result, "reconstruct", "reprojection_px") < 1.5);
    const tsuya_json *mapping = tsuya_json_member(member(job_result, "reconstruct", "parts"), "mapping");
    assert_true(tsuya_json_number_or(tsuya_json_member(mapping, "adjustments"), 0.0) >= 1.0);
    assert_true(tsuya_json_number_or(tsuya_json_member(mapping, "observations_kept"), 0.0) < tsuya_json_number_or(tsuya_json_member(mapping, "observations"), 0.0));
    assert_true(tsuya_json_is_null(member(job_result, "reconstruct", "scale_m_per_unit")));
}

static void test_surface_and_weft_field(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    assert_ok(tsuya_ply_load(&mesh, in_job(job_folder, "weave/weave.ply")));
    assert_true(mesh.vertex_count > 2000);
    assert_true(mesh.triangle_count > 4000);
    assert_non_null(mesh.normal);
    assert_non_null(mesh.color);
    assert_non_null(mesh.weft);
    assert_non_null(mesh.weave_confidence);
    for (size_t v = 0; v < mesh.vertex_count; v++) {
        const float *w = mesh.weft + 3 * v, *n = mesh.normal + 3 * v;
        double length = w[0] * w[0] + w[1] * w[1] + w[2] * w[2], along = w[0] * n[0] + w[1] * n[1] + w[2] * n[2];
        assert_true(fabs(length - 1.0) < 1e-3);
        assert_true(fabs(along) < 2e-2);
        assert_true(mesh.weave_confidence[v] >= 0.0f && mesh.weave_confidence[v] <= 1.0f);
    }
    tsuya_mesh_free(&mesh);
}

static void test_renders_show_cloth(void **state)
{
    (void)state;
    tsuya_arena *arena;
    char **names;
    int count, pictures = 0, floats = 0;
    assert_ok(tsuya_arena_create(&arena, 1 << 12));
    assert_ok(tsuya_folder_list(&names, &count, in_job(job_folder, "render/turntable"), arena));
    for (int i = 0; i < count; i++) {
        tsuya_image image;
        char name[TEST_PATH];
        const char *extension = tsuya_path_extension(names[i]);
        if (strcmp(extension, ".png") != 0 && strcmp(extension, ".exr") != 0) {
            continue;
        }
        snprintf(name, sizeof name, "render/turntable/%s", names[i]);
        assert_ok(tsuya_image_load(&image, in_job(job_folder, name)));
        assert_int_equal(image.width_px, 180);
        assert_int_equal(image.height_px, 240);
        float low = 1e9f, high = -1e9f;
        for (int p = 0; p < 180 * 240; p++) {
            float value = tsuya_image_get(&image, p % 180, p / 180, 0);
            low = fminf(low, value);
            high = fmaxf(high, value);
        }
        assert_true(high - low > 0.1f);
        pictures += strcmp(extension, ".png") == 0;
        floats += strcmp(extension, ".exr") == 0;
        tsuya_image_free(&image);
    }
    assert_int_equal(pictures, 4);
    assert_int_equal(floats, 4);
    tsuya_arena_free(arena);
}

static int occurrences(const char *text, const char *part)
{
    int count = 0;
    for (const char *at = text; (at = strstr(at, part)) != NULL; at += strlen(part)) {
        count++;
    }
    return count;
}

static void test_report_is_self_contained(void **state)
{
    (void)state;
    char *html;
    size_t size;
    assert_ok(tsuya_file_load(&html, &size, in_job(job_folder, "report/index.html"), (size_t)25 << 20));
    assert_true(occurrences(html, "<img ") + occurrences(html, "<svg ") >= 20);
    assert_int_equal(occurrences(html, "src=\""), occurrences(html, "src=\"data:image/"));
    assert_int_equal(occurrences(html, "http://") + occurrences(html, "https://"), 0);
    assert_int_equal(occurrences(html, "url(") + occurrences(html, "@import") + occurrences(html, "<link") + occurrences(html, "<script"), 0);
    assert_non_null(strstr(html, "not calibrated"));
    assert_non_null(strstr(html, "default: measured on nothing"));
    assert_int_equal(occurrences(html, "<section"), occurrences(html, "</section>"));
    tsuya_free(html);
}

static void test_second_run_does_nothing_and_options_redo_their_stage(void **state)
{
    (void)state;
    static const char *const stages[] = {"capture", "reconstruct", "weave", "brdf", "render", "report"};
    char yaml[TEST_PATH], json[TEST_PATH];
    tsuya_json *result;
    bool skipped;
    snprintf(yaml, sizeof yaml, "%s", test_path("input/JOB.yaml"));
    snprintf(json, sizeof json, "%s", test_path("again.json"));
    const char *argv[] = {"tsuya", "run", yaml, "-o", job_folder, "--json", json, NULL};
    run_to_end(argv);
    assert_ok(tsuya_json_load(&result, json));
    for (int i = 0; i < 6; i++) {
        assert_ok(tsuya_json_get_bool(&skipped, member(result, "stages", stages[i]), "skipped"));
        assert_true(skipped);
    }
    tsuya_json_free(result);

    static const char text[] = "name: reduced\nphotos: photos/\nmasks: masks/\n"
                               "render:\n  - {name: turntable, views: 4, size: [180, 240], color: \"#1f3a7a\"}\n";
    assert_ok(tsuya_file_write(yaml, text, sizeof text - 1));
    run_to_end(argv);
    assert_ok(tsuya_json_load(&result, json));
    for (int i = 0; i < 6; i++) {
        assert_ok(tsuya_json_get_bool(&skipped, member(result, "stages", stages[i]), "skipped"));
        assert_int_equal(skipped, i < 4);
    }
    tsuya_json_free(result);
}

/* The poses that COLMAP found, for a few photographs at a quarter of their size. */
static void write_posed_job(void)
{
    tsuya_sparse_model model;
    assert_ok(tsuya_sparse_model_load(&model, in_job(job_folder, "reconstruct/sparse/0")));
    assert_ok(reduced_job_write(test_path("posed"), data, POSED_FIRST, POSED, 4,
                                "poses: poses/\nrender:\n  - {name: t, views: 1, size: [90, 120]}\n"));
    for (int c = 0; c < model.camera_count; c++) {
        model.camera[c] = tsuya_camera_scaled(&model.camera[c], 326, 580);
    }
    int kept = 0;
    for (int v = 0; v < model.view_count; v++) {
        char photo[512];
        snprintf(photo, sizeof photo, "posed/photos/%s", model.view[v].name);
        if (tsuya_path_exists(test_path(photo))) {
            model.view[kept] = model.view[v];
            model.view[kept++].observation_count = 0;
        } else {
            tsuya_free(model.view[v].name);
            tsuya_free(model.view[v].observation);
        }
    }
    model.view_count = kept;
    for (size_t p = 0; p < model.point_count; p++) {
        tsuya_free(model.point[p].track);
    }
    model.point_count = 0;
    assert_int_equal(kept, POSED);
    assert_ok(tsuya_folder_make(test_path("posed/poses")));
    assert_ok(tsuya_sparse_model_save_text(&model, test_path("posed/poses")));
    tsuya_sparse_model_free(&model);
}

static bool has_depth_map(const char *folder)
{
    tsuya_arena *arena;
    char **names;
    int count = 0;
    const char *maps = in_job(folder, "reconstruct/dense/stereo/depth_maps");
    assert_ok(tsuya_arena_create(&arena, 1 << 12));
    bool found = tsuya_path_is_folder(maps) && tsuya_folder_list(&names, &count, maps, arena) == TSUYA_OK && count > 0;
    tsuya_arena_free(arena);
    return found;
}

static void wait_a_moment(void)
{
    struct timespec moment = {.tv_nsec = 20 * 1000 * 1000};
    nanosleep(&moment, NULL);
}

/* Kills the program, first by SIGINT in the first stages, then by SIGKILL amid the stereo; a second program is refused. */
static void run_with_kills(const char *const argv[], const char *folder)
{
    const char *log = test_path("killed.log");
    pid_t pid = start(argv, log);
    while (!tsuya_path_exists(in_job(folder, "state.json")) && waitpid(pid, NULL, WNOHANG) == 0) {
        wait_a_moment();
    }
    const char *second_log = test_path("second.log");
    int second = finish(start(argv, second_log));
    assert_int_equal(WEXITSTATUS(second), 1);
    kill(pid, SIGINT);
    int status = finish(pid);
    assert_true(WIFEXITED(status));
    assert_int_equal(WEXITSTATUS(status), 1);

    pid = start(argv, log);
    int ended = 0;
    while (!has_depth_map(folder) && (ended = waitpid(pid, &status, WNOHANG)) == 0) {
        wait_a_moment();
    }
    if (ended != 0) {
        show_log(log);
        fail_msg("the run ended before it could be killed");
    }
    kill(pid, SIGKILL);
    status = finish(pid);
    assert_true(WIFSIGNALED(status));
}

static void assert_same_file(const char *a, const char *b, const char *name)
{
    tsuya_hash one, two;
    assert_ok(tsuya_hash_file(&one, in_job(a, name)));
    assert_ok(tsuya_hash_file(&two, in_job(b, name)));
    if (strcmp(one.hex, two.hex) != 0) {
        fail_msg("%s differs", name);
    }
}

static void test_threads_and_kills_change_nothing(void **state)
{
    (void)state;
    char yaml[TEST_PATH], one[TEST_PATH], two[TEST_PATH];
    write_posed_job();
    snprintf(yaml, sizeof yaml, "%s", test_path("posed/JOB.yaml"));
    snprintf(one, sizeof one, "%s", test_path("one"));
    snprintf(two, sizeof two, "%s", test_path("two"));
    const char *with_one[] = {"tsuya", "run", yaml, "-o", one, "--threads", "1", NULL};
    const char *with_two[] = {"tsuya", "run", yaml, "-o", two, "--threads", "2", NULL};
    run_to_end(with_one);
    run_with_kills(with_two, two);
    run_to_end(with_two);
    assert_same_file(one, two, "reconstruct/cloud.ply");
    assert_same_file(one, two, "reconstruct/mesh.ply");
    assert_same_file(one, two, "weave/weave.ply");
}

static int prepare(void **state)
{
    (void)state;
    run_whole_job();
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_photographs_are_placed),
        cmocka_unit_test(test_surface_and_weft_field),
        cmocka_unit_test(test_renders_show_cloth),
        cmocka_unit_test(test_report_is_self_contained),
        cmocka_unit_test(test_second_run_does_nothing_and_options_redo_their_stage),
        cmocka_unit_test(test_threads_and_kills_change_nothing),
    };
    data = test_data("garment/asclepius");
    if (!data || !tsuya_process_available("colmap")) {
        printf("needs %s\n", data ? "colmap" : "the data folder's garment/asclepius");
        return TEST_SKIPPED;
    }
    int result = cmocka_run_group_tests(tests, prepare, NULL);
    tsuya_json_free(job_result);
    if (result == 0) {
        test_folder_remove();
    } else {
        fprintf(stderr, "kept for a look: %s\n", test_folder());
    }
    return result;
}
