#include "brdf/tanaka.h"

#include "brdf/polar_fit.h"
#include "core/memory.h"

enum { NU = 16, NV = 60 };

typedef struct problem {
    const tsuya_samples *samples;
    tsuya_half_angles *place;
    bool *placed; /* false: the light at the normal, which lies on no spoke */
    double *target, *weight, *control, scale;
} problem;

/* Intensities of one channel, the largest of the table being 1. */
static void take_channel(const problem *p, int c)
{
    double sum = 0.0;
    for (int k = 0; k < p->samples->count; ++k) {
        double v = p->samples->value[k * p->samples->channel_count + c] * p->samples->wi[k].z / p->scale;
        bool usable = isfinite(v) && p->placed[k];
        p->target[k] = usable ? v : 0.0;
        p->weight[k] = usable ? 1.0 / (9.0 * cbrt(pow(fmax(fabs(v), 1e-4), 4.0))) : 0.0;
        sum += usable ? cbrt(v) * cbrt(v) : 0.0;
    }
    for (int k = 0; k < p->samples->count; ++k) {
        p->weight[k] /= sum > 0.0 ? sum : 1.0;
    }
}

static tsuya_status fit_channels(tsuya_tanaka *t, double *reciprocal_condition, const problem *p)
{
    const tsuya_polar_options options = {.smooth_phi = 1e-7, .smooth_theta = 1e-9, .level = 1e-8, .shrink = 1e-12};
    const tsuya_polar_samples samples = {p->samples->count, p->place, p->target, p->weight};
    *reciprocal_condition = 1.0;
    for (int c = 0; c < t->channels; ++c) {
        double condition;
        take_channel(p, c);
        TSUYA_TRY(tsuya_polar_fit(p->control, &condition, t->nu, t->nv, 0, &samples, &options));
        *reciprocal_condition = fmin(*reciprocal_condition, condition);
        for (int k = 0; k < tsuya_sheen_net_points(t->nu, t->nv, 0); ++k) {
            t->net[(size_t)k * (size_t)t->line + (size_t)c] = (float)fmin(fmax(p->control[k] * p->scale, 0.0), 1e30);
        }
    }
    return tsuya_tanaka_prepare(t);
}

tsuya_status tsuya_fit_tanaka(void **state, double *reciprocal_condition, const tsuya_samples *samples)
{
    tsuya_status status = TSUYA_OK;
    problem p = {.samples = samples, .scale = 0.0};
    tsuya_tanaka *t = NULL;
    size_t n = (size_t)samples->count;
    TSUYA_GOTO_DONE(status, tsuya_tanaka_create(&t, samples->channel_count, NU, NV));
    TSUYA_NEW(status, p.place, n);
    TSUYA_NEW(status, p.placed, n);
    TSUYA_NEW(status, p.target, n);
    TSUYA_NEW(status, p.weight, n);
    TSUYA_NEW(status, p.control, (size_t)tsuya_sheen_net_points(NU, NV, 0));
    for (size_t k = 0; k < n; ++k) {
        p.placed[k] = tsuya_tanaka_place(&p.place[k], samples->wi[k], samples->wo[k]);
        for (int c = 0; c < samples->channel_count; ++c) {
            p.scale = fmax(p.scale, samples->value[k * (size_t)samples->channel_count + (size_t)c] * samples->wi[k].z);
        }
    }
    p.scale = p.scale > 0.0 ? p.scale : 1.0;
    TSUYA_GOTO_DONE(status, fit_channels(t, reciprocal_condition, &p));
    *state = t;
    t = NULL;
done:
    tsuya_tanaka_free(t);
    tsuya_free(p.place);
    tsuya_free(p.placed);
    tsuya_free(p.target);
    tsuya_free(p.weight);
    tsuya_free(p.control);
    return status;
}
