/* The PatchMatch kernels for AVX2: eight lanes. */
#include <math.h>
#include <stdint.h>

#ifdef __x86_64__
#pragma GCC push_options
#pragma GCC target("avx2")
#include <immintrin.h>

#define LANES 8
#define KERNEL tsuya_patch_row_avx2
#define INLINE static inline __attribute__((always_inline))

typedef float vf __attribute__((vector_size(32)));
typedef int32_t vi __attribute__((vector_size(32)));
typedef uint32_t vu __attribute__((vector_size(32)));
typedef int16_t vs __attribute__((vector_size(32)));

INLINE vf lane_sqrt(vf a) { return (vf)_mm256_sqrt_ps((__m256)a); }
INLINE vf lane_max(vf a, vf b) { return (vf)_mm256_max_ps((__m256)a, (__m256)b); }
INLINE vf lane_min(vf a, vf b) { return (vf)_mm256_min_ps((__m256)a, (__m256)b); }
INLINE vi lane_madd16(vi a, vi b) { return (vi)_mm256_madd_epi16((__m256i)a, (__m256i)b); }
/* Single loads: the gather instruction of many processors is slower. */
INLINE __m128i two_quads(const uint64_t *quad, int32_t first, int32_t second)
{
    __m128d low = _mm_load_sd((const double *)(quad + first));
    return _mm_castpd_si128(_mm_loadh_pd(low, (const double *)(quad + second)));
}
INLINE void lane_quads(vi *top, vi *bottom, const uint64_t *quad, vi index)
{
    _Alignas(32) int32_t i[LANES];
    _mm256_store_si256((__m256i *)i, (__m256i)index);
    __asm__("" ::: "memory");
    __m256i low = _mm256_set_m128i(two_quads(quad, i[4], i[5]), two_quads(quad, i[0], i[1]));
    __m256i high = _mm256_set_m128i(two_quads(quad, i[6], i[7]), two_quads(quad, i[2], i[3]));
    *top = (vi)_mm256_shuffle_ps((__m256)low, (__m256)high, 0x88);
    *bottom = (vi)_mm256_shuffle_ps((__m256)low, (__m256)high, 0xDD);
}

#include "reconstruct/patchmatch_lanes.h"
#pragma GCC pop_options
#endif
