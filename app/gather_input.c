#include "app/gather_input.h"

#include "core/file.h"
#include "core/order.h"
#include "core/photo.h"
#include "core/table.h"
#include "render/light.h"

#include <math.h>
#include <string.h>

enum { SIDE = 3, PIECES = SIDE * SIDE, LAMPS_MOST = 16 };

/* --- lamps: large ones in pieces of equal area --------------------------------------------------------------------------- */

static tsuya_vec3 piece_place(const tsuya_light *l, int k)
{
    double u = (k % SIDE + 0.5) / SIDE - 0.5, v = (k / SIDE + 0.5) / SIDE - 0.5;
    if (l->kind == TSUYA_LIGHT_DISK) { /* the sunflower's spiral */
        double r = 0.5 * l->size_m[0] * sqrt((k + 0.5) / PIECES), a = k * M_PI * (3.0 - sqrt(5.0));
        return tsuya_vec3_mad(tsuya_vec3_mad(l->position_m, r * cos(a), l->side), r * sin(a), tsuya_vec3_cross(l->side, l->direction));
    }
    return tsuya_vec3_mad(tsuya_vec3_mad(l->position_m, u * l->size_m[0], l->side), v * l->size_m[1], tsuya_vec3_cross(l->side, l->direction));
}

static void add_lamp(tsuya_gather_session *s, const tsuya_light *l, int lamp)
{
    bool large = l->kind == TSUYA_LIGHT_DISK || l->kind == TSUYA_LIGHT_RECT;
    for (int k = 0; k < (large ? PIECES : 1); k++) {
        tsuya_gather_emitter *e = &s->emitter[s->lamps.count++];
        *e = (tsuya_gather_emitter){.lamp = lamp, .distant = l->kind == TSUYA_LIGHT_DIRECTIONAL, .place = l->position_m};
        if (large) {
            e->place = piece_place(l, k);
            e->axis = l->direction;
        } else if (e->distant) {
            e->place = tsuya_vec3_scale(l->direction, -1.0);
        }
        for (int c = 0; c < 3; c++) {
            e->rgb[c] = l->rgb[c] * (large ? l->area_m2 / PIECES : 1.0);
        }
    }
}

static tsuya_status load_lamps(tsuya_gather_session *s, const char *path)
{
    tsuya_light_set set = {0};
    tsuya_status status;
    int lamps = 0;
    TSUYA_GOTO_DONE(status, tsuya_light_set_load(&set, path));
    TSUYA_NEW(status, s->emitter, (size_t)set.count * PIECES);
    TSUYA_NEW(status, s->placed, (size_t)set.count * PIECES);
    for (int i = 0; i < set.count; i++) {
        const tsuya_light *l = &set.light[i];
        if (l->kind == TSUYA_LIGHT_SPOT || l->map || lamps == LAMPS_MOST) {
            status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: lights: %s; at most %d lamps of type point, disk, rect or directional and an even environment are accepted",
                                path, l->map ? "an environment with a picture" : l->kind == TSUYA_LIGHT_SPOT ? "a spot" : "too many", LAMPS_MOST);
            goto done;
        }
        if (l->kind == TSUYA_LIGHT_ENVIRONMENT) {
            for (int c = 0; c < 3; c++) {
                s->lamps.ambient[c] += l->rgb[c];
            }
        } else {
            add_lamp(s, l, lamps++);
        }
    }
    if (lamps == 0) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: lights: no lamp beside the environment; reflectance needs a direction of light", path);
    }
done:
    tsuya_light_set_free(&set);
    return status;
}

/* Where the lamps are while a photograph is taken. */
static void place_lamps(tsuya_gather_session *s, bool with_camera, tsuya_pose camera_from_world)
{
    tsuya_pose world_from_camera = tsuya_pose_inverse(camera_from_world);
    memcpy(s->placed, s->emitter, (size_t)s->lamps.count * sizeof *s->placed);
    s->lamps.emitter = s->placed;
    for (int k = 0; k < s->lamps.count && with_camera; k++) {
        tsuya_gather_emitter *e = &s->placed[k];
        e->place = e->distant ? tsuya_mat3_apply(world_from_camera.rotation, e->place) : tsuya_pose_apply(world_from_camera, e->place);
        e->axis = tsuya_mat3_apply(world_from_camera.rotation, e->axis);
    }
}

/* --- patches -------------------------------------------------------------------------------------------------------------- */

typedef struct patches { tsuya_gather_patch *patch; int count; } patches;

static tsuya_status load_patches(patches *out, const char *path)
{
    static const char *const required[] = {"x_m", "y_m", "z_m", "r", "g", "b", NULL};
    static const char *const known[] = {"x_m", "y_m", "z_m", "nx", "ny", "nz", "r", "g", "b", "size_m", NULL};
    const tsuya_table_options options = {.required = required, .known = known};
    tsuya_table t = {0};
    tsuya_status status;
    if (!path) {
        return TSUYA_OK;
    }
    TSUYA_TRY(tsuya_table_load(&t, path, &options));
    int at[10];
    for (int k = 0; k < 10; k++) {
        at[k] = tsuya_table_column(&t, known[k]);
    }
    bool normals = at[3] >= 0 && at[4] >= 0 && at[5] >= 0;
    TSUYA_NEW(status, out->patch, t.row_count);
    status = TSUYA_OK;
    for (size_t row = 0; row < t.row_count && status == TSUYA_OK; row++) {
        double v[10];
        for (int k = 0; k < 10; k++) {
            v[k] = at[k] >= 0 ? tsuya_table_at(&t, row, at[k]) : 0.0;
        }
        tsuya_vec3 n = normals ? tsuya_vec3_unit((tsuya_vec3){v[3], v[4], v[5]}) : (tsuya_vec3){0, 0, 1};
        if (tsuya_vec3_norm(n) < 0.5 || !(fmin(v[6], fmin(v[7], v[8])) > 0.0) || !(fmax(v[6], fmax(v[7], v[8])) <= 1.0)) {
            status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: line %d: a normal that is not zero and reflectances above 0 and up to 1 are accepted", path, t.line[row]);
        }
        out->patch[out->count++] = (tsuya_gather_patch){{v[0], v[1], v[2]}, n, {v[6], v[7], v[8]}, v[9]};
    }
done:
    tsuya_table_free(&t);
    return status;
}

/* --- photographs ---------------------------------------------------------------------------------------------------------- */

static tsuya_status load_linear(tsuya_image *linear, const char *path)
{
    tsuya_image loaded = {0}, three = {0};
    TSUYA_TRY(tsuya_image_load(&loaded, path));
    tsuya_status status = tsuya_image_convert(linear, &loaded, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR);
    if (status == TSUYA_OK && linear->channels < 3) {
        status = tsuya_image_create(&three, linear->width_px, linear->height_px, 3, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR);
        for (int y = 0; y < linear->height_px && status == TSUYA_OK; y++) {
            for (int x = 0; x < linear->width_px; x++) {
                for (int c = 0; c < 3; c++) {
                    tsuya_image_f32(&three, x, y)[c] = *tsuya_image_f32(linear, x, y);
                }
            }
        }
        tsuya_image_free(linear);
        *linear = three;
    }
    tsuya_image_free(&loaded);
    return status;
}

static tsuya_status load_mask(tsuya_image *mask, const tsuya_photo *photo)
{
    tsuya_image loaded = {0};
    if (!photo->mask_path) {
        return TSUYA_OK;
    }
    TSUYA_TRY(tsuya_image_load(&loaded, photo->mask_path));
    tsuya_status status = tsuya_image_grey(mask, &loaded, TSUYA_SAMPLE_U8);
    tsuya_image_free(&loaded);
    return status;
}

static tsuya_status check_size(const tsuya_photo *photo, const tsuya_camera *camera)
{
    if (photo->width_px == camera->width_px && photo->height_px == camera->height_px) {
        return TSUYA_OK;
    }
    return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d x %d pixels, its camera has %d x %d; photographs of the camera's size are accepted", photo->path,
                      photo->width_px, photo->height_px, camera->width_px, camera->height_px);
}

typedef struct shot { /* a photograph that the model knows */
    const tsuya_photo *photo;
    const tsuya_camera *camera;
    tsuya_pose camera_from_world;
    double gain[3];
    int patches; /* that told the gain */
} shot;

typedef enum step { SCALE, READ } step;

static tsuya_status do_step(tsuya_gather_session *s, step what, shot *t, const patches *known, bool with_camera, const tsuya_context *context)
{
    tsuya_image linear = {0}, mask = {0};
    tsuya_status status;
    tsuya_gather_view v = {.camera = t->camera, .camera_from_world = t->camera_from_world, .image = &linear, .lamps = &s->lamps};
    place_lamps(s, with_camera, t->camera_from_world);
    TSUYA_GOTO_DONE(status, load_linear(&linear, t->photo->path));
    if (what == SCALE) {
        status = tsuya_gather_reference(t->gain, &t->patches, s->gather, &v, known->patch, known->count, context);
        goto done;
    }
    TSUYA_GOTO_DONE(status, load_mask(&mask, t->photo));
    v.mask = mask.data ? &mask : NULL;
    memcpy(v.gain, t->gain, sizeof v.gain);
    status = tsuya_gather_add(s->gather, &s->counts, &v, context);
done:
    tsuya_image_free(&linear);
    tsuya_image_free(&mask);
    return status;
}

/* Photographs that see no patch well get the session's median. */
static tsuya_status share_gain(shot *list, int count, const char *reference)
{
    tsuya_status status = TSUYA_OK;
    double *value;
    TSUYA_NEW(status, value, (size_t)count);
    for (int c = 0; c < 3 && status == TSUYA_OK; c++) {
        int n = 0;
        for (int i = 0; i < count; i++) {
            value[n] = list[i].gain[c];
            n += list[i].patches > 0;
        }
        if (n == 0) {
            status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: no photograph sees one of the patches well: lit, unclipped, at least 4 pixels across", reference);
            break;
        }
        tsuya_sort_doubles(value, (size_t)n);
        for (int i = 0; i < count; i++) {
            list[i].gain[c] = list[i].patches > 0 ? list[i].gain[c] : value[n / 2];
        }
    }
    tsuya_free(value);
done:
    return status;
}

static tsuya_status list_shots(shot *list, tsuya_gather_session *s, const tsuya_gather_paths *paths, const tsuya_sparse_model *model, const tsuya_photo_set *set)
{
    tsuya_vec3 low, high;
    tsuya_mesh_bounds(&s->mesh, &low, &high);
    for (int i = 0; i < set->count; i++) {
        const tsuya_photo *photo = &set->photo[i];
        int k = tsuya_sparse_model_find(model, photo->name);
        if (k < 0) {
            tsuya_note("%s: passed over, the model has no pose for it", photo->path);
            continue;
        }
        shot *t = &list[s->photos++];
        *t = (shot){.photo = photo, .camera = &model->camera[model->view[k].camera], .camera_from_world = model->view[k].camera_from_world, .gain = {1, 1, 1}};
        TSUYA_TRY(check_size(photo, t->camera));
        s->distance_m += tsuya_vec3_norm(tsuya_vec3_sub(tsuya_pose_center(t->camera_from_world), tsuya_vec3_scale(tsuya_vec3_add(low, high), 0.5)));
    }
    if (s->photos == 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %s has a pose for none of the %d photographs", paths->photos, paths->poses, set->count);
    }
    s->distance_m /= s->photos;
    return TSUYA_OK;
}

static tsuya_status gather_all(tsuya_gather_session *s, const tsuya_gather_paths *paths, const tsuya_sparse_model *model, const tsuya_photo_set *set,
                               const patches *known, const tsuya_context *context)
{
    tsuya_status status;
    shot *list;
    TSUYA_NEW(status, list, (size_t)set->count);
    TSUYA_GOTO_DONE(status, list_shots(list, s, paths, model, set));
    for (step what = known->count > 0 ? SCALE : READ; what <= READ; what++) {
        for (int i = 0; i < s->photos; i++) {
            tsuya_progress_update(context, what == SCALE ? "scale" : "photographs", i, s->photos, list[i].photo->name);
            TSUYA_GOTO_DONE(status, tsuya_check_interrupt());
            TSUYA_GOTO_DONE(status, do_step(s, what, &list[i], known, paths->lamps_with_camera, context));
        }
        TSUYA_GOTO_DONE(status, what == SCALE ? share_gain(list, s->photos, paths->reference) : TSUYA_OK);
    }
    tsuya_progress_update(context, "photographs", s->photos, s->photos, NULL);
done:
    tsuya_free(list);
    return status;
}

tsuya_status tsuya_gather_photos(tsuya_gather_session *s, const tsuya_gather_paths *paths, const tsuya_gather_options *options, const tsuya_context *context)
{
    tsuya_status status;
    tsuya_sparse_model model = {0};
    tsuya_photo_set set = {0};
    patches known = {0};
    *s = (tsuya_gather_session){.relative = !paths->reference};
    TSUYA_GOTO_DONE(status, tsuya_ply_load(&s->mesh, paths->surface));
    if (!s->mesh.normal) {
        TSUYA_GOTO_DONE(status, tsuya_mesh_compute_normals(&s->mesh));
    }
    TSUYA_GOTO_DONE(status, load_lamps(s, paths->lights));
    TSUYA_GOTO_DONE(status, load_patches(&known, paths->reference));
    TSUYA_GOTO_DONE(status, tsuya_sparse_model_load(&model, paths->poses));
    TSUYA_GOTO_DONE(status, tsuya_photo_set_load(&set, paths->photos, paths->masks));
    TSUYA_GOTO_DONE(status, tsuya_gather_create(&s->gather, &s->mesh, options));
    status = gather_all(s, paths, &model, &set, &known, context);
done:
    tsuya_sparse_model_free(&model);
    tsuya_photo_set_free(&set);
    tsuya_free(known.patch);
    return status;
}

void tsuya_gather_session_free(tsuya_gather_session *s)
{
    tsuya_gather_free(s->gather);
    tsuya_mesh_free(&s->mesh);
    tsuya_free(s->emitter);
    tsuya_free(s->placed);
    *s = (tsuya_gather_session){0};
}
