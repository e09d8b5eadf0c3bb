/* Ashikhmin & Shirley's anisotropic Phong lobe ("An Anisotropic Phong BRDF Model", JGT 5(2), 2000), its specular part:
 *
 *   f = ks F(k)/F(1) √((nu+1)(nv+1)) / (8π) · hz^((nu hx² + nv hy²)/(1 − hz²)) / (k max(cosθi, cosθo)),   k = wi·h
 *
 * with Schlick's F for the reflectance 0.04 at the normal. */
#include "brdf/lobe.h"

#include "core/memory.h"

static const double normal_reflectance = 0.04;

/* hz to the exponent that belongs to h's azimuth. */
static double facets(const tsuya_lobe *l, tsuya_vec3 h)
{
    double across = h.x * h.x + h.y * h.y;
    double exponent = across > 0.0 ? (l->shape[0] * h.x * h.x + l->shape[1] * h.y * h.y) / across : 0.0;
    return h.z > 0.0 ? exp(exponent * log(fmin(h.z, 1.0))) : 0.0;
}

static double normalisation(const tsuya_lobe *l) { return sqrt((l->shape[0] + 1.0) * (l->shape[1] + 1.0)) / (2.0 * M_PI); }

static void eval(const void *state, int channels, tsuya_vec3 wi, tsuya_vec3 wo, double *value)
{
    const tsuya_lobe *l = state;
    tsuya_vec3 sum = tsuya_vec3_add(wi, wo), h = tsuya_vec3_unit(sum);
    /* wi·h in a form that both orders share where they nearly oppose each other */
    double k = fmax(0.5 * tsuya_vec3_norm(sum), 1e-9), m = 1.0 - fmin(k, 1.0), m5 = m * m * m * m * m;
    double fresnel = 1.0 + (1.0 / normal_reflectance - 1.0) * m5;
    double f = 0.25 * normalisation(l) * facets(l, h) * fresnel / (k * fmax(wi.z, wo.z));
    for (int c = 0; c < channels; ++c) {
        value[c] = l->strength[c] * f;
    }
}

static void eval_batch(const void *state, int channels, const tsuya_direction_batch *b, float *value)
{
    const tsuya_lobe *l = state;
    const float nu = (float)l->shape[0], nv = (float)l->shape[1], scale = (float)(0.25 * normalisation(l));
    const float rise = (float)(1.0 / normal_reflectance - 1.0);
    for (int i = 0; i < b->count; ++i) {
        bool seen = b->wi_z[i] > 0.0f && b->wo_z[i] > 0.0f;
        float hx = b->wi_x[i] + b->wo_x[i], hy = b->wi_y[i] + b->wo_y[i], hz = seen ? b->wi_z[i] + b->wo_z[i] : 1.0f;
        float across = hx * hx + hy * hy, ratio = across / (hz * hz);
        float k = fmaxf(0.5f * sqrtf(across + hz * hz), 1e-9f), m = fmaxf(1.0f - k, 0.0f);
        float exponent = across > 0.0f ? (nu * hx * hx + nv * hy * hy) / across : 0.0f;
        float top = seen ? fmaxf(b->wi_z[i], b->wo_z[i]) : 1.0f, e = -0.5f * exponent * log1pf(ratio);
        value[i] = e > -80.0f ? scale * expf(e) * (1.0f + rise * m * m * m * m * m) / (k * top) : 0.0f;
    }
    tsuya_lobe_scale_planes(l, channels, b->count, value);
}

static double pdf(const void *state, tsuya_vec3 wi, tsuya_vec3 wo)
{
    const tsuya_lobe *l = state;
    tsuya_vec3 h = tsuya_vec3_unit(tsuya_vec3_add(wi, wo));
    return normalisation(l) * facets(l, h) / (4.0 * fmax(tsuya_vec3_dot(wo, h), 1e-12));
}

static bool sample(const void *state, tsuya_vec3 wo, const double u[2], tsuya_vec3 *wi)
{
    const tsuya_lobe *l = state;
    double turn = 4.0 * u[1], quadrant = fmin(floor(turn), 3.0), part = turn - quadrant; /* one quadrant mirrored into four */
    bool mirrored = quadrant == 1.0 || quadrant == 3.0;
    double phi = atan(sqrt((l->shape[0] + 1.0) / (l->shape[1] + 1.0)) * tan(0.5 * M_PI * (mirrored ? 1.0 - part : part)));
    double x = cos(phi), y = sin(phi), exponent = l->shape[0] * x * x + l->shape[1] * y * y;
    double z = exp(log1p(-u[0]) / (exponent + 1.0)), r = sqrt(fmax(0.0, 1.0 - z * z));
    tsuya_vec3 h = {quadrant == 1.0 || quadrant == 2.0 ? -r * x : r * x, quadrant >= 2.0 ? -r * y : r * y, z};
    return tsuya_lobe_reflect(wi, wo, h);
}

static tsuya_status from_json(void **state, int channels, const tsuya_json *parameters)
{
    return tsuya_lobe_from_json(state, channels, parameters, "exponent_weft", "exponent_warp", 0.0, 1e6);
}

static void to_json(const void *state, int channels, tsuya_json *parameters)
{
    tsuya_lobe_to_json(state, channels, parameters, "exponent_weft", "exponent_warp");
}

const tsuya_brdf_model tsuya_brdf_ashikhmin = {
    .name = "ashikhmin",
    .eval = eval,
    .eval_batch = eval_batch,
    .pdf = pdf,
    .sample = sample,
    .from_json = from_json,
    .to_json = to_json,
    .free_state = tsuya_free,
    .bytes = tsuya_lobe_bytes,
    .mirrored = true,
    .unbounded = true,
};
