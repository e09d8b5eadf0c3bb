/* The PatchMatch kernels for AVX-512 (F, BW, DQ, VL): sixteen lanes. */
#include <math.h>
#include <stdint.h>

#ifdef __x86_64__
#pragma GCC push_options
#pragma GCC target("avx512f,avx512bw,avx512dq,avx512vl,prefer-vector-width=512")
#include <immintrin.h>

#define LANES 16
#define KERNEL tsuya_patch_row_avx512
#define INLINE static inline __attribute__((always_inline))

typedef float vf __attribute__((vector_size(64)));
typedef int32_t vi __attribute__((vector_size(64)));
typedef uint32_t vu __attribute__((vector_size(64)));
typedef int16_t vs __attribute__((vector_size(64)));

INLINE vf lane_sqrt(vf a) { return (vf)_mm512_sqrt_ps((__m512)a); }
INLINE vf lane_max(vf a, vf b) { return (vf)_mm512_max_ps((__m512)a, (__m512)b); }
INLINE vf lane_min(vf a, vf b) { return (vf)_mm512_min_ps((__m512)a, (__m512)b); }
INLINE vi lane_madd16(vi a, vi b) { return (vi)_mm512_madd_epi16((__m512i)a, (__m512i)b); }
INLINE void lane_quads(vi *top, vi *bottom, const uint64_t *quad, vi index)
{
    const __m512i even = _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
    const __m512i odd = _mm512_setr_epi32(1, 3, 5, 7, 9, 11, 13, 15, 17, 19, 21, 23, 25, 27, 29, 31);
    __m512i low = _mm512_i32gather_epi64(_mm512_castsi512_si256((__m512i)index), (const long long *)quad, 8);
    __m512i high = _mm512_i32gather_epi64(_mm512_extracti64x4_epi64((__m512i)index, 1), (const long long *)quad, 8);
    *top = (vi)_mm512_permutex2var_epi32(low, even, high);
    *bottom = (vi)_mm512_permutex2var_epi32(low, odd, high);
}

#include "reconstruct/patchmatch_lanes.h"
#pragma GCC pop_options
#endif
