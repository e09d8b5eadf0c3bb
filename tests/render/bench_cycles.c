/* Against Blender's Cycles on the processor, where it is installed: the same mesh, lamp and camera, an anisotropic GGX beside a body on both
 * sides, one run.  Each renderer's error is taken against a picture of its own with many samples; that the two pictures are alike is asked
 * for too. */
#include "bench.h"
#include "support.h"

#include <time.h>

#include "core/image.h"
#include "core/json.h"
#include "core/process.h"

#include "render/light.h"

#include "render_scenes.h"

enum { WIDTH = 200, HEIGHT = 150, CELLS = 316, SPP_FEW = 64, SPP_MANY = 1024, BOUNCES = 4, PIXELS = WIDTH * HEIGHT };
static const double alpha_weft = 0.35, alpha_warp = 0.10, strength = 0.3, body = 0.1, eta = 4.0 /* hardly any Fresnel: Cycles' lobe has none */, lamp_radiance = 1500.0, lamp_m = 0.1;
static const tsuya_vec3 lamp_at = {2, -2, 2.5}, lamp_to = {-2, 2, -2.2}, eye = {3, -1, 1}, target = {0, 0, 0.1};

/* What a renderer needs: a second to build, seconds a sample, and the error of SPP_FEW. */
typedef struct cost {
    double build_s, sample_s, error;
} cost;

static double cpu_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Root mean square difference over the mean of the second. */
static double relative_error(const float *rgb, const float *reference)
{
    double sum = 0.0, mean = 0.0;
    for (int k = 0; k < 3 * PIXELS; ++k) {
        double d = (double)rgb[k] - (double)reference[k];
        sum += d * d;
        mean += (double)reference[k];
    }
    return sqrt(sum / (3 * PIXELS)) / (mean / (3 * PIXELS));
}

static double mean_of(const float *rgb)
{
    double mean = 0.0;
    for (int k = 0; k < 3 * PIXELS; ++k) {
        mean += (double)rgb[k] / (3 * PIXELS);
    }
    return mean;
}

/* The cycles.py beside this program (installed) or in the sources. */
static const char *script(void)
{
    static char path[TEST_PATH];
    ssize_t length = readlink("/proc/self/exe", path, sizeof path - 32);
    char *slash = length > 0 ? memrchr(path, '/', (size_t)length) : NULL;
    if (slash) {
        strcpy(slash + 1, "cycles.py");
    }
    if (!slash || access(path, R_OK) != 0) {
        snprintf(path, sizeof path, "%s/tests/render/cycles.py", TSUYA_SOURCE_DIR);
    }
    return path;
}

static tsuya_film render(const tsuya_scene *scene, const tsuya_light_set *lights, int spp, uint64_t seed, double *seconds)
{
    tsuya_context context = tsuya_context_default();
    tsuya_path_options options = options_of(spp, BOUNCES);
    tsuya_camera camera;
    tsuya_pose pose;
    tsuya_film film;
    tsuya_path_info info;
    context.seed = seed;
    scene_camera(&camera, &pose, eye, target, 33.0, WIDTH, HEIGHT);
    double start = cpu_s();
    assert_ok(tsuya_path_render(&film, &info, scene, lights, &camera, pose, &options, &context));
    *seconds = cpu_s() - start;
    return film;
}

/* A lobe and a body that do not know of each other, as Cycles adds them. */
static void satin_beside_body(tsuya_material **satin)
{
    char text[512];
    snprintf(text, sizeof text,
             "{\"format\": \"tsuya material\", \"version\": \"1.0\", \"name\": \"satin\", \"model\": \"ggx-aniso\", \"channels\": [\"r\", \"g\", \"b\"],"
             " \"dye\": {\"reflectance\": [%g, %g, %g], \"coupling\": \"lambert\"},"
             " \"parameters\": {\"alpha_weft\": %g, \"alpha_warp\": %g, \"eta\": %g, \"strength\": [%g, %g, %g]}}",
             body, body, body, alpha_weft, alpha_warp, eta, strength, strength, strength);
    assert_ok(tsuya_material_parse(satin, text, "satin"));
}

static tsuya_film ours(cost *c, const tsuya_mesh *mesh)
{
    tsuya_scene_options options = tsuya_scene_options_default();
    tsuya_light_set lights = {0};
    tsuya_material *satin;
    tsuya_shader shader;
    tsuya_scene *scene;
    double few_s, many_s;
    satin_beside_body(&satin);
    assert_ok(tsuya_shader_from_material(&shader, satin));
    options.shader = &shader;
    options.shader_count = 1;
    add_light(&lights, (tsuya_light){.kind = TSUYA_LIGHT_DISK, .position_m = lamp_at, .direction = lamp_to, .size_m = {lamp_m},
                                     .rgb = {lamp_radiance, lamp_radiance, lamp_radiance}});
    double start = cpu_s();
    assert_ok(tsuya_scene_create(&scene, mesh, &options));
    c->build_s = cpu_s() - start;
    tsuya_film few = render(scene, &lights, SPP_FEW, 1, &few_s), many = render(scene, &lights, SPP_MANY, 2, &many_s);
    c->error = relative_error(few.rgb, many.rgb);
    c->sample_s = (many_s - few_s) / (SPP_MANY - SPP_FEW);
    tsuya_film_free(&few);
    tsuya_scene_free(scene);
    tsuya_light_set_free(&lights);
    tsuya_material_free(satin);
    return many;
}

static void write_array(const char *name, const void *data, size_t bytes)
{
    FILE *file = fopen(test_path(name), "wb");
    assert_non_null(file);
    assert_int_equal(fwrite(data, 1, bytes, file), bytes);
    assert_int_equal(fclose(file), 0);
}

static void set3(tsuya_json *told, const char *key, tsuya_vec3 v)
{
    const double numbers[3] = {v.x, v.y, v.z};
    tsuya_json_set_numbers(told, key, numbers, 3);
}

/* Cycles' node: alpha = roughness², then × (1 − a) along the tangent and / (1 − a) across it; for a < 0 / (1 + a) and × (1 + a). */
static void tell_material(tsuya_json *told)
{
    double ratio = sqrt(alpha_warp / alpha_weft);
    const double color[3] = {strength, strength, strength}, dye[3] = {body, body, body};
    tsuya_json_set_number(told, "roughness", sqrt(sqrt(alpha_weft * alpha_warp)));
    tsuya_json_set_number(told, "anisotropy", ratio < 1.0 ? ratio - 1.0 : 1.0 - 1.0 / ratio);
    tsuya_json_set_numbers(told, "color", color, 3);
    tsuya_json_set_numbers(told, "dye", dye, 3);
}

static void tell_camera(tsuya_json *told)
{
    tsuya_camera camera;
    tsuya_pose pose;
    double m[12];
    scene_camera(&camera, &pose, eye, target, 33.0, WIDTH, HEIGHT);
    const double at[3] = {eye.x, eye.y, eye.z};
    for (int row = 0; row < 3; ++row) {
        for (int column = 0; column < 3; ++column) {
            m[4 * row + column] = pose.rotation.e[column][row];
        }
        m[4 * row + 3] = at[row];
    }
    tsuya_json_set_numbers(told, "world_from_camera", m, 12);
    tsuya_json_set_number(told, "focal_px", camera.fx_px);
    tsuya_json_set_number(told, "width", WIDTH);
    tsuya_json_set_number(told, "height", HEIGHT);
}

static void tell(const tsuya_mesh *mesh)
{
    const double samples[3] = {1, SPP_FEW, SPP_MANY};
    tsuya_json *told = tsuya_json_create_object();
    write_array("position.f32", mesh->position, 12 * mesh->vertex_count);
    write_array("weft.f32", mesh->weft, 12 * mesh->vertex_count);
    write_array("triangle.u32", mesh->triangle, 12 * mesh->triangle_count);
    tell_material(told);
    tell_camera(told);
    set3(told, "lamp_position", lamp_at);
    set3(told, "lamp_direction", lamp_to);
    tsuya_json_set_number(told, "lamp_diameter", lamp_m);
    tsuya_json_set_number(told, "lamp_radiance", lamp_radiance);
    tsuya_json_set_number(told, "bounces", BOUNCES);
    tsuya_json_set_number(told, "threads", tsuya_context_default().threads);
    tsuya_json_set_numbers(told, "samples", samples, 3);
    assert_ok(tsuya_json_save(told, test_path("scene.json")));
    tsuya_json_free(told);
}

static void load(float rgb[3 * PIXELS], const char *name)
{
    tsuya_image image;
    assert_ok(tsuya_image_load(&image, test_path(name)));
    assert_int_equal(image.width_px, WIDTH);
    assert_int_equal(image.height_px, HEIGHT);
    for (int k = 0; k < 3 * PIXELS; ++k) {
        rgb[k] = tsuya_image_get(&image, k / 3 % WIDTH, k / 3 / WIDTH, k % 3);
    }
    tsuya_image_free(&image);
}

static void cycles(cost *c, float many[3 * PIXELS])
{
    static float few[3 * PIXELS];
    const char *const argv[] = {"blender", "-b", "--factory-startup", "--python-exit-code", "1", "--python", script(), "--", test_path("scene.json"), NULL};
    const tsuya_process_options options = {.log_path = test_path("blender.log")};
    tsuya_json *root;
    double s[3];
    assert_ok(tsuya_process_run(NULL, argv, &options));
    assert_ok(tsuya_json_load(&root, test_path("cycles.json")));
    const tsuya_json *pictures = tsuya_json_member(root, "pictures");
    for (int k = 0; k < 3; ++k) {
        assert_ok(tsuya_json_get_number(&s[k], tsuya_json_element(pictures, k), "processor_s"));
    }
    load(few, "cycles_1.exr");
    load(many, "cycles_2.exr");
    c->error = relative_error(few, many);
    c->sample_s = (s[2] - s[1]) / (SPP_MANY - SPP_FEW);
    c->build_s = fmax(0.0, s[0] - c->sample_s);
    printf("cycles,%s\n", tsuya_json_text_or(tsuya_json_member(root, "version"), "?"));
    tsuya_json_free(root);
}

static void bench_cycles(void **state)
{
    (void)state;
    static float theirs[3 * PIXELS];
    tsuya_mesh mesh;
    cost own, peer;
    scene_drape(&mesh, CELLS);
    tsuya_film many = ours(&own, &mesh);
    printf("renderer,triangles,build_s,us_a_pixel_sample,relative_rmse_of_%d_spp,processor_s_to_that_rmse_of_tsuya\n", SPP_FEW);
    printf("tsuya,%zu,%.2f,%.3f,%.5f,%.3f\n", mesh.triangle_count, own.build_s, 1e6 * own.sample_s / PIXELS, own.error, own.sample_s * SPP_FEW);
    bench_point("satin by a small lamp", "tsuya", own.error, "relative rmse", own.sample_s * SPP_FEW, "s");
    if (!tsuya_process_available("blender")) {
        printf("cycles,skipped: blender is not installed\n");
    } else {
        tell(&mesh);
        cycles(&peer, theirs);
        double needed = SPP_FEW * pow(peer.error / own.error, 2.0), seconds = peer.sample_s * needed;
        printf("cycles,%zu,%.2f,%.3f,%.5f,%.3f\n", mesh.triangle_count, peer.build_s, 1e6 * peer.sample_s / PIXELS, peer.error, seconds);
        printf("cycles_over_tsuya_at_equal_error,%.2f\npictures_alike,mean %.4f and %.4f,difference %.4f of the mean\n",
               seconds / (own.sample_s * SPP_FEW), mean_of(many.rgb), mean_of(theirs), relative_error(many.rgb, theirs));
        assert_true(relative_error(many.rgb, theirs) < 0.1); /* else they did not draw the same scene */
        bench_point("satin by a small lamp", "Cycles", peer.error, "relative rmse", peer.sample_s * SPP_FEW, "s");
    }
    tsuya_film_free(&many);
    tsuya_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test_teardown(bench_cycles, test_folder_tear_down)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
