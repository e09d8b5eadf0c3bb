/* The camera's scale out of matt patches of known reflectance: radiance = albedo / π · irradiance. */
#include "brdf/gather_parts.h"

#include <math.h>

static const double ACROSS_PX = 4.0, DARK = 0.004, HIDDEN = 0.995; /* a surface this much nearer than the patch hides it */

/* Mean of the 3 × 3 pixels about a patch; false where they tell nothing. */
static bool measure(double value[3], const tsuya_gather *g, const tsuya_gather_view *view, const tsuya_raster *raster, tsuya_vec3 p)
{
    tsuya_vec2 pixel;
    tsuya_vec3 c = tsuya_pose_apply(view->camera_from_world, p);
    value[0] = value[1] = value[2] = 0.0;
    if (!tsuya_camera_project(view->camera, c, &pixel)) {
        return false;
    }
    int cx = (int)lround(pixel.x), cy = (int)lround(pixel.y);
    if (cx < 1 || cy < 1 || cx + 1 >= view->image->width_px || cy + 1 >= view->image->height_px) {
        return false;
    }
    for (int k = 0; k < 9; k++) {
        int x = cx + k % 3 - 1, y = cy + k / 3 - 1;
        double depth = (double)raster->depth[(size_t)y * (size_t)raster->width_px + (size_t)x];
        const float *v = tsuya_image_f32(view->image, x, y);
        if ((depth > 0.0 && depth < HIDDEN * c.z) || (double)fmaxf(v[0], fmaxf(v[1], v[2])) >= g->options.clip) {
            return false;
        }
        for (int j = 0; j < 3; j++) {
            value[j] += (double)v[j] / 9.0;
        }
    }
    return fmin(value[0], fmin(value[1], value[2])) > DARK;
}

tsuya_status tsuya_gather_reference(double gain[3], int *used, const tsuya_gather *g, const tsuya_gather_view *view, const tsuya_gather_patch *patch,
                                    int count, const tsuya_context *context)
{
    tsuya_status status;
    tsuya_raster raster = {0};
    gather_shadow *shadow = NULL;
    double expected[3] = {0}, measured[3] = {0}, value[3], low = sin(tsuya_rad_from_deg(g->options.grazing_deg));
    tsuya_vec3 eye = tsuya_pose_center(view->camera_from_world);
    *used = 0;
    TSUYA_GOTO_DONE(status, tsuya_raster_create(&raster, view->camera->width_px, view->camera->height_px));
    TSUYA_GOTO_DONE(status, tsuya_raster_draw(&raster, g->mesh, view->camera, view->camera_from_world, context));
    TSUYA_GOTO_DONE(status, tsuya_gather_shadows(&shadow, g, view->lamps, context));
    for (int k = 0; k < count; k++) {
        gather_light light = tsuya_gather_light(g, view->lamps, shadow, patch[k].p, patch[k].n);
        tsuya_vec3 way = tsuya_vec3_sub(eye, patch[k].p);
        double facing = tsuya_vec3_dot(tsuya_vec3_unit(way), patch[k].n), across = patch[k].size_m * facing * view->camera->fx_px / tsuya_vec3_norm(way);
        if (!light.whole || facing < low || (patch[k].size_m > 0.0 && across < ACROSS_PX) ||
            !measure(value, g, view, &raster, patch[k].p)) {
            continue;
        }
        for (int c = 0; c < 3; c++) {
            expected[c] += patch[k].albedo[c] / M_PI * (light.irradiance[c] + light.other[c]);
            measured[c] += value[c];
        }
        ++*used;
    }
    for (int c = 0; c < 3 && *used > 0; c++) {
        gain[c] = expected[c] / measured[c];
    }
done:
    tsuya_raster_free(&raster);
    tsuya_gather_shadows_free(shadow, view->lamps->count);
    return status;
}
