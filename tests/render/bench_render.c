/* Throughput with shading against a bare Embree loop that traces the same rays: one process, in pairs, one thread and two. */
#include "bench.h"
#include "support.h"

#include <omp.h>

#include "core/file.h"
#include "core/memory.h"

#include "render/detail.h"
#include "render/light.h"
#include "render/render.h"

#include "render_bench.h"

enum { WIDTH = 320, HEIGHT = 240, SPP = 8, PAIRS = 5 };

typedef struct ray_list {
    tsuya_ray *ray;
    bool *shadow;
    uint8_t *packet; /* rays of each call: those that go at once */
    size_t count, packets, room;
} ray_list;

static void keep_rays(void *user, const tsuya_ray *ray, int count, bool shadow)
{
    ray_list *list = user;
    if (list->count + TSUYA_RAY_PACKET > list->room) {
        list->room = list->room ? 2 * list->room : 1 << 20;
        list->ray = tsuya_realloc(list->ray, list->room, sizeof *list->ray);
        list->shadow = tsuya_realloc(list->shadow, list->room, sizeof *list->shadow);
        list->packet = tsuya_realloc(list->packet, list->room, sizeof *list->packet);
        assert_true(list->ray && list->shadow && list->packet);
    }
    list->packet[list->packets++] = (uint8_t)count;
    for (int k = 0; k < count; ++k) {
        list->ray[list->count] = ray[k];
        list->shadow[list->count++] = shadow;
    }
}

/* Processor seconds a thread of the rays alone, and how many met something (so that nothing is optimised away): one by one, ... */
static double trace_single(const tsuya_ray_scene *scene, const ray_list *list, int threads, size_t *met)
{
    size_t hits = 0;
    double start = bench_cpu_s();
#pragma omp parallel for schedule(static, 4096) num_threads(threads) reduction(+ : hits)
    for (size_t k = 0; k < list->count; ++k) {
        tsuya_ray_hit hit;
        hits += list->shadow[k] ? tsuya_ray_scene_occluded(scene, &list->ray[k]) : tsuya_ray_scene_intersect(scene, &list->ray[k], &hit);
    }
    *met = hits;
    return (bench_cpu_s() - start) / threads;
}

static size_t trace_packet(const tsuya_ray_scene *scene, const tsuya_ray *ray, int count, bool shadow)
{
    tsuya_ray_hit hit[TSUYA_RAY_PACKET];
    bool met[TSUYA_RAY_PACKET];
    size_t hits = 0;
    if (count == 1) {
        return shadow ? tsuya_ray_scene_occluded(scene, ray) : tsuya_ray_scene_intersect(scene, ray, hit);
    }
    if (shadow) {
        tsuya_ray_scene_occluded_packet(scene, ray, count, met);
    } else {
        tsuya_ray_scene_intersect_packet(scene, ray, count, hit, met);
    }
    for (int k = 0; k < count; ++k) {
        hits += met[k];
    }
    return hits;
}

/* ... and in the packets in which the renderer traced them. */
static double trace_packets(const tsuya_ray_scene *scene, const ray_list *list, int threads, size_t *met)
{
    enum { AT_ONCE = 4096 };
    size_t hits = 0, blocks = (list->packets + AT_ONCE - 1) / AT_ONCE, *first = tsuya_calloc(blocks + 1, sizeof *first);
    assert_non_null(first);
    for (size_t k = 0, ray = 0; k < list->packets; ray += list->packet[k++]) {
        if (k % AT_ONCE == 0) {
            first[k / AT_ONCE] = ray;
        }
    }
    double start = bench_cpu_s();
#pragma omp parallel for schedule(static, 1) num_threads(threads) reduction(+ : hits)
    for (size_t b = 0; b < blocks; ++b) {
        size_t ray = first[b];
        for (size_t k = b * AT_ONCE; k < list->packets && k < (b + 1) * AT_ONCE; ray += list->packet[k++]) {
            hits += trace_packet(scene, &list->ray[ray], list->packet[k], list->shadow[ray]);
        }
    }
    *met = hits;
    tsuya_free(first);
    return (bench_cpu_s() - start) / threads;
}

static double render_seconds(const tsuya_scene *scene, const tsuya_light_set *lights, const tsuya_camera *camera, tsuya_pose pose,
                             const tsuya_path_options *options, int threads, double *mean)
{
    tsuya_context context = tsuya_context_default();
    tsuya_film film;
    tsuya_path_info info;
    context.threads = threads;
    double start = bench_cpu_s();
    assert_ok(tsuya_path_render(&film, &info, scene, lights, camera, pose, options, &context));
    double seconds = (bench_cpu_s() - start) / threads;
    *mean = film_mean(&film, 1);
    tsuya_film_free(&film);
    return seconds;
}

static void studio(tsuya_light_set *lights, int kind)
{
    if (kind == 0) {
        add_light(lights, (tsuya_light){.kind = TSUYA_LIGHT_POINT, .position_m = {2, -2, 2.5}, .rgb = {12, 12, 12}});
    } else {
        assert_ok(tsuya_light_set_studio(lights, (tsuya_vec3){0, 0, 0.3}, 1.0, (tsuya_vec3){3, 1, 1}, (tsuya_vec3){0, 0, 1}));
    }
}

typedef struct shares { double rate[PAIRS], packets[PAIRS], single[PAIRS]; } shares;

/* One pair: the picture as it is rendered against the bare loop with the same packets, and with single rays in both. */
static void measure_pair(shares *s, int pair, const tsuya_scene *scene, const tsuya_ray_scene *bare, const ray_list *list, const tsuya_light_set *lights,
                         const tsuya_camera *camera, tsuya_pose pose, tsuya_path_options options, int threads, size_t *met)
{
    double mean, shaded = render_seconds(scene, lights, camera, pose, &options, threads, &mean);
    s->rate[pair] = 1e-6 * (double)list->count / shaded;
    s->packets[pair] = trace_packets(bare, list, threads, met) / shaded;
    options.single_rays = true;
    double alone = trace_single(bare, list, threads, met);
    s->single[pair] = alone / render_seconds(scene, lights, camera, pose, &options, threads, &mean);
}

static void bench_scene(int cells, int light, const tsuya_shader *shader, const char *material)
{
    tsuya_mesh mesh;
    tsuya_light_set lights = {0};
    tsuya_camera camera;
    tsuya_pose pose;
    tsuya_scene *scene;
    tsuya_ray_scene *bare;
    tsuya_scene_options scene_options = tsuya_scene_options_default();
    tsuya_path_options options = tsuya_path_options_default();
    ray_list list = {0};
    shares one, two;
    double scaling[PAIRS], mean = 0.0;
    size_t met;
    scene_options.shader = shader;
    scene_options.shader_count = 1;
    options.spp = SPP;
    scene_drape(&mesh, cells);
    studio(&lights, light);
    scene_camera(&camera, &pose, (tsuya_vec3){3, 1, 1}, (tsuya_vec3){0, 0, 0.2}, 33.0, WIDTH, HEIGHT);
    assert_ok(tsuya_scene_create(&scene, &mesh, &scene_options));
    assert_ok(tsuya_ray_scene_create(&bare, &mesh));
    options.ray_sink = keep_rays;
    options.ray_user = &list;
    render_seconds(scene, &lights, &camera, pose, &options, 1, &mean);
    options.ray_sink = NULL;
    for (int pair = 0; pair < PAIRS; ++pair) {
        measure_pair(&one, pair, scene, bare, &list, &lights, &camera, pose, options, 1, &met);
        measure_pair(&two, pair, scene, bare, &list, &lights, &camera, pose, options, 2, &met);
        scaling[pair] = two.packets[pair] / one.packets[pair];
    }
    double share = bench_median(one.packets, PAIRS);
    printf("%zu,%s,%s,%.2f,%.3f,%.3f,%.2f,%.3f,%.3f,%.3f\n", mesh.triangle_count, light == 0 ? "point" : "studio", material, bench_median(one.rate, PAIRS), share,
           bench_median(one.single, PAIRS), bench_median(two.rate, PAIRS), bench_median(two.packets, PAIRS), bench_median(scaling, PAIRS), (double)met / (double)list.count);
    fflush(stdout);
    tsuya_free(list.ray);
    tsuya_free(list.shadow);
    tsuya_free(list.packet);
    tsuya_ray_scene_free(bare);
    tsuya_scene_free(scene);
    tsuya_light_set_free(&lights);
    tsuya_mesh_free(&mesh);
}

static void bench_throughput(void **state)
{
    (void)state;
    tsuya_material *silk;
    tsuya_shader shader, matte = lambert(0.5);
    assert_ok(tsuya_material_default_silk(&silk));
    assert_ok(tsuya_shader_from_material(&shader, silk));
    printf("triangles,lamp,material,mrays_per_s_1,of_bare_1,single_rays_of_bare_1,mrays_per_s_2,of_bare_2,scaling_over_bare,met_fraction\n");
    for (int cells = 316; cells <= 1000; cells += 684) {
        for (int light = 0; light < 2; ++light) {
            bench_scene(cells, light, &matte, "lambert");
            bench_scene(cells, light, &shader, "ggx-aniso");
        }
    }
    tsuya_material_free(silk);
}

/* Median of the pictures' noise, each the median over its cloth; and how many are within `bar`. */
static double noise_of_pictures(const char *folder, double bar, int *within)
{
    tsuya_json *root;
    double noise[36];
    int count = 0;
    char path[TEST_PATH];
    snprintf(path, sizeof path, "%s/render.json", folder);
    assert_ok(tsuya_json_load(&root, path));
    *within = 0;
    for (const tsuya_json *p = tsuya_json_first(tsuya_json_member(root, "pictures")); p && count < 36; p = tsuya_json_next(p)) {
        noise[count] = tsuya_json_number_or(tsuya_json_member(p, "noise"), NAN);
        *within += noise[count++] <= bar;
    }
    tsuya_json_free(root);
    assert_int_equal(count, 36);
    return bench_median(noise, count);
}

/* A garment of half a million triangles under one small lamp, as 36 pictures and their files, to 3 % of noise: the command `render` from the
 * mesh's file on, with as many threads as there are.  Some views see little but its shadow, which is allowed more (render/path.h). */
static void bench_turntable(void **state)
{
    (void)state;
    static const char lamp[] = "{\"lights\": [{\"type\": \"disk\", \"position_m\": [2, -2, 2.5], \"direction\": [-2, 2, -2.2], \"size_m\": [0.1, 0.1], "
                               "\"rgb\": [1500, 1500, 1500]}]}";
    const char *mesh_path = test_path("garment.ply"), *lights_path = test_path("lamp.json");
    tsuya_mesh mesh;
    tsuya_render_info info;
    tsuya_context context = tsuya_context_default();
    tsuya_render_options options = tsuya_render_options_default();
    scene_drape(&mesh, 500);
    assert_ok(tsuya_ply_save(&mesh, mesh_path, NULL));
    size_t triangles = mesh.triangle_count;
    tsuya_mesh_free(&mesh);
    assert_ok(tsuya_file_write(lights_path, lamp, strlen(lamp)));
    options.mesh_path = mesh_path;
    options.lights_path = lights_path;
    options.output_folder = test_path("turntable");
    options.views = 36;
    options.spp = 4096;
    options.noise = 0.03;
    double start = bench_cpu_s(), wall = tsuya_clock_s();
    assert_ok(tsuya_render(&info, &options, &context));
    double processor_s = bench_cpu_s() - start;
    wall = tsuya_clock_s() - wall;
    int within;
    double noise = noise_of_pictures(options.output_folder, 0.03, &within);
    printf("turntable_triangles,views,width,height,seconds,processor_s,processor_s_over_2,threads,noise_median,worst_noise,views_within_3_percent,mrays,peak_mb\n"
           "%zu,%d,%d,%d,%.1f,%.1f,%.1f,%d,%.4f,%.4f,%d,%.1f,%.0f\n",
           triangles, info.frames, info.width_px, info.height_px, wall, processor_s, 0.5 * processor_s, context.threads, noise, info.noise, within,
           1e-6 * (double)info.rays, info.peak_mb);
    assert_true(info.frames == 36 && info.width_px == 1280 && info.height_px == 960 && noise <= 0.03);
    test_folder_remove();
}

/* Two million triangles in a small picture: time to build and to render, and what leaving triangles out does to the picture beside what
 * other random numbers do. */
static void bench_detail(void **state)
{
    (void)state;
    enum { W = 160, H = 120 };
    tsuya_mesh mesh, coarse;
    tsuya_detail_info info;
    tsuya_light_set lights = {0};
    tsuya_camera camera;
    tsuya_pose pose;
    tsuya_material *silk;
    tsuya_shader shader;
    tsuya_film film[3];
    double seconds[3], build[3], choose;
    tsuya_context context = tsuya_context_default();
    tsuya_detail_options detail = tsuya_detail_options_default();
    tsuya_path_options options = options_of(256, 4);
    assert_ok(tsuya_material_default_silk(&silk));
    assert_ok(tsuya_shader_from_material(&shader, silk));
    scene_drape(&mesh, 1000);
    studio(&lights, 1);
    scene_camera(&camera, &pose, (tsuya_vec3){3, 1, 1}, (tsuya_vec3){0, 0, 0.2}, 33.0, W, H);
    const tsuya_detail_view view = {{3, 1, 1}, 1.0 / camera.fx_px};
    double start = bench_cpu_s();
    assert_ok(tsuya_mesh_detail(&coarse, &info, &mesh, &view, 1, &detail, &context));
    choose = bench_cpu_s() - start;
    for (int k = 0; k < 3; ++k) { /* whole, whole with another seed, simplified */
        tsuya_scene_options scene_options = tsuya_scene_options_default();
        tsuya_scene *scene;
        tsuya_path_info path;
        scene_options.shader = &shader;
        scene_options.shader_count = 1;
        context.seed = (uint64_t)k;
        start = bench_cpu_s();
        assert_ok(tsuya_scene_create(&scene, k == 2 && coarse.vertex_count > 0 ? &coarse : &mesh, &scene_options));
        build[k] = bench_cpu_s() - start;
        start = bench_cpu_s();
        assert_ok(tsuya_path_render(&film[k], &path, scene, &lights, &camera, pose, &options, &context));
        seconds[k] = bench_cpu_s() - start;
        tsuya_scene_free(scene);
    }
    printf("detail,triangles,choose_s,build_s,render_s,rmse_to_whole\nwhole,%zu,0,%.2f,%.2f,%.5f\nwithin 0.1 px,%zu,%.2f,%.2f,%.2f,%.5f\n", info.triangles_before, build[1],
           seconds[1], sqrt(film_squared_error(&film[1], &film[0])), info.triangles_after, choose, build[2], seconds[2], sqrt(film_squared_error(&film[2], &film[0])));
    for (int k = 0; k < 3; ++k) {
        tsuya_film_free(&film[k]);
    }
    tsuya_mesh_free(&coarse);
    tsuya_mesh_free(&mesh);
    tsuya_material_free(silk);
    tsuya_light_set_free(&lights);
}

/* With an argument, only the benches whose names match it (bench_turntable, *throughput). */
int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bench_throughput),
        cmocka_unit_test(bench_turntable),
        cmocka_unit_test(bench_detail),
    };
    if (argc > 1) {
        cmocka_set_test_filter(argv[1]);
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
