/* Lenses: projection against unprojection, their derivative, scaling; camera models as mrcal writes and reads them. */
#include "failures.h"

#include "core/camera.h"
#include "core/process.h"

static uint64_t counter;
static double uniform(double low, double high) { return low + (high - low) * tsuya_random_uniform(11, 0, counter++); }

static const tsuya_lens LENSES[] = {TSUYA_LENS_PINHOLE, TSUYA_LENS_SIMPLE_PINHOLE, TSUYA_LENS_SIMPLE_RADIAL, TSUYA_LENS_RADIAL,
                                    TSUYA_LENS_OPENCV4, TSUYA_LENS_OPENCV5,        TSUYA_LENS_OPENCV8,       TSUYA_LENS_OPENCV12};
enum { LENS_COUNT = sizeof LENSES / sizeof LENSES[0] };

/* A mild lens of a kind: only what the kind has differs from 0. */
static tsuya_camera make(tsuya_lens lens)
{
    static const double k[12] = {0.11, -0.21, 0.0011, -0.0017, 0.04, 0.02, -0.03, 0.01, 0.0009, -0.0008, 0.0007, 0.0006};
    tsuya_camera camera = {.lens = lens, .width_px = 1280, .height_px = 960, .fx_px = 1100, .fy_px = 1107, .cx_px = 633.25, .cy_px = 470.5};
    int used = lens == TSUYA_LENS_SIMPLE_RADIAL ? 1 : lens == TSUYA_LENS_RADIAL ? 2 : lens == TSUYA_LENS_OPENCV4 ? 4
             : lens == TSUYA_LENS_OPENCV5       ? 5 : lens == TSUYA_LENS_OPENCV8 ? 8 : lens == TSUYA_LENS_OPENCV12 ? 12 : 0;
    memcpy(camera.distortion, k, (size_t)used * sizeof *k);
    if (lens == TSUYA_LENS_SIMPLE_PINHOLE || lens == TSUYA_LENS_SIMPLE_RADIAL || lens == TSUYA_LENS_RADIAL) {
        camera.fy_px = camera.fx_px;
    }
    return camera;
}

static void test_projection_by_hand(void **state)
{
    (void)state;
    tsuya_camera camera = make(TSUYA_LENS_PINHOLE);
    tsuya_vec2 pixel;
    assert_true(tsuya_camera_project(&camera, (tsuya_vec3){0.2, -0.1, 2}, &pixel));
    assert_near(pixel.x, 1100 * 0.1 + 633.25, 1e-12);
    assert_near(pixel.y, 1107 * -0.05 + 470.5, 1e-12);
    camera = make(TSUYA_LENS_SIMPLE_RADIAL);
    assert_true(tsuya_camera_project(&camera, (tsuya_vec3){0.3, 0.4, 1}, &pixel));
    assert_near(pixel.x, 1100 * 0.3 * (1 + 0.11 * 0.25) + 633.25, 1e-10);
    assert_false(tsuya_camera_project(&camera, (tsuya_vec3){0, 0, 0}, &pixel));
    assert_false(tsuya_camera_project(&camera, (tsuya_vec3){0, 0, -1}, &pixel));
    assert_false(tsuya_camera_project(&camera, (tsuya_vec3){NAN, 0, 1}, &pixel));
    assert_false(tsuya_camera_project(&camera, (tsuya_vec3){1, 0, 1e-300}, &pixel));
}

static void test_unprojection_undoes_projection(void **state)
{
    (void)state;
    for (int l = 0; l < LENS_COUNT; l++) {
        tsuya_camera camera = make(LENSES[l]);
        for (int i = 0; i < 2000; i++) {
            tsuya_vec3 p = {uniform(-0.6, 0.6), uniform(-0.45, 0.45), 1}, ray;
            p = tsuya_vec3_scale(p, uniform(0.1, 10));
            tsuya_vec2 pixel, again;
            assert_true(tsuya_camera_project(&camera, p, &pixel));
            assert_true(tsuya_camera_unproject(&camera, pixel, &ray));
            assert_near(tsuya_vec3_norm(ray), 1, 1e-14);
            assert_true(tsuya_vec3_norm(tsuya_vec3_sub(ray, tsuya_vec3_unit(p))) < 1e-12);
            assert_true(tsuya_camera_project(&camera, ray, &again));
            assert_near(again.x, pixel.x, 1e-9);
            assert_near(again.y, pixel.y, 1e-9);
        }
    }
}

/* The projection's derivative, by differences, has to be that of the model's formula written down a second time here. */
static void formula(const tsuya_camera *c, double x, double y, double out[2])
{
    const double *k = c->distortion;
    double r2 = x * x + y * y, radial = (1 + k[0] * r2 + k[1] * r2 * r2 + k[4] * r2 * r2 * r2) / (1 + k[5] * r2 + k[6] * r2 * r2 + k[7] * r2 * r2 * r2);
    out[0] = c->fx_px * (x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x) + k[8] * r2 + k[9] * r2 * r2) + c->cx_px;
    out[1] = c->fy_px * (y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y + k[10] * r2 + k[11] * r2 * r2) + c->cy_px;
}

static void test_projection_and_its_gradient(void **state)
{
    (void)state;
    const double h = 1e-6;
    for (int l = 0; l < LENS_COUNT; l++) {
        tsuya_camera camera = make(LENSES[l]);
        for (int i = 0; i < 200; i++) {
            double x = uniform(-0.6, 0.6), y = uniform(-0.45, 0.45), here[2], high[2], low[2];
            tsuya_vec2 pixel, a, b;
            formula(&camera, x, y, here);
            assert_true(tsuya_camera_project(&camera, (tsuya_vec3){x, y, 1}, &pixel));
            assert_near(pixel.x, here[0], 1e-10);
            assert_near(pixel.y, here[1], 1e-10);
            /* A ray that moves by dx in the picture moves the pixel by the inverse of Newton's Jacobian: check through the
             * unprojection, whose steps use that Jacobian. */
            tsuya_vec3 ray_a, ray_b;
            a = (tsuya_vec2){pixel.x + h, pixel.y};
            b = (tsuya_vec2){pixel.x - h, pixel.y};
            assert_true(tsuya_camera_unproject(&camera, a, &ray_a) && tsuya_camera_unproject(&camera, b, &ray_b));
            double dx = (ray_a.x / ray_a.z - ray_b.x / ray_b.z) / (2 * h), dy = (ray_a.y / ray_a.z - ray_b.y / ray_b.z) / (2 * h);
            double step = 1e-5;
            formula(&camera, x + step * dx, y + step * dy, high);
            formula(&camera, x - step * dx, y - step * dy, low);
            assert_near((high[0] - low[0]) / (2 * step), 1, 1e-6);
            assert_near((high[1] - low[1]) / (2 * step), 0, 1e-6);
        }
    }
}

static void test_beyond_the_fold(void **state)
{
    (void)state;
    tsuya_camera camera = make(TSUYA_LENS_SIMPLE_RADIAL);
    tsuya_vec3 ray;
    camera.distortion[0] = -0.3; /* r (1 − 0.3 r²) has its top of 0.7027 at r = 1.054 */
    assert_true(tsuya_camera_unproject(&camera, (tsuya_vec2){camera.cx_px + 0.70 * camera.fx_px, camera.cy_px}, &ray));
    assert_true(ray.x / ray.z < 1.06);
    assert_false(tsuya_camera_unproject(&camera, (tsuya_vec2){camera.cx_px + 0.71 * camera.fx_px, camera.cy_px}, &ray));
    assert_false(tsuya_camera_unproject(&camera, (tsuya_vec2){NAN, 0}, &ray));
}

static void test_scaling_keeps_pixel_centres(void **state)
{
    (void)state;
    tsuya_camera camera = make(TSUYA_LENS_OPENCV8), half = tsuya_camera_scaled(&camera, 640, 480), odd = tsuya_camera_scaled(&camera, 427, 320);
    for (int i = 0; i < 100; i++) {
        tsuya_vec3 p = {uniform(-0.5, 0.5), uniform(-0.4, 0.4), 1};
        tsuya_vec2 a, b, c;
        assert_true(tsuya_camera_project(&camera, p, &a) && tsuya_camera_project(&half, p, &b) && tsuya_camera_project(&odd, p, &c));
        assert_near(b.x + 0.5, (a.x + 0.5) / 2, 1e-10);
        assert_near(b.y + 0.5, (a.y + 0.5) / 2, 1e-10);
        assert_near(c.x + 0.5, (a.x + 0.5) * 427 / 1280, 1e-10);
    }
}

static const tsuya_pose POSE = {{{{0, -1, 0}, {0, 0, -1}, {1, 0, 0}}}, {0.1, -0.2, 0.3}};

static void test_camera_models_round_trip(void **state)
{
    (void)state;
    for (int l = 0; l < LENS_COUNT; l++) {
        tsuya_camera camera = make(LENSES[l]), back;
        tsuya_pose pose;
        assert_ok(tsuya_cameramodel_save(&camera, POSE, test_path("a.cameramodel")));
        assert_ok(tsuya_cameramodel_load(&back, &pose, test_path("a.cameramodel")));
        assert_memory_equal(back.distortion, camera.distortion, sizeof camera.distortion);
        assert_memory_equal(&back.width_px, &camera.width_px, offsetof(tsuya_camera, distortion) - offsetof(tsuya_camera, width_px));
        for (int k = 0; k < 9; k++) {
            assert_near(pose.rotation.e[k / 3][k % 3], POSE.rotation.e[k / 3][k % 3], 1e-15);
        }
        assert_memory_equal(&pose.translation, &POSE.translation, sizeof pose.translation);
    }
}

static tsuya_camera make_splined(void)
{
    tsuya_camera c = {.lens = TSUYA_LENS_SPLINED_STEREOGRAPHIC, .width_px = 1280, .height_px = 960, .fx_px = 601.5, .fy_px = 603.25, .cx_px = 650, .cy_px = 470,
                      .spline = {.nx = 12, .ny = 10, .fov_x_deg = 125}};
    for (int i = 0; i < 2 * 12 * 10; i++) {
        c.spline.point[i] = 0.02 * sin(1.7 * i) + 0.1 / 3.0;
    }
    return c;
}

/* A splined lens comes back from its file to the last digit, rays undo pixels, and Δ is what its weights say. */
static void test_splined(void **state)
{
    (void)state;
    tsuya_camera camera = make_splined(), back;
    tsuya_pose pose;
    assert_ok(tsuya_cameramodel_save(&camera, POSE, test_path("s.cameramodel")));
    assert_ok(tsuya_cameramodel_load(&back, &pose, test_path("s.cameramodel")));
    assert_int_equal(back.lens, camera.lens);
    assert_memory_equal(&back.spline, &camera.spline, sizeof camera.spline);
    for (int k = 0; k < 40; k++) {
        tsuya_vec2 pixel = {100 + 27.0 * k, 80 + 21.0 * k}, again;
        tsuya_vec3 ray;
        assert_true(tsuya_camera_unproject(&camera, pixel, &ray));
        assert_near(tsuya_vec3_norm(ray), 1.0, 1e-12);
        assert_true(tsuya_camera_project(&camera, tsuya_vec3_scale(ray, 3.0), &again));
        assert_near(again.x, pixel.x, 1e-7);
        assert_near(again.y, pixel.y, 1e-7);
        double weight[16], sum = 0.0, x = 0.0;
        int first;
        tsuya_vec2 u = tsuya_stereographic_from_ray(ray);
        tsuya_lens_spline_weights(weight, &first, &camera.spline, u);
        for (int i = 0; i < 16; i++) {
            sum += weight[i];
            x += weight[i] * camera.spline.point[2 * (first + i / 4 * camera.spline.nx + i % 4)];
        }
        assert_near(sum, 1.0, 1e-12);
        assert_near(camera.fx_px * (u.x + x) + camera.cx_px, pixel.x, 1e-7);
    }
    tsuya_vec2 reach = tsuya_lens_spline_reach(&camera.spline), pixel;
    assert_true(tsuya_camera_project(&camera, tsuya_stereographic_ray((tsuya_vec2){0.999 * reach.x, 0}), &pixel));
    assert_false(tsuya_camera_project(&camera, tsuya_stereographic_ray((tsuya_vec2){1.001 * reach.x, 0}), &pixel));
}

/* mrcal's own tool opens our files, and sees the same rays. */
static void test_mrcal_agrees(void **state)
{
    (void)state;
    if (!tsuya_process_available("mrcal-reproject-points")) {
        skip();
    }
    static const tsuya_lens shared[] = {TSUYA_LENS_OPENCV4, TSUYA_LENS_OPENCV12, TSUYA_LENS_SPLINED_STEREOGRAPHIC};
    tsuya_camera plain = {.lens = TSUYA_LENS_PINHOLE, .width_px = 1280, .height_px = 960, .fx_px = 1, .fy_px = 1};
    assert_ok(tsuya_cameramodel_save(&plain, tsuya_pose_identity(), test_path("plain.cameramodel")));
    for (int l = 0; l < 3; l++) {
        tsuya_camera camera = l == 2 ? make_splined() : make(shared[l]);
        char script[4 * TEST_PATH], *output;
        tsuya_process_info info;
        assert_ok(tsuya_cameramodel_save(&camera, POSE, test_path("lens.cameramodel")));
        snprintf(script, sizeof script, "printf '0 0\\n640 480\\n1279 3\\n200.5 900.25\\n' | mrcal-reproject-points --intrinsics-only %s %s",
                 test_path("lens.cameramodel"), test_path("plain.cameramodel"));
        assert_ok(tsuya_process_capture(&output, &info, (const char *[]){"sh", "-c", script, NULL}, NULL));
        if (info.exit_code != 0) {
            fail_msg("mrcal-reproject-points: %s", output);
        }
        static const tsuya_vec2 pixels[] = {{0, 0}, {640, 480}, {1279, 3}, {200.5, 900.25}};
        int found = 0;
        for (char *rest, *line = strtok_r(output, "\n", &rest); line; line = strtok_r(NULL, "\n", &rest)) {
            double x, y;
            tsuya_vec3 ray;
            if (found < 4 && sscanf(line, "%lf %lf", &x, &y) == 2) {
                assert_true(tsuya_camera_unproject(&camera, pixels[found++], &ray));
                assert_near(x, ray.x / ray.z, 1e-5); /* the tool prints six digits */
                assert_near(y, ray.y / ray.z, 1e-5);
            }
        }
        assert_int_equal(found, 4);
        tsuya_free(output);
    }
}

static tsuya_status load_text(const char *text)
{
    tsuya_camera camera;
    tsuya_pose pose;
    test_write(test_path("t.cameramodel"), text, strlen(text));
    return tsuya_cameramodel_load(&camera, &pose, test_path("t.cameramodel"));
}

static void test_what_mrcal_writes(void **state)
{
    (void)state;
    tsuya_camera camera;
    static const char text[] = "# generated by mrcal-calibrate-cameras\n{\n    'lensmodel':  'LENSMODEL_OPENCV4',\n\n    # intrinsics are fx,fy,cx,cy,k1…\n"
                               "    'intrinsics': [ 1761.181055, 1761.250444, 1965.706996, 1087.518797, -0.01266096516, 0.03590794372, -0.0002547045941, 0.0005275929652,],\n"
                               "    'valid_intrinsics_region': [\n    [ 66, 0 ],\n    [ 3999, 0 ],\n    ],\n\n    'rt_cam_ref':  [ 0, 0, 0, 0, 0, 0, ],\n"
                               "    'imagersize': [ 4000, 2200,],\n    'icam_intrinsics': 0,\n    'optimization_inputs': b'Jc5=w\\'\"}{]',\n}\n";
    assert_ok(load_text(text));
    assert_ok(tsuya_cameramodel_load(&camera, NULL, test_path("t.cameramodel")));
    assert_int_equal(camera.lens, TSUYA_LENS_OPENCV4);
    assert_near(camera.distortion[3], 0.0005275929652, 0);
    assert_int_equal(camera.height_px, 2200);
}

static void test_refusals(void **state)
{
    (void)state;
    assert_fails(load_text("{'lensmodel': 'LENSMODEL_CAHVORE', 'intrinsics': [1,1,0,0], 'imagersize': [1,1]}"), "lens model \"LENSMODEL_CAHVORE\"; LENSMODEL_PINHOLE");
    assert_fails(load_text("{'lensmodel': 'LENSMODEL_OPENCV4', 'intrinsics': [1,1,0,0], 'imagersize': [1,1]}"), "8 numbers");
    assert_fails(load_text("{'lensmodel': 'LENSMODEL_SPLINED_STEREOGRAPHIC_order=2_Nx=11_Ny=8_fov_x_deg=200', 'intrinsics': [1,1,0,0], 'imagersize': [1,1]}"), "order=3");
    assert_fails(load_text("{'lensmodel': 'LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=99_Ny=80_fov_x_deg=200', 'intrinsics': [1,1,0,0], 'imagersize': [1,1]}"), "at most 640");
    assert_fails(load_text("{'lensmodel': 'LENSMODEL_SPLINED_STEREOGRAPHIC_order=3_Nx=11_Ny=8_fov_x_deg=200', 'intrinsics': [1,1,0,0], 'imagersize': [1,1]}"), "180 numbers");
    assert_fails(load_text("{'lensmodel': 'LENSMODEL_PINHOLE', 'intrinsics': [0,1,0,0], 'imagersize': [1,1]}"), "positive focal lengths");
    assert_fails(load_text("{'lensmodel': 'LENSMODEL_PINHOLE', 'intrinsics': [1,1,0,0], 'imagersize': [1,0]}"), "imagersize");
    assert_fails(load_text("{'lensmodel': 'LENSMODEL_PINHOLE', 'intrinsics': [1,1,0,0]}"), "imagersize");
    assert_fails(load_text("{'lensmodel': 'LENSMODEL_PINHOLE', 'intrinsics': [1,1,0,0], 'imagersize': [1,1], 'extrinsics': [1]}"), "six numbers");
    assert_fails(load_text("{'lensmodel': 'LENSMODEL_PINHOLE', 'intrinsics': [1,1,nan,0], 'imagersize': [1,1]}"), "line 1: not an mrcal camera model");
    assert_fails(load_text("{'lensmodel': 'LENSMODEL_PINHOLE',"), "truncated");
    assert_fails(load_text("{'lensmodel': 'LENSMODEL"), "line 1");
    assert_fails(load_text("lens"), "'{' is expected");
    char deep[2000] = "{'x': ";
    memset(deep + 6, '[', 1500);
    assert_fails(load_text(deep), "line 1: not an mrcal camera model");
    tsuya_camera camera;
    assert_fails(tsuya_cameramodel_load(&camera, NULL, test_path("none.cameramodel")), "none.cameramodel: cannot read");
}

static tsuya_status load(const char *path)
{
    tsuya_camera camera;
    tsuya_pose pose;
    TSUYA_TRY(tsuya_cameramodel_load(&camera, &pose, path));
    assert_true(camera.fx_px > 0 && isfinite(camera.fx_px) && camera.width_px >= 1);
    return TSUYA_OK;
}

static tsuya_status attempt(void *user)
{
    tsuya_camera camera = make(TSUYA_LENS_OPENCV12);
    TSUYA_TRY(tsuya_cameramodel_save(&camera, POSE, user));
    return load(user);
}

static void test_failing_memory_and_damaged_files(void **state)
{
    (void)state;
    assert_true(test_every_allocation(attempt, (void *)(uintptr_t)test_path("good.cameramodel")) > 3);
    test_damage(load, test_path("damaged.cameramodel"), test_path("good.cameramodel"), 400, 3000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_projection_by_hand),
        cmocka_unit_test(test_unprojection_undoes_projection),
        cmocka_unit_test(test_projection_and_its_gradient),
        cmocka_unit_test(test_beyond_the_fold),
        cmocka_unit_test(test_scaling_keeps_pixel_centres),
        cmocka_unit_test(test_camera_models_round_trip),
        cmocka_unit_test(test_splined),
        cmocka_unit_test(test_mrcal_agrees),
        cmocka_unit_test(test_what_mrcal_writes),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_failing_memory_and_damaged_files),
    };
    int result = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return result;
}
