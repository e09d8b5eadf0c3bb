/* Light transport where renderers go wrong: meshes, views, input and memory that give nothing good. */
#include "support.h"

#include "core/memory.h"

#include "render_scenes.h"

static void check_finite(const tsuya_film *film)
{
    for (size_t k = 0; k < 3 * (size_t)film->width_px * (size_t)film->height_px; ++k) {
        assert_true(isfinite(film->rgb[k]) && film->rgb[k] >= 0.0f);
    }
}

static void test_hard_meshes(void **state)
{
    (void)state;
    tsuya_camera camera;
    tsuya_pose pose;
    tsuya_light_set lights = {0};
    tsuya_shader shader = lambert(0.5);
    tsuya_path_options options = options_of(16, 4);
    twenty_lamps(&lights);
    scene_camera(&camera, &pose, (tsuya_vec3){3, 0.5, 1}, (tsuya_vec3){0, 0, 0}, 40.0, 24, 24);
    tsuya_mesh mesh;
    assert_ok(tsuya_mesh_create(&mesh, 0, 0, 0)); /* empty: the sky and the lamps remain */
    tsuya_film film = scene_render(&mesh, &shader, &lights, &camera, pose, &options, 2);
    assert_true(fabs(film.rgb[2] - 0.4f) < 1e-6f && film.alpha[0] == 0.0f);
    check_finite(&film);
    tsuya_film_free(&film);
    tsuya_mesh_free(&mesh);
    for (int kind = 0; kind < 5; ++kind) {
        assert_ok(tsuya_mesh_create(&mesh, 5, 3, kind == 0 ? 0 : TSUYA_MESH_NORMAL | TSUYA_MESH_WEFT));
        const float position[15] = {-1, -1, 0, 1, -1, 0, 0, 1, 0, 0, 1, 0, kind == 3 ? 1e-30f : 0.5f, -1, kind == 3 ? 1e-30f : 0.0f};
        const uint32_t triangle[9] = {0, 1, 2, 2, 2, 3, 0, 4, 1}; /* one good, one without an edge, one without an area */
        memcpy(mesh.position, position, sizeof position);
        memcpy(mesh.triangle, triangle, sizeof triangle);
        for (size_t v = 0; v < 5 && kind > 0; ++v) {
            mesh.normal[3 * v + 2] = kind == 2 ? 0.0f : kind == 4 ? NAN : -1.0f; /* zero, not a number, or turned away */
            mesh.normal[3 * v] = kind == 1 ? 1.0f : 0.0f;
            mesh.weft[3 * v + 2] = 1.0f;
        }
        film = scene_render(&mesh, &shader, &lights, &camera, pose, &options, 2);
        check_finite(&film);
        assert_true(film.alpha[12 * 24 + 12] == 1.0f && film.rgb[3 * (12 * 24 + 12)] > 0.0f);
        tsuya_film_free(&film);
        tsuya_mesh_free(&mesh);
    }
    tsuya_light_set_free(&lights);
}

static void test_grazing_view(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_light_set lights = {0};
    tsuya_camera camera;
    tsuya_pose pose;
    tsuya_material *silk;
    tsuya_shader shader;
    tsuya_path_options options = options_of(64, 3);
    assert_ok(tsuya_material_default_silk(&silk));
    assert_ok(tsuya_shader_from_material(&shader, silk));
    scene_plane(&mesh, 2.0, 8);
    twenty_lamps(&lights);
    for (int k = 0; k < 3; ++k) {
        const double height[3] = {1e-2, 1e-6, 0.0};
        scene_camera(&camera, &pose, (tsuya_vec3){3, 0.1, height[k]}, (tsuya_vec3){0, 0, 0}, 20.0, 21, 21);
        tsuya_film film = scene_render(&mesh, &shader, &lights, &camera, pose, &options, 2);
        check_finite(&film);
        tsuya_film_free(&film);
    }
    tsuya_material_free(silk);
    tsuya_light_set_free(&lights);
    tsuya_mesh_free(&mesh);
}

static void test_refusals(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_scene *scene;
    tsuya_shader shader = lambert(0.5);
    tsuya_scene_options options = tsuya_scene_options_default();
    scene_plane(&mesh, 2.0, 8);
    assert_fails(tsuya_scene_create(&scene, &mesh, &options), "no material");
    options.shader = &shader;
    options.shader_count = 1;
    mesh.position[3 * 17 + 1] = NAN;
    assert_fails(tsuya_scene_create(&scene, &mesh, &options), "vertex 17");
    mesh.position[3 * 17 + 1] = INFINITY;
    assert_fails(tsuya_scene_create(&scene, &mesh, &options), "vertex 17");
    mesh.position[3 * 17 + 1] = 0.0f;
    mesh.triangle[3 * 5 + 2] = 9999;
    assert_fails(tsuya_scene_create(&scene, &mesh, &options), "9999");
    mesh.triangle[3 * 5 + 2] = 0;
    options.dye = TSUYA_DYE_OF_VERTICES;
    assert_fails(tsuya_scene_create(&scene, &mesh, &options), "vertex colours");
    options.dye = TSUYA_DYE_OF_COLOR;
    options.dye_rgb[1] = 2.0;
    assert_fails(tsuya_scene_create(&scene, &mesh, &options), "[0, 1]");
    tsuya_mesh_free(&mesh);
}

static void test_every_allocation_failing(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_camera camera;
    tsuya_pose pose;
    tsuya_light_set lights = {0};
    tsuya_shader shader = lambert(0.5);
    tsuya_scene_options scene_options = tsuya_scene_options_default();
    tsuya_path_options options = options_of(2, 2);
    tsuya_context context = tsuya_context_default();
    scene_options.shader = &shader;
    scene_options.shader_count = 1;
    scene_plane(&mesh, 2.0, 2);
    twenty_lamps(&lights);
    scene_camera(&camera, &pose, (tsuya_vec3){3, 0.1, 1}, (tsuya_vec3){0, 0, 0}, 20.0, 8, 8);
    for (uint64_t n = 1;; ++n) {
        tsuya_scene *scene = NULL;
        tsuya_film film = {0};
        tsuya_path_info info;
        tsuya_memory_fail_at(n);
        tsuya_status status = tsuya_scene_create(&scene, &mesh, &scene_options);
        if (status == TSUYA_OK) {
            status = tsuya_path_render(&film, &info, scene, &lights, &camera, pose, &options, &context);
        }
        tsuya_memory_fail_at(0);
        tsuya_scene_free(scene);
        tsuya_film_free(&film);
        if (status == TSUYA_OK) {
            assert_true(n > 5);
            break;
        }
        assert_int_equal(status, TSUYA_ERROR_MEMORY);
    }
    tsuya_light_set_free(&lights);
    tsuya_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_hard_meshes),
        cmocka_unit_test(test_grazing_view),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_every_allocation_failing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
