/* A curved prior for what stereo leaves open: bare cloth, where nothing can be matched, is taken to go on as smoothly as
 * the reliable cloth around it (inside reconstruct/).
 *
 * A gap is a connected set of open pixels without a strong edge in it.  Where at least half of its rim is reliable, the
 * inverse depths of the reliable band around it are continued into it twice: with small third differences and with small
 * fourth ones.  Where the two surfaces are the same to a ground sample distance, the band says what lies in the gap; where
 * they part, it does not, and the pixel stays open.  Islands of depth inside a gap, which may be images of a lamp in satin,
 * count only as far as they agree with the band.  A pixel whose grey the band does not show, such as a dark hole between
 * sleeve and body, stays open. */
#ifndef TSUYA_RECONSTRUCT_PRIOR_H
#define TSUYA_RECONSTRUCT_PRIOR_H

#include "reconstruct/patchmatch.h"

typedef struct tsuya_prior_options {
    int min_gap_px;     /* smaller gaps are left to the surface */
    double least_rim;   /* share of a gap's outline that must be reliable */
    double max_parting; /* of the two surfaces, ground sample distances */
    float max_edge;     /* grey over two pixels: more is an edge */
} tsuya_prior_options;
tsuya_prior_options tsuya_prior_options_default(void);

typedef struct tsuya_prior_problem {
    const tsuya_stereo_image *reference;
    const uint8_t *mask;        /* 0: not to be filled; NULL: all */
    const tsuya_depth_map *map; /* filtered, at level 0 */
    double depth_min, depth_max;
} tsuya_prior_problem;

/* Depth and normals of the filled pixels alone; `cost` is the parting of the two surfaces in ground sample distances. */
TSUYA_MUST_CHECK tsuya_status tsuya_prior(tsuya_depth_map *prior, const tsuya_prior_problem *problem,
                                          const tsuya_prior_options *options, const tsuya_context *context);

/* Opens again what stands in front of a depth that another view measured: there that view sees through it. */
void tsuya_prior_drop_contradicted(tsuya_depth_map *prior, const tsuya_stereo_image *reference, const tsuya_stereo_image *other,
                                   const float *other_depth, const tsuya_context *context);

#endif
