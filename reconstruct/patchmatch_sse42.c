/* The PatchMatch kernels for SSE4.2: four lanes. */
#include <math.h>
#include <stdint.h>

#ifdef __x86_64__
#pragma GCC push_options
#pragma GCC target("sse4.2")
#include <immintrin.h>

#define LANES 4
#define KERNEL tsuya_patch_row_sse42
#define INLINE static inline __attribute__((always_inline))

typedef float vf __attribute__((vector_size(16)));
typedef int32_t vi __attribute__((vector_size(16)));
typedef uint32_t vu __attribute__((vector_size(16)));
typedef int16_t vs __attribute__((vector_size(16)));

INLINE vf lane_sqrt(vf a) { return (vf)_mm_sqrt_ps((__m128)a); }
INLINE vf lane_max(vf a, vf b) { return (vf)_mm_max_ps((__m128)a, (__m128)b); }
INLINE vf lane_min(vf a, vf b) { return (vf)_mm_min_ps((__m128)a, (__m128)b); }
INLINE vi lane_madd16(vi a, vi b) { return (vi)_mm_madd_epi16((__m128i)a, (__m128i)b); }
INLINE __m128 two_quads(const uint64_t *quad, int32_t first, int32_t second)
{
    __m128d low = _mm_load_sd((const double *)(quad + first));
    return _mm_castpd_ps(_mm_loadh_pd(low, (const double *)(quad + second)));
}
INLINE void lane_quads(vi *top, vi *bottom, const uint64_t *quad, vi index)
{
    _Alignas(16) int32_t i[LANES];
    _mm_store_si128((__m128i *)i, (__m128i)index);
    __asm__("" ::: "memory");
    __m128 low = two_quads(quad, i[0], i[1]), high = two_quads(quad, i[2], i[3]);
    *top = (vi)_mm_shuffle_ps(low, high, 0x88);
    *bottom = (vi)_mm_shuffle_ps(low, high, 0xDD);
}

#include "reconstruct/patchmatch_lanes.h"
#pragma GCC pop_options
#endif
