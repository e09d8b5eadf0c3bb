/* A prediction held against readings: least squares on cube roots, by linear steps whose weights follow.  With Δ∛ ≈ Δ(f cosθ)/(3 (f cosθ)^⅔) at the
 * middle of both, each step is linear in the scale and the three levels, and the levels are eliminated channel by channel. */
#include "brdf/fit.h"
#include "brdf/predict.h"
#include "core/memory.h"

#include <string.h>

enum { STEPS = 40 };

typedef struct moments {
    double pp, pf, p1, f1, one; /* weighted sums of products of the prediction p, the reading f and 1/π */
} moments;

static moments moments_of(const tsuya_predict_match *m, const tsuya_samples *s, const double *predicted, int c, double floor)
{
    moments sum = {0};
    for (int k = 0; k < s->count; ++k) {
        double f = s->value[3 * k + c], p = predicted[3 * k + c], at = fmax(0.5 * (f + m->scale * p + m->body[c] / M_PI), floor);
        if (isfinite(f)) {
            double w = cbrt(s->wi[k].z * s->wi[k].z) / (at * cbrt(at));
            sum.pp += w * p * p;
            sum.pf += w * p * f;
            sum.p1 += w * p / M_PI;
            sum.f1 += w * f / M_PI;
            sum.one += w / (M_PI * M_PI);
        }
    }
    return sum;
}

static void step(tsuya_predict_match *m, const tsuya_samples *s, const double *predicted, bool body, double floor)
{
    moments sum[3];
    bool dark[3];
    for (int c = 0; c < 3; ++c) {
        sum[c] = moments_of(m, s, predicted, c, floor);
        dark[c] = !body || !(sum[c].one > 0.0);
    }
    for (int turn = 0; turn < 4; ++turn) { /* a level below zero is zero, and the others follow */
        double own = 0.0, both = 0.0;
        bool changed = false;
        for (int c = 0; c < 3; ++c) {
            own += sum[c].pp - (dark[c] ? 0.0 : sum[c].p1 * sum[c].p1 / sum[c].one);
            both += sum[c].pf - (dark[c] ? 0.0 : sum[c].p1 * sum[c].f1 / sum[c].one);
        }
        m->scale = own > 1e-12 * (sum[0].pp + sum[1].pp + sum[2].pp) ? fmax(both / own, 0.0) : 0.0;
        for (int c = 0; c < 3; ++c) {
            m->body[c] = dark[c] ? 0.0 : (sum[c].f1 - m->scale * sum[c].p1) / sum[c].one;
            changed |= m->body[c] < 0.0;
            dark[c] |= m->body[c] < 0.0;
            m->body[c] = fmax(m->body[c], 0.0);
        }
        if (!changed) {
            break;
        }
    }
}

static double fit(tsuya_predict_match *m, double *scratch, const tsuya_samples *s, const double *predicted, bool body)
{
    double brightest = 0.0;
    for (int k = 0; k < 3 * s->count; ++k) {
        brightest = s->value[k] > brightest ? s->value[k] : brightest;
    }
    for (int k = 0; k < STEPS && brightest > 0.0; ++k) {
        step(m, s, predicted, body, 1e-4 * brightest);
    }
    for (int k = 0; k < 3 * s->count; ++k) {
        scratch[k] = m->scale * predicted[k] + m->body[k % 3] / M_PI;
    }
    return tsuya_samples_error(s, scratch, -1).cbrt;
}

tsuya_status tsuya_predict_hold_against(tsuya_predict_match *match, const tsuya_material *material, const tsuya_samples *s)
{
    tsuya_predict_match alone = {0}, dull = {0};
    *match = (tsuya_predict_match){0};
    if (s->channel_count != 3) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%d channels of readings; the prediction has r, g, b", s->channel_count);
    }
    double *predicted = tsuya_calloc((size_t)s->count * 6, sizeof *predicted);
    if (!predicted) {
        return TSUYA_ERROR_MEMORY;
    }
    double *scratch = predicted + (size_t)s->count * 3;
    tsuya_material_predict(predicted, material, s);
    match->error_cbrt = fit(match, scratch, s, predicted, true);
    match->error_without_body = fit(&alone, scratch, s, predicted, false);
    match->scale_without_body = alone.scale;
    memset(predicted, 0, (size_t)s->count * 3 * sizeof *predicted);
    match->error_body_alone = fit(&dull, scratch, s, predicted, true);
    if (match->error_cbrt >= match->error_body_alone) { /* the weights lead near the least error, not to it */
        match->error_cbrt = match->error_body_alone;
        match->scale = 0.0;
        memcpy(match->body, dull.body, sizeof match->body);
    }
    tsuya_free(predicted);
    return TSUYA_OK;
}
