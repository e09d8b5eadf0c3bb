/* From corners to a camera with an error that can be believed: solve, choice of the lens, cross-validation, uncertainty,
 * plates' relations, and what is wrong with the photographs. */
#ifndef TSUYA_CALIB_CALIBRATE_H
#define TSUYA_CALIB_CALIBRATE_H

#include "calib/covariance.h"
#include "calib/projection.h"
#include "calib/solve.h"
#include "core/context.h"
#include "core/json.h"

enum { TSUYA_CALIB_TRIALS = 20, TSUYA_CALIB_ADVICE = 8 };

typedef struct tsuya_calibrate_options {
    double tolerance_px;  /* two halves of the photographs agree within this (p90) */
    double focal_px;      /* from EXIF; 0: unknown */
    bool lens_given;
    tsuya_lens lens;
    tsuya_lens largest;   /* that may be chosen */
} tsuya_calibrate_options;
TSUYA_API tsuya_calibrate_options tsuya_calibrate_options_default(void);

/* How one lens did. */
typedef struct tsuya_calibrate_trial {
    tsuya_lens lens;
    int nx, ny;           /* control points of a splined lens; else 0 */
    bool bent;            /* plates may be bent */
    double rms_px;        /* infinite where the solve failed, or the photographs do not determine the lens */
    double heldout_px;    /* corners of one half through the camera of the other; NaN without halves */
    double heldout_near_px; /* the same of corners where the fitting half saw boards: what splined lenses are judged by */
    tsuya_projection_stats cross, cross_infinity;
} tsuya_calibrate_trial;

typedef struct tsuya_calibrate_plate {
    const char *name, *reference;
    int photos;                   /* that show both */
    double angle_deg, angle_sd_deg, distance_m, distance_sd_m; /* NaN without photographs of both */
    bool rigid;
} tsuya_calibrate_plate;

typedef struct tsuya_calibration {
    tsuya_solve solve;
    tsuya_covariance covariance;
    double distance_m;            /* median from camera to plate */
    tsuya_calibrate_trial trial[TSUYA_CALIB_TRIALS]; /* in the order they were made */
    int trials, chosen;
    bool cross_validates;
    double misfit;                /* share of the residuals' variance that photographs share by place in the image (calib/misfit.h) */
    char reason[512];             /* of the choice */
    tsuya_projection_map sigma, sigma_infinity, cross, cross_infinity; /* cross: empty (cols 0) without halves */
    tsuya_calibrate_plate *plate; /* plate_count − 1 of the board; owned */
    int plates, photos_used;
    char advice[TSUYA_CALIB_ADVICE][256];
    int advice_count;
    double seconds;
} tsuya_calibration;

/* Fails with one line on corners that do not determine a camera (too few, too frontal, a wrong board). */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_calibrate(tsuya_calibration *calibration, const tsuya_board *board, const tsuya_corner_set *corners,
                                                        int width_px, int height_px, const tsuya_calibrate_options *options,
                                                        const tsuya_context *context);
TSUYA_API void tsuya_calibration_free(tsuya_calibration *calibration);
/* The figures of calib.json. */
TSUYA_API void tsuya_calibration_to_json(tsuya_json *object, const tsuya_calibration *calibration, const tsuya_corner_set *corners);

#endif
