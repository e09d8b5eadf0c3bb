/* Pictures through a lens: small squares at known places, found again by their coverage, against mrcal's own projection. */
#include "support.h"

#include "calib/mrcal_adapter.h"

#include "render_scenes.h"

enum { COLUMNS = 6, ROWS = 4, POINTS = COLUMNS * ROWS, WIDTH = 200, HEIGHT = 150 };

static const tsuya_camera lens = {.lens = TSUYA_LENS_OPENCV8, .width_px = WIDTH, .height_px = HEIGHT, .fx_px = 126, .fy_px = 124,
                                  .cx_px = 102.2, .cy_px = 73.4,
                                  .distortion = {-0.21, 0.06, 0.002, -0.003, 0.01, 0.05, -0.02, 0.004}};

static double half_side(tsuya_vec3 p_camera) { return 1.5 / 125.0 * p_camera.z; }

/* Squares of about 3 px, each at its own depth, parallel to the picture. */
static void make_squares(tsuya_mesh *mesh, tsuya_vec3 in_camera[POINTS], tsuya_pose camera_from_world)
{
    assert_ok(tsuya_mesh_create(mesh, 4 * POINTS, 2 * POINTS, TSUYA_MESH_NORMAL));
    tsuya_pose world_from_camera = tsuya_pose_inverse(camera_from_world);
    for (int k = 0; k < POINTS; ++k) {
        double z = 1.0 + 0.35 * (k % 5);
        in_camera[k] = (tsuya_vec3){z * (-0.62 + 0.25 * (k % COLUMNS)), z * (-0.43 + 0.28 * (k / COLUMNS)), z};
        double half = half_side(in_camera[k]);
        for (int c = 0; c < 4; ++c) {
            tsuya_vec3 corner = {in_camera[k].x + (c == 1 || c == 2 ? half : -half), in_camera[k].y + (c > 1 ? half : -half), z};
            tsuya_vec3 p = tsuya_pose_apply(world_from_camera, corner), n = tsuya_mat3_apply(world_from_camera.rotation, (tsuya_vec3){0, 0, -1});
            const double values[6] = {p.x, p.y, p.z, n.x, n.y, n.z};
            for (int i = 0; i < 3; ++i) {
                mesh->position[3 * (4 * k + c) + i] = (float)values[i];
                mesh->normal[3 * (4 * k + c) + i] = (float)values[3 + i];
            }
        }
        const uint32_t a = (uint32_t)(4 * k), corners[6] = {a, a + 2, a + 1, a, a + 3, a + 2};
        memcpy(mesh->triangle + 6 * k, corners, sizeof corners);
    }
}

/* Centre of the coverage within 4 px of a pixel. */
static tsuya_vec2 centre_of_coverage(const tsuya_film *film, tsuya_vec2 around)
{
    double sum = 0.0, x_sum = 0.0, y_sum = 0.0;
    for (int y = (int)around.y - 4; y <= (int)around.y + 5; ++y) {
        for (int x = (int)around.x - 4; x <= (int)around.x + 5; ++x) {
            double a = film->alpha[y * WIDTH + x];
            sum += a;
            x_sum += a * x;
            y_sum += a * y;
        }
    }
    assert_true(sum > 4.0 && sum < 12.0);
    return (tsuya_vec2){x_sum / sum, y_sum / sum};
}

/* The same centre by mrcal: many points of the square, each projected and counted in its pixel, weighted by the area that it stands for. */
static tsuya_vec2 centre_by_mrcal(tsuya_vec3 p_camera)
{
    enum { SIDE = 200 };
    double sum = 0.0, x_sum = 0.0, y_sum = 0.0, half = half_side(p_camera);
    for (int k = 0; k < SIDE * SIDE; ++k) {
        tsuya_vec3 p = {p_camera.x + half * (2.0 * (k % SIDE + 0.5) / SIDE - 1.0), p_camera.y + half * (2.0 * (k / SIDE + 0.5) / SIDE - 1.0), p_camera.z};
        tsuya_vec2 pixel;
        double by_point[6], by_lens[24];
        assert_true(tsuya_mrcal_project(&pixel, by_point, by_lens, &lens, p));
        double area = fabs(by_point[0] * by_point[4] - by_point[1] * by_point[3]);
        sum += area;
        x_sum += area * round(pixel.x);
        y_sum += area * round(pixel.y);
    }
    return (tsuya_vec2){x_sum / sum, y_sum / sum};
}

static void test_points_are_where_mrcal_projects_them(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_vec3 in_camera[POINTS];
    tsuya_light_set lights = {0};
    tsuya_shader shader = lambert(0.5);
    tsuya_path_options options = options_of(1024, 1);
    tsuya_pose pose = tsuya_pose_look_at((tsuya_vec3){1.3, -0.4, 0.8}, (tsuya_vec3){0.1, 0.2, 0.3}, (tsuya_vec3){0.1, 0.0, 1.0});
    double worst = 0.0;
    make_squares(&mesh, in_camera, pose);
    add_light(&lights, (tsuya_light){.kind = TSUYA_LIGHT_POINT, .position_m = {1, 0, 1}, .rgb = {1, 1, 1}});
    tsuya_film film = scene_render(&mesh, &shader, &lights, &lens, pose, &options, 2);
    for (int k = 0; k < POINTS; ++k) {
        tsuya_vec2 expected = centre_by_mrcal(in_camera[k]);
        assert_true(expected.x > 5 && expected.x < WIDTH - 6 && expected.y > 5 && expected.y < HEIGHT - 6);
        tsuya_vec2 seen = centre_of_coverage(&film, expected);
        worst = fmax(worst, hypot(seen.x - expected.x, seen.y - expected.y));
    }
    print_message("worst of %d points: %.4f px\n", POINTS, worst);
    assert_true(worst <= 0.02);
    tsuya_film_free(&film);
    tsuya_light_set_free(&lights);
    tsuya_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_points_are_where_mrcal_projects_them)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
