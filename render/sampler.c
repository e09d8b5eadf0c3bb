#include "render/sampler.h"

#include "core/clones.h"

TSUYA_CLONES("arch=x86-64-v3", "default") static void
pairs(const uint32_t key[TSUYA_SAMPLER_LANES], const uint32_t sample[TSUYA_SAMPLER_LANES], uint32_t pair, double u[2][TSUYA_SAMPLER_LANES])
{
    for (int k = 0; k < TSUYA_SAMPLER_LANES; ++k) {
        double one[2];
        tsuya_sampler_pair((tsuya_sampler){key[k], sample[k]}, pair, one);
        u[0][k] = one[0];
        u[1][k] = one[1];
    }
}

void tsuya_sampler_pairs(const uint32_t key[TSUYA_SAMPLER_LANES], const uint32_t sample[TSUYA_SAMPLER_LANES], uint32_t pair,
                         double u[2][TSUYA_SAMPLER_LANES])
{
    pairs(key, sample, pair, u);
}
