/* light.json: lamps of tsuya render's kinds at one place that together shine as the lobe does, by non-negative least squares over
 * the angles that were lit. */
#include "calib/lamp.h"

#include <stdio.h>

enum { ANGLES = 91, SPOTS = 17, KINDS = 2 + SPOTS, SWEEPS = 4000 };
static const double DISK_M = 0.01, NEGLIGIBLE = 2e-3;

/* Share of its full intensity that a lamp sends out at an angle from its axis: a point, a disk, spots that open by 10 degrees more each. */
static double shape(int kind, double angle_rad)
{
    if (kind == 0) {
        return 1.0;
    }
    if (kind == 1) {
        return fmax(cos(angle_rad), 0.0);
    }
    double outer = cos(tsuya_rad_from_deg(10.0 * kind)), t = fmin(fmax((cos(angle_rad) - outer) / (1.0 - outer), 0.0), 1.0);
    return t * t * (3.0 - 2.0 * t);
}

/* Shares of the kinds; the largest deviation that is left. */
static double compose(double share[KINDS], const tsuya_lamp *lamp)
{
    double most = acos(fmin(fmax(lamp->cos_least, 0.0), 1.0)), a[KINDS][KINDS] = {{0}}, b[KINDS] = {0}, worst = 0.0;
    for (int i = 0; i < ANGLES; i++) {
        double angle = most * i / (ANGLES - 1), want = pow(fmax(cos(angle), 0.0), lamp->falloff);
        for (int k = 0; k < KINDS; k++) {
            for (int m = 0; m < KINDS; m++) {
                a[k][m] += shape(k, angle) * shape(m, angle);
            }
            b[k] += shape(k, angle) * want;
        }
    }
    for (int k = 0; k < KINDS; k++) {
        share[k] = 0.0;
    }
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        for (int k = 0; k < KINDS; k++) {
            double g = b[k];
            for (int m = 0; m < KINDS; m++) {
                g -= a[k][m] * share[m];
            }
            share[k] = fmax(share[k] + g / a[k][k], 0.0);
        }
    }
    for (int k = 0; k < KINDS; k++) {
        share[k] = share[k] < NEGLIGIBLE ? 0.0 : share[k];
    }
    for (int i = 0; i < ANGLES; i++) {
        double angle = most * i / (ANGLES - 1), sum = -pow(fmax(cos(angle), 0.0), lamp->falloff);
        for (int k = 0; k < KINDS; k++) {
            sum += share[k] * shape(k, angle);
        }
        worst = fmax(worst, fabs(sum));
    }
    return worst;
}

static void set_vec3(tsuya_json *object, const char *key, tsuya_vec3 v) { tsuya_json_set_numbers(object, key, &v.x, 3); }

static void set_rgb(tsuya_json *object, const double rgb[3], double scale)
{
    tsuya_json_set_numbers(object, "rgb", (double[]){scale * rgb[0], scale * rgb[1], scale * rgb[2]}, 3);
}

static void add_light(tsuya_json *list, const tsuya_lamp *lamp, int kind, double share)
{
    tsuya_json *o = tsuya_json_add_object(list);
    tsuya_json_set_text(o, "type", kind == 0 ? "point" : kind == 1 ? "disk" : "spot");
    set_vec3(o, "position_m", lamp->position_m);
    if (kind > 0) {
        set_vec3(o, "direction", lamp->direction);
    }
    if (kind == 1) {
        tsuya_json_set_numbers(o, "size_m", (double[]){DISK_M, DISK_M}, 2);
        share /= 0.25 * M_PI * DISK_M * DISK_M; /* radiance */
    } else if (kind > 1) {
        tsuya_json_set_numbers(o, "cone_deg", (double[]){0.0, 10.0 * kind}, 2);
    }
    set_rgb(o, lamp->rgb, share);
}

/* Shares of the kinds; the deviation. */
static double shares_of(double share[KINDS], const tsuya_lamp *lamp)
{
    for (int k = 0; k < KINDS; k++) {
        share[k] = k == 0 ? 1.0 : 0.0;
    }
    return lamp->has_intensity ? compose(share, lamp) : 0.0;
}

void tsuya_lamp_add_lights(tsuya_json *list, const tsuya_lamp *lamp)
{
    double share[KINDS];
    if (lamp->far_away) {
        tsuya_json *o = tsuya_json_add_object(list);
        tsuya_json_set_text(o, "type", "directional");
        set_vec3(o, "direction", tsuya_vec3_scale(lamp->to_lamp, -1.0));
        set_rgb(o, lamp->rgb, 1.0);
        return;
    }
    (void)shares_of(share, lamp);
    for (int k = 0; k < KINDS; k++) {
        if (share[k] > 0.0) {
            add_light(list, lamp, k, share[k]);
        }
    }
}

static void set_plate(tsuya_json *object, const tsuya_lamp *lamp)
{
    tsuya_json_set_number(object, "direction_sigma_deg", lamp->direction_sigma_deg);
    tsuya_json_set_number(object, "falloff", lamp->falloff);
    tsuya_json_set_number(object, "falloff_sigma", lamp->falloff_sigma);
    tsuya_json_set_number(object, "distance_exponent", lamp->distance_exponent);
    tsuya_json_set_number(object, "distance_exponent_sigma", lamp->distance_exponent_sigma);
    tsuya_json_set_number(object, "rgb_sigma_rel", lamp->rgb_sigma_rel);
    tsuya_json_set_number(object, "lit_angle_deg", tsuya_deg_from_rad(acos(fmin(lamp->cos_least, 1.0))));
    tsuya_json_set_numbers(object, "ambient", lamp->ambient, 3);
    tsuya_json_set_number(object, "vignetting_corner", exp(lamp->vignetting));
}

void tsuya_lamp_describe(tsuya_json *object, const tsuya_lamp *lamp)
{
    double sigma[3], share[KINDS];
    if (!lamp->far_away) {
        tsuya_json_set_number(object, "lobe_deviation", shares_of(share, lamp));
    }
    tsuya_json *o = tsuya_json_set_object(object, "lamp");
    for (int i = 0; i < 3; i++) {
        sigma[i] = lamp->far_away ? INFINITY : sqrt(lamp->position_cov_m2[4 * i]);
    }
    set_vec3(o, "to_lamp", lamp->to_lamp);
    tsuya_json_set_number(o, "to_lamp_sigma_deg", lamp->to_lamp_sigma_deg);
    if (!lamp->far_away) {
        set_vec3(o, "position_m", lamp->position_m);
        tsuya_json_set_numbers(o, "position_sigma_m", sigma, 3);
        tsuya_json_set_number(o, "distance_m", lamp->distance_m);
        tsuya_json_set_number(o, "distance_sigma_m", lamp->distance_sigma_m);
        set_vec3(o, "direction", lamp->direction);
    }
    if (lamp->has_intensity) {
        set_plate(o, lamp);
        tsuya_json_set_number(object, "rms", lamp->rms);
        tsuya_json_set_number(object, "exposure_scatter", lamp->gain_sigma);
        tsuya_json_set_number(object, "photos", lamp->photos);
        tsuya_json_set_number(object, "readings", lamp->readings);
        tsuya_json_set_number(object, "outliers", lamp->outliers);
    }
    if (lamp->highlights) {
        tsuya_json_set_number(object, "rms_px", lamp->rms_px);
        tsuya_json_set_number(object, "highlights", lamp->highlights);
    }
}

void tsuya_lamp_to_json(tsuya_json *object, const tsuya_lamp *lamp)
{
    tsuya_json_set_text(object, "format", "tsuya light");
    tsuya_json_set_text(object, "version", "1.0");
    tsuya_lamp_add_lights(tsuya_json_set_array(object, "lights"), lamp);
    tsuya_lamp_describe(object, lamp);
}
