/* Lamps at the surface: which pieces of them a place sees (Williams, "Casting curved shadows on curved surfaces", SIGGRAPH 1978). */
#include "brdf/gather_parts.h"

#include "core/color.h"
#include "core/memory.h"

#include <math.h>

static const double WIDEST_DEG = 80.0, FAR = 60.0; /* half a map's field; distance of distant lamps, radii */

static tsuya_vec3 eye_of(const tsuya_gather *g, const tsuya_gather_emitter *e)
{
    return e->distant ? tsuya_vec3_mad(g->middle, FAR * g->radius_m, e->place) : e->place;
}

static tsuya_status draw_shadow(gather_shadow *s, const tsuya_gather *g, const tsuya_gather_emitter *e, const tsuya_context *context)
{
    int side = g->options.shadow_px;
    tsuya_vec3 eye = eye_of(g, e), way = tsuya_vec3_sub(g->middle, eye);
    double distance = tsuya_vec3_norm(way), widest = tsuya_rad_from_deg(WIDEST_DEG);
    double half = distance > g->radius_m ? fmin(asin(g->radius_m / distance), widest) : widest;
    tsuya_vec3 up = fabs(way.z) > 0.9 * distance ? (tsuya_vec3){0, 1, 0} : (tsuya_vec3){0, 0, 1};
    s->camera = (tsuya_camera){.lens = TSUYA_LENS_PINHOLE, .width_px = side, .height_px = side, .fx_px = 0.49 * side / tan(half),
                               .fy_px = 0.49 * side / tan(half), .cx_px = 0.5 * (side - 1), .cy_px = 0.5 * (side - 1)};
    s->pose = tsuya_pose_look_at(eye, g->middle, up);
    s->texel = 1.0 / s->camera.fx_px;
    TSUYA_TRY(tsuya_raster_create(&s->raster, side, side));
    return tsuya_raster_draw(&s->raster, g->mesh, &s->camera, s->pose, context);
}

tsuya_status tsuya_gather_shadows(gather_shadow **shadow, const tsuya_gather *g, const tsuya_gather_lamps *lamps, const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    gather_shadow *s;
    TSUYA_NEW(status, s, (size_t)lamps->count);
    for (int k = 0; k < lamps->count && status == TSUYA_OK; k++) {
        status = draw_shadow(&s[k], g, &lamps->emitter[k], context);
    }
    if (status != TSUYA_OK) {
        tsuya_gather_shadows_free(s, lamps->count);
        s = NULL;
    }
    *shadow = s;
done:
    return status;
}

void tsuya_gather_shadows_free(gather_shadow *shadow, int count)
{
    for (int k = 0; shadow && k < count; k++) {
        tsuya_raster_free(&shadow[k].raster);
    }
    tsuya_free(shadow);
}

/* Nothing of the surface before the place, in its pixel and those around it; there the place's own plane is expected. */
static bool sees(const gather_shadow *s, tsuya_vec3 p, tsuya_vec3 n, double edge_m)
{
    tsuya_vec2 pixel;
    tsuya_vec3 c = tsuya_pose_apply(s->pose, p), plane = tsuya_mat3_apply(s->pose.rotation, n);
    if (!tsuya_camera_project(&s->camera, c, &pixel)) {
        return false;
    }
    int cx = (int)lround(pixel.x), cy = (int)lround(pixel.y);
    double slack = 0.7 * s->texel * c.z + 0.01 * edge_m + 1e-5 * c.z, away = tsuya_vec3_dot(plane, c);
    for (int y = cy - 1; y <= cy + 1; y++) {
        for (int x = cx - 1; x <= cx + 1; x++) {
            if (x < 0 || y < 0 || x >= s->raster.width_px || y >= s->raster.height_px) {
                continue;
            }
            const tsuya_vec3 ray = {(x - s->camera.cx_px) * s->texel, (y - s->camera.cy_px) * s->texel, 1.0};
            double depth = (double)s->raster.depth[(size_t)y * (size_t)s->raster.width_px + (size_t)x], expected = away / tsuya_vec3_dot(plane, ray);
            if (depth > 0.0 && !(depth >= fmin(c.z, expected > 0.0 ? expected : c.z) - slack)) {
                return false;
            }
        }
    }
    return true;
}

typedef struct piece_sum { double irradiance[3]; tsuya_vec3 way; bool hidden; } piece_sum;

static void add_piece(piece_sum *sum, const tsuya_gather *g, const tsuya_gather_emitter *e, const gather_shadow *shadow, tsuya_vec3 p, tsuya_vec3 n)
{
    tsuya_vec3 way = e->distant ? e->place : tsuya_vec3_sub(e->place, p);
    double d2 = tsuya_vec3_dot(way, way), strength = 1.0;
    tsuya_vec3 wi = tsuya_vec3_unit(way);
    double cosine = tsuya_vec3_dot(wi, n);
    if (!e->distant) {
        strength = (tsuya_vec3_norm(e->axis) > 0.0 ? fmax(0.0, -tsuya_vec3_dot(wi, e->axis)) : 1.0) / d2;
    }
    if (cosine <= 0.0 || !sees(shadow, p, n, g->edge_m)) {
        sum->hidden = true;
        return;
    }
    for (int c = 0; c < 3; c++) {
        sum->irradiance[c] += e->rgb[c] * strength * cosine;
    }
    sum->way = tsuya_vec3_mad(sum->way, tsuya_rgb_luminance(e->rgb) * strength * cosine, wi);
}

gather_light tsuya_gather_light(const tsuya_gather *g, const tsuya_gather_lamps *lamps, const gather_shadow *shadow, tsuya_vec3 p, tsuya_vec3 n)
{
    piece_sum sum[GATHER_LAMPS] = {{.hidden = false}};
    gather_light light = {.whole = false};
    int best = 0;
    double all = 0.0;
    for (int k = 0; k < lamps->count; k++) {
        add_piece(&sum[lamps->emitter[k].lamp], g, &lamps->emitter[k], &shadow[k], p, n);
    }
    for (int l = 0; l < GATHER_LAMPS; l++) {
        best = tsuya_rgb_luminance(sum[l].irradiance) > tsuya_rgb_luminance(sum[best].irradiance) ? l : best;
        all += tsuya_rgb_luminance(sum[l].irradiance);
    }
    for (int c = 0; c < 3; c++) {
        light.irradiance[c] = sum[best].irradiance[c];
        light.other[c] = M_PI * lamps->ambient[c];
        for (int l = 0; l < GATHER_LAMPS; l++) {
            light.other[c] += l == best ? 0.0 : sum[l].irradiance[c];
        }
    }
    light.wi = tsuya_vec3_unit(sum[best].way);
    light.whole = !sum[best].hidden;
    all += tsuya_rgb_luminance(lamps->ambient) * M_PI;
    light.share = all > 0.0 ? tsuya_rgb_luminance(sum[best].irradiance) / all : 0.0;
    return light;
}
