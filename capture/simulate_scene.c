/* SCENE.yaml: its keys, what they are where they are left out, and what they may be. */
#include "capture/simulate.h"

#include "capture/drape.h"
#include "core/table.h"

#include <limits.h>
#include <stdio.h>
#include <math.h>
#include <string.h>

#define FIELD(record, name, type) {.key = #name, .kind = type, .offset = offsetof(record, name)}
#define RECORD(name, table, record, presence) \
    {.key = #name, .kind = TSUYA_YAML_RECORD, .offset = offsetof(tsuya_simulate_scene, name), .fields = table, .size = sizeof(record), presence}

typedef struct scene_file { /* what the file holds beside the scene: which records were there */
    tsuya_simulate_scene scene;
    bool has_stand, has_camera, has_cloth;
} scene_file;

static const tsuya_yaml_field cloth_fields[] = {
    FIELD(tsuya_scene_cloth, kind, TSUYA_YAML_TEXT),        FIELD(tsuya_scene_cloth, fabric, TSUYA_YAML_TEXT),
    FIELD(tsuya_scene_cloth, reflectance, TSUYA_YAML_TEXT), FIELD(tsuya_scene_cloth, side_m, TSUYA_YAML_NUMBER),
    FIELD(tsuya_scene_cloth, spacing_m, TSUYA_YAML_NUMBER), FIELD(tsuya_scene_cloth, weft_mm, TSUYA_YAML_NUMBER),
    FIELD(tsuya_scene_cloth, warp_mm, TSUYA_YAML_NUMBER),   FIELD(tsuya_scene_cloth, unevenness, TSUYA_YAML_NUMBER),
    FIELD(tsuya_scene_cloth, drop_m, TSUYA_YAML_NUMBER),    FIELD(tsuya_scene_cloth, fullness, TSUYA_YAML_NUMBER),
    FIELD(tsuya_scene_cloth, pleats, TSUYA_YAML_INT),       FIELD(tsuya_scene_cloth, smooth, TSUYA_YAML_INT),
    FIELD(tsuya_scene_cloth, levels, TSUYA_YAML_INT),       {0},
};
static const tsuya_yaml_field stand_fields[] = {
    FIELD(tsuya_scene_stand, kind, TSUYA_YAML_TEXT),       FIELD(tsuya_scene_stand, radius_m, TSUYA_YAML_NUMBER),
    FIELD(tsuya_scene_stand, height_m, TSUYA_YAML_NUMBER), FIELD(tsuya_scene_stand, length_m, TSUYA_YAML_NUMBER), {0},
};
static const tsuya_yaml_field camera_fields[] = {
    FIELD(tsuya_scene_camera, model, TSUYA_YAML_TEXT),          FIELD(tsuya_scene_camera, format, TSUYA_YAML_TEXT),
    FIELD(tsuya_scene_camera, size, TSUYA_YAML_NUMBERS),        FIELD(tsuya_scene_camera, distortion, TSUYA_YAML_NUMBERS),
    FIELD(tsuya_scene_camera, center_px, TSUYA_YAML_NUMBERS),   FIELD(tsuya_scene_camera, focal_px, TSUYA_YAML_NUMBER),
    FIELD(tsuya_scene_camera, sensor_mm, TSUYA_YAML_NUMBER),    FIELD(tsuya_scene_camera, f_number, TSUYA_YAML_NUMBER),
    FIELD(tsuya_scene_camera, vignetting, TSUYA_YAML_NUMBER),   FIELD(tsuya_scene_camera, full_well_e, TSUYA_YAML_NUMBER),
    FIELD(tsuya_scene_camera, read_noise_e, TSUYA_YAML_NUMBER), FIELD(tsuya_scene_camera, exposure_ev, TSUYA_YAML_NUMBER),
    FIELD(tsuya_scene_camera, bayer, TSUYA_YAML_BOOL),          FIELD(tsuya_scene_camera, jpeg_quality, TSUYA_YAML_INT),
    FIELD(tsuya_scene_camera, spp, TSUYA_YAML_INT),             FIELD(tsuya_scene_camera, blur_px, TSUYA_YAML_NUMBER), {0},
};
static const tsuya_yaml_field view_fields[] = {
    FIELD(tsuya_scene_view, count, TSUYA_YAML_INT),         FIELD(tsuya_scene_view, elevation_deg, TSUYA_YAML_NUMBER),
    FIELD(tsuya_scene_view, distance_m, TSUYA_YAML_NUMBER), FIELD(tsuya_scene_view, target_m, TSUYA_YAML_NUMBER),
    FIELD(tsuya_scene_view, azimuth_deg, TSUYA_YAML_NUMBER), FIELD(tsuya_scene_view, sweep_deg, TSUYA_YAML_NUMBER),
    FIELD(tsuya_scene_view, jitter, TSUYA_YAML_NUMBER),     FIELD(tsuya_scene_view, px_per_thread, TSUYA_YAML_NUMBER),
    FIELD(tsuya_scene_view, turntable, TSUYA_YAML_BOOL),    {0},
};
static const tsuya_yaml_field lamp_fields[] = {
    FIELD(tsuya_scene_lamp, type, TSUYA_YAML_TEXT),      FIELD(tsuya_scene_lamp, position_m, TSUYA_YAML_NUMBERS),
    FIELD(tsuya_scene_lamp, aim_m, TSUYA_YAML_NUMBERS),  FIELD(tsuya_scene_lamp, size_m, TSUYA_YAML_NUMBERS),
    FIELD(tsuya_scene_lamp, rgb, TSUYA_YAML_NUMBERS),    {0},
};
static const tsuya_yaml_field tags_fields[] = {
    FIELD(tsuya_scene_tags, family, TSUYA_YAML_TEXT),     FIELD(tsuya_scene_tags, cols, TSUYA_YAML_INT),
    FIELD(tsuya_scene_tags, rows, TSUYA_YAML_INT),        FIELD(tsuya_scene_tags, first_id, TSUYA_YAML_INT),
    FIELD(tsuya_scene_tags, border_bits, TSUYA_YAML_INT), FIELD(tsuya_scene_tags, photos, TSUYA_YAML_INT),
    FIELD(tsuya_scene_tags, tag_mm, TSUYA_YAML_NUMBER),   FIELD(tsuya_scene_tags, gap_mm, TSUYA_YAML_NUMBER), {0},
};
static const tsuya_yaml_field goniometer_fields[] = {
    FIELD(tsuya_scene_goniometer, azimuth_step_deg, TSUYA_YAML_NUMBER), FIELD(tsuya_scene_goniometer, tilt_step_deg, TSUYA_YAML_NUMBER),
    FIELD(tsuya_scene_goniometer, noise, TSUYA_YAML_NUMBER), FIELD(tsuya_scene_goniometer, photos, TSUYA_YAML_BOOL),
    FIELD(tsuya_scene_goniometer, spectra, TSUYA_YAML_BOOL), FIELD(tsuya_scene_goniometer, dye, TSUYA_YAML_NUMBERS),
    FIELD(tsuya_scene_goniometer, photo_step_deg, TSUYA_YAML_NUMBER), FIELD(tsuya_scene_goniometer, photo_scale, TSUYA_YAML_NUMBER), {0},
};
static const tsuya_yaml_field scene_fields[] = {
    FIELD(tsuya_simulate_scene, name, TSUYA_YAML_TEXT),
    RECORD(cloth, cloth_fields, tsuya_scene_cloth, .presence_offset = offsetof(scene_file, has_cloth)),
    RECORD(stand, stand_fields, tsuya_scene_stand, .presence_offset = offsetof(scene_file, has_stand)),
    RECORD(camera, camera_fields, tsuya_scene_camera, .presence_offset = offsetof(scene_file, has_camera)),
    RECORD(mat, tags_fields, tsuya_scene_tags, .presence_offset = offsetof(tsuya_simulate_scene, has_mat)),
    RECORD(board, tags_fields, tsuya_scene_tags, .presence_offset = offsetof(tsuya_simulate_scene, has_board)),
    RECORD(goniometer, goniometer_fields, tsuya_scene_goniometer, .presence_offset = offsetof(tsuya_simulate_scene, has_goniometer)),
    {.key = "views", .kind = TSUYA_YAML_RECORDS, .offset = offsetof(tsuya_simulate_scene, views), .fields = view_fields, .size = sizeof(tsuya_scene_view),
     .required = true},
    {.key = "lamps", .kind = TSUYA_YAML_RECORDS, .offset = offsetof(tsuya_simulate_scene, lamps), .fields = lamp_fields, .size = sizeof(tsuya_scene_lamp)},
    FIELD(tsuya_simulate_scene, chart, TSUYA_YAML_BOOL), FIELD(tsuya_simulate_scene, lamps_measured, TSUYA_YAML_BOOL),
    FIELD(tsuya_simulate_scene, seed, TSUYA_YAML_INT), FIELD(tsuya_simulate_scene, hold_out, TSUYA_YAML_INT), {0},
};

typedef struct number_rule { size_t offset; const char *key; double fallback, low, high; } number_rule;
typedef struct int_rule { size_t offset; const char *key; int fallback, low, high; } int_rule;
#define NUMBER(record, name, fallback, low, high) {offsetof(record, name), #name, fallback, low, high}

static const number_rule cloth_numbers[] = {
    NUMBER(tsuya_scene_cloth, side_m, 0.33, 0.02, 10),       NUMBER(tsuya_scene_cloth, spacing_m, 0.008, 5e-4, 0.1),
    NUMBER(tsuya_scene_cloth, weft_mm, 2.6, 0.05, 20),       NUMBER(tsuya_scene_cloth, warp_mm, 2.0, 0.05, 20),
    NUMBER(tsuya_scene_cloth, unevenness, 0.1, 0, 0.5),      NUMBER(tsuya_scene_cloth, drop_m, NAN, 0.02, 10),
    NUMBER(tsuya_scene_cloth, fullness, 2, 1.02, 4),         {0},
};
static const int_rule cloth_ints[] = {NUMBER(tsuya_scene_cloth, smooth, 2, 0, 4), NUMBER(tsuya_scene_cloth, levels, 1, 0, 3),
                                      NUMBER(tsuya_scene_cloth, pleats, 6, 1, 500), {0}};
static const number_rule stand_numbers[] = {
    NUMBER(tsuya_scene_stand, radius_m, 0.08, 0.002, 5), NUMBER(tsuya_scene_stand, height_m, 0.15, 0.02, 5),
    NUMBER(tsuya_scene_stand, length_m, 0.5, 0.02, 10),  {0},
};
static const number_rule camera_numbers[] = {
    NUMBER(tsuya_scene_camera, focal_px, 1000, 20, 1e6),       NUMBER(tsuya_scene_camera, sensor_mm, 36, 1, 200),
    NUMBER(tsuya_scene_camera, f_number, 11, 0, 128),          NUMBER(tsuya_scene_camera, vignetting, 0.15, 0, 0.9),
    NUMBER(tsuya_scene_camera, full_well_e, 20000, 0, 1e7),    NUMBER(tsuya_scene_camera, read_noise_e, 4, 0, 1000),
    NUMBER(tsuya_scene_camera, exposure_ev, 0, -6, 6),         NUMBER(tsuya_scene_camera, blur_px, 0, 0, 5), {0},
};
static const int_rule camera_ints[] = {NUMBER(tsuya_scene_camera, jpeg_quality, 95, 1, 100), NUMBER(tsuya_scene_camera, spp, 9, 1, 1024), {0}};
static const number_rule view_numbers[] = {
    NUMBER(tsuya_scene_view, elevation_deg, 20, -89, 89),   NUMBER(tsuya_scene_view, distance_m, NAN, 0.01, 100),
    NUMBER(tsuya_scene_view, target_m, NAN, -10, 10),       NUMBER(tsuya_scene_view, azimuth_deg, 0, -360, 360),
    NUMBER(tsuya_scene_view, sweep_deg, 360, 1, 360),       NUMBER(tsuya_scene_view, jitter, 0.04, 0, 0.5),
    NUMBER(tsuya_scene_view, px_per_thread, NAN, 0.1, 100), {0},
};
static const int_rule view_ints[] = {NUMBER(tsuya_scene_view, count, 12, 1, 999), {0}};
static const number_rule tags_numbers[] = {NUMBER(tsuya_scene_tags, tag_mm, 30, 1, 1000), NUMBER(tsuya_scene_tags, gap_mm, 9, 0.1, 1000), {0}};
static const int_rule tags_ints[] = {
    NUMBER(tsuya_scene_tags, cols, 8, 1, 100),       NUMBER(tsuya_scene_tags, rows, 5, 1, 100), NUMBER(tsuya_scene_tags, first_id, 0, 0, 100000),
    NUMBER(tsuya_scene_tags, border_bits, 1, 1, 2),  NUMBER(tsuya_scene_tags, photos, 20, 0, 999), {0},
};
static const number_rule goniometer_numbers[] = {
    NUMBER(tsuya_scene_goniometer, azimuth_step_deg, 45, 1, 180), NUMBER(tsuya_scene_goniometer, tilt_step_deg, 3, 0.5, 57),
    NUMBER(tsuya_scene_goniometer, noise, 0.01, 0, 0.5),          NUMBER(tsuya_scene_goniometer, photo_step_deg, NAN, 0.5, 57),
    NUMBER(tsuya_scene_goniometer, photo_scale, 1, 0.02, 1),      {0},
};
static const int_rule scene_ints[] = {NUMBER(tsuya_simulate_scene, seed, 1, 0, INT_MAX), NUMBER(tsuya_simulate_scene, hold_out, 2, 0, 100), {0}};

static tsuya_status settle(const char *path, const char *record_name, void *record, const number_rule *number, const int_rule *whole)
{
    for (; number && number->key; number++) {
        double *x = (double *)(void *)((char *)record + number->offset);
        bool absent = isnan(*x);
        *x = absent ? number->fallback : *x;
        if (!absent && !(*x >= number->low && *x <= number->high)) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %s%s: %g; from %g to %g is accepted", path, record_name, number->key, *x, number->low, number->high);
        }
    }
    for (; whole && whole->key; whole++) {
        int *x = (int *)(void *)((char *)record + whole->offset);
        *x = *x == INT_MIN ? whole->fallback : *x;
        if (*x < whole->low || *x > whole->high) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %s%s: %d; from %d to %d is accepted", path, record_name, whole->key, *x, whole->low, whole->high);
        }
    }
    return TSUYA_OK;
}

/* One of the names, NULL-terminated; the first where it was left out. */
static tsuya_status choose(const char *path, const char *key, const char **value, const char *const *names)
{
    char all[256] = "";
    *value = *value ? *value : names[0];
    for (const char *const *n = names; *n; n++) {
        if (strcmp(*value, *n) == 0) {
            return TSUYA_OK;
        }
        size_t used = strlen(all);
        snprintf(all + used, sizeof all - used, "%s%s", n == names ? "" : ", ", *n);
    }
    const char *nearest = tsuya_nearest_name(*value, names);
    return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %s: '%s'; %s is accepted%s%s%s", path, key, *value, all, nearest ? "; the nearest is '" : "",
                      nearest ? nearest : "", nearest ? "'" : "");
}

static tsuya_status check_list(const char *path, const char *key, const tsuya_yaml_list *list, const char *counts)
{
    char own[16];
    snprintf(own, sizeof own, " %d ", list->count);
    return strstr(counts, own) ? TSUYA_OK : tsuya_fail(TSUYA_ERROR_INPUT, "%s: %s: %d numbers;%sare accepted", path, key, list->count, counts);
}

static tsuya_status check_camera(const tsuya_simulate_scene *s, tsuya_scene_camera *c)
{
    static const char *const formats[] = {"jpg", "tif", NULL};
    TSUYA_TRY(settle(s->path, "camera: ", c, camera_numbers, camera_ints));
    TSUYA_TRY(choose(s->path, "camera: format", &c->format, formats));
    TSUYA_TRY(check_list(s->path, "camera: size", &c->size, " 0 2 "));
    TSUYA_TRY(check_list(s->path, "camera: center_px", &c->center_px, " 0 2 "));
    TSUYA_TRY(check_list(s->path, "camera: distortion", &c->distortion, " 0 4 5 8 12 "));
    for (int i = 0; i < c->size.count; i++) {
        double side = ((double *)c->size.item)[i];
        if (!(side >= 16 && side <= 20000 && side == floor(side))) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: camera: size: %g; whole numbers from 16 to 20000 are accepted", s->path, side);
        }
    }
    if (c->model && (c->size.count || c->distortion.count || c->center_px.count)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: camera: model: '%s' brings size, distortion and center_px, which are given too", s->path, c->model);
    }
    return TSUYA_OK;
}

static tsuya_status check_dye(const char *path, const tsuya_yaml_list *dye)
{
    TSUYA_TRY(check_list(path, "goniometer: dye", dye, " 0 3 "));
    for (int c = 0; c < dye->count; c++) {
        double share = ((double *)dye->item)[c];
        if (!(share >= 0.0 && share <= 1.0)) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: goniometer: dye: %g; numbers from 0 to 1 are accepted", path, share);
        }
    }
    return TSUYA_OK;
}

static tsuya_status check_lamp(const tsuya_simulate_scene *s, tsuya_scene_lamp *l)
{
    static const char *const types[] = {"rect", "disk", "point", "environment", NULL};
    TSUYA_TRY(choose(s->path, "lamps: type", &l->type, types));
    bool placed = strcmp(l->type, "environment") != 0, sized = strcmp(l->type, "rect") == 0 || strcmp(l->type, "disk") == 0;
    TSUYA_TRY(check_list(s->path, "lamps: rgb", &l->rgb, " 3 "));
    TSUYA_TRY(check_list(s->path, "lamps: position_m", &l->position_m, placed ? " 3 " : " 0 "));
    TSUYA_TRY(check_list(s->path, "lamps: aim_m", &l->aim_m, sized ? " 0 3 " : " 0 "));
    return check_list(s->path, "lamps: size_m", &l->size_m, strcmp(l->type, "rect") == 0 ? " 2 " : sized ? " 1 " : " 0 ");
}

static tsuya_status check_views(const tsuya_simulate_scene *s)
{
    int total = 0;
    for (int i = 0; i < s->views.count; i++) {
        tsuya_scene_view *v = (tsuya_scene_view *)s->views.item + i;
        TSUYA_TRY(settle(s->path, "views: ", v, view_numbers, view_ints));
        if (isnan(v->distance_m) == isnan(v->px_per_thread)) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: views: %s; a ring has distance_m, close-ups have px_per_thread", s->path,
                              isnan(v->distance_m) ? "neither distance_m nor px_per_thread" : "both distance_m and px_per_thread");
        }
        total += v->count;
    }
    if (total - s->hold_out < 3 || total > 999) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: views: %d photographs, %d of them held out; at least 3 left and at most 999 are accepted", s->path,
                          total, s->hold_out);
    }
    return TSUYA_OK;
}

/* Cloth that hangs from a bar. */
static tsuya_status check_hung(tsuya_simulate_scene *s)
{
    tsuya_scene_cloth *c = &s->cloth;
    const tsuya_scene_stand *stand = &s->stand;
    bool bar = strcmp(stand->kind, "bar") == 0;
    if (strcmp(c->kind, "karaori") == 0 && (!bar || stand->height_m < 1.1 * c->side_m)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: cloth: kind: karaori hangs on a stand of kind bar, at least 1.1 side_m high; %s of height_m %g is given", s->path,
                          stand->kind, stand->height_m);
    }
    if (strcmp(c->kind, "curtain") != 0) {
        return TSUYA_OK;
    }
    c->drop_m = isnan(c->drop_m) ? 0.9 * stand->height_m : c->drop_m;
    if (!bar || c->side_m > stand->length_m || !(c->drop_m + 2.0 * stand->radius_m < 0.99 * stand->height_m)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: cloth: kind: curtain hangs under a stand of kind bar that is as long as side_m and higher than drop_m; side_m %g and "
                          "drop_m %g under a %s of length_m %g, height_m %g and radius_m %g are given", s->path, c->side_m, c->drop_m, stand->kind, stand->length_m,
                          stand->height_m, stand->radius_m);
    }
    return TSUYA_OK;
}

static tsuya_status check(tsuya_simulate_scene *s)
{
    static const char *const kinds[] = {"closed", "square", "disc", "karaori", "curtain", NULL}, *const stands[] = {"disc", "table", "bar", "form", NULL};
    static const char *const reflectances[] = {"satin", "linen", "matt", NULL}, *const families[] = {"tag36h11", "tag25h9", "tagStandard41h12", NULL};
    tsuya_drape_fabric fabric;
    TSUYA_TRY(settle(s->path, "", s, NULL, scene_ints));
    TSUYA_TRY(settle(s->path, "cloth: ", &s->cloth, cloth_numbers, cloth_ints));
    TSUYA_TRY(settle(s->path, "stand: ", &s->stand, stand_numbers, NULL));
    TSUYA_TRY(choose(s->path, "cloth: kind", &s->cloth.kind, kinds));
    TSUYA_TRY(choose(s->path, "cloth: reflectance", &s->cloth.reflectance, reflectances));
    TSUYA_TRY(choose(s->path, "stand: kind", &s->stand.kind, stands));
    s->cloth.fabric = s->cloth.fabric ? s->cloth.fabric : "silk";
    if (!tsuya_drape_fabric_named(&fabric, s->cloth.fabric)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: cloth: fabric: '%s'; karaori, silk, cotton, wool is accepted", s->path, s->cloth.fabric);
    }
    TSUYA_TRY(check_camera(s, &s->camera));
    TSUYA_TRY(settle(s->path, "mat: ", &s->mat, tags_numbers, tags_ints));
    TSUYA_TRY(settle(s->path, "board: ", &s->board, tags_numbers, tags_ints));
    TSUYA_TRY(choose(s->path, "mat: family", &s->mat.family, families));
    TSUYA_TRY(choose(s->path, "board: family", &s->board.family, families));
    TSUYA_TRY(settle(s->path, "goniometer: ", &s->goniometer, goniometer_numbers, NULL));
    TSUYA_TRY(check_hung(s));
    s->goniometer.photo_step_deg = isnan(s->goniometer.photo_step_deg) ? s->goniometer.tilt_step_deg : s->goniometer.photo_step_deg;
    TSUYA_TRY(check_dye(s->path, &s->goniometer.dye));
    for (int i = 0; i < s->lamps.count; i++) {
        TSUYA_TRY(check_lamp(s, (tsuya_scene_lamp *)s->lamps.item + i));
    }
    return check_views(s);
}

/* A record that the file leaves out is absent as a whole: its numbers are made absent one by one. */
static void clear(void *record, const tsuya_yaml_field *fields)
{
    for (; fields->key; fields++) {
        char *at = (char *)record + fields->offset;
        if (fields->kind == TSUYA_YAML_NUMBER) {
            *(double *)(void *)at = NAN;
        } else if (fields->kind == TSUYA_YAML_INT) {
            *(int *)(void *)at = INT_MIN;
        }
    }
}

tsuya_status tsuya_simulate_scene_load(tsuya_simulate_scene *scene, const char *path)
{
    scene_file file = {0};
    *scene = (tsuya_simulate_scene){0};
    TSUYA_TRY(tsuya_arena_create(&scene->arena, 1 << 16));
    tsuya_arena *arena = scene->arena;
    tsuya_status status = tsuya_yaml_load(&file, sizeof file, scene_fields, path, arena);
    *scene = file.scene;
    scene->arena = arena;
    scene->path = tsuya_arena_printf(arena, "%s", path);
    const struct { bool there; void *record; const tsuya_yaml_field *fields; } records[] = {
        {file.has_cloth, &scene->cloth, cloth_fields}, {file.has_stand, &scene->stand, stand_fields}, {file.has_camera, &scene->camera, camera_fields},
        {scene->has_mat, &scene->mat, tags_fields}, {scene->has_board, &scene->board, tags_fields},
        {scene->has_goniometer, &scene->goniometer, goniometer_fields},
    };
    for (size_t i = 0; i < sizeof records / sizeof records[0]; i++) {
        if (!records[i].there) {
            clear(records[i].record, records[i].fields);
        }
    }
    scene->name = scene->name ? scene->name : "simulated";
    status = status == TSUYA_OK && !scene->path ? TSUYA_ERROR_MEMORY : status;
    status = status == TSUYA_OK ? check(scene) : status;
    if (status != TSUYA_OK) {
        tsuya_simulate_scene_free(scene);
    }
    return status;
}

void tsuya_simulate_scene_free(tsuya_simulate_scene *scene)
{
    tsuya_arena_free(scene->arena);
    *scene = (tsuya_simulate_scene){0};
}
