#include "weave_detect/opencv_adapter.h"

#include <opencv2/core.hpp>

void tsuya_opencv_single_thread(void)
{
    try {
        cv::setNumThreads(1);
    } catch (...) {
        return; /* only slower */
    }
}

tsuya_status tsuya_opencv_power_spectrum(float *power, const float *values, int n)
{
    try {
        cv::Mat input(n, n, CV_32F, const_cast<float *>(values)), output;
        cv::dft(input, output, cv::DFT_COMPLEX_OUTPUT);
        for (int y = 0; y < n; y++) {
            const cv::Vec2f *row = output.ptr<cv::Vec2f>(y);
            for (int x = 0; x < n; x++) {
                power[y * n + x] = row[x][0] * row[x][0] + row[x][1] * row[x][1];
            }
        }
        return TSUYA_OK;
    } catch (const std::exception &error) {
        return tsuya_fail(TSUYA_ERROR_MEMORY, "OpenCV: Fourier transform: %.200s", error.what());
    } catch (...) {
        return tsuya_fail(TSUYA_ERROR_MEMORY, "OpenCV: Fourier transform failed");
    }
}
