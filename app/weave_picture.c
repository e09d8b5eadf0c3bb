#include "app/weave_picture.h"

#include "core/memory.h"

#include <math.h>
#include <string.h>

enum { REACH_PX = 18 };

typedef struct canvas {
    tsuya_raster raster;
    tsuya_image clay;
    float *direction; /* 2 a pixel, in the picture, unit; 0 where there is none */
    float *tint;
} canvas;

/* The field at a pixel, projected. */
static void set_pixel(canvas *c, size_t p, int x, int y, const tsuya_mesh *mesh, const tsuya_camera *camera, tsuya_pose pose, const float *value)
{
    uint32_t triangle = c->raster.triangle[p];
    double w[3];
    if (triangle == UINT32_MAX || !tsuya_raster_weights(w, mesh, triangle, camera, pose, (tsuya_vec2){x, y})) {
        return;
    }
    tsuya_vec3 first = {0, 0, 0}, sum = {0, 0, 0}, point = {0, 0, 0};
    double tint = 0.0;
    for (int k = 0; k < 3; k++) {
        size_t v = mesh->triangle[3 * (size_t)triangle + (size_t)k];
        const float *f = mesh->weft + 3 * v;
        tsuya_vec3 weft = {(double)f[0], (double)f[1], (double)f[2]};
        first = k == 0 ? weft : first;
        sum = tsuya_vec3_mad(sum, tsuya_vec3_dot(weft, first) < 0.0 ? -w[k] : w[k], weft);
        point = tsuya_vec3_mad(point, w[k], tsuya_mesh_position(mesh, v));
        tint += value ? w[k] * (double)value[v] : 0.0;
    }
    tsuya_vec3 d = tsuya_mat3_apply(pose.rotation, sum), at = tsuya_pose_apply(pose, point);
    double dx = camera->fx_px * (d.x - at.x / at.z * d.z), dy = camera->fy_px * (d.y - at.y / at.z * d.z), length = hypot(dx, dy);
    if (length > 1e-12) {
        c->direction[2 * p] = (float)(dx / length);
        c->direction[2 * p + 1] = (float)(dy / length);
    }
    c->tint[p] = (float)tint;
}

static double noise_at(size_t p) { return tsuya_random_uniform(7, 1, p) < 0.5 ? 0.0 : 1.0; }

/* Mean of the noise along the field, a pixel a step, both ways. */
static double smear(const canvas *c, int x0, int y0)
{
    int w = c->raster.width_px, h = c->raster.height_px;
    double sum = 0.0, count = 0.0;
    for (int side = -1; side <= 1; side += 2) {
        double x = x0, y = y0, px = 0.0, py = 0.0;
        for (int step = 0; step < REACH_PX; step++) {
            int i = (int)lround(x), j = (int)lround(y);
            if (i < 0 || j < 0 || i >= w || j >= h || c->raster.triangle[(size_t)j * (size_t)w + (size_t)i] == UINT32_MAX) {
                break;
            }
            size_t p = (size_t)j * (size_t)w + (size_t)i;
            double dx = (double)c->direction[2 * p], dy = (double)c->direction[2 * p + 1];
            double sign = step == 0 ? side : dx * px + dy * py < 0.0 ? -1.0 : 1.0, weight = 1.0 - (double)step / REACH_PX;
            sum += weight * noise_at(p);
            count += weight;
            px = sign * dx;
            py = sign * dy;
            x += px;
            y += py;
        }
    }
    return count > 0.0 ? sum / count : 0.5;
}

static void paint(tsuya_image *picture, const canvas *c, int x, int y, bool tinted)
{
    size_t p = (size_t)y * (size_t)c->raster.width_px + (size_t)x;
    uint8_t *out = tsuya_image_u8(picture, x, y), tint[3];
    const uint8_t *clay = tsuya_image_u8(&c->clay, x, y);
    memcpy(out, clay, 3);
    if (c->raster.triangle[p] == UINT32_MAX) {
        return;
    }
    double light = fmin(fmax(0.5 + 2.6 * (smear(c, x, y) - 0.5), 0.0), 1.0), shade = 0.35 + 0.8 * light;
    tsuya_color_map(tint, (double)c->tint[p]);
    for (int k = 0; k < 3; k++) {
        double base = tinted ? (double)clay[k] / 255.0 * (60.0 + 0.9 * tint[k]) : clay[k];
        out[k] = (uint8_t)fmin(fmax(base * shade + 0.5, 0.0), 255.0);
    }
}

tsuya_status tsuya_weave_picture(tsuya_image *picture, const tsuya_mesh *mesh, const tsuya_camera *camera, tsuya_pose camera_from_world,
                                 const float *value, const tsuya_context *context)
{
    canvas c = {0};
    tsuya_status status;
    int w = camera->width_px, h = camera->height_px;
    tsuya_shade_options clay = {.shade = TSUYA_SHADE_CLAY};
    TSUYA_GOTO_DONE(status, tsuya_raster_create(&c.raster, w, h));
    TSUYA_GOTO_DONE(status, tsuya_raster_draw(&c.raster, mesh, camera, camera_from_world, context));
    TSUYA_GOTO_DONE(status, tsuya_shade_raster(&c.clay, &c.raster, mesh, camera, camera_from_world, &clay));
    TSUYA_NEW(status, c.direction, 2 * (size_t)w * (size_t)h);
    TSUYA_NEW(status, c.tint, (size_t)w * (size_t)h);
    TSUYA_GOTO_DONE(status, tsuya_image_create(picture, w, h, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
#pragma omp parallel for schedule(dynamic, 8) num_threads(context->threads)
    for (int y = 0; y < h; y++) {
        for (int x = 0; x < w; x++) {
            set_pixel(&c, (size_t)y * (size_t)w + (size_t)x, x, y, mesh, camera, camera_from_world, value);
        }
    }
#pragma omp parallel for schedule(dynamic, 8) num_threads(context->threads)
    for (int y = 0; y < h; y++) {
        for (int x = 0; x < w; x++) {
            paint(picture, &c, x, y, value != NULL);
        }
    }
done:
    tsuya_raster_free(&c.raster);
    tsuya_image_free(&c.clay);
    tsuya_free(c.direction);
    tsuya_free(c.tint);
    return status;
}
