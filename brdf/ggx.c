/* GGX facets, isotropic and anisotropic.
 *
 *   f = min(1, ks Fη(wi·h)/Fη(0)) D(h) G2(wi, wo) / (4 cosθi cosθo)
 *
 * D: anisotropic GGX; G2: Smith, height correlated (Heitz, "Understanding the masking-shadowing function", JCGT 3(2), 2014);
 * sampling of the visible normals (Heitz, "Sampling the GGX distribution of visible normals", JCGT 7(4), 2018);
 * Fη: unpolarised dielectric Fresnel.  With S(w) = sqrt(z² + αx² x² + αy² y²) the parts fold to
 *
 *   G2/(4 zi zo) = 1 / (2 (zo S(wi) + zi S(wo))),      pdf(wi) = D(h) / (2 (zo + S(wo))),
 *
 * which stay finite at grazing angles. */
#include "brdf/kernel.h"
#include "brdf/model.h"
#include "brdf/sampling.h"

#include "core/clones.h"
#include "core/memory.h"

#include <string.h>

typedef struct ggx {
    double alpha_x, alpha_y, eta;
    double fresnel0; /* Fη(0) */
    int channels;
    double strength[]; /* ks per channel: the reflectance at normal incidence */
} ggx;

static double fresnel(double cosine, double eta)
{
    double g = sqrt(eta * eta - 1.0 + cosine * cosine);
    double a = (g - cosine) / (g + cosine), b = (cosine * (g + cosine) - 1.0) / (cosine * (g - cosine) + 1.0);
    return 0.5 * a * a * (1.0 + b * b);
}

static double distribution(const ggx *g, tsuya_vec3 h)
{
    double x = h.x / g->alpha_x, y = h.y / g->alpha_y, q = x * x + y * y + h.z * h.z;
    return 1.0 / (M_PI * g->alpha_x * g->alpha_y * q * q);
}

static double slope(const ggx *g, tsuya_vec3 w)
{
    double x = g->alpha_x * w.x, y = g->alpha_y * w.y;
    return sqrt(w.z * w.z + x * x + y * y);
}

static void eval(const void *state, int channels, tsuya_vec3 wi, tsuya_vec3 wo, double *value)
{
    const ggx *g = state;
    tsuya_vec3 h = tsuya_vec3_unit(tsuya_vec3_add(wi, wo));
    double lobe = distribution(g, h) / (2.0 * (wo.z * slope(g, wi) + wi.z * slope(g, wo)));
    double relative = fresnel(fmin(1.0, tsuya_vec3_dot(wi, h)), g->eta) / g->fresnel0;
    for (int c = 0; c < channels; ++c) {
        value[c] = fmin(1.0, g->strength[c] * relative) * lobe;
    }
}

enum { BLOCK = 256 }; /* directions at a time */

/* One block, all channels.  With h unnormalised, h2 = |h|² and unit wi, wo: wi·h/|h| = |h|/2. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
eval_block(const ggx *g, int channels, const tsuya_direction_batch *batch, int from, int count, float *restrict value)
{
    float lobe[BLOCK], relative[BLOCK];
    const float ax = (float)g->alpha_x, ay = (float)g->alpha_y, eta2 = (float)(g->eta * g->eta - 1.0);
    const float rx = 1.0f / ax, ry = 1.0f / ay, scale = (float)(1.0 / (2.0 * M_PI * g->alpha_x * g->alpha_y));
    const float per = (float)(1.0 / g->fresnel0);
    const float *restrict ix = batch->wi_x + from, *restrict iy = batch->wi_y + from, *restrict iz = batch->wi_z + from;
    const float *restrict ox = batch->wo_x + from, *restrict oy = batch->wo_y + from, *restrict oz = batch->wo_z + from;
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        float hx = ix[k] + ox[k], hy = iy[k] + oy[k], hz = iz[k] + oz[k];
        float h2 = hx * hx + hy * hy + hz * hz, share = fresnel_term(0.5f * sqrtf(h2), eta2, per);
        float x = hx * rx, y = hy * ry, q = x * x + y * y + hz * hz;
        float si = sqrtf(iz[k] * iz[k] + ax * ax * ix[k] * ix[k] + ay * ay * iy[k] * iy[k]);
        float so = sqrtf(oz[k] * oz[k] + ax * ax * ox[k] * ox[k] + ay * ay * oy[k] * oy[k]);
        float r = h2 / (q > 1e-30f ? q : 1e-30f), f = scale * r * r / (oz[k] * si + iz[k] * so);
        bool seen = (iz[k] > 0.0f) & (oz[k] > 0.0f) & (fabsf(hx + hy + hz) < INFINITY);
        lobe[k] = seen ? f : 0.0f;
        relative[k] = seen ? share : 0.0f;
    }
    for (int c = 0; c < channels; ++c) {
        float strength = (float)g->strength[c], *restrict to = value + (size_t)c * (size_t)batch->count + from;
#pragma omp simd
        for (int k = 0; k < count; ++k) {
            float reflectance = strength * relative[k];
            to[k] = (reflectance < 1.0f ? reflectance : 1.0f) * lobe[k];
        }
    }
}

static void eval_batch(const void *state, int channels, const tsuya_direction_batch *batch, float *value)
{
    for (int from = 0; from < batch->count; from += BLOCK) {
        int count = batch->count - from < BLOCK ? batch->count - from : BLOCK;
        eval_block(state, channels, batch, from, count, value);
    }
}

TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
pdf_all(const ggx *g, const tsuya_direction_batch *batch, float *restrict pdf)
{
    const float ax = (float)g->alpha_x, ay = (float)g->alpha_y, rx = 1.0f / ax, ry = 1.0f / ay;
    const float scale = (float)(1.0 / (2.0 * M_PI * g->alpha_x * g->alpha_y));
    const float *restrict ix = batch->wi_x, *restrict iy = batch->wi_y, *restrict iz = batch->wi_z;
    const float *restrict ox = batch->wo_x, *restrict oy = batch->wo_y, *restrict oz = batch->wo_z;
#pragma omp simd
    for (int k = 0; k < batch->count; ++k) {
        float hx = ix[k] + ox[k], hy = iy[k] + oy[k], hz = iz[k] + oz[k], h2 = hx * hx + hy * hy + hz * hz;
        float x = hx * rx, y = hy * ry, q = x * x + y * y + hz * hz, r = h2 / (q > 1e-30f ? q : 1e-30f);
        pdf[k] = scale * r * r / (oz[k] + sqrtf(oz[k] * oz[k] + ax * ax * ox[k] * ox[k] + ay * ay * oy[k] * oy[k]));
    }
}

static void pdf_batch(const void *state, const tsuya_direction_batch *batch, float *pdf) { pdf_all(state, batch, pdf); }

TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
sample_all(const ggx *g, int count, const float *const wo[3], const float *const u[2], float *const wi[3])
{
    const float ax = (float)g->alpha_x, ay = (float)g->alpha_y;
    const float *restrict ox = wo[0], *restrict oy = wo[1], *restrict oz = wo[2], *restrict ua = u[0], *restrict ub = u[1];
    float *restrict ix = wi[0], *restrict iy = wi[1], *restrict iz = wi[2];
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        float vx = ax * ox[k], vy = ay * oy[k], vz = oz[k], flat = vx * vx + vy * vy, size = 1.0f / sqrtf(flat + vz * vz);
        float turn = flat > 0.0f ? 1.0f / sqrtf(flat) : 0.0f, tx = flat > 0.0f ? -vy * turn : 1.0f, ty = vx * turn, p, q;
        vx *= size;
        vy *= size;
        vz *= size;
        tsuya_sample_disk_f32(ua[k], ub[k], &p, &q);
        float s = 0.5f * (1.0f + vz), across = 1.0f - p * p;
        q = (1.0f - s) * sqrtf(across > 0.0f ? across : 0.0f) + s * q;
        float rest = across - q * q, r = sqrtf(rest > 0.0f ? rest : 0.0f);
        float hx = ax * (tx * p - vz * ty * q + vx * r), hy = ay * (ty * p + vz * tx * q + vy * r), hz = (vx * ty - vy * tx) * q + vz * r;
        hz = hz > 0.0f ? hz : 0.0f;
        float twice = 2.0f * (ox[k] * hx + oy[k] * hy + oz[k] * hz) / (hx * hx + hy * hy + hz * hz);
        ix[k] = twice * hx - ox[k];
        iy[k] = twice * hy - oy[k];
        iz[k] = twice * hz - oz[k];
    }
}

static void sample_batch(const void *state, int count, const float *const wo[3], const float *const u[2], float *const wi[3])
{
    sample_all(state, count, wo, u, wi);
}

static double pdf(const void *state, tsuya_vec3 wi, tsuya_vec3 wo)
{
    const ggx *g = state;
    tsuya_vec3 h = tsuya_vec3_unit(tsuya_vec3_add(wi, wo));
    return distribution(g, h) / (2.0 * (wo.z + slope(g, wo)));
}

static bool sample(const void *state, tsuya_vec3 wo, const double u[2], tsuya_vec3 *wi)
{
    const ggx *g = state;
    tsuya_vec3 v = tsuya_vec3_unit((tsuya_vec3){g->alpha_x * wo.x, g->alpha_y * wo.y, wo.z});
    double across = v.x * v.x + v.y * v.y;
    tsuya_vec3 t1 = across > 0.0 ? tsuya_vec3_scale((tsuya_vec3){-v.y, v.x, 0.0}, 1.0 / sqrt(across)) : (tsuya_vec3){1.0, 0.0, 0.0};
    tsuya_vec3 t2 = tsuya_vec3_cross(v, t1);
    double r = sqrt(u[0]), phi = 2.0 * M_PI * u[1], p1 = r * cos(phi), s = 0.5 * (1.0 + v.z);
    double p2 = (1.0 - s) * sqrt(fmax(0.0, 1.0 - p1 * p1)) + s * r * sin(phi);
    double p3 = sqrt(fmax(0.0, 1.0 - p1 * p1 - p2 * p2));
    tsuya_vec3 n = tsuya_vec3_add(tsuya_vec3_scale(t1, p1), tsuya_vec3_add(tsuya_vec3_scale(t2, p2), tsuya_vec3_scale(v, p3)));
    tsuya_vec3 h = tsuya_vec3_unit((tsuya_vec3){g->alpha_x * n.x, g->alpha_y * n.y, fmax(0.0, n.z)});
    *wi = tsuya_vec3_unit(tsuya_vec3_mad(tsuya_vec3_scale(wo, -1.0), 2.0 * tsuya_vec3_dot(wo, h), h));
    return wi->z > 0.0;
}

static tsuya_status create(ggx **state, int channels, double alpha_x, double alpha_y, double eta)
{
    ggx *g = tsuya_calloc(1, sizeof *g + (size_t)channels * sizeof g->strength[0]);
    if (!g) {
        return TSUYA_ERROR_MEMORY;
    }
    *g = (ggx){.alpha_x = alpha_x, .alpha_y = alpha_y, .eta = eta, .fresnel0 = fresnel(1.0, eta), .channels = channels};
    *state = g;
    return TSUYA_OK;
}

tsuya_status tsuya_ggx_create(void **state, int channels, double alpha_weft, double alpha_warp, double eta, const double *strength)
{
    ggx *g;
    TSUYA_TRY(create(&g, channels, alpha_weft, alpha_warp, eta));
    memcpy(g->strength, strength, (size_t)channels * sizeof *strength);
    *state = g;
    return TSUYA_OK;
}

/* Roughness below 1e-3 is a mirror, which no cloth is; above 1 the distribution turns inside out. */
static const double alpha_range[2] = {1e-3, 1.0}, eta_range[2] = {1.01, 4.0};

static tsuya_status read_state(void **state, int channels, const tsuya_json *parameters, const char *key_x, const char *key_y)
{
    double alpha_x, alpha_y, eta;
    TSUYA_TRY(tsuya_model_read_number(&alpha_x, parameters, key_x, alpha_range[0], alpha_range[1]));
    TSUYA_TRY(tsuya_model_read_number(&alpha_y, parameters, key_y, alpha_range[0], alpha_range[1]));
    TSUYA_TRY(tsuya_model_read_number(&eta, parameters, "eta", eta_range[0], eta_range[1]));
    ggx *g;
    TSUYA_TRY(create(&g, channels, alpha_x, alpha_y, eta));
    tsuya_status status = tsuya_model_read_numbers(g->strength, channels, parameters, "strength", 0.0, 1.0);
    if (status != TSUYA_OK) {
        tsuya_free(g);
        return status;
    }
    *state = g;
    return TSUYA_OK;
}

static tsuya_status from_json_aniso(void **state, int channels, const tsuya_json *parameters)
{
    return read_state(state, channels, parameters, "alpha_weft", "alpha_warp");
}

static tsuya_status from_json_iso(void **state, int channels, const tsuya_json *parameters)
{
    return read_state(state, channels, parameters, "alpha", "alpha");
}

static void to_json_aniso(const void *state, int channels, tsuya_json *parameters)
{
    const ggx *g = state;
    tsuya_json_set_number(parameters, "alpha_weft", g->alpha_x);
    tsuya_json_set_number(parameters, "alpha_warp", g->alpha_y);
    tsuya_json_set_number(parameters, "eta", g->eta);
    tsuya_json_set_numbers(parameters, "strength", g->strength, channels);
}

static void to_json_iso(const void *state, int channels, tsuya_json *parameters)
{
    const ggx *g = state;
    tsuya_json_set_number(parameters, "alpha", g->alpha_x);
    tsuya_json_set_number(parameters, "eta", g->eta);
    tsuya_json_set_numbers(parameters, "strength", g->strength, channels);
}

static size_t bytes(const void *state)
{
    const ggx *g = state;
    return sizeof *g + (size_t)g->channels * sizeof g->strength[0];
}

#define GGX_COMMON .eval = eval, .eval_batch = eval_batch, .pdf_batch = pdf_batch, .sample_batch = sample_batch, .pdf = pdf, .sample = sample, .free_state = tsuya_free, .bytes = bytes, .mirrored = true, .clears = true

const tsuya_brdf_model tsuya_brdf_ggx = {.name = "ggx", .from_json = from_json_iso, .to_json = to_json_iso, GGX_COMMON};
const tsuya_brdf_model tsuya_brdf_ggx_aniso = {
    .name = "ggx-aniso", .from_json = from_json_aniso, .to_json = to_json_aniso, GGX_COMMON};

static bool in_range(double value, const double range[2])
{
    return value >= range[0] && value <= range[1];
}

tsuya_status tsuya_material_ggx(tsuya_material **material, double alpha_weft, double alpha_warp, const double strength[3],
                                double eta, const double dye[3])
{
    *material = NULL;
    if (!in_range(alpha_weft, alpha_range) || !in_range(alpha_warp, alpha_range) || !in_range(eta, eta_range)) {
        return tsuya_fail(TSUYA_ERROR_INPUT,
                          "ggx: alpha_weft %g, alpha_warp %g, eta %g: alpha must lie in [%g, %g], eta in [%g, %g]", alpha_weft,
                          alpha_warp, eta, alpha_range[0], alpha_range[1], eta_range[0], eta_range[1]);
    }
    ggx *g;
    TSUYA_TRY(create(&g, 3, alpha_weft, alpha_warp, eta));
    for (int c = 0; c < 3; ++c) {
        if (!(strength[c] >= 0.0 && strength[c] <= 1.0)) {
            tsuya_free(g);
            return tsuya_fail(TSUYA_ERROR_INPUT, "ggx: strength %g: expected a reflectance in [0, 1]", strength[c]);
        }
        g->strength[c] = strength[c];
    }
    TSUYA_TRY(tsuya_material_create(material, &tsuya_brdf_ggx_aniso, g, "ggx-aniso", 3, NULL));
    tsuya_status status = tsuya_material_set_dye(*material, dye);
    if (status != TSUYA_OK) {
        tsuya_material_free(*material);
        *material = NULL;
    }
    return status;
}

/* Fibroin has a refractive index of about 1.55 (F0 = 0.047).  In a warp-faced satin the floats run along the warp: narrow
 * along it, broad across it. */
tsuya_status tsuya_material_default_silk(tsuya_material **material)
{
    const double f0 = fresnel(1.0, 1.55), strength[3] = {f0, f0, f0}, dye[3] = {0.5, 0.5, 0.5};
    TSUYA_TRY(tsuya_material_ggx(material, 0.35, 0.10, strength, 1.55, dye));
    (*material)->is_default = true;
    tsuya_free((*material)->name);
    (*material)->name = tsuya_strdup("default silk satin (not measured)");
    tsuya_status status = (*material)->name ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        status = tsuya_material_set_note(*material, "built-in default: optical constants of silk and a plausible satin weave; "
                                                    "measured on no cloth");
    }
    if (status != TSUYA_OK) {
        tsuya_material_free(*material);
        *material = NULL;
    }
    return status;
}
