#include "brdf/fit.h"

#include "brdf/dye.h"
#include "brdf/fit_lobes.h"
#include "brdf/fit_parts.h"
#include "brdf/fit_sheen.h"
#include "brdf/sampling.h"
#include "brdf/tanaka.h"
#include "core/memory.h"
#include "core/table.h"

#include <string.h>

/* In the order of their cost: bytes first, then time. */
static const char *const model_names[] = {"auto", "lambert", "ggx", "ggx-aniso", "ward", "ashikhmin", "tanaka", "yarn", "ndf", "nurbs3", NULL};
/* Of a larger table, so many samples are held out from and choose the model; all of them fit it. */
enum { FEWEST = 8, CHOOSING = 20000 };
/* Pairs of directions for which a material is asked when another model is to stand for it. */
enum { DESIGN = 3000, DESIGN_STREAM = 0x64657369 };

const char *const *tsuya_fit_model_names(void) { return model_names; }

void tsuya_material_predict(double *predicted, const tsuya_material *material, const tsuya_samples *s)
{
#pragma omp parallel for schedule(static)
    for (int k = 0; k < s->count; ++k) {
        tsuya_material_eval(material, NULL, s->wi[k], s->wo[k], predicted + (size_t)k * (size_t)s->channel_count);
    }
}

/* A set of samples to fit, with the two yarns once something asked for them. */
typedef struct training {
    const tsuya_samples *samples;
    tsuya_sheen *guide;
} training;

static bool is_sheen(const tsuya_brdf_model *m) { return m == &tsuya_brdf_yarn || m == &tsuya_brdf_ndf || m == &tsuya_brdf_nurbs3; }

static void hold_at_one(tsuya_material *m)
{
    bool over = false;
    for (int c = 0; c < m->channel_count; ++c) {
        float highest = 0.0f;
        for (int k = 0; k < m->albedo->side * m->albedo->side; ++k) {
            highest = fmaxf(highest, m->albedo->value[k * m->channel_count + c]);
        }
        over |= m->dye[c] + (double)highest > 1.0;
    }
    m->coupling = over ? TSUYA_DYE_UNDER_SURFACE : TSUYA_DYE_LAMBERT;
    for (int c = 0; c < m->channel_count && over; ++c) {
        m->dye[c] = fmin(m->dye[c], 0.995); /* the albedo's table is good to a few 1e-3, and the sum stays below 1 */
    }
}

static bool any_dye(const tsuya_material *m)
{
    for (int c = 0; c < m->channel_count; ++c) {
        if (m->dye[c] > 0.0) {
            return true;
        }
    }
    return false;
}

static tsuya_status fit_once(tsuya_material **material, double *reciprocal_condition, const tsuya_brdf_model *model, training *t,
                             const char *name)
{
    const tsuya_samples *s = t->samples;
    const char *channel[TSUYA_MATERIAL_MAX_CHANNELS];
    double diffuse[TSUYA_MATERIAL_MAX_CHANNELS] = {0};
    void *state = NULL;
    *material = NULL;
    *reciprocal_condition = NAN;
    for (int c = 0; c < s->channel_count; ++c) {
        channel[c] = s->channel[c];
    }
    if (is_sheen(model)) {
        if (!t->guide) {
            TSUYA_TRY(tsuya_fit_guide(&t->guide, s));
        }
        TSUYA_TRY(tsuya_fit_sheen(&state, reciprocal_condition, model, t->guide, s));
    } else if (model == &tsuya_brdf_tanaka) {
        TSUYA_TRY(tsuya_fit_tanaka(&state, reciprocal_condition, s));
    } else {
        TSUYA_TRY(tsuya_fit_lobe(&state, diffuse, model, s));
    }
    TSUYA_TRY(tsuya_material_create(material, model, state, name, s->channel_count, channel));
    memcpy((*material)->dye, diffuse, (size_t)s->channel_count * sizeof *diffuse);
    if (!is_sheen(model) && model != &tsuya_brdf_tanaka) {
        hold_at_one(*material);
    }
    (*material)->relative = s->relative;
    return TSUYA_OK;
}

static tsuya_status error_of(tsuya_brdf_error *error, const tsuya_material *material, const tsuya_samples *samples)
{
    double *predicted = tsuya_calloc((size_t)samples->count * (size_t)samples->channel_count, sizeof *predicted);
    if (!predicted) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_material_predict(predicted, material, samples);
    *error = tsuya_samples_error(samples, predicted, -1);
    tsuya_free(predicted);
    return TSUYA_OK;
}

/* Everything that is fitted: all samples, those that choose, and what is left of these without a part. */
typedef struct work {
    training all, choosing, without[TSUYA_FIT_PARTS];
    tsuya_samples some, kept[TSUYA_FIT_PARTS], left_out[TSUYA_FIT_PARTS];
} work;

/* Samples that choose: all of a small table, a random draw from a large one. */
static tsuya_status draw(work *w, const tsuya_samples *samples)
{
    w->all.samples = w->choosing.samples = samples;
    if (samples->count <= CHOOSING) {
        return TSUYA_OK;
    }
    w->choosing.samples = &w->some;
    return tsuya_samples_draw(&w->some, samples, CHOOSING);
}

static tsuya_status split(work *w, const tsuya_samples *samples)
{
    unsigned char *mask = tsuya_calloc((size_t)samples->count, 2);
    if (!mask) {
        return TSUYA_ERROR_MEMORY;
    }
    unsigned char *rest = mask + samples->count;
    tsuya_status status = TSUYA_OK;
    for (int part = 0; part < TSUYA_FIT_PARTS && status == TSUYA_OK; ++part) {
        int count = 0;
        status = tsuya_fit_part(mask, &count, samples, (tsuya_fit_part_kind)part);
        if (status != TSUYA_OK || count == 0) {
            continue;
        }
        for (int k = 0; k < samples->count; ++k) {
            rest[k] = !mask[k];
        }
        status = tsuya_samples_copy(&w->left_out[part], samples, mask);
        if (status == TSUYA_OK) {
            status = tsuya_samples_copy(&w->kept[part], samples, rest);
        }
        w->without[part].samples = &w->kept[part];
    }
    tsuya_free(mask);
    return status;
}

static void free_work(work *w)
{
    tsuya_sheen_free(w->all.guide);
    tsuya_sheen_free(w->choosing.guide);
    tsuya_samples_free(&w->some);
    for (int part = 0; part < TSUYA_FIT_PARTS; ++part) {
        tsuya_sheen_free(w->without[part].guide);
        tsuya_samples_free(&w->kept[part]);
        tsuya_samples_free(&w->left_out[part]);
    }
}

static double pooled(double a, double b)
{
    return isnan(a) ? b : isnan(b) ? a : sqrt(0.5 * (a * a + b * b));
}

static tsuya_status validate(tsuya_fit_info *info, const tsuya_brdf_model *model, work *w)
{
    tsuya_brdf_error *errors[TSUYA_FIT_PARTS] = {&info->heldout_tilts, &info->heldout_azimuth};
    for (int part = 0; part < TSUYA_FIT_PARTS; ++part) {
        *errors[part] = (tsuya_brdf_error){NAN, NAN};
        if (w->left_out[part].count == 0) {
            continue;
        }
        tsuya_material *m;
        double condition;
        TSUYA_TRY(fit_once(&m, &condition, model, &w->without[part], "part"));
        tsuya_status status = error_of(errors[part], m, &w->left_out[part]);
        tsuya_material_free(m);
        TSUYA_TRY(status);
    }
    info->heldout.cbrt = pooled(info->heldout_tilts.cbrt, info->heldout_azimuth.cbrt);
    info->heldout.log = pooled(info->heldout_tilts.log, info->heldout_azimuth.log);
    return TSUYA_OK;
}

static void take_range(double range[2], double value)
{
    range[0] = fmin(range[0], value); /* fmin and fmax drop the NaN of the beginning */
    range[1] = fmax(range[1], value);
}

static tsuya_material_support support_of(const tsuya_samples *s)
{
    tsuya_material_support r = {{NAN, NAN}, {NAN, NAN}, {NAN, NAN}, {NAN, NAN}};
    for (int k = 0; k < s->count; ++k) {
        tsuya_half_angles a = tsuya_half_angles_of(s->wi[k], s->wo[k]);
        take_range(r.theta_i_deg, tsuya_deg_from_rad(acos(fmin(s->wi[k].z, 1.0))));
        take_range(r.theta_o_deg, tsuya_deg_from_rad(acos(fmin(s->wo[k].z, 1.0))));
        take_range(r.theta_h_deg, tsuya_deg_from_rad(a.theta_h));
        take_range(r.theta_d_deg, tsuya_deg_from_rad(a.theta_d));
    }
    return r;
}

/* The material, and what is said of it beside its held-out errors. */
static tsuya_status fit_to(tsuya_material **material, tsuya_fit_info *info, const tsuya_brdf_model *model, training *t, const char *name)
{
    *material = NULL;
    info->samples = t->samples->count;
    TSUYA_TRY(fit_once(material, &info->reciprocal_condition, model, t, name));
    tsuya_material *m = *material;
    m->support = support_of(t->samples);
    m->heldout_cbrt = info->heldout.cbrt;
    m->heldout_log = info->heldout.log;
    tsuya_status status = error_of(&info->fit, m, t->samples);
    if (status == TSUYA_OK) {
        info->bytes = tsuya_material_get_info(m).bytes;
        tsuya_material_physics(&info->reciprocity_deficit, &info->furnace, m);
        status = tsuya_material_time(&info->eval_ns, m);
    }
    if (status != TSUYA_OK) {
        tsuya_material_free(m);
        *material = NULL;
    }
    return status;
}

static tsuya_status fit_model(tsuya_material **material, tsuya_fit_info *info, const tsuya_brdf_model *model, work *w, training *t, const char *name)
{
    double started = tsuya_clock_s();
    *info = (tsuya_fit_info){.model = model->name};
    *material = NULL;
    TSUYA_TRY(validate(info, model, w));
    TSUYA_TRY(fit_to(material, info, model, t, name));
    info->seconds = tsuya_clock_s() - started;
    return TSUYA_OK;
}

static bool tells_difference_angles(const tsuya_samples *s)
{
    tsuya_material_support r = support_of(s);
    return r.theta_d_deg[1] - r.theta_d_deg[0] > 10.0;
}

/* What auto compares: a geometric mean of the held-out errors.  An azimuth left out doubles the gap that the whole table leaves,
 * a tilt hardly widens it, so the tilts count twice. */
static double merit(const tsuya_fit_info *i)
{
    double a = i->heldout_tilts.cbrt, b = i->heldout_azimuth.cbrt;
    return isnan(a) && isnan(b) ? i->fit.cbrt : isnan(a) ? b : isnan(b) ? a : cbrt(a * a * b);
}

/* What a scene may be lit with; tanaka seldom is. */
static bool physical(const tsuya_fit_info *i) { return i->reciprocity_deficit <= 1e-6 && i->furnace <= 1.001; }

/* The cheapest that meets the tolerance; without one, or when none does, that with the lowest held-out error. */
static tsuya_status fit_auto(tsuya_material **material, tsuya_fit_info *info, tsuya_fit_info *candidates, int *count, work *w,
                             const tsuya_fit_options *options, const tsuya_context *context)
{
    *count = 0;
    *material = NULL;
    for (int k = 1; model_names[k]; ++k) {
        const tsuya_brdf_model *model = tsuya_brdf_model_find(model_names[k]);
        if (model == &tsuya_brdf_nurbs3 && !tells_difference_angles(w->choosing.samples)) {
            continue; /* one difference angle cannot tell what another would show */
        }
        tsuya_material *m;
        tsuya_fit_info *now = &candidates[*count];
        tsuya_progress_update(context, "fit", k - 1, TSUYA_FIT_MODELS - 1, model->name);
        TSUYA_TRY(tsuya_check_interrupt());
        TSUYA_TRY(fit_model(&m, now, model, w, &w->choosing, options->name));
        ++*count;
        double here = isnan(now->heldout.cbrt) ? now->fit.cbrt : now->heldout.cbrt;
        bool meets = physical(now) && !isnan(options->tolerance) && here <= options->tolerance;
        if (!*material || meets || (physical(now) && merit(now) < merit(info))) {
            tsuya_material_free(*material);
            *material = m;
            *info = *now;
        } else {
            tsuya_material_free(m);
        }
        if (meets) {
            break;
        }
    }
    if (w->choosing.samples == w->all.samples) {
        return TSUYA_OK;
    }
    tsuya_material_free(*material);
    return fit_to(material, info, tsuya_brdf_model_find(info->model), &w->all, options->name);
}

static tsuya_status check_samples(const tsuya_samples *s, const tsuya_fit_options *options)
{
    bool positive = false;
    if (s->count < FEWEST) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d samples: at least %d are needed to fit a material", options->name, s->count, FEWEST);
    }
    for (size_t k = 0; k < (size_t)s->count * (size_t)s->channel_count; ++k) {
        positive |= s->value[k] > 0.0;
    }
    if (!positive) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: no value above zero", options->name);
    }
    for (int k = 0; model_names[k]; ++k) {
        if (strcmp(model_names[k], options->model) == 0) {
            return TSUYA_OK;
        }
    }
    const char *nearest = tsuya_nearest_name(options->model, model_names);
    return tsuya_fail(TSUYA_ERROR_INPUT, "model '%s' is not known%s%s", options->model, nearest ? "; the nearest known one is " : "",
                      nearest ? nearest : "");
}

/* Viewers spread by the cosine; lights by the cosine and by the material's own density in turns. */
static void draw_pair(tsuya_vec3 *wi, tsuya_vec3 *wo, const tsuya_material *m, int k)
{
    double u[5];
    for (int c = 0; c < 5; ++c) {
        u[c] = tsuya_random_uniform(DESIGN_STREAM, (uint64_t)c, (uint64_t)k);
    }
    *wo = tsuya_sample_cosine(u[0], u[1]);
    if (k % 2 == 0 || !tsuya_material_sample(m, NULL, *wo, u + 2, wi)) {
        *wi = tsuya_sample_cosine(u[2], u[3]);
    }
    wo->z = fmax(wo->z, 1e-3);
    wi->z = fmax(wi->z, 1e-3);
}

tsuya_status tsuya_material_refit(tsuya_material **other, double *diffuse, const tsuya_material *material, const char *model)
{
    const double no_dye[TSUYA_MATERIAL_MAX_CHANNELS] = {0};
    const tsuya_brdf_model *wanted = tsuya_brdf_model_find(model);
    const int channels = material->channel_count;
    tsuya_samples samples = {0};
    training t = {.samples = &samples};
    double condition;
    *other = NULL;
    if (!wanted) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "model '%s' is not known", model);
    }
    tsuya_status status;
    TSUYA_GOTO_DONE(status, tsuya_samples_create(&samples, DESIGN, channels, material->channel));
    for (int k = 0; k < DESIGN; ++k) {
        draw_pair(&samples.wi[k], &samples.wo[k], material, k);
        tsuya_material_eval(material, no_dye, samples.wi[k], samples.wo[k], samples.value + (size_t)k * (size_t)channels);
    }
    TSUYA_GOTO_DONE(status, fit_once(other, &condition, wanted, &t, material->name));
    tsuya_material *m = *other;
    for (int c = 0; c < channels; ++c) {
        diffuse[c] = m->dye[c];
        m->dye[c] = fmin(m->dye[c] + material->dye[c], 1.0);
    }
    hold_at_one(m);
    m->coupling = material->coupling == TSUYA_DYE_UNDER_SURFACE && any_dye(material) ? TSUYA_DYE_UNDER_SURFACE : m->coupling;
    m->relative = material->relative;
    m->is_default = material->is_default;
done:
    tsuya_sheen_free(t.guide);
    tsuya_samples_free(&samples);
    return status;
}

tsuya_status tsuya_brdf_fit(tsuya_material **material, tsuya_fit_info *info, tsuya_fit_info *candidates, int *candidate_count,
                            const tsuya_samples *samples, const tsuya_fit_options *options, const tsuya_context *context)
{
    double started = tsuya_clock_s();
    tsuya_fit_info own[TSUYA_FIT_MODELS];
    int own_count = 0, *count = candidate_count ? candidate_count : &own_count;
    *material = NULL;
    TSUYA_TRY(check_samples(samples, options));
    work *w = tsuya_calloc(1, sizeof *w);
    if (!w) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_status status = draw(w, samples);
    if (status == TSUYA_OK) {
        status = split(w, w->choosing.samples);
    }
    if (status == TSUYA_OK && strcmp(options->model, "auto") == 0) {
        status = fit_auto(material, info, candidates ? candidates : own, count, w, options, context);
    } else if (status == TSUYA_OK) {
        status = fit_model(material, info, tsuya_brdf_model_find(options->model), w, &w->all, options->name);
        *count = 1;
        if (candidates) {
            candidates[0] = *info;
        }
    }
    if (status != TSUYA_OK) {
        tsuya_material_free(*material);
        *material = NULL;
    } else {
        info->seconds = tsuya_clock_s() - started;
    }
    free_work(w);
    tsuya_free(w);
    return status;
}
