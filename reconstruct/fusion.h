/* Fusion: the depth maps of a dense workspace become one point cloud.
 *
 * A pixel of a reference makes a point when enough views agree: a neighbour agrees when its own depth, seen from the
 * reference, falls on the same pixel, at the same depth, with the same normal (Schönberger et al., ECCV 2016, section 4.5;
 * Xu and Tao, CVPR 2019, section 3.5).  Every agreeing view votes for a depth along the reference's ray with its own
 * tangent plane; the votes are averaged, and their disagreement, held against the triangulation's geometry, gives sigma.
 * Each pixel of each view is used once.
 *
 * Pixels of the curved prior agree like measured ones, but a point that enough views measure is not moved by them.  Evidence
 * counts the views that measured: where the prior had to help it is less than `min_views`, down to 0, and sigma is that of
 * the prior, a ground sample distance.
 *
 * Streams: in memory are one reference and its neighbours, one bit a pixel of every view, and the points. */
#ifndef TSUYA_RECONSTRUCT_FUSION_H
#define TSUYA_RECONSTRUCT_FUSION_H

#include "core/context.h"
#include "core/json.h"
#include "core/mesh.h"

typedef struct tsuya_fusion_options {
    const char *workspace;
    bool prior;                 /* with what the curved prior closes (stereo.h); default true */
    bool geometric;             /* fuse the geometric maps (default), else the photometric ones */
    int min_views;              /* reference included; default 3 */
    int neighbours;             /* views asked about a reference, 1 … 12; default 10 */
    double max_reprojection_px; /* forward-backward, of the maps; default 1.5 */
    double max_depth_error;     /* relative; default 0.01 */
    double max_normal_deg;      /* default 25 */
    const char *const *hold_out;
    int hold_out_count;
} tsuya_fusion_options;
TSUYA_API tsuya_fusion_options tsuya_fusion_options_default(void);

typedef struct tsuya_fusion_info {
    int views;            /* references fused */
    size_t points;
    size_t points_prior;  /* of them, with fewer than min_views measured */
    double mean_views;    /* that measured a point */
    double median_sigma;  /* unit of the world */
    double gsd;           /* ground sample distance of the maps: median over views of depth / focal, unit of the world */
    double seconds;
} tsuya_fusion_info;

/* Fills `cloud` (vertices only; normal, colour, evidence = views that measured it, sigma) in the workspace's world frame.
 * Fails on missing or broken maps, on photographs that cannot be read, and when no point is supported. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_fusion(tsuya_mesh *cloud, tsuya_fusion_info *info,
                                                     const tsuya_fusion_options *options, const tsuya_context *context);
TSUYA_API void tsuya_fusion_info_to_json(tsuya_json *object, const tsuya_fusion_info *info);

#endif
