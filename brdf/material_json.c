/* Materials as JSON documents. */
#include "brdf/model.h"

#include "core/memory.h"
#include "core/table.h"

#include <math.h>
#include <stdio.h>
#include <string.h>

static const char format_name[] = "tsuya material";
static const char *const coupling_name[] = {[TSUYA_DYE_LAMBERT] = "lambert", [TSUYA_DYE_UNDER_SURFACE] = "under_surface"};

tsuya_status tsuya_model_read_numbers(double *numbers, int count, const tsuya_json *object, const char *key, double low, double high)
{
    TSUYA_TRY(tsuya_json_get_numbers(numbers, count, object, key));
    for (int k = 0; k < count; ++k) {
        if (!(numbers[k] >= low && numbers[k] <= high)) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "material: %s: %g: expected a number in [%g, %g]", key, numbers[k], low, high);
        }
    }
    return TSUYA_OK;
}

tsuya_status tsuya_model_read_number(double *number, const tsuya_json *object, const char *key, double low, double high)
{
    TSUYA_TRY(tsuya_json_get_number(number, object, key));
    if (!(*number >= low && *number <= high)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "material: %s: %g: expected a number in [%g, %g]", key, *number, low, high);
    }
    return TSUYA_OK;
}

static tsuya_status check_version(const tsuya_json *root, const char *file)
{
    const char *format, *version;
    TSUYA_TRY(tsuya_json_get_text(&format, root, "format"));
    if (strcmp(format, format_name) != 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: format \"%.40s\": expected \"%s\"", file, format, format_name);
    }
    TSUYA_TRY(tsuya_json_get_text(&version, root, "version"));
    int major, minor, used = 0;
    if (strlen(version) > 16 || sscanf(version, "%9d.%9d%n", &major, &minor, &used) != 2 || version[used] != '\0' || major < 1 ||
        minor < 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: version \"%.40s\": expected MAJOR.MINOR such as \"%d.%d\"", file, version,
                          TSUYA_MATERIAL_VERSION_MAJOR, TSUYA_MATERIAL_VERSION_MINOR);
    }
    if (major > TSUYA_MATERIAL_VERSION_MAJOR) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: version %s was written by a newer tsuya; this one reads materials up to %d.x", file,
                          version, TSUYA_MATERIAL_VERSION_MAJOR);
    }
    return TSUYA_OK;
}

static tsuya_status read_channels(const char **channel, int *count, const tsuya_json *root, const char *file)
{
    const tsuya_json *array = tsuya_json_member(root, "channels");
    *count = tsuya_json_count(array);
    if (!array || !tsuya_json_is_array(array) || *count < 1 || *count > TSUYA_MATERIAL_MAX_CHANNELS) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: channels: expected an array of 1 to %d names", file, TSUYA_MATERIAL_MAX_CHANNELS);
    }
    int c = 0;
    for (const tsuya_json *item = tsuya_json_first(array); item; item = tsuya_json_next(item), ++c) {
        channel[c] = tsuya_json_text_or(item, "");
        size_t length = strlen(channel[c]);
        if (length == 0 || length >= TSUYA_CHANNEL_NAME_SIZE) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: channels[%d]: expected a name of 1 to %d characters", file, c,
                              TSUYA_CHANNEL_NAME_SIZE - 1);
        }
    }
    return TSUYA_OK;
}

static tsuya_status read_dye(tsuya_material *m, const tsuya_json *root, const char *file)
{
    const tsuya_json *dye = tsuya_json_member(root, "dye");
    if (!dye) {
        return TSUYA_OK;
    }
    const char *coupling;
    TSUYA_TRY(tsuya_model_read_numbers(m->dye, m->channel_count, dye, "reflectance", 0.0, 1.0));
    TSUYA_TRY(tsuya_json_get_text(&coupling, dye, "coupling"));
    for (int k = 0; k < (int)(sizeof coupling_name / sizeof coupling_name[0]); ++k) {
        if (strcmp(coupling, coupling_name[k]) == 0) {
            m->coupling = (tsuya_dye_coupling)k;
            return TSUYA_OK;
        }
    }
    return tsuya_fail(TSUYA_ERROR_INPUT, "%s: dye.coupling \"%.40s\": expected \"%s\" or \"%s\"", file, coupling, coupling_name[0],
                      coupling_name[1]);
}

static const char *const support_key[4] = {"theta_i_deg", "theta_o_deg", "theta_h_deg", "theta_d_deg"};

static double (*support_range(tsuya_material_support *s, int k))[2]
{
    double(*range[4])[2] = {&s->theta_i_deg, &s->theta_o_deg, &s->theta_h_deg, &s->theta_d_deg};
    return range[k];
}

static tsuya_status read_about(tsuya_material *m, const tsuya_json *root)
{
    const tsuya_json *support = tsuya_json_member(root, "support"), *error = tsuya_json_member(root, "error_heldout");
    for (int k = 0; k < 4 && tsuya_json_is_object(support); ++k) {
        if (tsuya_json_member(support, support_key[k])) {
            TSUYA_TRY(tsuya_model_read_numbers(*support_range(&m->support, k), 2, support, support_key[k], 0.0, 90.0));
        }
    }
    m->heldout_cbrt = tsuya_json_number_or(tsuya_json_member(error, "cbrt"), NAN);
    m->heldout_log = tsuya_json_number_or(tsuya_json_member(error, "log"), NAN);
    if (tsuya_json_member(root, "default")) {
        TSUYA_TRY(tsuya_json_get_bool(&m->is_default, root, "default"));
    }
    if (tsuya_json_member(root, "relative")) {
        TSUYA_TRY(tsuya_json_get_bool(&m->relative, root, "relative"));
    }
    return tsuya_material_set_note(m, tsuya_json_text_or(tsuya_json_member(root, "note"), ""));
}

static tsuya_status from_json(tsuya_material **material, const tsuya_json *root, const char *file)
{
    const char *channel[TSUYA_MATERIAL_MAX_CHANNELS], *model_name, *name;
    int channels;
    TSUYA_TRY(check_version(root, file));
    TSUYA_TRY(read_channels(channel, &channels, root, file));
    TSUYA_TRY(tsuya_json_get_text(&name, root, "name"));
    TSUYA_TRY(tsuya_json_get_text(&model_name, root, "model"));
    const tsuya_brdf_model *model = tsuya_brdf_model_find(model_name);
    if (!model) {
        const char *nearest = tsuya_nearest_name(model_name, tsuya_brdf_model_names());
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: model \"%.40s\" is not known%s%s", file, model_name,
                          nearest ? "; the nearest known one is " : "", nearest ? nearest : "");
    }
    const tsuya_json *parameters = tsuya_json_member(root, "parameters");
    if (!parameters || !tsuya_json_is_object(parameters)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: parameters: expected an object", file);
    }
    void *state = NULL;
    TSUYA_TRY(model->from_json(&state, channels, parameters));
    TSUYA_TRY(tsuya_material_create(material, model, state, name, channels, channel));
    tsuya_status status = read_dye(*material, root, file);
    if (status == TSUYA_OK) {
        status = read_about(*material, root);
    }
    if (status != TSUYA_OK) {
        tsuya_material_free(*material);
        *material = NULL;
    }
    return status;
}

/* Values inside a document do not know its file; the reason shall. */
static tsuya_status with_file(tsuya_status status, const char *file)
{
    const char *reason = tsuya_reason(), *prefix = "material: ";
    if (status != TSUYA_ERROR_INPUT || strstr(reason, file)) {
        return status;
    }
    char copy[TSUYA_REASON_SIZE];
    snprintf(copy, sizeof copy, "%s", strncmp(reason, prefix, strlen(prefix)) == 0 ? reason + strlen(prefix) : reason);
    return tsuya_fail(status, "%s: %s", file, copy);
}

tsuya_status tsuya_material_parse(tsuya_material **material, const char *text, const char *name_for_messages)
{
    tsuya_json *root;
    *material = NULL;
    TSUYA_TRY(tsuya_json_parse(&root, text, name_for_messages));
    tsuya_status status = with_file(from_json(material, root, name_for_messages), name_for_messages);
    tsuya_json_free(root);
    return status;
}

tsuya_status tsuya_material_load(tsuya_material **material, const char *path)
{
    tsuya_json *root;
    *material = NULL;
    TSUYA_TRY(tsuya_json_load(&root, path));
    tsuya_status status = with_file(from_json(material, root, path), path);
    tsuya_json_free(root);
    return status;
}

tsuya_status tsuya_material_to_json(tsuya_json **root, const tsuya_material *m)
{
    char version[24];
    snprintf(version, sizeof version, "%d.%d", TSUYA_MATERIAL_VERSION_MAJOR, TSUYA_MATERIAL_VERSION_MINOR);
    *root = tsuya_json_create_object();
    if (!*root) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_json_set_text(*root, "format", format_name);
    tsuya_json_set_text(*root, "version", version);
    tsuya_json_set_text(*root, "name", m->name);
    tsuya_json_set_text(*root, "note", m->note);
    tsuya_json_set_bool(*root, "default", m->is_default);
    tsuya_json_set_bool(*root, "relative", m->relative);
    tsuya_json_set_text(*root, "model", m->model->name);
    tsuya_json *channels = tsuya_json_set_array(*root, "channels");
    for (int c = 0; c < m->channel_count; ++c) {
        tsuya_json_add_text(channels, m->channel[c]);
    }
    tsuya_json *support = tsuya_json_set_object(*root, "support");
    tsuya_material_support ranges = m->support;
    for (int k = 0; k < 4; ++k) {
        const double *range = *support_range(&ranges, k);
        if (isfinite(range[0]) && isfinite(range[1])) {
            tsuya_json_set_numbers(support, support_key[k], range, 2);
        }
    }
    tsuya_json *error = tsuya_json_set_object(*root, "error_heldout");
    tsuya_json_set_number(error, "cbrt", m->heldout_cbrt);
    tsuya_json_set_number(error, "log", m->heldout_log);
    tsuya_json *dye = tsuya_json_set_object(*root, "dye");
    tsuya_json_set_numbers(dye, "reflectance", m->dye, m->channel_count);
    tsuya_json_set_text(dye, "coupling", coupling_name[m->coupling]);
    m->model->to_json(m->state, m->channel_count, tsuya_json_set_object(*root, "parameters"));
    return TSUYA_OK;
}

tsuya_status tsuya_material_save(const tsuya_material *material, const char *path)
{
    tsuya_json *root;
    TSUYA_TRY(tsuya_material_to_json(&root, material));
    tsuya_status status = tsuya_json_save(root, path);
    tsuya_json_free(root);
    return status;
}
