/* Ten million triangles: built, hit where geometry says, and shaded as the textbook has it. */
#include "support.h"

#include "render_scenes.h"

enum { CELLS = 2237 };

static void test_ten_million_triangles(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_light_set lights = {0};
    tsuya_camera camera;
    tsuya_pose pose;
    tsuya_shader shader = lambert(0.5);
    tsuya_path_options options = options_of(4, 1);
    scene_plane(&mesh, 2.0, CELLS);
    assert_true(mesh.triangle_count > 10000000);
    const double cosine = 0.8;
    add_light(&lights, (tsuya_light){.kind = TSUYA_LIGHT_DIRECTIONAL, .direction = {0.6, 0, -0.8}, .rgb = {1, 2, 3}});
    scene_camera(&camera, &pose, (tsuya_vec3){0.3, 0.2, 2}, (tsuya_vec3){0, 0, 0}, 30.0, 64, 48);
    tsuya_film film = scene_render(&mesh, &shader, &lights, &camera, pose, &options, 2);
    for (size_t k = 0; k < 64 * 48; ++k) {
        assert_true(film.alpha[k] == 1.0f);
        for (size_t c = 0; c < 3; ++c) {
            assert_true(fabs(film.rgb[3 * k + c] - 0.5 / M_PI * cosine * (double)(c + 1)) < 1e-3);
        }
    }
    print_message("%zu triangles, peak %.0f MiB\n", mesh.triangle_count, tsuya_peak_memory_mb());
    tsuya_film_free(&film);
    tsuya_light_set_free(&lights);
    tsuya_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_ten_million_triangles)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
