/* How far a material is from reciprocity and from energy conservation. */
#include "brdf/fit.h"

#include "core/context.h"

#include <string.h>

enum { PAIRS = 4096, VIEWS = 64, SIDE = 48 };

static tsuya_vec3 up_to_80(uint64_t stream, uint64_t k)
{
    double low = cos(80.0 * M_PI / 180.0), z = low + (1.0 - low) * tsuya_random_uniform(11, stream, 2 * k), r = sqrt(1.0 - z * z);
    double phi = 2.0 * M_PI * tsuya_random_uniform(11, stream, 2 * k + 1);
    return (tsuya_vec3){r * cos(phi), r * sin(phi), z};
}

static double deficit_of(const tsuya_material *m, int channels)
{
    double a[TSUYA_MATERIAL_MAX_CHANNELS], b[TSUYA_MATERIAL_MAX_CHANNELS], difference = 0.0, sum = 0.0;
    for (uint64_t k = 0; k < PAIRS; ++k) {
        tsuya_vec3 wi = up_to_80(1, k), wo = up_to_80(2, k);
        tsuya_material_eval(m, NULL, wi, wo, a);
        tsuya_material_eval(m, NULL, wo, wi, b);
        for (int c = 0; c < channels; ++c) {
            difference += fabs(a[c] - b[c]) * wi.z * wo.z;
            sum += 0.5 * (a[c] + b[c]) * wi.z * wo.z;
        }
    }
    return sum > 0.0 ? difference / sum : 0.0;
}

static double albedo_from(const tsuya_material *m, int channels, tsuya_vec3 wo)
{
    double f[TSUYA_MATERIAL_MAX_CHANNELS], sum[TSUYA_MATERIAL_MAX_CHANNELS] = {0}, highest = 0.0;
    for (int k = 0; k < SIDE * SIDE; ++k) {
        const double u[3] = {(k % SIDE + 0.5) / SIDE, (k / SIDE + 0.5) / SIDE, fmod(0.5 + k * 0.6180339887498949, 1.0)};
        tsuya_vec3 wi;
        if (!tsuya_material_sample(m, NULL, wo, u, &wi)) {
            continue;
        }
        double pdf = tsuya_material_eval_pdf(m, NULL, wi, wo, f);
        for (int c = 0; c < channels && pdf > 0.0; ++c) {
            sum[c] += f[c] * wi.z / (pdf * SIDE * SIDE);
            highest = fmax(highest, sum[c]);
        }
    }
    return highest;
}

void tsuya_material_physics(double *reciprocity_deficit, double *furnace, const tsuya_material *m)
{
    int channels = tsuya_material_get_info(m).channel_count;
    if (reciprocity_deficit) {
        *reciprocity_deficit = deficit_of(m, channels);
    }
    double highest = 0.0;
    for (uint64_t k = 0; k < VIEWS && furnace; ++k) {
        highest = fmax(highest, albedo_from(m, channels, up_to_80(3, k)));
    }
    if (furnace) {
        *furnace = highest;
    }
}
