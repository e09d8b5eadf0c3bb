/* Shear and thread density as colours of the mesh. */
#include "support.h"

#include "app/shade.h"
#include "app/weave_maps.h"

#include <math.h>

enum { SIDE = 10 };

/* A sheet whose shear grows along x from −9 to 9 degrees; its last row was not seen. */
static void make(tsuya_mesh *mesh)
{
    assert_ok(tsuya_mesh_create(mesh, SIDE * SIDE, 1, TSUYA_MESH_NORMAL | TSUYA_MESH_WEFT | TSUYA_MESH_CONFIDENCE | TSUYA_MESH_SHEAR | TSUYA_MESH_THREADS));
    for (int v = 0; v < SIDE * SIDE; v++) {
        mesh->position[3 * v] = (float)(v % SIDE);
        mesh->position[3 * v + 1] = (float)(int)(v / SIDE);
        mesh->normal[3 * v + 2] = 1.0f;
        mesh->weft[3 * v] = 1.0f;
        mesh->weave_confidence[v] = v / SIDE == SIDE - 1 ? 0.2f : 0.9f;
        mesh->shear_deg[v] = -9.0f + 2.0f * (float)(v % SIDE);
        mesh->threads_per_m[2 * v] = 2000.0f;
        mesh->threads_per_m[2 * v + 1] = 3000.0f + (float)v;
    }
    const uint32_t three[3] = {0, 1, SIDE};
    memcpy(mesh->triangle, three, sizeof three);
}

static void test_values_and_their_range(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_weave_map map;
    make(&mesh);
    assert_ok(tsuya_weave_map_create(&map, &mesh, mesh.shear_deg, 1));
    assert_int_equal(map.seen, SIDE * (SIDE - 1));
    assert_float_equal(map.low, -9.0, 0.0);
    assert_float_equal(map.high, 9.0, 0.0);
    assert_true(isnan(map.value[SIDE * SIDE - 1]));
    assert_float_equal(map.value[3], -3.0, 0.0);
    tsuya_free(map.value);
    assert_ok(tsuya_weave_map_create(&map, &mesh, mesh.threads_per_m, 2)); /* all alike */
    assert_true(map.low == 2000.0 && map.high > map.low);
    tsuya_free(map.value);
    tsuya_mesh_free(&mesh);
}

static void test_colored_meshes(void **state)
{
    (void)state;
    tsuya_mesh mesh, back;
    uint8_t low[3], high[3];
    double value;
    tsuya_json *figures = tsuya_json_create_object();
    make(&mesh);
    assert_ok(tsuya_weave_maps_save(figures, &mesh, test_folder()));
    assert_null(mesh.color);
    assert_ok(tsuya_ply_load(&back, test_path("shear.ply")));
    tsuya_color_map(low, 0.0);
    tsuya_color_map(high, 1.0);
    assert_memory_equal(back.color, low, 3);
    assert_memory_equal(back.color + 3 * (SIDE - 1), high, 3);
    const uint8_t *unseen = back.color + 3 * (SIDE * SIDE - 1);
    assert_true(unseen[0] == unseen[1] && unseen[1] == unseen[2]);
    assert_float_equal(back.shear_deg[0], -9.0, 0.0);
    tsuya_mesh_free(&back);
    assert_ok(tsuya_ply_load(&back, test_path("warp_threads.ply")));
    assert_true(back.color[0] != back.color[3 * (SIDE * (SIDE - 1) - 1)]);
    tsuya_mesh_free(&back);
    assert_ok(tsuya_ply_load(&back, test_path("weft_threads.ply")));
    tsuya_mesh_free(&back);
    const tsuya_json *shear = tsuya_json_member(tsuya_json_member(figures, "maps"), "shear_deg");
    value = tsuya_json_number_or(tsuya_json_member(shear, "high"), NAN);
    assert_float_equal(value, 9.0, 0.0);
    tsuya_json_free(figures);
    tsuya_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_values_and_their_range), cmocka_unit_test(test_colored_meshes)};
    int result = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return result;
}
