#include "app/job.h"

#include "core/file.h"
#include "core/table.h"
#include "render/render.h"

#include <limits.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>

static const tsuya_yaml_field camera_fields[] = {
    {.key = "board", .kind = TSUYA_YAML_TEXT, .offset = offsetof(tsuya_job_camera, board)},
    {.key = "photos", .kind = TSUYA_YAML_TEXT, .offset = offsetof(tsuya_job_camera, photos)},
    {.key = "model", .kind = TSUYA_YAML_TEXT, .offset = offsetof(tsuya_job_camera, model)},
    {0},
};

static const tsuya_yaml_field scale_fields[] = {
    {.key = "board", .kind = TSUYA_YAML_TEXT, .offset = offsetof(tsuya_job_scale, board)},
    {.key = "distances", .kind = TSUYA_YAML_TEXT_LISTS, .offset = offsetof(tsuya_job_scale, distances)},
    {0},
};

static const tsuya_yaml_field material_fields[] = {
    {.key = "name", .kind = TSUYA_YAML_TEXT, .offset = offsetof(tsuya_job_material, name), .required = true},
    {.key = "samples", .kind = TSUYA_YAML_TEXT, .offset = offsetof(tsuya_job_material, samples)},
    {.key = "model", .kind = TSUYA_YAML_TEXT, .offset = offsetof(tsuya_job_material, model)},
    {.key = "where", .kind = TSUYA_YAML_TEXT, .offset = offsetof(tsuya_job_material, where)},
    {0},
};

static const tsuya_yaml_field render_fields[] = {
    {.key = "name", .kind = TSUYA_YAML_TEXT, .offset = offsetof(tsuya_job_render, name), .required = true},
    {.key = "views", .kind = TSUYA_YAML_INT, .offset = offsetof(tsuya_job_render, views)},
    {.key = "size", .kind = TSUYA_YAML_NUMBERS, .offset = offsetof(tsuya_job_render, size)},
    {.key = "color", .kind = TSUYA_YAML_TEXT, .offset = offsetof(tsuya_job_render, color)},
    {.key = "like", .kind = TSUYA_YAML_TEXT, .offset = offsetof(tsuya_job_render, like)},
    {.key = "elevation", .kind = TSUYA_YAML_NUMBER, .offset = offsetof(tsuya_job_render, elevation_deg)},
    {.key = "exposure", .kind = TSUYA_YAML_NUMBER, .offset = offsetof(tsuya_job_render, exposure_ev)},
    {.key = "tolerance", .kind = TSUYA_YAML_NUMBER, .offset = offsetof(tsuya_job_render, tolerance)},
    {.key = "lights", .kind = TSUYA_YAML_TEXT, .offset = offsetof(tsuya_job_render, lights)},
    {.key = "model", .kind = TSUYA_YAML_TEXT, .offset = offsetof(tsuya_job_render, model)},
    {0},
};

static const tsuya_yaml_field job_fields[] = {
    {.key = "name", .kind = TSUYA_YAML_TEXT, .offset = offsetof(tsuya_job, name), .required = true},
    {.key = "photos", .kind = TSUYA_YAML_TEXT, .offset = offsetof(tsuya_job, photos), .required = true},
    {.key = "masks", .kind = TSUYA_YAML_TEXT, .offset = offsetof(tsuya_job, masks)},
    {.key = "camera", .kind = TSUYA_YAML_RECORD, .offset = offsetof(tsuya_job, camera), .fields = camera_fields,
     .size = sizeof(tsuya_job_camera), .presence_offset = offsetof(tsuya_job, has_camera)},
    {.key = "poses", .kind = TSUYA_YAML_TEXT, .offset = offsetof(tsuya_job, poses)},
    {.key = "scale", .kind = TSUYA_YAML_RECORD, .offset = offsetof(tsuya_job, scale), .fields = scale_fields,
     .size = sizeof(tsuya_job_scale), .presence_offset = offsetof(tsuya_job, has_scale)},
    {.key = "tolerance", .kind = TSUYA_YAML_TEXT, .offset = offsetof(tsuya_job, tolerance)},
    {.key = "materials", .kind = TSUYA_YAML_RECORDS, .offset = offsetof(tsuya_job, materials), .fields = material_fields,
     .size = sizeof(tsuya_job_material)},
    {.key = "lights", .kind = TSUYA_YAML_TEXT, .offset = offsetof(tsuya_job, lights)},
    {.key = "render", .kind = TSUYA_YAML_RECORDS, .offset = offsetof(tsuya_job, render), .fields = render_fields,
     .size = sizeof(tsuya_job_render)},
    {.key = "hold_out", .kind = TSUYA_YAML_TEXTS, .offset = offsetof(tsuya_job, hold_out)},
    {0},
};

bool tsuya_parse_length(double *length, bool *in_metres, const char *text)
{
    static const struct { const char *name; double metres; } units[] = {{"mm", 1e-3}, {"cm", 1e-2}, {"m", 1.0}};
    char number[64];
    double unit = 1.0;
    size_t size = strlen(text);
    *in_metres = false;
    for (size_t i = 0; i < sizeof units / sizeof units[0] && !*in_metres; i++) {
        size_t tail = strlen(units[i].name);
        if (size > tail && strcmp(text + size - tail, units[i].name) == 0) {
            *in_metres = true;
            unit = units[i].metres;
            size -= tail;
        }
    }
    while (size > 0 && text[size - 1] == ' ') {
        size--;
    }
    if (size == 0 || size >= sizeof number) {
        return false;
    }
    memcpy(number, text, size);
    number[size] = '\0';
    if (!tsuya_parse_number(length, number) || !(*length > 0.0 && *length < 1e12)) {
        return false;
    }
    *length *= unit;
    return true;
}

static tsuya_status invalid(const tsuya_job *job, const char *key, const char *value, const char *wanted)
{
    return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %s: '%s' %s", job->path, key, value, wanted);
}

/* A folder or file of the job file, from the current folder. */
static tsuya_status resolve(const tsuya_job *job, const char **path, const char *key, bool folder)
{
    if (!*path) {
        return TSUYA_OK;
    }
    char *joined = tsuya_path_join(job->source_folder, *path);
    if (!joined) {
        return TSUYA_ERROR_MEMORY;
    }
    size_t length = strlen(joined);
    while (length > 1 && joined[length - 1] == '/') {
        joined[--length] = '\0';
    }
    *path = tsuya_arena_printf(job->arena, "%s", joined);
    tsuya_free(joined);
    if (!*path) {
        return TSUYA_ERROR_MEMORY;
    }
    if (!tsuya_path_exists(*path)) {
        return invalid(job, key, *path, folder ? "does not exist; a folder is expected" : "does not exist; a file is expected");
    }
    if (tsuya_path_is_folder(*path) != folder) {
        return invalid(job, key, *path, folder ? "is not a folder" : "is a folder; a file is expected");
    }
    return TSUYA_OK;
}

/* A folder or a file, whichever is there. */
static tsuya_status resolve_either(const tsuya_job *job, const char **path, const char *key)
{
    char *joined = *path ? tsuya_path_join(job->source_folder, *path) : NULL;
    bool folder = joined && tsuya_path_is_folder(joined);
    tsuya_free(joined);
    return resolve(job, path, key, folder);
}

static tsuya_status refuse_inside(const tsuya_job *job, const char *key, const char *path, const char *stage_folder)
{
    char input[PATH_MAX], folder[PATH_MAX];
    if (!path || !realpath(path, input) || !realpath(stage_folder, folder)) {
        return TSUYA_OK;
    }
    size_t length = strlen(folder);
    if (strncmp(input, folder, length) != 0 || (input[length] != '/' && input[length] != '\0')) {
        return TSUYA_OK;
    }
    return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %s: '%s' lies in %s, which a stage of this job empties; move it or choose another "
                      "job folder with -o", job->path, key, path, stage_folder);
}

/* Stages empty their folders (app/runner.c); what the user gave must not be there. */
static tsuya_status check_places(const tsuya_job *job)
{
    static const char *const folder[] = {"capture", "calib", "reconstruct", "weave", "brdf", "render", "report"};
    for (size_t i = 0; i < sizeof folder / sizeof folder[0]; i++) {
        const char *stage_folder = tsuya_job_path(job, "%s", folder[i]);
        if (!stage_folder) {
            return TSUYA_ERROR_MEMORY;
        }
        TSUYA_TRY(refuse_inside(job, "photos", job->photos, stage_folder));
        TSUYA_TRY(refuse_inside(job, "masks", job->masks, stage_folder));
        TSUYA_TRY(refuse_inside(job, "poses", job->poses, stage_folder));
        TSUYA_TRY(refuse_inside(job, "lights", job->lights, stage_folder));
        TSUYA_TRY(refuse_inside(job, "camera: model", job->camera.model, stage_folder));
        TSUYA_TRY(refuse_inside(job, "scale: board", job->scale.board, stage_folder));
        TSUYA_TRY(refuse_inside(job, "camera: board", job->camera.board, stage_folder));
        TSUYA_TRY(refuse_inside(job, "camera: photos", job->camera.photos, stage_folder));
        for (int r = 0; r < job->render.count; r++) {
            TSUYA_TRY(refuse_inside(job, "render: lights", tsuya_job_render_at(job, r)->lights, stage_folder));
            TSUYA_TRY(refuse_inside(job, "render: model", tsuya_job_render_at(job, r)->model, stage_folder));
        }
        for (int m = 0; m < job->materials.count; m++) {
            TSUYA_TRY(refuse_inside(job, "materials: model", tsuya_job_material_at(job, m)->model, stage_folder));
            TSUYA_TRY(refuse_inside(job, "materials: where", tsuya_job_material_at(job, m)->where, stage_folder));
        }
    }
    return TSUYA_OK;
}

/* Names become names of files. */
static bool is_plain_name(const char *name)
{
    return name[0] != '\0' && name[0] != '.' && strlen(name) < 128 && strpbrk(name, "/\\\n\r\t") == NULL;
}

static tsuya_status check_camera(tsuya_job *job)
{
    if (!job->has_camera) {
        return TSUYA_OK;
    }
    tsuya_job_camera *c = &job->camera;
    TSUYA_TRY(resolve(job, &c->board, "camera: board", false));
    TSUYA_TRY(resolve(job, &c->photos, "camera: photos", true));
    TSUYA_TRY(resolve(job, &c->model, "camera: model", false));
    if (c->model ? (c->board || c->photos) : !(c->board && c->photos)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: camera: needs board: and photos: of it, or model: alone", job->path);
    }
    return TSUYA_OK;
}

static tsuya_status check_scale(tsuya_job *job)
{
    if (!job->has_scale) {
        return TSUYA_OK;
    }
    TSUYA_TRY(resolve(job, &job->scale.board, "scale: board", false));
    if ((job->scale.board != NULL) == (job->scale.distances.count > 0)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: scale: needs either board: or distances:", job->path);
    }
    return TSUYA_OK;
}

static tsuya_status check_materials(tsuya_job *job)
{
    tsuya_job_material *material = job->materials.item;
    int everywhere = 0;
    for (int i = 0; i < job->materials.count; i++) {
        tsuya_job_material *m = &material[i];
        if (!is_plain_name(m->name)) {
            return invalid(job, "materials: name", m->name, "cannot be a file's name");
        }
        for (int other = 0; other < i; other++) {
            if (strcmp(material[other].name, m->name) == 0) {
                return invalid(job, "materials: name", m->name, "is there twice");
            }
        }
        TSUYA_TRY(resolve(job, &m->samples, "materials: samples", false));
        TSUYA_TRY(resolve(job, &m->model, "materials: model", false));
        TSUYA_TRY(resolve_either(job, &m->where, "materials: where"));
        if ((m->samples != NULL) == (m->model != NULL)) {
            return invalid(job, "materials: name", m->name, "needs either samples: or model:");
        }
        everywhere += m->where == NULL;
    }
    if (job->materials.count > 0 && everywhere != 1) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: materials: %d of %d without where:; exactly one must have none, which covers what the "
                          "masks of the others leave", job->path, everywhere, job->materials.count);
    }
    return job->materials.count <= 255 ? TSUYA_OK : invalid(job, "materials", "more than 255", "cannot be told apart");
}

/* NAME.png or NAME.jpg.png for the photograph NAME.jpg. */
static bool is_mask_of(const char *mask, const char *photo)
{
    size_t length = strlen(mask), stem = strlen(photo) - strlen(tsuya_path_extension(photo));
    if (length < 4 || strcmp(mask + length - 4, ".png") != 0) {
        return false;
    }
    length -= 4;
    return (length == stem || length == strlen(photo)) && strncmp(mask, photo, length) == 0;
}

tsuya_status tsuya_job_region_mask(const char **path, const tsuya_job *job, int material, int photo)
{
    const char *where = tsuya_job_material_at(job, material)->where, *name = job->photo.photo[photo].name;
    *path = NULL;
    if (!where) {
        return TSUYA_OK;
    }
    if (!tsuya_path_is_folder(where)) {
        *path = is_mask_of(tsuya_path_name(where), name) ? where : NULL;
        return TSUYA_OK;
    }
    int stem = (int)(strlen(name) - strlen(tsuya_path_extension(name)));
    const char *candidate[2] = {tsuya_arena_printf(job->arena, "%s/%.*s.png", where, stem, name),
                                tsuya_arena_printf(job->arena, "%s/%s.png", where, name)};
    if (!candidate[0] || !candidate[1]) {
        return TSUYA_ERROR_MEMORY;
    }
    *path = tsuya_path_exists(candidate[0]) ? candidate[0] : tsuya_path_exists(candidate[1]) ? candidate[1] : NULL;
    return TSUYA_OK;
}

/* The masks of a region are named after photographs. */
static tsuya_status check_regions(const tsuya_job *job)
{
    for (int i = 0; i < job->materials.count; i++) {
        const char *where = tsuya_job_material_at(job, i)->where;
        int masks = 0;
        for (int p = 0; where && p < job->photo.count; p++) {
            const char *mask;
            TSUYA_TRY(tsuya_job_region_mask(&mask, job, i, p));
            masks += mask != NULL;
        }
        if (where && masks == 0) {
            return invalid(job, "materials: where", where, "names no photograph; a folder of masks NAME.png (or NAME.jpg.png) for the "
                           "photographs NAME.jpg is expected, or one such mask");
        }
    }
    return TSUYA_OK;
}

static tsuya_status check_render_size(const tsuya_job *job, tsuya_job_render *r)
{
    r->width_px = 960;
    r->height_px = 1280;
    if (r->size.count == 0) {
        return TSUYA_OK;
    }
    const double *size = r->size.item;
    if (r->size.count != 2 || !(size[0] >= 1.0 && size[0] <= 16384.0) || !(size[1] >= 1.0 && size[1] <= 16384.0) ||
        size[0] != (int)size[0] || size[1] != (int)size[1]) {
        return invalid(job, "render: size of", r->name, "needs [width, height] in px, whole numbers from 1 to 16384");
    }
    r->width_px = (int)size[0];
    r->height_px = (int)size[1];
    return TSUYA_OK;
}

static tsuya_status check_render(const tsuya_job *job, tsuya_job_render *r)
{
    if (!is_plain_name(r->name)) {
        return invalid(job, "render: name", r->name, "cannot be a folder's name");
    }
    TSUYA_TRY(resolve(job, &r->like, "render: like", true));
    TSUYA_TRY(resolve(job, &r->lights, "render: lights", false));
    TSUYA_TRY(resolve(job, &r->model, "render: model", false));
    if (r->tolerance < 0.0 || r->tolerance > 1.0) {
        return invalid(job, "render: tolerance of", r->name, "must be from 0 to 1, as an error on cube roots such as 0.1");
    }
    if (r->like) {
        if (r->views != INT_MIN || r->size.count > 0 || isfinite(r->elevation_deg) || isfinite(r->exposure_ev)) {
            return invalid(job, "render: name", r->name, "has like:, which takes views, size, elevation and exposure from the photographs");
        }
        if (strcmp(r->like, job->photos) != 0) {
            return invalid(job, "render: like", r->like, "is not the folder of photos:");
        }
        if (job->hold_out.count == 0) {
            return invalid(job, "render: like", r->like, "renders the photographs of hold_out:, and there is none");
        }
        r->views = 0;
        return TSUYA_OK;
    }
    if (r->views == INT_MIN) {
        r->views = 12;
    }
    if (r->views < 1 || r->views > 3600) {
        return invalid(job, "render: views of", r->name, "must be from 1 to 3600");
    }
    TSUYA_TRY(check_render_size(job, r));
    if (fabs(r->elevation_deg) > 89.0) {
        return invalid(job, "render: elevation of", r->name, "must be from -89 to 89 degrees");
    }
    if (fabs(r->exposure_ev) > 30.0) {
        return invalid(job, "render: exposure of", r->name, "must be from -30 to 30 EV");
    }
    if (r->color && tsuya_render_check_color(r->color) != TSUYA_OK) {
        return invalid(job, "render: color", r->color, "is not \"#rrggbb\" nor \"r,g,b\" in linear light, \"photographs\" or \"material\"");
    }
    return TSUYA_OK;
}

static tsuya_status check_renders(tsuya_job *job)
{
    if (job->render.count == 0) {
        tsuya_job_render *turntable = tsuya_arena_alloc(job->arena, 1, sizeof *turntable);
        if (!turntable) {
            return TSUYA_ERROR_MEMORY;
        }
        *turntable = (tsuya_job_render){.name = "turntable", .views = 12, .elevation_deg = NAN, .exposure_ev = NAN, .tolerance = NAN};
        job->render = (tsuya_yaml_list){turntable, 1};
    }
    tsuya_job_render *render = job->render.item;
    for (int i = 0; i < job->render.count; i++) {
        TSUYA_TRY(check_render(job, &render[i]));
        for (int other = 0; other < i; other++) {
            if (strcmp(render[other].name, render[i].name) == 0) {
                return invalid(job, "render: name", render[i].name, "is there twice");
            }
        }
    }
    return TSUYA_OK;
}

static tsuya_status check_hold_out(const tsuya_job *job)
{
    for (int i = 0; i < job->hold_out.count; i++) {
        const char *name = tsuya_job_hold_out_at(job, i);
        const char **names = tsuya_arena_alloc(job->arena, (size_t)job->photo.count + 1, sizeof *names);
        if (!names) {
            return TSUYA_ERROR_MEMORY;
        }
        bool found = false;
        for (int p = 0; p < job->photo.count; p++) {
            names[p] = job->photo.photo[p].name;
            found = found || strcmp(names[p], name) == 0;
        }
        if (!found) {
            const char *nearest = tsuya_nearest_name(name, names);
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: hold_out: '%s' is not a photograph of %s%s%s%s", job->path, name, job->photos,
                              nearest ? "; the nearest name is '" : "", nearest ? nearest : "", nearest ? "'" : "");
        }
    }
    if (job->photo.count - job->hold_out.count < 3) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: photos: %s has %d photographs, %d of them held out; at least 3 must be left",
                          job->path, job->photos, job->photo.count, job->hold_out.count);
    }
    return TSUYA_OK;
}

static tsuya_status check(tsuya_job *job)
{
    if (!is_plain_name(job->name)) {
        return invalid(job, "name", job->name, "must be one line without slashes");
    }
    TSUYA_TRY(resolve(job, &job->photos, "photos", true));
    TSUYA_TRY(resolve(job, &job->masks, "masks", true));
    TSUYA_TRY(resolve(job, &job->poses, "poses", true));
    TSUYA_TRY(resolve(job, &job->lights, "lights", false));
    if (job->tolerance && !tsuya_parse_length(&job->tolerance_units, &job->tolerance_in_metres, job->tolerance)) {
        return invalid(job, "tolerance", job->tolerance, "is not a length such as 0.5mm, or a number above 0");
    }
    TSUYA_TRY(check_camera(job));
    TSUYA_TRY(check_scale(job));
    TSUYA_TRY(check_materials(job));
    TSUYA_TRY(check_renders(job));
    TSUYA_TRY(check_places(job));
    TSUYA_TRY(tsuya_photo_set_load(&job->photo, job->photos, job->masks));
    TSUYA_TRY(check_regions(job));
    return check_hold_out(job);
}

static tsuya_status set_folders(tsuya_job *job, const char *path, const char *folder)
{
    char *source = tsuya_path_folder(path);
    if (!source) {
        return TSUYA_ERROR_MEMORY;
    }
    job->path = tsuya_arena_printf(job->arena, "%s", path);
    job->source_folder = tsuya_arena_printf(job->arena, "%s", source);
    job->folder = tsuya_arena_printf(job->arena, "%s", folder ? folder : source);
    tsuya_free(source);
    return job->path && job->source_folder && job->folder ? TSUYA_OK : TSUYA_ERROR_MEMORY;
}

tsuya_status tsuya_job_load(tsuya_job *job, const char *path, const char *folder)
{
    *job = (tsuya_job){0};
    tsuya_arena *arena;
    TSUYA_TRY(tsuya_arena_create(&arena, 1 << 16));
    tsuya_status status = tsuya_yaml_load(job, sizeof *job, job_fields, path, arena);
    job->arena = arena;
    if (status == TSUYA_OK) {
        status = set_folders(job, path, folder);
    }
    if (status == TSUYA_OK) {
        status = check(job);
    }
    if (status != TSUYA_OK) {
        tsuya_job_free(job);
    }
    return status;
}

void tsuya_job_free(tsuya_job *job)
{
    tsuya_photo_set_free(&job->photo);
    tsuya_arena_free(job->arena);
    *job = (tsuya_job){0};
}

char *tsuya_job_path(const tsuya_job *job, const char *format, ...)
{
    char relative[1024];
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(relative, sizeof relative, format, arguments);
    va_end(arguments);
    return tsuya_arena_printf(job->arena, "%s/%s", job->folder, relative);
}

bool tsuya_job_holds_out(const tsuya_job *job, const char *name)
{
    for (int h = 0; h < job->hold_out.count; h++) {
        if (strcmp(tsuya_job_hold_out_at(job, h), name) == 0) {
            return true;
        }
    }
    return false;
}
