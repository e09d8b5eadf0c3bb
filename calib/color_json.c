#include "calib/color.h"

#include "core/memory.h"

#include <string.h>

static void set_stats(tsuya_json *object, const char *key, tsuya_color_stats s)
{
    tsuya_json *o = tsuya_json_set_object(object, key);
    tsuya_json_set_number(o, "mean", s.mean);
    tsuya_json_set_number(o, "median", s.median);
    tsuya_json_set_number(o, "max", s.max);
    tsuya_json_set_number(o, "patches", s.count);
}

static void set_patches(tsuya_json *object, const tsuya_color *c)
{
    tsuya_json *list = tsuya_json_set_array(object, "patches");
    for (int i = 0; i < TSUYA_CHART_PATCHES; i++) {
        tsuya_json *o = tsuya_json_add_object(list);
        tsuya_json_set_number(o, "patch", i + 1);
        tsuya_json_set_numbers(o, "lab_reference", (double[]){c->reference[i].l, c->reference[i].a, c->reference[i].b}, 3);
        tsuya_json_set_numbers(o, "lab_measured", (double[]){c->measured[i].l, c->measured[i].a, c->measured[i].b}, 3);
        tsuya_json_set_number(o, "de00", c->de00[i]);
        tsuya_json_set_number(o, "de00_heldout", c->de00_heldout[i]);
        tsuya_json_set_bool(o, "clipped", c->left_out[i]);
    }
}

static void set_chart(tsuya_json *object, const tsuya_color *c)
{
    tsuya_json *de = tsuya_json_set_object(object, "de00"), *linearity;
    set_stats(de, "light", c->light);
    set_stats(de, "dark", c->dark);
    set_stats(de, "heldout", c->heldout);
    linearity = tsuya_json_set_object(object, "linearity");
    tsuya_json_set_number(linearity, "gamma", c->gamma);
    tsuya_json_set_number(linearity, "worst", c->grey_deviation);
    tsuya_json_set_number(linearity, "worst_patch", c->grey_worst + 1);
    tsuya_json_set_numbers(object, "light_gradient", c->light_gradient, 2);
    set_patches(object, c);
}

void tsuya_color_to_json(tsuya_json *object, const tsuya_color *c)
{
    const tsuya_vignetting *v = &c->vignetting;
    tsuya_json_set_text(object, "format", "tsuya color");
    tsuya_json_set_text(object, "version", "1.0");
    tsuya_json_set_numbers(object, "white_balance", c->white_balance, 3);
    tsuya_json_set_number(object, "exposure", c->exposure);
    tsuya_json_set_numbers(object, "matrix", &c->matrix.e[0][0], 9);
    if (v->width_px) {
        tsuya_json *o = tsuya_json_set_object(object, "vignetting");
        tsuya_json_set_numbers(o, "size_px", (double[]){v->width_px, v->height_px}, 2);
        tsuya_json_set_numbers(o, "log_polynomial", v->k, 3);
        tsuya_json_set_number(o, "corner", v->corner);
        tsuya_json_set_number(o, "residual", v->residual);
    } else {
        tsuya_json_set_null(object, "vignetting");
    }
    if (c->has_matrix) {
        set_chart(object, c);
    }
}

static tsuya_status take(tsuya_color *c, const tsuya_json *root, const char *path)
{
    const char *format;
    TSUYA_TRY(tsuya_json_get_text(&format, root, "format"));
    const char *version = tsuya_json_text_or(tsuya_json_member(root, "version"), "");
    if (strcmp(format, "tsuya color") != 0 || strncmp(version, "1.", 2) != 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: format '%s' version '%s'; 'tsuya color' of version 1 is expected", path, format, version);
    }
    TSUYA_TRY(tsuya_json_get_numbers(c->white_balance, 3, root, "white_balance"));
    TSUYA_TRY(tsuya_json_get_number(&c->exposure, root, "exposure"));
    TSUYA_TRY(tsuya_json_get_numbers(&c->matrix.e[0][0], 9, root, "matrix"));
    c->has_matrix = tsuya_json_member(root, "patches") != NULL;
    const tsuya_json *v = tsuya_json_member(root, "vignetting");
    if (tsuya_json_is_object(v)) {
        double size[2];
        TSUYA_TRY(tsuya_json_get_numbers(size, 2, v, "size_px"));
        if (!(size[0] >= 1 && size[0] <= 65535 && size[1] >= 1 && size[1] <= 65535)) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: vignetting: size_px: %g x %g; 1 to 65535 is expected", path, size[0], size[1]);
        }
        c->vignetting.width_px = (int)size[0];
        c->vignetting.height_px = (int)size[1];
        TSUYA_TRY(tsuya_json_get_numbers(c->vignetting.k, 3, v, "log_polynomial"));
    }
    return TSUYA_OK;
}

tsuya_status tsuya_color_load(tsuya_color *c, const char *path)
{
    tsuya_json *root;
    *c = (tsuya_color){0};
    TSUYA_TRY(tsuya_json_load(&root, path));
    tsuya_status status = take(c, root, path);
    tsuya_json_free(root);
    return status;
}
