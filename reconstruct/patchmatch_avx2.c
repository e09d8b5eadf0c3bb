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

INLINE vf lane_sqrt(vf a) { return (vf)_mm256_sqrt_ps((__m256)a); }
INLINE vf lane_max(vf a, vf b) { return (vf)_mm256_max_ps((__m256)a, (__m256)b); }
INLINE vf lane_min(vf a, vf b) { return (vf)_mm256_min_ps((__m256)a, (__m256)b); }
INLINE vi lane_madd16(vi a, vi b) { return (vi)_mm256_madd_epi16((__m256i)a, (__m256i)b); }
INLINE void lane_quads(vi *top, vi *bottom, const uint64_t *quad, vi index)
{
    __m256i low = _mm256_i32gather_epi64((const long long *)quad, _mm256_castsi256_si128((__m256i)index), 8);
    __m256i high = _mm256_i32gather_epi64((const long long *)quad, _mm256_extracti128_si256((__m256i)index, 1), 8);
    __m256 even = _mm256_shuffle_ps((__m256)low, (__m256)high, 0x88);
    __m256 odd = _mm256_shuffle_ps((__m256)low, (__m256)high, 0xDD);
    *top = (vi)_mm256_permute4x64_epi64((__m256i)even, 0xD8);
    *bottom = (vi)_mm256_permute4x64_epi64((__m256i)odd, 0xD8);
}

#include "reconstruct/patchmatch_lanes.h"
#pragma GCC pop_options
#endif
