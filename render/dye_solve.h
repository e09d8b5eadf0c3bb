/* Dyes and gains from readings, once it is known how the light falls.  For render/dye.c. */
#ifndef TSUYA_RENDER_DYE_SOLVE_H
#define TSUYA_RENDER_DYE_SOLVE_H

#include "render/dye.h"
#include "render/dye_light.h"
#include "render/split.h"

enum { TSUYA_DYE_READINGS = 8 }; /* of a place at most */

/* What one photograph shows of a place: linear values; weight 0: nothing. */
typedef struct tsuya_dye_reading {
    uint32_t view;
    float weight, value[3];
} tsuya_dye_reading;

typedef struct tsuya_dye_problem {
    tsuya_mesh *fine;       /* its colours become dyes */
    const uint8_t *own;     /* 3 × vertex_count of fine: the mesh's own colours */
    const tsuya_split_place *place;
    const tsuya_dye_reading *reading; /* TSUYA_DYE_READINGS by vertex of fine */
    const tsuya_dye_looks *looks;     /* by vertex of the coarse mesh */
    int view_count;                   /* ≥ 1 */
} tsuya_dye_problem;

/* Fills the colours, and gain, seen and residual. */
TSUYA_MUST_CHECK tsuya_status tsuya_dye_solve(tsuya_dye_info *info, const tsuya_dye_problem *problem, const tsuya_context *context);

#endif
