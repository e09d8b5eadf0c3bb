/* Masks of photographs carried to the surface: a painted plane behind a small screen, masks made by geometry alone. */
#include "support.h"

#include "app/regions.h"
#include "core/image.h"

#include <math.h>

enum { CELLS = 60, WIDTH = 200, HEIGHT = 150 };

static void grid(tsuya_mesh *mesh, size_t first, double z, double x0, double x1, double y0, double y1)
{
    size_t n = CELLS + 1;
    for (size_t k = 0; k < n * n; ++k) {
        float *p = mesh->position + 3 * (first + k), *normal = mesh->normal + 3 * (first + k);
        p[0] = (float)(x0 + (x1 - x0) * (double)(k % n) / CELLS);
        p[1] = (float)(y0 + (y1 - y0) * (double)(k / n) / CELLS);
        p[2] = (float)z;
        normal[2] = 1.0f;
    }
    uint32_t *t = mesh->triangle + 3 * 2 * CELLS * CELLS * (first > 0);
    for (int c = 0; c < CELLS * CELLS; ++c, t += 6) {
        uint32_t a = (uint32_t)(first + (size_t)(c / CELLS) * n + (size_t)(c % CELLS));
        const uint32_t corner[6] = {a, a + 1, a + (uint32_t)n + 1, a, a + (uint32_t)n + 1, a + (uint32_t)n};
        memcpy(t, corner, sizeof corner);
    }
}

/* A plane at z = 0 and a strip of screen at z = 0.3 over part of it. */
static void make_scene(tsuya_mesh *mesh)
{
    size_t n = (CELLS + 1) * (CELLS + 1);
    assert_ok(tsuya_mesh_create(mesh, 2 * n, 4 * CELLS * CELLS, TSUYA_MESH_NORMAL));
    grid(mesh, 0, 0.0, -1.0, 1.0, -0.7, 0.7);
    grid(mesh, n, 0.3, -0.2, 0.0, -0.7, 0.7);
}

static void make_model(tsuya_sparse_model *model, tsuya_camera *camera, tsuya_view view[3])
{
    *camera = (tsuya_camera){.lens = TSUYA_LENS_OPENCV4, .width_px = WIDTH, .height_px = HEIGHT, .fx_px = 150, .fy_px = 151,
                             .cx_px = 101, .cy_px = 73, .distortion = {-0.05, 0.01, 0.001, -0.001}};
    for (int k = 0; k < 3; ++k) {
        tsuya_vec3 eye = {0.7 * (k - 1), 0.1, 2.0};
        view[k] = (tsuya_view){.name = (char *)"x", .camera_from_world = tsuya_pose_look_at(eye, (tsuya_vec3){0, 0, 0}, (tsuya_vec3){0, 1, 0})};
    }
    *model = (tsuya_sparse_model){.camera = camera, .camera_count = 1, .view = view, .view_count = 3};
}

/* Gold is a disk on the plane; the screen hides what it hides. */
static bool is_gold(double x, double y) { return hypot(x - 0.25, y) < 0.4; }

static void paint(const char *path, const tsuya_camera *camera, tsuya_pose pose)
{
    tsuya_image mask;
    assert_ok(tsuya_image_create(&mask, WIDTH, HEIGHT, 1, TSUYA_SAMPLE_U8, TSUYA_ENCODING_DATA));
    for (int y = 0; y < HEIGHT; ++y) {
        for (int x = 0; x < WIDTH; ++x) {
            tsuya_vec3 ray, eye = tsuya_pose_center(pose);
            if (tsuya_camera_unproject(camera, (tsuya_vec2){x, y}, &ray)) {
                ray = tsuya_mat3_apply_transposed(pose.rotation, ray);
                tsuya_vec3 screen = tsuya_vec3_mad(eye, (0.3 - eye.z) / ray.z, ray), plane = tsuya_vec3_mad(eye, -eye.z / ray.z, ray);
                bool hidden = screen.x > -0.2 && screen.x < 0.0 && fabs(screen.y) < 0.7;
                *tsuya_image_u8(&mask, x, y) = !hidden && is_gold(plane.x, plane.y) ? 255 : 0;
            }
        }
    }
    assert_ok(tsuya_image_save(&mask, path, NULL));
    tsuya_image_free(&mask);
}

static void test_the_disk_is_found(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_camera camera;
    tsuya_view view[3];
    tsuya_sparse_model model;
    tsuya_region_mask masks[3];
    tsuya_context context = tsuya_context_default();
    make_scene(&mesh);
    make_model(&model, &camera, view);
    for (int k = 0; k < 3; ++k) {
        char name[16];
        snprintf(name, sizeof name, "m%d.png", k);
        masks[k] = (tsuya_region_mask){.region = 2, .view = k, .path = test_path(name)};
        paint(masks[k].path, &camera, view[k].camera_from_world);
    }
    assert_ok(tsuya_regions_vote(&mesh, &model, masks, 3, 1, &context));
    size_t n = (CELLS + 1) * (CELLS + 1), wrong = 0, near = 0, gold = 0;
    for (size_t v = 0; v < n; ++v) {
        const float *p = mesh.position + 3 * v;
        double from_edge = fabs(hypot(p[0] - 0.25, p[1]) - 0.4);
        gold += mesh.material[v] == 2;
        if (from_edge < 0.04) { /* two cells, three pixels */
            ++near;
        } else {
            wrong += mesh.material[v] != (is_gold(p[0], p[1]) ? 2 : 1);
        }
    }
    assert_true(gold > 400 && near < 400);
    assert_int_equal(wrong, 0);
    for (size_t v = n; v < 2 * n; ++v) { /* nothing shines through the screen, but for its very rim */
        if (mesh.position[3 * v] > -0.17f && mesh.position[3 * v] < -0.03f) {
            assert_int_equal(mesh.material[v], 1);
        }
    }
    tsuya_mesh_free(&mesh);
}

static void test_unseen_vertices_follow_their_neighbours(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_camera camera;
    tsuya_view view[3];
    tsuya_sparse_model model;
    tsuya_context context = tsuya_context_default();
    make_scene(&mesh);
    make_model(&model, &camera, view);
    tsuya_region_mask mask = {.region = 0, .view = 1, .path = test_path("white.png")};
    tsuya_image white;
    assert_ok(tsuya_image_create(&white, WIDTH, HEIGHT, 1, TSUYA_SAMPLE_U8, TSUYA_ENCODING_DATA));
    memset(white.data, 255, white.row_bytes * HEIGHT);
    assert_ok(tsuya_image_save(&white, mask.path, NULL));
    assert_ok(tsuya_regions_vote(&mesh, &model, &mask, 1, 3, &context));
    for (size_t v = 0; v < mesh.vertex_count; ++v) {
        assert_int_equal(mesh.material[v], 0); /* all of both sheets: what the screen hides and what lies outside the picture too */
    }
    tsuya_image_free(&white);
    tsuya_mesh_free(&mesh);
}

static void test_size_of_a_mask_is_checked(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_camera camera;
    tsuya_view view[3];
    tsuya_sparse_model model;
    tsuya_context context = tsuya_context_default();
    tsuya_image small;
    make_scene(&mesh);
    make_model(&model, &camera, view);
    tsuya_region_mask mask = {.region = 0, .view = 1, .path = test_path("small.png")};
    assert_ok(tsuya_image_create(&small, 20, 15, 1, TSUYA_SAMPLE_U8, TSUYA_ENCODING_DATA));
    assert_ok(tsuya_image_save(&small, mask.path, NULL));
    assert_fails(tsuya_regions_vote(&mesh, &model, &mask, 1, 3, &context), "20 × 15");
    tsuya_image_free(&small);
    tsuya_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_the_disk_is_found),
        cmocka_unit_test(test_unseen_vertices_follow_their_neighbours),
        cmocka_unit_test(test_size_of_a_mask_is_checked),
    };
    int result = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return result;
}
