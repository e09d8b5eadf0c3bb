/* What one would do with OpenCV alone, for the bench: angles along the threads, counter-clockwise with y up, radians. */
#ifndef TSUYA_TESTS_WEAVE_DETECT_PEERS_OPENCV_H
#define TSUYA_TESTS_WEAVE_DETECT_PEERS_OPENCV_H

#ifdef __cplusplus
extern "C" {
#endif

/* Each fills two angles from n × n values. */
void peer_structure_tensor(double angle_rad[2], const float *values, int n); /* the dominant direction, and the one across it */
void peer_sobel_histogram(double angle_rad[2], const float *values, int n);  /* two peaks of the gradients' directions, 1 degree bins */
void peer_fourier_peak(double angle_rad[2], const float *values, int n);     /* two highest peaks, 45 degrees apart or more, parabola */
void peer_gaussian_derivative(double angle_rad[2], const float *values, int n); /* structure tensor of Gaussian derivatives, σ 1.5 px */

#ifdef __cplusplus
}
#endif
#endif
