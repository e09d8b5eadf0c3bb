/* The studio's truth against other ways to the same numbers. */
#include "support.h"

#include "capture/studio.h"
#include "capture/studio_sensor.h"
#include "capture/studio_spread.h"
#include "core/photo.h"
#include "core/raster.h"

#include <math.h>

static tsuya_studio_drape small_drape(void)
{
    tsuya_studio_drape drape = tsuya_studio_drape_default();
    drape.spacing_m = 0.003;
    return drape;
}

static tsuya_vec3 vector_at(const float *v, size_t i) { return (tsuya_vec3){v[3 * i], v[3 * i + 1], v[3 * i + 2]}; }

/* The weft against the mesh's own edges along u, which know nothing of the closed form's derivative. */
static void weft_runs_along_the_rows(void **state)
{
    (void)state;
    tsuya_studio_drape drape = tsuya_studio_drape_default();
    tsuya_studio_cloth cloth;
    assert_ok(tsuya_studio_drape_create(&cloth, &drape));
    size_t row = (size_t)ceil(drape.side_m / drape.spacing_m) + 1, worse = 0;
    for (size_t j = 0; j < row; j++) {
        for (size_t i = 1; i + 1 < row; i++) {
            size_t v = j * row + i;
            tsuya_vec3 along = tsuya_vec3_unit(tsuya_vec3_sub(tsuya_mesh_position(&cloth.mesh, v + 1), tsuya_mesh_position(&cloth.mesh, v - 1)));
            tsuya_vec3 weft = vector_at(cloth.mesh.weft, v), normal = vector_at(cloth.mesh.normal, v);
            assert_true(fabs(tsuya_vec3_norm(weft) - 1.0) < 1e-5);
            assert_true(fabs(tsuya_vec3_dot(weft, normal)) < 1e-5);
            worse += tsuya_vec3_dot(along, weft) < cos(tsuya_rad_from_deg(1.0));
        }
    }
    assert_true(worse < row * row / 200); /* the folds' tightest bends */
    tsuya_studio_cloth_free(&cloth);
}

/* Folds make room: lengths of the flat cloth are roughly kept. */
static void lengths_are_roughly_kept(void **state)
{
    (void)state;
    tsuya_studio_drape drape = small_drape();
    tsuya_studio_cloth cloth;
    assert_ok(tsuya_studio_drape_create(&cloth, &drape));
    double flat = drape.side_m * drape.side_m, area = tsuya_mesh_area(&cloth.mesh);
    tsuya_vec3 low, high;
    tsuya_mesh_bounds(&cloth.mesh, &low, &high);
    print_message("area %.3f of the flat cloth, height %.3f to %.3f m\n", area / flat, low.z, high.z);
    assert_true(area / flat > 0.75 && area / flat < 1.1);
    assert_true(low.z > 0.0 && fabs(high.z - drape.stand_height_m) < 1e-6);
    tsuya_studio_cloth_free(&cloth);
}

typedef struct small_studio {
    tsuya_studio_cloth cloth;
    tsuya_studio_weave weave;
    tsuya_light_set lights;
    tsuya_studio *studio;
    tsuya_studio_prop floor;
    tsuya_studio_shot shot;
} small_studio;

static void open_studio(small_studio *s, int threads)
{
    tsuya_studio_drape drape = small_drape();
    tsuya_studio_options options = {.samples = 9, .prop = &s->floor, .prop_count = 1};
    tsuya_context context = tsuya_context_default();
    context.threads = threads;
    *s = (small_studio){.weave = tsuya_studio_weave_default()};
    assert_ok(tsuya_studio_drape_create(&s->cloth, &drape));
    assert_ok(tsuya_light_set_parse(&s->lights,
                                    "{\"lights\": [{\"type\": \"point\", \"position_m\": [0.3, 0.1, 0.8], \"rgb\": [1, 1, 1]},"
                                    "{\"type\": \"environment\", \"rgb\": [0.3, 0.3, 0.3]}]}",
                                    "lights", "."));
    assert_ok(tsuya_studio_prop_floor(&s->floor, (tsuya_vec3){0, 0, 0}));
    assert_ok(tsuya_studio_create(&s->studio, &s->cloth, &s->weave, &s->lights, &options, &context));
    s->shot.camera = (tsuya_camera){.lens = TSUYA_LENS_PINHOLE, .width_px = 240, .height_px = 180, .fx_px = 300, .fy_px = 300, .cx_px = 119.5, .cy_px = 89.5};
    s->shot.camera_from_world = tsuya_pose_look_at((tsuya_vec3){0.4, 0.1, 0.3}, (tsuya_vec3){0, 0, 0.07}, (tsuya_vec3){0, 0, 1});
}

static void close_studio(small_studio *s)
{
    tsuya_studio_free(s->studio);
    tsuya_studio_cloth_free(&s->cloth);
    tsuya_studio_prop_free(&s->floor);
    tsuya_light_set_free(&s->lights);
}

static void photographs_cover_what_a_rasteriser_covers(void **state)
{
    (void)state;
    small_studio s;
    tsuya_context context = tsuya_context_default();
    tsuya_image radiance, coverage;
    tsuya_raster raster;
    open_studio(&s, 2);
    s.shot.spp = 16;
    assert_ok(tsuya_studio_shoot(&radiance, &coverage, s.studio, &s.shot, &context));
    assert_ok(tsuya_raster_create(&raster, s.shot.camera.width_px, s.shot.camera.height_px));
    assert_ok(tsuya_raster_draw(&raster, &s.cloth.mesh, &s.shot.camera, s.shot.camera_from_world, &context));
    int both = 0, either = 0;
    for (int y = 0; y < s.shot.camera.height_px; y++) {
        for (int x = 0; x < s.shot.camera.width_px; x++) {
            bool a = *tsuya_image_u8(&coverage, x, y) > 127, b = raster.depth[y * s.shot.camera.width_px + x] > 0.0f;
            both += a && b;
            either += a || b;
        }
    }
    assert_true(both > 5000 && (double)both / either > 0.985);
    tsuya_raster_free(&raster);
    tsuya_image_free(&radiance);
    tsuya_image_free(&coverage);
    close_studio(&s);
}

/* A vertex in full view: its radiance is albedo · irradiance / π with the lamp's inverse square and cosine, thread by thread
 * apart; so the mean over a patch of one ground colour is compared. */
static void the_top_is_as_bright_as_the_lamp_makes_it(void **state)
{
    (void)state;
    small_studio s;
    open_studio(&s, 2);
    double white = tsuya_studio_white(s.studio, 1.0);
    tsuya_vec3 lamp = {0.3, 0.1, 0.8}, top = {0.05, 0.0, 0.15};
    tsuya_vec3 d = tsuya_vec3_sub(lamp, top);
    double expected = (d.z / tsuya_vec3_norm(d) / tsuya_vec3_dot(d, d) + M_PI * 0.3) / M_PI;
    print_message("white %.3f, expected about %.3f\n", white, expected);
    assert_true(fabs(white / expected - 1.0) < 0.15);
    close_studio(&s);
}

static void threads_do_not_matter(void **state)
{
    (void)state;
    tsuya_image radiance[2], coverage[2];
    for (int k = 0; k < 2; k++) {
        small_studio s;
        tsuya_context context = tsuya_context_default();
        context.threads = k ? 4 : 1;
        open_studio(&s, context.threads);
        s.shot.spp = 4;
        assert_ok(tsuya_studio_shoot(&radiance[k], &coverage[k], s.studio, &s.shot, &context));
        close_studio(&s);
    }
    for (int y = 0; y < radiance[0].height_px; y++) {
        assert_memory_equal(tsuya_image_f32(&radiance[0], 0, y), tsuya_image_f32(&radiance[1], 0, y), (size_t)radiance[0].width_px * 12);
    }
    for (int k = 0; k < 2; k++) {
        tsuya_image_free(&radiance[k]);
        tsuya_image_free(&coverage[k]);
    }
}

/* Variance against signal: photons (∝ signal), reading, and the rounding to 8 bits of the curve's local step. */
static void noise_lies_on_the_photon_transfer_line(void **state)
{
    (void)state;
    tsuya_studio_sensor sensor = tsuya_studio_sensor_default();
    sensor.full_well_e = 3000.0;
    sensor.read_noise_e = 6.0;
    tsuya_context context = tsuya_context_default();
    static const float signal[] = {0.02f, 0.05f, 0.1f, 0.2f, 0.4f, 0.7f};
    for (size_t i = 0; i < sizeof signal / sizeof signal[0]; i++) {
        tsuya_image radiance, photograph;
        assert_ok(tsuya_image_create(&radiance, 256, 256, 3, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
        for (int y = 0; y < 256; y++) {
            for (int x = 0; x < 256 * 3; x++) {
                tsuya_image_f32(&radiance, 0, y)[x] = signal[i];
            }
        }
        assert_ok(tsuya_studio_develop(&photograph, &radiance, &sensor, 9, &context));
        double sum = 0.0, squares = 0.0, n = 256.0 * 256.0 * 3.0;
        for (int y = 0; y < 256; y++) {
            for (int x = 0; x < 256 * 3; x++) {
                double v = (double)tsuya_srgb_decode((float)tsuya_image_u8(&photograph, 0, y)[x] / 255.0f);
                sum += v;
                squares += v * v;
            }
        }
        double mean = sum / n, variance = squares / n - mean * mean;
        double code = (double)tsuya_srgb_encode(signal[i]);
        double step = (double)(tsuya_srgb_decode((float)code + 0.5f / 255.0f) - tsuya_srgb_decode((float)code - 0.5f / 255.0f));
        double expected = ((double)signal[i] * 3000.0 + 36.0) / (3000.0 * 3000.0) + step * step / 12.0;
        if (fabs(variance / expected - 1.0) > 0.04 || fabs(mean / (double)signal[i] - 1.0) > 0.01) {
            fail_msg("signal %.2f: mean %.4f, variance %.3e, expected %.3e", (double)signal[i], mean, variance, expected);
        }
        tsuya_image_free(&radiance);
        tsuya_image_free(&photograph);
    }
}

/* Behind the colour filters, in 16 bits: each channel at its own pixels, which the interpolation leaves as they are. */
static void the_mosaic_lies_on_the_photon_transfer_line(void **state)
{
    (void)state;
    tsuya_studio_sensor sensor = {.full_radiance = 2.0, .full_well_e = 20000.0, .read_noise_e = 8.0, .bayer = true, .deep = true};
    tsuya_context context = tsuya_context_default();
    static const double signal[] = {0.01, 0.04, 0.15, 0.5, 0.8};
    for (size_t i = 0; i < sizeof signal / sizeof signal[0]; i++) {
        tsuya_image radiance, photograph;
        double sum[3] = {0}, squares[3] = {0}, n[3] = {0};
        assert_ok(tsuya_image_create(&radiance, 512, 512, 3, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
        for (int k = 0; k < 512 * 512 * 3; k++) { /* rows follow each other */
            tsuya_image_f32(&radiance, k / 3 % 512, k / 3 / 512)[k % 3] = (float)(2.0 * signal[i] * (1.0 - 0.2 * (k % 3)));
        }
        assert_ok(tsuya_studio_develop(&photograph, &radiance, &sensor, 4, &context));
        assert_int_equal(photograph.sample, TSUYA_SAMPLE_U16);
        for (int k = 0; k < 512 * 512; k++) {
            int x = k % 512, y = k / 512, c = tsuya_studio_bayer_channel(x, y);
            double v = (double)tsuya_srgb_decode((float)tsuya_image_u16(&photograph, x, y)[c] / 65535.0f);
            sum[c] += v;
            squares[c] += v * v;
            n[c] += 1.0;
        }
        for (int c = 0; c < 3; c++) {
            double own = signal[i] * (1.0 - 0.2 * c), mean = sum[c] / n[c], variance = squares[c] / n[c] - mean * mean;
            double expected = (own * 20000.0 + 64.0) / (20000.0 * 20000.0);
            if (fabs(variance / expected - 1.0) > 0.03 || fabs(mean / own - 1.0) > 0.003) {
                fail_msg("signal %.2f, channel %d: mean %.5f, variance %.3e, expected %.5f and %.3e", signal[i], c, mean, variance, own, expected);
            }
        }
        tsuya_image_free(&radiance);
        tsuya_image_free(&photograph);
    }
}

/* A pixel's width and a Gaussian, in cells: the variance of both, evenly on either side, and what lies within half a pixel by the integral. */
static void a_pixel_sees_its_width_and_the_blur(void **state)
{
    (void)state;
    static const double sigma[] = {0.0, 0.3, 0.6, 2.0}, within[] = {1.0, 0.760702, 0.545061, 0.195417};
    static const int side[] = {1, 2, 3, 8};
    for (int k = 0; k < 16; k++) {
        tsuya_studio_spread s;
        const int n = side[k / 4];
        double sum = 0.0, mean = 0.0, squares = 0.0, near = 0.0;
        assert_ok(tsuya_studio_spread_create(&s, sigma[k % 4], n));
        assert_int_equal(s.count, (2 * s.reach + 1) * n);
        for (int i = 0; i < s.count; i++) {
            const double x = -0.5 - s.reach + (i + 0.5) / n;
            assert_true(s.weight[i] >= 0.0);
            sum += s.weight[i];
            mean += s.weight[i] * x;
            squares += s.weight[i] * (x * x + 1.0 / (12.0 * n * n));
            near += fabs(x) < 0.5 ? s.weight[i] : 0.0;
        }
        print_message("blur %.1f px, %d cells: variance %.4f px2, %.4f within the pixel\n", sigma[k % 4], n, squares, near);
        assert_near(sum, 1.0, 1e-12);
        assert_near(mean, 0.0, 1e-12);
        assert_true(fabs(squares / (1.0 / 12.0 + sigma[k % 4] * sigma[k % 4]) - 1.0) < 0.002);
        assert_true(fabs(near - within[k % 4]) < 0.16 / n);
        tsuya_studio_spread_free(&s);
    }
}

/* Means of a print over boxes of any size against the mean of 400 x 400 points, on tags, gaps, paper and beyond the plate. */
static void print_is_the_mean_of_its_points(void **state)
{
    (void)state;
    enum { BOXES = 40, FINE = 400 };
    const tsuya_studio_grid grid = {"tag36h11", 1, 3, 2, 7, 30, 9};
    for (int k = 0; k < 2; k++) {
        tsuya_studio_prop prop;
        assert_ok(k == 0 ? tsuya_studio_prop_tags(&prop, tsuya_pose_identity(), &grid) : tsuya_studio_prop_chart(&prop, tsuya_pose_identity()));
        for (int i = 0; i < BOXES; i++) {
            uint64_t n = 5 * (uint64_t)i;
            const double none[2] = {0, 0}, size = i % 4 == 3 ? 0.08 : 0.006, spread[2] = {size * tsuya_random_uniform(3, 1, n), size * tsuya_random_uniform(3, 1, n + 1)};
            const tsuya_vec3 p = {0.15 * tsuya_random_uniform(3, 1, n + 2) - 0.02, 0.1 * tsuya_random_uniform(3, 1, n + 3) - 0.02, 0.0};
            double want[3] = {0};
            float got[3], point[3];
            for (int j = 0; j < FINE * FINE; j++) {
                const tsuya_vec3 at = {p.x + ((j % FINE + 0.5) / FINE - 0.5) * spread[0], p.y + ((j / FINE + 0.5) / FINE - 0.5) * spread[1], 0.0};
                tsuya_studio_print_at(prop.print, at, none, point);
                for (int c = 0; c < 3; c++) {
                    want[c] += (double)point[c] / (FINE * FINE);
                }
            }
            tsuya_studio_print_at(prop.print, p, spread, got);
            for (int c = 0; c < 3; c++) {
                assert_near((double)got[c], want[c], 0.004);
            }
        }
        tsuya_studio_prop_free(&prop);
    }
}

static void exif_reads_back(void **state)
{
    (void)state;
    tsuya_image image, back;
    tsuya_photo photo;
    tsuya_studio_exif exif = {.make = "maker", .model = "a model", .taken = "2026:01:02 03:04:05", .focal_mm = 31.25, .exposure_s = 0.0125,
                              .f_number = 5.6, .focal_35mm = 47, .iso = 400};
    assert_ok(tsuya_image_create(&image, 64, 48, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    memset(image.data, 120, image.row_bytes * 48);
    assert_ok(tsuya_studio_save_jpeg(&image, test_path("exif.jpg"), 95, &exif));
    assert_ok(tsuya_photo_load(&photo, test_path("exif.jpg")));
    assert_string_equal(photo.make, "maker");
    assert_string_equal(photo.model, "a model");
    assert_string_equal(photo.taken, "2026:01:02 03:04:05");
    assert_true(fabs(photo.focal_mm - 31.25) < 1e-3 && photo.focal_35mm == 47.0 && photo.iso == 400.0);
    assert_true(fabs(photo.exposure_s - 0.0125) < 1e-6 && fabs(photo.f_number - 5.6) < 1e-3);
    assert_ok(tsuya_image_load(&back, test_path("exif.jpg")));
    assert_int_equal(back.width_px, 64);
    assert_in_range(*tsuya_image_u8(&back, 10, 10), 118, 122);
    tsuya_photo_free(&photo);
    tsuya_image_free(&image);
    tsuya_image_free(&back);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(weft_runs_along_the_rows),
        cmocka_unit_test(lengths_are_roughly_kept),
        cmocka_unit_test(photographs_cover_what_a_rasteriser_covers),
        cmocka_unit_test(the_top_is_as_bright_as_the_lamp_makes_it),
        cmocka_unit_test(threads_do_not_matter),
        cmocka_unit_test(noise_lies_on_the_photon_transfer_line),
        cmocka_unit_test(the_mosaic_lies_on_the_photon_transfer_line),
        cmocka_unit_test(a_pixel_sees_its_width_and_the_blur),
        cmocka_unit_test(print_is_the_mean_of_its_points),
        cmocka_unit_test(exif_reads_back),
    };
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
