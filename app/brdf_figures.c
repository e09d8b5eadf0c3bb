#include "app/brdf_figures.h"

static void set_error(tsuya_json *object, const char *key, tsuya_brdf_error error)
{
    tsuya_json *e = tsuya_json_set_object(object, key);
    tsuya_json_set_number(e, "cbrt", error.cbrt);
    tsuya_json_set_number(e, "log", error.log);
}

void tsuya_brdf_figures(tsuya_json *figures, const tsuya_fit_info *info)
{
    tsuya_json_set_text(figures, "model", info->model);
    tsuya_json_set_number(figures, "samples", info->samples);
    set_error(figures, "error_fit", info->fit);
    set_error(figures, "error_heldout", info->heldout);
    set_error(figures, "error_heldout_tilts", info->heldout_tilts);
    set_error(figures, "error_heldout_azimuth", info->heldout_azimuth);
    tsuya_json_set_number(figures, "eval_ns", info->eval_ns);
    tsuya_json_set_number(figures, "bytes", (double)info->bytes);
    tsuya_json_set_number(figures, "reciprocity_deficit", info->reciprocity_deficit);
    tsuya_json_set_number(figures, "furnace", info->furnace);
    tsuya_json_set_number(figures, "reciprocal_condition", info->reciprocal_condition);
    tsuya_json_set_number(figures, "seconds", info->seconds);
}

void tsuya_brdf_candidates(tsuya_json *figures, const tsuya_fit_info *candidates, int count)
{
    tsuya_json *array = tsuya_json_set_array(figures, "candidates");
    for (int k = 0; k < count; ++k) {
        tsuya_brdf_figures(tsuya_json_add_object(array), &candidates[k]);
    }
}
