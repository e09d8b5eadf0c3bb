/* Photographs of boards with known corners.  The truth is made by sampling the printed pattern through the lens (jittered,
 * Gaussian weights), not by any edge model. */
#ifndef TSUYA_TESTS_CALIB_SCENE_H
#define TSUYA_TESTS_CALIB_SCENE_H

#include "calib/board.h"
#include "core/camera.h"
#include "core/context.h"
#include "core/image.h"

typedef struct scene_look {
    double blur_px;        /* Gaussian */
    double motion_px[2];   /* uniform motion during the exposure */
    double black, white, background; /* linear, 1 = full scale */
    double noise;          /* σ of the stored values, 1 = full scale */
    bool srgb;             /* stored with sRGB's curve, else as they are */
    tsuya_sample sample;   /* 8 or 16 bits */
    double row_gain;       /* exposure of the last row over the first's (rolling exposure); 1: even */
    double bulge_m;        /* the plate bends: z = bulge (1 − r²), r to its corner (0: flat) */
    double (*light)(const void *user, double x_m, double y_m); /* factor at a place of the plate; NULL: even */
    const void *light_user;
    uint64_t seed;
} scene_look;

scene_look scene_look_default(void);
/* Float image of the background. */
void scene_begin(tsuya_image *image, int width_px, int height_px, const scene_look *look);
/* One plate into it. */
void scene_plate(tsuya_image *image, const tsuya_board *board, int plate, const tsuya_camera *camera, tsuya_pose camera_from_plate,
                 const scene_look *look);
/* Noise, tone curve, quantisation. */
void scene_end(tsuya_image *photo, tsuya_image *image, const scene_look *look);
/* Where a corner truly is. */
tsuya_vec2 scene_corner(const tsuya_board *board, int tag, int corner, const tsuya_camera *camera, tsuya_pose camera_from_plate);

#endif
