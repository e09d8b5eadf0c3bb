/* PatchMatch multi-view stereo of one reference photograph (inside reconstruct/; the stage is stereo.h).
 *
 * Every pixel carries a slanted plane.  A plane is linear in inverse depth over the pixel grid, so it is kept as the
 * inverse depth w at the pixel and its slopes: w(x + dx, y + dy) = w + wx·dx + wy·dy; handing it to another pixel is
 * two multiplications, and a source's homography is linear in (w, wx, wy).
 *
 *   Bleyer, Rhemann, Rother, "PatchMatch Stereo", BMVC 2011                       slanted support windows
 *   Galliani, Lasinger, Schindler, "Massively parallel multiview stereopsis" (Gipuma), ICCV 2015    red-black order
 *   Schönberger, Zheng, Pollefeys, Frahm, "Pixelwise view selection" (COLMAP), ECCV 2016    bilateral NCC, geometric term
 *   Xu, Tao, "Multi-scale geometric consistency guided multi-view stereo" (ACMH, ACMM), CVPR 2019
 *                                       adaptive checkerboard sampling, joint view selection, coarse to fine
 *
 * A pixel of one colour reads only pixels of the other, and random numbers are a hash of pixel, iteration and level:
 * the result does not depend on threads, on the order of rows, or on how many pixels go through the lanes at once. */
#ifndef TSUYA_RECONSTRUCT_PATCHMATCH_H
#define TSUYA_RECONSTRUCT_PATCHMATCH_H

#include "core/camera.h"
#include "core/context.h"

#include <stdint.h>

enum {
    TSUYA_STEREO_PAD = 8, /* replicated pixels around every level */
    TSUYA_STEREO_MAX_LEVELS = 4,
    TSUYA_STEREO_MAX_SOURCES = 12,
};

/* One scale of one photograph.  The arrays are padded: pixel (x, y) stands at [(y + PAD)·stride + x + PAD]. */
typedef struct tsuya_stereo_level {
    int width_px, height_px, stride;
    double fx_px, fy_px, cx_px, cy_px;
    float *grey;    /* [0, 1] */
    uint64_t *quad; /* (x,y), (x+1,y), (x,y+1), (x+1,y+1) as signed 16 bit, lowest first: 32768·(grey − ½), so that one
                       64-bit load serves a bilinear sample */
} tsuya_stereo_level;

typedef struct tsuya_stereo_image {
    tsuya_pose camera_from_world;
    int level_count; /* level 0 is the finest; each next one halves */
    tsuya_stereo_level level[TSUYA_STEREO_MAX_LEVELS];
} tsuya_stereo_image;

/* `grey` is width × height without padding and of the camera's size.  Levels stop before a side falls under 24 pixels. */
TSUYA_MUST_CHECK tsuya_status tsuya_stereo_image_create(tsuya_stereo_image *image, const float *grey,
                                                        const tsuya_camera *camera, tsuya_pose camera_from_world,
                                                        int levels);
void tsuya_stereo_image_free(tsuya_stereo_image *image);
size_t tsuya_stereo_image_bytes(const tsuya_stereo_image *image);

/* depth 0: none.  Normals are unit, in the camera frame, and face the camera; three planes of width × height, as in
 * COLMAP's file.  `cost` (1 − NCC, plus the geometric term) may be NULL. */
typedef struct tsuya_depth_map {
    int width_px, height_px;
    float *depth, *normal, *cost;
} tsuya_depth_map;
TSUYA_MUST_CHECK tsuya_status tsuya_depth_map_create(tsuya_depth_map *map, int width_px, int height_px);
void tsuya_depth_map_free(tsuya_depth_map *map);

typedef struct tsuya_patchmatch_source {
    const tsuya_stereo_image *image;
    const float *depth; /* its photometric depth map at level 0, or NULL: then there is no geometric term */
} tsuya_patchmatch_source;

/* Instruction sets of the kernels; every one gives the same result, AUTO is the widest that the processor has. */
typedef enum tsuya_simd { TSUYA_SIMD_AUTO, TSUYA_SIMD_PORTABLE, TSUYA_SIMD_SSE42, TSUYA_SIMD_AVX2, TSUYA_SIMD_AVX512 } tsuya_simd;

typedef struct tsuya_patchmatch_options {
    tsuya_simd simd;
    bool coarse_to_fine, view_selection;
    int coarse_iterations, fine_iterations, geometric_iterations;
    float sigma_color;     /* of the bilateral weight, grey in [0, 1] */
    float max_cost;        /* pixels above are dropped by the filter */
    /* Windows count as empty whose grey, less its best quadratic, has a standard deviation below the first, or a variance
     * below this share of what its best plane leaves: shading and highlights are smooth, texture is not. */
    float min_contrast, min_roughness;
    float max_reprojection_px, max_depth_error; /* of the geometric filter: forward-backward, relative */
    int min_consistent;    /* source views that must agree, of those that see the place */
    int min_component_px;  /* smaller islands are dropped */
} tsuya_patchmatch_options;
tsuya_patchmatch_options tsuya_patchmatch_options_default(void);

typedef struct tsuya_patchmatch_problem {
    const tsuya_stereo_image *reference;
    const uint8_t *mask; /* level 0, 0: not computed; NULL: all */
    const tsuya_patchmatch_source *source;
    int source_count;
    double depth_min, depth_max;
    const tsuya_depth_map *start; /* planes to start from (the photometric map), or NULL */
    bool geometric;               /* sources carry depth: adds the geometric term, starts from `start` at level 0 */
    bool filter;                  /* drop what is not trustworthy; a photometric map that a geometric pass follows keeps it */
} tsuya_patchmatch_problem;

/* Fails on memory and interruption only. */
TSUYA_MUST_CHECK tsuya_status tsuya_patchmatch(tsuya_depth_map *map, const tsuya_patchmatch_problem *problem,
                                               const tsuya_patchmatch_options *options, const tsuya_context *context);

#endif
