#include "capture/microcylinder.h"

#include "core/file.h"

#include <stdio.h>
#include <stdlib.h>
#include <string.h>

/* The published model is unbounded at grazing light; f·cosθi is held at its value for 80°. */
static const double grazing_rad = 80.0 * M_PI / 180.0;

/* Not fmin and fmax: those are calls. */
static double least(double a, double b) { return a < b ? a : b; }
static double most(double a, double b) { return a > b ? a : b; }
static double cosine(double c) { return most(least(c, 1.0), -1.0); }

static double fresnel(double cos_theta, double eta)
{
    double c = least(most(cos_theta, 0.0), 1.0), g = sqrt(eta * eta - 1.0 + c * c);
    double a = (g - c) / (g + c), b = (c * (g + c) - 1.0) / (c * (g - c) + 1.0);
    return 0.5 * a * a * (1.0 + b * b);
}

static double gaussian(double width_rad, double x)
{
    return exp(-0.5 * x * x / (width_rad * width_rad)) / (width_rad * sqrt(2.0 * M_PI));
}

/* Of two angles from a plane's normal, by their cosines and the cosine of their difference. */
static double shadow(double ca, double cb, double cd)
{
    double width = tsuya_rad_from_deg(20.0), d = acos(cosine(cd)), u = exp(-0.5 * d * d / (width * width));
    ca = most(ca, 0.0);
    cb = most(cb, 0.0);
    return (1.0 - u) * ca * cb + u * least(ca, cb);
}

/* Cosine of half an angle in [0, π]. */
static double half_cosine(double c) { return sqrt(most(0.5 * (1.0 + c), 0.0)); }

typedef struct sums {
    double light[3], back[3], weight; /* Σ f M P cosθi, the same with light and viewer exchanged, Σ P */
} sums;

/* One cylinder with its axis tipped out of the plane, by the offset's cosine c and sine n. */
static void add_cylinder(sums *s, const tsuya_microcylinder_thread *p, tsuya_vec3 along, double c, double n, double share,
                         tsuya_vec3 wi, tsuya_vec3 wo)
{
    tsuya_vec3 t = {c * along.x, c * along.y, n}, up = {-n * along.x, -n * along.y, c}, b = tsuya_vec3_cross(up, t);
    double ti = cosine(tsuya_vec3_dot(wi, t)), tr = cosine(tsuya_vec3_dot(wo, t));
    double ni = tsuya_vec3_dot(wi, up), nr = tsuya_vec3_dot(wo, up), bi = tsuya_vec3_dot(wi, b), br = tsuya_vec3_dot(wo, b);
    double ci = sqrt(1.0 - ti * ti), cr = sqrt(1.0 - tr * tr), across = most(ci * cr, 1e-12); /* cosines of the inclinations θ */
    double theta_h = 0.5 * atan2(ti * cr + tr * ci, ci * cr - ti * tr); /* (θi + θr) / 2 */
    double turn = cosine((ni * nr + bi * br) / across); /* cos(φi − φr) */
    double cd = half_cosine(ci * cr + ti * tr), half = half_cosine(turn);
    double surface = fresnel(cd * half, p->eta) * half * gaussian(tsuya_rad_from_deg(p->surface_deg), theta_h);
    double through = (1.0 - fresnel(ci, p->eta)) * (1.0 - fresnel(cr, p->eta)) / most(ci + cr, 1e-9);
    double volume = through * ((1.0 - p->isotropic) * gaussian(tsuya_rad_from_deg(p->volume_deg), theta_h) + p->isotropic);
    /* angles in the plane along the yarn */
    double pi = most(sqrt(ti * ti + ni * ni), 1e-12), pr = most(sqrt(tr * tr + nr * nr), 1e-12);
    double reweight = shadow(ni / pi, nr / pr, (ni * nr + ti * tr) / (pi * pr));
    double k = share * shadow(ni / most(ci, 1e-12), nr / most(cr, 1e-12), turn) * reweight / most(cd * cd, 1e-9);
    for (int j = 0; j < 3; ++j) {
        double f = k * (surface + volume * p->albedo[j]);
        s->light[j] += f * ci;
        s->back[j] += f * cr;
    }
    s->weight += share * reweight;
}

static sums thread_sums(const tsuya_microcylinder_thread *p, double step_deg, tsuya_vec3 along, tsuya_vec3 wi, tsuya_vec3 wo)
{
    sums s = {0};
    double total = 0.0;
    for (int k = 0; k + 1 < p->knot_count; ++k) {
        total += p->length[k];
    }
    for (int k = 0; k + 1 < p->knot_count; ++k) {
        double from = tsuya_rad_from_deg(p->offset_deg[k]), to = tsuya_rad_from_deg(p->offset_deg[k + 1]);
        int steps = from == to ? 1 : (int)ceil(fabs(p->offset_deg[k + 1] - p->offset_deg[k]) / (step_deg > 0.0 ? step_deg : 0.5));
        double step = (to - from) / steps, c = cos(from + 0.5 * step), n = sin(from + 0.5 * step), cos_step = cos(step), sin_step = sin(step);
        for (int i = 0; i < steps; ++i) {
            add_cylinder(&s, p, along, c, n, p->length[k] / (total * steps), wi, wo);
            double turned = c * cos_step - n * sin_step;
            n = n * cos_step + c * sin_step;
            c = turned;
        }
    }
    return s;
}

static tsuya_vec3 not_grazing(tsuya_vec3 w)
{
    double z = cos(grazing_rad), across = sqrt(w.x * w.x + w.y * w.y);
    if (w.z >= z || across <= 0.0) {
        return w;
    }
    double k = sin(grazing_rad) / across;
    return (tsuya_vec3){k * w.x, k * w.y, z};
}

void tsuya_microcylinder_eval_ways(const tsuya_microcylinder *cloth, tsuya_vec3 wi, tsuya_vec3 wo, double value[3], double back[3])
{
    memset(value, 0, 3 * sizeof *value);
    memset(back, 0, 3 * sizeof *back);
    if (!(wi.z > 0.0 && wo.z > 0.0)) {
        return;
    }
    tsuya_vec3 i = not_grazing(wi), o = not_grazing(wo);
    sums warp = thread_sums(&cloth->warp, cloth->step_deg, (tsuya_vec3){0, 1, 0}, i, o), weft = thread_sums(&cloth->weft, cloth->step_deg, (tsuya_vec3){1, 0, 0}, i, o);
    double a = cloth->warp.area, b = cloth->weft.area, threads = a * warp.weight + b * weft.weight, gaps = fmax(1.0 - a - b, 0.0);
    double from_o = (threads + gaps * o.z) * i.z, from_i = (threads + gaps * i.z) * o.z;
    for (int j = 0; j < 3; ++j) {
        value[j] = from_o > 0.0 ? (a * warp.light[j] + b * weft.light[j]) / from_o : 0.0;
        back[j] = from_i > 0.0 ? (a * warp.back[j] + b * weft.back[j]) / from_i : 0.0;
    }
}

void tsuya_microcylinder_eval(const tsuya_microcylinder *cloth, tsuya_vec3 wi, tsuya_vec3 wo, double value[3])
{
    double back[3];
    tsuya_microcylinder_eval_ways(cloth, wi, wo, value, back);
}

void tsuya_microcylinder_eval_reciprocal(const tsuya_microcylinder *cloth, tsuya_vec3 wi, tsuya_vec3 wo, double value[3])
{
    double one[3], other[3];
    tsuya_microcylinder_eval_ways(cloth, wi, wo, one, other);
    for (int j = 0; j < 3; ++j) {
        value[j] = sqrt(fmax(one[j], 0.0) * fmax(other[j], 0.0));
    }
}

static int numbers_after(double *numbers, int capacity, const char *line, const char *key)
{
    const char *at = strstr(line, key);
    int count = 0;
    if (!at) {
        return 0;
    }
    at += strlen(key);
    for (char *end; count < capacity; at = end) {
        numbers[count] = strtod(at, &end);
        if (end == at) {
            break;
        }
        count++;
    }
    return count;
}

static bool parse_thread(tsuya_microcylinder_thread *p, const char *line)
{
    double factor;
    *p = (tsuya_microcylinder_thread){0};
    const char *a = strstr(line, " A (");
    if (!a || sscanf(a, " A (%lf,%lf,%lf)*%lf", &p->albedo[0], &p->albedo[1], &p->albedo[2], &factor) != 4) {
        return false;
    }
    for (int j = 0; j < 3; ++j) {
        p->albedo[j] *= factor;
    }
    p->knot_count = numbers_after(p->offset_deg, TSUYA_MICROCYLINDER_KNOTS, line, " off ");
    int lengths = numbers_after(p->length, TSUYA_MICROCYLINDER_KNOTS, line, " len ");
    return numbers_after(&p->eta, 1, line, " eta ") && numbers_after(&p->isotropic, 1, line, " kd ") &&
           numbers_after(&p->surface_deg, 1, line, " gs ") && numbers_after(&p->volume_deg, 1, line, " gv ") &&
           numbers_after(&p->area, 1, line, " a ") && p->knot_count >= 2 && lengths == p->knot_count - 1;
}

static tsuya_status take_line(tsuya_microcylinder *cloth, int *threads, const char *line, const char *path, const char *name)
{
    char cloth_name[64], thread[16];
    if (line[0] == '#' || sscanf(line, "%63s %15s", cloth_name, thread) != 2 || strcmp(cloth_name, name) != 0) {
        return TSUYA_OK;
    }
    tsuya_microcylinder_thread p;
    if (!parse_thread(&p, line)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %s %s: expected eta, A (r,g,b)*factor, kd, gs, gv, a, off and len", path, name, thread);
    }
    if (strcmp(thread, "both") == 0) {
        cloth->warp = cloth->weft = p;
        *threads += 2;
    } else {
        *(strcmp(thread, "flat") == 0 || strcmp(thread, "dir1") == 0 ? &cloth->warp : &cloth->weft) = p;
        *threads += 1;
    }
    return TSUYA_OK;
}

tsuya_status tsuya_microcylinder_load(tsuya_microcylinder *cloth, const char *path, const char *name)
{
    char *text, *rest;
    size_t size;
    int threads = 0;
    *cloth = (tsuya_microcylinder){0};
    TSUYA_TRY(tsuya_file_load(&text, &size, path, 1 << 20));
    tsuya_status status = TSUYA_OK;
    for (char *line = strtok_r(text, "\n", &rest); line && status == TSUYA_OK; line = strtok_r(NULL, "\n", &rest)) {
        status = take_line(cloth, &threads, line, path, name);
    }
    tsuya_free(text);
    if (status == TSUYA_OK && threads != 2) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: cloth %s: %d threads found, 2 expected", path, name, threads);
    }
    return status;
}
