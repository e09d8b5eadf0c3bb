/* Materials against each other: time to an error with their own sampling and with others', fitted models beside the one they were fitted to, and
 * what the cheapest model that will do saves. */
#include "bench.h"
#include "support.h"

#include "brdf/fit.h"

#include "render/light.h"
#include "render/reflectance.h"

#include "render_bench.h"

enum { PAIRS = 5 };

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

/* Time to an error falls as the error squared: seconds × squared error is what it costs. */
static double cost(const tsuya_mesh *mesh, const tsuya_shader *shader, const tsuya_light_set *lights, const tsuya_film *reference,
                   tsuya_path_options options, double *rmse, double *seconds_out)
{
    tsuya_camera camera;
    tsuya_pose pose;
    scene_camera(&camera, &pose, (tsuya_vec3){3, 0.5, 1}, (tsuya_vec3){0, 0, 0}, 21.0, reference->width_px, reference->height_px);
    double start = bench_cpu_s();
    tsuya_film film = scene_render(mesh, shader, lights, &camera, pose, &options, 1);
    double seconds = bench_cpu_s() - start, error = film_squared_error(&film, reference);
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
        assert_true(bench_median(plain_ratio, PAIRS) >= 4.0); /* the bar: a quarter of the time of sampling the cosine and finding the lamp by chance */
    }
    printf("%s,%s,%.5f,%.5f,%.2f,%.2f\n", name, strategy == TSUYA_STRATEGY_MIS ? "mis" : "bsdf alone", rmse[0], rmse[1], bench_median(ratio, PAIRS),
           bench_median(plain_ratio, PAIRS));
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
    double start = bench_cpu_s();
    tsuya_film film = render_trial(t, lights, 64, 1);
    t->seconds = bench_cpu_s() - start;
    double error = film_squared_error(&film, &t->reference);
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
        printf("%s,%s,%.5f,%.5f,%.3f,%.3f,%.2f\n", name, model[k], ggx.rmse, other.rmse, ggx.seconds, other.seconds, bench_median(ratio, TRIAL_PAIRS));
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
    tsuya_light_set_free(&lamp);
    tsuya_light_set_free(&sky);
}

/* --- the cheapest model that will do --- */

typedef struct stripes {
    tsuya_mesh mesh;
    tsuya_scene *scene;
    tsuya_light_set lights;
    tsuya_camera camera;
    tsuya_pose pose;
} stripes;

/* A plane whose weft turns once every 40 mm. */
static void set_up_stripes(stripes *s, const tsuya_shader *shader, double distance, int side)
{
    tsuya_scene_options options = tsuya_scene_options_default();
    *s = (stripes){.lights = {0}};
    scene_plane(&s->mesh, 1.0, 400);
    scene_turn_weft(&s->mesh, 0.04);
    options.shader = shader;
    options.shader_count = 1;
    assert_ok(tsuya_scene_create(&s->scene, &s->mesh, &options));
    scene_camera(&s->camera, &s->pose, (tsuya_vec3){0.5 * distance, 0, 0.8 * distance}, (tsuya_vec3){0, 0, 0}, fmin(10.0, 60.0 / distance), side, side);
    assert_ok(tsuya_light_set_studio(&s->lights, (tsuya_vec3){0, 0, 0}, 1.0, (tsuya_vec3){0.5, 0, 0.8}, (tsuya_vec3){0, 0, 1}));
}

static tsuya_film render_stripes(const stripes *s, const tsuya_shader *shader, uint64_t seed, double *seconds)
{
    tsuya_context context = tsuya_context_default();
    tsuya_path_options options = options_of(64 * 160 * 160 / (s->camera.width_px * s->camera.width_px), 3); /* as many paths for every size */
    tsuya_film film;
    tsuya_path_info info;
    context.threads = 1;
    context.seed = seed;
    tsuya_scene_set_shader(s->scene, 0, shader);
    double start = bench_cpu_s();
    assert_ok(tsuya_path_render(&film, &info, s->scene, &s->lights, &s->camera, s->pose, &options, &context));
    *seconds = bench_cpu_s() - start;
    return film;
}

/* Difference of two pictures on cube roots, over the first. */
static double cbrt_difference(const tsuya_film *a, const tsuya_film *b)
{
    size_t values = 3 * (size_t)a->width_px * (size_t)a->height_px;
    double off = 0.0, all = 0.0;
    for (size_t k = 0; k < values; ++k) {
        double own = cbrt((double)a->rgb[k]), d = cbrt((double)b->rgb[k]) - own;
        off += d * d;
        all += own * own;
    }
    return sqrt(off / all);
}

/* What --tolerance costs, saves and is off by, beside the noise of the pictures. */
static void tolerance_at(const char *name, const tsuya_material *material, double distance, int side, double tolerance)
{
    stripes s;
    tsuya_shader own, cheap;
    tsuya_material *simple;
    tsuya_reflectance_choice choice;
    tsuya_context context = tsuya_context_default();
    double under[3], seconds[3], ratio[PAIRS], choose;
    assert_ok(tsuya_shader_from_material(&own, material));
    set_up_stripes(&s, &own, distance, side);
    const tsuya_reflectance_view view = {&s.camera, s.pose};
    double start = bench_cpu_s();
    assert_ok(tsuya_reflectance_choose(&simple, under, &choice, s.scene, 0, &view, 1, tolerance, &context));
    choose = bench_cpu_s() - start;
    cheap = own;
    if (simple) {
        assert_ok(tsuya_shader_from_material(&cheap, simple));
        memcpy(cheap.under, under, sizeof under);
    }
    tsuya_film whole = render_stripes(&s, &own, 1, &seconds[0]), again = render_stripes(&s, &own, 2, &seconds[1]), with = render_stripes(&s, &cheap, 1, &seconds[2]);
    double off = cbrt_difference(&whole, &with), noise = cbrt_difference(&whole, &again);
    tsuya_film_free(&whole);
    tsuya_film_free(&again);
    tsuya_film_free(&with);
    for (int pair = 0; pair < PAIRS; ++pair) {
        tsuya_film a = render_stripes(&s, &own, 1, &seconds[0]), b = render_stripes(&s, &cheap, 1, &seconds[2]);
        ratio[pair] = seconds[2] / seconds[0];
        tsuya_film_free(&a);
        tsuya_film_free(&b);
    }
    printf("%s,%g,%.1f,%g,%s,%.2f,%.3f,%.3f,%.2f,%.4f,%.4f\n", name, distance, 1000.0 * hypot(0.5, 0.8) * distance / s.camera.fx_px, tolerance, choice.model, choose, seconds[0], seconds[2], bench_median(ratio, PAIRS), off, noise);
    fflush(stdout);
    tsuya_material_free(simple);
    tsuya_scene_free(s.scene);
    tsuya_light_set_free(&s.lights);
    tsuya_mesh_free(&s.mesh);
}

static void bench_tolerance(void **state)
{
    (void)state;
    const double strength[3] = {0.3, 0.25, 0.2}, dye[3] = {0.1, 0.05, 0.2};
    const tsuya_fit_options options = {.name = "satin", .model = "nurbs3", .tolerance = NAN};
    tsuya_context context = tsuya_context_default();
    tsuya_material *satin, *fitted;
    tsuya_samples samples;
    tsuya_fit_info info;
    const char *path = test_path("tolerance.csv");
    assert_ok(tsuya_material_ggx(&satin, 0.5, 0.15, strength, 1.5, dye));
    write_readings(path, satin);
    assert_ok(tsuya_samples_load(&samples, path));
    assert_ok(tsuya_brdf_fit(&fitted, &info, NULL, NULL, &samples, &options, &context));
    printf("tolerance_of,distance_m,pixel_mm,tolerance,rendered_as,choose_s,seconds_own,seconds_cheap,time_over_own,picture_off_cbrt,noise_cbrt\n");
    for (int k = 0; k < 3; ++k) { /* pixels much smaller than a turn of the weft, and larger */
        const double distance[3] = {0.3, 5.0, 40.0};
        const int side[3] = {160, 160, 16};
        tolerance_at("ggx-aniso", satin, distance[k], side[k], 0.12);
        tolerance_at("nurbs3", fitted, distance[k], side[k], 0.12);
    }
    tsuya_samples_free(&samples);
    tsuya_material_free(satin);
    tsuya_material_free(fitted);
}

/* With an argument, only the benches whose names match it. */
int main(int argc, char **argv)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(bench_satin),
        cmocka_unit_test(bench_fitted),
        cmocka_unit_test(bench_tolerance),
    };
    if (argc > 1) {
        cmocka_set_test_filter(argv[1]);
    }
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
