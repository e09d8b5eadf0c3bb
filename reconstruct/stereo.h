/* The dense stage: a depth and a normal map for every photograph of a COLMAP dense workspace, by PatchMatch multi-view
 * stereo on the CPU (patchmatch.h).
 *
 * Reads WORKSPACE/sparse, WORKSPACE/images and, where it exists, WORKSPACE/masks/NAME.png (white keeps).  Writes
 *   WORKSPACE/stereo/depth_maps/NAME.photometric.bin, NAME.geometric.bin    depth along the optical axis, 0 = none
 *   WORKSPACE/stereo/depth_maps/NAME.prior.bin                             what the curved prior closes of its gaps (prior.h)
 *   WORKSPACE/stereo/normal_maps/...                                        unit, camera frame, towards the camera
 *   WORKSPACE/stereo/patch-match.cfg, fusion.cfg                            references and sources
 *   WORKSPACE/stereo/stamps/NAME.*.txt                                      hash of everything that a map depends on
 * in COLMAP's formats, each file atomically.  A map whose stamp agrees is passed over, so that a run that was cut off
 * continues.  Results depend neither on threads nor on the order of views: the second pass reads only maps of the first. */
#ifndef TSUYA_RECONSTRUCT_STEREO_H
#define TSUYA_RECONSTRUCT_STEREO_H

#include "core/camera.h"
#include "core/context.h"
#include "core/json.h"

typedef struct tsuya_stereo_options {
    const char *workspace;
    int long_side_px;  /* maps are made at this size of the longer side; 0: as the photographs are */
    int source_views;  /* at most this many for each reference, 1 … 12; default 5 */
    bool geometric;    /* second pass and its maps; default true */
    bool prior;        /* the prior's maps; default true */
    const char *const *hold_out; /* names of photographs that are neither reference nor source */
    int hold_out_count;
    size_t cache_mb;   /* photographs kept in memory; default 1024, never fewer than one reference needs */
} tsuya_stereo_options;
TSUYA_API tsuya_stereo_options tsuya_stereo_options_default(void);

typedef struct tsuya_stereo_info {
    int views;           /* references with maps */
    int views_skipped;   /* registered, but without enough points or neighbours */
    int maps_resumed;    /* passed over because their stamps agreed */
    int width_px, height_px; /* of the largest map */
    double source_views; /* mean number a reference */
    double megapixels;   /* inside the masks, of the references computed by this run */
    double seconds_per_megapixel; /* of both passes, NaN where nothing was computed */
    double closed;       /* share of the open pixels inside the masks that the prior closes, maps of this run */
    double coverage;     /* share of the pixels inside the masks that have depth, final maps of this run */
    double seconds_photometric, seconds_geometric, seconds_prior, seconds;
} tsuya_stereo_info;

/* Fails on a model without points (the depth range would be unknown), on photographs whose size is not their camera's,
 * on lenses other than pinhole, on unreadable files, disk full, interruption.  About 14 processor seconds a megapixel
 * with five sources; memory: the cache, and about 60 bytes a pixel of one reference. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_stereo(tsuya_stereo_info *info, const tsuya_stereo_options *options,
                                                     const tsuya_context *context);
TSUYA_API void tsuya_stereo_info_to_json(tsuya_json *object, const tsuya_stereo_info *info);

#endif
