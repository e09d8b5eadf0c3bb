/* What the schedule (patchmatch.c) hands to the kernels (patchmatch_lanes.h, compiled once for each instruction set). */
#ifndef TSUYA_RECONSTRUCT_PATCHMATCH_SWEEP_H
#define TSUYA_RECONSTRUCT_PATCHMATCH_SWEEP_H

#include "reconstruct/patchmatch.h"

enum {
    PATCH_RADIUS = 5,
    PATCH_STEP = 2,
    PATCH_SIDE = 6, /* samples at −5, −3 … 5 */
    PATCH_SAMPLES = PATCH_SIDE * PATCH_SIDE,
    PATCH_FRACTION_BITS = 10, /* of a source pixel, in the fixed-point bilinear sample */
};

/* Costs are 1 − NCC: 0 … 2.  A window that a source does not see costs PATCH_COST_UNSEEN there. */
#define PATCH_COST_UNSEEN 2.0f
/* Scale of quad samples against grey; variance that stands for noise in NCC: windows whose contrast lies below half a
 * level of 8-bit grey correlate with nothing. */
#define QUAD_SCALE 32768.0f
#define NOISE_VARIANCE (QUAD_SCALE * QUAD_SCALE * 4e-6f)
/* A plane outside the depth range or edge-on. */
#define PATCH_COST_IMPOSSIBLE 4.0f

typedef struct patch_source {
    const uint64_t *quad;
    int stride, width_px, height_px;
    /* Homogeneous source pixel of (x, y) at inverse depth w: forward·(x, y, 1) + shift·w. Rows 0 and 1 carry the padding:
     * their quotient with row 2 is pixel + PAD. */
    float forward[3][3], shift[3];
    const float *depth;              /* NULL: no geometric term */
    float back[3][3], back_shift[3]; /* reference pixel of (x z, y z, z) in the source */
} patch_source;

typedef struct patch_level {
    const float *grey; /* padded */
    const float *keep; /* padded, 1 inside the mask, or NULL */
    int stride, width_px, height_px;
    float fx_px, fy_px, cx_px, cy_px;
    int source_count;
    patch_source source[TSUYA_STEREO_MAX_SOURCES];
    float w_min, w_max;
    float w_per_px; /* inverse depth that moves the projection by about one source pixel */
    float spatial[PATCH_SAMPLES];
    float color_factor; /* −1 / (2 σ²) */
    bool geometric, view_selection;
    uint32_t seed;
} patch_level;

typedef struct plane_field {
    int width_px, height_px;
    float *w, *wx, *wy, *cost;
    uint8_t *view;           /* the source that mattered most */
    const uint8_t *active; /* 0: not computed */
} plane_field;

typedef enum patch_mode {
    PATCH_START,  /* random planes beside the present one (where w > 0); the best stays */
    PATCH_SCORE,  /* only the present plane's cost */
    PATCH_SWEEP,  /* propagation, view selection, refinement */
} patch_mode;

typedef struct patch_pass {
    patch_mode mode;
    int color;     /* pixels with (x + y) & 1 == color; −1: all */
    uint32_t turn; /* makes random numbers of every pass different */
    float good_limit; /* cost under which a plane speaks for a source */
    float reach_px, tilt; /* largest perturbation of depth (in source pixels) and of the normal */
    int refinements; /* perturbed planes a pixel, up to 5 */
    int strips;      /* far neighbours asked: 4 all round, 2 the vertical ones, −2 the horizontal ones */
    bool anywhere; /* refinement may also jump over the whole depth range */
    bool polish;   /* parabola through the cost at neighbouring depths */
} patch_pass;

/* One row of one pass.  Returns nothing: pure computation. */
typedef void (*patch_row_kernel)(const patch_level *level, plane_field *field, const patch_pass *pass, int y);

void tsuya_patch_row_portable(const patch_level *level, plane_field *field, const patch_pass *pass, int y);
void tsuya_patch_row_sse42(const patch_level *level, plane_field *field, const patch_pass *pass, int y);
void tsuya_patch_row_avx2(const patch_level *level, plane_field *field, const patch_pass *pass, int y);
void tsuya_patch_row_avx512(const patch_level *level, plane_field *field, const patch_pass *pass, int y);

/* The kernel for `simd`, or the widest one below it that this build and processor have. */
patch_row_kernel tsuya_patch_row_kernel(tsuya_simd simd);

#endif
