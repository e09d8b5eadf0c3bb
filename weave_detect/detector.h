/* The two thread families of one patch. */
#ifndef TSUYA_WEAVE_DETECT_DETECTOR_H
#define TSUYA_WEAVE_DETECT_DETECTOR_H

#include "weave_detect/threads.h"

typedef struct tsuya_detector tsuya_detector; /* workspace of one thread of execution */

typedef struct tsuya_detector_options {
    int rounds; /* of refinement: 1; 0 leaves the peaks as the transform gives them */
} tsuya_detector_options;

/* Patches of n × n pixels, n even, 16 … 512.  `options` NULL: defaults. */
TSUYA_MUST_CHECK tsuya_status tsuya_detector_create(tsuya_detector **detector, int n, const tsuya_detector_options *options);
void tsuya_detector_free(tsuya_detector *detector);

/* values: n × n grey, rows top to bottom.  Allocates nothing. */
void tsuya_detector_run(tsuya_detector *detector, tsuya_threads *threads, const float *values);

#endif
