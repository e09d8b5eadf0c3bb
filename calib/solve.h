/* The calibration problem and its solution by libmrcal.
 *
 * Each (photograph, plate) is a camera pose of its own with shared intrinsics; a tag's corners are fixed points of its plate.
 * mrcal's own outlier rejection knows chessboards only, so outliers are found by a loop around mrcal_optimize.
 *
 * Weights: a corner's variance is its own sigma² plus τ² of its photograph (motion, rolling shutter, bent paper: what the
 * corner's own fit cannot know), which is estimated from the residuals between the solves.  Blurred photographs therefore
 * count less and are not thrown away.
 *
 * Tags stand at known places, so a common displacement of all edges shows: one number a camera (in blur widths) and, of each
 * plate, its shape (calib/shape.h) are estimated between the solves, by the normal equations of calib/covariance.h. */
#ifndef TSUYA_CALIB_SOLVE_H
#define TSUYA_CALIB_SOLVE_H

#include "calib/board.h"
#include "calib/corners.h"
#include "calib/shape.h"
#include "core/camera.h"

enum { TSUYA_INTRINSICS_MOST = 4 + 2 * TSUYA_SPLINE_MOST, TSUYA_OUTLIER_SIGMAS = 4 };

typedef struct tsuya_solve_view {
    int photo, plate; /* photo: index in the corner set */
    tsuya_pose camera_from_plate;
    int first, count; /* observations */
} tsuya_solve_view;

typedef struct tsuya_solve_observation {
    int view, tag, corner; /* tag: index in the board */
    tsuya_vec2 pixel;      /* as it is used: seen − edge_bias · spread */
    tsuya_vec2 seen, spread_px;
    double sigma_px;       /* the corner's own */
    double weight_sigma_px; /* with the photograph's share: what the solve uses */
    bool outlier;
    tsuya_vec2 residual_px; /* observed − projected */
} tsuya_solve_observation;

typedef struct tsuya_solve {
    const tsuya_board *board;
    tsuya_camera camera;
    tsuya_solve_view *view;
    int view_count;
    tsuya_solve_observation *observation;
    int observation_count;
    int photo_count;          /* of the corner set */
    double *photo_sigma_px;   /* robust residual of each photograph, per coordinate; NaN where it has no view */
    double edge_bias;         /* edges lie this many blur widths too far out: what the tone curve and sharpening do */
    tsuya_plate_shape *shape; /* of each plate */
    bool bent;                /* bends are estimated; flat otherwise */
    tsuya_camera prior;       /* of a splined lens: what it follows, loosely, where no corner holds it (calib/spline.h) */
    tsuya_pose camera_from_prior; /* as poses absorb motions, so does this */
    double rms_px;            /* per coordinate, over what is no outlier */
    double variance;          /* of unit weight: 1 where sigmas are right */
    int outliers;
} tsuya_solve;

/* Views of at least `fewest` corners; photographs whose `use` is false are left out (NULL: all).  Poses are not set. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_solve_create(tsuya_solve *solve, const tsuya_board *board, const tsuya_corner_set *corners,
                                                           const bool *use, int fewest, int width_px, int height_px);
TSUYA_API void tsuya_solve_free(tsuya_solve *solve);

/* Focal length and poses from the plates' homographies; `focal_px` > 0 is tried too (EXIF).  The best of several focal
 * lengths, as judged by a short solve, stays. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_solve_start(tsuya_solve *solve, double focal_px);
/* Poses alone, for a camera that is given. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_solve_poses(tsuya_solve *solve, const tsuya_camera *camera);
/* The whole solve for a lens, from a start or from a smaller lens' solution, with outliers and weights. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_solve_lens(tsuya_solve *solve, tsuya_lens lens);
/* The same for a splined lens with nx control points along x (calib/spline.h), from a smaller lens' solution. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_solve_splined(tsuya_solve *solve, int nx);
/* Camera, poses, edge bias and the plates' shapes from where the solve stands; weights and outliers stay. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_solve_again(tsuya_solve *solve);

/* Parameters of each plate's shape that are free: the growth, and bends where they are estimated. */
static inline int tsuya_solve_shape_parameters(const tsuya_solve *solve) { return solve->bent ? TSUYA_SHAPE_PARAMETERS : 1; }
/* A tag's corner in its plate's frame, as the solve sees it. */
TSUYA_API tsuya_vec3 tsuya_solve_point(const tsuya_solve *solve, int tag, int corner);

/* Intrinsics as one vector: fx fy cx cy, then the distortions of the lens, or the control points of its spline.  How many, and how many of
 * them, from the first, stay where they are (a spline does what its core could do). */
TSUYA_API int tsuya_lens_parameters(const tsuya_camera *camera);
TSUYA_API int tsuya_lens_locked(const tsuya_camera *camera);
TSUYA_API const char *tsuya_lens_name(tsuya_lens lens); /* mrcal's, without "LENSMODEL_" */
TSUYA_API bool tsuya_lens_from_name(tsuya_lens *lens, const char *name);

#endif
