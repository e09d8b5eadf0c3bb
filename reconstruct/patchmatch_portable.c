/* The PatchMatch kernels for any processor: four lanes, which gcc maps to SSE2 or NEON. */
#include <math.h>
#include <stdint.h>

#define LANES 4
#define KERNEL tsuya_patch_row_portable
#define INLINE static inline __attribute__((always_inline))

typedef float vf __attribute__((vector_size(16)));
typedef int32_t vi __attribute__((vector_size(16)));
typedef uint32_t vu __attribute__((vector_size(16)));
typedef int16_t vs __attribute__((vector_size(16)));

INLINE vf lane_sqrt(vf a)
{
    for (int l = 0; l < LANES; l++) {
        a[l] = sqrtf(a[l]);
    }
    return a;
}
INLINE vf lane_max(vf a, vf b)
{
    vi more = a > b;
    return (vf)((more & (vi)a) | (~more & (vi)b));
}
INLINE vf lane_min(vf a, vf b)
{
    vi less = a < b;
    return (vf)((less & (vi)a) | (~less & (vi)b));
}
/* Sum of the products of the two signed 16-bit halves. */
INLINE vi lane_madd16(vi a, vi b) { return ((a << 16) >> 16) * ((b << 16) >> 16) + (a >> 16) * (b >> 16); }
INLINE void lane_quads(vi *top, vi *bottom, const uint64_t *quad, vi index)
{
    for (int l = 0; l < LANES; l++) {
        uint64_t q = quad[index[l]];
        (*top)[l] = (int32_t)(uint32_t)q;
        (*bottom)[l] = (int32_t)(uint32_t)(q >> 32);
    }
}

#include "reconstruct/patchmatch_lanes.h"
