#include "scene_workspace.h"

#include "core/file.h"
#include "core/image.h"
#include "core/memory.h"

#include <stdio.h>
#include <string.h>

static tsuya_status write_picture(const scene_view *v, const char *folder, const char *name, bool mask)
{
    char path[4096];
    tsuya_image image;
    TSUYA_TRY(tsuya_image_create(&image, v->camera.width_px, v->camera.height_px, mask ? 1 : 3, TSUYA_SAMPLE_U8,
                                 mask ? TSUYA_ENCODING_DATA : TSUYA_ENCODING_SRGB));
    for (int y = 0; y < image.height_px; y++) {
        for (int x = 0; x < image.width_px; x++) {
            size_t at = (size_t)y * (size_t)image.width_px + (size_t)x;
            uint8_t *p = tsuya_image_u8(&image, x, y);
            uint8_t grey = (uint8_t)(v->grey[at] * 255.0f + 0.5f);
            if (mask) {
                *p = v->depth[at] > 0.0f ? 255 : 0;
            } else {
                p[0] = p[1] = p[2] = grey;
            }
        }
    }
    snprintf(path, sizeof path, "%s/%s/%s%s", folder, mask ? "masks" : "images", name, mask ? ".png" : "");
    tsuya_status status = tsuya_image_save(&image, path, NULL);
    tsuya_image_free(&image);
    return status;
}

/* The pixel of a world point in a view, when the view's own truth says that it sees the point. */
static bool sees(const scene_view *v, tsuya_vec3 world, tsuya_vec2 *pixel)
{
    tsuya_vec3 p = tsuya_pose_apply(v->camera_from_world, world);
    if (!tsuya_camera_project(&v->camera, p, pixel) || pixel->x < 0 || pixel->y < 0 ||
        pixel->x > v->camera.width_px - 1 || pixel->y > v->camera.height_px - 1) {
        return false;
    }
    size_t at = (size_t)(pixel->y + 0.5) * (size_t)v->camera.width_px + (size_t)(pixel->x + 0.5);
    return v->depth[at] > 0.0f && fabs(v->depth[at] - p.z) < 0.01 * p.z;
}

static tsuya_vec3 truth_point(const scene_view *v, int x, int y)
{
    double z = v->depth[(size_t)y * (size_t)v->camera.width_px + (size_t)x];
    tsuya_vec3 ray = {(x - v->camera.cx_px) / v->camera.fx_px, (y - v->camera.cy_px) / v->camera.fy_px, 1};
    return tsuya_pose_apply(tsuya_pose_inverse(v->camera_from_world), tsuya_vec3_scale(ray, z));
}

/* A point for every twelfth pixel of every view, with every view that sees it. */
static void add_points(tsuya_sparse_model *model, const scene_pictures *s, size_t capacity)
{
    for (int v = 0; v < s->view_count; v++) {
        for (int y = 6; y < s->view[v].camera.height_px; y += 12) {
            for (int x = 6; x < s->view[v].camera.width_px; x += 12) {
                if (!(s->view[v].depth[(size_t)y * (size_t)s->view[v].camera.width_px + (size_t)x] > 0.0f) ||
                    model->point_count == capacity) {
                    continue;
                }
                tsuya_point *p = &model->point[model->point_count];
                p->position = truth_point(&s->view[v], x, y);
                p->point_id = model->point_count + 1;
                for (int other = 0; other < s->view_count; other++) {
                    tsuya_vec2 pixel;
                    tsuya_view *seen_by = &model->view[other];
                    if (sees(&s->view[other], p->position, &pixel)) {
                        p->track[p->track_count++] = (tsuya_track_element){other, seen_by->observation_count};
                        seen_by->observation[seen_by->observation_count++] =
                            (tsuya_observation){(float)pixel.x, (float)pixel.y, (int64_t)model->point_count};
                    }
                }
                model->point_count++;
            }
        }
    }
}

static tsuya_status make_model(tsuya_sparse_model *model, const scene_pictures *s)
{
    tsuya_status status = TSUYA_OK;
    size_t capacity = (size_t)s->view_count * (size_t)(s->view[0].camera.width_px / 12 + 1) *
                      (size_t)(s->view[0].camera.height_px / 12 + 1);
    TSUYA_NEW(status, model->camera, 1);
    TSUYA_NEW(status, model->camera_id, 1);
    TSUYA_NEW(status, model->view, (size_t)s->view_count);
    TSUYA_NEW(status, model->point, capacity);
    model->camera[0] = s->view[0].camera;
    model->camera_id[0] = 1;
    model->camera_count = 1;
    model->view_count = s->view_count;
    for (int v = 0; v < s->view_count; v++) {
        char name[16];
        snprintf(name, sizeof name, "view%02d.png", v);
        model->view[v] = (tsuya_view){.image_id = (uint32_t)v + 1, .camera_id = 1,
                                      .camera_from_world = s->view[v].camera_from_world, .name = tsuya_strdup(name)};
        TSUYA_NEW(status, model->view[v].observation, capacity);
    }
    for (size_t p = 0; p < capacity; p++) {
        TSUYA_NEW(status, model->point[p].track, (size_t)s->view_count);
    }
    add_points(model, s, capacity);
    for (size_t p = model->point_count; p < capacity; p++) {
        tsuya_free(model->point[p].track);
    }
done:
    return status;
}

tsuya_status scene_workspace_write(const scene_pictures *s, const char *folder, bool masks)
{
    static const char *const parts[] = {"images", "masks", "sparse"};
    char path[4096];
    tsuya_sparse_model model = {0};
    tsuya_status status = TSUYA_OK;
    for (int i = 0; i < 3; i++) {
        snprintf(path, sizeof path, "%s/%s", folder, parts[i]);
        TSUYA_TRY(tsuya_folder_make(path));
    }
    TSUYA_GOTO_DONE(status, make_model(&model, s));
    TSUYA_GOTO_DONE(status, tsuya_sparse_model_save_binary(&model, path));
    for (int v = 0; v < s->view_count; v++) {
        TSUYA_GOTO_DONE(status, write_picture(&s->view[v], folder, model.view[v].name, false));
        if (masks) {
            TSUYA_GOTO_DONE(status, write_picture(&s->view[v], folder, model.view[v].name, true));
        }
    }
done:
    tsuya_sparse_model_free(&model);
    return status;
}
