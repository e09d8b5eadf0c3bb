/* Simulated jobs: their scenes, their files, and what the photographs show against other ways to the same numbers. */
#include "support.h"

#include "calib/detect.h"
#include "calib/mrcal_adapter.h"
#include "capture/drape.h"
#include "capture/simulate.h"
#include "capture/simulate_parts.h"
#include "capture/studio_sensor.h"
#include "core/photo.h"

#include <math.h>

static const char SMALL[] =
    "name: small\n"
    "cloth: {kind: closed, side_m: 0.3, spacing_m: 0.01, reflectance: satin}\n"
    "stand: {kind: disc, radius_m: 0.08, height_m: 0.16}\n"
    "camera: {size: [120, 90], focal_px: 150, distortion: [-0.04, 0, 0, 0], spp: 1, bayer: true, format: %s}\n"
    "views:\n"
    "  - {count: 4, elevation_deg: 30, distance_m: 0.6}\n"
    "  - {count: 2, px_per_thread: 2}\n"
    "mat: {cols: 5, rows: 5, tag_mm: 60, gap_mm: 20}\n"
    "chart: true\n"
    "board: {cols: 3, rows: 2, photos: 2}\n"
    "goniometer: {tilt_step_deg: 15, dye: [0.02, 0.02, 0.02]}\n"
    "lamps_measured: true\n"
    "hold_out: 1\n";

static const char *write_scene(const char *name, const char *text)
{
    const char *path = test_path(name);
    assert_ok(tsuya_file_write(path, text, strlen(text)));
    return path;
}

static void a_scene_says_what_it_wants(void **state)
{
    (void)state;
    static const struct { const char *text, *reason; } bad[] = {
        {"views: [{count: 3, distance_m: 1}]\ncloth: {kinds: disc}\n", "kind"},
        {"views: [{count: 3, distance_m: 1}]\ncloth: {kind: sqare}\n", "the nearest is 'square'"},
        {"views: [{count: 3}]\nhold_out: 0\n", "neither distance_m nor px_per_thread"},
        {"views: [{count: 3, distance_m: 1}]\n", "at least 3 left"},
        {"views: [{count: 3, distance_m: 1}]\nhold_out: 0\ncamera: {focal_px: 3}\n", "camera: focal_px: 3; from 20 to 1e+06"},
        {"views: [{count: 3, distance_m: 1}]\nhold_out: 0\ncamera: {distortion: [1, 2]}\n", "camera: distortion: 2 numbers"},
        {"views: [{count: 3, distance_m: 1}]\nhold_out: 0\nlamps: [{type: disk, rgb: [1, 1, 1], position_m: [0, 0, 1]}]\n", "lamps: size_m"},
        {"views: [{count: 3, distance_m: 1}]\nhold_out: 0\ncloth: {fabric: tweed}\n", "'tweed'; karaori, silk, cotton, wool"},
        {"views: [{count: 3, distance_m: 1}]\nhold_out: 0\ngoniometer: {dye: [0.1, 2, 0.1]}\n", "goniometer: dye: 2; numbers from 0 to 1"},
        {"views: [{count: 3, distance_m: 1}]\nhold_out: 0\ngoniometer: {dye: [0.1]}\n", "goniometer: dye: 1 numbers"},
        {"views: [{count: 3, distance_m: 1}]\nhold_out: 0\ncloth: {kind: karaori}\n", "karaori hangs on a stand of kind bar"},
        {"views: [{count: 3, distance_m: 1}]\nhold_out: 0\ncloth: {kind: curtain}\n", "curtain hangs under a stand of kind bar"},
        {"views: [{count: 3, distance_m: 1}]\nhold_out: 0\nstand: {kind: bar, height_m: 1, length_m: 1}\ncloth: {kind: curtain, drop_m: 1.2}\n", "higher than drop_m"},
        {"views: [{count: 3, distance_m: 1}]\nhold_out: 0\nstand: {kind: bar, height_m: 1, length_m: 1}\ncloth: {kind: curtain, fullness: 6}\n", "fullness"},
        {"views: [{count: 3, distance_m: 1}]\nhold_out: 0\ngoniometer: {photo_scale: 0}\n", "photo_scale: 0; from 0.02 to 1"},
        {"views: [{count: 3, distance_m: 1}]\nhold_out: 0\ncamera: {blur_px: -1}\n", "blur_px: -1; from 0 to 5"},
    };
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        tsuya_simulate_scene scene;
        assert_fails(tsuya_simulate_scene_load(&scene, write_scene("bad.yaml", bad[i].text)), bad[i].reason);
    }
}

/* A table that turns: its axis stands still in every picture, nothing else does, and the steps are even to a part of themselves. */
static void a_turntable_turns_about_its_axis(void **state)
{
    (void)state;
    enum { COUNT = 9 };
    const char *text = "views: [{count: 9, distance_m: 1.2, elevation_deg: 15, azimuth_deg: 20, jitter: 0.05, turntable: true}]\nhold_out: 0\n";
    tsuya_simulate_scene scene;
    tsuya_studio_cloth cloth = {0};
    tsuya_camera camera;
    simulate_view *view;
    int count;
    double before = 0.0;
    assert_ok(tsuya_simulate_scene_load(&scene, write_scene("table.yaml", text)));
    assert_ok(tsuya_simulate_camera(&camera, &scene));
    assert_ok(tsuya_mesh_create(&cloth.mesh, 2, 0, 0));
    const float corners[6] = {-0.25f, -0.125f, 0.125f, 0.5f, 0.375f, 0.5f}; /* exact in binary */
    memcpy(cloth.mesh.position, corners, sizeof corners);
    assert_ok(tsuya_simulate_views(&view, &count, &scene, &camera, &cloth, 3));
    assert_int_equal(count, COUNT);
    for (int i = 0; i < COUNT; i++) {
        for (int k = 0; k < 2; k++) { /* two points of the axis, in the camera's frame */
            tsuya_vec3 p = {0.125, 0.125, 0.2 + 0.3 * k};
            tsuya_vec3 now = tsuya_pose_apply(view[i].camera_from_world, p), first = tsuya_pose_apply(view[0].camera_from_world, p);
            assert_true(tsuya_vec3_norm(tsuya_vec3_sub(now, first)) < 1e-9);
        }
        tsuya_vec3 eye = tsuya_pose_apply(tsuya_pose_inverse(view[i].camera_from_world), (tsuya_vec3){0, 0, 0});
        double azimuth = tsuya_deg_from_rad(atan2(eye.y - 0.125, eye.x - 0.125)), step = remainder(azimuth - before, 360.0);
        assert_true(i == 0 || (fabs(step - 360.0 / COUNT) <= 2.0 * 0.05 * 360.0 / COUNT && fabs(step - 360.0 / COUNT) > 1e-6));
        before = azimuth;
    }
    tsuya_mesh_free(&cloth.mesh);
    tsuya_simulate_scene_free(&scene);
}

/* Files, and the frame: the mat's tags are seen where the truth's poses put them. */
static void a_job_is_left_with_its_truth(void **state)
{
    (void)state;
    char text[1024], path[TEST_PATH];
    tsuya_context context = tsuya_context_default();
    const char *folder = test_path("job"), *formats[] = {"jpg", "tif"};
    for (int k = 0; k < 2; k++) {
        tsuya_simulate_scene scene;
        tsuya_simulate_info info;
        snprintf(text, sizeof text, SMALL, formats[k]);
        assert_ok(tsuya_simulate_scene_load(&scene, write_scene("scene.yaml", text)));
        assert_ok(tsuya_simulate(&info, &scene, folder, &context));
        assert_int_equal(info.photos, 6);
        tsuya_simulate_scene_free(&scene);
        static const char *const files[] = {"JOB.yaml", "mat.yaml", "board.yaml", "goniometer.csv", "truth/mesh.ply", "truth/lights.json",
                                            "truth/reflectance.csv", "truth/chart.csv", "truth/camera.cameramodel", "masks/close-006.png"};
        for (size_t i = 0; i < sizeof files / sizeof files[0]; i++) {
            snprintf(path, sizeof path, "%s/%s", folder, files[i]);
            assert_true(tsuya_path_exists(path));
        }
        tsuya_photo_set photos;
        snprintf(path, sizeof path, "%s/photos", folder);
        assert_ok(tsuya_photo_set_load(&photos, path, NULL));
        assert_int_equal(photos.count, 6);
        tsuya_photo_set_free(&photos);
    }
    tsuya_mesh mesh;
    tsuya_vec3 low, high;
    snprintf(path, sizeof path, "%s/truth/mesh.ply", folder);
    assert_ok(tsuya_ply_load(&mesh, path));
    tsuya_mesh_bounds(&mesh, &low, &high);
    assert_true(mesh.weft && fabs(0.5 * (low.x + high.x) - 0.19) < 0.02 && fabs(0.5 * (low.y + high.y) - 0.19) < 0.02); /* the mat's middle */
    tsuya_mesh_free(&mesh);
    assert_ok(tsuya_folder_make(test_path("foreign/photos")));
    tsuya_simulate_scene scene;
    tsuya_simulate_info info;
    assert_ok(tsuya_simulate_scene_load(&scene, test_path("scene.yaml")));
    assert_fails(tsuya_simulate(&info, &scene, test_path("foreign"), &context), "no simulation made it");
    tsuya_simulate_scene_free(&scene);
}

static const char BOARD[] =
    "camera: {size: [640, 480], focal_px: 560, center_px: [325.5, 236], distortion: [-0.21, 0.06, 0.0004, -0.0006, 0.004, 0.02, -0.01, 0.003], "
    "f_number: 0, full_well_e: 0, spp: 25, format: tif}\n"
    "views: [{count: 3, distance_m: 1}]\nhold_out: 0\n"
    "board: {cols: 8, rows: 5, photos: 3}\n";

/* Corners that calib measures in photographs, against mrcal's own projection of the board; root mean square of a coordinate. */
static double corner_error_px(int spp, double blur_px, bool bayer)
{
    tsuya_simulate_scene scene;
    tsuya_camera camera;
    tsuya_board board;
    tsuya_context context = tsuya_context_default();
    assert_ok(tsuya_simulate_scene_load(&scene, write_scene("board.yaml", BOARD)));
    assert_ok(tsuya_simulate_camera(&camera, &scene));
    assert_ok(tsuya_board_grid(&board, "tag36h11", 1, 8, 5, 0.03, 0.009, 0));
    tsuya_corner_set corners = {0};
    double sum_x = 0.0, sum_y = 0.0, worst = 0.0, squares = 0.0;
    int count = 0;
    for (int i = 0; i < 3; i++) {
        double distance;
        tsuya_pose pose = tsuya_simulate_board_pose(&distance, &scene, &camera, 3 * i + 1, 5);
        const tsuya_studio_grid grid = {"tag36h11", 1, 8, 5, 0, 30, 9};
        tsuya_studio_prop prop;
        tsuya_light_set lights = {0};
        tsuya_studio *studio;
        tsuya_image radiance, coverage, photograph;
        assert_ok(tsuya_studio_prop_tags(&prop, pose, &grid));
        assert_ok(tsuya_light_set_parse(&lights, "{\"lights\": [{\"type\": \"environment\", \"rgb\": [0.25, 0.25, 0.25]}]}", "lights", "."));
        tsuya_studio_options options = {.samples = 4, .prop = &prop, .prop_count = 1};
        assert_ok(tsuya_studio_create(&studio, NULL, NULL, &lights, &options, &context));
        tsuya_studio_shot shot = {.camera = camera, .camera_from_world = tsuya_pose_identity(), .blur_px = blur_px, .spp = spp, .stream = (uint64_t)i};
        tsuya_studio_sensor sensor = {.full_radiance = 1.2 * tsuya_studio_white(studio, 0.8), .bayer = bayer, .deep = true};
        assert_ok(tsuya_studio_shoot(&radiance, &coverage, studio, &shot, &context));
        assert_ok(tsuya_studio_develop(&photograph, &radiance, &sensor, 1, &context));
        tsuya_detect_report report;
        assert_ok(tsuya_detect_image(&corners, &report, &board, &photograph, i, &(tsuya_edge_look){2.4, 0.0}));
        for (; count < corners.count; count++) {
            const tsuya_corner *c = &corners.corner[count];
            tsuya_vec3 p = tsuya_pose_apply(pose, tsuya_board_corner(&board, tsuya_board_find(&board, c->tag_id), c->corner));
            tsuya_vec2 pixel, own;
            double by_point[6], by_lens[2 * 16];
            assert_true(tsuya_mrcal_project(&pixel, by_point, by_lens, &camera, p));
            assert_true(tsuya_camera_project(&camera, p, &own) && hypot(own.x - pixel.x, own.y - pixel.y) < 1e-6);
            double dx = c->x_px - pixel.x, dy = c->y_px - pixel.y;
            sum_x += dx;
            sum_y += dy;
            squares += dx * dx + dy * dy;
            worst = fmax(worst, hypot(dx, dy));
        }
        tsuya_studio_free(studio);
        tsuya_studio_prop_free(&prop);
        tsuya_light_set_free(&lights);
        tsuya_image_free(&radiance);
        tsuya_image_free(&coverage);
        tsuya_image_free(&photograph);
    }
    double n = count, rms = sqrt(0.5 * squares / n);
    print_message("%d rays, blur %.1f px: %d corners, mean offset %.4f %.4f px, rms %.4f px a coordinate, worst %.3f px\n", spp, blur_px, count, sum_x / n,
                  sum_y / n, rms, worst);
    assert_true(count > 150 && fabs(sum_x / n) < 0.02 && fabs(sum_y / n) < 0.02);
    tsuya_corner_set_free(&corners);
    tsuya_board_free(&board);
    tsuya_simulate_scene_free(&scene);
    return rms;
}

/* Few rays tell edges as well as many do: what is printed is exact, and neighbouring pixels share what is not. */
static void board_photographs_agree_with_mrcal(void **state)
{
    (void)state;
    assert_true(corner_error_px(25, 0.0, false) < 0.05);
    assert_true(corner_error_px(4, 0.6, false) < 0.025);
    assert_true(corner_error_px(1, 0.6, false) < 0.04);
    assert_true(corner_error_px(4, 0.6, true) < 0.05);
}

/* A flat cloth seen from far: the mean over threads is the macroscopic reflectance of the mean dye. */
static void far_cloth_has_the_reflectance_of_its_truth(void **state)
{
    (void)state;
    tsuya_studio_cloth cloth = {0};
    tsuya_studio_weave weave = tsuya_studio_weave_default();
    tsuya_light_set lights = {0};
    tsuya_context context = tsuya_context_default();
    tsuya_simulate_scene scene = {.cloth.reflectance = "satin"};
    const tsuya_microcylinder *satin = tsuya_simulate_reflectance(&scene);
    const tsuya_studio_drape flat = {.side_m = 0.1, .stand_radius_m = 1.0, .stand_height_m = 0.1, .edge_radius_m = 0.01, .folds = 1, .spacing_m = 0.01};
    assert_ok(tsuya_studio_drape_create(&cloth, &flat));
    tsuya_studio_options options = {.samples = 1, .cloth = satin};
    static const double lamp[3][3] = {{0.3, 0.1, 1.0}, {0.6, 0.0, 0.6}, {-0.2, 0.7, 0.5}};
    for (int k = 0; k < 3; k++) {
        char json[256];
        tsuya_studio *studio;
        tsuya_image radiance, coverage;
        tsuya_vec3 wi = tsuya_vec3_unit((tsuya_vec3){lamp[k][0], lamp[k][1], lamp[k][2]}), wo = tsuya_vec3_unit((tsuya_vec3){0.2, -0.3, 0.9});
        snprintf(json, sizeof json, "{\"lights\": [{\"type\": \"directional\", \"direction\": [%g, %g, %g], \"rgb\": [1, 1, 1]}]}", -wi.x, -wi.y, -wi.z);
        assert_ok(tsuya_light_set_parse(&lights, json, "lights", "."));
        assert_ok(tsuya_studio_create(&studio, &cloth, &weave, &lights, &options, &context));
        tsuya_studio_shot shot = {.camera = {.lens = TSUYA_LENS_PINHOLE, .width_px = 60, .height_px = 60, .fx_px = 20000, .fy_px = 20000, .cx_px = 29.5, .cy_px = 29.5},
                                  .camera_from_world = tsuya_pose_look_at(tsuya_vec3_mad((tsuya_vec3){0, 0, 0.1}, 20.0, wo), (tsuya_vec3){0, 0, 0.1}, (tsuya_vec3){0, 1, 0}), .spp = 36, .stream = 3};
        assert_ok(tsuya_studio_shoot(&radiance, &coverage, studio, &shot, &context));
        double seen[3] = {0}, expected[3], dye[3] = {0};
        for (int y = 0; y < 60; y++) {
            for (int x = 0; x < 60; x++) {
                tsuya_vec3 ray;
                float own[3];
                assert_true(tsuya_camera_unproject(&shot.camera, (tsuya_vec2){x, y}, &ray));
                tsuya_vec3 d = tsuya_mat3_apply_transposed(shot.camera_from_world.rotation, ray), eye = tsuya_pose_center(shot.camera_from_world);
                double t = (0.1 - eye.z) / d.z;
                tsuya_studio_dye_at(&weave, eye.x + t * d.x, eye.y + t * d.y, own);
                for (int c = 0; c < 3; c++) {
                    seen[c] += (double)tsuya_image_f32(&radiance, x, y)[c] / 3600.0;
                    dye[c] += (double)own[c] / 3600.0;
                }
            }
        }
        float mean[3] = {(float)dye[0], (float)dye[1], (float)dye[2]};
        tsuya_studio_reflectance(satin, mean, wi, wo, expected);
        print_message("lamp %d: seen %.4f %.4f %.4f, reflectance times cosine %.4f %.4f %.4f\n", k, seen[0], seen[1], seen[2], expected[0] * wi.z, expected[1] * wi.z, expected[2] * wi.z);
        for (int c = 0; c < 3; c++) {
            assert_true(fabs(seen[c] / (expected[c] * wi.z) - 1.0) < 0.02);
        }
        tsuya_image_free(&radiance);
        tsuya_image_free(&coverage);
        tsuya_studio_free(studio);
        tsuya_light_set_free(&lights);
    }
    tsuya_studio_cloth_free(&cloth);
}

/* A plane of colour goes through the mosaic unharmed; so does a grey edge's place. */
static void the_mosaic_keeps_planes(void **state)
{
    (void)state;
    float mosaic[20 * 16], rgb[3];
    for (int i = 0; i < 20 * 16; i++) {
        int x = i % 20, y = i / 20;
        mosaic[i] = 0.1f + 0.01f * (float)x + 0.02f * (float)y;
    }
    for (int y = 2; y < 14; y++) {
        for (int x = 2; x < 18; x++) {
            tsuya_studio_demosaic(rgb, mosaic, 20, 16, x, y);
            for (int c = 0; c < 3; c++) {
                assert_true(fabsf(rgb[c] - mosaic[20 * y + x]) < 1e-6f);
            }
        }
    }
}

static void subdividing_keeps_a_flat_sheet(void **state)
{
    (void)state;
    for (int smooth = 0; smooth < 2; smooth++) {
        tsuya_drape_sheet coarse, fine;
        double area = 0.0;
        assert_ok(tsuya_drape_sheet_grid(&coarse, 0.0, 0.0, 0.1, 4, 3));
        assert_ok(tsuya_drape_sheet_subdivide(&fine, &coarse, smooth));
        assert_int_equal(fine.triangle_count, 4 * coarse.triangle_count);
        assert_int_equal(fine.vertex_count, 9 * 7);
        for (size_t t = 0; t < fine.triangle_count; t++) {
            const double *c = fine.uv + 6 * t;
            area += 0.5 * ((c[2] - c[0]) * (c[5] - c[1]) - (c[4] - c[0]) * (c[3] - c[1]));
            for (size_t i = 0; i < 3 && !smooth; i++) {
                const double *p = fine.position + 3 * fine.triangle[3 * t + i];
                assert_true(fabs(p[0] - c[2 * i]) < 1e-12 && fabs(p[1] - c[2 * i + 1]) < 1e-12 && p[2] == 0.0);
            }
        }
        assert_true(fabs(area - 0.12) < 1e-12);
        tsuya_drape_sheet_free(&coarse);
        tsuya_drape_sheet_free(&fine);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_turntable_turns_about_its_axis), cmocka_unit_test(a_scene_says_what_it_wants),          cmocka_unit_test(a_job_is_left_with_its_truth),
        cmocka_unit_test(board_photographs_agree_with_mrcal),  cmocka_unit_test(far_cloth_has_the_reflectance_of_its_truth),
        cmocka_unit_test(the_mosaic_keeps_planes),             cmocka_unit_test(subdividing_keeps_a_flat_sheet),
    };
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
