/* Cheaper reflectance models, held against the whole one in pictures of the path tracer. */
#include "support.h"

#include "brdf/fit.h"

#include "render/reflectance.h"

#include "render_scenes.h"

enum { SIDE = 48 };

/* A plane of satin whose weft turns once every 40 mm, seen from above under a lamp. */
typedef struct studio {
    tsuya_mesh mesh;
    tsuya_material *satin;
    tsuya_shader shader;
    tsuya_scene *scene;
    tsuya_camera camera;
    tsuya_pose pose;
} studio;

static void set_up_studio(studio *s, double distance)
{
    const double strength[3] = {0.3, 0.25, 0.2}, dye[3] = {0.1, 0.05, 0.2};
    tsuya_scene_options options = tsuya_scene_options_default();
    scene_plane(&s->mesh, 1.0, 400);
    scene_turn_weft(&s->mesh, 0.04);
    assert_ok(tsuya_material_ggx(&s->satin, 0.5, 0.15, strength, 1.5, dye));
    assert_ok(tsuya_shader_from_material(&s->shader, s->satin));
    options.shader = &s->shader;
    options.shader_count = 1;
    assert_ok(tsuya_scene_create(&s->scene, &s->mesh, &options));
    scene_camera(&s->camera, &s->pose, (tsuya_vec3){0.5 * distance, 0, 0.8 * distance}, (tsuya_vec3){0, 0, 0}, 10.0, SIDE, SIDE);
}

static void tear_down_studio(studio *s)
{
    tsuya_scene_free(s->scene);
    tsuya_material_free(s->satin);
    tsuya_mesh_free(&s->mesh);
}

static void choose(tsuya_material **simple, double under[3], tsuya_reflectance_choice *choice, const studio *s, double tolerance)
{
    const tsuya_reflectance_view view = {&s->camera, s->pose};
    tsuya_context context = tsuya_context_default();
    assert_ok(tsuya_reflectance_choose(simple, under, choice, s->scene, 0, &view, 1, tolerance, &context));
    for (int k = 0; k < choice->tried; ++k) {
        print_message("%s %.4f  ", choice->candidate[k], choice->candidate_error[k]);
    }
    print_message("-> %s (%d pixels)\n", choice->model, choice->pixels);
}

static tsuya_film picture(studio *s, const tsuya_shader *shader)
{
    tsuya_context context = tsuya_context_default();
    tsuya_light_set lights = {0};
    tsuya_path_options options = options_of(256, 1);
    tsuya_film film;
    tsuya_path_info info;
    add_light(&lights, (tsuya_light){.kind = TSUYA_LIGHT_POINT, .position_m = {-8, 3, 12}, .rgb = {200, 200, 200}});
    tsuya_scene_set_shader(s->scene, 0, shader);
    assert_ok(tsuya_path_render(&film, &info, s->scene, &lights, &s->camera, s->pose, &options, &context));
    tsuya_light_set_free(&lights);
    return film;
}

/* Where a pixel covers whole turns of the weft no lobe with a direction is needed, and the picture says so too; near by it is. */
static void test_far_pixels_need_no_direction(void **state)
{
    (void)state;
    studio s;
    tsuya_material *simple;
    tsuya_shader shader;
    tsuya_reflectance_choice choice;
    double under[3], off = 0.0, all = 0.0;
    const double tolerance = 0.12;
    set_up_studio(&s, 40.0);
    choose(&simple, under, &choice, &s, tolerance);
    assert_non_null(simple);
    assert_string_equal(choice.model, "ggx");
    assert_true(choice.error <= tolerance && choice.candidate_error[0] > tolerance);
    assert_ok(tsuya_shader_from_material(&shader, simple));
    tsuya_film full = picture(&s, &s.shader), cheap = picture(&s, &shader);
    for (int k = 0; k < 3 * SIDE * SIDE; ++k) {
        double d = cbrt((double)cheap.rgb[k]) - cbrt((double)full.rgb[k]);
        off += d * d;
        all += pow(cbrt((double)full.rgb[k]), 2.0);
    }
    print_message("pictures differ by %.4f on cube roots\n", sqrt(off / all));
    assert_true(sqrt(off / all) <= 1.5 * tolerance);
    tsuya_film_free(&full);
    tsuya_film_free(&cheap);
    tsuya_material_free(simple);
    tear_down_studio(&s);
    set_up_studio(&s, 0.3);
    choose(&simple, under, &choice, &s, tolerance);
    assert_null(simple);
    assert_string_equal(choice.model, "ggx-aniso");
    assert_int_equal(choice.tried, 2);
    choose(&simple, under, &choice, &s, 0.0);
    assert_null(simple);
    assert_int_equal(choice.tried, 0);
    tear_down_studio(&s);
}

/* A diffuse part that a lobe's fit finds belongs under any dye: with a dye that a caller gives, too, the values are the material's. */
static void test_a_refit_is_the_material_again(void **state)
{
    (void)state;
    const double strength[3] = {0.3, 0.25, 0.2}, dye[3] = {0.1, 0.05, 0.2};
    tsuya_material *satin, *again, *plain;
    double diffuse[3], a[3], b[3], off = 0.0, all = 0.0;
    assert_ok(tsuya_material_ggx(&satin, 0.5, 0.15, strength, 1.5, dye));
    assert_ok(tsuya_material_refit(&again, diffuse, satin, "ggx-aniso"));
    for (uint64_t k = 0; k < 2000; ++k) {
        double t[4];
        for (uint64_t c = 0; c < 4; ++c) {
            t[c] = tsuya_random_uniform(3, c, k);
        }
        tsuya_vec3 w[2];
        for (int i = 0; i < 2; ++i) {
            double z = 0.2 + 0.8 * t[2 * i], r = sqrt(1.0 - z * z), phi = 2.0 * M_PI * t[2 * i + 1];
            w[i] = (tsuya_vec3){r * cos(phi), r * sin(phi), z};
        }
        tsuya_material_eval(satin, NULL, w[0], w[1], a);
        tsuya_material_eval(again, NULL, w[0], w[1], b);
        for (int c = 0; c < 3; ++c) {
            off += pow(cbrt(b[c] * w[0].z) - cbrt(a[c] * w[0].z), 2.0);
            all += pow(cbrt(a[c] * w[0].z), 2.0);
        }
    }
    print_message("refit: off by %.4f on cube roots, diffuse %.5f %.5f %.5f\n", sqrt(off / all), diffuse[0], diffuse[1], diffuse[2]);
    assert_true(sqrt(off / all) < 0.03);
    assert_ok(tsuya_material_lambert(&plain, dye));
    tsuya_material *matte;
    assert_ok(tsuya_material_refit(&matte, diffuse, plain, "ggx"));
    tsuya_material_free(matte);
    assert_fails(tsuya_material_refit(&matte, diffuse, plain, "velvet"), "velvet");
    tsuya_material_free(plain);
    tsuya_material_free(again);
    tsuya_material_free(satin);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_far_pixels_need_no_direction),
        cmocka_unit_test(test_a_refit_is_the_material_again),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
