/* Quick pictures: the right pixels get a colour, the colour map rises in lightness. */
#include "support.h"

#include "app/shade.h"

static void test_color_map_rises(void **state)
{
    (void)state;
    double last = -1.0;
    for (int i = 0; i <= 100; i++) {
        uint8_t c[3];
        tsuya_color_map(c, i / 100.0);
        double luma = 0.2126 * c[0] + 0.7152 * c[1] + 0.0722 * c[2];
        assert_true(luma > last - 0.6);
        last = luma;
    }
    uint8_t low[3], high[3], nan[3];
    tsuya_color_map(low, -5.0);
    tsuya_color_map(high, 5.0);
    tsuya_color_map(nan, NAN);
    assert_int_equal(low[0], 68);
    assert_int_equal(high[0], 253);
    assert_int_equal(nan[0], 68);
}

/* A square of side 1 at distance 2, seen by a camera of focal length 100 px: 50 × 50 px. */
static void make_square(tsuya_mesh *mesh)
{
    static const float position[] = {-0.5f, -0.5f, 2, 0.5f, -0.5f, 2, 0.5f, 0.5f, 2, -0.5f, 0.5f, 2};
    static const uint32_t triangle[] = {0, 2, 1, 0, 3, 2};
    assert_ok(tsuya_mesh_create(mesh, 4, 2, TSUYA_MESH_COLOR | TSUYA_MESH_NORMAL));
    memcpy(mesh->position, position, sizeof position);
    memcpy(mesh->triangle, triangle, sizeof triangle);
    for (int v = 0; v < 4; v++) {
        mesh->normal[3 * v + 2] = -1.0f;
        mesh->color[3 * v] = v == 1 || v == 2 ? 200 : 0; /* red grows to the right */
    }
}

static const tsuya_camera camera = {.lens = TSUYA_LENS_PINHOLE, .width_px = 100, .height_px = 80, .fx_px = 100, .fy_px = 100, .cx_px = 49.5, .cy_px = 39.5};

static void test_square_has_its_area_and_colours(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_image picture;
    tsuya_context context = tsuya_context_default();
    make_square(&mesh);
    tsuya_shade_options options = {.shade = TSUYA_SHADE_COLOR};
    assert_ok(tsuya_shade_view(&picture, &mesh, &camera, tsuya_pose_identity(), &options, &context));
    int covered = 0;
    for (int y = 0; y < 80; y++) {
        for (int x = 0; x < 100; x++) {
            const uint8_t *c = tsuya_image_u8(&picture, x, y);
            covered += c[1] == 0;
        }
    }
    assert_int_equal(covered, 2500);
    assert_int_equal(tsuya_image_u8(&picture, 50, 40)[0], 102); /* centre of pixel 50: 0.51 of the way to 200 */
    tsuya_image_free(&picture);

    options = (tsuya_shade_options){.shade = TSUYA_SHADE_NORMAL};
    assert_ok(tsuya_shade_view(&picture, &mesh, &camera, tsuya_pose_identity(), &options, &context));
    const uint8_t *n = tsuya_image_u8(&picture, 50, 40);
    assert_in_range(n[0], 127, 128);
    assert_in_range(n[2], 253, 255);
    tsuya_image_free(&picture);
    tsuya_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_color_map_rises),
        cmocka_unit_test(test_square_has_its_area_and_colours),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
