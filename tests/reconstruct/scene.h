/* Analytic scenes for the stereo tests and benches: surfaces with a solid texture, drawn by ray casting through known
 * pinhole cameras.  Nothing here shares code with the stereo under test beyond core's cameras and poses. */
#ifndef TSUYA_TESTS_RECONSTRUCT_SCENE_H
#define TSUYA_TESTS_RECONSTRUCT_SCENE_H

#include "core/camera.h"

#include <stdint.h>

typedef enum scene_kind {
    SCENE_SHEET,    /* an undulating sheet that fills the pictures */
    SCENE_CYLINDER, /* an upright cylinder before nothing */
    SCENE_GRAZING,  /* a plane whose normal stands 75 degrees off the middle view's axis */
    SCENE_SLAB,     /* a slab six ground sample distances thick, with cameras on both sides */
    SCENE_BARE,     /* the sheet with no texture in its middle third */
    SCENE_SATIN,    /* the same with a highlight that moves with the view */
    SCENE_KIND_COUNT
} scene_kind;

const char *scene_name(scene_kind kind);

typedef struct scene_view {
    tsuya_camera camera;
    tsuya_pose camera_from_world;
    float *grey;       /* width × height, [0, 1], with sensor noise */
    float *depth;      /* along the optical axis, at pixel centres; 0 where the ray hits nothing */
    float *normal;     /* three planes, camera frame */
    uint8_t *textured; /* 1 where the surface has texture */
} scene_view;

typedef struct scene_pictures {
    scene_kind kind;
    int view_count;
    scene_view *view;
    double noise; /* standard deviation of grey */
} scene_pictures;

/* Every view of the scene at the given width (height is ¾ of it); noise is added after drawing.  Returns false when
 * memory is short. */
bool scene_create(scene_pictures *s, scene_kind kind, int width_px, int view_count, double noise);
void scene_free(scene_pictures *s);

/* First surface point along a ray in the world frame. */
typedef struct scene_hit {
    tsuya_vec3 point, normal; /* the normal faces the ray's origin */
    double grey;
    bool textured;
} scene_hit;
bool scene_trace(scene_hit *hit, scene_kind kind, tsuya_vec3 origin, tsuya_vec3 direction);

/* Unsigned distance of a point from the nearest surface of the scene. */
double scene_distance_m(scene_kind kind, tsuya_vec3 point);

/* Views on the same side as `view`: all of them but for the slab. */
bool scene_same_side(const scene_pictures *s, int a, int b);

/* Ground sample distance of the scene at its target: what one pixel covers. */
double scene_gsd_m(const scene_pictures *s);

#endif
