/* lights.json. */
#include "render/light.h"

#include "core/file.h"
#include "core/memory.h"
#include "core/table.h"

#include <stdio.h>
#include <string.h>

static const char *const kind_names[] = {"point", "spot", "directional", "disk", "rect", "environment", NULL};
static const char *const keys[] = {"type", "position_m", "direction", "up", "size_m", "cone_deg", "rgb", "spectrum", "file", "name", NULL};

enum { LIGHT_LIMIT = 4096 };

static int index_of(const char *name, const char *const *names)
{
    for (int k = 0; names[k]; ++k) {
        if (strcmp(names[k], name) == 0) {
            return k;
        }
    }
    return -1;
}

static tsuya_status check_keys(const tsuya_json *object, const char *label)
{
    for (const tsuya_json *member = tsuya_json_first(object); member; member = tsuya_json_next(member)) {
        const char *key = tsuya_json_key(member), *nearest;
        if (index_of(key, keys) < 0) {
            nearest = tsuya_nearest_name(key, keys);
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: unknown key \"%.40s\"%s%s", label, key, nearest ? "; the nearest known one is " : "",
                              nearest ? nearest : "");
        }
    }
    return TSUYA_OK;
}

static tsuya_status read_vec3(tsuya_vec3 *v, const tsuya_json *object, const char *key, bool required)
{
    double e[3];
    if (!required && !tsuya_json_member(object, key)) {
        return TSUYA_OK;
    }
    TSUYA_TRY(tsuya_json_get_numbers(e, 3, object, key));
    *v = (tsuya_vec3){e[0], e[1], e[2]};
    return TSUYA_OK;
}

static tsuya_status read_size(tsuya_light *l, const tsuya_json *object, const char *label)
{
    int count = tsuya_json_count(tsuya_json_member(object, "size_m"));
    if (l->kind == TSUYA_LIGHT_DISK && count == 1) {
        TSUYA_TRY(tsuya_json_get_numbers(l->size_m, 1, object, "size_m"));
        l->size_m[1] = l->size_m[0];
        return TSUYA_OK;
    }
    TSUYA_TRY(tsuya_json_get_numbers(l->size_m, 2, object, "size_m"));
    if (l->kind == TSUYA_LIGHT_DISK && l->size_m[0] != l->size_m[1]) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: size_m: [%g, %g]; a disk has one diameter", label, l->size_m[0], l->size_m[1]);
    }
    return TSUYA_OK;
}

static tsuya_status read_map(tsuya_light *l, const tsuya_json *object, const char *label, const char *folder)
{
    const char *file;
    if (!tsuya_json_member(object, "file")) {
        return TSUYA_OK;
    }
    TSUYA_TRY(tsuya_json_get_text(&file, object, "file"));
    if (l->kind != TSUYA_LIGHT_ENVIRONMENT) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: file: only an environment has one", label);
    }
    char *path = tsuya_path_join(folder, file);
    tsuya_image image = {0};
    tsuya_status status = path ? tsuya_image_load(&image, path) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        tsuya_vec3 up = tsuya_vec3_norm(l->up) > 0.0 ? l->up : (tsuya_vec3){0, 0, 1};
        tsuya_vec3 ahead = tsuya_vec3_norm(l->direction) > 0.0 ? l->direction : (tsuya_vec3){1, 0, 0};
        if (!(tsuya_vec3_norm(tsuya_vec3_tangent(ahead, tsuya_vec3_unit(up))) > 0.5)) {
            status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: direction and up are parallel; a map needs two different directions", label);
        } else {
            status = tsuya_environment_create(&l->map, &image, ahead, up, path);
        }
    }
    tsuya_image_free(&image);
    tsuya_free(path);
    return status;
}

static tsuya_status read_spectrum(tsuya_light *l, const tsuya_json *object, const char *label, const char *folder)
{
    const char *name;
    if (!tsuya_json_member(object, "spectrum")) {
        return TSUYA_OK;
    }
    TSUYA_TRY(tsuya_json_get_text(&name, object, "spectrum"));
    if (tsuya_json_member(object, "file")) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: spectrum: a map brings its own colours; expected \"file\" or \"spectrum\"", label);
    }
    return tsuya_light_take_spectrum(l, name, folder);
}

static tsuya_status read_light(tsuya_light *l, const tsuya_json *object, const char *label, const char *folder)
{
    const char *type;
    double cone_deg[2];
    TSUYA_TRY(tsuya_json_get_text(&type, object, "type"));
    int kind = index_of(type, kind_names);
    if (kind < 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: type \"%.40s\": expected point, spot, directional, disk, rect or environment", label,
                          type);
    }
    l->kind = (tsuya_light_kind)kind;
    bool environment = l->kind == TSUYA_LIGHT_ENVIRONMENT, area = l->kind == TSUYA_LIGHT_DISK || l->kind == TSUYA_LIGHT_RECT;
    TSUYA_TRY(check_keys(object, label));
    TSUYA_TRY(read_vec3(&l->position_m, object, "position_m", l->kind != TSUYA_LIGHT_DIRECTIONAL && !environment));
    TSUYA_TRY(read_vec3(&l->direction, object, "direction", l->kind != TSUYA_LIGHT_POINT && !environment));
    TSUYA_TRY(read_vec3(&l->up, object, "up", false));
    if (area) {
        TSUYA_TRY(read_size(l, object, label));
    }
    if (l->kind == TSUYA_LIGHT_SPOT) {
        TSUYA_TRY(tsuya_json_get_numbers(cone_deg, 2, object, "cone_deg"));
        l->cone_rad[0] = tsuya_rad_from_deg(cone_deg[0]);
        l->cone_rad[1] = tsuya_rad_from_deg(cone_deg[1]);
    }
    if (environment && tsuya_json_member(object, "file") && !tsuya_json_member(object, "rgb")) {
        l->rgb[0] = l->rgb[1] = l->rgb[2] = 1.0;
    } else {
        TSUYA_TRY(tsuya_json_get_numbers(l->rgb, 3, object, "rgb"));
    }
    TSUYA_TRY(read_spectrum(l, object, label, folder));
    return read_map(l, object, label, folder);
}

/* Values inside a document do not know where they stand; the reason shall. */
static tsuya_status with_label(tsuya_status status, const char *label)
{
    if (status != TSUYA_ERROR_INPUT || strstr(tsuya_reason(), label)) {
        return status;
    }
    char copy[TSUYA_REASON_SIZE];
    snprintf(copy, sizeof copy, "%s", tsuya_reason());
    return tsuya_fail(status, "%s: %s", label, copy);
}

static tsuya_status read_all(tsuya_light_set *set, const tsuya_json *root, const char *file, const char *folder)
{
    const tsuya_json *array = tsuya_json_member(root, "lights");
    if (!array || !tsuya_json_is_array(array) || tsuya_json_count(array) > LIGHT_LIMIT) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: lights: expected an array of at most %d lamps", file, LIGHT_LIMIT);
    }
    int k = 0;
    for (const tsuya_json *item = tsuya_json_first(array); item; item = tsuya_json_next(item), ++k) {
        char label[512];
        tsuya_light light = {0};
        snprintf(label, sizeof label, "%.460s: lights[%d]", file, k);
        tsuya_status status = with_label(read_light(&light, item, label, folder), label);
        if (status != TSUYA_OK) {
            tsuya_free(light.spectrum);
            return status;
        }
        TSUYA_TRY(tsuya_light_set_add(set, &light, label));
    }
    return TSUYA_OK;
}

static tsuya_status read_root(tsuya_light_set *set, const tsuya_json *root, const char *file, const char *folder)
{
    tsuya_status status = read_all(set, root, file, folder);
    if (status != TSUYA_OK) {
        tsuya_light_set_free(set);
    }
    return status;
}

tsuya_status tsuya_light_set_parse(tsuya_light_set *set, const char *text, const char *name_for_messages, const char *folder)
{
    tsuya_json *root;
    *set = (tsuya_light_set){0};
    TSUYA_TRY(tsuya_json_parse(&root, text, name_for_messages));
    tsuya_status status = read_root(set, root, name_for_messages, folder);
    tsuya_json_free(root);
    return status;
}

tsuya_status tsuya_light_set_load(tsuya_light_set *set, const char *path)
{
    tsuya_json *root;
    *set = (tsuya_light_set){0};
    TSUYA_TRY(tsuya_json_load(&root, path));
    char *folder = tsuya_path_folder(path);
    tsuya_status status = folder ? read_root(set, root, path, folder) : TSUYA_ERROR_MEMORY;
    tsuya_free(folder);
    tsuya_json_free(root);
    return status;
}
