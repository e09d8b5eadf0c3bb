/* Cameras of a render: the turntable frames the mesh, and a picture through a lens shows a point where the lens projects it. */
#include "support.h"

#include "render/views.h"

#include "render_scenes.h"

static void test_turntable(void **state)
{
    (void)state;
    const tsuya_vec3 ups[] = {{0, 0, 1}, {0, -1, 0}, {1, 2, -0.5}};
    tsuya_mesh mesh;
    scene_drape(&mesh, 24);
    for (int u = 0; u < 3; ++u) {
        tsuya_turntable table = {.up = ups[u], .elevation_rad = 0.2, .field_rad = 0.5, .width_px = 640, .height_px = 480};
        double widest = 0.0;
        assert_ok(tsuya_turntable_fit(&table, &mesh));
        for (int k = 0; k < 12; ++k) {
            tsuya_camera camera;
            tsuya_pose pose;
            tsuya_turntable_view(&table, k, 12, &camera, &pose);
            for (size_t v = 0; v < mesh.vertex_count; ++v) {
                tsuya_vec2 pixel;
                assert_true(tsuya_camera_project(&camera, tsuya_pose_apply(pose, tsuya_mesh_position(&mesh, v)), &pixel));
                widest = fmax(widest, fmax(fabs(pixel.x - 319.5) / 320.0, fabs(pixel.y - 239.5) / 240.0));
            }
            tsuya_vec3 up = tsuya_mat3_apply(pose.rotation, tsuya_vec3_unit(ups[u])); /* upwards in the picture */
            assert_true(up.y < -0.9 && fabs(up.x) < 1e-9);
        }
        assert_true(widest <= 0.921 && widest > 0.6);
    }
    tsuya_turntable bad = {.field_rad = 0.5, .width_px = 4, .height_px = 4};
    assert_fails(tsuya_turntable_fit(&bad, &mesh), "axis");
    tsuya_mesh_free(&mesh);
    assert_ok(tsuya_mesh_create(&mesh, 0, 0, 0));
    bad.up.z = 1.0;
    assert_fails(tsuya_turntable_fit(&bad, &mesh), "no vertices");
    tsuya_mesh_free(&mesh);
}

static void test_up_from_cameras(void **state)
{
    (void)state;
    tsuya_pose pose[8];
    tsuya_vec3 up = tsuya_vec3_unit((tsuya_vec3){0.3, -0.8, 0.2}), x, y;
    x = tsuya_vec3_tangent((tsuya_vec3){1, 0, 0}, up);
    y = tsuya_vec3_cross(up, x);
    for (int k = 0; k < 8; ++k) {
        double a = M_PI * k / 4.0;
        tsuya_vec3 eye = tsuya_vec3_add(tsuya_vec3_scale(x, 3 * cos(a)), tsuya_vec3_scale(y, 3 * sin(a)));
        pose[k] = tsuya_pose_look_at(eye, tsuya_vec3_scale(up, 0.4), up);
    }
    assert_true(tsuya_vec3_dot(tsuya_up_from_cameras(pose, 8), up) > 0.9999);
    assert_true(tsuya_up_from_cameras(NULL, 0).z == 1.0);
}

enum { EDGE = 32, OUTLINE = 4 * EDGE, CROP = 16 };

/* A small square's outline as the lens projects it, point by point. */
static void project_outline(tsuya_vec2 outline[OUTLINE], const tsuya_camera *camera, tsuya_pose pose, tsuya_vec3 center, double h)
{
    const double corner[5][2] = {{-h, -h}, {h, -h}, {h, h}, {-h, h}, {-h, -h}};
    for (int k = 0; k < OUTLINE; ++k) {
        double s = (double)(k % EDGE) / EDGE;
        const double *a = corner[k / EDGE], *b = corner[k / EDGE + 1];
        tsuya_vec3 p = {center.x + (1 - s) * a[0] + s * b[0], center.y, center.z + (1 - s) * a[1] + s * b[1]};
        assert_true(tsuya_camera_project(camera, tsuya_pose_apply(pose, p), &outline[k]));
    }
}

static bool inside(const tsuya_vec2 outline[OUTLINE], double x, double y)
{
    bool odd = false;
    for (int k = 0, last = OUTLINE - 1; k < OUTLINE; last = k++) {
        tsuya_vec2 a = outline[k], b = outline[last];
        if ((a.y > y) != (b.y > y) && x < a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x)) {
            odd = !odd;
        }
    }
    return odd;
}

/* Centre of what the outline covers of each pixel of the crop, as the picture has it: pixel by pixel. */
static tsuya_vec2 covered_center(const tsuya_vec2 outline[OUTLINE], int x0, int y0)
{
    enum { SUB = 128 };
    double sum = 0.0, x = 0.0, y = 0.0;
    for (int k = 0; k < CROP * CROP * SUB * SUB; ++k) {
        int pixel = k / (SUB * SUB), px = x0 + pixel % CROP, py = y0 + pixel / CROP;
        if (hypot(px - outline[0].x, py - outline[0].y) > 8.0) {
            continue; /* the squares are smaller */
        }
        if (inside(outline, px - 0.5 + (k % SUB + 0.5) / SUB, py - 0.5 + (k / SUB % SUB + 0.5) / SUB)) {
            sum += 1.0;
            x += px;
            y += py;
        }
    }
    return (tsuya_vec2){x / sum, y / sum};
}

/* Small squares on a wall, each in a crop of the picture around it: the centre of what it covers against the outline that
 * the lens itself projects. */
static void test_lens_projection(void **state)
{
    (void)state;
    const tsuya_camera camera = {.lens = TSUYA_LENS_OPENCV8, .width_px = 320, .height_px = 240, .fx_px = 260, .fy_px = 255, .cx_px = 165,
                                 .cy_px = 112, .distortion = {-0.28, 0.09, 0.001, -0.0008, -0.012, 0.02, 0.01, -0.002}};
    const tsuya_pose pose = tsuya_pose_look_at((tsuya_vec3){0.2, -2.0, 0.1}, (tsuya_vec3){0, 0, 0}, (tsuya_vec3){0, 0, 1});
    tsuya_shader shader = lambert(0.5);
    tsuya_light_set lights = {0};
    tsuya_path_options options = tsuya_path_options_default();
    options.spp = 4096;
    options.bounces = 1;
    for (int k = 0; k < 6; ++k) {
        tsuya_vec3 center = {0.42 * (k % 3 - 1) * 2.0, 0.0, 0.35 * (k / 3 * 2 - 1)};
        tsuya_vec2 middle;
        assert_true(tsuya_camera_project(&camera, tsuya_pose_apply(pose, center), &middle));
        int x0 = (int)middle.x - CROP / 2, y0 = (int)middle.y - CROP / 2;
        tsuya_camera crop = camera;
        crop.width_px = crop.height_px = CROP;
        crop.cx_px -= x0;
        crop.cy_px -= y0;
        const double h = 0.012, corner[4][2] = {{-h, -h}, {h, -h}, {h, h}, {-h, h}};
        tsuya_mesh mesh;
        assert_ok(tsuya_mesh_create(&mesh, 4, 2, 0));
        for (int v = 0; v < 4; ++v) {
            const float p[3] = {(float)(center.x + corner[v][0]), (float)center.y, (float)(center.z + corner[v][1])};
            memcpy(mesh.position + 3 * v, p, sizeof p);
        }
        const uint32_t triangle[6] = {0, 1, 2, 0, 2, 3};
        memcpy(mesh.triangle, triangle, sizeof triangle);
        tsuya_film film = scene_render(&mesh, &shader, &lights, &crop, pose, &options, 2);
        double sum = 0.0, x = 0.0, y = 0.0;
        for (int pixel = 0; pixel < CROP * CROP; ++pixel) {
            sum += film.alpha[pixel];
            x += (double)film.alpha[pixel] * (x0 + pixel % CROP);
            y += (double)film.alpha[pixel] * (y0 + pixel / CROP);
        }
        assert_true(sum > 3.0);
        tsuya_vec2 outline[OUTLINE];
        project_outline(outline, &camera, pose, center, h);
        tsuya_vec2 expected = covered_center(outline, x0, y0);
        if (!(hypot(x / sum - expected.x, y / sum - expected.y) < 0.01)) {
            fail_msg("square %d: seen at (%.3f, %.3f), projected to (%.3f, %.3f)", k, x / sum, y / sum, expected.x, expected.y);
        }
        tsuya_film_free(&film);
        tsuya_mesh_free(&mesh);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_turntable),
        cmocka_unit_test(test_up_from_cameras),
        cmocka_unit_test(test_lens_projection),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
