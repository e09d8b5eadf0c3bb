/* COLMAP's model files and maps: round trips, the half pixel, hostile counts, and COLMAP itself reading what is written. */
#include "failures.h"

#include "core/camera.h"
#include "core/process.h"

/* Two cameras, three views, 40 points with tracks. */
static tsuya_sparse_model make(void)
{
    enum { VIEWS = 3, POINTS = 40 };
    tsuya_sparse_model m = {.camera_count = 2, .view_count = VIEWS, .point_count = POINTS};
    m.camera = tsuya_calloc(2, sizeof *m.camera);
    m.camera_id = tsuya_calloc(2, sizeof *m.camera_id);
    m.view = tsuya_calloc(VIEWS, sizeof *m.view);
    m.point = tsuya_calloc(POINTS, sizeof *m.point);
    m.camera[0] = (tsuya_camera){.lens = TSUYA_LENS_OPENCV4, .width_px = 640, .height_px = 480, .fx_px = 500.125, .fy_px = 501, .cx_px = 319.5,
                                 .cy_px = 239.25, .distortion = {0.1, -0.01, 0.001, 0.002}};
    m.camera[1] = (tsuya_camera){.lens = TSUYA_LENS_SIMPLE_RADIAL, .width_px = 320, .height_px = 240, .fx_px = 250, .fy_px = 250, .cx_px = 159.5,
                                 .cy_px = 119.5, .distortion = {0.05}};
    m.camera_id[0] = 7;
    m.camera_id[1] = 3;
    for (int v = 0; v < VIEWS; v++) {
        char name[32];
        snprintf(name, sizeof name, "IMG %d.jpg", v);
        m.view[v] = (tsuya_view){.image_id = (uint32_t)(30 - v), .camera_id = v == 2 ? 3 : 7, .name = tsuya_strdup(name), .camera = v == 2,
                                 .camera_from_world = tsuya_pose_look_at((tsuya_vec3){v - 1.0, -3, 0.5}, (tsuya_vec3){0, 0, 0}, (tsuya_vec3){0, 0, 1}),
                                 .observation_count = POINTS + 1, .observation = tsuya_calloc(POINTS + 1, sizeof(tsuya_observation))};
        m.view[v].observation[POINTS] = (tsuya_observation){1.5f, 2.25f, -1};
    }
    for (int i = 0; i < POINTS; i++) {
        tsuya_point *p = &m.point[i];
        *p = (tsuya_point){.position = {tsuya_random_uniform(1, 1, (uint64_t)i) - 0.5, tsuya_random_uniform(1, 2, (uint64_t)i) - 0.5, 0.01 * i},
                           .color = {(uint8_t)i, 100, 200}, .error_px = 0.25 * i, .track_count = VIEWS,
                           .track = tsuya_calloc(VIEWS, sizeof(tsuya_track_element)), .point_id = (uint64_t)(1000 - 3 * i)};
        for (int v = 0; v < VIEWS; v++) {
            tsuya_vec2 pixel;
            assert_true(tsuya_camera_project(&m.camera[m.view[v].camera], tsuya_pose_apply(m.view[v].camera_from_world, p->position), &pixel));
            m.view[v].observation[i] = (tsuya_observation){(float)pixel.x, (float)pixel.y, i};
            p->track[v] = (tsuya_track_element){v, i};
        }
    }
    return m;
}

static void assert_same(const tsuya_sparse_model *a, const tsuya_sparse_model *b)
{
    assert_int_equal(a->camera_count, b->camera_count);
    assert_int_equal(a->view_count, b->view_count);
    assert_int_equal(a->point_count, b->point_count);
    for (int c = 0; c < a->camera_count; c++) {
        assert_int_equal(a->camera_id[c], b->camera_id[c]);
        assert_int_equal(a->camera[c].lens, b->camera[c].lens);
        assert_near(a->camera[c].cx_px, b->camera[c].cx_px, 1e-12);
        assert_near(a->camera[c].fy_px, b->camera[c].fy_px, 0);
        assert_memory_equal(a->camera[c].distortion, b->camera[c].distortion, sizeof a->camera[c].distortion);
    }
    for (int v = 0; v < a->view_count; v++) {
        const tsuya_view *x = &a->view[v], *y = &b->view[v];
        assert_string_equal(x->name, y->name);
        assert_true(x->image_id == y->image_id && x->camera == y->camera && x->observation_count == y->observation_count);
        for (int k = 0; k < 9; k++) {
            assert_near(x->camera_from_world.rotation.e[k / 3][k % 3], y->camera_from_world.rotation.e[k / 3][k % 3], 1e-15);
        }
        assert_memory_equal(&x->camera_from_world.translation, &y->camera_from_world.translation, sizeof(tsuya_vec3));
        for (int k = 0; k < x->observation_count; k++) {
            assert_near((double)x->observation[k].x_px, (double)y->observation[k].x_px, 1e-4);
            assert_near((double)x->observation[k].y_px, (double)y->observation[k].y_px, 1e-4);
            assert_int_equal(x->observation[k].point, y->observation[k].point);
        }
    }
    for (size_t i = 0; i < a->point_count; i++) {
        assert_memory_equal(&a->point[i].position, &b->point[i].position, sizeof(tsuya_vec3));
        assert_memory_equal(a->point[i].color, b->point[i].color, 3);
        assert_true(a->point[i].point_id == b->point[i].point_id && a->point[i].track_count == b->point[i].track_count);
        assert_memory_equal(a->point[i].track, b->point[i].track, (size_t)a->point[i].track_count * sizeof *a->point[i].track);
        assert_near(a->point[i].error_px, b->point[i].error_px, 1e-9);
    }
}

static void fresh(const char *name) { assert_ok(tsuya_folder_remove(test_path(name))); }

static void test_round_trips(void **state)
{
    (void)state;
    tsuya_sparse_model m = make(), back;
    fresh("text"), fresh("binary");
    assert_ok(tsuya_sparse_model_save_text(&m, test_path("text")));
    assert_ok(tsuya_sparse_model_load(&back, test_path("text")));
    assert_same(&m, &back);
    tsuya_sparse_model_free(&back);
    assert_ok(tsuya_sparse_model_save_binary(&m, test_path("binary")));
    assert_ok(tsuya_sparse_model_load(&back, test_path("binary")));
    assert_same(&m, &back);
    assert_int_equal(tsuya_sparse_model_find(&back, "IMG 1.jpg"), 1);
    assert_int_equal(tsuya_sparse_model_find(&back, "IMG 9.jpg"), -1);
    tsuya_sparse_model_free(&back);
    tsuya_sparse_model_free(&m);
    tsuya_sparse_model_free(&m);
}

/* The file says 320 where the principal point of a 640 pixel wide camera is in the middle: (0.5, 0.5) is COLMAP's first centre. */
static void test_half_a_pixel(void **state)
{
    (void)state;
    static const char cameras[] = "1 PINHOLE 640 480 500 500 320 240\n", images[] = "1 1 0 0 0 0 0 0 1 a.jpg\n320 240 -1\n";
    tsuya_sparse_model m;
    tsuya_vec2 pixel;
    fresh("half");
    assert_ok(tsuya_folder_make(test_path("half")));
    assert_ok(tsuya_file_write(test_path("half/cameras.txt"), cameras, sizeof cameras - 1));
    assert_ok(tsuya_file_write(test_path("half/images.txt"), images, sizeof images - 1));
    assert_ok(tsuya_sparse_model_load(&m, test_path("half")));
    assert_near(m.camera[0].cx_px, 319.5, 0);
    assert_near(m.camera[0].cy_px, 239.5, 0);
    assert_true(tsuya_camera_project(&m.camera[0], (tsuya_vec3){0, 0, 1}, &pixel));
    assert_near(pixel.x, (double)m.view[0].observation[0].x_px, 0); /* both moved: what was seen stays where the lens says */
    assert_near(pixel.y, (double)m.view[0].observation[0].y_px, 0);
    char *text;
    size_t size;
    assert_ok(tsuya_sparse_model_save_text(&m, test_path("half/again")));
    assert_ok(tsuya_file_load(&text, &size, test_path("half/again/cameras.txt"), 1 << 16));
    assert_non_null(strstr(text, "1 PINHOLE 640 480 500 500 320 240\n"));
    tsuya_free(text);
    tsuya_sparse_model_free(&m);
}

/* COLMAP opens both, and turns one into the other. */
static void test_colmap_agrees(void **state)
{
    (void)state;
    if (!tsuya_process_available("colmap")) {
        skip();
    }
    tsuya_sparse_model m = make(), back;
    static const char *const environment[] = {"QT_QPA_PLATFORM=offscreen", NULL};
    tsuya_process_options options = {.environment = environment, .log_path = test_path("colmap.log")};
    fresh("ours"), fresh("theirs");
    assert_ok(tsuya_sparse_model_save_binary(&m, test_path("ours")));
    assert_ok(tsuya_folder_make(test_path("theirs")));
    const char *argv[] = {"colmap", "model_converter", "--input_path", test_path("ours"), "--output_path", test_path("theirs"), "--output_type", "TXT", NULL};
    assert_ok(tsuya_process_run(NULL, argv, &options));
    assert_ok(tsuya_sparse_model_load(&back, test_path("theirs")));
    assert_int_equal(back.view_count, 3);
    assert_int_equal(back.point_count, 40);
    int c = back.camera_id[0] == 7 ? 0 : 1;
    assert_near(back.camera[c].cx_px, 319.5, 1e-9);
    assert_near(back.camera[c].distortion[3], 0.002, 1e-9);
    for (int v = 0; v < 3; v++) {
        assert_string_equal(back.view[v].name, m.view[v].name);
        for (int k = 0; k < 9; k++) {
            assert_near(back.view[v].camera_from_world.rotation.e[k / 3][k % 3], m.view[v].camera_from_world.rotation.e[k / 3][k % 3], 1e-9);
        }
        assert_near((double)back.view[v].observation[5].x_px, (double)m.view[v].observation[5].x_px, 1e-2);
    }
    tsuya_sparse_model_free(&back);
    tsuya_sparse_model_free(&m);
}

static void test_moving_a_model_keeps_its_pixels(void **state)
{
    (void)state;
    tsuya_sparse_model m = make();
    tsuya_similarity s = {0.37, tsuya_mat3_from_rodrigues((tsuya_vec3){0.3, -0.8, 0.5}), {4, -5, 6}};
    tsuya_sparse_model_transform(&m, s);
    for (size_t i = 0; i < m.point_count; i++) {
        for (int v = 0; v < m.view_count; v++) {
            tsuya_vec2 pixel;
            tsuya_vec3 p = tsuya_pose_apply(m.view[v].camera_from_world, m.point[i].position);
            assert_true(tsuya_camera_project(&m.camera[m.view[v].camera], p, &pixel));
            assert_near(pixel.x, (double)m.view[v].observation[i].x_px, 1e-4);
            assert_near(pixel.y, (double)m.view[v].observation[i].y_px, 1e-4);
        }
    }
    tsuya_sparse_model_free(&m);
}

static void refuse(const char *cameras, const char *images, const char *points, const char *part)
{
    tsuya_sparse_model m;
    fresh("bad");
    assert_ok(tsuya_folder_make(test_path("bad")));
    assert_ok(tsuya_file_write(test_path("bad/cameras.txt"), cameras, strlen(cameras)));
    assert_ok(tsuya_file_write(test_path("bad/images.txt"), images, strlen(images)));
    assert_ok(tsuya_file_write(test_path("bad/points3D.txt"), points, strlen(points)));
    assert_fails(tsuya_sparse_model_load(&m, test_path("bad")), part);
    assert_null(m.view);
}

static void test_refusals(void **state)
{
    (void)state;
    static const char fine[] = "1 PINHOLE 640 480 500 500 320 240\n", view[] = "1 1 0 0 0 0 0 0 1 a.jpg\n320 240 -1\n";
    refuse("1 FISHEYE 640 480 500 500 320 240\n", view, "", "lens model FISHEYE; SIMPLE_PINHOLE, PINHOLE");
    refuse("1 PINHOLE 640 480 500 500 320\n", view, "", "ID MODEL WIDTH HEIGHT PARAMETERS expected");
    refuse("1 PINHOLE 640 480 500 500 320 nan\n", view, "", "expected");
    refuse("1 PINHOLE 640 70000 500 500 320 240\n", view, "", "expected");
    refuse("1 PINHOLE 640 480 -500 500 320 240\n", view, "", "focal length -500 px; it must be positive");
    refuse(fine, "1 1 0 0 0 0 0 0 2 a.jpg\n\n", "", "image a.jpg names camera 2, which does not exist");
    refuse(fine, "1 1 0 0 0 0 0 0 1 a.jpg\n\n2 1 0 0 0 0 0 0 1 a.jpg\n\n", "", "image a.jpg occurs twice");
    refuse(fine, "1 1 0 0 0 0 inf 0 1 a.jpg\n\n", "", "IMAGE_ID QW QX QY QZ");
    refuse(fine, "1 1 0 0 0 0 0 0 1 a.jpg\n1 2\n", "", "triples X Y POINT3D_ID expected");
    refuse(fine, view, "1 0 0 0 0 0 0 0.1 1 5\n", "point 1 is seen in image 1, observation 5, which does not exist");
    refuse(fine, view, "1 0 0 0 0 0 0 0.1 9 0\n", "point 1 is seen in image 9");
    refuse(fine, view, "1 0 0 0 0 0 256 0.1\n", "POINT3D_ID X Y Z R G B ERROR TRACK expected");
    refuse(fine, view, "1 0 0 0 0 0 0 0.1 1\n", "pairs of IMAGE_ID POINT2D_IDX");
    tsuya_sparse_model m;
    assert_fails(tsuya_sparse_model_load(&m, test_path("none")), "no cameras.bin and no cameras.txt");
    tsuya_sparse_model own = make();
    own.camera[0].lens = TSUYA_LENS_OPENCV12;
    assert_fails(tsuya_sparse_model_save_binary(&own, test_path("bad2")), "no lens model for thin prism terms (OPENCV12)");
    tsuya_sparse_model_free(&own);
}

/* Counts of 2^60 are held against the file's size before memory is taken. */
static void test_hostile_counts(void **state)
{
    (void)state;
    static const char *const names[] = {"hostile/cameras.bin", "hostile/images.bin", "hostile/points3D.bin"};
    static const uint64_t counts[] = {UINT64_MAX, (uint64_t)1 << 60, (uint64_t)1 << 32, 1000000};
    tsuya_sparse_model own = make(), m;
    for (int f = 0; f < 3; f++) {
        for (size_t k = 0; k < sizeof counts / sizeof counts[0]; k++) {
            char *bytes;
            size_t size;
            fresh("hostile");
            assert_ok(tsuya_sparse_model_save_binary(&own, test_path("hostile")));
            assert_ok(tsuya_file_load(&bytes, &size, test_path(names[f]), 1 << 20));
            memcpy(bytes, &counts[k], 8);
            test_write(test_path(names[f]), bytes, size);
            tsuya_free(bytes);
            assert_fails(tsuya_sparse_model_load(&m, test_path("hostile")), "more than the file can hold");
        }
    }
    tsuya_sparse_model_free(&own);
}

static char part_path[TEST_PATH], folder_path[TEST_PATH];

/* The damaged part lies at part_path already, among whole ones. */
static tsuya_status load_part(const char *path)
{
    tsuya_sparse_model m;
    (void)path;
    tsuya_status status = tsuya_sparse_model_load(&m, folder_path);
    if (status != TSUYA_OK) { /* it may name the folder alone, where parts do not fit each other */
        return strstr(tsuya_reason(), folder_path) ? tsuya_fail(status, "%s", part_path) : status;
    }
    tsuya_sparse_model_free(&m);
    return TSUYA_OK;
}

static tsuya_status attempt(void *user)
{
    TSUYA_TRY(tsuya_sparse_model_save_text(user, test_path("memory")));
    TSUYA_TRY(tsuya_sparse_model_save_binary(user, test_path("memory")));
    tsuya_sparse_model m;
    TSUYA_TRY(tsuya_sparse_model_load(&m, test_path("memory")));
    tsuya_sparse_model_free(&m);
    return TSUYA_OK;
}

static void test_failing_memory_and_damaged_files(void **state)
{
    (void)state;
    tsuya_sparse_model own = make();
    assert_true(test_every_allocation(attempt, &own) > 50);
    static const char *const names[] = {"cameras.bin", "images.bin", "points3D.bin", "cameras.txt", "images.txt", "points3D.txt"};
    for (int f = 0; f < 6; f++) {
        char part[64];
        fresh("damaged"), fresh("whole");
        snprintf(folder_path, sizeof folder_path, "%s", test_path("damaged"));
        assert_ok((f < 3 ? tsuya_sparse_model_save_binary : tsuya_sparse_model_save_text)(&own, test_path("damaged")));
        assert_ok((f < 3 ? tsuya_sparse_model_save_binary : tsuya_sparse_model_save_text)(&own, test_path("whole")));
        snprintf(part, sizeof part, "damaged/%s", names[f]);
        snprintf(part_path, sizeof part_path, "%s", test_path(part));
        snprintf(part, sizeof part, "whole/%s", names[f]);
        test_damage(load_part, part_path, test_path(part), 0, 400);
    }
    tsuya_sparse_model_free(&own);
}

static tsuya_status load_map(const char *path)
{
    float *values;
    int width, height, channels;
    TSUYA_TRY(tsuya_colmap_map_load(&values, &width, &height, &channels, path));
    tsuya_free(values);
    return TSUYA_OK;
}

static void test_maps(void **state)
{
    (void)state;
    float values[3 * 5 * 7], *back;
    int width, height, channels;
    for (int i = 0; i < 105; i++) {
        values[i] = (float)i * 0.37f;
    }
    assert_ok(tsuya_colmap_map_save(test_path("map.bin"), 7, 5, 3, values));
    assert_ok(tsuya_colmap_map_load(&back, &width, &height, &channels, test_path("map.bin")));
    assert_true(width == 7 && height == 5 && channels == 3);
    assert_memory_equal(back, values, sizeof values);
    tsuya_free(back);
    struct stat about;
    assert_int_equal(stat(test_path("map.bin"), &about), 0);
    test_damage(load_map, test_path("damaged.bin"), test_path("map.bin"), (size_t)about.st_size, 1000);
    test_write(test_path("damaged.bin"), "65535&65535&16&", 15);
    assert_fails(load_map(test_path("damaged.bin")), "0 bytes of values, 65535 x 65535 x 16 floats expected");
    test_write(test_path("damaged.bin"), "-1&5&1&xxxx", 11);
    assert_fails(load_map(test_path("damaged.bin")), "not a COLMAP map");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_round_trips),
        cmocka_unit_test(test_half_a_pixel),
        cmocka_unit_test(test_colmap_agrees),
        cmocka_unit_test(test_moving_a_model_keeps_its_pixels),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_hostile_counts),
        cmocka_unit_test(test_failing_memory_and_damaged_files),
        cmocka_unit_test(test_maps),
    };
    int result = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return result;
}
