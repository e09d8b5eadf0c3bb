/* The structure tensor of a patch: where its texture runs, whatever makes it (Bigün & Granlund, "Optimal orientation detection
 * of linear symmetry", ICCV 1987). */
#ifndef TSUYA_WEAVE_DETECT_FLOW_H
#define TSUYA_WEAVE_DETECT_FLOW_H

#include "weave_detect/threads.h"

/* values: n × n, rows top to bottom.  Sets flow_rad and flow_coherence; a flat patch gets coherence 0. */
void tsuya_flow(tsuya_threads *threads, const float *values, int n);

#endif
