#include "brdf/fit_sheen.h"

#include "brdf/fit_parts.h"
#include "brdf/sheen_fit.h"
#include "core/memory.h"

#include <string.h>

enum { GUIDE_SAMPLES = 4000, FLAT_NU = 16, FLAT_NV = 30, DEEP_NU = 8, DEEP_NV = 15, DEEP_ND = 6 };

static void scale_strengths(tsuya_sheen *s, double factor)
{
    for (int c = 0; c < s->channels; ++c) {
        s->strength[0][c] *= factor;
        s->strength[1][c] *= factor;
        s->matte[c] *= factor;
    }
    s->gloss[0] *= factor;
    s->gloss[1] *= factor;
}

tsuya_status tsuya_fit_guide(tsuya_sheen **guide, const tsuya_samples *samples)
{
    tsuya_sheen_guide_options options = tsuya_sheen_guide_options_default();
    tsuya_samples part = {0};
    tsuya_fit_data data = {0};
    tsuya_sheen *s = NULL;
    double error;
    tsuya_status status;
    *guide = NULL;
    TSUYA_GOTO_DONE(status, tsuya_samples_draw(&part, samples, GUIDE_SAMPLES));
    TSUYA_GOTO_DONE(status, tsuya_fit_data_create(&data, &part));
    TSUYA_GOTO_DONE(status, tsuya_sheen_create(&s, samples->channel_count, options.spans, 0, 0, 0));
    TSUYA_GOTO_DONE(status, tsuya_sheen_fit_guide(s, &error, &data, &options));
    scale_strengths(s, data.scale);
    *guide = s;
    s = NULL;
done:
    tsuya_sheen_free(s);
    tsuya_fit_data_free(&data);
    tsuya_samples_free(&part);
    return status;
}

static void copy_guide(tsuya_sheen *to, const tsuya_sheen *from)
{
    size_t curve = ((size_t)from->spans + 3) * sizeof(double), channels = (size_t)from->channels * sizeof(double);
    for (int k = 0; k < TSUYA_SHEEN_CURVES; ++k) {
        memcpy(to->curve[k], from->curve[k], curve);
    }
    to->eta = from->eta;
    to->lowest_cosine = from->lowest_cosine;
    memcpy(to->gloss, from->gloss, sizeof to->gloss);
    memcpy(to->slant, from->slant, sizeof to->slant);
    memcpy(to->reach, from->reach, sizeof to->reach);
    memcpy(to->strength[0], from->strength[0], channels);
    memcpy(to->strength[1], from->strength[1], channels);
    memcpy(to->matte, from->matte, channels);
}

tsuya_status tsuya_fit_sheen(void **state, double *reciprocal_condition, const tsuya_brdf_model *model, const tsuya_sheen *guide,
                             const tsuya_samples *samples)
{
    tsuya_polar_options options = tsuya_sheen_surface_options_default();
    bool flat = model == &tsuya_brdf_ndf, deep = model == &tsuya_brdf_nurbs3;
    tsuya_fit_data data = {0};
    tsuya_sheen *s = NULL;
    tsuya_status status;
    TSUYA_GOTO_DONE(status, tsuya_sheen_create(&s, guide->channels, guide->spans, flat ? FLAT_NU : deep ? DEEP_NU : 0,
                                               flat ? FLAT_NV : deep ? DEEP_NV : 0, deep ? DEEP_ND : 0));
    copy_guide(s, guide);
    if (flat || deep) {
        TSUYA_GOTO_DONE(status, tsuya_fit_data_create(&data, samples));
        scale_strengths(s, 1.0 / data.scale);
        TSUYA_GOTO_DONE(status, tsuya_sheen_fit_surface(s, reciprocal_condition, &data, &options));
        scale_strengths(s, data.scale);
        TSUYA_GOTO_DONE(status, tsuya_sheen_separate_by(s, &data));
    }
    TSUYA_GOTO_DONE(status, tsuya_sheen_prepare(s));
    *state = s;
    s = NULL;
done:
    tsuya_sheen_free(s);
    tsuya_fit_data_free(&data);
    return status;
}
