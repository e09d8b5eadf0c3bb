/* Throughput with shading against a bare Embree loop that traces the same rays: one process, in pairs, one thread and two. */
#include "bench.h"
#include "support.h"

#include <omp.h>
#include <time.h>

#include "brdf/fit.h"
#include "core/memory.h"

#include "render/detail.h"
#include "render/light.h"

#include "render_scenes.h"

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

/* Processor time: other work on the machine does not count. */
static double cpu_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

/* Processor seconds a thread of the rays alone, and how many met something (so that nothing is optimised away): one by one, ... */
static double trace_single(const tsuya_ray_scene *scene, const ray_list *list, int threads, size_t *met)
{
    size_t hits = 0;
    double start = cpu_s();
#pragma omp parallel for schedule(static, 4096) num_threads(threads) reduction(+ : hits)
    for (size_t k = 0; k < list->count; ++k) {
        tsuya_ray_hit hit;
        hits += list->shadow[k] ? tsuya_ray_scene_occluded(scene, &list->ray[k]) : tsuya_ray_scene_intersect(scene, &list->ray[k], &hit);
    }
    *met = hits;
    return (cpu_s() - start) / threads;
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
    double start = cpu_s();
#pragma omp parallel for schedule(static, 1) num_threads(threads) reduction(+ : hits)
    for (size_t b = 0; b < blocks; ++b) {
        size_t ray = first[b];
        for (size_t k = b * AT_ONCE; k < list->packets && k < (b + 1) * AT_ONCE; ray += list->packet[k++]) {
            hits += trace_packet(scene, &list->ray[ray], list->packet[k], list->shadow[ray]);
        }
    }
    *met = hits;
    tsuya_free(first);
    return (cpu_s() - start) / threads;
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
    double start = cpu_s();
    assert_ok(tsuya_path_render(&film, &info, scene, lights, camera, pose, options, &context));
    double seconds = (cpu_s() - start) / threads;
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
    double share = median(one.packets, PAIRS);
    printf("%zu,%s,%s,%.2f,%.3f,%.3f,%.2f,%.3f,%.3f,%.3f\n", mesh.triangle_count, light == 0 ? "point" : "studio", material, median(one.rate, PAIRS), share,
           median(one.single, PAIRS), median(two.rate, PAIRS), median(two.packets, PAIRS), median(scaling, PAIRS), (double)met / (double)list.count);
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

/* --- satin: its own sampling against a cosine's --- */

static double cosine_eval_pdf(const void *user, const double *dye, tsuya_vec3 wi, tsuya_vec3 wo, double value[3])
{
    tsuya_material_eval(user, dye, wi, wo, value);
    return wi.z > 0.0 && wo.z > 0.0 ? wi.z / M_PI : 0.0;
}

static bool cosine_sample(const void *user, const double *dye, tsuya_vec3 wo, const double u[3], tsuya_vec3 *wi)
{
    (void)user, (void)dye, (void)wo;
    double r = sqrt(u[0]), phi = 2.0 * M_PI * u[1];
    *wi = (tsuya_vec3){r * cos(phi), r * sin(phi), sqrt(1.0 - u[0])};
    return wi->z > 0.0;
}

static double squared_error(const tsuya_film *film, const tsuya_film *reference)
{
    size_t values = 3 * (size_t)film->width_px * (size_t)film->height_px;
    double sum = 0.0;
    for (size_t k = 0; k < values; ++k) {
        double d = (double)film->rgb[k] - (double)reference->rgb[k];
        sum += d * d;
    }
    return sum / (double)values;
}

/* Time to an error falls as the error squared: seconds × squared error is what it costs. */
static double cost(const tsuya_mesh *mesh, const tsuya_shader *shader, const tsuya_light_set *lights, const tsuya_film *reference,
                   tsuya_path_options options, double *rmse, double *seconds_out)
{
    tsuya_camera camera;
    tsuya_pose pose;
    scene_camera(&camera, &pose, (tsuya_vec3){3, 0.5, 1}, (tsuya_vec3){0, 0, 0}, 21.0, reference->width_px, reference->height_px);
    double start = cpu_s();
    tsuya_film film = scene_render(mesh, shader, lights, &camera, pose, &options, 1);
    double seconds = cpu_s() - start, error = squared_error(&film, reference);
    tsuya_film_free(&film);
    *rmse = sqrt(error);
    *seconds_out = seconds;
    return seconds * error;
}

/* Under `mis` both have the lamps' samples as well; under `bsdf alone` neither; the last column holds the renderer as it is against plain
 * cosine sampling. */
static void satin_under(const char *name, const tsuya_light_set *lights, tsuya_strategy strategy)
{
    enum { SIDE = 40 };
    const double plain[3] = {0.3, 0.3, 0.3}, black[3] = {0.02, 0.02, 0.02};
    tsuya_material *satin;
    tsuya_shader own, cosine = {.eval_pdf = cosine_eval_pdf, .sample = cosine_sample};
    tsuya_mesh mesh;
    tsuya_camera camera;
    tsuya_pose pose;
    tsuya_path_options options = tsuya_path_options_default();
    double rmse[3], seconds[3], ratio[PAIRS], plain_ratio[PAIRS];
    assert_ok(tsuya_material_ggx(&satin, 0.25, 0.06, plain, 1.5, black));
    assert_ok(tsuya_shader_from_material(&own, satin));
    cosine.user = satin;
    scene_sphere(&mesh, 0.5, 48, false);
    scene_camera(&camera, &pose, (tsuya_vec3){3, 0.5, 1}, (tsuya_vec3){0, 0, 0}, 21.0, SIDE, SIDE);
    options.spp = 16384;
    options.bounces = 2;
    tsuya_film reference = scene_render(&mesh, &own, lights, &camera, pose, &options, 2);
    options.spp = 64;
    options.strategy = strategy;
    for (int pair = 0; pair < PAIRS; ++pair) {
        double ours = cost(&mesh, &own, lights, &reference, options, &rmse[0], &seconds[0]);
        ratio[pair] = cost(&mesh, &cosine, lights, &reference, options, &rmse[1], &seconds[1]) / ours;
        tsuya_path_options plain_options = options;
        plain_options.strategy = TSUYA_STRATEGY_BSDF;
        plain_ratio[pair] = cost(&mesh, &cosine, lights, &reference, plain_options, &rmse[2], &seconds[2]) / ours;
    }
    if (strategy == TSUYA_STRATEGY_MIS) {
        bench_point(name, "own density", rmse[0], "rmse", seconds[0], "s");
        bench_point(name, "cosine", rmse[1], "rmse", seconds[1], "s");
        assert_true(median(plain_ratio, PAIRS) >= 4.0); /* the bar: a quarter of the time of sampling the cosine and finding the lamp by chance */
    }
    printf("%s,%s,%.5f,%.5f,%.2f,%.2f\n", name, strategy == TSUYA_STRATEGY_MIS ? "mis" : "bsdf alone", rmse[0], rmse[1], median(ratio, PAIRS),
           median(plain_ratio, PAIRS));
    fflush(stdout);
    tsuya_film_free(&reference);
    tsuya_material_free(satin);
    tsuya_mesh_free(&mesh);
}

static void add_small_lamp(tsuya_light_set *lights)
{
    add_light(lights, (tsuya_light){.kind = TSUYA_LIGHT_RECT, .position_m = {2, -1, 2}, .direction = {-2, 1, -2}, .size_m = {0.4, 0.4}, .rgb = {30, 30, 30}});
}

/* A sky with a bright half and windows in it. */
static void add_windows(tsuya_light_set *lights)
{
    enum { W = 128, H = 64 };
    tsuya_image image;
    tsuya_light map = {.kind = TSUYA_LIGHT_ENVIRONMENT, .rgb = {1, 1, 1}};
    assert_ok(tsuya_image_create(&image, W, H, 3, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    for (int k = 0; k < W * H; ++k) {
        float *pixel = tsuya_image_f32(&image, k % W, k / W), value = k % W < W / 2 ? 1.0f : 0.2f;
        value += k / W > 18 && k / W < 26 && k % 16 < 4 ? 6.0f : 0.0f;
        pixel[0] = pixel[1] = pixel[2] = value;
    }
    assert_ok(tsuya_environment_create(&map.map, &image, (tsuya_vec3){1, 0, 0}, (tsuya_vec3){0, 0, 1}, "map"));
    add_light(lights, map);
    tsuya_image_free(&image);
}

static void bench_satin(void **state)
{
    (void)state;
    tsuya_light_set lamp = {0}, sky = {0};
    add_small_lamp(&lamp);
    add_windows(&sky);
    printf("satin_under,strategy,rmse_own,rmse_cosine,time_of_cosine_over_own_at_equal_error,time_of_plain_cosine_sampling_over_own\n");
    for (int k = 0; k < 2; ++k) {
        satin_under("small lamp", &lamp, k ? TSUYA_STRATEGY_BSDF : TSUYA_STRATEGY_MIS);
        satin_under("environment", &sky, k ? TSUYA_STRATEGY_BSDF : TSUYA_STRATEGY_MIS);
    }
    tsuya_light_set_free(&lamp);
    tsuya_light_set_free(&sky);
}

/* Readings of a reflectance on the paper's bench, as a table of directions. */
static void write_readings(const char *path, const tsuya_material *material)
{
    FILE *file = fopen(path, "w");
    assert_non_null(file);
    fprintf(file, "# quantity=brdf\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b\n");
    for (int azimuth = 0; azimuth < 180; azimuth += 45) {
        for (int tilt = -57; tilt <= 57; tilt += 3) {
            double side[2] = {30.0, -30.0}, angle[2][2];
            tsuya_vec3 w[2];
            for (int k = 0; k < 2; ++k) {
                double t = tsuya_rad_from_deg(side[k] - tilt), a = tsuya_rad_from_deg(azimuth);
                w[k] = (tsuya_vec3){sin(t) * cos(a), sin(t) * sin(a), cos(t)};
                angle[k][0] = tsuya_deg_from_rad(acos(w[k].z));
                angle[k][1] = tsuya_deg_from_rad(atan2(w[k].y, w[k].x));
            }
            double f[3];
            tsuya_material_eval(material, NULL, w[0], w[1], f);
            fprintf(file, "%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g\n", angle[0][0], angle[0][1], angle[1][0], angle[1][1], f[0], f[1], f[2]);
        }
    }
    assert_int_equal(fclose(file), 0);
}

/* A material on a sphere, and what a long time of rendering says of it. */
typedef struct trial {
    tsuya_scene *scene;
    tsuya_film reference;
    double rmse, seconds; /* of the last picture */
} trial;

enum { TRIAL_SIDE = 40, TRIAL_PAIRS = 15 };

static tsuya_film render_trial(const trial *t, const tsuya_light_set *lights, int spp, int threads)
{
    tsuya_camera camera;
    tsuya_pose pose;
    tsuya_film film;
    tsuya_path_info info;
    tsuya_path_options options = options_of(spp, 2);
    tsuya_context context = tsuya_context_default();
    context.threads = threads;
    scene_camera(&camera, &pose, (tsuya_vec3){3, 0.5, 1}, (tsuya_vec3){0, 0, 0}, 21.0, TRIAL_SIDE, TRIAL_SIDE);
    assert_ok(tsuya_path_render(&film, &info, t->scene, lights, &camera, pose, &options, &context));
    return film;
}

static void start_trial(trial *t, const tsuya_material *material, const tsuya_mesh *mesh, const tsuya_light_set *lights)
{
    tsuya_shader shader;
    tsuya_scene_options options = tsuya_scene_options_default();
    assert_ok(tsuya_shader_from_material(&shader, material));
    options.shader = &shader;
    options.shader_count = 1;
    assert_ok(tsuya_scene_create(&t->scene, mesh, &options));
    t->reference = render_trial(t, lights, 8192, 2);
}

static void end_trial(trial *t)
{
    tsuya_film_free(&t->reference);
    tsuya_scene_free(t->scene);
}

/* Time to an error falls as the error squared: what sampling and evaluation cost together. */
static double trial_cost(trial *t, const tsuya_light_set *lights)
{
    double start = cpu_s();
    tsuya_film film = render_trial(t, lights, 64, 1);
    t->seconds = cpu_s() - start;
    double error = squared_error(&film, &t->reference);
    t->rmse = sqrt(error);
    tsuya_film_free(&film);
    return t->seconds * error;
}

/* Fitted models against the anisotropic GGX that they were fitted to: the same roughness. */
static void fitted_under(const char *name, const tsuya_light_set *lights)
{
    static const char *const model[] = {"yarn", "ndf", "nurbs3"};
    const double plain[3] = {0.3, 0.3, 0.3}, dye[3] = {0.05, 0.05, 0.05};
    tsuya_context context = tsuya_context_default();
    tsuya_material *satin, *fitted;
    tsuya_samples samples;
    tsuya_fit_info info;
    tsuya_mesh mesh;
    trial ggx, other;
    const char *path = test_path("readings.csv");
    scene_sphere(&mesh, 0.5, 48, false);
    assert_ok(tsuya_material_ggx(&satin, 0.35, 0.15, plain, 1.5, dye));
    write_readings(path, satin);
    start_trial(&ggx, satin, &mesh, lights);
    for (int k = 0; k < 3; ++k) {
        const tsuya_fit_options options = {.name = "satin", .model = model[k], .tolerance = NAN};
        double ratio[TRIAL_PAIRS];
        assert_ok(tsuya_samples_load(&samples, path));
        assert_ok(tsuya_brdf_fit(&fitted, &info, NULL, NULL, &samples, &options, &context));
        start_trial(&other, fitted, &mesh, lights);
        for (int pair = 0; pair < TRIAL_PAIRS; ++pair) {
            ratio[pair] = trial_cost(&other, lights) / trial_cost(&ggx, lights);
        }
        printf("%s,%s,%.5f,%.5f,%.3f,%.3f,%.2f\n", name, model[k], ggx.rmse, other.rmse, ggx.seconds, other.seconds, median(ratio, TRIAL_PAIRS));
        fflush(stdout);
        end_trial(&other);
        tsuya_samples_free(&samples);
        tsuya_material_free(fitted);
    }
    end_trial(&ggx);
    tsuya_material_free(satin);
    tsuya_mesh_free(&mesh);
}

static void bench_fitted(void **state)
{
    (void)state;
    tsuya_light_set lamp = {0}, sky = {0};
    add_small_lamp(&lamp);
    add_windows(&sky);
    printf("fitted_under,model,rmse_ggx,rmse,seconds_ggx,seconds,time_over_ggx_at_equal_error\n");
    fitted_under("small lamp", &lamp);
    fitted_under("environment", &sky);
    test_folder_remove();
    tsuya_light_set_free(&lamp);
    tsuya_light_set_free(&sky);
}

/* A garment of half a million triangles under one small lamp, one of 36 views: what 3 % of noise takes. */
static void bench_turntable(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_light_set lights = {0};
    tsuya_camera camera;
    tsuya_pose pose;
    tsuya_scene *scene;
    tsuya_material *silk;
    tsuya_shader shader;
    tsuya_film film;
    tsuya_path_info info;
    tsuya_context context = tsuya_context_default();
    tsuya_scene_options scene_options = tsuya_scene_options_default();
    tsuya_path_options options = tsuya_path_options_default();
    assert_ok(tsuya_material_default_silk(&silk));
    assert_ok(tsuya_shader_from_material(&shader, silk));
    scene_options.shader = &shader;
    scene_options.shader_count = 1;
    options.spp = 4096;
    options.noise = 0.03;
    scene_drape(&mesh, 500);
    add_light(&lights, (tsuya_light){.kind = TSUYA_LIGHT_DISK, .position_m = {2, -2, 2.5}, .direction = {-2, 2, -2.2}, .size_m = {0.1, 0.1}, .rgb = {1500, 1500, 1500}});
    scene_camera(&camera, &pose, (tsuya_vec3){3, -1, 1}, (tsuya_vec3){0, 0, 0.1}, 33.0, 1280, 960);
    assert_ok(tsuya_scene_create(&scene, &mesh, &scene_options));
    double start = cpu_s();
    assert_ok(tsuya_path_render(&film, &info, scene, &lights, &camera, pose, &options, &context));
    double processor_s = cpu_s() - start;
    printf("turntable_triangles,seconds_a_view,processor_s,threads,spp_mean,noise_median,mrays_per_s,peak_mb\n%zu,%.2f,%.2f,%d,%.2f,%.4f,%.2f,%.0f\n",
           mesh.triangle_count, info.seconds, processor_s, context.threads, info.spp_mean, info.noise_median, 1e-6 * (double)info.rays / info.seconds,
           tsuya_peak_memory_mb());
    fflush(stdout);
    tsuya_film_free(&film);
    tsuya_scene_free(scene);
    tsuya_material_free(silk);
    tsuya_light_set_free(&lights);
    tsuya_mesh_free(&mesh);
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
    double start = cpu_s();
    assert_ok(tsuya_mesh_detail(&coarse, &info, &mesh, &view, 1, &detail, &context));
    choose = cpu_s() - start;
    for (int k = 0; k < 3; ++k) { /* whole, whole with another seed, simplified */
        tsuya_scene_options scene_options = tsuya_scene_options_default();
        tsuya_scene *scene;
        tsuya_path_info path;
        scene_options.shader = &shader;
        scene_options.shader_count = 1;
        context.seed = (uint64_t)k;
        start = cpu_s();
        assert_ok(tsuya_scene_create(&scene, k == 2 && coarse.vertex_count > 0 ? &coarse : &mesh, &scene_options));
        build[k] = cpu_s() - start;
        start = cpu_s();
        assert_ok(tsuya_path_render(&film[k], &path, scene, &lights, &camera, pose, &options, &context));
        seconds[k] = cpu_s() - start;
        tsuya_scene_free(scene);
    }
    printf("detail,triangles,choose_s,build_s,render_s,rmse_to_whole\nwhole,%zu,0,%.2f,%.2f,%.5f\nwithin 0.1 px,%zu,%.2f,%.2f,%.2f,%.5f\n", info.triangles_before, build[1],
           seconds[1], sqrt(squared_error(&film[1], &film[0])), info.triangles_after, choose, build[2], seconds[2], sqrt(squared_error(&film[2], &film[0])));
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
        cmocka_unit_test(bench_satin),
        cmocka_unit_test(bench_fitted),
        cmocka_unit_test(bench_turntable),
        cmocka_unit_test(bench_detail),
    };
    if (argc > 1) {
        cmocka_set_test_filter(argv[1]);
    }
    return cmocka_run_group_tests(tests, NULL, NULL);
}
