#include "support.h"

#include "core/memory.h"
#include "core/raster.h"
#include "core/shapes.h"

static tsuya_context context_of(int threads)
{
    tsuya_context context = tsuya_context_default();
    context.threads = threads;
    return context;
}

static tsuya_camera pinhole(int width_px, int height_px, double f_px)
{
    return (tsuya_camera){.lens = TSUYA_LENS_PINHOLE, .width_px = width_px, .height_px = height_px, .fx_px = f_px,
                          .fy_px = f_px, .cx_px = 0.5 * width_px - 0.5, .cy_px = 0.5 * height_px - 0.5};
}

static tsuya_status draw(tsuya_raster *raster, const tsuya_mesh *mesh, const tsuya_camera *camera, tsuya_pose pose, int threads)
{
    tsuya_context context = context_of(threads);
    TSUYA_TRY(tsuya_raster_create(raster, camera->width_px, camera->height_px));
    return tsuya_raster_draw(raster, mesh, camera, pose, &context);
}

/* Depth of a sphere along a pixel's ray, 0 where it is missed; `margin` shrinks (> 0) or grows the sphere. */
static double sphere_depth(const tsuya_camera *camera, tsuya_vec3 center, double radius, double x, double y)
{
    tsuya_vec3 ray;
    assert_true(tsuya_camera_unproject(camera, (tsuya_vec2){x, y}, &ray));
    double along = tsuya_vec3_dot(ray, center);
    double rest = radius * radius - (tsuya_vec3_dot(center, center) - along * along);
    return rest < 0.0 ? 0.0 : (along - sqrt(rest)) * ray.z;
}

static void check_sphere(const tsuya_camera *camera)
{
    const tsuya_vec3 world = {0.4, -0.1, 0.2}, eye = {3, 2, 1};
    tsuya_pose pose = tsuya_pose_look_at(eye, (tsuya_vec3){0.2, 0, 0.1}, (tsuya_vec3){0, 0, 1});
    tsuya_vec3 center = tsuya_pose_apply(pose, world);
    tsuya_mesh mesh;
    tsuya_raster raster;
    assert_int_equal(shape_sphere(&mesh, world, 0.8, 300, 600), TSUYA_OK);
    assert_int_equal(draw(&raster, &mesh, camera, pose, 2), TSUYA_OK);
    int covered = 0;
    for (int y = 0; y < camera->height_px; y++) {
        for (int x = 0; x < camera->width_px; x++) {
            float z = raster.depth[y * camera->width_px + x];
            uint32_t t = raster.triangle[y * camera->width_px + x];
            double inner = sphere_depth(camera, center, 0.798, x, y), outer = sphere_depth(camera, center, 0.8001, x, y);
            assert_true((z > 0.0f) == (t != UINT32_MAX));
            assert_true(z > 0.0f || inner == 0.0);
            assert_true(z == 0.0f || outer > 0.0);
            if (inner > 0.0) {
                assert_true(fabs((double)z - sphere_depth(camera, center, 0.8, x, y)) < 2e-3);
                covered++;
            }
        }
    }
    assert_true(covered > 5000);
    tsuya_raster_free(&raster);
    tsuya_mesh_free(&mesh);
}

static void sphere_covers_its_silhouette_at_its_depth(void **state)
{
    (void)state;
    tsuya_camera camera = pinhole(240, 180, 260.0);
    check_sphere(&camera);
}

static void a_distorting_lens_bends_the_picture(void **state)
{
    (void)state;
    tsuya_camera camera = pinhole(240, 180, 200.0);
    camera.lens = TSUYA_LENS_OPENCV4;
    camera.distortion[0] = -0.2;
    camera.distortion[1] = 0.05;
    camera.distortion[2] = 0.001;
    check_sphere(&camera);
}

static double hilly(double x, double y) { return 0.15 * sin(9.0 * x) * cos(7.0 * y); }

static void threads_do_not_change_a_bit(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_camera camera = pinhole(200, 150, 150.0);
    tsuya_pose pose = tsuya_pose_look_at((tsuya_vec3){0.9, 0.8, 0.3}, (tsuya_vec3){0, 0, 0}, (tsuya_vec3){0, 0, 1});
    assert_int_equal(shape_sheet(&mesh, -1, 1, -1, 1, 120, 120, hilly), TSUYA_OK);
    tsuya_raster one;
    assert_int_equal(draw(&one, &mesh, &camera, pose, 1), TSUYA_OK);
    static const int threads[] = {2, 3, 7, 149, 150, 400};
    for (size_t k = 0; k < sizeof threads / sizeof *threads; k++) {
        tsuya_raster many;
        assert_int_equal(draw(&many, &mesh, &camera, pose, threads[k]), TSUYA_OK);
        assert_memory_equal(one.depth, many.depth, 200 * 150 * sizeof *one.depth);
        assert_memory_equal(one.triangle, many.triangle, 200 * 150 * sizeof *one.triangle);
        tsuya_raster_free(&many);
    }
    tsuya_raster_free(&one);
    tsuya_mesh_free(&mesh);
}

/* A flat fan whose vertices and edges often fall exactly on pixel centres: its triangles, drawn one by one, must cover
 * every pixel of the square once. */
static void shared_edges_are_drawn_once(void **state)
{
    (void)state;
    enum { N = 40, SIDE = 9 };
    tsuya_camera camera = pinhole(N, N, 1.0);
    camera.cx_px = camera.cy_px = 0.0;
    for (uint64_t trial = 0; trial < 20; trial++) {
        tsuya_mesh mesh;
        assert_int_equal(tsuya_mesh_create(&mesh, SIDE * SIDE, 2 * (SIDE - 1) * (SIDE - 1), 0), TSUYA_OK);
        uint32_t *t = mesh.triangle;
        for (int j = 0; j < SIDE; j++) {
            for (int i = 0; i < SIDE; i++) {
                uint32_t a = (uint32_t)(j * SIDE + i), b = a + 1, c = a + SIDE, d = c + 1;
                bool inner = i > 0 && j > 0 && i < SIDE - 1 && j < SIDE - 1;
                uint64_t r = tsuya_random_u64(7, trial, a);
                double scale = trial % 2 ? 0.5 : 0.37; /* half pixels hit centres, the others do not */
                mesh.position[3 * a] = (float)(4 * i + 3 + (inner ? scale * (double)(r % 5) - 2 * scale : 0.0));
                mesh.position[3 * a + 1] = (float)(4 * j + 3 + (inner ? scale * (double)(r / 5 % 5) - 2 * scale : 0.0));
                mesh.position[3 * a + 2] = 1.0f;
                if (i < SIDE - 1 && j < SIDE - 1) {
                    const uint32_t quads[2][6] = {{a, b, d, a, d, c}, {b, d, c, a, c, b}};
                    memcpy(t, quads[r % 2], sizeof quads[0]);
                    t += 6;
                }
            }
        }
        int count[N * N] = {0};
        tsuya_mesh single = mesh;
        single.triangle_count = 1;
        for (size_t k = 0; k < mesh.triangle_count; k++) {
            tsuya_raster raster;
            single.triangle = mesh.triangle + 3 * k;
            assert_int_equal(draw(&raster, &single, &camera, tsuya_pose_identity(), 1), TSUYA_OK);
            for (int p = 0; p < N * N; p++) {
                count[p] += raster.depth[p] > 0.0f;
            }
            tsuya_raster_free(&raster);
        }
        for (int p = 0; p < N * N; p++) {
            bool in = p % N >= 3 && p % N < 35 && p / N >= 3 && p / N < 35; /* top and left edges in, others out */
            assert_int_equal(count[p], in);
        }
        tsuya_mesh_free(&mesh);
    }
}

static double flat(double x, double y)
{
    (void)x;
    (void)y;
    return 0.0;
}

/* The floor runs from far behind the camera to far in front of it, in two triangles. */
static void a_floor_through_the_camera_is_clipped(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_raster raster;
    tsuya_camera camera = pinhole(160, 120, 100.0);
    tsuya_pose pose = tsuya_pose_look_at((tsuya_vec3){0, 0, 1}, (tsuya_vec3){5, 0, 1}, (tsuya_vec3){0, 0, 1});
    assert_int_equal(shape_sheet(&mesh, -1000, 1000, -1000, 1000, 1, 1, flat), TSUYA_OK);
    assert_int_equal(draw(&raster, &mesh, &camera, pose, 2), TSUYA_OK);
    for (int y = 0; y < 120; y++) {
        for (int x = 0; x < 160; x++) {
            double down = (y - camera.cy_px) / camera.fy_px, z = 1.0 / down;
            float drawn = raster.depth[y * 160 + x];
            if (down > 0.0 && z < 900.0) {
                /* half a subpixel of the vertices' rounding moves the horizon: 1/8192 px of 100 px / z */
                assert_true(fabs((double)drawn / z - 1.0) < 1e-5 + 3e-6 * z);
            } else if (down <= 0.0) {
                assert_true(drawn == 0.0f);
            }
        }
    }
    tsuya_raster_free(&raster);
    tsuya_mesh_free(&mesh);
}

static void nothing_is_drawn_of_what_cannot_be_seen(void **state)
{
    (void)state;
    static const float positions[][9] = {
        {0, 0, -1, 1, 0, -1, 0, 1, -1},                /* behind */
        {0, 0, 0, 0, 0, 0, 0, 0, 0},                   /* in the camera */
        {0, 0, 1, 0, 0, 1, 0.1f, 0, 1},                /* two corners the same */
        {0, 0, 1, 0.1f, 0.1f, 1, 0.2f, 0.2f, 1},       /* a line */
        {0, 0, 1, 0, 0, 2, 0, 0, 3},                   /* along the ray */
        {5, 5, 1, 6, 5, 1, 5, 6, 1},                   /* outside */
        {1e30f, 0, 1, 0, 1e30f, 1, -1e30f, 2e30f, 1},  /* beyond any picture */
        {0, 0, 1e-30f, 1e-30f, 0, 0, 0, 1e-30f, 0},    /* denormal */
    };
    tsuya_camera camera = pinhole(64, 48, 60.0);
    for (size_t k = 0; k < sizeof positions / sizeof *positions; k++) {
        tsuya_mesh mesh;
        tsuya_raster raster;
        assert_int_equal(tsuya_mesh_create(&mesh, 3, 1, 0), TSUYA_OK);
        memcpy(mesh.position, positions[k], sizeof positions[k]);
        mesh.triangle[1] = 1;
        mesh.triangle[2] = 2;
        assert_int_equal(draw(&raster, &mesh, &camera, tsuya_pose_identity(), 2), TSUYA_OK);
        if (k != 6 && k != 7) {
            for (int p = 0; p < 64 * 48; p++) {
                assert_true(raster.depth[p] == 0.0f && raster.triangle[p] == UINT32_MAX);
            }
        }
        tsuya_raster_free(&raster);
        tsuya_mesh_free(&mesh);
    }
}

static void weights_find_the_point_of_the_pixel(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_raster raster;
    tsuya_camera camera = pinhole(160, 120, 140.0);
    tsuya_pose pose = tsuya_pose_look_at((tsuya_vec3){1.5, -1.2, 1.0}, (tsuya_vec3){0, 0, 0}, (tsuya_vec3){0, 0, 1});
    assert_int_equal(shape_sheet(&mesh, -1, 1, -1, 1, 17, 13, hilly), TSUYA_OK);
    assert_int_equal(draw(&raster, &mesh, &camera, pose, 1), TSUYA_OK);
    int tested = 0;
    for (int p = 0; p < 160 * 120; p++) {
        if (raster.triangle[p] == UINT32_MAX) {
            continue;
        }
        double w[3];
        tsuya_vec2 pixel = {p % 160, p / 160}, back;
        assert_true(tsuya_raster_weights(w, &mesh, raster.triangle[p], &camera, pose, pixel));
        tsuya_vec3 at = {0, 0, 0};
        for (size_t k = 0; k < 3; k++) {
            assert_true(w[k] > -0.02 && w[k] < 1.02);
            at = tsuya_vec3_mad(at, w[k], tsuya_mesh_position(&mesh, mesh.triangle[3 * (size_t)raster.triangle[p] + k]));
        }
        assert_true(fabs(w[0] + w[1] + w[2] - 1.0) < 1e-12);
        tsuya_vec3 seen = tsuya_pose_apply(pose, at);
        assert_true(tsuya_camera_project(&camera, seen, &back));
        assert_true(hypot(back.x - pixel.x, back.y - pixel.y) < 1e-6);
        assert_true(fabs(seen.z / (double)raster.depth[p] - 1.0) < 2e-3);
        tested++;
    }
    assert_true(tested > 3000);
    tsuya_raster_free(&raster);
    tsuya_mesh_free(&mesh);
}

static void nearer_meshes_cover_what_was_drawn(void **state)
{
    (void)state;
    tsuya_context context = context_of(1);
    tsuya_camera camera = pinhole(32, 32, 30.0);
    tsuya_mesh near, far;
    tsuya_raster raster;
    assert_int_equal(shape_sphere(&near, (tsuya_vec3){0, 0, 4}, 0.5, 20, 20), TSUYA_OK);
    assert_int_equal(shape_sphere(&far, (tsuya_vec3){0, 0, 9}, 2.0, 20, 20), TSUYA_OK);
    assert_int_equal(tsuya_raster_create(&raster, 32, 32), TSUYA_OK);
    assert_int_equal(tsuya_raster_draw(&raster, &near, &camera, tsuya_pose_identity(), &context), TSUYA_OK);
    assert_int_equal(tsuya_raster_draw(&raster, &far, &camera, tsuya_pose_identity(), &context), TSUYA_OK);
    assert_true(fabsf(raster.depth[16 * 32 + 16] - 3.5f) < 0.02f);
    assert_true(raster.depth[16 * 32 + 21] > 6.9f);
    camera.width_px = 31;
    assert_int_equal(tsuya_raster_draw(&raster, &far, &camera, tsuya_pose_identity(), &context), TSUYA_ERROR_INPUT);
    tsuya_raster_free(&raster);
    tsuya_mesh_free(&near);
    tsuya_mesh_free(&far);
}

static void interruption_stops_the_drawing(void **state)
{
    (void)state;
    tsuya_camera camera = pinhole(32, 32, 30.0);
    tsuya_mesh mesh;
    tsuya_raster raster;
    assert_int_equal(shape_sphere(&mesh, (tsuya_vec3){0, 0, 4}, 0.5, 20, 20), TSUYA_OK);
    tsuya_interrupt();
    assert_int_equal(draw(&raster, &mesh, &camera, tsuya_pose_identity(), 2), TSUYA_ERROR_INTERRUPTED);
    tsuya_interrupt_clear();
    tsuya_raster_free(&raster);
    tsuya_mesh_free(&mesh);
}

static void every_allocation_may_fail(void **state)
{
    (void)state;
    tsuya_camera camera = pinhole(32, 32, 30.0);
    tsuya_mesh mesh;
    tsuya_raster raster;
    assert_int_equal(shape_sphere(&mesh, (tsuya_vec3){0, 0, 4}, 0.5, 5, 5), TSUYA_OK);
    tsuya_memory_fail_at(0);
    assert_int_equal(draw(&raster, &mesh, &camera, tsuya_pose_identity(), 2), TSUYA_OK);
    tsuya_raster_free(&raster);
    uint64_t count = tsuya_memory_fail_at(0);
    for (uint64_t n = 1; n <= count; n++) {
        tsuya_memory_fail_at(n);
        assert_int_equal(draw(&raster, &mesh, &camera, tsuya_pose_identity(), 2), TSUYA_ERROR_MEMORY);
        tsuya_raster_free(&raster);
    }
    tsuya_memory_fail_at(0);
    assert_int_equal(tsuya_raster_create(&raster, 0, 5), TSUYA_ERROR_INPUT);
    assert_int_equal(tsuya_raster_create(&raster, 5, 70000), TSUYA_ERROR_INPUT);
    tsuya_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sphere_covers_its_silhouette_at_its_depth),
        cmocka_unit_test(a_distorting_lens_bends_the_picture),
        cmocka_unit_test(threads_do_not_change_a_bit),
        cmocka_unit_test(shared_edges_are_drawn_once),
        cmocka_unit_test(a_floor_through_the_camera_is_clipped),
        cmocka_unit_test(nothing_is_drawn_of_what_cannot_be_seen),
        cmocka_unit_test(weights_find_the_point_of_the_pixel),
        cmocka_unit_test(nearer_meshes_cover_what_was_drawn),
        cmocka_unit_test(interruption_stops_the_drawing),
        cmocka_unit_test(every_allocation_may_fail),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
