/* Which features of two photographs show the same point: exhaustive, exact search among their descriptors, the ratio test
 * of Lowe (IJCV 2004) both ways, and, where the pair's geometry is known, only along the epipolar lines.
 *
 * Descriptors are whole numbers and so are their products: the result is the same for any instruction set and any number of
 * threads. */
#ifndef TSUYA_CORE_MATCHING_H
#define TSUYA_CORE_MATCHING_H

#include "core/camera.h"

enum { TSUYA_DESCRIPTOR_LENGTH = 128 };

typedef struct tsuya_sift_position {
    float x, y; /* px, the first pixel's centre at 0.5 */
} tsuya_sift_position;

/* A photograph's features and what they look like. */
typedef struct tsuya_sift {
    int count;
    tsuya_sift_position *position;
    uint8_t *descriptor; /* count × TSUYA_DESCRIPTOR_LENGTH, of Euclidean length 512 */
} tsuya_sift;

typedef struct tsuya_match {
    uint32_t a, b; /* indices of features */
} tsuya_match;

typedef enum tsuya_guide_kind {
    TSUYA_GUIDE_NONE,
    TSUYA_GUIDE_EPIPOLAR,   /* x_bᵀ M x_a = 0, Sampson's distance */
    TSUYA_GUIDE_HOMOGRAPHY, /* x_b ~ M x_a, distance in b */
} tsuya_guide_kind;

/* Where a match may lie. */
typedef struct tsuya_guide {
    tsuya_guide_kind kind;
    double matrix[9]; /* M, row by row */
    double most;      /* distance, in the unit of the features' positions */
} tsuya_guide;

/* Pairs (index in a, index in b), ascending in a; nearest neighbours of each other, at most 0.7 rad apart and 0.8 times as
 * far as the next one.  `guide` may be NULL.  The caller frees *match with tsuya_free. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_match_features(tsuya_match **match, int *count, const tsuya_sift *a, const tsuya_sift *b,
                                                   const tsuya_guide *guide, int threads);
TSUYA_INTERNAL void tsuya_sift_free(tsuya_sift *features);
/* Positions in px become those on the plane at depth 1, without distortion; not a number where the lens has no ray. */
TSUYA_INTERNAL void tsuya_sift_undistort(tsuya_sift *features, const tsuya_camera *camera);
/* The epipolar guide of two posed cameras, for features on the plane at depth 1. */
TSUYA_INTERNAL tsuya_guide tsuya_guide_of_poses(tsuya_pose a_from_world, tsuya_pose b_from_world, double most);

#endif
