/* Writing COLMAP's sparse models; the counterpart of colmap_model.c, whose half-pixel shift it undoes. */
#include "core/colmap_lens.h"
#include "core/file.h"

#include <inttypes.h>

typedef struct output {
    tsuya_file_writer writer;
    FILE *stream;
} output;

static tsuya_status output_open(output *o, const char *folder, const char *name)
{
    char *path = tsuya_path_join(folder, name);
    if (!path) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_status status = tsuya_file_begin(&o->writer, path);
    o->stream = o->writer.stream;
    tsuya_free(path);
    return status;
}

static void put_u32(output *o, uint32_t value) { fwrite(&value, sizeof value, 1, o->stream); }
static void put_u64(output *o, uint64_t value) { fwrite(&value, sizeof value, 1, o->stream); }
static void put_f64(output *o, double value) { fwrite(&value, sizeof value, 1, o->stream); }

static uint64_t point_id_of(const tsuya_sparse_model *model, const tsuya_observation *observation)
{
    return observation->point < 0 ? UINT64_MAX : model->point[observation->point].point_id;
}

static tsuya_status write_cameras(const tsuya_sparse_model *model, output *o, bool binary)
{
    if (binary) {
        put_u64(o, (uint64_t)model->camera_count);
    } else {
        fprintf(o->stream, "# Camera list with one line of data per camera:\n#   CAMERA_ID, MODEL, WIDTH, HEIGHT, PARAMS[]\n");
    }
    for (int i = 0; i < model->camera_count; i++) {
        const tsuya_camera *camera = &model->camera[i];
        double p[12] = {0};
        const tsuya_colmap_lens *lens = tsuya_colmap_parameters(p, camera);
        if (!lens) {
            return TSUYA_ERROR_INPUT;
        }
        if (binary) {
            put_u32(o, model->camera_id[i]);
            put_u32(o, (uint32_t)lens->id);
            put_u64(o, (uint64_t)camera->width_px);
            put_u64(o, (uint64_t)camera->height_px);
        } else {
            fprintf(o->stream, "%u %s %d %d", model->camera_id[i], lens->name, camera->width_px, camera->height_px);
        }
        for (int k = 0; k < lens->parameters; k++) {
            if (binary) {
                put_f64(o, p[k]);
            } else {
                fprintf(o->stream, " %.17g", p[k]);
            }
        }
        fputs(binary ? "" : "\n", o->stream);
    }
    return TSUYA_OK;
}

static void write_view_binary(const tsuya_sparse_model *model, const tsuya_view *view, output *o)
{
    tsuya_quaternion q = tsuya_quaternion_from_mat3(view->camera_from_world.rotation);
    tsuya_vec3 t = view->camera_from_world.translation;
    const double pose[7] = {q.w, q.x, q.y, q.z, t.x, t.y, t.z};
    put_u32(o, view->image_id);
    fwrite(pose, sizeof pose, 1, o->stream);
    put_u32(o, view->camera_id);
    fwrite(view->name, 1, strlen(view->name) + 1, o->stream);
    put_u64(o, (uint64_t)view->observation_count);
    for (int k = 0; k < view->observation_count; k++) {
        put_f64(o, (double)view->observation[k].x_px + 0.5);
        put_f64(o, (double)view->observation[k].y_px + 0.5);
        put_u64(o, point_id_of(model, &view->observation[k]));
    }
}

static void write_view_text(const tsuya_sparse_model *model, const tsuya_view *view, output *o)
{
    tsuya_quaternion q = tsuya_quaternion_from_mat3(view->camera_from_world.rotation);
    tsuya_vec3 t = view->camera_from_world.translation;
    fprintf(o->stream, "%u %.17g %.17g %.17g %.17g %.17g %.17g %.17g %u %s\n", view->image_id, q.w, q.x, q.y, q.z, t.x, t.y, t.z,
            view->camera_id, view->name);
    for (int k = 0; k < view->observation_count; k++) {
        fprintf(o->stream, "%s%.9g %.9g %" PRId64, k ? " " : "", (double)view->observation[k].x_px + 0.5,
                (double)view->observation[k].y_px + 0.5, (int64_t)point_id_of(model, &view->observation[k]));
    }
    fputc('\n', o->stream);
}

static tsuya_status write_views(const tsuya_sparse_model *model, output *o, bool binary)
{
    if (binary) {
        put_u64(o, (uint64_t)model->view_count);
    } else {
        fprintf(o->stream, "# Image list with two lines of data per image:\n#   IMAGE_ID, QW, QX, QY, QZ, TX, TY, TZ, CAMERA_ID, NAME\n"
                           "#   POINTS2D[] as (X, Y, POINT3D_ID)\n");
    }
    for (int v = 0; v < model->view_count; v++) {
        (binary ? write_view_binary : write_view_text)(model, &model->view[v], o);
    }
    return TSUYA_OK;
}

static tsuya_status write_points(const tsuya_sparse_model *model, output *o, bool binary)
{
    if (binary) {
        put_u64(o, model->point_count);
    } else {
        fprintf(o->stream, "# 3D point list with one line of data per point:\n#   POINT3D_ID, X, Y, Z, R, G, B, ERROR, TRACK[] as "
                           "(IMAGE_ID, POINT2D_IDX)\n");
    }
    for (size_t i = 0; i < model->point_count; i++) {
        const tsuya_point *p = &model->point[i];
        if (binary) {
            put_u64(o, p->point_id);
            fwrite(&p->position, sizeof p->position, 1, o->stream);
            fwrite(p->color, sizeof p->color, 1, o->stream);
            put_f64(o, p->error_px);
            put_u64(o, (uint64_t)p->track_count);
        } else {
            fprintf(o->stream, "%" PRIu64 " %.17g %.17g %.17g %d %d %d %.9g", p->point_id, p->position.x, p->position.y, p->position.z,
                    p->color[0], p->color[1], p->color[2], p->error_px);
        }
        for (int k = 0; k < p->track_count; k++) {
            uint32_t image = model->view[p->track[k].view].image_id;
            if (binary) {
                put_u32(o, image);
                put_u32(o, (uint32_t)p->track[k].observation);
            } else {
                fprintf(o->stream, " %u %d", image, p->track[k].observation);
            }
        }
        fputs(binary ? "" : "\n", o->stream);
    }
    return TSUYA_OK;
}

typedef tsuya_status (*part_writer)(const tsuya_sparse_model *, output *, bool);

static tsuya_status save(const tsuya_sparse_model *model, const char *folder, bool binary)
{
    static const part_writer WRITE[3] = {write_cameras, write_views, write_points};
    static const char *const NAME[2][3] = {{"cameras.txt", "images.txt", "points3D.txt"}, {"cameras.bin", "images.bin", "points3D.bin"}};
    TSUYA_TRY(tsuya_folder_make(folder));
    for (int part = 0; part < 3; part++) {
        output o = {0};
        TSUYA_TRY(output_open(&o, folder, NAME[binary][part]));
        tsuya_status status = WRITE[part](model, &o, binary);
        if (status != TSUYA_OK) {
            tsuya_file_abort(&o.writer);
            return status;
        }
        TSUYA_TRY(tsuya_file_commit(&o.writer));
    }
    return TSUYA_OK;
}

tsuya_status tsuya_sparse_model_save_text(const tsuya_sparse_model *model, const char *folder) { return save(model, folder, false); }
tsuya_status tsuya_sparse_model_save_binary(const tsuya_sparse_model *model, const char *folder) { return save(model, folder, true); }
