#include "scene_surface.h"

#include "scene_weave.h"
#include "support.h"

#include "core/camera.h"
#include "core/image.h"
#include "core/memory.h"
#include "core/raster.h"

#include <math.h>

enum { WIDTH = 640, HEIGHT = 480, FOCAL = 900, FINE_SIDE = 220, COARSE_SIDE = 56, SAMPLES = 2 };
static const double half_side_m = 0.26, distance_m = 0.95, thread_m = 0.0062, shear = 0.16;

const char *surface_name(surface_kind kind)
{
    static const char *const name[] = {"sheared cylinder", "cone", "drape", "seam"};
    return name[kind];
}

/* Point of the sheet at (u, v), metres along weft and across it. */
static tsuya_vec3 point_at(surface_kind kind, double u, double v)
{
    if (kind == SURFACE_CYLINDER) {
        const double r = 0.17;
        return (tsuya_vec3){r * sin(u / r), v, r * cos(u / r) - r};
    }
    if (kind == SURFACE_CONE) { /* the flat sheet in polar coordinates about a point below it; the cone's half angle has a sine of ½ */
        const double sine = 0.5, apex = 0.6;
        double rho = hypot(u, v + apex), angle = atan2(u, v + apex) / sine, r = rho * sine;
        return (tsuya_vec3){r * sin(angle), rho * sqrt(1.0 - sine * sine) - apex * sqrt(1.0 - sine * sine), r * cos(angle) - apex * sine};
    }
    return (tsuya_vec3){u, v, 0.03 * sin(13.0 * u + 3.0 * v) + 0.015 * sin(17.0 * v - 5.0 * u)};
}

static double skew(surface_kind kind) { return kind == SURFACE_CYLINDER ? shear : 0.0; }

/* Where the weft runs in (u, v). */
static double weft_turn(surface_kind kind, double u) { return kind == SURFACE_SEAM && u > SURFACE_SEAM_M ? SURFACE_SEAM_DEG * M_PI / 180.0 : 0.0; }

static void set_vector(float *out, tsuya_vec3 v)
{
    out[0] = (float)v.x;
    out[1] = (float)v.y;
    out[2] = (float)v.z;
}

static void make_mesh(tsuya_mesh *mesh, float *uv, surface_kind kind, int side)
{
    assert_ok(tsuya_mesh_create(mesh, (size_t)side * (size_t)side, 2 * (size_t)(side - 1) * (size_t)(side - 1), TSUYA_MESH_WEFT));
    for (int j = 0; j < side; j++) {
        for (int i = 0; i < side; i++) {
            size_t k = (size_t)j * (size_t)side + (size_t)i;
            double u = half_side_m * (2.0 * i / (side - 1) - 1.0), v = 0.8 * half_side_m * (2.0 * j / (side - 1) - 1.0), d = 1e-5;
            set_vector(mesh->position + 3 * k, point_at(kind, u, v));
            double du = d * cos(weft_turn(kind, u)), dv = d * sin(weft_turn(kind, u));
            set_vector(mesh->weft + 3 * k, tsuya_vec3_unit(tsuya_vec3_sub(point_at(kind, u + du, v + dv), point_at(kind, u - du, v - dv))));
            if (uv) {
                uv[2 * k] = (float)u;
                uv[2 * k + 1] = (float)v;
            }
        }
    }
    uint32_t *t = mesh->triangle, s = (uint32_t)side;
    for (uint32_t j = 0; j + 1 < s; j++) {
        for (uint32_t i = 0; i + 1 < s; i++, t += 6) {
            uint32_t k = j * s + i;
            const uint32_t six[6] = {k, k + 1, k + s, k + 1, k + s + 1, k + s};
            memcpy(t, six, sizeof six);
        }
    }
    assert_ok(tsuya_mesh_compute_normals(mesh));
}

static tsuya_pose pose_of(int view, int view_count)
{
    double turn = view_count > 1 ? 1.3 * (view / (view_count - 1.0) - 0.5) : 0.0, lift = view % 2 ? 0.25 : -0.12;
    tsuya_vec3 eye = {distance_m * sin(turn) * cos(lift), distance_m * sin(lift), distance_m * cos(turn) * cos(lift) - 0.05};
    return tsuya_pose_look_at(eye, (tsuya_vec3){0, 0, -0.05}, (tsuya_vec3){0, 1, 0});
}

static double shade(const weave_loom *loom, surface_kind kind, double u, double v)
{
    double turn = weft_turn(kind, u), along = cos(turn) * u + sin(turn) * v, across = cos(turn) * v - sin(turn) * u;
    return weave_brightness(loom, across / thread_m, (along + skew(kind) * across) / (1.15 * thread_m));
}

static void photograph(const tsuya_mesh *fine, const float *uv, surface_kind kind, const tsuya_camera *camera, tsuya_pose pose,
                       const char *path, uint64_t seed)
{
    tsuya_context context = tsuya_context_default();
    tsuya_camera big = tsuya_camera_scaled(camera, SAMPLES * WIDTH, SAMPLES * HEIGHT);
    tsuya_raster raster = {0};
    tsuya_image image = {0};
    weave_loom loom;
    weave_cloth cloth = weave_cloth_default();
    cloth.draft = WEAVE_TWILL_22;
    weave_loom_set(&loom, &cloth);
    assert_ok(tsuya_raster_create(&raster, big.width_px, big.height_px));
    assert_ok(tsuya_raster_draw(&raster, fine, &big, pose, &context));
    assert_ok(tsuya_image_create(&image, WIDTH, HEIGHT, 1, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    for (int p = 0; p < WIDTH * HEIGHT; p++) {
        double sum = 0.0;
        for (int q = 0; q < SAMPLES * SAMPLES; q++) {
            int x = SAMPLES * (p % WIDTH) + q % SAMPLES, y = SAMPLES * (p / WIDTH) + q / SAMPLES;
            uint32_t triangle = raster.triangle[(size_t)y * (size_t)big.width_px + (size_t)x];
            double w[3], u = 0.0, v = 0.0;
            if (triangle == UINT32_MAX || !tsuya_raster_weights(w, fine, triangle, &big, pose, (tsuya_vec2){x, y})) {
                sum += 0.05;
                continue;
            }
            for (int k = 0; k < 3; k++) {
                size_t vertex = fine->triangle[3 * (size_t)triangle + (size_t)k];
                u += w[k] * (double)uv[2 * vertex];
                v += w[k] * (double)uv[2 * vertex + 1];
            }
            sum += shade(&loom, kind, u, v);
        }
        double value = 200.0 * sum / (SAMPLES * SAMPLES) + 4.0 * tsuya_random_normal(seed, 5, (uint64_t)p);
        *tsuya_image_u8(&image, p % WIDTH, p / WIDTH) = (uint8_t)fmin(fmax(value + 0.5, 0.0), 255.0);
    }
    assert_ok(tsuya_image_save(&image, path, NULL));
    tsuya_raster_free(&raster);
    tsuya_image_free(&image);
}

void surface_photograph(tsuya_mesh *mesh, surface_kind kind, int view_count, const char *folder)
{
    tsuya_camera camera = {.lens = TSUYA_LENS_PINHOLE, .width_px = WIDTH, .height_px = HEIGHT, .fx_px = FOCAL, .fy_px = FOCAL,
                           .cx_px = 0.5 * (WIDTH - 1), .cy_px = 0.5 * (HEIGHT - 1)};
    uint32_t camera_id = 1;
    tsuya_mesh fine;
    float *uv = tsuya_calloc(2 * FINE_SIDE * FINE_SIDE, sizeof *uv);
    tsuya_view *views = tsuya_calloc((size_t)view_count, sizeof *views);
    char path[TEST_PATH], (*names)[32] = tsuya_calloc((size_t)view_count, sizeof *names);
    assert_true(uv && views && names);
    make_mesh(mesh, NULL, kind, COARSE_SIDE);
    make_mesh(&fine, uv, kind, FINE_SIDE);
    snprintf(path, sizeof path, "%s/images", folder);
    assert_ok(tsuya_folder_make(path));
    for (int v = 0; v < view_count; v++) {
        snprintf(names[v], sizeof names[v], "view_%02d.png", v);
        views[v] = (tsuya_view){.image_id = (uint32_t)(v + 1), .camera_id = 1, .name = names[v], .camera_from_world = pose_of(v, view_count)};
        snprintf(path, sizeof path, "%s/images/%s", folder, names[v]);
        photograph(&fine, uv, kind, &camera, views[v].camera_from_world, path, (uint64_t)(v + 1));
    }
    tsuya_sparse_model model = {.camera = &camera, .camera_id = &camera_id, .camera_count = 1, .view = views, .view_count = view_count};
    snprintf(path, sizeof path, "%s/sparse", folder);
    assert_ok(tsuya_folder_make(path));
    assert_ok(tsuya_sparse_model_save_text(&model, path));
    tsuya_mesh_free(&fine);
    tsuya_free(uv);
    tsuya_free(views);
    tsuya_free(names);
}
