/* The similarity that takes triangulated corners to their plates (scale.h). */
#ifndef TSUYA_RECONSTRUCT_SCALE_FIT_H
#define TSUYA_RECONSTRUCT_SCALE_FIT_H

#include "reconstruct/scale.h"

enum { TSUYA_SCALE_LEAST_CORNERS = 3 };

typedef struct tsuya_scale_item {
    int tag, plate;
    tsuya_vec3 model, target, center; /* triangulated; on the plate; the tag's centre there */
    tsuya_mat3 covariance;            /* of `model` */
    bool outlier, aside;              /* aside: held out for now */
} tsuya_scale_item;

typedef struct tsuya_scale_plate_fit {
    tsuya_mat3 rotation;
    tsuya_vec3 translation;
    double growth;
    bool used, growth_free;
} tsuya_scale_plate_fit;

typedef struct tsuya_scale_fit {
    double scale, floor_m, sigma_rel;
    tsuya_scale_plate_fit plate[TSUYA_SCALE_PLATES];
} tsuya_scale_fit;

typedef struct tsuya_scale_problem {
    const tsuya_scale_input *input;
    tsuya_scale_item *item;
    int count;
    int *tag_corners; /* triangulated corners of each tag */
    tsuya_scale_fit fit;
} tsuya_scale_problem;

/* Fits, and marks outliers. */
TSUYA_MUST_CHECK tsuya_status tsuya_scale_fit_plates(tsuya_scale_problem *p);
/* Each tag in turn against what the others say; NaN where no plate has two. */
double tsuya_scale_held_out_rms(tsuya_scale_problem *p);
/* Tags of a plate (−1: of all) with a corner that is no outlier. */
int tsuya_scale_tags_used(const tsuya_scale_problem *p, int plate);
tsuya_vec3 tsuya_scale_error(const tsuya_scale_fit *fit, const tsuya_scale_item *item);

#endif
