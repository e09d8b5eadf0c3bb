#include "brdf/plan.h"

#include "brdf/model.h"
#include "brdf/sheen.h"
#include "core/memory.h"

#include <math.h>
#include <string.h>

enum { MOST_POSITIONS = 8000 };

/* Standard deviations of the logarithm, and lengths in radians over which the changes hang together; trend: variance of level and slope along
 * a yarn; slant_length: of the light's difference, as in brdf/sheen.h. */
static const struct { double along, across, strength, rest, trend, along_length, across_length, rest_length, slant_length; } prior = {
    0.8, 0.5, 0.5, 0.3, 8.0, 0.15, 0.35, 0.25, 0.1};
static const double lowest_cosine = 0.17364817766693041; /* 80° */

tsuya_plan_options tsuya_plan_options_default(void)
{
    return (tsuya_plan_options){{30.0, 0.0}, {30.0, 180.0}, 7.5, 1.5, 48.0, 0.01, 132};
}

typedef struct position {
    double azimuth_deg, tilt_deg;
    double psi[2];  /* half vector's inclination along weft and warp */
    double slant[2]; /* squares of the light's difference along weft and warp */
    double part[2]; /* of the light there, of warp and weft */
    double slope;   /* of ∛(f cosθi) by log f: a third of it */
} position;

/* A yarn material says whose light it is; of others nothing is known, and each yarn has half. */
static void set_parts(position *p, const tsuya_material *m, const tsuya_half_angles *a, double value)
{
    bool sheen = m->model == &tsuya_brdf_yarn || m->model == &tsuya_brdf_ndf || m->model == &tsuya_brdf_nurbs3;
    p->part[0] = p->part[1] = 0.5;
    if (!sheen) {
        return;
    }
    const tsuya_sheen *s = m->state;
    double yarn[2], light[2] = {0.0, 0.0}, matte = 0.0;
    tsuya_sheen_yarns(yarn, s, a);
    for (int c = 0; c < s->channels; ++c) {
        light[0] += s->strength[0][c] * exp(yarn[0]) * a->falloff / s->channels;
        light[1] += s->strength[1][c] * exp(yarn[1]) * a->falloff / s->channels;
        matte += s->matte[c] * a->falloff / s->channels;
    }
    double sum = fmax(light[0] + light[1] + matte, value);
    for (int y = 0; y < 2; ++y) {
        p->part[y] = 0.5 * (sum > 0.0 ? light[y] / sum : 0.0) + 0.25; /* a prediction may miss whose light it is */
    }
}

static bool set_position(position *p, const tsuya_material *m, tsuya_vec3 wi, tsuya_vec3 wo)
{
    double value[TSUYA_MATERIAL_MAX_CHANNELS], mean = 0.0;
    tsuya_half_angles a = tsuya_half_angles_of(wi, wo);
    if (wi.z < lowest_cosine || wo.z < lowest_cosine) {
        return false;
    }
    tsuya_material_eval(m, NULL, wi, wo, value);
    for (int c = 0; c < m->channel_count; ++c) {
        mean += value[c] / m->channel_count;
    }
    p->psi[0] = a.psi_t;
    p->psi[1] = a.psi_b;
    p->slant[0] = a.dt2;
    p->slant[1] = a.db2;
    p->slope = cbrt(mean * wi.z) / 3.0;
    set_parts(p, m, &a, mean);
    return true;
}

static double bell(double difference, double length) { return exp(-0.5 * difference * difference / (length * length)); }

/* What a cubic smoothing spline believes of a curve: a straight line, and bends that grow away from what is known (Wahba, "Spline models for
 * observational data", 1990).  A bell would forget them there, where the fit leads the curve on and is wrong. */
static double bend(double x, double y)
{
    double a = x + 0.5 * M_PI, b = y + 0.5 * M_PI, low = fmin(a, b), high = fmax(a, b);
    double rough = 3.0 * prior.along * prior.along / pow(prior.along_length, 3);
    return rough * low * low * (3.0 * high - low) / 6.0 + prior.trend * (1.0 + a * b);
}

static double covariance(const position *p, const position *q)
{
    double dt = p->psi[0] - q->psi[0], db = p->psi[1] - q->psi[1], sum = 0.0;
    for (int y = 0; y < 2; ++y) { /* the warp runs along b */
        int along = y == 0 ? 1 : 0;
        double across = y == 0 ? dt : db;
        double own = bend(p->psi[along], q->psi[along]) * bell(across, 2.0 * prior.across_length) +
                     prior.across * prior.across * bell(across, prior.across_length) + prior.strength * prior.strength;
        sum += p->part[y] * q->part[y] * own;
    }
    /* one half vector belongs to many pairs of directions: at the mirror position, to every azimuth */
    double slant = bell(hypot(p->slant[0] - q->slant[0], p->slant[1] - q->slant[1]), prior.slant_length);
    sum += prior.rest * prior.rest * bell(hypot(dt, db), prior.rest_length) * (1.0 + slant);
    return p->slope * q->slope * sum;
}

static tsuya_status list_positions(position **list, int *count, const tsuya_material *m, const tsuya_plan_options *o)
{
    int turns = (int)ceil(180.0 / o->azimuth_step_deg - 1e-9), side = (int)floor(o->tilt_most_deg / o->tilt_step_deg + 1e-9);
    *count = 0;
    if (!(turns >= 1 && side >= 0 && turns <= MOST_POSITIONS && (double)turns * (2.0 * side + 1.0) <= MOST_POSITIONS)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "stage: azimuths every %g° and tilts every %g° to ±%g°: expected 1 to %d positions", o->azimuth_step_deg,
                          o->tilt_step_deg, o->tilt_most_deg, MOST_POSITIONS);
    }
    *list = tsuya_calloc((size_t)turns * (2 * (size_t)side + 1), sizeof **list);
    if (!*list) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int k = 0; k < turns * (2 * side + 1); ++k) {
        double a = o->azimuth_step_deg * (k / (2 * side + 1)), t = o->tilt_step_deg * (k % (2 * side + 1) - side);
        position *p = &(*list)[*count];
        p->azimuth_deg = a;
        p->tilt_deg = t;
        *count += set_position(p, m, tsuya_goniometer_direction(o->light_deg[0], o->light_deg[1], a, t),
                               tsuya_goniometer_direction(o->view_deg[0], o->view_deg[1], a, t));
    }
    return TSUYA_OK;
}

static double noise_of(const position *p, double relative, double brightest)
{
    double own = relative * p->slope, floor_noise = 0.02 * relative * brightest;
    return own * own + floor_noise * floor_noise;
}

/* Covariance after a reading whose covariances with every position are `column`. */
static void update(double *matrix, int n, const double *column, double variance)
{
#pragma omp parallel for schedule(static)
    for (int i = 0; i < n; ++i) {
        double factor = column[i] / variance;
        for (int j = 0; j < n; ++j) {
            matrix[(size_t)i * (size_t)n + (size_t)j] -= factor * column[j];
        }
    }
}

/* Readings so far are taken at the nearest position, or are of no help where there is none within two degrees of half vector. */
static int nearest_position(const position *list, int n, const position *p)
{
    int best = -1;
    double least = 0.035;
    for (int k = 0; k < n; ++k) {
        double d = hypot(list[k].psi[0] - p->psi[0], list[k].psi[1] - p->psi[1]);
        if (d < least) {
            least = d;
            best = k;
        }
    }
    return best;
}

static void gains_of(double *gain, const double *matrix, const position *list, int n, double noise, double brightest)
{
#pragma omp parallel for schedule(static)
    for (int k = 0; k < n; ++k) {
        const double *row = matrix + (size_t)k * (size_t)n;
        double sum = 0.0;
        for (int j = 0; j < n; ++j) {
            sum += row[j] * row[j];
        }
        gain[k] = sum / (fmax(row[k], 0.0) + noise_of(&list[k], noise, brightest));
    }
}

typedef struct design {
    position *list;
    int n;
    double *matrix, *column, *gain, scale, brightest;
    const tsuya_plan_options *options;
} design;

static void observe(design *d, int k)
{
    memcpy(d->column, d->matrix + (size_t)k * (size_t)d->n, (size_t)d->n * sizeof *d->column);
    update(d->matrix, d->n, d->column, fmax(d->column[k], 0.0) + noise_of(&d->list[k], d->options->noise, d->brightest));
}

/* A cube root whose logarithm is known to v is known to a third of √v, and never worse than to itself. */
static double expected(const design *d)
{
    double sum = 0.0;
    for (int k = 0; k < d->n; ++k) {
        double own = 9.0 * d->list[k].slope * d->list[k].slope;
        sum += own > 0.0 ? own * -expm1(-fmax(d->matrix[(size_t)k * (size_t)d->n + (size_t)k], 0.0) / own) : 0.0;
    }
    return d->scale > 0.0 ? sqrt(sum / d->scale) : 0.0;
}

/* A prediction may also miss a lobe, or see one that is not there: no place counts for less than half of the mean, or more than one and
 * a half of it. */
static void level(position *list, int n)
{
    double mean = 0.0;
    for (int k = 0; k < n; ++k) {
        mean += list[k].slope / n;
    }
    for (int k = 0; k < n; ++k) {
        list[k].slope = fmin(fmax(list[k].slope, 0.5 * mean), 1.5 * mean);
    }
}

static void prepare(design *d, const tsuya_material *m, const tsuya_samples *taken)
{
    level(d->list, d->n);
    for (int k = 0; k < d->n; ++k) {
        d->scale += 9.0 * d->list[k].slope * d->list[k].slope;
        d->brightest = fmax(d->brightest, d->list[k].slope);
        for (int j = 0; j < d->n; ++j) {
            d->matrix[(size_t)k * (size_t)d->n + (size_t)j] = covariance(&d->list[k], &d->list[j]);
        }
    }
    for (int k = 0; taken && k < taken->count; ++k) {
        position p;
        int at = set_position(&p, m, taken->wi[k], taken->wo[k]) ? nearest_position(d->list, d->n, &p) : -1;
        if (at >= 0) {
            observe(d, at);
        }
    }
}

static void choose(tsuya_plan_reading *chosen, design *d)
{
    double before = expected(d);
    for (int r = 0; r < d->options->readings; ++r) {
        int best = 0;
        gains_of(d->gain, d->matrix, d->list, d->n, d->options->noise, d->brightest);
        for (int k = 1; k < d->n; ++k) {
            best = d->gain[k] > d->gain[best] * (1.0 + 1e-9) ? k : best;
        }
        observe(d, best);
        double after = expected(d);
        chosen[r] = (tsuya_plan_reading){d->list[best].azimuth_deg, d->list[best].tilt_deg, before - after};
        before = after;
    }
}

tsuya_status tsuya_plan(tsuya_plan_reading *chosen, tsuya_plan_info *info, const tsuya_material *predicted, const tsuya_samples *taken,
                        const tsuya_plan_options *options)
{
    design d = {.options = options};
    tsuya_status status;
    TSUYA_GOTO_DONE(status, list_positions(&d.list, &d.n, predicted, options));
    if (options->readings < 1 || options->readings > d.n) {
        TSUYA_GOTO_DONE(status, tsuya_fail(TSUYA_ERROR_INPUT, "%d readings: the stage has %d positions with lamp and camera 10° above the cloth", options->readings, d.n));
    }
    TSUYA_NEW(status, d.matrix, (size_t)d.n * (size_t)d.n);
    TSUYA_NEW(status, d.column, (size_t)d.n);
    TSUYA_NEW(status, d.gain, (size_t)d.n);
    prepare(&d, predicted, taken);
    info->positions = d.n;
    info->expected_before = expected(&d);
    choose(chosen, &d);
    info->expected_after = expected(&d);
done:
    tsuya_free(d.list);
    tsuya_free(d.matrix);
    tsuya_free(d.column);
    tsuya_free(d.gain);
    return status;
}
