#include "brdf/gltf.h"

#include <math.h>

/* Smith's term of the Charlie distribution, as tabulated by Estevez and Kulla, "Production friendly microfacet sheen BRDF", 2017. */
static double sheen_fit(double x, double alpha)
{
    static const double rough[5] = {21.5473, 3.82987, 0.19823, -1.97760, -4.32054}, smooth[5] = {25.3245, 3.32435, 0.16801, -1.27393, -4.85967};
    double share = (1.0 - alpha) * (1.0 - alpha), p[5];
    for (int k = 0; k < 5; ++k) {
        p[k] = rough[k] + share * (smooth[k] - rough[k]);
    }
    return p[0] / (1.0 + p[1] * pow(x, p[2])) + p[3] * x + p[4];
}

static double sheen_lambda(double cosine, double alpha)
{
    return cosine < 0.5 ? exp(sheen_fit(cosine, alpha)) : exp(2.0 * sheen_fit(0.5, alpha) - sheen_fit(1.0 - cosine, alpha));
}

static double sheen_lobe(double alpha, double nh, double ni, double no)
{
    double d = (2.0 + 1.0 / alpha) * pow(fmax(1.0 - nh * nh, 0.0), 0.5 / alpha) / (2.0 * M_PI);
    return d * fmin(1.0 / ((1.0 + sheen_lambda(ni, alpha) + sheen_lambda(no, alpha)) * 4.0 * ni * no), 1.0);
}

void tsuya_gltf_prepare(tsuya_gltf *g)
{
    enum { RINGS = 24, TURNS = 24 };
    double alpha = g->sheen_roughness * g->sheen_roughness;
    for (int n = 0; n < TSUYA_GLTF_SHEEN_NODES; ++n) {
        double z = fmax((double)n / (TSUYA_GLTF_SHEEN_NODES - 1), 0.01), sum = 0.0;
        tsuya_vec3 wo = {sqrt(1.0 - z * z), 0.0, z};
        for (int k = 0; k < RINGS * TURNS; ++k) { /* equal shares of cosθ dω, and of half a turn */
            double r2 = (k / TURNS + 0.5) / RINGS, phi = M_PI * (k % TURNS + 0.5) / TURNS, r = sqrt(r2);
            tsuya_vec3 wi = {r * cos(phi), r * sin(phi), sqrt(1.0 - r2)}, h = tsuya_vec3_unit(tsuya_vec3_add(wi, wo));
            sum += sheen_lobe(alpha, h.z, wi.z, wo.z);
        }
        g->sheen_albedo[n] = sum * M_PI / (RINGS * TURNS);
    }
}

static double sheen_albedo(const tsuya_gltf *g, double cosine)
{
    double at = fmin(fmax(cosine, 0.0), 1.0) * (TSUYA_GLTF_SHEEN_NODES - 1);
    int k = (int)fmin(at, TSUYA_GLTF_SHEEN_NODES - 2);
    return g->sheen_albedo[k] + (at - k) * (g->sheen_albedo[k + 1] - g->sheen_albedo[k]);
}

/* D V of GGX, rougher along t. */
static double surface_lobe(const tsuya_gltf *g, tsuya_vec3 h, tsuya_vec3 wi, tsuya_vec3 wo)
{
    double c = cos(g->rotation_rad), s = sin(g->rotation_rad), b = g->roughness * g->roughness, t = b + (1.0 - b) * g->anisotropy * g->anisotropy;
    double ht = (c * h.x + s * h.y) / t, hb = (c * h.y - s * h.x) / b, q = ht * ht + hb * hb + h.z * h.z;
    double i = sqrt(pow(t * (c * wi.x + s * wi.y), 2.0) + pow(b * (c * wi.y - s * wi.x), 2.0) + wi.z * wi.z);
    double o = sqrt(pow(t * (c * wo.x + s * wo.y), 2.0) + pow(b * (c * wo.y - s * wo.x), 2.0) + wo.z * wo.z);
    return 0.5 / (M_PI * t * b * q * q * (wi.z * o + wo.z * i));
}

void tsuya_gltf_eval(double value[3], const tsuya_gltf *g, tsuya_vec3 wi, tsuya_vec3 wo)
{
    value[0] = value[1] = value[2] = 0.0;
    if (!(wi.z > 0.0 && wo.z > 0.0)) {
        return;
    }
    tsuya_vec3 h = tsuya_vec3_unit(tsuya_vec3_add(wi, wo));
    double rise = pow(1.0 - fmin(tsuya_vec3_dot(wi, h), 1.0), 5.0), lobe = surface_lobe(g, h, wi, wo), f[3], most = 0.0;
    double sheen = sheen_lobe(g->sheen_roughness * g->sheen_roughness, h.z, wi.z, wo.z), tint = fmax(fmax(g->sheen[0], g->sheen[1]), g->sheen[2]);
    double below = fmin(1.0 - tint * sheen_albedo(g, wi.z), 1.0 - tint * sheen_albedo(g, wo.z));
    for (int c = 0; c < 3; ++c) {
        f[c] = g->f0[c] + (g->f90 - g->f0[c]) * rise;
        most = fmax(most, f[c]);
    }
    for (int c = 0; c < 3; ++c) {
        value[c] = g->sheen[c] * sheen + fmax(below, 0.0) * (f[c] * lobe + (1.0 - most) * g->base[c] / M_PI);
    }
}
