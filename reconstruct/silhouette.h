/* The mesh drawn into every photograph's own camera, against the photograph's mask. */
#ifndef TSUYA_RECONSTRUCT_SILHOUETTE_H
#define TSUYA_RECONSTRUCT_SILHOUETTE_H

#include "core/context.h"
#include "core/json.h"
#include "core/mesh.h"

typedef struct tsuya_silhouette_view {
    char *name;
    double iou;     /* pixels of both over pixels of either; 1 where neither has any */
    double covered; /* share of the mask that the mesh covers */
    double inside;  /* share of the mesh's pixels that lie in the mask */
} tsuya_silhouette_view;

typedef struct tsuya_silhouette_info {
    tsuya_silhouette_view *view; /* those that have a mask, by name */
    int count;
    double iou_median, iou_min;
} tsuya_silhouette_info;

/* `workspace`: COLMAP's dense folder with sparse/ and masks/NAME.png.  Fails where no view has a mask. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_silhouette(tsuya_silhouette_info *info, const tsuya_mesh *mesh,
                                                         const char *workspace, const tsuya_context *context);
TSUYA_API void tsuya_silhouette_info_free(tsuya_silhouette_info *info);
TSUYA_API void tsuya_silhouette_info_to_json(tsuya_json *object, const tsuya_silhouette_info *info);

#endif
