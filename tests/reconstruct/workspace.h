/* A COLMAP dense workspace of a unit sphere, drawn ray by ray. */
#ifndef TSUYA_TESTS_WORKSPACE_H
#define TSUYA_TESTS_WORKSPACE_H

#include "core/camera.h"
#include "core/image.h"
#include "support.h"

enum { WORKSPACE_VIEWS = 10, WORKSPACE_W = 160, WORKSPACE_H = 128 };

typedef struct workspace_options {
    double gain[WORKSPACE_VIEWS]; /* exposure, 0: 1 */
    bool highlight;               /* mirror of a lamp at the camera */
    int spoiled;                  /* this view is all green; −1: none */
    bool masks;
} workspace_options;

/* Linear reflectance of the sphere at a unit vector. */
static inline tsuya_vec3 workspace_reflectance(tsuya_vec3 p)
{
    return (tsuya_vec3){0.3 + 0.15 * sin(4.0 * p.x), 0.25 + 0.1 * sin(3.0 * p.y + 1.0), 0.2 + 0.1 * p.z};
}

static inline tsuya_camera workspace_camera(void)
{
    return (tsuya_camera){.lens = TSUYA_LENS_PINHOLE, .width_px = WORKSPACE_W, .height_px = WORKSPACE_H, .fx_px = 200.0,
                          .fy_px = 200.0, .cx_px = 81.0, .cy_px = 62.0};
}

/* Cameras around the equator and above, at distance 4. */
static inline tsuya_pose workspace_pose(int view)
{
    double phi = 2.0 * M_PI * view / WORKSPACE_VIEWS, up = view % 2 ? 1.6 : -1.6, flat = sqrt(16.0 - up * up);
    return tsuya_pose_look_at((tsuya_vec3){flat * cos(phi), flat * sin(phi), up}, (tsuya_vec3){0, 0, 0}, (tsuya_vec3){0, 0, 1});
}

/* Where a pixel's ray meets the unit sphere. */
static inline bool workspace_hit(tsuya_vec3 *hit, tsuya_pose pose, double x, double y)
{
    tsuya_camera camera = workspace_camera();
    tsuya_vec3 ray = {(x - camera.cx_px) / camera.fx_px, (y - camera.cy_px) / camera.fy_px, 1.0};
    tsuya_vec3 eye = tsuya_pose_center(pose), d = tsuya_vec3_unit(tsuya_mat3_apply_transposed(pose.rotation, ray));
    double b = tsuya_vec3_dot(eye, d), rest = b * b - tsuya_vec3_dot(eye, eye) + 1.0;
    *hit = tsuya_vec3_mad(eye, -b - sqrt(fmax(rest, 0.0)), d);
    return rest >= 0.0;
}

static inline void workspace_pixel(uint8_t rgb[3], const workspace_options *o, int view, tsuya_vec3 hit)
{
    double gain = o->gain[view] > 0.0 ? o->gain[view] : 1.0;
    tsuya_vec3 light = tsuya_vec3_scale(workspace_reflectance(hit), gain);
    tsuya_vec3 towards = tsuya_vec3_unit(tsuya_vec3_sub(tsuya_pose_center(workspace_pose(view)), hit));
    double shine = o->highlight ? pow(fmax(tsuya_vec3_dot(towards, hit), 0.0), 120.0) : 0.0;
    const double c[3] = {light.x + shine, light.y + shine, light.z + shine};
    for (int k = 0; k < 3; k++) {
        rgb[k] = (uint8_t)lrintf(255.0f * tsuya_srgb_encode((float)c[k]));
    }
    if (view == o->spoiled) {
        rgb[0] = rgb[2] = 0;
        rgb[1] = 255;
    }
}

static inline void workspace_draw(const char *folder, const workspace_options *o, int view, const char *name)
{
    char path[TEST_PATH];
    tsuya_image photo, mask;
    assert_ok(tsuya_image_create(&photo, WORKSPACE_W, WORKSPACE_H, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    assert_ok(tsuya_image_create(&mask, WORKSPACE_W, WORKSPACE_H, 1, TSUYA_SAMPLE_U8, TSUYA_ENCODING_DATA));
    for (int y = 0; y < WORKSPACE_H; y++) {
        for (int x = 0; x < WORKSPACE_W; x++) {
            tsuya_vec3 hit;
            if (workspace_hit(&hit, workspace_pose(view), x, y)) {
                workspace_pixel(tsuya_image_u8(&photo, x, y), o, view, hit);
                *tsuya_image_u8(&mask, x, y) = 255;
            }
        }
    }
    snprintf(path, sizeof path, "%.2000s/images/%s", folder, name);
    assert_ok(tsuya_image_save(&photo, path, NULL));
    snprintf(path, sizeof path, "%.2000s/masks/%s.png", folder, name);
    if (o->masks) {
        assert_ok(tsuya_image_save(&mask, path, NULL));
    }
    tsuya_image_free(&photo);
    tsuya_image_free(&mask);
}

static inline void workspace_make(const char *folder, const workspace_options *o)
{
    char path[TEST_PATH], names[WORKSPACE_VIEWS][16];
    tsuya_camera camera = workspace_camera();
    uint32_t camera_id = 1;
    tsuya_view view[WORKSPACE_VIEWS] = {{0}};
    static const char *const parts[] = {"images", "masks", "sparse"};
    assert_ok(tsuya_folder_remove(folder));
    for (int k = 0; k < 3; k++) {
        snprintf(path, sizeof path, "%.2000s/%s", folder, parts[k]);
        assert_ok(tsuya_folder_make(path));
    }
    for (int i = 0; i < WORKSPACE_VIEWS; i++) {
        snprintf(names[i], sizeof names[i], "view%02d.png", i);
        workspace_draw(folder, o, i, names[i]);
        view[i] = (tsuya_view){.image_id = (uint32_t)i + 1, .camera_id = 1, .name = names[i],
                               .camera_from_world = workspace_pose(i)};
    }
    tsuya_sparse_model model = {.camera = &camera, .camera_id = &camera_id, .camera_count = 1, .view = view,
                                .view_count = WORKSPACE_VIEWS};
    assert_ok(tsuya_sparse_model_save_binary(&model, path)); /* sparse was the last one */
}

#endif
