/* The 24-patch colour chart (six by four, greys in the last row) and flat cards in photographs.
 *
 * The chart is found by OpenCV (calib/opencv_adapter.h), then laid on its patches: each patch is grown from its expected middle,
 * and a homography fits the middles of those that came out whole.  Colours are trimmed means over the inner part of each patch,
 * linear light (sRGB files are decoded; camera raw and linear files are taken as they are). */
#ifndef TSUYA_CALIB_CHART_H
#define TSUYA_CALIB_CHART_H

#include "core/color.h"
#include "core/geometry.h"
#include "core/image.h"

#include <stdbool.h>

enum { TSUYA_CHART_COLS = 6, TSUYA_CHART_ROWS = 4, TSUYA_CHART_PATCHES = 24, TSUYA_CHART_FIRST_GREY = 18 };

typedef struct tsuya_chart_patch {
    tsuya_vec2 center_px;
    double rgb[3];        /* linear, 1 = full scale */
    double sigma[3];      /* of a pixel around it */
    int pixels;
    double clipped;       /* share of the patch's pixels with a channel at the top of its range */
} tsuya_chart_patch;

typedef struct tsuya_chart {
    tsuya_chart_patch patch[TSUYA_CHART_PATCHES]; /* row by row, dark skin first, black last */
    tsuya_mat3 photo_from_chart;  /* chart: patch (i, j) has its middle at (i, j) */
    int fitted;                   /* patches that the homography rests on */
    double fit_px;                /* RMS of their middles about it */
} tsuya_chart;

/* Lab (D50) of the chart's maker for charts made since November 2014. */
TSUYA_API void tsuya_chart_reference(tsuya_lab lab_d50[TSUYA_CHART_PATCHES]);
/* Another chart's, from a table with the columns patch (1 … 24), l, a, b. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_chart_reference_load(tsuya_lab lab_d50[TSUYA_CHART_PATCHES], const char *path);
/* XYZ under D65 of a Lab under D50 (Bradford's adaptation). */
TSUYA_API tsuya_vec3 tsuya_chart_xyz_d65(tsuya_lab lab_d50);

/* `corners_px`: middles of the four corner patches (dark skin, bluish green, black, white), or NULL to look for the chart.  Fails,
 * naming `name`, where there is none, or it is too small. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_chart_find(tsuya_chart *chart, const tsuya_image *photo, const char *name,
                                                         const tsuya_vec2 *corners_px, int threads);

#endif
