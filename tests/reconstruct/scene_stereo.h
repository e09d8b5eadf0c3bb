/* Stereo on analytic scenes and its errors, shared by tests and bench. */
#ifndef TSUYA_TESTS_RECONSTRUCT_SCENE_STEREO_H
#define TSUYA_TESTS_RECONSTRUCT_SCENE_STEREO_H

#include "core/context.h"
#include "reconstruct/patchmatch.h"
#include "scene.h"

enum { SCENE_MOST_VIEWS = 16 };

/* The pyramids of every view, and one view's problem over the others of its side. */
typedef struct scene_stereo {
    const scene_pictures *scene;
    tsuya_stereo_image image[SCENE_MOST_VIEWS];
    tsuya_depth_map photometric[SCENE_MOST_VIEWS];
    /* Of the solves so far, photometric [0] and geometric [1]. */
    double seconds[2], cpu_seconds[2], megapixels[2];
} scene_stereo;

/* Both passes together, a megapixel; `cpu`: processor time instead of time. */
double scene_stereo_seconds(const scene_stereo *s, bool cpu);

bool scene_stereo_create(scene_stereo *s, const scene_pictures *scene, int levels);
void scene_stereo_free(scene_stereo *s);

/* Depth and normals of `view`.  With `geometric`, the photometric maps of all views of its side are made first (once).
 * `masked`: only where the truth has a surface. */
tsuya_status scene_stereo_solve(tsuya_depth_map *map, scene_stereo *s, int view, bool geometric, bool masked,
                                const tsuya_patchmatch_options *options, const tsuya_context *context);

/* Against the truth, in ground sample distances (depth / focal): over textured pixels that have depth the median and the
 * 90 % quantile; share of textured pixels within 2; share of all pixels with depth that are off by more than 4 or lie
 * where nothing is; the same over untextured surface alone, as a share of that surface; median angle of the normals. */
typedef struct scene_errors {
    double median_gsd, p90_gsd, completeness, wrong, wrong_bare, normal_deg;
} scene_errors;
bool scene_errors_measure(scene_errors *errors, const scene_pictures *scene, int view, const tsuya_depth_map *map);

#endif
