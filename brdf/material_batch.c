/* A material for a renderer's wave of paths: the functions of tsuya_material_view for many viewers at once, in float. */
#include "brdf/dye.h"
#include "brdf/sampling.h"

#include "core/clones.h"

#include <assert.h>
#include <string.h>

static const float inverse_pi = 0.318309886f;

/* Nothing but the dye, from every side alike. */
static bool matte(const tsuya_material *m) { return m->model == &tsuya_brdf_lambert; }

static const float *plane_of(const float *planes, int c, int count) { return planes ? planes + (size_t)c * (size_t)count : NULL; }

/* below += dye · rest, over += albedo; dye NULL: `own` */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
add_shares(float *restrict below, float *restrict over, const float *restrict dye, float own, const float *restrict rest, bool under, int count)
{
    for (int k = 0; k < count; ++k) {
        float d = dye ? dye[k] : own;
        below[k] += under ? d * rest[k] : d;
        over[k] += (1.0f - rest[k]) * (1.0f / 1.003f);
    }
}

TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
divide_shares(float *restrict share, const float *restrict below, const float *restrict over, int count)
{
    for (int k = 0; k < count; ++k) {
        share[k] = over[k] > 0.0f ? below[k] / (below[k] + over[k]) : 1.0f;
    }
}

void tsuya_material_look(const tsuya_material_looks *l)
{
    const tsuya_material *m = l->material;
    float below[TSUYA_MATERIAL_LOOKS] = {0}, over[TSUYA_MATERIAL_LOOKS] = {0};
    assert(l->count <= TSUYA_MATERIAL_LOOKS);
    if (matte(m)) {
        for (int k = 0; k < l->count; ++k) {
            l->share[k] = 1.0f;
        }
        return;
    }
    tsuya_dye_rest_batch(m->albedo, l->count, l->wo, l->rest);
    for (int c = 0; c < m->channel_count; ++c) {
        add_shares(below, over, plane_of(l->dye, c, l->count), (float)m->dye[c], plane_of(l->rest, c, l->count), m->coupling == TSUYA_DYE_UNDER_SURFACE, l->count);
    }
    divide_shares(l->share, below, over, l->count);
}

/* value += dye · scale · rest of both; rest_i NULL: without */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
add_base(float *restrict value, const float *restrict dye, float own, float scale, const float *restrict rest_i, const float *restrict rest_o, int count)
{
    for (int k = 0; k < count; ++k) {
        float base = scale * (dye ? dye[k] : own);
        value[k] += rest_i ? base * rest_i[k] * rest_o[k] : base;
    }
}

static bool any_dye(const tsuya_material_looks *l)
{
    bool any = l->dye != NULL;
    for (int c = 0; c < l->material->channel_count; ++c) {
        any |= l->material->dye[c] > 0.0;
    }
    return any;
}

static void add_dye(const tsuya_material_looks *l, const float *const wi[3], float *value)
{
    const tsuya_material *m = l->material;
    float rest[TSUYA_MATERIAL_LOOKS * TSUYA_MATERIAL_MAX_CHANNELS];
    const bool under = m->coupling == TSUYA_DYE_UNDER_SURFACE && !matte(m);
    if (under) {
        tsuya_dye_rest_batch(m->albedo, l->count, wi, rest);
    }
    for (int c = 0; c < m->channel_count; ++c) {
        add_base(value + (size_t)c * (size_t)l->count, plane_of(l->dye, c, l->count), (float)m->dye[c],
                 under ? (float)m->albedo->inverse_rest[c] : inverse_pi, under ? plane_of(rest, c, l->count) : NULL, plane_of(l->rest, c, l->count), l->count);
    }
}

static void model_pdf(const tsuya_material *m, const tsuya_direction_batch *d, float *pdf)
{
    if (m->model->pdf_batch) {
        m->model->pdf_batch(m->state, d, pdf);
        return;
    }
    for (int k = 0; k < d->count; ++k) {
        bool up = d->wi_z[k] > 0.0f && d->wo_z[k] > 0.0f;
        const tsuya_vec3 wi = {d->wi_x[k], d->wi_y[k], d->wi_z[k]}, wo = {d->wo_x[k], d->wo_y[k], d->wo_z[k]};
        pdf[k] = up ? (float)m->model->pdf(m->state, wi, wo) : 0.0f;
    }
}

/* The density of both lobes; what is not above the surface, or not finite, is cleared. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
join(const tsuya_direction_batch *d, const float *restrict share, bool dye_alone, int channels, float *restrict pdf, float *restrict value)
{
    const float *restrict ix = d->wi_x, *restrict iy = d->wi_y, *restrict iz = d->wi_z;
    const float *restrict ox = d->wo_x, *restrict oy = d->wo_y, *restrict oz = d->wo_z;
    int seen[TSUYA_MATERIAL_LOOKS];
    for (int k = 0; k < d->count; ++k) {
        seen[k] = (iz[k] > 0.0f) & (oz[k] > 0.0f) & (fabsf(ix[k] + iy[k] + iz[k] + (ox[k] + oy[k] + oz[k])) < INFINITY);
        float cosine = inverse_pi * iz[k], mixed = dye_alone ? cosine : share[k] * cosine + (1.0f - share[k]) * pdf[k];
        pdf[k] = seen[k] ? mixed : 0.0f;
    }
    for (int c = 0; c < channels; ++c) {
        float *restrict plane = value + (size_t)c * (size_t)d->count;
        for (int k = 0; k < d->count; ++k) {
            plane[k] = seen[k] ? plane[k] : 0.0f;
        }
    }
}

void tsuya_material_looks_eval_pdf(const tsuya_material_looks *l, const float *const wi[3], float *value, float *pdf)
{
    const tsuya_material *m = l->material;
    const tsuya_direction_batch d = {l->count, wi[0], wi[1], wi[2], l->wo[0], l->wo[1], l->wo[2]};
    assert(l->count <= TSUYA_MATERIAL_LOOKS);
    m->model->eval_batch(m->state, m->channel_count, &d, value);
    if (m->limit) {
        tsuya_limit_batch(m->limit, m->channel_count, &d, value);
    }
    if (any_dye(l)) {
        add_dye(l, wi, value);
    }
    if (!matte(m)) {
        model_pdf(m, &d, pdf);
    }
    join(&d, l->share, matte(m), m->channel_count, pdf, value);
}

TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
choose(const float *restrict share, const float *const u[3], const float *const wo[3], float *const wi[3], int count)
{
    const float *restrict a = u[0], *restrict b = u[1], *restrict which = u[2], *restrict oz = wo[2];
    float *restrict ix = wi[0], *restrict iy = wi[1], *restrict iz = wi[2];
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        float x, y, z, lobe_x = ix[k], lobe_y = iy[k], lobe_z = iz[k];
        tsuya_sample_cosine_f32(a[k], b[k], &x, &y, &z);
        bool below = which[k] < share[k];
        x = below ? x : lobe_x;
        y = below ? y : lobe_y;
        z = below ? z : lobe_z;
        ix[k] = x;
        iy[k] = y;
        iz[k] = (z > 0.0f) & (oz[k] > 0.0f) ? z : 0.0f;
    }
}

static void model_sample(const tsuya_material_looks *l, const float *const u[3], float *const wi[3])
{
    const tsuya_material *m = l->material;
    if (m->model->sample_batch) {
        m->model->sample_batch(m->state, l->count, l->wo, u, wi);
        return;
    }
    for (int k = 0; k < l->count; ++k) {
        tsuya_vec3 w = {0, 0, 0};
        const tsuya_vec3 wo = {l->wo[0][k], l->wo[1][k], l->wo[2][k]};
        const double pair[2] = {u[0][k], u[1][k]};
        bool drawn = u[2][k] >= l->share[k] && wo.z > 0.0 && m->model->sample(m->state, wo, pair, &w);
        wi[0][k] = (float)w.x;
        wi[1][k] = (float)w.y;
        wi[2][k] = drawn ? (float)w.z : 0.0f;
    }
}

void tsuya_material_looks_sample(const tsuya_material_looks *l, const float *const u[3], float *const wi[3])
{
    if (matte(l->material)) {
        for (int c = 0; c < 3; ++c) {
            memset(wi[c], 0, (size_t)l->count * sizeof *wi[c]);
        }
    } else {
        model_sample(l, u, wi);
    }
    choose(l->share, u, l->wo, wi, l->count);
}
