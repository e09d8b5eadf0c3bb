/* The two thread families of one patch. */
#ifndef TSUYA_WEAVE_DETECT_DETECTOR_H
#define TSUYA_WEAVE_DETECT_DETECTOR_H

#include "weave_detect/kind.h"
#include "weave_detect/refine.h"
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

/* What a window tells to the patches in it.  A window of twice the patch's side sees twice the repeats and four times the power
 * over the noise: which peaks are threads is told there, where exactly they run in the patch. */
enum { TSUYA_ALTERNATIVES = 6 };

typedef struct tsuya_alternative {
    double f[2][2];
    double angle_rad[2], length[2]; /* along the threads; of f */
    float probability;
    tsuya_kind kind;
    int step, point_count;
    tsuya_lattice_point point[TSUYA_TONES];
} tsuya_alternative;

typedef struct tsuya_finding {
    tsuya_alternative alternative[TSUYA_ALTERNATIVES]; /* the likeliest first */
    int count;
    float none_probability;
    float belief; /* probability of the likeliest alternative's angles; 0 where none is likeliest */
    bool empty; /* nothing stands above the noise */
} tsuya_finding;

void tsuya_detector_find(tsuya_detector *detector, tsuya_finding *finding, const float *values);

/* Sets `belief`, for whoever changes probabilities. */
void tsuya_finding_believe(tsuya_finding *finding);

/* The patch's threads, given what windows around it found, the best suited first.  Where the patch does not show them, or no window knows,
 * the patch is looked at alone. */
void tsuya_detector_follow(tsuya_detector *detector, tsuya_threads *threads, const tsuya_finding *const *finding, int count, const float *values);

/* Alternatives that the windows around (columns × rows of them) believe gain, others lose; "no threads" is one of them. */
TSUYA_MUST_CHECK tsuya_status tsuya_findings_pool(tsuya_finding *finding, int columns, int rows);

#endif
