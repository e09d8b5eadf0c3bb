#include "brdf/energy.h"
#include "brdf/sampling.h"

#include "core/clones.h"
#include "core/memory.h"

#include <stdio.h>
#include <string.h>

static const char *const rgb_channels[3] = {"r", "g", "b"};

static tsuya_status name_channels(tsuya_material *m, int count, const char *const *channels)
{
    m->channel_count = count;
    m->channel_name = tsuya_calloc((size_t)count, sizeof *m->channel_name);
    m->channel = tsuya_calloc((size_t)count, sizeof *m->channel);
    m->dye = tsuya_calloc((size_t)count, sizeof *m->dye);
    if (!m->channel_name || !m->channel || !m->dye) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int c = 0; c < count; ++c) {
        int length = snprintf(m->channel_name[c], TSUYA_CHANNEL_NAME_SIZE, "%s", channels[c]);
        if (length <= 0 || length >= TSUYA_CHANNEL_NAME_SIZE) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "material: channel name \"%.40s\": expected 1 to %d characters", channels[c],
                              TSUYA_CHANNEL_NAME_SIZE - 1);
        }
        m->channel[c] = m->channel_name[c];
    }
    return TSUYA_OK;
}

tsuya_status tsuya_material_create(tsuya_material **material, const tsuya_brdf_model *model, void *state, const char *name,
                                   int channel_count, const char *const *channels)
{
    tsuya_status status = TSUYA_OK;
    tsuya_material *m;
    *material = NULL;
    TSUYA_NEW(status, m, 1);
    m->model = model;
    m->state = state;
    state = NULL;
    m->heldout_cbrt = m->heldout_log = NAN;
    m->support = (tsuya_material_support){{NAN, NAN}, {NAN, NAN}, {NAN, NAN}, {NAN, NAN}};
    m->coupling = TSUYA_DYE_UNDER_SURFACE;
    if (channel_count < 1 || channel_count > TSUYA_MATERIAL_MAX_CHANNELS || (!channels && channel_count != 3)) {
        TSUYA_GOTO_DONE(status, tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d channels: expected 1 to %d, each with its name", name,
                                           channel_count, TSUYA_MATERIAL_MAX_CHANNELS));
    }
    TSUYA_GOTO_DONE(status, name_channels(m, channel_count, channels ? channels : rgb_channels));
    m->name = tsuya_strdup(name);
    m->note = tsuya_strdup("");
    if (!m->name || !m->note) {
        TSUYA_GOTO_DONE(status, TSUYA_ERROR_MEMORY);
    }
    TSUYA_GOTO_DONE(status, tsuya_energy_tables_create(&m->albedo, &m->limit, m->model, m->state, channel_count));
    *material = m;
    return TSUYA_OK;
done:
    if (state && model->free_state) {
        model->free_state(state);
    }
    tsuya_material_free(m);
    return status;
}

void tsuya_material_free(tsuya_material *material)
{
    if (!material) {
        return;
    }
    if (material->state && material->model->free_state) {
        material->model->free_state(material->state);
    }
    tsuya_albedo_table_free(material->albedo);
    tsuya_albedo_table_free(material->limit);
    tsuya_free(material->name);
    tsuya_free(material->note);
    tsuya_free(material->channel_name);
    tsuya_free(material->channel);
    tsuya_free(material->dye);
    tsuya_free(material);
}

tsuya_status tsuya_material_set_note(tsuya_material *material, const char *note)
{
    char *copy = tsuya_strdup(note);
    if (!copy) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_free(material->note);
    material->note = copy;
    return TSUYA_OK;
}

tsuya_material_info tsuya_material_get_info(const tsuya_material *m)
{
    size_t per_channel = sizeof *m->channel_name + sizeof *m->channel + sizeof *m->dye;
    return (tsuya_material_info){
        .name = m->name,
        .note = m->note,
        .model = m->model->name,
        .is_default = m->is_default,
        .relative = m->relative,
        .channel_count = m->channel_count,
        .channel = m->channel,
        .support = m->support,
        .heldout_cbrt = m->heldout_cbrt,
        .heldout_log = m->heldout_log,
        .bytes = sizeof *m + (size_t)m->channel_count * per_channel + tsuya_albedo_table_bytes(m->albedo) + m->model->bytes(m->state) +
                 (m->limit ? tsuya_albedo_table_bytes(m->limit) : 0),
    };
}

tsuya_status tsuya_material_set_dye(tsuya_material *material, const double rgb[3])
{
    for (int c = 0; c < 3; ++c) {
        if (material->channel_count != 3 || strcmp(material->channel[c], rgb_channels[c]) != 0) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: a dye in r, g, b needs a material with the channels r, g, b; this one has %d",
                              material->name, material->channel_count);
        }
    }
    return tsuya_material_set_channel_dye(material, rgb);
}

tsuya_status tsuya_material_set_channel_dye(tsuya_material *material, const double *dye)
{
    for (int c = 0; c < material->channel_count; ++c) {
        if (!(dye[c] >= 0.0 && dye[c] <= 1.0 + 1e-12)) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: dye %s %g: expected a linear reflectance in [0, 1]", material->name, material->channel[c], dye[c]);
        }
    }
    memcpy(material->dye, dye, (size_t)material->channel_count * sizeof *dye);
    material->coupling = TSUYA_DYE_UNDER_SURFACE;
    return TSUYA_OK;
}

const double *tsuya_material_dye(const tsuya_material *material)
{
    return material->dye;
}

static bool any_dye(const double *dye, int channels)
{
    for (int c = 0; c < channels; ++c) {
        if (dye[c] > 0.0) {
            return true;
        }
    }
    return false;
}

/* A direction that is not finite is not above the surface. */
static bool above(tsuya_vec3 wi, tsuya_vec3 wo)
{
    return wi.z > 0.0 && wo.z > 0.0 && isfinite(wi.x + wi.y + wi.z + (wo.x + wo.y + wo.z));
}

static tsuya_material_view blind_view(const tsuya_material *m, const double *dye, tsuya_vec3 wo)
{
    tsuya_material_view v;
    v.material = m;
    v.dye = dye ? dye : m->dye;
    v.wo = above(wo, wo) ? wo : (tsuya_vec3){0.0, 0.0, -1.0};
    v.coloured = any_dye(v.dye, m->channel_count);
    v.limit = v.dye_share = 1.0;
    return v;
}

static void look_at_limit(tsuya_material_view *v)
{
    if (v->material->limit && v->wo.z > 0.0) {
        tsuya_albedo_table_eval(v->material->limit, v->wo, &v->limit);
    }
}

/* The dye's share of draws is its part of the whole albedo, channels summed. */
static void look_at_albedo(tsuya_material_view *v)
{
    const tsuya_material *m = v->material;
    double below = 0.0, over = 0.0;
    if (!(v->wo.z > 0.0)) {
        return;
    }
    tsuya_albedo_table_eval(m->albedo, v->wo, v->rest);
    for (int c = 0; c < m->channel_count; ++c) {
        double surface = v->rest[c];
        v->rest[c] = tsuya_dye_rest(surface);
        over += surface;
        below += v->dye[c] * (m->coupling == TSUYA_DYE_LAMBERT ? 1.0 : v->rest[c]);
    }
    v->dye_share = over > 0.0 ? below / (below + over) : 1.0;
}

tsuya_material_view tsuya_material_view_of(const tsuya_material *m, const double *dye, tsuya_vec3 wo)
{
    tsuya_material_view v = blind_view(m, dye, wo);
    look_at_limit(&v);
    look_at_albedo(&v);
    return v;
}

static void add_dye(const tsuya_material_view *v, tsuya_vec3 wi, double *value)
{
    const tsuya_material *m = v->material;
    if (m->coupling == TSUYA_DYE_LAMBERT) {
        for (int c = 0; c < m->channel_count; ++c) {
            value[c] += v->dye[c] / M_PI;
        }
        return;
    }
    double albedo[TSUYA_MATERIAL_MAX_CHANNELS];
    tsuya_albedo_table_eval(m->albedo, wi, albedo);
    for (int c = 0; c < m->channel_count; ++c) {
        value[c] += v->dye[c] * tsuya_dye_rest(albedo[c]) * v->rest[c] * m->albedo->inverse_rest[c];
    }
}

void tsuya_material_view_eval(const tsuya_material_view *v, tsuya_vec3 wi, double *value)
{
    const tsuya_material *m = v->material;
    if (!above(wi, v->wo)) {
        memset(value, 0, (size_t)m->channel_count * sizeof *value);
        return;
    }
    m->model->eval(m->state, m->channel_count, wi, v->wo, value);
    if (m->limit) {
        double there;
        tsuya_albedo_table_eval(m->limit, wi, &there);
        for (int c = 0; c < m->channel_count; ++c) {
            value[c] *= there * v->limit;
        }
    }
    if (v->coloured) {
        add_dye(v, wi, value);
    }
}

double tsuya_material_view_pdf(const tsuya_material_view *v, tsuya_vec3 wi)
{
    if (!above(wi, v->wo)) {
        return 0.0;
    }
    double pdf = v->dye_share * wi.z / M_PI;
    return v->dye_share < 1.0 ? pdf + (1.0 - v->dye_share) * v->material->model->pdf(v->material->state, wi, v->wo) : pdf;
}

double tsuya_material_view_eval_pdf(const tsuya_material_view *v, tsuya_vec3 wi, double *value)
{
    tsuya_material_view_eval(v, wi, value);
    return tsuya_material_view_pdf(v, wi);
}

bool tsuya_material_view_sample(const tsuya_material_view *v, const double u[3], tsuya_vec3 *wi)
{
    if (!(v->wo.z > 0.0)) {
        return false;
    }
    if (u[2] < v->dye_share) {
        *wi = tsuya_sample_cosine(u[0], u[1]);
        return wi->z > 0.0;
    }
    return v->material->model->sample(v->material->state, v->wo, u, wi) && wi->z > 0.0;
}

void tsuya_material_eval(const tsuya_material *m, const double *dye, tsuya_vec3 wi, tsuya_vec3 wo, double *value)
{
    tsuya_material_view v = blind_view(m, dye, wo);
    look_at_limit(&v);
    if (v.coloured && m->coupling == TSUYA_DYE_UNDER_SURFACE) {
        look_at_albedo(&v);
    }
    tsuya_material_view_eval(&v, wi, value);
}

double tsuya_material_pdf(const tsuya_material *m, const double *dye, tsuya_vec3 wi, tsuya_vec3 wo)
{
    tsuya_material_view v = blind_view(m, dye, wo);
    look_at_albedo(&v);
    return tsuya_material_view_pdf(&v, wi);
}

double tsuya_material_eval_pdf(const tsuya_material *m, const double *dye, tsuya_vec3 wi, tsuya_vec3 wo, double *value)
{
    tsuya_material_view v = tsuya_material_view_of(m, dye, wo);
    return tsuya_material_view_eval_pdf(&v, wi, value);
}

bool tsuya_material_sample(const tsuya_material *m, const double *dye, tsuya_vec3 wo, const double u[3], tsuya_vec3 *wi)
{
    tsuya_material_view v = blind_view(m, dye, wo);
    look_at_albedo(&v);
    return tsuya_material_view_sample(&v, u, wi);
}

void tsuya_material_albedo(const tsuya_material *m, const double *dye, tsuya_vec3 wo, double *value)
{
    if (!above(wo, wo)) {
        memset(value, 0, (size_t)m->channel_count * sizeof *value);
        return;
    }
    dye = dye ? dye : m->dye;
    tsuya_albedo_table_eval(m->albedo, wo, value);
    for (int c = 0; c < m->channel_count; ++c) {
        value[c] += dye[c] * (m->coupling == TSUYA_DYE_LAMBERT ? 1.0 : tsuya_dye_rest(value[c]));
    }
}

enum { BLOCK = 256 };

/* value += constant, a channel, where both directions are finite and above the surface, and 0 elsewhere, for one block. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
finish_block(const tsuya_direction_batch *b, int from, int count, const float *constant, int channels, float *restrict value)
{
    const float *restrict ix = b->wi_x + from, *restrict iy = b->wi_y + from, *restrict iz = b->wi_z + from;
    const float *restrict ox = b->wo_x + from, *restrict oy = b->wo_y + from, *restrict oz = b->wo_z + from;
    int seen[BLOCK];
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        seen[k] = (iz[k] > 0.0f) & (oz[k] > 0.0f) & (fabsf(ix[k] + iy[k] + iz[k] + (ox[k] + oy[k] + oz[k])) < INFINITY);
    }
    for (int c = 0; c < channels; ++c) {
        float *restrict plane = value + (size_t)c * (size_t)b->count + from, more = constant[c];
#pragma omp simd
        for (int k = 0; k < count; ++k) {
            float sum = plane[k] + more;
            plane[k] = seen[k] ? sum : 0.0f;
        }
    }
}

void tsuya_material_eval_batch(const tsuya_material *m, const double *dye, const tsuya_direction_batch *batch, float *value)
{
    float constant[TSUYA_MATERIAL_MAX_CHANNELS];
    dye = dye ? dye : m->dye;
    m->model->eval_batch(m->state, m->channel_count, batch, value);
    if (m->limit) {
        tsuya_limit_batch(m->limit, m->channel_count, batch, value);
    }
    if (m->model->clears && !any_dye(dye, m->channel_count)) {
        return;
    }
    if (m->coupling == TSUYA_DYE_UNDER_SURFACE) {
        tsuya_dye_add_batch(m->albedo, dye, batch, value);
    }
    for (int c = 0; c < m->channel_count; ++c) {
        constant[c] = m->coupling == TSUYA_DYE_LAMBERT ? (float)(dye[c] / M_PI) : 0.0f;
    }
    for (int from = 0; from < batch->count; from += BLOCK) {
        int count = batch->count - from < BLOCK ? batch->count - from : BLOCK;
        finish_block(batch, from, count, constant, m->channel_count, value);
    }
}
