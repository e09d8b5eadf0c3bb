#include "render/sampler.h"

#include "core/clones.h"

TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
pairs(const uint32_t *restrict key, const uint32_t *restrict sample, int count, uint32_t pair, float *restrict u, float *restrict v)
{
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        uint32_t a, b;
        tsuya_sampler_bits((tsuya_sampler){key[k], sample[k]}, pair, &a, &b);
        u[k] = (float)(int)(a >> 8) * 0x1.0p-24f; /* 24 bits, so that none becomes 1 */
        v[k] = (float)(int)(b >> 8) * 0x1.0p-24f;
    }
}

void tsuya_sampler_pairs(const uint32_t *key, const uint32_t *sample, int count, uint32_t pair, float *u, float *v)
{
    pairs(key, sample, count, pair, u, v);
}
