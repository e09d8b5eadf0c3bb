#include "brdf/tanaka.h"

#include "brdf/half_table.h"
#include "core/memory.h"

#include <string.h>

enum { SIDE_MAX = 256 };
static const double control_limit = 1e30, lowest_cosine = 1e-6;

bool tsuya_tanaka_place(tsuya_half_angles *place, tsuya_vec3 wi, tsuya_vec3 wo)
{
    double sine = sqrt(wi.x * wi.x + wi.y * wi.y);
    *place = (tsuya_half_angles){0};
    if (!(sine > 1e-12)) {
        place->theta_h = 0.5 * atan2(sqrt(wo.x * wo.x + wo.y * wo.y), wo.z);
        return false;
    }
    double x = wi.x / sine, y = wi.y / sine, ahead = -(wo.x * x + wo.y * y); /* V′ in the plane: away from the light, up */
    double v = atan2(ahead, wo.z) - atan2(sine, wi.z), side = wo.x * y - wo.y * x;
    double u = atan2(y, x) + asin(fmin(fmax(side, -1.0), 1.0));
    place->phi_h = v < 0.0 ? u + M_PI : u;
    place->theta_h = 0.5 * fabs(v);
    return true;
}

static void surface(double *value, const tsuya_tanaka *t, const tsuya_half_angles *place)
{
    int index[64], count;
    double weight[64];
    count = tsuya_sheen_stencil(index, weight, place, t->nu, t->nv, 0);
    for (int c = 0; c < t->channels; ++c) {
        double sum = 0.0;
        for (int k = 0; k < count; ++k) {
            sum += weight[k] * (double)t->net[(size_t)index[k] * (size_t)t->line + (size_t)c];
        }
        value[c] = sum;
    }
}

/* A periodic spline's mean is the mean of its control values. */
static void mean_surface(double *value, const tsuya_tanaka *t, double theta)
{
    double w[4];
    int v = tsuya_uniform_weights(w, theta, 0.0, 0.5 * M_PI, t->nv, false);
    for (int c = 0; c < t->channels; ++c) {
        value[c] = 0.0;
        for (int k = 0; k < 4 * t->nu; ++k) {
            size_t point = (size_t)(k / 4 * (t->nv + 3) + v + k % 4);
            value[c] += w[k % 4] * (double)t->net[point * (size_t)t->line + (size_t)c] / t->nu;
        }
    }
}

static void eval(const void *state, int channels, tsuya_vec3 wi, tsuya_vec3 wo, double *value)
{
    const tsuya_tanaka *t = state;
    tsuya_half_angles place;
    if (tsuya_tanaka_place(&place, wi, wo)) {
        surface(value, t, &place);
    } else {
        mean_surface(value, t, place.theta_h);
    }
    for (int c = 0; c < channels; ++c) {
        value[c] = fmax(value[c], 0.0) / fmax(wi.z, lowest_cosine);
    }
}

static void eval_batch(const void *state, int channels, const tsuya_direction_batch *b, float *value)
{
    double f[TSUYA_MATERIAL_MAX_CHANNELS];
    for (int k = 0; k < b->count; ++k) {
        eval(state, channels, (tsuya_vec3){b->wi_x[k], b->wi_y[k], b->wi_z[k]}, (tsuya_vec3){b->wo_x[k], b->wo_y[k], b->wo_z[k]}, f);
        for (int c = 0; c < channels; ++c) {
            value[(size_t)c * (size_t)b->count + (size_t)k] = (float)f[c];
        }
    }
}

/* On the bench of the paper (±30°) the half vector h lies at v = 2θh, u = φh + π. */
static double half_density(const void *user, tsuya_vec3 h)
{
    const tsuya_tanaka *t = user;
    double value[TSUYA_MATERIAL_MAX_CHANNELS], sum = 0.0;
    const tsuya_half_angles place = {.phi_h = atan2(h.y, h.x) + M_PI, .theta_h = atan2(sqrt(h.x * h.x + h.y * h.y), h.z)};
    surface(value, t, &place);
    for (int c = 0; c < t->channels; ++c) {
        sum += fmax(value[c], 0.0);
    }
    return sum;
}

tsuya_status tsuya_tanaka_prepare(tsuya_tanaka *t)
{
    tsuya_half_table_free(t->half);
    return tsuya_half_table_create(&t->half, half_density, t);
}

static double pdf(const void *state, tsuya_vec3 wi, tsuya_vec3 wo)
{
    return tsuya_half_table_pdf(((const tsuya_tanaka *)state)->half, wi, wo);
}

static bool sample(const void *state, tsuya_vec3 wo, const double u[2], tsuya_vec3 *wi)
{
    return tsuya_half_table_sample(((const tsuya_tanaka *)state)->half, wo, u, wi);
}

static void shared_draws(const void *state, int total, float *shared)
{
    tsuya_half_table_shared_draws(((const tsuya_tanaka *)state)->half, total, shared);
}

static void take_draws(const void *state, tsuya_vec3 wo, const float *shared, int total, int from, int count, float *const wi[3], float *weight)
{
    tsuya_half_table_take_draws(((const tsuya_tanaka *)state)->half, wo, shared, total, from, count, wi, weight);
}

static size_t net_size(const tsuya_tanaka *t) { return (size_t)tsuya_sheen_net_points(t->nu, t->nv, 0) * (size_t)t->line; }

tsuya_status tsuya_tanaka_create(tsuya_tanaka **state, int channels, int nu, int nv)
{
    tsuya_status status = TSUYA_OK;
    tsuya_tanaka *t;
    *state = NULL;
    TSUYA_NEW(status, t, 1);
    *t = (tsuya_tanaka){.channels = channels, .line = (channels + 3) & ~3, .nu = nu, .nv = nv};
    TSUYA_NEW(status, t->net, net_size(t));
    *state = t;
    return TSUYA_OK;
done:
    tsuya_tanaka_free(t);
    return status;
}

void tsuya_tanaka_free(void *state)
{
    tsuya_tanaka *t = state;
    if (t) {
        tsuya_half_table_free(t->half);
        tsuya_free(t->net);
        tsuya_free(t);
    }
}

static tsuya_status read_net(tsuya_tanaka *t, const tsuya_json *parameters)
{
    int count = tsuya_sheen_net_points(t->nu, t->nv, 0) * t->channels;
    double *control = tsuya_calloc((size_t)count, sizeof *control);
    if (!control) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_status status = tsuya_model_read_numbers(control, count, parameters, "control", 0.0, control_limit);
    for (int k = 0; k < count; ++k) {
        t->net[(size_t)(k / t->channels) * (size_t)t->line + (size_t)(k % t->channels)] = (float)control[k];
    }
    tsuya_free(control);
    return status;
}

static tsuya_status from_json(void **state, int channels, const tsuya_json *parameters)
{
    double nu, nv;
    tsuya_tanaka *t;
    TSUYA_TRY(tsuya_model_read_number(&nu, parameters, "functions_u", 4, SIDE_MAX));
    TSUYA_TRY(tsuya_model_read_number(&nv, parameters, "intervals_v", 1, SIDE_MAX));
    if (fmod(nu, 2.0) != 0.0 || nv != floor(nv)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "material: functions_u %g, intervals_v %g: expected an even and a whole number", nu, nv);
    }
    TSUYA_TRY(tsuya_tanaka_create(&t, channels, (int)nu, (int)nv));
    tsuya_status status = read_net(t, parameters);
    status = status == TSUYA_OK ? tsuya_tanaka_prepare(t) : status;
    if (status != TSUYA_OK) {
        tsuya_tanaka_free(t);
        return status;
    }
    *state = t;
    return TSUYA_OK;
}

static void to_json(const void *state, int channels, tsuya_json *parameters)
{
    const tsuya_tanaka *t = state;
    tsuya_json_set_number(parameters, "degree", 3);
    tsuya_json_set_number(parameters, "functions_u", t->nu);
    tsuya_json_set_number(parameters, "intervals_v", t->nv);
    tsuya_json *net = tsuya_json_set_array(parameters, "control");
    for (int k = 0; k < tsuya_sheen_net_points(t->nu, t->nv, 0) * channels; ++k) {
        tsuya_json_add_number(net, (double)t->net[(size_t)(k / channels) * (size_t)t->line + (size_t)(k % channels)]);
    }
}

static size_t bytes(const void *state)
{
    const tsuya_tanaka *t = state;
    return sizeof *t + net_size(t) * sizeof *t->net + tsuya_half_table_bytes(t->half);
}

const tsuya_brdf_model tsuya_brdf_tanaka = {
    .name = "tanaka",
    .eval = eval,
    .eval_batch = eval_batch,
    .pdf = pdf,
    .sample = sample,
    .shared_draws = shared_draws,
    .take_draws = take_draws,
    .from_json = from_json,
    .to_json = to_json,
    .free_state = tsuya_tanaka_free,
    .bytes = bytes,
};
