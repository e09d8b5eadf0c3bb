/* Points in space from the photographs that see them. */
#ifndef TSUYA_RECONSTRUCT_SCALE_POINTS_H
#define TSUYA_RECONSTRUCT_SCALE_POINTS_H

#include "reconstruct/scale.h"

typedef struct tsuya_scale_point {
    bool found;
    int views, sighted;   /* photographs that agree; registered ones that see it */
    tsuya_vec3 position;
    tsuya_mat3 covariance; /* for unit variance of weight */
} tsuya_scale_point;

typedef struct tsuya_scale_points {
    tsuya_scale_point *point; /* owned */
    int count, photos;
    double reprojection_px;
} tsuya_scale_points;

/* `count`: of all points that sightings may name. */
TSUYA_MUST_CHECK tsuya_status tsuya_scale_points_create(tsuya_scale_points *points, int count, const tsuya_sparse_model *model,
                                                        const tsuya_scale_input *input);
void tsuya_scale_points_free(tsuya_scale_points *points);
/* Symmetric positive definite 3 × 3; false where it is not. */
bool tsuya_scale_invert(tsuya_mat3 *inverse, tsuya_mat3 a);

#endif
