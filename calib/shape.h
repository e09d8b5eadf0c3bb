/* How a plate differs from its file: tags printed larger or smaller, and a sheet that is not flat.
 *
 * Height over the file's plane, with u, v from −1 to 1 between the plate's outermost corners:
 *     z = b₀ (1 − u²) + b₁ (1 − v²) + b₂ u v
 * The first two are mrcal's calobject_warp; the third is a twist, which a sheet of paper on a thin board has as easily. */
#ifndef TSUYA_CALIB_SHAPE_H
#define TSUYA_CALIB_SHAPE_H

#include "calib/board.h"

enum { TSUYA_BENDS = 3, TSUYA_SHAPE_PARAMETERS = 1 + TSUYA_BENDS };

typedef struct tsuya_plate_shape {
    double growth;               /* share of the tag's edge */
    double bend_m[TSUYA_BENDS];
    tsuya_vec2 middle_m, half_m; /* of the plate's outermost corners */
} tsuya_plate_shape;

/* A flat plate whose tags are as large as the file says. */
TSUYA_API tsuya_plate_shape tsuya_plate_shape_flat(const tsuya_board *board, int plate);
/* A tag's corner in its plate's frame, and how it moves with each parameter (growth, bends). */
TSUYA_API tsuya_vec3 tsuya_plate_shape_corner(const tsuya_plate_shape *shape, const tsuya_board *board, int tag, int corner);
TSUYA_API void tsuya_plate_shape_gradient(tsuya_vec3 by[TSUYA_SHAPE_PARAMETERS], const tsuya_plate_shape *shape, const tsuya_board *board, int tag, int corner);
/* What is believed of a plate before it is seen, one sigma of each parameter: tags within one per cent, bends within half a
 * per cent of the plate's half diagonal. */
TSUYA_API void tsuya_plate_shape_prior(double sigma[TSUYA_SHAPE_PARAMETERS], const tsuya_plate_shape *shape);

#endif
