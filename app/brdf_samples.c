#include "app/brdf_samples.h"

#include "brdf/samples_color.h"

#include <string.h>

bool tsuya_brdf_channels_known(const char *text) { return strcmp(text, "own") == 0 || strcmp(text, "rgb") == 0; }

static tsuya_status joined(tsuya_samples *samples, tsuya_join_info *info, const tsuya_samples *camera, const tsuya_samples_source *source, bool rgb,
                           const tsuya_context *context)
{
    tsuya_samples radiometer;
    TSUYA_TRY(tsuya_samples_load(&radiometer, source->radiometer));
    tsuya_status status = tsuya_samples_join(samples, info, camera, &radiometer, !rgb, context);
    tsuya_samples_free(&radiometer);
    return status == TSUYA_ERROR_INPUT ? tsuya_fail(status, "%s with %s: %s", source->path, source->radiometer, tsuya_reason()) : status;
}

static tsuya_status colored(tsuya_samples *samples, const tsuya_samples *own, const char *path)
{
    tsuya_status status = tsuya_samples_to_color(samples, own, TSUYA_COLOR_RGB);
    return status == TSUYA_ERROR_INPUT ? tsuya_fail(status, "%s: %s", path, tsuya_reason()) : status;
}

tsuya_status tsuya_brdf_samples(tsuya_samples *samples, tsuya_join_info *info, const tsuya_samples_source *source, const tsuya_context *context)
{
    tsuya_samples own;
    bool rgb = source->channels && strcmp(source->channels, "rgb") == 0;
    *info = (tsuya_join_info){0};
    TSUYA_TRY(tsuya_samples_load(&own, source->path));
    bool colors = own.channel_count == 3 && strcmp(own.channel[0], "r") == 0;
    if (!source->radiometer && (!rgb || colors)) {
        *samples = own;
        return TSUYA_OK;
    }
    tsuya_status status = source->radiometer ? joined(samples, info, &own, source, rgb, context) : colored(samples, &own, source->path);
    tsuya_samples_free(&own);
    return status;
}

void tsuya_brdf_joined(tsuya_json *figures, const tsuya_join_info *info)
{
    if (info->linked == 0) {
        return;
    }
    tsuya_json *j = tsuya_json_set_object(figures, "joined");
    tsuya_json_set_number(j, "camera_rows", info->camera);
    tsuya_json_set_number(j, "radiometer_rows", info->radiometer);
    tsuya_json_set_number(j, "linked_rows", info->linked);
    tsuya_json_set_number(j, "rank", info->rank);
    tsuya_json_set_numbers(j, "gain", info->gain, 3);
    tsuya_json_set_numbers(j, "gain_sigma", info->gain_sigma, 3);
    tsuya_json_set_number(j, "camera_scale", info->camera_scale);
    tsuya_json_set_number(j, "radiometer_scale", info->radiometer_scale);
    tsuya_json_set_number(j, "scale_sigma", info->scale_sigma);
    tsuya_json_set_number(j, "residual_cbrt", info->residual);
}
