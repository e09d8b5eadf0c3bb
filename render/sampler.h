/* Random numbers of the path tracer: a pure function of (seed, pixel, sample, dimension), so that an image does not depend
 * on threads or tiles.
 *
 * Each pair of dimensions of a pixel is an Owen-scrambled (0,2)-sequence of its own over the pixel's samples: the first two
 * Sobol' dimensions, index shuffled and values scrambled by the Laine–Karras hash (Burley, "Practical hash-based Owen
 * scrambling", JCGT 9(4), 2020; constants of Vegdahl 2021).  Every sample is uniform by itself, so estimates stay unbiased;
 * together they are stratified for every power of two. */
#ifndef TSUYA_RENDER_SAMPLER_H
#define TSUYA_RENDER_SAMPLER_H

#include <stdint.h>

typedef struct tsuya_sampler {
    uint32_t key;    /* of seed and pixel */
    uint32_t sample; /* index of the sample in its pixel */
} tsuya_sampler;

/* lowbias32 of Wellons, a bijection with little bias. */
static inline uint32_t tsuya_mix32(uint32_t x)
{
    x ^= x >> 16;
    x *= 0x7feb352du;
    x ^= x >> 15;
    x *= 0x846ca68bu;
    return x ^ x >> 16;
}

static inline tsuya_sampler tsuya_sampler_start(uint64_t seed, uint64_t pixel, uint32_t sample)
{
    uint32_t key = tsuya_mix32((uint32_t)seed ^ 0x9e3779b9u);
    key = tsuya_mix32(key ^ (uint32_t)(seed >> 32));
    key = tsuya_mix32(key ^ (uint32_t)pixel);
    return (tsuya_sampler){tsuya_mix32(key ^ (uint32_t)(pixel >> 32)), sample};
}

static inline uint32_t tsuya_reverse_bits32(uint32_t x)
{
    x = __builtin_bswap32(x);
    x = (x & 0x0f0f0f0fu) << 4 | (x & 0xf0f0f0f0u) >> 4;
    x = (x & 0x33333333u) << 2 | (x & 0xccccccccu) >> 2;
    return (x & 0x55555555u) << 1 | (x & 0xaaaaaaaau) >> 1;
}

/* Owen scrambling of a value whose bits are reversed: each bit is flipped by a hash of those below it. */
static inline uint32_t tsuya_scramble_reversed(uint32_t x, uint32_t key)
{
    x ^= x * 0x3d20adeau;
    x += key;
    x *= (key >> 16) | 1u;
    x ^= x * 0x05526c56u;
    return x ^ x * 0x53a22864u;
}

/* Second Sobol' dimension, bits reversed: the Pascal matrix modulo 2 as five butterflies. */
static inline uint32_t tsuya_sobol_second_reversed(uint32_t index)
{
    index ^= (index & 0xaaaaaaaau) >> 1;
    index ^= (index & 0xccccccccu) >> 2;
    index ^= (index & 0xf0f0f0f0u) >> 4;
    index ^= (index & 0xff00ff00u) >> 8;
    return index ^ (index & 0xffff0000u) >> 16;
}

/* Two numbers for a pair of dimensions, as multiples of 2⁻³². */
static inline void tsuya_sampler_bits(tsuya_sampler s, uint32_t pair, uint32_t *u, uint32_t *v)
{
    uint32_t key = tsuya_mix32(s.key ^ (pair * 0x9e3779b9u + 0x7f4a7c15u));
    uint32_t index = tsuya_reverse_bits32(tsuya_scramble_reversed(tsuya_reverse_bits32(s.sample), key));
    uint32_t a = tsuya_scramble_reversed(index, tsuya_mix32(key ^ 0xa511e9b3u));
    uint32_t b = tsuya_scramble_reversed(tsuya_sobol_second_reversed(index), tsuya_mix32(key ^ 0x63d83595u));
    *u = tsuya_reverse_bits32(a);
    *v = tsuya_reverse_bits32(b);
}

/* In [0, 1). */
static inline void tsuya_sampler_pair(tsuya_sampler s, uint32_t pair, double u[2])
{
    uint32_t a, b;
    tsuya_sampler_bits(s, pair, &a, &b);
    u[0] = a * 0x1.0p-32;
    u[1] = b * 0x1.0p-32;
}

/* The same for many samplers at once, in float: count a multiple of 16. */
void tsuya_sampler_pairs(const uint32_t *key, const uint32_t *sample, int count, uint32_t pair, float *u, float *v);

#endif
