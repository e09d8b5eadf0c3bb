/* A calibration of an even grid as mrcal's own board problem, and as the optimization inputs that mrcal's tools read out of a
 * .cameramodel to compute uncertainty.
 *
 * mrcal's boards are grids of one spacing whose frames move before a camera that stands in the reference; the board may be warped
 * (a parabola along each axis).  The inputs are a Python dict of arrays: NumPy's .npz (a zip of .npy, stored) in base 85. */
#ifndef TSUYA_CALIB_MRCAL_INPUTS_H
#define TSUYA_CALIB_MRCAL_INPUTS_H

#include "calib/solve.h"

typedef struct tsuya_mrcal_board {
    tsuya_camera camera;        /* where the solve stood: its lens and size are the board's, too */
    int cols, rows, frames;     /* of corners */
    double spacing_m;
    int intrinsics_count;
    double intrinsics[TSUYA_INTRINSICS_MOST];
    double *frame;              /* rotation vector and translation, 6 a frame; owned */
    double *observation;        /* x, y, weight; cols × rows a frame, weight −1: not seen or left out; owned */
    double warp_m[2];           /* how far the middle stands out of the plane of the edges, along x and along y */
    double rms_px, rms_flat_px; /* with the warp and without it */
} tsuya_mrcal_board;

/* From where the solve stands; the solve's board must be an even grid (tsuya_board_even_grid).  Solved by mrcal_optimize, once flat
 * and once with the warp. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_mrcal_board_solve(tsuya_mrcal_board *board, const tsuya_solve *solve);
TSUYA_API void tsuya_mrcal_board_free(tsuya_mrcal_board *board);
/* Writes the inputs into a .cameramodel that exists.  Atomic. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_mrcal_inputs_add(const char *path, const tsuya_mrcal_board *board);

#endif
