/* OpenCV behind calib/opencv_adapter.h.  No exception leaves this file. */
#include "calib/opencv_adapter.h"

#include <new>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <opencv2/mcc.hpp>
#include <vector>

namespace {

void find_box(bool *found, tsuya_vec2 *box, const tsuya_image *photo)
{
    cv::Mat rgb(photo->height_px, photo->width_px, CV_8UC3, photo->data, photo->row_bytes), bgr;
    cv::cvtColor(rgb, bgr, cv::COLOR_RGB2BGR);
    auto detector = cv::mcc::CCheckerDetector::create();
    if (!detector->process(bgr, cv::mcc::MCC24, 1)) {
        return;
    }
    auto best = detector->getBestColorChecker();
    std::vector<cv::Point2f> corner = best ? best->getBox() : std::vector<cv::Point2f>();
    *found = corner.size() == 4;
    for (size_t i = 0; *found && i < 4; i++) {
        box[i] = {static_cast<double>(corner[i].x), static_cast<double>(corner[i].y)};
    }
}

} // namespace

tsuya_status tsuya_chart_box(bool *found, tsuya_vec2 box_px[4], const tsuya_image *photo, int threads)
{
    *found = false;
    try {
        cv::setNumThreads(threads);
        cv::theRNG().state = 1;
        find_box(found, box_px, photo);
        return TSUYA_OK;
    } catch (const std::bad_alloc &) {
        return tsuya_fail(TSUYA_ERROR_MEMORY, "OpenCV: chart: out of memory");
    } catch (const std::exception &error) {
        return tsuya_fail(TSUYA_ERROR_NUMERIC, "OpenCV: chart: %.200s", error.what());
    } catch (...) {
        return tsuya_fail(TSUYA_ERROR_NUMERIC, "OpenCV: chart: failed");
    }
}
