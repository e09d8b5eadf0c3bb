/* What is left out of a table to see how well a fit predicts it. */
#ifndef TSUYA_BRDF_FIT_PARTS_H
#define TSUYA_BRDF_FIT_PARTS_H

#include "brdf/samples.h"

enum { TSUYA_FIT_PARTS = 2 };
typedef enum tsuya_fit_part_kind {
    TSUYA_FIT_TILTS,   /* every fifth tilt: ring of half vectors */
    TSUYA_FIT_AZIMUTH, /* the last azimuth of three or more */
} tsuya_fit_part_kind;

/* Marks the rows; count 0 where the table has too few groups. */
TSUYA_MUST_CHECK tsuya_status tsuya_fit_part(unsigned char *mask, int *count, const tsuya_samples *samples, tsuya_fit_part_kind kind);

/* About `count` samples of a larger table, drawn at random, always the same ones: equal steps could miss whole azimuths of a table
 * that repeats itself. */
TSUYA_MUST_CHECK tsuya_status tsuya_samples_draw(tsuya_samples *part, const tsuya_samples *samples, int count);

#endif
