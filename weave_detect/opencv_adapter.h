/* OpenCV's Fourier transform for the weave detector. */
#ifndef TSUYA_WEAVE_DETECT_OPENCV_ADAPTER_H
#define TSUYA_WEAVE_DETECT_OPENCV_ADAPTER_H

#include "core/status.h"

/* power[n × n] = |DFT|² of the real values[n × n], frequency 0 in the first element.  n even. */
TSUYA_INTERNAL TSUYA_MUST_CHECK tsuya_status tsuya_opencv_power_spectrum(float *power, const float *values, int n);
/* One thread inside OpenCV: the patches are what runs in parallel here. */
TSUYA_INTERNAL void tsuya_opencv_single_thread(void);

#endif
