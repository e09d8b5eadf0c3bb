#include "published.h"

#include "core/file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

enum { MOST_VIEWS = 64, PATH = 4096 };

static tsuya_status model_create(tsuya_sparse_model *model, int count)
{
    tsuya_status status = TSUYA_OK;
    *model = (tsuya_sparse_model){0};
    TSUYA_NEW(status, model->camera, (size_t)count);
    TSUYA_NEW(status, model->camera_id, (size_t)count);
    TSUYA_NEW(status, model->view, (size_t)count);
done:
    return status;
}

/* Every view with a camera of its own: published ones differ by fractions of a pixel.  K is in pixels whose first one has
 * its centre at (0, 0). */
static tsuya_status add_view(tsuya_sparse_model *model, const char *name, const double k[9], tsuya_pose pose, int width_px, int height_px)
{
    int at = model->view_count;
    model->camera[at] = (tsuya_camera){.lens = TSUYA_LENS_PINHOLE, .width_px = width_px, .height_px = height_px, .fx_px = k[0], .fy_px = k[4],
                                       .cx_px = k[2], .cy_px = k[5]};
    model->camera_id[at] = (uint32_t)at + 1;
    model->view[at] = (tsuya_view){.image_id = (uint32_t)at + 1, .camera_id = (uint32_t)at + 1, .camera = at, .camera_from_world = pose,
                                   .name = tsuya_strdup(name)};
    model->camera_count = model->view_count = at + 1;
    return model->view[at].name ? TSUYA_OK : TSUYA_ERROR_MEMORY;
}

static bool read_numbers(FILE *file, double *out, int count)
{
    int got = 0;
    while (got < count && fscanf(file, "%lf", &out[got]) == 1) {
        got++;
    }
    return got == count;
}

static tsuya_mat3 matrix_of(const double *e) { return (tsuya_mat3){{{e[0], e[1], e[2]}, {e[3], e[4], e[5]}, {e[6], e[7], e[8]}}}; }

tsuya_status published_middlebury(tsuya_sparse_model *model, const char *parameters, int width_px, int height_px)
{
    int count = 0;
    *model = (tsuya_sparse_model){0};
    FILE *file = fopen(parameters, "r");
    if (!file || fscanf(file, "%d", &count) != 1 || count < 1 || count > MOST_VIEWS) {
        if (file) {
            fclose(file);
        }
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: no list of cameras", parameters);
    }
    tsuya_status status = model_create(model, count);
    for (int i = 0; status == TSUYA_OK && i < count; i++) {
        char name[64];
        double e[21];
        if (fscanf(file, "%63s", name) != 1 || !read_numbers(file, e, 21)) {
            status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: camera %d is incomplete", parameters, i + 1);
            break;
        }
        tsuya_pose pose = {matrix_of(e + 9), {e[18], e[19], e[20]}};
        status = add_view(model, name, e, pose, width_px, height_px);
    }
    fclose(file);
    return status;
}

static tsuya_status read_strecha(tsuya_sparse_model *model, const char *path, const char *name, int reduced)
{
    double e[26];
    FILE *file = fopen(path, "r");
    bool whole = file && read_numbers(file, e, 26);
    if (file) {
        fclose(file);
    }
    if (!whole) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: 26 numbers are expected", path);
    }
    double s = 1.0 / reduced;
    for (int i = 0; i < 6; i++) { /* x' + ½ = s (x + ½) */
        e[i] = s * e[i] + (i == 2 || i == 5 ? 0.5 * s - 0.5 : 0.0);
    }
    tsuya_mat3 camera_from_world = tsuya_mat3_transpose(matrix_of(e + 12));
    tsuya_vec3 center = {e[21], e[22], e[23]};
    tsuya_pose pose = {camera_from_world, tsuya_vec3_scale(tsuya_mat3_apply(camera_from_world, center), -1.0)};
    return add_view(model, name, e, pose, (int)e[24] / reduced, (int)e[25] / reduced);
}

tsuya_status published_strecha(tsuya_sparse_model *model, const char *folder, int reduced)
{
    char path[PATH], name[32];
    TSUYA_TRY(model_create(model, MOST_VIEWS));
    for (int i = 0; i < MOST_VIEWS; i++) {
        snprintf(name, sizeof name, "%04d.jpg", i);
        snprintf(path, sizeof path, "%s/%s.camera", folder, name);
        if (!tsuya_path_exists(path)) {
            break;
        }
        TSUYA_TRY(read_strecha(model, path, name, reduced));
    }
    return TSUYA_OK;
}

tsuya_status published_lay_out(const tsuya_sparse_model *model, const char *from, const char *folder)
{
    char target[PATH], link[PATH];
    snprintf(link, sizeof link, "%s/poses", folder);
    TSUYA_TRY(tsuya_folder_make(link));
    TSUYA_TRY(tsuya_sparse_model_save_text(model, link));
    snprintf(link, sizeof link, "%s/photos", folder);
    TSUYA_TRY(tsuya_folder_make(link));
    for (int i = 0; i < model->view_count; i++) {
        char *absolute = realpath(from, NULL);
        snprintf(target, sizeof target, "%s/%s", absolute ? absolute : from, model->view[i].name);
        free(absolute);
        snprintf(link, sizeof link, "%s/photos/%s", folder, model->view[i].name);
        if (symlink(target, link) != 0) {
            return tsuya_fail_errno(link, "cannot be made");
        }
    }
    return TSUYA_OK;
}
