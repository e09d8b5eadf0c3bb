/* Edges that all lie outside their tags, found from the tags' sizes and distances alone. */
#include "support.h"

#include "calib/edge_bias.h"
#include "core/camera.h"
#include "core/context.h"

#include <math.h>

enum { PHOTOS = 6 };

static tsuya_pose pose_of(int photo)
{
    double tilt = tsuya_rad_from_deg(20.0 + 8.0 * photo), turn = tsuya_rad_from_deg(50.0 * photo);
    tsuya_mat3 about_z = tsuya_mat3_from_rodrigues((tsuya_vec3){0, 0, turn});
    tsuya_mat3 r = tsuya_mat3_multiply(tsuya_mat3_from_rodrigues((tsuya_vec3){M_PI - tilt, 0, 0}), about_z);
    tsuya_vec3 middle = tsuya_mat3_apply(r, (tsuya_vec3){0.15, 0.15, 0.0});
    return (tsuya_pose){r, {-middle.x, -middle.y, 0.9 - middle.z}};
}

/* Corners of a grid through a lens, each moved outwards by `bias` of its spread (a pixel of blur along each edge's normal), with noise. */
static void see(tsuya_corner_set *corners, const tsuya_board *board, double bias, double noise_px, int stride)
{
    static const char *const name[PHOTOS] = {"a", "b", "c", "d", "e", "f"};
    const tsuya_camera camera = {.lens = TSUYA_LENS_OPENCV8, .width_px = 800, .height_px = 600, .fx_px = 1000, .fy_px = 1000, .cx_px = 400, .cy_px = 300,
                                 .distortion = {-0.08, 0.02}};
    uint64_t counter = 0;
    assert_ok(tsuya_corner_set_create(corners, name, PHOTOS));
    for (int photo = 0; photo < PHOTOS; photo++) {
        for (int t = 0; t < board->tag_count; t += stride) {
            tsuya_vec2 at[4], middle = {0, 0};
            bool inside = true;
            for (int c = 0; c < 4; c++) {
                inside = inside && tsuya_camera_project(&camera, tsuya_pose_apply(pose_of(photo), tsuya_board_corner(board, t, c)), &at[c]) &&
                         at[c].x > 10 && at[c].y > 10 && at[c].x < 790 && at[c].y < 590;
                middle.x += 0.25 * at[c].x;
                middle.y += 0.25 * at[c].y;
            }
            for (int c = 0; inside && c < 4; c++) {
                tsuya_vec2 spread = {at[c].x > middle.x ? 0.7 : -0.7, at[c].y > middle.y ? 0.7 : -0.7};
                tsuya_corner k = {.photo = photo, .tag_id = board->tag[t].id, .corner = c, .sigma_px = fmax(noise_px, 0.01), .spread_x_px = spread.x,
                                  .spread_y_px = spread.y};
                k.x_px = at[c].x + bias * spread.x + noise_px * tsuya_random_normal(3, 0, counter);
                k.y_px = at[c].y + bias * spread.y + noise_px * tsuya_random_normal(3, 1, counter++);
                assert_ok(tsuya_corner_set_add(corners, k));
            }
        }
    }
    tsuya_corner_set_sort(corners);
}

static tsuya_edge_bias measured(const tsuya_board *board, double bias, double noise_px, int stride)
{
    tsuya_corner_set corners;
    tsuya_edge_bias found;
    see(&corners, board, bias, noise_px, stride);
    assert_ok(tsuya_edge_bias_measure(&found, &corners, board));
    print_message("bias %.2f, noise %.2f px: %.3f +- %.3f from %d pairs\n", bias, noise_px, found.bias, found.sigma, found.pairs);
    tsuya_corner_set_free(&corners);
    return found;
}

static void the_bias_comes_back_within_its_sigma(void **state)
{
    (void)state;
    static const double bias[] = {0.0, 0.4, -0.3};
    tsuya_board board;
    assert_ok(tsuya_board_grid(&board, "tag36h11", 1, 5, 5, 0.045, 0.015, 0));
    for (int k = 0; k < 3; k++) {
        tsuya_edge_bias found = measured(&board, bias[k], 0.06, 1);
        assert_true(found.pairs > 200);
        assert_true(found.sigma < 0.03);
        assert_true(fabs(found.bias - bias[k]) < 3.0 * found.sigma);
        assert_true((fabs(found.bias) > 3.0 * found.sigma) == (bias[k] != 0.0));
        assert_true(fabs(measured(&board, bias[k], 0.0, 1).bias - bias[k]) < 0.02); /* what the lens bends is left */
    }
    tsuya_board_free(&board);
}

/* Every eleventh of five columns. */
static void tags_without_neighbours_tell_nothing(void **state)
{
    (void)state;
    tsuya_board board;
    assert_ok(tsuya_board_grid(&board, "tag36h11", 1, 5, 5, 0.045, 0.015, 0));
    tsuya_edge_bias found = measured(&board, 0.4, 0.06, 11);
    assert_int_equal(found.pairs, 0);
    assert_true(isinf(found.sigma));
    tsuya_corner_set none;
    assert_ok(tsuya_corner_set_create(&none, (const char *const[]){"a"}, 1));
    assert_ok(tsuya_edge_bias_measure(&found, &none, &board));
    assert_int_equal(found.pairs, 0);
    tsuya_corner_set_free(&none);
    tsuya_board_free(&board);
}

static void corners_go_back(void **state)
{
    (void)state;
    tsuya_board board;
    tsuya_corner_set moved, straight;
    assert_ok(tsuya_board_grid(&board, "tag36h11", 1, 5, 5, 0.045, 0.015, 0));
    see(&moved, &board, 0.4, 0.0, 1);
    see(&straight, &board, 0.0, 0.0, 1);
    tsuya_edge_bias_remove(&moved, 0.4);
    for (int i = 0; i < moved.count; i++) {
        assert_true(fabs(moved.corner[i].x_px - straight.corner[i].x_px) < 1e-9);
        assert_true(fabs(moved.corner[i].y_px - straight.corner[i].y_px) < 1e-9);
    }
    tsuya_corner_set_free(&moved);
    tsuya_corner_set_free(&straight);
    tsuya_board_free(&board);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_bias_comes_back_within_its_sigma),
        cmocka_unit_test(tags_without_neighbours_tell_nothing),
        cmocka_unit_test(corners_go_back),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
