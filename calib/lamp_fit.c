/* The lamp that explains white's values: near-field Lambert. */
#include "calib/lamp_parts.h"

#include "core/memory.h"

#include <stdlib.h>
#include <string.h>

enum { STARTS = 72, KEPT = 3, ROUNDS = 8, FEWEST_READINGS = 12 };
/* The numbers a step moves; behind them one a further plate and OWN a photograph (log gain and its gradient across the plate), then the
 * balls' shifts. */
enum { TO_LAMP, INVERSE = 2, AXIS, FALLOFF = 5, POWER, AMBIENT, VIGNETTING, LEVEL, REST, OWN = 3 };

static const double AXIS_PRIOR = 0.5, FALLOFF_PRIOR = 3.0, AMBIENT_PRIOR = 0.1, VIGNETTING_PRIOR = 0.3, PLATE_PRIOR = 0.3, HELD = 1e-7;
static const double LEAST_TURN_DEG = 8.0, UNLIT = 0.003, ALIKE = 0.03, GRAZING = 0.06, MISFIT = 0.15, FIRST_GAIN = 0.01;
/* Paper is not quite matte: what it deviates by changes with the tilt, and is alike in all tags of a photograph. */
static const double LEAST_GAIN = 0.005, GRADIENT_PRIOR = 0.003, FIRST_SIGMA_PX = 0.5;

typedef struct model {
    tsuya_vec3 to_lamp, axis;
    double inverse_m;            /* of the distance */
    double falloff, power, ambient, vignetting, level;
} model;

typedef struct fit {
    const tsuya_lamp_readings *r;
    tsuya_vec3 middle;
    tsuya_vec2 plate_middle_m;
    double extent_m, plate_m;    /* root mean square distance from the middles */
    double typical;              /* value */
    double *value, *weight;      /* luminance of each reading; weight: square root, over the scatter */
    double scale, gain_sigma;
    bool free_power, free_vignetting, free_lobe, free_extra;
    int extras, first_shift;     /* among the extras: the balls' shifts come last */
    const tsuya_lamp_balls *balls; /* NULL: none */
    double sigma_px;             /* of highlights */
} fit;

/* The solver copies states as bytes: log white of plates 1 …, log gain and gradient of each photograph, and the balls' shifts
 * stand behind the model. */
typedef struct state {
    model m;
    const fit *f;
    double extra[];
} state;

static double lobe_of(const model *m, tsuya_vec3 v)
{
    double c = -tsuya_vec3_dot(v, m->axis) / tsuya_vec3_norm(v);
    return c > 0.0 ? pow(c, m->falloff) : 0.0;
}

static tsuya_vec3 way(const model *m, const fit *f, const tsuya_lamp_reading *r)
{
    return tsuya_vec3_mad(m->to_lamp, -m->inverse_m, tsuya_vec3_sub(r->position_m, f->middle));
}

/* What comes from the lamp, for level 0; and the factor of everything that reaches the pixel. */
static double direct(const model *m, const fit *f, const tsuya_lamp_reading *r)
{
    tsuya_vec3 v = way(m, f, r);
    double length = fmax(tsuya_vec3_norm(v), 1e-6), cosine = tsuya_vec3_dot(r->normal, v) / length;
    return cosine > 0.0 ? lobe_of(m, v) * cosine / pow(length, m->power) : 0.0;
}

static double factor(const model *m, const double *extra, const fit *f, const tsuya_lamp_reading *r)
{
    const double *own = extra + f->r->plates - 1 + OWN * r->photo;
    double u = (r->place_m.x - f->plate_middle_m.x) / f->plate_m, v = (r->place_m.y - f->plate_middle_m.y) / f->plate_m;
    double e = m->vignetting * r->radius2 + own[0] + u * own[1] + v * own[2];
    return exp(r->plate > 0 ? e + extra[r->plate - 1] : e);
}

static double expected(const state *s, const tsuya_lamp_reading *r)
{
    return factor(&s->m, s->extra, s->f, r) * (exp(s->m.level) * direct(&s->m, s->f, r) + s->m.ambient);
}

static double measure(const fit *f, int i) { return f->value[i] + 0.02 * f->typical; }

static tsuya_lamp_place place_of(const state *s) { return (tsuya_lamp_place){s->f->middle, s->m.to_lamp, s->m.inverse_m}; }

static void residuals(double *row, const void *at)
{
    const state *s = at;
    const fit *f = s->f;
    int n = f->r->count;
    for (int i = 0; i < n; i++) {
        row[i] = f->weight[i] * (f->value[i] - expected(s, &f->r->reading[i])) / measure(f, i);
    }
    tsuya_vec3 off = tsuya_vec3_add(s->m.axis, s->m.to_lamp);
    double *prior = row + n;
    *prior++ = off.x / AXIS_PRIOR;
    *prior++ = off.y / AXIS_PRIOR;
    *prior++ = off.z / AXIS_PRIOR;
    *prior++ = (s->m.falloff - (f->free_lobe ? 1.0 : 0.0)) / (f->free_lobe ? FALLOFF_PRIOR : HELD);
    *prior++ = s->m.ambient / (f->typical * (f->free_lobe ? AMBIENT_PRIOR : HELD));
    *prior++ = (s->m.power - 2.0) / (f->free_power ? 1.0 : HELD);
    *prior++ = s->m.vignetting / (f->free_vignetting && f->free_lobe ? VIGNETTING_PRIOR : HELD);
    for (int k = 0; k < f->first_shift; k++) {
        bool gain = (k - f->r->plates + 1) % OWN == 0;
        double sigma = k < f->r->plates - 1 ? PLATE_PRIOR : gain ? f->gain_sigma : GRADIENT_PRIOR;
        *prior++ = s->extra[k] / (f->free_extra || k < f->r->plates - 1 ? sigma : HELD);
    }
    if (f->balls) {
        tsuya_lamp_place place = place_of(s);
        tsuya_lamp_ball_rows(prior, f->balls, &place, s->extra + f->first_shift, f->sigma_px);
    }
}

static void move(void *at, const double *step)
{
    state *s = at;
    s->m.to_lamp = tsuya_lamp_turn(s->m.to_lamp, step[TO_LAMP], step[TO_LAMP + 1]);
    s->m.axis = tsuya_lamp_turn(s->m.axis, step[AXIS], step[AXIS + 1]);
    s->m.inverse_m = fmax(s->m.inverse_m + step[INVERSE], 0.0);
    s->m.falloff = fmin(fmax(s->m.falloff + step[FALLOFF], 0.0), 60.0);
    s->m.power += step[POWER];
    s->m.ambient += step[AMBIENT];
    s->m.vignetting += step[VIGNETTING];
    s->m.level += step[LEVEL];
    for (int k = 0; k < s->f->extras; k++) {
        s->extra[k] += step[REST + k];
    }
}

static size_t state_bytes(const fit *f) { return sizeof(state) + (size_t)f->extras * sizeof(double); }

static tsuya_lamp_problem problem_of(const fit *f, state *s, double *nudge)
{
    for (int k = 0; k < REST + f->extras; k++) {
        nudge[k] = 1e-5;
    }
    for (int k = f->first_shift; k < f->extras; k++) {
        nudge[REST + k] = 1e-7;
    }
    nudge[INVERSE] = 1e-5 / f->extent_m;
    nudge[AMBIENT] = 1e-5 * f->typical;
    int rows = f->r->count + 7 + f->extras + (f->balls ? 2 * f->balls->highlights : 0);
    return (tsuya_lamp_problem){s, state_bytes(f), REST + f->extras, rows, residuals, move, nudge};
}

/* Robust scatter, and Cauchy weights by it. */
static void reweigh(fit *f, const state *s, double *scratch)
{
    int n = f->r->count;
    for (int i = 0; i < n; i++) {
        scratch[i] = fabs(f->value[i] - expected(s, &f->r->reading[i])) / measure(f, i);
    }
    double freedom = fmax(n - REST - f->r->plates - f->r->photos, 0.5 * n) / n; /* what the fit took out of the residuals */
    f->scale = fmax(1.4826 * tsuya_lamp_median(scratch, n) / sqrt(freedom), 1e-3);
    for (int i = 0; i < n; i++) {
        double e = (f->value[i] - expected(s, &f->r->reading[i])) / measure(f, i) / (2.385 * f->scale);
        f->weight[i] = 1.0 / (f->scale * sqrt(1.0 + e * e));
    }
}

/* A place on a sphere, spread evenly (golden angle). */
static tsuya_vec3 direction_of(int k, int count)
{
    double z = 1.0 - 2.0 * (k + 0.5) / count, a = 2.399963229728653 * k, r = sqrt(1.0 - z * z);
    return (tsuya_vec3){r * cos(a), r * sin(a), z};
}

static int lit(const fit *f, tsuya_vec3 u)
{
    int count = 0;
    for (int i = 0; i < f->r->count; i++) {
        count += tsuya_vec3_dot(f->r->reading[i].normal, u) > 0.0;
    }
    return count;
}

static void begin_at(state *s, const fit *f, tsuya_vec3 u, double inverse_m)
{
    memset(s, 0, state_bytes(f));
    s->m = (model){.to_lamp = u, .axis = tsuya_vec3_scale(u, -1.0), .inverse_m = inverse_m, .power = 2.0};
    s->f = f;
    double sum = 0.0;
    for (int i = 0; i < f->r->count; i++) {
        sum += direct(&s->m, f, &f->r->reading[i]);
    }
    s->m.level = log(f->typical * f->r->count / fmax(sum, 1e-6 * f->r->count));
}

/* The best bare points from many places. */
static tsuya_status start(state *best[KEPT], double cost[KEPT], fit *f, state *trial, double *nudge)
{
    static const double distance[] = {1.0, 2.5, 8.0};
    f->free_lobe = f->free_extra = false;
    for (int i = 0; i < f->r->count; i++) {
        f->weight[i] = 1.0 / 0.1;
    }
    for (int k = 0; k < 3 * STARTS; k++) {
        tsuya_vec3 u = direction_of(k / 3, STARTS);
        double reached;
        if (2 * lit(f, u) < f->r->count) {
            continue;
        }
        begin_at(trial, f, u, 1.0 / (distance[k % 3] * f->extent_m));
        tsuya_lamp_problem p = problem_of(f, trial, nudge);
        TSUYA_TRY(tsuya_lamp_descend(&reached, &p, 8));
        int at = KEPT;
        for (; at > 0 && reached < cost[at - 1]; at--) {
        }
        if (at == KEPT || (at > 0 && reached > 0.999 * cost[at - 1])) {
            continue; /* no better, or the same place again */
        }
        state *last = best[KEPT - 1];
        memmove(&best[at + 1], &best[at], (size_t)(KEPT - 1 - at) * sizeof *best);
        memmove(&cost[at + 1], &cost[at], (size_t)(KEPT - 1 - at) * sizeof *cost);
        best[at] = last;
        cost[at] = reached;
        memcpy(last, trial, state_bytes(f));
    }
    return TSUYA_OK;
}

/* Everything free; gains' scatter from the gains themselves. */
static tsuya_status polish(state *s, fit *f, double *nudge, double *scratch, double *covariance)
{
    double cost;
    f->free_lobe = f->free_extra = true;
    f->gain_sigma = FIRST_GAIN;
    f->sigma_px = FIRST_SIGMA_PX;
    s->m.falloff = s->m.falloff > 0.0 ? s->m.falloff : 0.5;
    int first = f->r->plates - 1, n = REST + f->extras;
    for (int round = 0; round < ROUNDS; round++) {
        tsuya_lamp_problem p = problem_of(f, s, nudge);
        reweigh(f, s, scratch);
        TSUYA_TRY(tsuya_lamp_descend(&cost, &p, 25));
        if (f->balls) {
            tsuya_lamp_place place = place_of(s);
            f->sigma_px = tsuya_lamp_ball_sigma(f->balls, &place, s->extra + f->first_shift, f->sigma_px);
        }
        if (round % 2 == 1 && tsuya_lamp_covariance(covariance, &p) == TSUYA_OK) {
            double sum = 0.0;
            for (int k = first; k < f->first_shift; k += OWN) {
                sum += s->extra[k] * s->extra[k] + covariance[(REST + k) * (n + 1)];
            }
            f->gain_sigma = fmin(fmax(sqrt(sum / f->r->photos), LEAST_GAIN), 0.1);
        }
    }
    return TSUYA_OK;
}

static double robust_cost(const fit *f, const state *s, double *scratch)
{
    for (int i = 0; i < f->r->count; i++) {
        scratch[i] = fabs(f->value[i] - expected(s, &f->r->reading[i])) / measure(f, i);
    }
    return 1.4826 * tsuya_lamp_median(scratch, f->r->count);
}

/* What the readings must offer before anything is solved. */
static tsuya_status check_readings(const tsuya_lamp_readings *r, bool balls)
{
    if (2 * r->clipped > r->count + r->clipped) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "the white of %d of %d tags is clipped; expose less (white at 80 %% of the range at most)", r->clipped,
                          r->count + r->clipped);
    }
    if (r->count < FEWEST_READINGS) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%d tags are large enough to read their white, %d are too small (cells under 6 px); %d are needed", r->count, r->small,
                          FEWEST_READINGS);
    }
    double turn = 0.0, low = INFINITY, high = -INFINITY, extent = 0.0;
    const tsuya_lamp_reading *first = &r->reading[0];
    for (int i = 0; i < r->count; i++) {
        double c = tsuya_vec3_dot(r->reading[i].normal, first->normal), h = tsuya_vec3_dot(tsuya_vec3_sub(r->reading[i].position_m, first->position_m), first->normal);
        turn = fmax(turn, acos(fmin(c, 1.0)));
        low = fmin(low, h);
        high = fmax(high, h);
        extent = fmax(extent, tsuya_vec3_norm(tsuya_vec3_sub(r->reading[i].position_m, first->position_m)));
    }
    if (!balls && turn < tsuya_rad_from_deg(LEAST_TURN_DEG) && high - low < 0.25 * extent) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "the plate lies in one plane in all photographs (turned by %.0f degrees at most), which gives no lamp; "
                          "tilt it by 30 degrees and more to several sides", tsuya_deg_from_rad(turn));
    }
    return TSUYA_OK;
}

static double luminance(const double rgb[3]) { return 0.25 * rgb[0] + 0.5 * rgb[1] + 0.25 * rgb[2]; }

static tsuya_status prepare(fit *f, const tsuya_lamp_readings *r, double *scratch)
{
    for (int i = 0; i < r->count; i++) {
        f->middle = tsuya_vec3_mad(f->middle, 1.0 / r->count, r->reading[i].position_m);
        f->plate_middle_m.x += r->reading[i].place_m.x / r->count;
        f->plate_middle_m.y += r->reading[i].place_m.y / r->count;
        f->value[i] = scratch[i] = luminance(r->reading[i].rgb);
    }
    f->typical = tsuya_lamp_median(scratch, r->count);
    double sum = 0.0, on_plate = 0.0;
    for (int i = 0; i < r->count; i++) {
        tsuya_vec3 d = tsuya_vec3_sub(r->reading[i].position_m, f->middle);
        double u = r->reading[i].place_m.x - f->plate_middle_m.x, v = r->reading[i].place_m.y - f->plate_middle_m.y;
        sum += tsuya_vec3_dot(d, d) / r->count;
        on_plate += (u * u + v * v) / r->count;
    }
    f->extent_m = sqrt(sum);
    f->plate_m = fmax(sqrt(on_plate), 1e-6);
    if (!(f->typical > UNLIT)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "the plate is not lit: its white stands at %.2f %% of the range; the lamp must light the side of the tags",
                          100.0 * f->typical);
    }
    return TSUYA_OK;
}

/* White that is alike however the plate is turned, but for the lens' fall-off, is lit by the room. */
static tsuya_status check_changes(const fit *f, double *scratch)
{
    double n = f->r->count, sr = 0.0, sv = 0.0, srr = 0.0, srv = 0.0;
    for (int i = 0; i < f->r->count; i++) {
        double r2 = f->r->reading[i].radius2, v = log(fmax(f->value[i], 1e-6));
        sr += r2 / n, sv += v / n, srr += r2 * r2 / n, srv += r2 * v / n;
    }
    double slope = f->free_vignetting ? (srv - sr * sv) / fmax(srr - sr * sr, 1e-9) : 0.0;
    for (int i = 0; i < f->r->count; i++) {
        scratch[i] = fabs(log(fmax(f->value[i], 1e-6)) - sv - slope * (f->r->reading[i].radius2 - sr));
    }
    double spread = 1.4826 * tsuya_lamp_median(scratch, f->r->count);
    if (spread < ALIKE) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "the plate's white stays within %.1f %% however it is turned: the room lights it, no lamp does; darken the room, and "
                          "tilt the plate more", 100.0 * spread);
    }
    return TSUYA_OK;
}

/* Channels one by one: with the geometry known, level and ambient of each are linear. */
static void split_channels(tsuya_lamp *lamp, const fit *f, const state *s, double reflectance)
{
    for (int c = 0; c < 3; c++) {
        double a[3] = {0, 0, 0}, b[2] = {0, 0};
        for (int i = 0; i < f->r->count; i++) {
            const tsuya_lamp_reading *r = &f->r->reading[i];
            double w = f->weight[i] / measure(f, i), k = factor(&s->m, s->extra, f, r), d = w * k * direct(&s->m, f, r), one = w * k, value = w * r->rgb[c];
            a[0] += d * d, a[1] += d * one, a[2] += one * one, b[0] += d * value, b[1] += one * value;
        }
        double det = a[0] * a[2] - a[1] * a[1], level = (a[2] * b[0] - a[1] * b[1]) / det, ambient = (a[0] * b[1] - a[1] * b[0]) / det;
        /* The luminance's fit knows the ambient light better than one channel does. */
        ambient = fabs(s->m.ambient) < 1e-12 ? 0.0 : ambient;
        lamp->ambient[c] = ambient;
        lamp->rgb[c] = level * M_PI / reflectance;
        for (int i = 0; i < f->r->count; i++) {
            tsuya_lamp_reading *r = &f->r->reading[i];
            r->expected[c] = factor(&s->m, s->extra, f, r) * (level * direct(&s->m, f, r) + ambient);
        }
    }
}

static void count_readings(tsuya_lamp *lamp, const fit *f, const state *s)
{
    double sum = 0.0;
    int photo = -1;
    lamp->cos_least = 1.0;
    lamp->cos_most = 0.0;
    for (int i = 0; i < f->r->count; i++) {
        tsuya_lamp_reading *r = &f->r->reading[i];
        double e = (f->value[i] - expected(s, r)) / measure(f, i);
        r->outlier = fabs(e) > 4.0 * f->scale;
        lamp->readings++;
        lamp->outliers += r->outlier;
        lamp->photos += r->photo != photo;
        photo = r->photo;
        if (!r->outlier) {
            tsuya_vec3 v = way(&s->m, f, r);
            double c = -tsuya_vec3_dot(v, s->m.axis) / tsuya_vec3_norm(v);
            sum += e * e;
            lamp->cos_least = fmin(lamp->cos_least, fmax(c, 0.0));
            lamp->cos_most = fmax(lamp->cos_most, c);
        }
    }
    lamp->rms = sqrt(sum / fmax(lamp->readings - lamp->outliers, 1));
}

static double worst(const double *c, int n, int at)
{
    double a = c[at * n + at], b = c[at * n + at + 1], d = c[(at + 1) * n + at + 1];
    return sqrt(0.5 * (a + d) + hypot(0.5 * (a - d), b));
}

/* position = middle + to_lamp / inverse: its covariance from that of the turn and of the inverse. */
static void set_position(tsuya_lamp *lamp, const fit *f, const state *s, const double *c, int n)
{
    tsuya_vec3 t[2];
    double d = 1.0 / fmax(s->m.inverse_m, 1e-9), by[3][3];
    tsuya_lamp_tangents(t, s->m.to_lamp);
    for (int i = 0; i < 3; i++) {
        double u = (&s->m.to_lamp.x)[i];
        by[i][0] = d * (&t[0].x)[i], by[i][1] = d * (&t[1].x)[i], by[i][2] = -d * d * u;
    }
    for (int i = 0; i < 9; i++) {
        lamp->position_cov_m2[i] = 0.0;
        for (int a = 0; a < 9; a++) {
            lamp->position_cov_m2[i] += by[i / 3][a / 3] * c[(TO_LAMP + a / 3) * n + TO_LAMP + a % 3] * by[i % 3][a % 3];
        }
    }
    lamp->distance_m = d;
    lamp->distance_sigma_m = d * d * sqrt(c[INVERSE * (n + 1)]);
    lamp->to_lamp = s->m.to_lamp;
    lamp->position_m = tsuya_vec3_mad(f->middle, d, s->m.to_lamp);
    lamp->to_lamp_sigma_deg = tsuya_deg_from_rad(worst(c, n, TO_LAMP));
}

static tsuya_status check_solution(tsuya_lamp *lamp, const fit *f, const state *s, const double *c, int n)
{
    int grazing = 0;
    for (int i = 0; i < f->r->count; i++) {
        tsuya_vec3 v = way(&s->m, f, &f->r->reading[i]);
        grazing += tsuya_vec3_dot(v, f->r->reading[i].normal) < GRAZING * tsuya_vec3_norm(v);
    }
    if (2 * grazing > f->r->count) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "the lamp stands in the plate's plane or behind it in %d of %d readings; turn the plate towards the lamp", grazing, f->r->count);
    }
    if (f->scale > MISFIT) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "the plate's white does not fit one lamp (%.0f %% off); several lamps, a shiny plate, or, with one plate, a camera "
                          "that was moved", 100.0 * f->scale);
    }
    double sigma = sqrt(c[INVERSE * (n + 1)]), nearest = 1.0 / (s->m.inverse_m + 2.0 * sigma);
    lamp->far_away = sigma > 0.2 * s->m.inverse_m;
    if (lamp->far_away && (nearest < 2.5 * f->extent_m || lamp->to_lamp_sigma_deg > 5.0)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "the photographs do not determine the lamp (distance %.2f m and more, direction within %.1f degrees); more tilts, "
                          "and the plate nearer to and farther from the lamp", nearest, lamp->to_lamp_sigma_deg);
    }
    return TSUYA_OK;
}

/* A fit of its own with the distance's exponent free. */
static tsuya_status check_power(tsuya_lamp *lamp, fit *f, state *trial, const state *s, double *nudge, double *covariance)
{
    double cost;
    int n = REST + f->extras;
    memcpy(trial, s, state_bytes(f));
    f->free_power = true;
    tsuya_lamp_problem p = problem_of(f, trial, nudge);
    TSUYA_TRY(tsuya_lamp_descend(&cost, &p, 40));
    TSUYA_TRY(tsuya_lamp_covariance(covariance, &p));
    f->free_power = false;
    lamp->distance_exponent = trial->m.power;
    lamp->distance_exponent_sigma = sqrt(covariance[POWER * (n + 1)]);
    return TSUYA_OK;
}

static tsuya_status finish(tsuya_lamp *lamp, fit *f, state *s, state *trial, double *nudge, double *covariance, const tsuya_lamp_options *options)
{
    int n = REST + f->extras;
    tsuya_lamp_problem p = problem_of(f, s, nudge);
    TSUYA_TRY(tsuya_lamp_covariance(covariance, &p));
    *lamp = (tsuya_lamp){.has_intensity = true, .falloff = s->m.falloff, .direction = s->m.axis, .gain_sigma = f->gain_sigma, .vignetting = s->m.vignetting};
    set_position(lamp, f, s, covariance, n);
    lamp->falloff_sigma = sqrt(covariance[FALLOFF * (n + 1)]);
    lamp->direction_sigma_deg = tsuya_deg_from_rad(worst(covariance, n, AXIS));
    TSUYA_TRY(check_solution(lamp, f, s, covariance, n));
    double by_inverse = lamp->far_away ? 0.0 : -2.0 * lamp->distance_m;
    lamp->rgb_sigma_rel = sqrt(fmax(covariance[LEVEL * (n + 1)] + 2.0 * by_inverse * covariance[LEVEL * n + INVERSE] +
                                    by_inverse * by_inverse * covariance[INVERSE * (n + 1)], 0.0));
    count_readings(lamp, f, s);
    split_channels(lamp, f, s, options->reflectance);
    for (int c = 0; c < 3; c++) { /* the level stands for the middle: intensity is what makes it there */
        lamp->rgb[c] *= lamp->far_away ? 1.0 : lamp->distance_m * lamp->distance_m;
    }
    TSUYA_TRY(check_power(lamp, f, trial, s, nudge, covariance));
    if (f->balls) {
        tsuya_lamp_place place = place_of(s);
        tsuya_lamp_ball_settle(lamp, options->balls, &place, s->extra + f->first_shift);
    }
    return TSUYA_OK;
}

tsuya_lamp_options tsuya_lamp_options_default(void) { return (tsuya_lamp_options){.reflectance = 0.85}; }

tsuya_status tsuya_lamp_fit(tsuya_lamp *lamp, tsuya_lamp_readings *r, const tsuya_lamp_options *options)
{
    tsuya_status status = TSUYA_OK;
    fit f = {.r = r, .free_vignetting = !options->vignetting_known, .first_shift = r->plates - 1 + OWN * r->photos, .balls = options->balls, .sigma_px = FIRST_SIGMA_PX, .gain_sigma = FIRST_GAIN, .scale = 0.1};
    state *best[KEPT] = {0}, *trial = NULL;
    double cost[KEPT], *nudge = NULL, *scratch = NULL, *covariance = NULL, least = INFINITY;
    f.extras = f.first_shift + (f.balls ? 2 * f.balls->balls : 0);
    TSUYA_TRY(check_readings(r, options->balls != NULL));
    size_t n = (size_t)(REST + f.extras);
    TSUYA_NEW(status, f.value, (size_t)r->count);
    TSUYA_NEW(status, f.weight, (size_t)r->count);
    TSUYA_NEW(status, scratch, (size_t)r->count);
    TSUYA_NEW(status, nudge, n);
    TSUYA_NEW(status, covariance, n * n);
    for (int k = 0; k <= KEPT; k++) {
        state **place = k < KEPT ? &best[k] : &trial;
        *place = tsuya_calloc(1, state_bytes(&f));
        if (!*place) {
            status = TSUYA_ERROR_MEMORY;
            goto done;
        }
        if (k < KEPT) {
            cost[k] = INFINITY;
        }
    }
    TSUYA_GOTO_DONE(status, prepare(&f, r, scratch));
    if (!f.balls) {
        TSUYA_GOTO_DONE(status, check_changes(&f, scratch));
    }
    TSUYA_GOTO_DONE(status, start(best, cost, &f, trial, nudge));
    int chosen = -1;
    for (int k = 0; k < KEPT && isfinite(cost[k]); k++) {
        TSUYA_GOTO_DONE(status, polish(best[k], &f, nudge, scratch, covariance));
        double reached = robust_cost(&f, best[k], scratch);
        chosen = reached < least ? k : chosen;
        least = fmin(least, reached);
    }
    if (chosen < 0) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "no place of a lamp lights half of the plate's readings; turn the plate towards the lamp");
        goto done;
    }
    TSUYA_GOTO_DONE(status, polish(best[chosen], &f, nudge, scratch, covariance));
    reweigh(&f, best[chosen], scratch);
    TSUYA_GOTO_DONE(status, finish(lamp, &f, best[chosen], trial, nudge, covariance, options));
done:
    for (int k = 0; k < KEPT; k++) {
        tsuya_free(best[k]);
    }
    tsuya_free(trial);
    tsuya_free(f.value);
    tsuya_free(f.weight);
    tsuya_free(scratch);
    tsuya_free(nudge);
    tsuya_free(covariance);
    return status;
}
