#include "render/light.h"

#include "brdf/sampling.h"

#include "core/color.h"
#include "core/memory.h"

#include "render/frame.h"

#include <math.h>
#include <string.h>

static bool finite3(tsuya_vec3 v)
{
    return isfinite(v.x) && isfinite(v.y) && isfinite(v.z);
}

static tsuya_status check_shape(const tsuya_light *l, const char *name)
{
    bool placed = l->kind != TSUYA_LIGHT_DIRECTIONAL && l->kind != TSUYA_LIGHT_ENVIRONMENT;
    bool aimed = l->kind != TSUYA_LIGHT_POINT && l->kind != TSUYA_LIGHT_ENVIRONMENT;
    int sizes = l->kind == TSUYA_LIGHT_RECT ? 2 : l->kind == TSUYA_LIGHT_DISK ? 1 : 0;
    if (placed && !finite3(l->position_m)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: position_m: expected three finite numbers", name);
    }
    if (aimed && !(finite3(l->direction) && tsuya_vec3_norm(l->direction) > 0.0)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: direction: expected three finite numbers, not all zero", name);
    }
    for (int k = 0; k < sizes; ++k) {
        if (!(l->size_m[k] > 0.0 && isfinite(l->size_m[k]))) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: size_m: %g; expected finite numbers above 0", name, l->size_m[k]);
        }
    }
    for (int c = 0; c < 3; ++c) {
        if (!(l->rgb[c] >= 0.0 && isfinite(l->rgb[c]))) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: rgb: %g; expected finite numbers ≥ 0", name, l->rgb[c]);
        }
    }
    if (l->kind == TSUYA_LIGHT_SPOT && !(l->cone_rad[0] >= 0.0 && l->cone_rad[0] <= l->cone_rad[1] && l->cone_rad[1] > 0.0 &&
                                         l->cone_rad[1] <= M_PI)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: cone_deg: [%g, %g]; expected 0 ≤ inner ≤ outer ≤ 180, outer above 0", name,
                          tsuya_deg_from_rad(l->cone_rad[0]), tsuya_deg_from_rad(l->cone_rad[1]));
    }
    return TSUYA_OK;
}

static void derive(tsuya_light *l)
{
    l->luminance = tsuya_rgb_luminance(l->rgb);
    /* a lamp of pure blue is still chosen often enough */
    l->luminance = fmax(l->luminance, 0.1 * fmax(l->rgb[0], fmax(l->rgb[1], l->rgb[2])));
    if (l->map) {
        l->luminance *= tsuya_environment_mean(l->map);
    }
    l->direction = tsuya_vec3_unit(l->direction);
    tsuya_vec3 up = tsuya_vec3_tangent(l->up, l->direction);
    if (!(tsuya_vec3_norm(up) > 0.5)) {
        tsuya_vec3 side;
        tsuya_frame_from_normal(l->direction, &side, &up);
    }
    l->up = up;
    l->side = tsuya_vec3_cross(l->direction, up);
    l->area_m2 = l->kind == TSUYA_LIGHT_RECT   ? l->size_m[0] * l->size_m[1]
                 : l->kind == TSUYA_LIGHT_DISK ? M_PI / 4.0 * l->size_m[0] * l->size_m[0]
                                               : 0.0;
    l->reach_m = 0.5 * hypot(l->size_m[0], l->size_m[1]);
}

tsuya_status tsuya_light_set_add(tsuya_light_set *set, const tsuya_light *light, const char *name)
{
    tsuya_status status = check_shape(light, name);
    tsuya_light *grown = status == TSUYA_OK ? tsuya_realloc(set->light, (size_t)set->count + 1, sizeof *grown) : NULL;
    if (!grown) {
        tsuya_environment_free(light->map);
        tsuya_free(light->spectrum);
        return status != TSUYA_OK ? status : TSUYA_ERROR_MEMORY;
    }
    set->light = grown;
    set->light[set->count] = *light;
    derive(&set->light[set->count++]);
    return TSUYA_OK;
}

void tsuya_light_set_free(tsuya_light_set *set)
{
    for (int k = 0; k < set->count; ++k) {
        tsuya_environment_free(set->light[k].map);
        tsuya_free(set->light[k].spectrum);
    }
    tsuya_free(set->light);
    *set = (tsuya_light_set){0};
}

tsuya_status tsuya_light_take_spectrum(tsuya_light *light, const char *name, const char *folder)
{
    tsuya_lamp_spectrum *spectrum = tsuya_calloc(1, sizeof *spectrum);
    tsuya_status status = spectrum ? tsuya_lamp_spectrum_load(spectrum, name, folder) : TSUYA_ERROR_MEMORY;
    if (status != TSUYA_OK) {
        tsuya_free(spectrum);
        return status;
    }
    tsuya_vec3 color = tsuya_vec3_scale(tsuya_lamp_spectrum_rgb(spectrum), tsuya_rgb_luminance(light->rgb));
    const double rgb[3] = {color.x, color.y, color.z};
    memcpy(light->rgb, rgb, sizeof rgb);
    tsuya_free(light->spectrum);
    light->spectrum = spectrum;
    return TSUYA_OK;
}

tsuya_status tsuya_light_set_give_spectrum(tsuya_light_set *set, const char *name)
{
    for (int k = 0; k < set->count; ++k) {
        TSUYA_TRY(tsuya_light_take_spectrum(&set->light[k], name, "."));
        derive(&set->light[k]);
    }
    return TSUYA_OK;
}

static tsuya_status add_studio_rect(tsuya_light_set *set, tsuya_vec3 center, tsuya_vec3 to_lamp, tsuya_vec3 up, double distance,
                                    double side, double irradiance)
{
    tsuya_light rect = {.kind = TSUYA_LIGHT_RECT, .up = up, .size_m = {side, side}};
    tsuya_vec3 d = tsuya_vec3_unit(to_lamp);
    rect.position_m = tsuya_vec3_mad(center, distance, d);
    rect.direction = tsuya_vec3_scale(d, -1.0);
    for (int c = 0; c < 3; ++c) {
        rect.rgb[c] = irradiance * distance * distance / (side * side);
    }
    return tsuya_light_set_add(set, &rect, "studio");
}

tsuya_status tsuya_light_set_studio(tsuya_light_set *set, tsuya_vec3 center, double radius_m, tsuya_vec3 eye, tsuya_vec3 up)
{
    tsuya_vec3 back = tsuya_vec3_unit(tsuya_vec3_sub(eye, center));
    tsuya_vec3 top = tsuya_vec3_tangent(up, back), right = tsuya_vec3_cross(top, back);
    *set = (tsuya_light_set){0};
    tsuya_vec3 key = tsuya_vec3_add(tsuya_vec3_mad(back, -0.9, right), tsuya_vec3_scale(top, 1.0));
    tsuya_vec3 fill = tsuya_vec3_add(tsuya_vec3_mad(back, 1.3, right), tsuya_vec3_scale(top, 0.2));
    const tsuya_light dim = {.kind = TSUYA_LIGHT_ENVIRONMENT, .rgb = {0.08, 0.08, 0.08}};
    tsuya_status status = add_studio_rect(set, center, key, up, 4.0 * radius_m, 1.6 * radius_m, 2.8);
    if (status == TSUYA_OK) {
        status = add_studio_rect(set, center, fill, up, 5.0 * radius_m, 2.5 * radius_m, 0.7);
    }
    if (status == TSUYA_OK) {
        status = tsuya_light_set_add(set, &dim, "studio");
    }
    if (status != TSUYA_OK) {
        tsuya_light_set_free(set);
    }
    return status;
}

static void scaled_rgb(double out[3], const double rgb[3], double s)
{
    for (int c = 0; c < 3; ++c) {
        out[c] = rgb[c] * s;
    }
}

/* Share of a spot's intensity in a direction that makes the cosine with its axis. */
static double spot_share(const tsuya_light *l, double cosine)
{
    double inner = cos(l->cone_rad[0]), outer = cos(l->cone_rad[1]);
    if (cosine >= inner) {
        return 1.0;
    }
    double t = cosine <= outer ? 0.0 : (cosine - outer) / (inner - outer);
    return t * t * (3.0 - 2.0 * t);
}

static bool sample_point(const tsuya_light *l, tsuya_vec3 p, tsuya_light_sample *s)
{
    tsuya_vec3 d = tsuya_vec3_sub(l->position_m, p);
    double r = tsuya_vec3_norm(d);
    if (!(r > 0.0)) {
        return false;
    }
    s->wi = tsuya_vec3_scale(d, 1.0 / r);
    s->distance_m = r;
    double share = l->kind == TSUYA_LIGHT_SPOT ? spot_share(l, -tsuya_vec3_dot(s->wi, l->direction)) : 1.0;
    scaled_rgb(s->rgb, l->rgb, share / (r * r));
    return share > 0.0;
}

static bool sample_area(const tsuya_light *l, tsuya_vec3 p, const double u[2], tsuya_light_sample *s)
{
    double a, b;
    if (l->kind == TSUYA_LIGHT_DISK) {
        tsuya_vec2 d = tsuya_sample_disk(u[0], u[1]);
        a = 0.5 * l->size_m[0] * d.x;
        b = 0.5 * l->size_m[0] * d.y;
    } else {
        a = (u[0] - 0.5) * l->size_m[0];
        b = (u[1] - 0.5) * l->size_m[1];
    }
    tsuya_vec3 q = tsuya_vec3_mad(tsuya_vec3_mad(l->position_m, a, l->side), b, l->up), d = tsuya_vec3_sub(q, p);
    double r = tsuya_vec3_norm(d);
    s->wi = tsuya_vec3_unit(d);
    double cosine = -tsuya_vec3_dot(s->wi, l->direction);
    if (!(r > 0.0 && cosine > 0.0)) {
        return false;
    }
    s->distance_m = r;
    s->delta = false;
    s->pdf = r * r / (cosine * l->area_m2);
    scaled_rgb(s->rgb, l->rgb, 1.0);
    return isfinite(s->pdf);
}

void tsuya_light_radiance(const tsuya_light *l, tsuya_vec3 direction, double rgb[3])
{
    scaled_rgb(rgb, l->rgb, 1.0);
    if (l->map) {
        double seen[3];
        tsuya_environment_radiance(l->map, direction, seen);
        for (int c = 0; c < 3; ++c) {
            rgb[c] *= seen[c];
        }
    }
}

static double constant_pdf(tsuya_vec3 n, tsuya_vec3 direction)
{
    double cosine = tsuya_vec3_dot(n, direction);
    return cosine > 0.0 ? cosine / M_PI : 0.0;
}

static bool sample_environment(const tsuya_light *l, tsuya_vec3 n, const double u[2], tsuya_light_sample *s)
{
    s->delta = false;
    s->distance_m = INFINITY;
    if (l->map) {
        s->wi = tsuya_environment_sample(l->map, u);
        s->pdf = tsuya_environment_pdf(l->map, s->wi);
    } else {
        tsuya_vec3 d = tsuya_sample_cosine(u[0], u[1]), x, y;
        tsuya_frame_from_normal(n, &x, &y);
        s->wi = tsuya_vec3_add(tsuya_vec3_mad(tsuya_vec3_scale(x, d.x), d.y, y), tsuya_vec3_scale(n, d.z));
        s->pdf = constant_pdf(n, s->wi);
    }
    tsuya_light_radiance(l, s->wi, s->rgb);
    return s->pdf > 0.0;
}

bool tsuya_light_sample_at(const tsuya_light *light, tsuya_vec3 p, tsuya_vec3 n, const double u[2], tsuya_light_sample *sample)
{
    *sample = (tsuya_light_sample){.pdf = 1.0, .delta = true};
    switch (light->kind) {
    case TSUYA_LIGHT_POINT:
    case TSUYA_LIGHT_SPOT:
        return sample_point(light, p, sample);
    case TSUYA_LIGHT_DIRECTIONAL:
        sample->wi = tsuya_vec3_scale(light->direction, -1.0);
        sample->distance_m = INFINITY;
        scaled_rgb(sample->rgb, light->rgb, 1.0);
        return true;
    case TSUYA_LIGHT_DISK:
    case TSUYA_LIGHT_RECT:
        return sample_area(light, p, u, sample);
    case TSUYA_LIGHT_ENVIRONMENT:
        return sample_environment(light, n, u, sample);
    }
    return false;
}

static bool hit_area(const tsuya_light *l, tsuya_vec3 origin, tsuya_vec3 direction, double *distance_m, double rgb[3], double *pdf)
{
    double cosine = -tsuya_vec3_dot(direction, l->direction);
    tsuya_vec3 to_lamp = tsuya_vec3_sub(l->position_m, origin);
    double height = -tsuya_vec3_dot(to_lamp, l->direction);
    if (!(cosine > 0.0 && height > 0.0)) {
        return false;
    }
    double t = height / cosine;
    tsuya_vec3 d = tsuya_vec3_sub(tsuya_vec3_scale(direction, t), to_lamp);
    double a = tsuya_vec3_dot(d, l->side), b = tsuya_vec3_dot(d, l->up);
    bool inside = l->kind == TSUYA_LIGHT_DISK ? a * a + b * b <= 0.25 * l->size_m[0] * l->size_m[0]
                                              : fabs(a) <= 0.5 * l->size_m[0] && fabs(b) <= 0.5 * l->size_m[1];
    if (!inside || !isfinite(t)) {
        return false;
    }
    *distance_m = t;
    *pdf = t * t / (cosine * l->area_m2);
    scaled_rgb(rgb, l->rgb, 1.0);
    return true;
}

bool tsuya_light_hit(const tsuya_light *light, tsuya_vec3 origin, tsuya_vec3 n, tsuya_vec3 direction, double *distance_m,
                     double rgb[3], double *pdf)
{
    if (light->kind == TSUYA_LIGHT_ENVIRONMENT) {
        *distance_m = INFINITY;
        *pdf = light->map ? tsuya_environment_pdf(light->map, direction) : constant_pdf(n, direction);
        tsuya_light_radiance(light, direction, rgb);
        return true;
    }
    return (light->kind == TSUYA_LIGHT_DISK || light->kind == TSUYA_LIGHT_RECT) &&
           hit_area(light, origin, direction, distance_m, rgb, pdf);
}

double tsuya_light_weight(const tsuya_light *l, tsuya_vec3 p, tsuya_vec3 n)
{
    if (l->kind == TSUYA_LIGHT_ENVIRONMENT) {
        return M_PI * l->luminance;
    }
    if (l->kind == TSUYA_LIGHT_DIRECTIONAL) {
        double cosine = -tsuya_vec3_dot(n, l->direction);
        return cosine > 0.0 ? cosine * l->luminance : 0.0;
    }
    tsuya_vec3 d = tsuya_vec3_sub(l->position_m, p);
    double r2 = tsuya_vec3_dot(d, d), r = sqrt(r2), reach = l->reach_m;
    /* the highest point of the lamp over the surface decides whether it is seen at all */
    double cosine = (tsuya_vec3_dot(n, d) + reach) / (r + reach);
    if (!(r > 0.0) || !(cosine > 0.0)) {
        return 0.0;
    }
    if (l->area_m2 > 0.0) {
        double facing = -tsuya_vec3_dot(d, l->direction), emitted = facing > 0.05 * r ? facing / r : 0.05;
        return l->luminance * l->area_m2 * cosine * emitted / (r2 + l->area_m2 / M_PI);
    }
    return l->luminance * cosine / r2;
}
