/* The maps and colours of single views, as fusion holds them (inside reconstruct/). */
#ifndef TSUYA_RECONSTRUCT_FUSION_VIEWS_H
#define TSUYA_RECONSTRUCT_FUSION_VIEWS_H

#include "core/image.h"
#include "reconstruct/patchmatch.h"

typedef struct tsuya_fusion_view {
    int view;            /* index in the model */
    tsuya_camera camera; /* of the maps */
    tsuya_pose camera_from_world, world_from_camera;
    tsuya_depth_map map; /* with the prior's pixels in its gaps */
    uint8_t *prior;      /* 1: from the prior; NULL: none are */
    tsuya_image color;   /* 8 bit, three channels, at the maps' size */
    uint64_t used;       /* clock of the last use */
} tsuya_fusion_view;

/* Keeps the views that were asked for last, at most `capacity`; with the prior's maps where `prior` says so and they exist. */
typedef struct tsuya_fusion_views tsuya_fusion_views;
TSUYA_MUST_CHECK tsuya_status tsuya_fusion_views_create(tsuya_fusion_views **views, const tsuya_sparse_model *model,
                                                        const char *workspace, const char *kind, bool prior,
                                                        int capacity);
void tsuya_fusion_views_free(tsuya_fusion_views *views);
/* At most `capacity` views at once, borrowed until the next call. */
TSUYA_MUST_CHECK tsuya_status tsuya_fusion_views_get(tsuya_fusion_view **out, tsuya_fusion_views *views,
                                                     const int *index, int count);

#endif
