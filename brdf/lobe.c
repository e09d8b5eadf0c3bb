#include "brdf/lobe.h"

#include "core/memory.h"

#include <string.h>

tsuya_status tsuya_lobe_create(void **state, int channels, double weft, double warp, const double *strength)
{
    tsuya_lobe *l = tsuya_calloc(1, sizeof *l + (size_t)channels * sizeof l->strength[0]);
    if (!l) {
        return TSUYA_ERROR_MEMORY;
    }
    l->shape[0] = weft;
    l->shape[1] = warp;
    l->channels = channels;
    memcpy(l->strength, strength, (size_t)channels * sizeof *strength);
    *state = l;
    return TSUYA_OK;
}

tsuya_status tsuya_lobe_from_json(void **state, int channels, const tsuya_json *parameters, const char *key_weft, const char *key_warp,
                                  double low, double high)
{
    double weft, warp, strength[TSUYA_MATERIAL_MAX_CHANNELS];
    TSUYA_TRY(tsuya_model_read_number(&weft, parameters, key_weft, low, high));
    TSUYA_TRY(tsuya_model_read_number(&warp, parameters, key_warp, low, high));
    TSUYA_TRY(tsuya_model_read_numbers(strength, channels, parameters, "strength", 0.0, 1.0));
    return tsuya_lobe_create(state, channels, weft, warp, strength);
}

void tsuya_lobe_to_json(const void *state, int channels, tsuya_json *parameters, const char *key_weft, const char *key_warp)
{
    const tsuya_lobe *l = state;
    tsuya_json_set_number(parameters, key_weft, l->shape[0]);
    tsuya_json_set_number(parameters, key_warp, l->shape[1]);
    tsuya_json_set_numbers(parameters, "strength", l->strength, channels);
}

size_t tsuya_lobe_bytes(const void *state)
{
    const tsuya_lobe *l = state;
    return sizeof *l + (size_t)l->channels * sizeof l->strength[0];
}

void tsuya_lobe_scale_planes(const tsuya_lobe *l, int channels, int count, float *value)
{
    for (int c = channels - 1; c >= 0; --c) {
        float strength = (float)l->strength[c], *restrict to = value + (size_t)c * (size_t)count;
        for (int k = 0; k < count; ++k) {
            to[k] = strength * value[k];
        }
    }
}
