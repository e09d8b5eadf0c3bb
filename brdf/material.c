#include "brdf/dye.h"
#include "brdf/sampling.h"

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

static tsuya_status make_tables(tsuya_material *m)
{
    double highest;
    TSUYA_TRY(tsuya_albedo_table_create(&m->albedo, &highest, m->model, m->state, m->channel_count, NULL));
    if (!m->model->unbounded || !(highest > 0.999)) {
        return TSUYA_OK;
    }
    tsuya_albedo_table_free(m->albedo);
    m->albedo = NULL;
    TSUYA_TRY(tsuya_limit_table_create(&m->limit, m->model, m->state, m->channel_count));
    return tsuya_albedo_table_create(&m->albedo, NULL, m->model, m->state, m->channel_count, m->limit);
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
    TSUYA_GOTO_DONE(status, make_tables(m));
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
        if (!(rgb[c] >= 0.0 && rgb[c] <= 1.0)) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: dye %s %g: expected a linear reflectance in [0, 1]", material->name,
                              rgb_channels[c], rgb[c]);
        }
    }
    memcpy(material->dye, rgb, 3 * sizeof *rgb);
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

static void add_dye(const tsuya_material *m, const double *dye, tsuya_vec3 wi, tsuya_vec3 wo, double *value)
{
    if (m->coupling == TSUYA_DYE_LAMBERT) {
        for (int c = 0; c < m->channel_count; ++c) {
            value[c] += dye[c] / M_PI;
        }
        return;
    }
    double ai[TSUYA_MATERIAL_MAX_CHANNELS], ao[TSUYA_MATERIAL_MAX_CHANNELS];
    tsuya_albedo_table_eval(m->albedo, wi, ai);
    tsuya_albedo_table_eval(m->albedo, wo, ao);
    for (int c = 0; c < m->channel_count; ++c) {
        value[c] += dye[c] * (1.0 - ai[c]) * (1.0 - ao[c]) * m->albedo->inverse_rest[c];
    }
}

static bool above(tsuya_vec3 wi, tsuya_vec3 wo)
{
    return wi.z > 0.0 && wo.z > 0.0;
}

void tsuya_material_eval(const tsuya_material *m, const double *dye, tsuya_vec3 wi, tsuya_vec3 wo, double *value)
{
    if (!above(wi, wo)) {
        memset(value, 0, (size_t)m->channel_count * sizeof *value);
        return;
    }
    dye = dye ? dye : m->dye;
    m->model->eval(m->state, m->channel_count, wi, wo, value);
    if (m->limit) {
        double a, b;
        tsuya_albedo_table_eval(m->limit, wi, &a);
        tsuya_albedo_table_eval(m->limit, wo, &b);
        for (int c = 0; c < m->channel_count; ++c) {
            value[c] *= a * b;
        }
    }
    if (any_dye(dye, m->channel_count)) {
        add_dye(m, dye, wi, wo, value);
    }
}

/* Share of draws that go to the dye: its part of the whole albedo, channels summed. */
static double dye_share(const tsuya_material *m, const double *dye, tsuya_vec3 wo)
{
    double surface[TSUYA_MATERIAL_MAX_CHANNELS], below = 0.0, over = 0.0;
    tsuya_albedo_table_eval(m->albedo, wo, surface);
    for (int c = 0; c < m->channel_count; ++c) {
        over += surface[c];
        below += dye[c] * (m->coupling == TSUYA_DYE_LAMBERT ? 1.0 : 1.0 - surface[c]);
    }
    return over > 0.0 ? below / (below + over) : 1.0;
}

static double mixed_pdf(const tsuya_material *m, const double *dye, tsuya_vec3 wi, tsuya_vec3 wo)
{
    double share = dye_share(m, dye, wo), pdf = share * wi.z / M_PI;
    return share < 1.0 ? pdf + (1.0 - share) * m->model->pdf(m->state, wi, wo) : pdf;
}

double tsuya_material_pdf(const tsuya_material *m, const double *dye, tsuya_vec3 wi, tsuya_vec3 wo)
{
    return above(wi, wo) ? mixed_pdf(m, dye ? dye : m->dye, wi, wo) : 0.0;
}

double tsuya_material_eval_pdf(const tsuya_material *m, const double *dye, tsuya_vec3 wi, tsuya_vec3 wo, double *value)
{
    tsuya_material_eval(m, dye, wi, wo, value);
    return tsuya_material_pdf(m, dye, wi, wo);
}

bool tsuya_material_sample(const tsuya_material *m, const double *dye, tsuya_vec3 wo, const double u[3], tsuya_vec3 *wi)
{
    if (!(wo.z > 0.0)) {
        return false;
    }
    if (u[2] < dye_share(m, dye ? dye : m->dye, wo)) {
        *wi = tsuya_sample_cosine(u[0], u[1]);
        return wi->z > 0.0;
    }
    return m->model->sample(m->state, wo, u, wi) && wi->z > 0.0;
}

void tsuya_material_albedo(const tsuya_material *m, const double *dye, tsuya_vec3 wo, double *value)
{
    if (!(wo.z > 0.0)) {
        memset(value, 0, (size_t)m->channel_count * sizeof *value);
        return;
    }
    dye = dye ? dye : m->dye;
    tsuya_albedo_table_eval(m->albedo, wo, value);
    for (int c = 0; c < m->channel_count; ++c) {
        value[c] += dye[c] * (m->coupling == TSUYA_DYE_LAMBERT ? 1.0 : 1.0 - value[c]);
    }
}

void tsuya_material_eval_batch(const tsuya_material *m, const double *dye, const tsuya_direction_batch *batch, float *value)
{
    dye = dye ? dye : m->dye;
    int count = batch->count;
    m->model->eval_batch(m->state, m->channel_count, batch, value);
    if (m->limit) {
        tsuya_limit_batch(m->limit, m->channel_count, batch, value);
    }
    if (m->coupling == TSUYA_DYE_UNDER_SURFACE) {
        tsuya_dye_add_batch(m->albedo, dye, batch, value);
    }
    for (int c = 0; c < m->channel_count; ++c) {
        float *plane = value + (size_t)c * (size_t)count;
        float constant = m->coupling == TSUYA_DYE_LAMBERT ? (float)(dye[c] / M_PI) : 0.0f;
        for (int k = 0; k < count; ++k) {
            bool seen = batch->wi_z[k] > 0.0f && batch->wo_z[k] > 0.0f;
            plane[k] = seen ? plane[k] + constant : 0.0f;
        }
    }
}
