/* Photographs through lenses that COLMAP lacks, as a pinhole sees them. */
#include "support.h"

#include "core/image.h"
#include "core/memory.h"
#include "lens_scene.h"
#include "reconstruct/pinhole.h"
#include "reconstruct/undistort.h"

#include <math.h>

enum { WIDTH = 480, HEIGHT = 360 };

/* A smooth picture of directions, waves of 12 pixels in the middle. */
static double scene(tsuya_vec3 ray, double focal_px)
{
    double x = ray.x / ray.z * focal_px, y = ray.y / ray.z * focal_px;
    return 0.5 + 0.2 * sin(x * 2.0 * M_PI / 12.0) + 0.2 * cos(y * 2.0 * M_PI / 14.0 + x * 0.1);
}

static tsuya_camera lens_of(int which)
{
    return which == 0 ? lens_thin_prism(WIDTH, HEIGHT, 430) : which == 1 ? lens_splined(WIDTH, HEIGHT, 430, 80) : lens_splined(WIDTH, HEIGHT, 170, 160);
}

static const char *const name[] = {"OPENCV12", "splined", "splined, wide"};

static void draw(tsuya_image *photo, const tsuya_camera *lens)
{
    assert_ok(tsuya_image_create(photo, WIDTH, HEIGHT, 1, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            tsuya_vec3 ray;
            if (tsuya_camera_unproject(lens, (tsuya_vec2){x, y}, &ray) && ray.z > 0.05) {
                *tsuya_image_f32(photo, x, y) = (float)scene(ray, lens->fx_px);
            }
        }
    }
}

/* Every pixel of the pinhole was seen, and shows what lies in its direction; nothing near the middle gets fewer pixels than it had. */
static void directions_stay(void **state)
{
    (void)state;
    for (int k = 0; k < 3; k++) {
        tsuya_camera lens = lens_of(k), pinhole;
        tsuya_pinhole_info info;
        tsuya_image photo, out, linear;
        double squares[2] = {0, 0}, growth;
        tsuya_vec2 pixel;
        assert_true(tsuya_pinhole_needed(&lens));
        assert_ok(tsuya_pinhole_of(&pinhole, &info, &lens, "x.cameramodel"));
        draw(&photo, &lens);
        assert_ok(tsuya_undistort(&out, &photo, &pinhole, &lens, TSUYA_RESAMPLE_LANCZOS, 2));
        assert_ok(tsuya_undistort(&linear, &photo, &pinhole, &lens, TSUYA_RESAMPLE_LINEAR, 1));
        for (int y = 0; y < pinhole.height_px; y++) {
            for (int x = 0; x < pinhole.width_px; x++) {
                tsuya_vec3 ray;
                assert_true(tsuya_camera_unproject(&pinhole, (tsuya_vec2){x, y}, &ray));
                double truth = scene(ray, lens.fx_px);
                squares[0] += pow(*tsuya_image_f32(&out, x, y) - truth, 2);
                squares[1] += pow(*tsuya_image_f32(&linear, x, y) - truth, 2);
            }
        }
        double rms = sqrt(squares[0] / (pinhole.width_px * pinhole.height_px)), rms_linear = sqrt(squares[1] / (pinhole.width_px * pinhole.height_px));
        print_message("%s: %d x %d at %.1f px, %.1f %% kept, stretched by %.2f, closes to %.1e px; resampled within %.4f rms (linear %.4f)\n", name[k],
                      pinhole.width_px, pinhole.height_px, pinhole.fx_px, 100 * info.kept, info.stretch, info.closure_px, rms, rms_linear);
        assert_true(rms < 0.004 && rms < 0.5 * rms_linear);
        assert_true(info.kept > (k < 2 ? 0.8 : 0.6));
        assert_true(info.closure_px < 1e-3);
        assert_true(tsuya_pinhole_pixel(&pixel, &growth, &pinhole, &lens, (tsuya_vec2){lens.cx_px, lens.cy_px}));
        assert_true(growth > 0.98 && growth < 1.1);
        tsuya_image_free(&photo);
        tsuya_image_free(&out);
        tsuya_image_free(&linear);
    }
}

static void sightings_go_along(void **state)
{
    (void)state;
    tsuya_camera lens = lens_of(1), pinhole;
    tsuya_pinhole_info info;
    tsuya_arena *arena;
    tsuya_scale_input out;
    const tsuya_vec3 p = {0.11, -0.07, 0.9};
    tsuya_scale_sighting seen[] = {{"a.png", 0, {0, 0}, 0.1}};
    const tsuya_scale_input in = {.source = "mat.yaml", .sighting = seen, .sighting_count = 1};
    tsuya_vec2 there;
    assert_ok(tsuya_arena_create(&arena, 1 << 12));
    assert_ok(tsuya_pinhole_of(&pinhole, &info, &lens, "x.cameramodel"));
    assert_true(tsuya_camera_project(&lens, p, &seen[0].pixel));
    assert_ok(tsuya_pinhole_sightings(&out, &in, &pinhole, &lens, arena));
    assert_true(tsuya_camera_project(&pinhole, p, &there));
    assert_int_equal(out.sighting_count, 1);
    assert_string_equal(out.source, "mat.yaml");
    assert_near(out.sighting[0].pixel.x, there.x, 1e-6);
    assert_near(out.sighting[0].pixel.y, there.y, 1e-6);
    assert_near(out.sighting[0].sigma_px, 0.1, 0.03);
    tsuya_arena_free(arena);
}

/* Photographs keep their bits, masks stay masks, both their names; the same at any number of threads. */
static void a_set_is_drawn_anew(void **state)
{
    (void)state;
    tsuya_camera lens = lens_of(0), pinhole;
    tsuya_pinhole_info info;
    tsuya_image photo, deep, mask, back[2];
    tsuya_photo_set set;
    tsuya_context context = tsuya_context_default();
    char folder[2][TEST_PATH];
    assert_ok(tsuya_folder_make(test_path("in")));
    assert_ok(tsuya_folder_make(test_path("white")));
    assert_ok(tsuya_pinhole_of(&pinhole, &info, &lens, "x.cameramodel"));
    draw(&photo, &lens);
    assert_ok(tsuya_image_convert(&deep, &photo, TSUYA_SAMPLE_U16, TSUYA_ENCODING_SRGB));
    assert_ok(tsuya_image_save(&deep, test_path("in/a.tif"), NULL));
    assert_ok(tsuya_image_create(&mask, WIDTH, HEIGHT, 1, TSUYA_SAMPLE_U8, TSUYA_ENCODING_DATA));
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = WIDTH / 2; x < WIDTH; x++) {
            *tsuya_image_u8(&mask, x, y) = 255;
        }
    }
    assert_ok(tsuya_image_save(&mask, test_path("white/a.png"), NULL));
    assert_ok(tsuya_photo_set_load(&set, test_path("in"), test_path("white")));
    for (int t = 0; t < 2; t++) {
        char path[TEST_PATH + 32];
        snprintf(folder[t], TEST_PATH, "%s", test_path(t ? "three" : "one"));
        context.threads = 1 + 2 * t;
        assert_ok(tsuya_folder_make(folder[t]));
        assert_ok(tsuya_pinhole_photos(folder[t], &pinhole, &lens, &set, &context));
        snprintf(path, sizeof path, "%s/photos/a.tif", folder[t]);
        assert_ok(tsuya_image_load(&back[t], path));
        assert_int_equal(back[t].sample, TSUYA_SAMPLE_U16);
        assert_int_equal(back[t].width_px, pinhole.width_px);
    }
    assert_memory_equal(back[0].data, back[1].data, back[0].row_bytes * (size_t)back[0].height_px);
    tsuya_image_free(&mask);
    char path[TEST_PATH + 32];
    snprintf(path, sizeof path, "%s/masks/a.tif.png", folder[0]);
    assert_ok(tsuya_image_load(&mask, path));
    for (int y = 5; y < mask.height_px; y += 20) {
        for (int x = 5; x < mask.width_px; x += 7) {
            tsuya_vec3 ray;
            tsuya_vec2 seen;
            assert_true(tsuya_camera_unproject(&pinhole, (tsuya_vec2){x, y}, &ray) && tsuya_camera_project(&lens, ray, &seen));
            if (fabs(seen.x - WIDTH / 2 + 0.5) > 1.0) {
                assert_int_equal(*tsuya_image_u8(&mask, x, y), seen.x > WIDTH / 2 ? 255 : 0);
            }
        }
    }
    for (int t = 0; t < 2; t++) {
        tsuya_image_free(&back[t]);
    }
    tsuya_image_free(&photo);
    tsuya_image_free(&deep);
    tsuya_image_free(&mask);
    tsuya_photo_set_free(&set);
}

static void a_lens_that_sees_nothing_is_refused(void **state)
{
    (void)state;
    tsuya_camera lens = lens_thin_prism(80, 60, 400), pinhole;
    tsuya_pinhole_info info;
    assert_fails(tsuya_pinhole_of(&pinhole, &info, &lens, "small.cameramodel"), "small.cameramodel: the lens images less than 64 pixels");
    lens = lens_thin_prism(WIDTH, HEIGHT, 430);
    lens.cx_px = 3.0 * WIDTH; /* looks past its picture */
    assert_fails(tsuya_pinhole_of(&pinhole, &info, &lens, "aside.cameramodel"), "aside.cameramodel");
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(directions_stay), cmocka_unit_test(sightings_go_along), cmocka_unit_test(a_set_is_drawn_anew),
                                       cmocka_unit_test(a_lens_that_sees_nothing_is_refused)};
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
