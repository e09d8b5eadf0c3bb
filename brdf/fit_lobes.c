/* The strengths of lobe and diffuse part are found inside (two non-negative unknowns a channel, reweighted least squares); the
 * shape by a grid and a compass search from its best nodes. */
#include "brdf/fit_lobes.h"

#include "brdf/lobe.h"
#include "core/memory.h"

#include <stdlib.h>
#include <string.h>

/* Shapes are searched for with as many samples as the first, strengths are found with as many as the second. */
enum { GRID = 9, SEARCHED = 3000, SUBSET = 20000, REWEIGHTS = 6, STARTS = 3 };

typedef struct family {
    const tsuya_brdf_model *model;
    int shapes;
    double low, high;  /* logarithms of the shape's range */
    double highest_strength;
} family;

static tsuya_status make_state(void **state, const family *f, const double *log_shape, int channels, const double *strength)
{
    double a = exp(log_shape[0]), b = f->shapes > 1 ? exp(log_shape[1]) : a;
    if (f->model == &tsuya_brdf_ggx || f->model == &tsuya_brdf_ggx_aniso) {
        return tsuya_ggx_create(state, channels, a, b, 1.5, strength);
    }
    return tsuya_lobe_create(state, channels, a, b, strength);
}

typedef struct problem {
    const family *family;
    const tsuya_samples *samples;
    int stride, count; /* every stride-th sample */
    double *lobe;      /* count: the lobe at strength 1 */
    double *root, *edge; /* ∛(f cosθi) of every value at scale; ∛cos²θi */
    double *strength, *diffuse, scale;
} problem;

/* kd, ks of one channel for the lobe at hand; returns Σ (∛ − ∛)². */
static double fit_channel(const problem *p, int c)
{
    const tsuya_samples *s = p->samples;
    double kd = 0.0, ks = 0.0, error = 0.0;
    for (int round = 0; round <= REWEIGHTS; ++round) {
        double a = 0.0, b = 0.0, d = 0.0, u = 0.0, v = 0.0;
        for (int i = 0; i < p->count; ++i) {
            int k = i * p->stride;
            double f = s->value[k * s->channel_count + c] / p->scale, cosine = s->wi[k].z, l = p->lobe[i], g = kd / M_PI + ks * l;
            if (isnan(f)) {
                continue;
            }
            if (round == REWEIGHTS) {
                double difference = cbrt(g * cosine) - p->root[k * s->channel_count + c];
                error += difference * difference;
                continue;
            }
            double at = fmax(round == 0 ? f : 0.5 * (g + f), 1e-4), w = p->edge[k] / (at * cbrt(at));
            a += w / (M_PI * M_PI);
            b += w * l / M_PI;
            d += w * l * l;
            u += w * f / M_PI;
            v += w * f * l;
        }
        if (round == REWEIGHTS) {
            break;
        }
        double det = a * d - b * b;
        kd = det > 1e-12 * a * d ? (u * d - v * b) / det : 0.0;
        ks = det > 1e-12 * a * d ? (v * a - u * b) / det : 0.0;
        if (!(kd >= 0.0) || det <= 1e-12 * a * d) {
            kd = 0.0;
            ks = d > 0.0 ? v / d : 0.0;
        }
        if (!(ks >= 0.0) || d == 0.0) {
            ks = 0.0;
            kd = a > 0.0 ? u / a : 0.0;
        }
        ks = fmin(ks, p->family->highest_strength / p->scale);
        kd = fmin(fmax(d > 0.0 || a == 0.0 ? kd : u / a, 0.0), 1.0 / p->scale);
    }
    p->strength[c] = ks * p->scale;
    p->diffuse[c] = kd * p->scale;
    return error;
}

static tsuya_status objective(double *error, const problem *p, const double *log_shape)
{
    const double tiny = 1e-6;
    void *state = NULL;
    memset(p->lobe, 0, (size_t)p->count * sizeof *p->lobe);
    if (p->family->shapes > 0) {
        TSUYA_TRY(make_state(&state, p->family, log_shape, 1, &tiny));
        for (int i = 0; i < p->count; ++i) {
            int k = i * p->stride;
            p->family->model->eval(state, 1, p->samples->wi[k], p->samples->wo[k], &p->lobe[i]);
            p->lobe[i] /= tiny;
        }
        p->family->model->free_state(state);
    }
    *error = 0.0;
    for (int c = 0; c < p->samples->channel_count; ++c) {
        *error += fit_channel(p, c);
    }
    return TSUYA_OK;
}

static tsuya_status compass(double *shape, double *best, const problem *p)
{
    const family *f = p->family;
    for (double step = 0.5 * (f->high - f->low) / (GRID - 1); step > 1e-3;) {
        bool moved = false;
        for (int k = 0; k < 2 * f->shapes; ++k) {
            double trial[2] = {shape[0], shape[1]}, error;
            trial[k / 2] = fmin(fmax(trial[k / 2] + (k % 2 ? -step : step), f->low), f->high);
            TSUYA_TRY(objective(&error, p, trial));
            if (error < *best) {
                *best = error;
                memcpy(shape, trial, sizeof trial);
                moved = true;
            }
        }
        step = moved ? step : 0.5 * step;
    }
    return TSUYA_OK;
}

/* The best nodes of the grid, apart from each other's neighbours. */
static tsuya_status search(double *shape, const problem *p)
{
    const family *f = p->family;
    double error[GRID * GRID], best = INFINITY;
    int nodes = f->shapes == 1 ? GRID : GRID * GRID;
    for (int k = 0; k < nodes; ++k) {
        const double at[2] = {f->low + (f->high - f->low) * (k % GRID) / (GRID - 1), f->low + (f->high - f->low) * (k / GRID) / (GRID - 1)};
        TSUYA_TRY(objective(&error[k], p, at));
    }
    for (int start = 0; start < STARTS; ++start) {
        int lowest = 0;
        for (int k = 1; k < nodes; ++k) {
            lowest = error[k] < error[lowest] ? k : lowest;
        }
        double at[2] = {f->low + (f->high - f->low) * (lowest % GRID) / (GRID - 1), f->low + (f->high - f->low) * (lowest / GRID) / (GRID - 1)};
        double found = error[lowest];
        for (int k = 0; k < nodes; ++k) {
            bool near = abs(k % GRID - lowest % GRID) <= 1 && abs(k / GRID - lowest / GRID) <= 1;
            error[k] = near ? INFINITY : error[k];
        }
        if (!isfinite(found)) {
            break;
        }
        TSUYA_TRY(compass(at, &found, p));
        if (found < best) {
            best = found;
            memcpy(shape, at, sizeof at);
        }
    }
    return TSUYA_OK;
}

static family family_of(const tsuya_brdf_model *model)
{
    if (model == &tsuya_brdf_ashikhmin) {
        return (family){model, 2, log(0.3), log(3000.0), 1.0};
    }
    int shapes = model == &tsuya_brdf_lambert ? 0 : model == &tsuya_brdf_ggx ? 1 : 2;
    return (family){model, shapes, log(0.02), log(1.0), 1.0};
}

static void take_every(problem *p, int at_most)
{
    p->stride = (p->samples->count + at_most - 1) / at_most;
    p->count = (p->samples->count + p->stride - 1) / p->stride;
}

static void take_roots(problem *p)
{
    const tsuya_samples *s = p->samples;
    for (int k = 0; k < s->count * s->channel_count; ++k) {
        p->scale = s->value[k] > p->scale ? s->value[k] : p->scale;
    }
    p->scale = p->scale > 0.0 ? p->scale : 1.0;
    for (int k = 0; k < s->count; ++k) {
        p->edge[k] = cbrt(s->wi[k].z * s->wi[k].z);
        for (int c = 0; c < s->channel_count; ++c) {
            p->root[k * s->channel_count + c] = cbrt(s->value[k * s->channel_count + c] / p->scale * s->wi[k].z);
        }
    }
}

tsuya_status tsuya_fit_lobe(void **state, double *diffuse, const tsuya_brdf_model *model, const tsuya_samples *samples)
{
    tsuya_status status = TSUYA_OK;
    family f = family_of(model);
    problem p = {.family = &f, .samples = samples, .diffuse = diffuse, .scale = 0.0};
    double shape[2] = {0.0, 0.0}, error;
    take_every(&p, SUBSET);
    TSUYA_NEW(status, p.lobe, (size_t)p.count);
    TSUYA_NEW(status, p.strength, (size_t)samples->channel_count);
    TSUYA_NEW(status, p.edge, (size_t)samples->count);
    TSUYA_NEW(status, p.root, (size_t)samples->count * (size_t)samples->channel_count);
    take_roots(&p);
    if (f.shapes > 0) {
        take_every(&p, SEARCHED);
        TSUYA_GOTO_DONE(status, search(shape, &p));
        take_every(&p, SUBSET);
    }
    TSUYA_GOTO_DONE(status, objective(&error, &p, shape));
    if (f.shapes > 0) {
        TSUYA_GOTO_DONE(status, make_state(state, &f, shape, samples->channel_count, p.strength));
    }
done:
    tsuya_free(p.lobe);
    tsuya_free(p.strength);
    tsuya_free(p.edge);
    tsuya_free(p.root);
    return status;
}
