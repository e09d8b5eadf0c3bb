/* A set of photographs through a splined lens comes out as shape, in metres. */
#include "support.h"

#include "core/image.h"
#include "core/memory.h"
#include "core/mesh.h"
#include "core/order.h"
#include "core/process.h"
#include "lens_scene.h"
#include "reconstruct/reconstruct.h"
#include "scene.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { WIDTH = 400, HEIGHT = 300, VIEWS = 9 };

static void draw(const char *path, const scene_view *view, const tsuya_camera *lens, int v)
{
    tsuya_image image;
    tsuya_pose world_from_camera = tsuya_pose_inverse(view->camera_from_world);
    assert_ok(tsuya_image_create(&image, WIDTH, HEIGHT, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            tsuya_vec3 ray;
            scene_hit hit = {.grey = 0.0};
            assert_true(tsuya_camera_unproject(lens, (tsuya_vec2){x, y}, &ray));
            (void)scene_trace(&hit, SCENE_SHEET, world_from_camera.translation, tsuya_mat3_apply(world_from_camera.rotation, ray));
            double noise = 0.01 * (tsuya_random_uniform(7, (uint64_t)v, (uint64_t)(y * WIDTH + x)) - 0.5);
            uint8_t grey = (uint8_t)lrint(255.0 * fmin(fmax(hit.grey + noise, 0.0), 1.0));
            memset(tsuya_image_u8(&image, x, y), grey, 3);
        }
    }
    assert_ok(tsuya_image_save(&image, path, NULL));
    tsuya_image_free(&image);
}

/* Two points of the surface, measured and marked in every photograph that shows both. */
static void mark(tsuya_scale_input *input, tsuya_scale_sighting sighting[2 * VIEWS], tsuya_scale_distance *distance, const scene_pictures *scene,
                 const tsuya_camera *lens, char photo[VIEWS][16])
{
    scene_hit end[2];
    int count[2] = {0, 0};
    assert_true(scene_trace(&end[0], SCENE_SHEET, (tsuya_vec3){-0.1, 0.05, 1}, (tsuya_vec3){0, 0, -1}));
    assert_true(scene_trace(&end[1], SCENE_SHEET, (tsuya_vec3){0.12, -0.04, 1}, (tsuya_vec3){0, 0, -1}));
    for (int e = 0; e < 2; e++) {
        for (int v = 0; v < scene->view_count; v++) {
            tsuya_vec2 pixel;
            if (tsuya_camera_project(lens, tsuya_pose_apply(scene->view[v].camera_from_world, end[e].point), &pixel)) {
                sighting[count[0] + count[1]] = (tsuya_scale_sighting){photo[v], e, pixel, 0.1};
                count[e]++;
            }
        }
    }
    assert_true(count[0] >= 3 && count[1] >= 3);
    *distance = (tsuya_scale_distance){0, 1, tsuya_vec3_norm(tsuya_vec3_sub(end[0].point, end[1].point))};
    *input = (tsuya_scale_input){.source = "marks", .sighting = sighting, .sighting_count = count[0] + count[1], .distance = distance, .distance_count = 1};
}

static void shape_comes_back(void **state)
{
    (void)state;
    scene_pictures scene;
    tsuya_camera lens = lens_splined(WIDTH, HEIGHT, 480, 70);
    tsuya_reconstruct_info info;
    tsuya_reconstruct_options options = tsuya_reconstruct_options_default();
    tsuya_context context = tsuya_context_default();
    tsuya_scale_input scale;
    tsuya_scale_sighting sighting[2 * VIEWS];
    tsuya_scale_distance distance;
    tsuya_sparse_model model;
    tsuya_similarity true_from_made;
    tsuya_vec3 made[VIEWS], truth[VIEWS];
    tsuya_mesh cloud;
    char photo[VIEWS][16], photos[TEST_PATH], output[TEST_PATH], camera[TEST_PATH], path[2 * TEST_PATH];
    double rms;
    if (!tsuya_process_available("colmap")) {
        skip();
    }
    assert_true(scene_create(&scene, SCENE_SHEET, 64, VIEWS, 0.0));
    snprintf(photos, sizeof photos, "%s", test_path("photos"));
    snprintf(output, sizeof output, "%s", test_path("out"));
    snprintf(camera, sizeof camera, "%s", test_path("lens.cameramodel"));
    assert_ok(tsuya_folder_make(photos));
    assert_ok(tsuya_cameramodel_save(&lens, tsuya_pose_identity(), camera));
    for (int v = 0; v < VIEWS; v++) {
        snprintf(photo[v], sizeof photo[v], "view%02d.png", v);
        snprintf(path, sizeof path, "%s/%s", photos, photo[v]);
        draw(path, &scene.view[v], &lens, v);
    }
    mark(&scale, sighting, &distance, &scene, &lens, photo);
    options.photos = photos;
    options.output = output;
    options.camera_model = camera;
    options.scale = &scale;
    assert_ok(tsuya_reconstruct(&info, &options, &context));
    assert_int_equal(info.registered, VIEWS);
    assert_true(info.calibrated);
    assert_ok(tsuya_reconstruct_cameras(&model, output, camera, NULL));
    assert_int_equal(model.camera[0].lens, lens.lens);
    assert_int_equal(model.camera[0].width_px, WIDTH);
    for (int v = 0; v < VIEWS; v++) {
        made[v] = tsuya_pose_center(model.view[v].camera_from_world);
        truth[v] = tsuya_pose_center(scene.view[v].camera_from_world);
    }
    assert_true(tsuya_similarity_align(&true_from_made, &rms, truth, made, VIEWS));
    snprintf(path, sizeof path, "%s/cloud.ply", output);
    assert_ok(tsuya_ply_load(&cloud, path));
    double *off = tsuya_calloc(cloud.vertex_count + 1, sizeof *off), gsd = 1.0 / lens.fx_px;
    assert_non_null(off);
    for (size_t i = 0; i < cloud.vertex_count; i++) {
        off[i] = scene_distance_m(SCENE_SHEET, tsuya_similarity_apply(true_from_made, tsuya_mesh_position(&cloud, i))) / gsd;
    }
    tsuya_sort_doubles(off, cloud.vertex_count);
    double median = off[cloud.vertex_count / 2], p90 = off[cloud.vertex_count * 9 / 10];
    print_message("splined lens: %d of %d placed, %.2f px, centres within %.2f mm, scale off by %.3f %%, %zu points at %.2f / %.2f of a pixel (median, p90)\n",
                  info.registered, info.photos, info.reprojection_px, 1e3 * rms, 100 * fabs(true_from_made.scale - 1), cloud.vertex_count, median, p90);
    assert_true(1e3 * rms < 1.0);
    assert_true(fabs(true_from_made.scale - 1.0) < 2e-3);
    assert_true(cloud.vertex_count > 5000);
    assert_true(median < 0.5 && p90 < 1.5);
    tsuya_free(off);
    tsuya_mesh_free(&cloud);
    tsuya_sparse_model_free(&model);
    tsuya_reconstruct_info_free(&info);
    assert_ok(tsuya_reconstruct(&info, &options, &context)); /* a later run goes on where it was */
    for (int i = 0; i < info.step_count; i++) {
        assert_true(info.step[i].skipped);
    }
    tsuya_reconstruct_info_free(&info);
    scene_free(&scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(shape_comes_back)};
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
