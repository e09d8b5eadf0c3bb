/* Sampling of lamps held against their densities by chi-square, the presets, colours of spectra, and thin cloth. */
#include "support.h"

#include "core/color.h"
#include "core/memory.h"
#include "core/table.h"

#include "render/preset.h"
#include "core/spectrum.h"

#include "render_scenes.h"

/* --- chi-square --- */

enum { THETA = 24, PHI = 48, CELLS = THETA * PHI, INNER = 80 };

static int cell_of(tsuya_vec3 d)
{
    int i = (int)((1.0 - d.z) / 2.0 * THETA), j = (int)((atan2(d.y, d.x) + M_PI) / (2.0 * M_PI) * PHI);
    return (i < THETA ? i : THETA - 1) * PHI + (j < PHI ? j : PHI - 1);
}

/* z score of χ² (Wilson and Hilferty 1931), cells of few pooled. */
static double chi_square_z(const double *seen, const double *expected)
{
    double sum = 0.0, few_seen = 0.0, few_expected = 0.0, freedom = -1.0;
    for (int k = 0; k <= CELLS; ++k) {
        double a = k < CELLS ? seen[k] : few_seen, e = k < CELLS ? expected[k] : few_expected;
        if (k < CELLS && e < 10.0) {
            few_seen += a;
            few_expected += e;
        } else if (e > 0.0) {
            sum += (a - e) * (a - e) / e;
            freedom += 1.0;
        }
    }
    double k = fmax(1.0, freedom), v = 2.0 / (9.0 * k);
    return (cbrt(sum / k) - (1.0 - v)) / sqrt(v);
}

/* Draws against ∫ density over equal-area cells; the lamp's own density is integrated finely inside each cell. */
static double lamp_chi_square(const tsuya_light *light, tsuya_vec3 p, tsuya_vec3 n, int draws, uint64_t seed)
{
    double *seen = tsuya_calloc(CELLS, sizeof *seen), *expected = tsuya_calloc(CELLS, sizeof *expected);
    assert_true(seen && expected);
    for (int k = 0; k < draws; ++k) {
        const double u[2] = {tsuya_random_uniform(seed, 1, (uint64_t)k), tsuya_random_uniform(seed, 2, (uint64_t)k)};
        tsuya_light_sample s;
        if (tsuya_light_sample_at(light, p, n, u, &s)) {
            seen[cell_of(s.wi)] += 1.0;
        }
    }
    for (int k = 0; k < CELLS * INNER * INNER; ++k) {
        int cell = k / (INNER * INNER), i = k % INNER, j = k / INNER % INNER;
        double z = 1.0 - 2.0 * (cell / PHI + (i + 0.5) / INNER) / THETA, phi = 2.0 * M_PI * (cell % PHI + (j + 0.5) / INNER) / PHI - M_PI;
        double r = sqrt(fmax(0.0, 1.0 - z * z)), distance, rgb[3], pdf;
        tsuya_vec3 d = {r * cos(phi), r * sin(phi), z};
        if (tsuya_light_hit(light, p, n, d, &distance, rgb, &pdf)) {
            expected[cell] += draws * pdf * 4.0 * M_PI / (CELLS * INNER * INNER);
        }
    }
    double z = chi_square_z(seen, expected);
    tsuya_free(seen);
    tsuya_free(expected);
    return z;
}

static void test_chi_square(void **state)
{
    (void)state;
    enum { W = 48, H = 24 }; /* rows of equal angle; cells of the test cut across them */
    tsuya_image image;
    tsuya_light_set set = {0};
    tsuya_vec3 p = {0.1, 0.2, 0.0}, n = tsuya_vec3_unit((tsuya_vec3){0.3, -0.2, 1.0});
    assert_ok(tsuya_image_create(&image, W, H, 3, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    for (int k = 0; k < W * H; ++k) {
        float *pixel = tsuya_image_f32(&image, k % W, k / W);
        double wave = 1.0 + sin(0.5 * (k % W)) * cos(0.4 * (k / W)) + (k % 97 == 5 ? 20.0 : 0.0);
        pixel[0] = (float)wave;
        pixel[1] = k / W < 4 ? 0.0f : (float)wave;
        pixel[2] = 0.2f;
    }
    tsuya_light map = {.kind = TSUYA_LIGHT_ENVIRONMENT, .rgb = {1, 1, 1}};
    assert_ok(tsuya_environment_create(&map.map, &image, (tsuya_vec3){0.6, 0.8, 0}, (tsuya_vec3){0, 0.1, 1}, "map"));
    add_light(&set, map);
    add_light(&set, (tsuya_light){.kind = TSUYA_LIGHT_ENVIRONMENT, .rgb = {1, 1, 1}});
    add_light(&set, (tsuya_light){.kind = TSUYA_LIGHT_RECT, .position_m = {0.4, 0, 0.8}, .direction = {-0.3, 0.2, -1}, .size_m = {1.4, 0.8}, .rgb = {1, 1, 1}});
    add_light(&set, (tsuya_light){.kind = TSUYA_LIGHT_DISK, .position_m = {-0.4, 0.3, 0.6}, .direction = {0.3, 0.2, -1}, .size_m = {1.2, 1.2}, .rgb = {1, 1, 1}});
    for (int k = 0; k < set.count; ++k) {
        double z = lamp_chi_square(&set.light[k], p, n, 400000, (uint64_t)k + 7);
        if (!(fabs(z) < 4.0)) {
            fail_msg("lamp %d: samples leave their density by z = %.1f", k, z);
        }
    }
    tsuya_image_free(&image);
    tsuya_light_set_free(&set);
}

/* --- spectra --- */

static void test_spectra(void **state)
{
    (void)state;
    tsuya_vec3 white = tsuya_rgb_of_daylight(6504.0);
    assert_true(fabs(white.x - 1.0) < 0.01 && fabs(white.y - 1.0) < 0.01 && fabs(white.z - 1.0) < 0.01);
    assert_true(fabs(tsuya_daylight_power(560.0, 6504.0) - 1.0) < 1e-12 && fabs(tsuya_blackbody_power(560.0, 3000.0) - 1.0) < 1e-12);
    tsuya_lamp_spectrum fire;
    assert_ok(tsuya_lamp_spectrum_load(&fire, "1900K", "."));
    tsuya_vec3 flame = tsuya_lamp_spectrum_rgb(&fire), sky = tsuya_rgb_of_daylight(15000.0);
    assert_true(flame.x > 2.0 * flame.y && flame.z < 0.1 && sky.z > sky.y && sky.y > sky.x);
    const double nm[3] = {400, 550, 700}, one[3] = {1, 1, 1}, red[3] = {0.02, 0.1, 0.7};
    tsuya_vec3 paper = tsuya_rgb_of_reflectance(nm, one, 3), cloth = tsuya_rgb_of_reflectance(nm, red, 3);
    assert_true(tsuya_vec3_norm(tsuya_vec3_sub(paper, (tsuya_vec3){1, 1, 1})) < 1e-9);
    assert_true(cloth.x > cloth.y && cloth.y > cloth.z);
}

/* The fitted observer against the tabulated one: colours of smooth reflectances, and of illuminant A. */
static void test_observer_against_table(void **state)
{
    (void)state;
    const char *path = test_data("spectral/cie1931_2deg_xyz_1nm.csv");
    if (!path) {
        skip();
    }
    tsuya_table table;
    assert_ok(tsuya_table_load(&table, path, NULL));
    double worst = 0.0;
    for (int kind = 0; kind < 24; ++kind) {
        enum { BANDS = 41 };
        double nm[BANDS], r[BANDS];
        for (int k = 0; k < BANDS; ++k) {
            nm[k] = 380.0 + 10.0 * k;
            double edge = 420.0 + 12.0 * kind, slope = kind % 2 ? 15.0 : -15.0;
            r[k] = 0.05 + 0.8 / (1.0 + exp(-(nm[k] - edge) / slope));
        }
        tsuya_vec3 sum = {0, 0, 0}, all = {0, 0, 0}, d65 = tsuya_white_d65();
        for (size_t row = 0; row < table.row_count; ++row) {
            double w = tsuya_table_at(&table, row, 0);
            if (w < 380.0 || w > 780.0) {
                continue;
            }
            int k = (int)fmin((w - 380.0) / 10.0, BANDS - 2);
            double t = (w - nm[k]) / 10.0, power = tsuya_daylight_power(w, 6504.0);
            tsuya_vec3 cmf = {tsuya_table_at(&table, row, 1), tsuya_table_at(&table, row, 2), tsuya_table_at(&table, row, 3)};
            sum = tsuya_vec3_mad(sum, power * ((1.0 - t) * r[k] + t * r[k + 1]), cmf);
            all = tsuya_vec3_mad(all, power, cmf);
        }
        tsuya_vec3 expected = tsuya_rgb_from_xyz((tsuya_vec3){d65.x * sum.x / all.x, d65.y * sum.y / all.y, d65.z * sum.z / all.z});
        worst = fmax(worst, tsuya_color_difference(tsuya_lab_from_rgb(expected), tsuya_lab_from_rgb(tsuya_rgb_of_reflectance(nm, r, BANDS))));
    }
    print_message("fitted observer: at most %.2f ΔE00\n", worst);
    assert_true(worst < 1.6);
    tsuya_table_free(&table);
}

/* --- presets --- */

static double facing_irradiance(const tsuya_light_set *set, tsuya_vec3 p, tsuya_vec3 n, int channel)
{
    double sum = 0.0;
    for (int l = 0; l < set->count; ++l) {
        for (int s = 0; s < 4096; ++s) {
            const double u[2] = {(s % 64 + 0.5) / 64, (s / 64 + 0.5) / 64};
            tsuya_light_sample sample;
            if (tsuya_light_sample_at(&set->light[l], p, n, u, &sample)) {
                sum += sample.rgb[channel] * fmax(0.0, tsuya_vec3_dot(n, sample.wi)) / sample.pdf / 4096;
            }
        }
    }
    return sum;
}

static void test_presets(void **state)
{
    (void)state;
    const tsuya_vec3 center = {1, 2, 3}, up = {0, 0, 1};
    tsuya_light_set day, fire, later, other;
    assert_true(tsuya_light_preset_find("torch") == TSUYA_PRESET_TORCH && tsuya_light_preset_find("lights.json") == TSUYA_PRESET_NONE);
    assert_ok(tsuya_light_set_preset(&day, TSUYA_PRESET_DAYLIGHT, center, 0.7, up, 1, 0));
    double luminance = 0.0;
    const double weight[3] = {0.2126, 0.7152, 0.0722};
    for (int c = 0; c < 3; ++c) {
        luminance += weight[c] * facing_irradiance(&day, center, up, c);
    }
    assert_true(fabs(luminance - (500.0 * sin(tsuya_rad_from_deg(42.0)) + 100.0)) < 4.0); /* what the header says falls on the ground */
    assert_true(facing_irradiance(&day, center, (tsuya_vec3){0, 0, -1}, 1) > 50.0);       /* the floor sends some back */
    assert_ok(tsuya_light_set_preset(&fire, TSUYA_PRESET_TORCH, center, 0.7, up, 1, 0));
    assert_ok(tsuya_light_set_preset(&later, TSUYA_PRESET_TORCH, center, 0.7, up, 1, 6));
    assert_ok(tsuya_light_set_preset(&other, TSUYA_PRESET_TORCH, center, 0.7, up, 2, 6));
    tsuya_vec3 front = {0, -1, 0};
    double now = facing_irradiance(&fire, center, front, 1), then = facing_irradiance(&later, center, front, 1);
    assert_true(now != then && then != facing_irradiance(&other, center, front, 1)); /* flickers in time, and by the seed */
    assert_true(fmax(now, then) < 2.5 * fmin(now, then) && facing_irradiance(&fire, center, front, 0) > 2.0 * now);
    tsuya_light_set_free(&later);
    assert_ok(tsuya_light_set_preset(&later, TSUYA_PRESET_TORCH, center, 0.7, up, 1, 0));
    assert_true(facing_irradiance(&later, center, front, 1) == now);
    tsuya_light_set_free(&day);
    tsuya_light_set_free(&fire);
    tsuya_light_set_free(&later);
    tsuya_light_set_free(&other);
}

/* --- thin cloth --- */

static tsuya_film render_thin(const tsuya_mesh *mesh, tsuya_shader shader, double through, const tsuya_light_set *lights,
                              tsuya_vec3 eye, double field_deg, int size, tsuya_path_options options)
{
    tsuya_camera camera;
    tsuya_pose pose;
    for (int c = 0; c < 3; ++c) {
        shader.transmittance[c] = through;
    }
    scene_camera(&camera, &pose, eye, (tsuya_vec3){0, 0, 0}, field_deg, size, size);
    return scene_render(mesh, &shader, lights, &camera, pose, &options, 2);
}

/* A lamp behind the cloth: τ E / π comes through, whatever the viewer's direction; nothing through opaque cloth. */
static void test_light_comes_through(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_light_set lights = {0};
    tsuya_path_options options = tsuya_path_options_default();
    tsuya_vec3 to_lamp = tsuya_vec3_unit((tsuya_vec3){0.3, 0.4, -1.0});
    options.spp = 1024;
    options.bounces = 1;
    scene_plane(&mesh, 4.0, 4);
    add_light(&lights, (tsuya_light){.kind = TSUYA_LIGHT_DIRECTIONAL, .direction = tsuya_vec3_scale(to_lamp, -1.0), .rgb = {2, 2, 2}});
    for (int k = 0; k < 2; ++k) {
        tsuya_film film = render_thin(&mesh, lambert(0.5), 0.3, &lights, k ? (tsuya_vec3){0.1, 0.2, 3} : (tsuya_vec3){3, 0, 0.6}, 0.05, 4, options);
        double expected = 0.3 / M_PI * 2.0 * -to_lamp.z;
        assert_true(fabs(film_mean(&film, 0) - expected) < 2e-2 * expected);
        tsuya_film_free(&film);
    }
    tsuya_film film = render_thin(&mesh, lambert(0.5), 0.0, &lights, (tsuya_vec3){0.1, 0.2, 3}, 0.05, 4, options);
    assert_true(film_mean(&film, 0) == 0.0);
    tsuya_film_free(&film);
    tsuya_light_set_free(&lights);
    tsuya_mesh_free(&mesh);
}

/* Cloth that reflects 0.6 and lets 0.4 through disappears in an even sky, from outside and from inside. */
static void test_thin_furnace(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_light_set lights = {0};
    tsuya_path_options options = tsuya_path_options_default();
    options.spp = 1024;
    options.bounces = 64;
    scene_sphere(&mesh, 1.0, 48, false);
    add_light(&lights, (tsuya_light){.kind = TSUYA_LIGHT_ENVIRONMENT, .rgb = {1, 1, 1}});
    tsuya_film film = render_thin(&mesh, lambert(0.6), 0.4, &lights, (tsuya_vec3){5, 1, 2}, 26.0, 16, options);
    double mean = film_mean(&film, 0), error = film_mean_error(&film);
    assert_true(mean < 1.0 + 1e-3 + 3.0 * error && mean > 1.0 - 2e-3 - 3.0 * error && error < 4e-3);
    tsuya_film_free(&film);
    tsuya_light_set_free(&lights);
    tsuya_mesh_free(&mesh);
}

static void test_thin_strategies_agree(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_light_set lights = {0};
    double mean[3], error[3];
    scene_drape(&mesh, 30);
    add_light(&lights, (tsuya_light){.kind = TSUYA_LIGHT_RECT, .position_m = {-2, 0, 1}, .direction = {2, 0, -1}, .size_m = {1, 1}, .rgb = {4, 4, 4}});
    add_light(&lights, (tsuya_light){.kind = TSUYA_LIGHT_ENVIRONMENT, .rgb = {0.2, 0.2, 0.2}});
    for (int k = 0; k < 3; ++k) {
        tsuya_path_options options = tsuya_path_options_default();
        options.spp = 512;
        options.bounces = 3;
        options.strategy = (tsuya_strategy)k;
        tsuya_film film = render_thin(&mesh, lambert(0.4), 0.3, &lights, (tsuya_vec3){3, 0.5, 1}, 30.0, 20, options);
        mean[k] = film_mean(&film, 0);
        error[k] = film_mean_error(&film);
        tsuya_film_free(&film);
    }
    for (int k = 1; k < 3; ++k) {
        assert_true(fabs(mean[0] - mean[k]) <= 3.0 * hypot(error[0], error[k]));
    }
    tsuya_light_set_free(&lights);
    tsuya_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_chi_square),          cmocka_unit_test(test_spectra),     cmocka_unit_test(test_observer_against_table),
        cmocka_unit_test(test_presets),             cmocka_unit_test(test_light_comes_through),
        cmocka_unit_test(test_thin_furnace),        cmocka_unit_test(test_thin_strategies_agree),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
