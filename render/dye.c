#include "render/dye.h"

#include "core/image.h"
#include "core/memory.h"
#include "core/order.h"
#include "core/raster.h"

#include "render/dye_light.h"
#include "render/dye_solve.h"
#include "render/split.h"

#include <math.h>
#include <string.h>

enum { SPLIT_MOST = 8, ROUNDS = 2 };
static const int SHINE[ROUNDS] = {8, 32};
static const size_t TRIANGLES_MOST = 3000000;
static const double FACING_LEAST = 0.2, CLIPPED = 0.97;

typedef struct dyeing {
    const tsuya_dye_options *options;
    const tsuya_context *context;
    tsuya_mesh mesh;           /* with normals */
    tsuya_mesh *fine;
    tsuya_split_place *place;
    tsuya_material **material;
    tsuya_light_set lights;
    tsuya_ray_scene *rays;
    tsuya_vec3 *eye;
    double edge, grain;        /* mean edge of the mesh; wanted of the finer one */
    uint64_t *seen;            /* bits of views by vertex of the mesh */
    size_t words;
    tsuya_dye_looks looks;
    tsuya_dye_reading *reading; /* TSUYA_DYE_READINGS by fine vertex */
    float *irradiance, *sent;
    uint8_t *own;              /* the mesh's colours, by fine vertex */
} dyeing;

static const tsuya_view *view_of(const dyeing *d, int k) { return &d->options->model->view[d->options->view[k]]; }
static const tsuya_camera *camera_of(const dyeing *d, int k) { return &d->options->model->camera[view_of(d, k)->camera]; }

/* Width of a pixel on the mesh's middle. */
static double grain_of(const dyeing *d, int k)
{
    tsuya_vec3 low, high;
    tsuya_mesh_bounds(&d->mesh, &low, &high);
    return tsuya_vec3_norm(tsuya_vec3_sub(d->eye[k], tsuya_vec3_scale(tsuya_vec3_add(low, high), 0.5))) / camera_of(d, k)->fx_px;
}

static tsuya_status cut(dyeing *d, tsuya_dye_info *info)
{
    int views = d->options->view_count;
    double *grain = tsuya_calloc((size_t)views, sizeof *grain);
    if (!grain) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int k = 0; k < views; k++) {
        grain[k] = grain_of(d, k);
    }
    tsuya_sort_doubles(grain, (size_t)views);
    d->edge = tsuya_mesh_mean_edge(&d->mesh);
    info->split = (int)fmin(fmax(ceil(1.25 * d->edge / grain[views / 2] - 0.25), 1.0), SPLIT_MOST);
    while (info->split > 1 && d->mesh.triangle_count * (size_t)(info->split * info->split) > TRIANGLES_MOST) {
        info->split--;
    }
    d->grain = fmax(grain[views / 2], d->edge / info->split);
    tsuya_free(grain);
    return tsuya_mesh_split(d->fine, &d->place, &d->mesh, info->split);
}

static tsuya_status load(dyeing *d)
{
    const tsuya_dye_options *o = d->options;
    const double none[3] = {0.0, 0.0, 0.0};
    tsuya_status status = TSUYA_OK;
    TSUYA_NEW(status, d->material, (size_t)o->material_count);
    TSUYA_NEW(status, d->eye, (size_t)o->view_count);
    for (int k = 0; k < o->material_count; k++) {
        TSUYA_GOTO_DONE(status, tsuya_material_load(&d->material[k], o->material_path[k]));
        TSUYA_GOTO_DONE(status, tsuya_material_set_dye(d->material[k], none));
    }
    for (int k = 0; k < o->view_count; k++) {
        d->eye[k] = tsuya_pose_center(view_of(d, k)->camera_from_world);
    }
    TSUYA_GOTO_DONE(status, tsuya_light_set_load(&d->lights, o->lights_path));
    if (!d->mesh.color || d->mesh.triangle_count == 0) {
        TSUYA_GOTO_DONE(status, tsuya_fail(TSUYA_ERROR_INPUT, "dye: a mesh without %s; expected a reconstruction's", d->mesh.color ? "triangles" : "colours"));
    }
    if (!d->mesh.normal) {
        TSUYA_GOTO_DONE(status, tsuya_mesh_compute_normals(&d->mesh));
    }
    TSUYA_GOTO_DONE(status, tsuya_ray_scene_create(&d->rays, &d->mesh));
    d->words = ((size_t)o->view_count + 63) / 64;
    TSUYA_NEW(status, d->seen, d->words * d->mesh.vertex_count);
done:
    return status;
}

/* --- what the photographs show --- */

typedef struct shot {
    tsuya_image photo, mask; /* linear floats; one channel of 8 bits */
    tsuya_raster raster;
    tsuya_camera camera;
    tsuya_pose pose;
    tsuya_vec3 eye;
    double edge;
} shot;

static void free_shot(shot *s)
{
    tsuya_image_free(&s->photo);
    tsuya_image_free(&s->mask);
    tsuya_raster_free(&s->raster);
}

static tsuya_status load_scaled(tsuya_image *out, const char *path, const tsuya_camera *full, const tsuya_camera *camera, bool light)
{
    tsuya_image image = {0}, other = {0};
    tsuya_status status = tsuya_image_load(&image, path);
    if (status == TSUYA_OK && (image.width_px != full->width_px || image.height_px != full->height_px)) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d × %d px; its camera has %d × %d", path, image.width_px, image.height_px, full->width_px, full->height_px);
    }
    if (status == TSUYA_OK) {
        status = light ? tsuya_image_convert(&other, &image, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR) : tsuya_image_grey(&other, &image, TSUYA_SAMPLE_U8);
    }
    tsuya_image_free(&image);
    if (status == TSUYA_OK && light && other.channels < 3) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d channel; dyes need a photograph in colour", path, other.channels);
    }
    if (status == TSUYA_OK && (camera->width_px != full->width_px || camera->height_px != full->height_px)) {
        status = tsuya_image_resize(out, &other, camera->width_px, camera->height_px);
        tsuya_image_free(&other);
        return status;
    }
    *out = other;
    return status;
}

/* Never finer than the dyes, so that threads of a close-up are averaged. */
static tsuya_status open_shot(shot *s, const dyeing *d, int k)
{
    const tsuya_camera *full = camera_of(d, k);
    double scale = fmin(1.0, grain_of(d, k) / d->grain);
    scale = scale > 0.75 ? 1.0 : scale;
    s->camera = tsuya_camera_scaled(full, (int)fmax(1.0, round(scale * full->width_px)), (int)fmax(1.0, round(scale * full->height_px)));
    s->pose = view_of(d, k)->camera_from_world;
    s->eye = d->eye[k];
    s->edge = d->edge;
    TSUYA_TRY(load_scaled(&s->photo, d->options->photo[k], full, &s->camera, true));
    if (d->options->mask && d->options->mask[k]) {
        TSUYA_TRY(load_scaled(&s->mask, d->options->mask[k], full, &s->camera, false));
    }
    TSUYA_TRY(tsuya_raster_create(&s->raster, s->camera.width_px, s->camera.height_px));
    return tsuya_raster_draw(&s->raster, &d->mesh, &s->camera, s->pose, d->context);
}

/* Cosine of view at the pixel of a vertex whose four pixels around show its own surface; else 0. */
static double visible(tsuya_vec2 *pixel, const shot *s, const tsuya_mesh *mesh, size_t v)
{
    const float *n = mesh->normal + 3 * v;
    tsuya_vec3 p = tsuya_mesh_position(mesh, v), wo = tsuya_vec3_unit(tsuya_vec3_sub(s->eye, p)), q = tsuya_pose_apply(s->pose, p);
    double cosine = tsuya_vec3_dot(wo, (tsuya_vec3){n[0], n[1], n[2]});
    if (cosine < FACING_LEAST || !tsuya_camera_project(&s->camera, q, pixel) || !(pixel->x >= 0.0 && pixel->x < s->camera.width_px - 1.0) ||
        !(pixel->y >= 0.0 && pixel->y < s->camera.height_px - 1.0)) {
        return 0.0;
    }
    double slack = 0.5 * s->edge + 1.5 * q.z / s->camera.fx_px * (1.0 + sqrt(1.0 - cosine * cosine) / cosine);
    int x = (int)pixel->x, y = (int)pixel->y;
    for (int k = 0; k < 4; k++) {
        size_t at = (size_t)(y + k / 2) * (size_t)s->raster.width_px + (size_t)(x + k % 2);
        double depth = (double)s->raster.depth[at];
        if (!(depth > 0.0) || fabs(depth - q.z) > slack || (s->mask.data && *tsuya_image_u8(&s->mask, x + k % 2, y + k / 2) < 128)) {
            return 0.0;
        }
    }
    return cosine;
}

/* Keeps the readings of highest weight. */
static void keep(tsuya_dye_reading *list, const tsuya_dye_reading *own)
{
    int least = 0;
    for (int k = 1; k < TSUYA_DYE_READINGS; k++) {
        least = list[k].weight < list[least].weight ? k : least;
    }
    if (own->weight > list[least].weight) {
        list[least] = *own;
    }
}

static void read_shot(dyeing *d, const shot *s, int k)
{
#pragma omp parallel for schedule(static) num_threads(d->context->threads)
    for (size_t v = 0; v < d->fine->vertex_count; v++) {
        tsuya_vec2 pixel;
        double cosine = visible(&pixel, s, d->fine, v);
        float rgb[4];
        if (cosine <= 0.0) {
            continue;
        }
        tsuya_image_sample_bilinear(&s->photo, pixel.x, pixel.y, rgb);
        tsuya_dye_reading own = {.view = (uint32_t)k, .weight = (float)(cosine * cosine)};
        memcpy(own.value, rgb, sizeof own.value);
        if (fmaxf(fmaxf(rgb[0], rgb[1]), rgb[2]) < (float)CLIPPED) {
            keep(d->reading + TSUYA_DYE_READINGS * v, &own);
        }
    }
}

/* Corners of every triangle on which a reading lies are looked at. */
static void mark_seen(dyeing *d)
{
    for (size_t v = 0; v < d->fine->vertex_count; v++) {
        const tsuya_dye_reading *r = d->reading + TSUYA_DYE_READINGS * v;
        for (int k = 0; k < 3 * TSUYA_DYE_READINGS; k++) {
            uint32_t view = r[k / 3].view;
            if (r[k / 3].weight > 0.0f) {
                d->seen[d->words * d->place[v].corner[k % 3] + view / 64] |= 1ULL << (view % 64);
            }
        }
    }
}

static tsuya_status read_photographs(dyeing *d)
{
    for (int k = 0; k < d->options->view_count; k++) {
        shot s = {.edge = 0.0};
        tsuya_progress_update(d->context, "photographs", k, d->options->view_count, view_of(d, k)->name);
        TSUYA_TRY(tsuya_check_interrupt());
        tsuya_status status = open_shot(&s, d, k);
        if (status == TSUYA_OK) {
            read_shot(d, &s, k);
        }
        free_shot(&s);
        TSUYA_TRY(status);
    }
    mark_seen(d);
    return TSUYA_OK;
}

static tsuya_status list_looks(dyeing *d)
{
    tsuya_status status = TSUYA_OK;
    size_t count = 0;
    TSUYA_NEW(status, d->looks.first, d->mesh.vertex_count + 1);
    for (size_t v = 0; v < d->mesh.vertex_count; v++) {
        for (size_t w = 0; w < d->words; w++) {
            count += (size_t)__builtin_popcountll(d->seen[d->words * v + w]);
        }
        d->looks.first[v + 1] = count;
    }
    TSUYA_NEW(status, d->looks.look, count);
    for (size_t v = 0, at = 0; v < d->mesh.vertex_count; v++) {
        for (uint32_t k = 0; k < (uint32_t)d->options->view_count; k++) {
            if (d->seen[d->words * v + k / 64] >> (k % 64) & 1) {
                d->looks.look[at++].view = k;
            }
        }
    }
    if (count == 0) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "dye: none of the %d photographs shows the cloth", d->options->view_count);
    }
done:
    return status;
}

/* What each vertex of the mesh sends, all round: by its dye so far, and what the surface part throws back of light from the normal. */
static void send(dyeing *d)
{
    for (size_t v = 0; v < d->mesh.vertex_count; v++) {
        int index = d->mesh.material && d->options->material_count > 1 ? d->mesh.material[v] : 0;
        double dye[3], albedo[3];
        for (size_t c = 0; c < 3; c++) {
            dye[c] = (double)tsuya_srgb_decode(d->fine->color[3 * v + c] / 255.0f);
        }
        tsuya_material_albedo(d->material[index], dye, (tsuya_vec3){0, 0, 1}, albedo);
        for (size_t c = 0; c < 3; c++) {
            d->sent[3 * v + c] = (float)(albedo[c] * (double)d->irradiance[3 * v + c] / M_PI);
        }
    }
}

static tsuya_status dye(dyeing *d, tsuya_dye_info *info)
{
    tsuya_status status = TSUYA_OK;
    tsuya_dye_room room = {.mesh = &d->mesh, .rays = d->rays, .lights = &d->lights, .material = d->material, .material_count = d->options->material_count,
                           .eye = d->eye, .bias = 0.1 * d->edge};
    tsuya_dye_problem problem = {.fine = d->fine, .place = d->place, .reading = d->reading, .looks = &d->looks, .own = d->own,
                                 .view_count = d->options->view_count};
    TSUYA_NEW(status, d->irradiance, 3 * d->mesh.vertex_count);
    TSUYA_NEW(status, d->sent, 3 * d->mesh.vertex_count);
    TSUYA_GOTO_DONE(status, tsuya_dye_light(d->irradiance, NULL, &room, NULL, d->context));
    for (int round = 0; round < ROUNDS; round++) { /* the mesh's own colours, then the dyes, light the folds */
        send(d);
        room.shine = SHINE[round];
        TSUYA_GOTO_DONE(status, tsuya_dye_light(d->irradiance, &d->looks, &room, d->sent, d->context));
        TSUYA_GOTO_DONE(status, tsuya_dye_solve(info, &problem, d->context));
    }
done:
    return status;
}

static void free_dyeing(dyeing *d)
{
    for (int k = 0; d->material && k < d->options->material_count; k++) {
        tsuya_material_free(d->material[k]);
    }
    tsuya_mesh_free(&d->mesh);
    tsuya_light_set_free(&d->lights);
    tsuya_ray_scene_free(d->rays);
    tsuya_free(d->material);
    tsuya_free(d->place);
    tsuya_free(d->eye);
    tsuya_free(d->seen);
    tsuya_free(d->looks.first);
    tsuya_free(d->looks.look);
    tsuya_free(d->reading);
    tsuya_free(d->irradiance);
    tsuya_free(d->sent);
    tsuya_free(d->own);
}

tsuya_status tsuya_dye_from_photographs(tsuya_mesh *dyed, tsuya_dye_info *info, const tsuya_mesh *mesh, const tsuya_dye_options *options,
                                        const tsuya_context *context)
{
    double start = tsuya_clock_s();
    dyeing d = {.options = options, .context = context, .fine = dyed};
    tsuya_status status;
    *dyed = (tsuya_mesh){0};
    *info = (tsuya_dye_info){.photos = options->view_count};
    TSUYA_GOTO_DONE(status, tsuya_mesh_copy(&d.mesh, mesh));
    TSUYA_GOTO_DONE(status, load(&d));
    TSUYA_GOTO_DONE(status, cut(&d, info));
    info->vertices = dyed->vertex_count;
    TSUYA_NEW(status, d.reading, TSUYA_DYE_READINGS * dyed->vertex_count);
    TSUYA_NEW(status, d.own, 3 * dyed->vertex_count);
    memcpy(d.own, dyed->color, 3 * dyed->vertex_count);
    TSUYA_GOTO_DONE(status, read_photographs(&d));
    TSUYA_GOTO_DONE(status, list_looks(&d));
    TSUYA_GOTO_DONE(status, dye(&d, info));
    info->seconds = tsuya_clock_s() - start;
done:
    free_dyeing(&d);
    if (status != TSUYA_OK) {
        tsuya_mesh_free(dyed);
    }
    return status;
}

void tsuya_dye_info_to_json(tsuya_json *object, const tsuya_dye_info *info)
{
    tsuya_json_set_number(object, "photos", info->photos);
    tsuya_json_set_number(object, "split", info->split);
    tsuya_json_set_number(object, "vertices", (double)info->vertices);
    tsuya_json_set_number(object, "seen_fraction", info->seen);
    tsuya_json_set_numbers(object, "gain", info->gain, 3);
    tsuya_json_set_number(object, "residual", info->residual);
    tsuya_json_set_number(object, "seconds", info->seconds);
}
