/* Reflectance from photographs: a corner whose light and shadow are known in closed form. */
#include "support.h"

#include "app/gather_input.h"

#include <math.h>

/* Without symmetry, so that every mistaken sign or exchanged axis shows. */
static void lopsided(tsuya_vec3 wi, tsuya_vec3 wo, double rgb[3])
{
    rgb[0] = 0.20 + 0.08 * wi.x - 0.05 * wo.y + 0.03 * wi.y * wo.x;
    rgb[1] = 0.15 - 0.04 * wi.y + 0.06 * wo.x;
    rgb[2] = 0.10 + 0.04 * wi.x * wo.x + 0.02 * wo.z;
}

/* --- a floor and a wall on it: the wall stands at x = 0 from y = −0.05 to 0.05, 0.06 high; the lamp is beyond it ------- */

enum { WIDTH = 160, HEIGHT = 120 };
static const tsuya_vec3 LAMP = {0.5, 0.0, 0.3};
static const double HALF = 0.1, WALL_Y = 0.05, WALL_Z = 0.06, INTENSITY = 0.5, FULL = 0.24;

static void add_square(tsuya_mesh *m, size_t at, tsuya_vec3 origin, tsuya_vec3 a, tsuya_vec3 b, tsuya_vec3 n, tsuya_vec3 weft)
{
    const tsuya_vec3 corner[4] = {origin, tsuya_vec3_add(origin, a), tsuya_vec3_add(tsuya_vec3_add(origin, a), b), tsuya_vec3_add(origin, b)};
    for (size_t k = 0; k < 4; k++) {
        const double v[9] = {corner[k].x, corner[k].y, corner[k].z, n.x, n.y, n.z, weft.x, weft.y, weft.z};
        for (size_t i = 0; i < 3; i++) {
            m->position[3 * (4 * at + k) + i] = (float)v[i];
            m->normal[3 * (4 * at + k) + i] = (float)v[3 + i];
            m->weft[3 * (4 * at + k) + i] = (float)v[6 + i];
        }
    }
    const uint32_t o = (uint32_t)(4 * at), t[6] = {o, o + 1, o + 2, o, o + 2, o + 3};
    memcpy(m->triangle + 6 * at, t, sizeof t);
}

/* Floor in squares of 2 cm, so that shadow maps and patches have something to do. */
static void make_corner(tsuya_mesh *m)
{
    assert_ok(tsuya_mesh_create(m, 4 * 101, 2 * 101, TSUYA_MESH_NORMAL | TSUYA_MESH_WEFT));
    for (size_t k = 0; k < 100; k++) {
        add_square(m, k, (tsuya_vec3){-HALF + 0.02 * (double)(k % 10), -HALF + 0.02 * (double)(k / 10), 0.0}, (tsuya_vec3){0.02, 0, 0}, (tsuya_vec3){0, 0.02, 0},
                   (tsuya_vec3){0, 0, 1}, (tsuya_vec3){0.6, 0.8, 0.0});
    }
    add_square(m, 100, (tsuya_vec3){0, -WALL_Y, 0}, (tsuya_vec3){0, 2.0 * WALL_Y, 0}, (tsuya_vec3){0, 0, WALL_Z}, (tsuya_vec3){1, 0, 0}, (tsuya_vec3){0, 1, 0});
}

static bool in_shadow(tsuya_vec3 p)
{
    double t = p.x / (p.x - LAMP.x), y = p.y + t * (LAMP.y - p.y), z = t * LAMP.z; /* where the way to the lamp crosses x = 0 */
    return p.x < 0.0 && fabs(y) < WALL_Y && z < WALL_Z;
}

/* Radiance along a ray; NaN where it meets nothing. */
static void radiance_along(double rgb[3], tsuya_vec3 eye, tsuya_vec3 way)
{
    tsuya_vec3 p, n = {0, 0, 1}, weft = {0.6, 0.8, 0.0};
    double t = -eye.x / way.x, floor_t = -eye.z / way.z;
    rgb[0] = rgb[1] = rgb[2] = 0.0;
    p = tsuya_vec3_mad(eye, t, way);
    if (t > 0.0 && fabs(p.y) < WALL_Y && p.z > 0.0 && p.z < WALL_Z && (floor_t < 0.0 || t < floor_t)) {
        n = (tsuya_vec3){1, 0, 0};
        weft = (tsuya_vec3){0, 1, 0};
    } else {
        p = tsuya_vec3_mad(eye, floor_t, way);
        if (floor_t <= 0.0 || fabs(p.x) > HALF || fabs(p.y) > HALF || in_shadow(p)) {
            return;
        }
    }
    tsuya_vec3 to_lamp = tsuya_vec3_sub(LAMP, p), warp = tsuya_vec3_cross(n, weft), wi = tsuya_vec3_unit(to_lamp), wo = tsuya_vec3_scale(way, -1.0);
    tsuya_vec3 a = {tsuya_vec3_dot(wi, weft), tsuya_vec3_dot(wi, warp), tsuya_vec3_dot(wi, n)};
    tsuya_vec3 b = {tsuya_vec3_dot(wo, weft), tsuya_vec3_dot(wo, warp), tsuya_vec3_dot(wo, n)};
    if (a.z > 0.0 && b.z > 0.0) {
        lopsided(a, b, rgb);
        for (int c = 0; c < 3; c++) {
            rgb[c] *= INTENSITY * a.z / tsuya_vec3_dot(to_lamp, to_lamp);
        }
    }
}

static void a_corner_with_its_shadow(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_gather *g;
    tsuya_gather_counts counts = {0};
    tsuya_gathered out;
    tsuya_context context = tsuya_context_default();
    tsuya_gather_options options = tsuya_gather_options_default();
    const tsuya_gather_emitter lamp = {.place = LAMP, .rgb = {INTENSITY, INTENSITY, INTENSITY}};
    const tsuya_gather_lamps lamps = {.emitter = &lamp, .count = 1};
    const tsuya_camera camera = {.lens = TSUYA_LENS_PINHOLE, .width_px = WIDTH, .height_px = HEIGHT, .fx_px = 300, .fy_px = 300, .cx_px = 79.5, .cy_px = 59.5};
    const tsuya_vec3 eyes[3] = {{0.25, -0.2, 0.3}, {-0.3, 0.1, 0.3}, {0.1, 0.3, 0.35}};
    size_t clipped = 0;
    make_corner(&mesh);
    options.pattern = false;
    options.cell = 0.02;
    assert_ok(tsuya_gather_create(&g, &mesh, &options));
    for (int k = 0; k < 3; k++) {
        tsuya_image image;
        tsuya_pose pose = tsuya_pose_look_at(eyes[k], (tsuya_vec3){0, 0, 0.01}, (tsuya_vec3){0, 0, 1});
        assert_ok(tsuya_image_create(&image, WIDTH, HEIGHT, 3, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
        for (int i = 0; i < WIDTH * HEIGHT; i++) {
            tsuya_vec3 ray;
            double rgb[3];
            assert_true(tsuya_camera_unproject(&camera, (tsuya_vec2){i % WIDTH, i / WIDTH}, &ray));
            radiance_along(rgb, eyes[k], tsuya_mat3_apply_transposed(pose.rotation, ray));
            for (int c = 0; c < 3; c++) {
                tsuya_image_f32(&image, i % WIDTH, i / WIDTH)[c] = (float)fmin(1.0, rgb[c] / FULL);
            }
            clipped += fmax(rgb[0], fmax(rgb[1], rgb[2])) >= FULL;
        }
        tsuya_gather_view view = {&camera, pose, &image, NULL, {FULL, FULL, FULL}, &lamps};
        assert_ok(tsuya_gather_add(g, &counts, &view, &context));
        tsuya_image_free(&image);
    }
    assert_ok(tsuya_gather_finish(&out, g));
    double worst = 0.0;
    for (int k = 0; k < out.samples.count; k++) {
        double rgb[3];
        lopsided(out.samples.wi[k], out.samples.wo[k], rgb);
        for (int c = 0; c < 3; c++) {
            worst = fmax(worst, fabs(out.samples.value[3 * k + c] / rgb[c] - 1.0));
        }
    }
    print_message("%d rows, worst %.2e; %zu of %zu pixels used, %zu in shadow, %zu clipped\n", out.samples.count, worst, counts.used, counts.seen, counts.shadowed,
                  counts.clipped);
    assert_true(clipped > 300 && counts.clipped > clipped * 4 / 5); /* some lie on borders */
    assert_true(counts.shadowed > 500);
    assert_true(counts.used > counts.seen / 3);
    assert_true(worst < 2e-3); /* a cell is 1.2 degrees wide, and the reflectance nearly linear in it */
    tsuya_gathered_free(&out);
    tsuya_gather_free(g);
    tsuya_mesh_free(&mesh);
}

static void what_cannot_be_gathered_is_said(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    tsuya_gather *g;
    tsuya_gather_options options = tsuya_gather_options_default();
    assert_ok(tsuya_mesh_create(&mesh, 3, 1, TSUYA_MESH_NORMAL));
    assert_fails(tsuya_gather_create(&g, &mesh, &options), "no weft");
    tsuya_mesh_free(&mesh);
    make_corner(&mesh);
    assert_ok(tsuya_ply_save(&mesh, test_path("corner.ply"), NULL));
    tsuya_gather_session session;
    tsuya_context context = tsuya_context_default();
    const char *lights = test_path("dim.json"), *text = "{\"lights\": [{\"type\": \"environment\", \"rgb\": [1, 1, 1]}]}";
    assert_ok(tsuya_file_write(lights, text, strlen(text)));
    tsuya_gather_paths paths = {.photos = test_folder(), .poses = test_folder(), .surface = test_path("corner.ply"), .lights = lights};
    assert_fails(tsuya_gather_photos(&session, &paths, &options, &context), "no lamp beside the environment");
    tsuya_gather_session_free(&session);
    const char *rows = "x_m,y_m,z_m,r,g,b\n0,0,0,0.5,0.5,1.5\n", *point = "{\"lights\": [{\"type\": \"point\", \"position_m\": [0, 0, 1], \"rgb\": [1, 1, 1]}]}";
    assert_ok(tsuya_file_write(lights, point, strlen(point)));
    assert_ok(tsuya_file_write(test_path("patches.csv"), rows, strlen(rows)));
    paths.reference = test_path("patches.csv");
    assert_fails(tsuya_gather_photos(&session, &paths, &options, &context), "line 2");
    tsuya_gather_session_free(&session);
    assert_ok(tsuya_gather_create(&g, &mesh, &options));
    tsuya_gathered out;
    assert_fails(tsuya_gather_finish(&out, g), "no pixel");
    tsuya_gather_free(g);
    tsuya_mesh_free(&mesh);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_corner_with_its_shadow),
        cmocka_unit_test(what_cannot_be_gathered_is_said),
    };
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
