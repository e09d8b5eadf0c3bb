/* The two thread directions of one patch, from the peaks of its power spectrum.
 *
 * Threads that run along a direction θ with a spacing p make a line of peaks k/p at right angles to θ.  Where the two
 * families cross, a weave adds peaks at rational combinations of the two (plain: (½, ½); twill: its diagonal), which are no
 * threads.  So peaks are judged as pairs: a pair is good when each member carries harmonics of its own, and when the sum
 * and the difference of a candidate pair are strong peaks themselves, those two are the threads and the candidates are the
 * crossing pattern. */
#ifndef TSUYA_WEAVE_DETECT_SPECTRUM_H
#define TSUYA_WEAVE_DETECT_SPECTRUM_H

#include "weave_detect/threads.h"

typedef struct tsuya_spectrum tsuya_spectrum; /* workspace of one thread */
/* Patches of n × n pixels, n even, 16 … 512. */
TSUYA_MUST_CHECK tsuya_status tsuya_spectrum_create(tsuya_spectrum **spectrum, int n);
void tsuya_spectrum_free(tsuya_spectrum *spectrum);
/* values: n × n grey, rows top to bottom; changed (mean and slope removed, windowed). */
TSUYA_MUST_CHECK tsuya_status tsuya_spectrum_threads(tsuya_spectrum *spectrum, tsuya_threads *threads, float *values);

#endif
