/* OpenCV's local features (SIFT, Lowe 2004) and two-view geometry, for the overlap between photographs. */
#ifndef TSUYA_CAPTURE_OPENCV_ADAPTER_H
#define TSUYA_CAPTURE_OPENCV_ADAPTER_H

#include "core/geometry.h"
#include "core/image.h"

#ifdef __cplusplus
extern "C" {
#endif

typedef struct tsuya_features tsuya_features;

/* At most `most` features of an 8-bit grey image where `mask` (same size, may be NULL) is not 0. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_features_find(tsuya_features **features, const tsuya_image *grey,
                                                                 const tsuya_image *mask, int most, int threads);
TSUYA_INTERNAL void tsuya_features_free(tsuya_features *features);
TSUYA_INTERNAL int tsuya_features_count(const tsuya_features *features);
/* Pixel of a feature. */
TSUYA_INTERNAL void tsuya_features_place(const tsuya_features *features, int index, double *x_px, double *y_px);
/* Radius of the blob that the feature is, px. */
TSUYA_INTERNAL double tsuya_features_radius(const tsuya_features *features, int index);

typedef struct tsuya_feature_pair { int a, b; } tsuya_feature_pair;
/* Mutual nearest neighbours that pass Lowe's ratio test and obey one fundamental matrix (RANSAC at `tolerance_px`).
 * `pairs`: room for the smaller of both counts. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_features_match(tsuya_feature_pair *pairs, int *count, const tsuya_features *a,
                                                                  const tsuya_features *b, double tolerance_px, int threads);

/* A picture's features with its lens. */
typedef struct tsuya_features_view { const tsuya_features *features; double focal_px; tsuya_vec2 middle; } tsuya_features_view;
/* How the second camera is turned against the first: rotation of b_from_a out of the essential matrix of the matched pairs, and how many
 * of them agree with it and lie before both cameras (0: no essential matrix). */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_features_turn(tsuya_mat3 *turn, int *agreeing, const tsuya_features_view *a,
                                                                 const tsuya_features_view *b, const tsuya_feature_pair *pairs, int count,
                                                                 double tolerance_px);

#ifdef __cplusplus
}
#endif
#endif
