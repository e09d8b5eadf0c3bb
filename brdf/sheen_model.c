/* yarn, ndf and nurbs3 as models: their JSON, their sampling. */
#include "brdf/half_table.h"
#include "brdf/sheen.h"
#include "brdf/sheen_tables.h"

#include "core/memory.h"

#include <string.h>

enum { SPANS_MAX = 512, SIDE_MAX = 256, NET_MAX = 1 << 22 };
static const char *const curve_key[TSUYA_SHEEN_CURVES] = {"warp_along", "warp_across", "weft_along", "weft_across"};
static const char *const factor_key[TSUYA_SHEEN_FACTORS] = {"over_theta_d", "over_phi", "over_theta", "over_channels"};
static const double log_limit = 200.0, strength_limit = 1e30;

/* What a bench at a typical difference angle would see of the facets. */
static double half_density(const void *user, tsuya_vec3 h)
{
    const tsuya_sheen *s = user;
    tsuya_half_angles a = {.psi_t = atan2(h.x, h.z), .psi_b = atan2(h.y, h.z), .phi_h = atan2(h.y, h.x), .theta_h = acos(fmin(h.z, 1.0)),
                           .theta_d = M_PI / 6.0, .falloff = 1.0, .cosine = cos(M_PI / 6.0)};
    double value[TSUYA_MATERIAL_MAX_CHANNELS], log_value[TSUYA_MATERIAL_MAX_CHANNELS], sum = 0.0;
    tsuya_sheen_guide(value, s, &a);
    tsuya_sheen_surface(log_value, s, &a);
    for (int c = 0; c < s->channels; ++c) {
        sum += value[c] * exp(log_value[c]);
    }
    return sum;
}

tsuya_status tsuya_sheen_prepare(tsuya_sheen *s)
{
    TSUYA_TRY(tsuya_sheen_tables(s));
    tsuya_half_table_free(s->half);
    return tsuya_half_table_create(&s->half, half_density, s);
}

static double pdf(const void *state, tsuya_vec3 wi, tsuya_vec3 wo)
{
    return tsuya_half_table_pdf(((const tsuya_sheen *)state)->half, wi, wo);
}

static bool sample(const void *state, tsuya_vec3 wo, const double u[2], tsuya_vec3 *wi)
{
    return tsuya_half_table_sample(((const tsuya_sheen *)state)->half, wo, u, wi);
}

static void pdf_batch(const void *state, const tsuya_direction_batch *batch, float *pdf_of)
{
    tsuya_half_table_pdf_batch(((const tsuya_sheen *)state)->half, batch, pdf_of);
}

static void sample_batch(const void *state, int count, const float *const wo[3], const float *const u[2], float *const wi[3])
{
    tsuya_half_table_sample_batch(((const tsuya_sheen *)state)->half, count, wo, u, wi);
}

static void shared_draws(const void *state, int total, float *shared)
{
    tsuya_half_table_shared_draws(((const tsuya_sheen *)state)->half, total, shared);
}

static void take_draws(const void *state, tsuya_vec3 wo, const float *shared, int total, int from, int count, float *const wi[3], float *weight)
{
    tsuya_half_table_take_draws(((const tsuya_sheen *)state)->half, wo, shared, total, from, count, wi, weight);
}

static tsuya_status read_count(int *count, const tsuya_json *object, const char *key, int low, int high)
{
    double number;
    TSUYA_TRY(tsuya_model_read_number(&number, object, key, low, high));
    *count = (int)number;
    return number == *count ? TSUYA_OK : tsuya_fail(TSUYA_ERROR_INPUT, "material: %s: %g: expected a whole number", key, number);
}

static tsuya_status read_sizes(int *nu, int *nv, int *nd, const tsuya_json *surface, bool deep)
{
    *nu = *nv = *nd = 0;
    if (!surface) {
        return TSUYA_OK;
    }
    TSUYA_TRY(read_count(nu, surface, "functions_phi", 4, SIDE_MAX));
    TSUYA_TRY(read_count(nv, surface, "intervals_theta", 1, SIDE_MAX));
    return deep ? read_count(nd, surface, "intervals_theta_d", 1, SIDE_MAX) : TSUYA_OK;
}

/* A net of control values, as files of older versions hold it. */
static tsuya_status read_net(tsuya_sheen *s, const tsuya_json *surface)
{
    int points = tsuya_sheen_net_points(s->nu, s->nv, s->nd), channels = s->channels;
    if (points > NET_MAX / channels) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "material: surface: %d control values in %d channels: expected at most %d together", points, channels, NET_MAX);
    }
    TSUYA_TRY(tsuya_sheen_create_net(s));
    double *net = tsuya_calloc((size_t)points * (size_t)channels, sizeof *net);
    if (!net) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_status status = tsuya_model_read_numbers(net, points * channels, surface, "log_control", -log_limit, log_limit);
    for (int k = 0; k < points * channels; ++k) {
        s->net[(size_t)(k / channels) * (size_t)s->line + (size_t)(k % channels)] = (float)net[k];
    }
    tsuya_free(net);
    return status == TSUYA_OK ? tsuya_sheen_separate(s, NULL, NULL) : status;
}

static tsuya_status read_surface(tsuya_sheen *s, const tsuya_json *surface)
{
    if (s->nu == 0) {
        return TSUYA_OK;
    }
    if (tsuya_json_member(surface, "log_control")) {
        return read_net(s, surface);
    }
    TSUYA_TRY(read_count(&s->terms, surface, "terms", 0, TSUYA_SHEEN_TERMS));
    for (int k = 0; k < TSUYA_SHEEN_FACTORS; ++k) {
        TSUYA_TRY(tsuya_model_read_numbers(s->factor[k], s->terms * tsuya_sheen_factor_size(s, k), surface, factor_key[k], -log_limit, log_limit));
    }
    return TSUYA_OK;
}

static tsuya_status read_all(tsuya_sheen *s, const tsuya_json *parameters)
{
    for (int k = 0; k < TSUYA_SHEEN_CURVES; ++k) {
        TSUYA_TRY(tsuya_model_read_numbers(s->curve[k], s->spans + 3, parameters, curve_key[k], -log_limit, log_limit));
    }
    TSUYA_TRY(tsuya_model_read_numbers(&s->slant[0][0], 4, parameters, "slant", -100.0, 100.0));
    s->eta = 1.0; /* files that say nothing know no Fresnel term */
    if (tsuya_json_member(parameters, "gloss")) {
        TSUYA_TRY(tsuya_model_read_number(&s->eta, parameters, "eta", 1.3, 2.5));
        TSUYA_TRY(tsuya_model_read_number(&s->lowest_cosine, parameters, "lowest_cosine", 0.0, 0.999));
        TSUYA_TRY(tsuya_model_read_numbers(s->gloss, 2, parameters, "gloss", 0.0, strength_limit));
    }
    TSUYA_TRY(tsuya_model_read_numbers(s->strength[0], s->channels, parameters, "strength_warp", 0.0, strength_limit));
    TSUYA_TRY(tsuya_model_read_numbers(s->strength[1], s->channels, parameters, "strength_weft", 0.0, strength_limit));
    TSUYA_TRY(tsuya_model_read_numbers(s->matte, s->channels, parameters, "matte", 0.0, strength_limit));
    if (tsuya_json_member(parameters, "slant_reach")) {
        TSUYA_TRY(tsuya_model_read_numbers(s->reach, 2, parameters, "slant_reach", 0.0, 1.0));
    }
    TSUYA_TRY(read_surface(s, tsuya_json_member(parameters, "surface")));
    return tsuya_sheen_prepare(s);
}

static tsuya_status read_state(void **state, int channels, const tsuya_json *parameters, bool surface, bool deep)
{
    int spans, nu, nv, nd;
    const tsuya_json *net = surface ? tsuya_json_member(parameters, "surface") : NULL;
    if (surface && !net) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "material: surface: expected an object");
    }
    TSUYA_TRY(read_count(&spans, parameters, "intervals_psi", 4, SPANS_MAX));
    TSUYA_TRY(read_sizes(&nu, &nv, &nd, net, deep));
    tsuya_sheen *s;
    TSUYA_TRY(tsuya_sheen_create(&s, channels, spans, nu, nv, nd));
    tsuya_status status = read_all(s, parameters);
    if (status != TSUYA_OK) {
        tsuya_sheen_free(s);
        return status;
    }
    *state = s;
    return TSUYA_OK;
}

static tsuya_status yarn_from_json(void **state, int channels, const tsuya_json *parameters)
{
    return read_state(state, channels, parameters, false, false);
}

static tsuya_status ndf_from_json(void **state, int channels, const tsuya_json *parameters)
{
    return read_state(state, channels, parameters, true, false);
}

static tsuya_status nurbs3_from_json(void **state, int channels, const tsuya_json *parameters)
{
    return read_state(state, channels, parameters, true, true);
}

static void write_surface(const tsuya_sheen *s, tsuya_json *parameters)
{
    tsuya_json *surface = tsuya_json_set_object(parameters, "surface");
    tsuya_json_set_number(surface, "functions_phi", s->nu);
    tsuya_json_set_number(surface, "intervals_theta", s->nv);
    if (s->nd > 0) {
        tsuya_json_set_number(surface, "intervals_theta_d", s->nd);
    }
    tsuya_json_set_number(surface, "terms", s->terms);
    for (int k = 0; k < TSUYA_SHEEN_FACTORS; ++k) {
        tsuya_json_set_numbers(surface, factor_key[k], s->factor[k], s->terms * tsuya_sheen_factor_size(s, k));
    }
}

static void to_json(const void *state, int channels, tsuya_json *parameters)
{
    const tsuya_sheen *s = state;
    tsuya_json_set_number(parameters, "degree", 3);
    tsuya_json_set_number(parameters, "intervals_psi", s->spans);
    for (int k = 0; k < TSUYA_SHEEN_CURVES; ++k) {
        tsuya_json_set_numbers(parameters, curve_key[k], s->curve[k], s->spans + 3);
    }
    tsuya_json_set_numbers(parameters, "slant", &s->slant[0][0], 4);
    tsuya_json_set_numbers(parameters, "slant_reach", s->reach, 2);
    if (s->gloss[0] + s->gloss[1] > 0.0) {
        tsuya_json_set_number(parameters, "eta", s->eta);
        tsuya_json_set_number(parameters, "lowest_cosine", s->lowest_cosine);
        tsuya_json_set_numbers(parameters, "gloss", s->gloss, 2);
    }
    tsuya_json_set_numbers(parameters, "strength_warp", s->strength[0], channels);
    tsuya_json_set_numbers(parameters, "strength_weft", s->strength[1], channels);
    tsuya_json_set_numbers(parameters, "matte", s->matte, channels);
    if (s->nu > 0) {
        write_surface(s, parameters);
    }
}

static size_t bytes(const void *state)
{
    const tsuya_sheen *s = state;
    size_t numbers = 4 * ((size_t)s->spans + 3) + (size_t)s->channels * 3;
    for (int k = 0; k < TSUYA_SHEEN_FACTORS; ++k) {
        numbers += (size_t)(s->terms * tsuya_sheen_factor_size(s, k));
    }
    return sizeof *s + numbers * sizeof(double) + tsuya_sheen_tables_bytes(s) + tsuya_half_table_bytes(s->half);
}

#define SHEEN_MODEL(model_name, reader)                                                                                   \
    {                                                                                                                     \
        .name = model_name, .eval = tsuya_sheen_eval, .eval_batch = tsuya_sheen_eval_batch, .pdf = pdf, .sample = sample,  \
        .pdf_batch = pdf_batch, .sample_batch = sample_batch,                                                              \
        .shared_draws = shared_draws, .take_draws = take_draws, .from_json = reader, .to_json = to_json,                   \
        .free_state = tsuya_sheen_free, .bytes = bytes, .clears = true, .unbounded = true,                                 \
    }
const tsuya_brdf_model tsuya_brdf_yarn = SHEEN_MODEL("yarn", yarn_from_json);
const tsuya_brdf_model tsuya_brdf_ndf = SHEEN_MODEL("ndf", ndf_from_json);
const tsuya_brdf_model tsuya_brdf_nurbs3 = SHEEN_MODEL("nurbs3", nurbs3_from_json);
