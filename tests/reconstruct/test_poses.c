/* Known poses from .cameramodel files: of photographs, of a rig's cameras, and files that nobody gave a pose. */
#include "tests/support.h"

#include "core/file.h"
#include "reconstruct/poses.h"

enum { PHOTOS = 5 };
static const char *const NAME[PHOTOS] = {"left-001.jpg", "left-002.jpg", "leftmost.jpg", "right.png", "right_b.x.tif"};

static tsuya_photo_set photos_of(tsuya_photo *photo)
{
    for (int i = 0; i < PHOTOS; i++) {
        photo[i] = (tsuya_photo){.name = (char *)(uintptr_t)NAME[i], .width_px = 640, .height_px = 480};
    }
    return (tsuya_photo_set){.photo = photo, .count = PHOTOS};
}

static void save(const char *folder, const char *name, double fx, double x)
{
    char path[512];
    tsuya_camera lens = {.lens = TSUYA_LENS_OPENCV4, .width_px = 640, .height_px = 480, .fx_px = fx, .fy_px = fx, .cx_px = 319.5, .cy_px = 239.5, .distortion = {0.01}};
    tsuya_pose pose = {tsuya_mat3_from_rodrigues((tsuya_vec3){0.1, -0.2, 0.3}), {x, 0.0, 1.0}};
    snprintf(path, sizeof path, "%s/%s.cameramodel", folder, name);
    assert_ok(tsuya_cameramodel_save(&lens, pose, path));
}

static void test_files_find_their_photographs(void **state)
{
    (void)state;
    const char *folder = test_path("poses");
    tsuya_photo photo[PHOTOS];
    tsuya_photo_set photos = photos_of(photo);
    tsuya_sparse_model model;
    assert_ok(tsuya_folder_make(folder));
    save(folder, "left", 500.0, 1.0);
    save(folder, "left-002", 500.0, 2.0); /* the longer name */
    save(folder, "right", 600.0, 3.0);
    assert_ok(tsuya_poses_load(&model, folder, &photos));
    assert_int_equal(model.view_count, 4); /* leftmost.jpg is no photograph of left */
    assert_int_equal(model.camera_count, 2);
    assert_int_equal(model.point_count, 0);
    static const char *const name[] = {"left-001.jpg", "left-002.jpg", "right.png", "right_b.x.tif"};
    static const double x[] = {1.0, 2.0, 3.0, 3.0};
    for (int v = 0; v < 4; v++) {
        assert_string_equal(model.view[v].name, name[v]);
        assert_near(model.view[v].camera_from_world.translation.x, x[v], 1e-12);
        assert_near(model.camera[model.view[v].camera].fx_px, v < 2 ? 500.0 : 600.0, 1e-9);
    }
    tsuya_sparse_model_free(&model);
}

static void test_files_without_poses(void **state)
{
    (void)state;
    const char *folder = test_path("at-home");
    tsuya_photo photo[PHOTOS];
    tsuya_photo_set photos = photos_of(photo);
    tsuya_sparse_model model;
    assert_ok(tsuya_folder_make(folder));
    save(folder, "left", 500.0, 0.0);
    save(folder, "right", 600.0, 0.0);
    assert_fails(tsuya_poses_load(&model, folder, &photos), "one place");
    assert_int_equal(model.view_count, 0);
}

static void test_damaged_and_missing(void **state)
{
    (void)state;
    const char *folder = test_path("damaged");
    char path[512];
    tsuya_photo photo[PHOTOS];
    tsuya_photo_set photos = photos_of(photo);
    tsuya_sparse_model model;
    assert_ok(tsuya_folder_make(folder));
    assert_fails(tsuya_poses_load(&model, folder, &photos), "damaged"); /* an empty folder is no COLMAP model */
    snprintf(path, sizeof path, "%s/right.cameramodel", folder);
    assert_ok(tsuya_file_write(path, "{", 1));
    assert_fails(tsuya_poses_load(&model, folder, &photos), "right.cameramodel");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_files_find_their_photographs), cmocka_unit_test(test_files_without_poses), cmocka_unit_test(test_damaged_and_missing),
    };
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
