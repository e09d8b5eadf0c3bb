/* Light transport against closed forms, strategies against each other, and what normals and weft do. */
#include "support.h"

#include "core/memory.h"

#include "render_scenes.h"

#include "render/trace.h"

/* Radiance of a Lambert plane of reflectance 0.5 around the origin, seen at a slant, under one lamp. */
static double plane_radiance(tsuya_light light, int spp)
{
    tsuya_mesh mesh;
    tsuya_light_set lights = {0};
    tsuya_camera camera;
    tsuya_pose pose;
    tsuya_shader shader = lambert(0.5);
    tsuya_path_options options = options_of(spp, 3);
    scene_plane(&mesh, 4.0, 4);
    add_light(&lights, light);
    scene_camera(&camera, &pose, (tsuya_vec3){2.0, -1.0, 1.5}, (tsuya_vec3){0, 0, 0}, 0.05, 4, 4);
    tsuya_film film = scene_render(&mesh, &shader, &lights, &camera, pose, &options, 2);
    double mean = film_mean(&film, 1);
    assert_true(film_mean(&film, 0) == mean && film.alpha[0] == 1.0f);
    tsuya_film_free(&film);
    tsuya_light_set_free(&lights);
    tsuya_mesh_free(&mesh);
    return mean;
}

static void check_irradiance(tsuya_light light, double irradiance, int spp, double tolerance)
{
    double seen = plane_radiance(light, spp), expected = 0.5 / M_PI * irradiance;
    if (!(fabs(seen - expected) <= tolerance * expected)) {
        fail_msg("lamp %d: radiance %.6g, closed form %.6g", light.kind, seen, expected);
    }
}

static void test_small_lamps(void **state)
{
    (void)state;
    tsuya_light lamp = {.kind = TSUYA_LIGHT_POINT, .position_m = {0.6, 0.0, 0.8}, .rgb = {3, 3, 3}};
    check_irradiance(lamp, 3.0 * 0.8, 4, 1e-3);
    lamp.kind = TSUYA_LIGHT_SPOT;
    lamp.direction = (tsuya_vec3){-0.6, 0.0, -0.8};
    lamp.cone_rad[0] = 0.2;
    lamp.cone_rad[1] = 0.3;
    check_irradiance(lamp, 3.0 * 0.8, 4, 1e-3);
    lamp.direction = (tsuya_vec3){0.8, 0.0, -0.6}; /* 90° beside */
    assert_true(plane_radiance(lamp, 4) == 0.0);
    lamp = (tsuya_light){.kind = TSUYA_LIGHT_DIRECTIONAL, .direction = {0, -2, -2}, .rgb = {5, 5, 5}};
    check_irradiance(lamp, 5.0 * M_SQRT1_2, 4, 1e-4);
}

static void test_area_lamps(void **state)
{
    (void)state;
    double r = 0.7, h = 0.9;
    tsuya_light disk = {.kind = TSUYA_LIGHT_DISK, .position_m = {0, 0, h}, .direction = {0, 0, -1}, .size_m = {2 * r, 2 * r}, .rgb = {2, 2, 2}};
    check_irradiance(disk, M_PI * 2.0 * r * r / (r * r + h * h), 4096, 2e-3);
    /* four rectangles with a corner over the point (Howell, configuration factor B-3) */
    double a = 0.5, b = 0.3, x = a / h, y = b / h, sx = sqrt(1 + x * x), sy = sqrt(1 + y * y);
    double factor = 4.0 / (2.0 * M_PI) * (x / sx * atan(y / sx) + y / sy * atan(x / sy));
    tsuya_light rect = {.kind = TSUYA_LIGHT_RECT, .position_m = {0, 0, h}, .direction = {0, 0, -1}, .up = {0, 1, 0}, .size_m = {2 * a, 2 * b},
                        .rgb = {2, 2, 2}};
    check_irradiance(rect, M_PI * 2.0 * factor, 4096, 2e-3);
    rect.up = (tsuya_vec3){1, 0, 0};
    rect.size_m[0] = 2 * b;
    rect.size_m[1] = 2 * a;
    check_irradiance(rect, M_PI * 2.0 * factor, 4096, 2e-3);
    tsuya_light away = rect;
    away.direction = (tsuya_vec3){0, 0, 1};
    assert_true(plane_radiance(away, 64) == 0.0);
    tsuya_light edge_on = disk; /* in the surface's plane: finite, and nothing from it */
    edge_on.position_m = (tsuya_vec3){0.8, 0, 0};
    double seen = plane_radiance(edge_on, 256);
    assert_true(isfinite(seen) && seen == 0.0);
    edge_on.direction = (tsuya_vec3){-1, 0, 0}; /* half of it under the surface: the half above shines */
    seen = plane_radiance(edge_on, 4096);
    assert_true(isfinite(seen) && seen > 0.0);
}

static void test_environments(void **state)
{
    (void)state;
    tsuya_light sky = {.kind = TSUYA_LIGHT_ENVIRONMENT, .rgb = {1.5, 1.5, 1.5}};
    check_irradiance(sky, M_PI * 1.5, 1024, 1e-3);
    /* upper half bright, lower half dark, and a bright window: irradiance by the pixels' own solid angles */
    tsuya_image image;
    enum { W = 32, H = 16 };
    double expected = 0.0;
    assert_ok(tsuya_image_create(&image, W, H, 3, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    for (int k = 0; k < W * H; ++k) {
        int row = k / W, column = k % W;
        float value = row < H / 2 ? 1.0f : 0.0f;
        value = row == 3 && column == 5 ? 500.0f : value;
        double z0 = cos(M_PI * row / H), z1 = cos(M_PI * (row + 1) / H);
        expected += row < H / 2 ? value * M_PI / W * (z0 * z0 - z1 * z1) : 0.0;
        for (int c = 0; c < 3; ++c) {
            tsuya_image_f32(&image, column, row)[c] = value;
        }
    }
    tsuya_light map = {.kind = TSUYA_LIGHT_ENVIRONMENT, .rgb = {1, 1, 1}};
    assert_ok(tsuya_environment_create(&map.map, &image, (tsuya_vec3){1, 0, 0}, (tsuya_vec3){0, 0, 1}, "map"));
    check_irradiance(map, expected, 4096, 3e-3);
    tsuya_image_free(&image);
}

/* The map as a picture of itself: centre column ahead, right of it to the right, top row up. */
static void test_environment_orientation(void **state)
{
    (void)state;
    tsuya_image image;
    tsuya_environment *e;
    enum { W = 8, H = 4 };
    assert_ok(tsuya_image_create(&image, W, H, 3, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    for (int k = 0; k < W * H; ++k) {
        float *pixel = tsuya_image_f32(&image, k % W, k / W);
        pixel[0] = (float)(k % W) + 1.0f;
        pixel[1] = (float)(k / W) + 1.0f;
    }
    assert_ok(tsuya_environment_create(&e, &image, (tsuya_vec3){1, 0, 0}, (tsuya_vec3){0, 0, 1}, "map"));
    double rgb[3];
    tsuya_environment_radiance(e, tsuya_vec3_unit((tsuya_vec3){1, -0.1, 0.1}), rgb); /* slightly right, slightly up */
    assert_true(rgb[0] == W / 2 + 1 && rgb[1] == H / 2);
    tsuya_environment_radiance(e, tsuya_vec3_unit((tsuya_vec3){0.1, -1, 0.01}), rgb); /* 90° right */
    assert_true(rgb[0] == 6.0);
    tsuya_environment_radiance(e, tsuya_vec3_unit((tsuya_vec3){0.1, 0.3, 1}), rgb);
    assert_true(rgb[1] == 1.0);
    for (int k = 0; k < 10000; ++k) { /* a sample has the density that is said of it */
        const double u[2] = {fmod(0.5 + 0.7548776662466927 * k, 1.0), fmod(0.5 + 0.5698402909980532 * k, 1.0)};
        tsuya_vec3 d = tsuya_environment_sample(e, u);
        assert_true(fabs(tsuya_vec3_norm(d) - 1.0) < 1e-9 && tsuya_environment_pdf(e, d) > 0.0);
    }
    double total = 0.0;
    for (int k = 0; k < 400 * 200; ++k) {
        double z = 1.0 - 2.0 * (k / 400 + 0.5) / 200, r = sqrt(1.0 - z * z), phi = 2.0 * M_PI * (k % 400 + 0.5) / 400;
        total += tsuya_environment_pdf(e, (tsuya_vec3){r * cos(phi), r * sin(phi), z}) * 4.0 * M_PI / (400 * 200);
    }
    assert_true(fabs(total - 1.0) < 0.02);
    tsuya_environment_free(e);
    tsuya_image_f32(&image, 3, 2)[1] = NAN;
    assert_fails(tsuya_environment_create(&e, &image, (tsuya_vec3){1, 0, 0}, (tsuya_vec3){0, 0, 1}, "map"), "(3, 2)");
    tsuya_image_free(&image);
}

/* A white ball in a white sky disappears; silk stays at or below the sky. */
static void test_white_furnace(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_light_set lights = {0};
    tsuya_camera camera;
    tsuya_pose pose;
    tsuya_path_options options = options_of(1024, 8);
    scene_sphere(&mesh, 1.0, 48, false);
    add_light(&lights, (tsuya_light){.kind = TSUYA_LIGHT_ENVIRONMENT, .rgb = {1, 1, 1}});
    scene_camera(&camera, &pose, (tsuya_vec3){5, 1, 2}, (tsuya_vec3){0, 0, 0}, 26.0, 16, 16);
    tsuya_shader white = lambert(1.0);
    tsuya_film film = scene_render(&mesh, &white, &lights, &camera, pose, &options, 2);
    double mean = film_mean(&film, 0);
    assert_true(mean <= 1.0 + 1e-3 && mean >= 1.0 - 2e-3);
    tsuya_film_free(&film);
    const double plain[3] = {0.047, 0.047, 0.047}, dye[3] = {1, 1, 1};
    tsuya_material *silk;
    tsuya_shader shader;
    assert_ok(tsuya_material_ggx(&silk, 0.35, 0.1, plain, 1.55, dye));
    assert_ok(tsuya_shader_from_material(&shader, silk));
    film = scene_render(&mesh, &shader, &lights, &camera, pose, &options, 2);
    mean = film_mean(&film, 0);
    assert_true(mean <= 1.0 + 1e-3 && mean > 0.97);
    tsuya_film_free(&film);
    tsuya_material_free(silk);
    tsuya_light_set_free(&lights);
    tsuya_mesh_free(&mesh);
}

/* What a lamp sends into a closed box stays there until it is absorbed: ∫ (1 − ρ) E dA = 4π I.  A pixel of a 90° picture from the
 * centre covers the same area of the wall wherever it lies. */
static void test_closed_box(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_light_set lights = {0};
    tsuya_camera camera;
    tsuya_pose pose;
    tsuya_shader shader = lambert(0.5);
    tsuya_path_options options = options_of(4096, 64);
    scene_cube(&mesh);
    add_light(&lights, (tsuya_light){.kind = TSUYA_LIGHT_POINT, .position_m = {0, 0, 0}, .rgb = {1, 1, 1}});
    scene_camera(&camera, &pose, (tsuya_vec3){0, 0, 0}, (tsuya_vec3){1, 0, 0}, 90.0, 24, 24);
    tsuya_film film = scene_render(&mesh, &shader, &lights, &camera, pose, &options, 2);
    double expected = 0.5 / M_PI * 4.0 * M_PI / (24.0 * 0.5);
    if (!(fabs(film_mean(&film, 0) - expected) <= 2e-3 * expected)) {
        fail_msg("closed box: mean radiance %.6g, expected %.6g", film_mean(&film, 0), expected);
    }
    tsuya_film_free(&film);
    tsuya_light_set_free(&lights);
    tsuya_mesh_free(&mesh);
}

static void test_strategies_agree(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_light_set lights = {0};
    tsuya_camera camera;
    tsuya_pose pose;
    const double plain[3] = {0.3, 0.3, 0.3}, dye[3] = {0.4, 0.2, 0.1};
    tsuya_material *material;
    tsuya_shader shader;
    double mean[3], error[3];
    assert_ok(tsuya_material_ggx(&material, 0.4, 0.15, plain, 1.5, dye));
    assert_ok(tsuya_shader_from_material(&shader, material));
    scene_sphere(&mesh, 0.5, 24, false);
    twenty_lamps(&lights);
    scene_camera(&camera, &pose, (tsuya_vec3){3, 0.5, 1}, (tsuya_vec3){0, 0, 0}, 16.0, 24, 24);
    for (int k = 0; k < 3; ++k) {
        tsuya_path_options options = options_of(512, 2);
        options.strategy = (tsuya_strategy)k;
        tsuya_film film = scene_render(&mesh, &shader, &lights, &camera, pose, &options, 2);
        mean[k] = 0.2126 * film_mean(&film, 0) + 0.7152 * film_mean(&film, 1) + 0.0722 * film_mean(&film, 2);
        error[k] = film_mean_error(&film);
        tsuya_film_free(&film);
    }
    for (int k = 1; k < 3; ++k) {
        double sigma = hypot(error[0], error[k]);
        if (!(fabs(mean[0] - mean[k]) <= 3.0 * sigma)) {
            fail_msg("strategy %d: %.6g ± %.2g against %.6g ± %.2g of both together", k, mean[k], error[k], mean[0], error[0]);
        }
        assert_true(error[0] < error[k]);
    }
    tsuya_material_free(material);
    tsuya_light_set_free(&lights);
    tsuya_mesh_free(&mesh);
}

static void test_threads_change_nothing(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_light_set lights = {0};
    tsuya_camera camera;
    tsuya_pose pose;
    tsuya_material *silk;
    tsuya_shader shader;
    assert_ok(tsuya_material_default_silk(&silk));
    assert_ok(tsuya_shader_from_material(&shader, silk));
    scene_drape(&mesh, 40);
    twenty_lamps(&lights);
    scene_camera(&camera, &pose, (tsuya_vec3){3, 1, 1}, (tsuya_vec3){0, 0, 0.3}, 30.0, 70, 50);
    for (int noise = 0; noise < 2; ++noise) {
        tsuya_path_options options = options_of(noise ? 64 : 8, 3);
        options.noise = noise ? 0.1 : 0.0;
        tsuya_film one = scene_render(&mesh, &shader, &lights, &camera, pose, &options, 1);
        tsuya_film two = scene_render(&mesh, &shader, &lights, &camera, pose, &options, 2);
        tsuya_film five = scene_render(&mesh, &shader, &lights, &camera, pose, &options, 5);
        size_t pixels = 70 * 50;
        assert_memory_equal(one.rgb, two.rgb, 3 * pixels * sizeof *one.rgb);
        assert_memory_equal(one.rgb, five.rgb, 3 * pixels * sizeof *one.rgb);
        assert_memory_equal(one.samples, two.samples, pixels * sizeof *one.samples);
        assert_memory_equal(one.error, five.error, pixels * sizeof *one.error);
        tsuya_film_free(&one);
        tsuya_film_free(&two);
        tsuya_film_free(&five);
    }
    tsuya_material_free(silk);
    tsuya_light_set_free(&lights);
    tsuya_mesh_free(&mesh);
}

static tsuya_walker camera_walker(uint64_t pixel, uint32_t sample, uint8_t bundle)
{
    double u[2];
    tsuya_sampler s = tsuya_sampler_start(5, pixel, sample);
    tsuya_sampler_pair(s, TSUYA_PAIR_PIXEL, u);
    tsuya_vec3 eye = {3, 1, 1}, to = {0.03 * u[0] + 0.6 * sin((double)pixel), 0.03 * u[1] + 0.6 * cos(2.0 * (double)pixel), 0.4};
    tsuya_vec3 d = tsuya_vec3_unit(tsuya_vec3_sub(to, eye));
    return (tsuya_walker){.ray = {{(float)eye.x, (float)eye.y, (float)eye.z}, {(float)d.x, (float)d.y, (float)d.z}, 0.0f, INFINITY}, .key = s.key, .sample = s.sample, .bundle = bundle};
}

/* What a path finds does not depend on who else is on the wave. */
static void test_company_changes_nothing(void **state)
{
    (void)state;
    enum { BUNDLE = 8, BUNDLES = TSUYA_WAVE / BUNDLE };
    tsuya_mesh drape, mesh;
    tsuya_light_set lights = {0};
    tsuya_material *silk;
    tsuya_shader shader[2] = {lambert(0.6)};
    tsuya_scene *scene;
    tsuya_tracer tracer;
    tsuya_wave *all, *some;
    tsuya_scene_options scene_options = tsuya_scene_options_default();
    tsuya_path_options options = options_of(1, 6);
    assert_ok(tsuya_material_default_silk(&silk));
    assert_ok(tsuya_shader_from_material(&shader[1], silk));
    shader[0].transmittance[0] = shader[0].transmittance[1] = shader[0].transmittance[2] = 0.2;
    scene_drape(&drape, 40);
    assert_ok(tsuya_mesh_create(&mesh, drape.vertex_count, drape.triangle_count, TSUYA_MESH_NORMAL | TSUYA_MESH_WEFT | TSUYA_MESH_MATERIAL));
    memcpy(mesh.position, drape.position, 3 * mesh.vertex_count * sizeof *mesh.position);
    memcpy(mesh.triangle, drape.triangle, 3 * mesh.triangle_count * sizeof *mesh.triangle);
    memcpy(mesh.normal, drape.normal, 3 * mesh.vertex_count * sizeof *mesh.normal);
    for (size_t v = 0; v < mesh.vertex_count; ++v) { /* a third without weft, every other stripe of another cloth */
        memcpy(mesh.weft + 3 * v, drape.weft + 3 * v, v % 3 == 0 ? 0 : 3 * sizeof *mesh.weft);
        mesh.material[v] = v / 7 % 2;
    }
    scene_options.shader = shader;
    scene_options.shader_count = 2;
    twenty_lamps(&lights);
    assert_ok(tsuya_scene_create(&scene, &mesh, &scene_options));
    assert_ok(tsuya_tracer_create(&tracer, scene, &lights, &options));
    assert_ok(tsuya_wave_create(&all, &tracer));
    assert_ok(tsuya_wave_create(&some, &tracer));
    int met = 0;
    for (uint32_t k = 0; k < TSUYA_WAVE; ++k) {
        all->walker[all->count++] = camera_walker(k / BUNDLE, k % BUNDLE, (uint8_t)(k / BUNDLE));
    }
    tsuya_trace(&tracer, all);
    for (uint32_t b = 0; b < BUNDLES; ++b) {
        some->count = 0;
        for (uint32_t k = 0; k < BUNDLE; ++k) {
            some->walker[some->count++] = camera_walker(b, k, 3);
        }
        tsuya_trace(&tracer, some);
        for (uint32_t k = 0; k < BUNDLE; ++k) {
            assert_memory_equal(some->walker[k].rgb, all->walker[b * BUNDLE + k].rgb, sizeof some->walker[k].rgb);
            met += some->walker[k].met && some->walker[k].rgb[1] > 0.0f;
        }
    }
    assert_true(met > TSUYA_WAVE / 2);
    tsuya_wave_free(all);
    tsuya_wave_free(some);
    tsuya_tracer_free(&tracer);
    tsuya_scene_free(scene);
    tsuya_light_set_free(&lights);
    tsuya_material_free(silk);
    tsuya_mesh_free(&drape);
    tsuya_mesh_free(&mesh);
}

/* Sampling by variance: same mean as many fixed samples, more samples where they are needed. */
static void test_adaptive_is_unbiased(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_light_set lights = {0};
    tsuya_camera camera;
    tsuya_pose pose;
    tsuya_shader shader = lambert(0.6);
    scene_drape(&mesh, 40);
    twenty_lamps(&lights);
    scene_camera(&camera, &pose, (tsuya_vec3){3, 1, 1}, (tsuya_vec3){0, 0, 0.3}, 30.0, 48, 48);
    tsuya_path_options fixed = options_of(1024, 3), adaptive = options_of(1024, 3);
    adaptive.noise = 0.05;
    tsuya_film a = scene_render(&mesh, &shader, &lights, &camera, pose, &fixed, 2);
    tsuya_film b = scene_render(&mesh, &shader, &lights, &camera, pose, &adaptive, 2);
    double sigma = hypot(film_mean_error(&a), film_mean_error(&b));
    assert_true(fabs(film_mean(&a, 1) - film_mean(&b, 1)) < 3.0 * sigma);
    uint32_t least = UINT32_MAX, most = 0;
    for (size_t k = 0; k < 48 * 48; ++k) {
        least = b.samples[k] < least ? b.samples[k] : least;
        most = b.samples[k] > most ? b.samples[k] : most;
    }
    assert_true(least >= 4 && least <= 16 && most > 40 && most < 1024);
    tsuya_film_free(&a);
    tsuya_film_free(&b);
    tsuya_light_set_free(&lights);
    tsuya_mesh_free(&mesh);
}

/* Nothing behind an opaque cloth gets through it, be its normals smooth, coarse or missing. */
static void test_no_leaks(void **state)
{
    (void)state;
    for (int kind = 0; kind < 4; ++kind) {
        tsuya_mesh mesh;
        tsuya_light_set lights = {0};
        tsuya_camera camera;
        tsuya_pose pose;
        tsuya_shader shader = lambert(0.8);
        tsuya_path_options options = options_of(64, 4);
        if (kind < 2) {
            scene_plane(&mesh, 50.0, 4);
        } else {
            scene_sphere(&mesh, 1.0, kind == 2 ? 8 : 64, false);
        }
        if (kind == 1) { /* normals that lean far over */
            for (size_t v = 0; v < mesh.vertex_count; ++v) {
                double a = 2.0 * (double)v;
                mesh.normal[3 * v] = (float)(0.9 * cos(a));
                mesh.normal[3 * v + 1] = (float)(0.9 * sin(a));
                mesh.normal[3 * v + 2] = 0.43f;
            }
        }
        /* behind the plane, or inside the ball */
        tsuya_vec3 p = kind < 2 ? (tsuya_vec3){0.3, 0.2, -1.0} : (tsuya_vec3){0.1, 0.2, 0.3};
        add_light(&lights, (tsuya_light){.kind = TSUYA_LIGHT_POINT, .position_m = p, .rgb = {10, 10, 10}});
        add_light(&lights, (tsuya_light){.kind = TSUYA_LIGHT_DISK, .position_m = p, .direction = {0.3, 0, 1}, .size_m = {0.4, 0.4}, .rgb = {10, 10, 10}});
        scene_camera(&camera, &pose, (tsuya_vec3){2, 1, 2}, (tsuya_vec3){0, 0, 0}, 50.0, 40, 40);
        tsuya_film film = scene_render(&mesh, &shader, &lights, &camera, pose, &options, 2);
        for (size_t k = 0; k < 3 * 40 * 40; ++k) {
            if (film.rgb[k] != 0.0f) {
                fail_msg("kind %d: pixel %zu has %g from behind the cloth", kind, k / 3, (double)film.rgb[k]);
            }
        }
        tsuya_film_free(&film);
        tsuya_light_set_free(&lights);
        tsuya_mesh_free(&mesh);
    }
}

/* A coarse ball with smooth normals under a directional lamp looks like the ball, at the terminator as elsewhere. */
static void test_terminator(void **state)
{
    (void)state;
    enum { SIZE = 96 };
    tsuya_mesh mesh;
    tsuya_light_set lights = {0};
    tsuya_camera camera;
    tsuya_pose pose;
    tsuya_shader shader = lambert(1.0);
    tsuya_path_options options = options_of(16, 1);
    tsuya_vec3 to_lamp = tsuya_vec3_unit((tsuya_vec3){0.2, -1.0, 0.3}), eye = {6, 0, 0};
    scene_sphere(&mesh, 1.0, 24, false);
    add_light(&lights, (tsuya_light){.kind = TSUYA_LIGHT_DIRECTIONAL, .direction = tsuya_vec3_scale(to_lamp, -1.0), .rgb = {M_PI, M_PI, M_PI}});
    scene_camera(&camera, &pose, eye, (tsuya_vec3){0, 0, 0}, 19.4, SIZE, SIZE);
    tsuya_film film = scene_render(&mesh, &shader, &lights, &camera, pose, &options, 2);
    int compared = 0;
    for (int k = 0; k < SIZE * SIZE; ++k) {
        tsuya_vec3 ray;
        assert_true(tsuya_camera_unproject(&camera, (tsuya_vec2){k % SIZE, k / SIZE}, &ray));
        ray = tsuya_mat3_apply_transposed(pose.rotation, ray);
        double b = tsuya_vec3_dot(eye, ray), d = b * b - 35.0;
        tsuya_vec3 n = tsuya_vec3_mad(eye, -b - sqrt(fmax(0.0, d)), ray);
        if (d > 0.0 && -tsuya_vec3_dot(n, ray) > 0.3) {
            double expected = fmax(0.0, tsuya_vec3_dot(n, to_lamp));
            if (!(fabs(film.rgb[3 * k] - expected) < 0.05)) {
                fail_msg("pixel (%d, %d): %g, the ball has %g", k % SIZE, k / SIZE, (double)film.rgb[3 * k], expected);
            }
            ++compared;
        }
    }
    assert_true(compared > SIZE * SIZE / 2);
    tsuya_film_free(&film);
    tsuya_light_set_free(&lights);
    tsuya_mesh_free(&mesh);
}

/* Where the weft is missing, zero or parallel to the normal, the plane shows the mean over all azimuths. */
static void test_missing_weft(void **state)
{
    (void)state;
    tsuya_material *material;
    tsuya_shader shader;
    tsuya_camera camera;
    tsuya_pose pose;
    tsuya_light_set lights = {0};
    const double plain[3] = {0.2, 0.2, 0.2}, black[3] = {0, 0, 0};
    assert_ok(tsuya_material_ggx(&material, 0.5, 0.15, plain, 1.5, black));
    assert_ok(tsuya_shader_from_material(&shader, material));
    tsuya_vec3 wi = tsuya_vec3_unit((tsuya_vec3){0.5, 0.2, 1.0}), eye = {2, -1, 2.5}, wo = tsuya_vec3_unit(eye);
    add_light(&lights, (tsuya_light){.kind = TSUYA_LIGHT_DIRECTIONAL, .direction = tsuya_vec3_scale(wi, -1.0), .rgb = {1, 1, 1}});
    double expected = 0.0;
    enum { TURNS = 720 };
    for (int k = 0; k < TURNS; ++k) {
        double a = 2.0 * M_PI * k / TURNS, c = cos(a), s = sin(a), f[3];
        tsuya_material_eval(material, NULL, (tsuya_vec3){c * wi.x - s * wi.y, s * wi.x + c * wi.y, wi.z},
                            (tsuya_vec3){c * wo.x - s * wo.y, s * wo.x + c * wo.y, wo.z}, f);
        expected += f[0] * wi.z / TURNS;
    }
    scene_camera(&camera, &pose, eye, (tsuya_vec3){0, 0, 0}, 0.05, 4, 4);
    for (int kind = 0; kind < 4; ++kind) {
        tsuya_mesh mesh;
        scene_plane(&mesh, 4.0, 2);
        for (size_t v = 0; v < mesh.vertex_count; ++v) {
            float weft[3] = {0, 0, kind == 2 ? 1.0f : 0.0f};
            weft[0] = kind == 3 ? NAN : 0.0f;
            memcpy(mesh.weft + 3 * v, weft, sizeof weft);
        }
        if (kind == 0) {
            tsuya_free(mesh.weft);
            mesh.weft = NULL;
        }
        tsuya_path_options options = options_of(2048, 1);
        tsuya_film film = scene_render(&mesh, &shader, &lights, &camera, pose, &options, 2);
        assert_true(fabs(film_mean(&film, 0) - expected) < 3e-3 * expected);
        tsuya_film_free(&film);
        tsuya_mesh_free(&mesh);
    }
    tsuya_material_free(material);
    tsuya_light_set_free(&lights);
}

/* Weft along x or along y, seen by a camera along x: the anisotropy has the direction that it should have. */
static void test_weft_turns_the_lobe(void **state)
{
    (void)state;
    tsuya_material *material;
    tsuya_shader shader;
    tsuya_camera camera;
    tsuya_pose pose;
    tsuya_light_set lights = {0};
    const double plain[3] = {0.2, 0.2, 0.2}, black[3] = {0, 0, 0};
    tsuya_vec3 wi = tsuya_vec3_unit((tsuya_vec3){-0.2, 0, 1.0}), eye = {2, 0, 2.5};
    assert_ok(tsuya_material_ggx(&material, 0.5, 0.1, plain, 1.5, black));
    assert_ok(tsuya_shader_from_material(&shader, material));
    add_light(&lights, (tsuya_light){.kind = TSUYA_LIGHT_DIRECTIONAL, .direction = tsuya_vec3_scale(wi, -1.0), .rgb = {1, 1, 1}});
    scene_camera(&camera, &pose, eye, (tsuya_vec3){0, 0, 0}, 0.02, 2, 2);
    for (int along_y = 0; along_y < 2; ++along_y) {
        tsuya_mesh mesh;
        tsuya_path_options options = options_of(4, 1);
        double f[3];
        scene_plane(&mesh, 4.0, 2);
        for (size_t v = 0; v < mesh.vertex_count; ++v) {
            double sign = v % 2 ? 1.0 : -1.0; /* weft is an axis: mixed signs must not matter */
            mesh.weft[3 * v] = (float)(along_y ? 0.0 : sign);
            mesh.weft[3 * v + 1] = (float)(along_y ? sign : 0.0);
        }
        tsuya_vec3 wo = tsuya_vec3_unit(eye);
        tsuya_film film = scene_render(&mesh, &shader, &lights, &camera, pose, &options, 1);
        tsuya_material_eval(material, NULL, along_y ? (tsuya_vec3){wi.y, -wi.x, wi.z} : wi, along_y ? (tsuya_vec3){wo.y, -wo.x, wo.z} : wo, f);
        assert_true(fabs(film_mean(&film, 0) - f[0] * wi.z) < 2e-3 * f[0]);
        tsuya_film_free(&film);
        tsuya_mesh_free(&mesh);
    }
    tsuya_material_free(material);
    tsuya_light_set_free(&lights);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_small_lamps),
        cmocka_unit_test(test_area_lamps),
        cmocka_unit_test(test_environments),
        cmocka_unit_test(test_environment_orientation),
        cmocka_unit_test(test_white_furnace),
        cmocka_unit_test(test_closed_box),
        cmocka_unit_test(test_strategies_agree),
        cmocka_unit_test(test_threads_change_nothing),
        cmocka_unit_test(test_company_changes_nothing),
        cmocka_unit_test(test_adaptive_is_unbiased),
        cmocka_unit_test(test_no_leaks),
        cmocka_unit_test(test_terminator),
        cmocka_unit_test(test_missing_weft),
        cmocka_unit_test(test_weft_turns_the_lobe),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
