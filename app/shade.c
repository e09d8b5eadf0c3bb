#include "app/shade.h"

#include <math.h>
#include <string.h>

static const uint8_t background[3] = {244, 241, 234};

void tsuya_color_map(uint8_t rgb[3], double t)
{
    static const double anchor[9][3] = {{68, 1, 84},    {71, 44, 122},  {59, 81, 139},  {44, 113, 142}, {33, 144, 141},
                                        {39, 173, 129}, {92, 200, 99},  {170, 220, 50}, {253, 231, 37}};
    t = t > 0.0 ? (t < 1.0 ? t : 1.0) : 0.0;
    int i = t < 1.0 ? (int)(8.0 * t) : 7;
    double f = 8.0 * t - i;
    for (int c = 0; c < 3; c++) {
        rgb[c] = (uint8_t)(anchor[i][c] + f * (anchor[i + 1][c] - anchor[i][c]) + 0.5);
    }
}

static tsuya_vec3 weighted3(const float *array, const uint32_t *v, const double w[3])
{
    tsuya_vec3 sum = {0, 0, 0};
    for (int k = 0; k < 3; k++) {
        const float *a = array + 3 * (size_t)v[k];
        sum = tsuya_vec3_mad(sum, w[k], (tsuya_vec3){a[0], a[1], a[2]});
    }
    return sum;
}

static tsuya_vec3 face_normal(const tsuya_mesh *mesh, const uint32_t *v)
{
    tsuya_vec3 a = tsuya_mesh_position(mesh, v[0]);
    return tsuya_vec3_unit(tsuya_vec3_cross(tsuya_vec3_sub(tsuya_mesh_position(mesh, v[1]), a),
                                            tsuya_vec3_sub(tsuya_mesh_position(mesh, v[2]), a)));
}

static void clay(uint8_t rgb[3], tsuya_vec3 n)
{
    tsuya_vec3 light = tsuya_vec3_unit((tsuya_vec3){-0.45, -0.55, -0.70});
    double lit = fmax(tsuya_vec3_dot(n, light), 0.0), facing = fmax(-n.z, 0.0);
    float value = tsuya_srgb_encode((float)(0.05 + 0.50 * lit + 0.12 * facing));
    for (int c = 0; c < 3; c++) {
        rgb[c] = (uint8_t)(255.0f * value * (c == 2 ? 0.96f : 1.0f) + 0.5f);
    }
}

static void shade_pixel(uint8_t rgb[3], const tsuya_mesh *mesh, const uint32_t *v, const double w[3], tsuya_pose camera_from_world,
                        const tsuya_shade_options *options)
{
    const float *value = options->value;
    double x = options->shade == TSUYA_SHADE_VALUE ? w[0] * value[v[0]] + w[1] * value[v[1]] + w[2] * value[v[2]] : NAN;
    if (isfinite(x)) {
        tsuya_color_map(rgb, (x - options->low) / (options->high - options->low));
    } else if (options->shade == TSUYA_SHADE_COLOR && mesh->color) {
        for (int c = 0; c < 3; c++) {
            double sum = 0.0;
            for (int k = 0; k < 3; k++) {
                sum += w[k] * mesh->color[3 * (size_t)v[k] + (size_t)c];
            }
            rgb[c] = (uint8_t)(fmin(fmax(sum, 0.0), 255.0) + 0.5);
        }
    } else {
        tsuya_vec3 n = mesh->normal ? tsuya_vec3_unit(weighted3(mesh->normal, v, w)) : face_normal(mesh, v);
        n = tsuya_mat3_apply(camera_from_world.rotation, n);
        if (options->shade == TSUYA_SHADE_NORMAL) {
            rgb[0] = (uint8_t)(127.5 + 127.0 * n.x);
            rgb[1] = (uint8_t)(127.5 - 127.0 * n.y);
            rgb[2] = (uint8_t)(127.5 - 127.0 * n.z);
        } else {
            clay(rgb, n);
        }
    }
}

tsuya_status tsuya_shade_raster(tsuya_image *picture, const tsuya_raster *raster, const tsuya_mesh *mesh, const tsuya_camera *camera,
                                tsuya_pose camera_from_world, const tsuya_shade_options *options)
{
    TSUYA_TRY(tsuya_image_create(picture, raster->width_px, raster->height_px, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    for (int y = 0; y < raster->height_px; y++) {
        for (int x = 0; x < raster->width_px; x++) {
            uint32_t triangle = raster->triangle[(size_t)y * (size_t)raster->width_px + (size_t)x];
            uint8_t *rgb = tsuya_image_u8(picture, x, y);
            double w[3];
            memcpy(rgb, background, 3);
            if (triangle != UINT32_MAX && tsuya_raster_weights(w, mesh, triangle, camera, camera_from_world, (tsuya_vec2){x, y})) {
                shade_pixel(rgb, mesh, mesh->triangle + 3 * (size_t)triangle, w, camera_from_world, options);
            }
        }
    }
    return TSUYA_OK;
}

tsuya_status tsuya_shade_view(tsuya_image *picture, const tsuya_mesh *mesh, const tsuya_camera *camera, tsuya_pose camera_from_world,
                              const tsuya_shade_options *options, const tsuya_context *context)
{
    tsuya_camera fine = tsuya_camera_scaled(camera, 2 * camera->width_px, 2 * camera->height_px);
    tsuya_raster raster = {0};
    tsuya_image large = {0};
    tsuya_status status;
    TSUYA_GOTO_DONE(status, tsuya_raster_create(&raster, fine.width_px, fine.height_px));
    TSUYA_GOTO_DONE(status, tsuya_raster_draw(&raster, mesh, &fine, camera_from_world, context));
    TSUYA_GOTO_DONE(status, tsuya_shade_raster(&large, &raster, mesh, &fine, camera_from_world, options));
    TSUYA_GOTO_DONE(status, tsuya_image_resize(picture, &large, camera->width_px, camera->height_px));
done:
    tsuya_raster_free(&raster);
    tsuya_image_free(&large);
    return status;
}
