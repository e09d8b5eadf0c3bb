/* Throughput with shading against a bare Embree loop that traces the same rays: one process, in pairs, one thread and two. */
#include "support.h"

#include <omp.h>

#include "core/memory.h"

#include "render/light.h"

#include "render_scenes.h"

enum { WIDTH = 320, HEIGHT = 240, SPP = 8, PAIRS = 5 };

typedef struct ray_list {
    tsuya_ray *ray;
    bool *shadow;
    size_t count, room;
} ray_list;

static void keep_ray(void *user, const tsuya_ray *ray, bool shadow)
{
    ray_list *list = user;
    if (list->count == list->room) {
        list->room = list->room ? 2 * list->room : 1 << 20;
        list->ray = tsuya_realloc(list->ray, list->room, sizeof *list->ray);
        list->shadow = tsuya_realloc(list->shadow, list->room, sizeof *list->shadow);
        assert_true(list->ray && list->shadow);
    }
    list->ray[list->count] = *ray;
    list->shadow[list->count++] = shadow;
}

/* Seconds of the rays alone, and how many met something (so that nothing is optimised away). */
static double trace_bare(const tsuya_ray_scene *scene, const ray_list *list, int threads, size_t *met)
{
    size_t hits = 0;
    double start = tsuya_clock_s();
#pragma omp parallel for schedule(static, 4096) num_threads(threads) reduction(+ : hits)
    for (size_t k = 0; k < list->count; ++k) {
        tsuya_ray_hit hit;
        hits += list->shadow[k] ? tsuya_ray_scene_occluded(scene, &list->ray[k]) : tsuya_ray_scene_intersect(scene, &list->ray[k], &hit);
    }
    *met = hits;
    return tsuya_clock_s() - start;
}

static double median(double *value, int count)
{
    for (int i = 1; i < count; ++i) {
        for (int j = i; j > 0 && value[j] < value[j - 1]; --j) {
            double swap = value[j];
            value[j] = value[j - 1];
            value[j - 1] = swap;
        }
    }
    return value[count / 2];
}

static double render_seconds(const tsuya_scene *scene, const tsuya_light_set *lights, const tsuya_camera *camera, tsuya_pose pose,
                             const tsuya_path_options *options, int threads, double *mean)
{
    tsuya_context context = tsuya_context_default();
    tsuya_film film;
    tsuya_path_info info;
    context.threads = threads;
    assert_ok(tsuya_path_render(&film, &info, scene, lights, camera, pose, options, &context));
    *mean = film_mean(&film, 1);
    tsuya_film_free(&film);
    return info.seconds;
}

static void studio(tsuya_light_set *lights, int kind)
{
    if (kind == 0) {
        add_light(lights, (tsuya_light){.kind = TSUYA_LIGHT_POINT, .position_m = {2, -2, 2.5}, .rgb = {12, 12, 12}});
    } else {
        assert_ok(tsuya_light_set_studio(lights, (tsuya_vec3){0, 0, 0.3}, 1.0, (tsuya_vec3){3, 1, 1}, (tsuya_vec3){0, 0, 1}));
    }
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
    double ratio[2][PAIRS], rate[2][PAIRS], mean = 0.0;
    size_t met;
    scene_options.shader = shader;
    scene_options.shader_count = 1;
    options.spp = SPP;
    scene_drape(&mesh, cells);
    studio(&lights, light);
    scene_camera(&camera, &pose, (tsuya_vec3){3, 1, 1}, (tsuya_vec3){0, 0, 0.2}, 33.0, WIDTH, HEIGHT);
    assert_ok(tsuya_scene_create(&scene, &mesh, &scene_options));
    assert_ok(tsuya_ray_scene_create(&bare, &mesh));
    options.ray_sink = keep_ray;
    options.ray_user = &list;
    render_seconds(scene, &lights, &camera, pose, &options, 1, &mean);
    options.ray_sink = NULL;
    for (int pair = 0; pair < PAIRS; ++pair) {
        for (int threads = 1; threads <= 2; ++threads) {
            double shaded = render_seconds(scene, &lights, &camera, pose, &options, threads, &mean);
            double alone = trace_bare(bare, &list, threads, &met);
            ratio[threads - 1][pair] = alone / shaded;
            rate[threads - 1][pair] = 1e-6 * (double)list.count / shaded;
        }
    }
    printf("%zu,%s,%s,%.2f,%.3f,%.2f,%.3f,%.3f\n", mesh.triangle_count, light == 0 ? "point" : "studio", material,
           median(rate[0], PAIRS), median(ratio[0], PAIRS), median(rate[1], PAIRS), median(ratio[1], PAIRS),
           (double)met / (double)list.count);
    fflush(stdout);
    tsuya_free(list.ray);
    tsuya_free(list.shadow);
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
    printf("triangles,lamp,material,mrays_per_s_1,of_bare_1,mrays_per_s_2,of_bare_2,met_fraction\n");
    for (int cells = 316; cells <= 1000; cells += 684) {
        for (int light = 0; light < 2; ++light) {
            bench_scene(cells, light, &matte, "lambert");
            bench_scene(cells, light, &shader, "ggx-aniso");
        }
    }
    tsuya_material_free(silk);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(bench_throughput)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
