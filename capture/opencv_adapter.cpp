/* OpenCV behind capture/opencv_adapter.h.  No exception leaves this file. */
#include "capture/opencv_adapter.h"

#include <new>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <vector>

struct tsuya_features {
    std::vector<cv::KeyPoint> place;
    cv::Mat descriptor; /* one row each, Hellinger (square-rooted) distances */
};

namespace {

/* Arandjelović & Zisserman 2012: square roots of L1-normed descriptors. */
void take_roots(cv::Mat &descriptor)
{
    for (int row = 0; row < descriptor.rows; row++) {
        float *d = descriptor.ptr<float>(row), sum = 0.0f;
        for (int k = 0; k < descriptor.cols; k++) {
            sum += d[k];
        }
        for (int k = 0; k < descriptor.cols; k++) {
            d[k] = sum > 0.0f ? std::sqrt(d[k] / sum) : 0.0f;
        }
    }
}

/* For every row of `from` the row of `to` that passes the ratio test, or −1. */
std::vector<int> best_of(const cv::Mat &from, const cv::Mat &to)
{
    std::vector<std::vector<cv::DMatch>> found;
    std::vector<int> best(static_cast<size_t>(from.rows), -1);
    cv::BFMatcher(cv::NORM_L2).knnMatch(from, to, found, 2);
    for (const auto &f : found) {
        if (f.size() == 2 && f[0].distance < 0.8f * f[1].distance) {
            best[static_cast<size_t>(f[0].queryIdx)] = f[0].trainIdx;
        }
    }
    return best;
}

void match(tsuya_feature_pair *pairs, int *count, const tsuya_features *a, const tsuya_features *b, double tolerance_px)
{
    std::vector<cv::Point2f> from, to;
    std::vector<tsuya_feature_pair> candidate;
    std::vector<int> forward = best_of(a->descriptor, b->descriptor), backward = best_of(b->descriptor, a->descriptor);
    for (int i = 0; i < a->descriptor.rows; i++) {
        int j = forward[static_cast<size_t>(i)];
        if (j >= 0 && backward[static_cast<size_t>(j)] == i) {
            candidate.push_back({i, j});
            from.push_back(a->place[static_cast<size_t>(i)].pt);
            to.push_back(b->place[static_cast<size_t>(j)].pt);
        }
    }
    *count = 0;
    if (candidate.size() < 12) {
        return;
    }
    std::vector<unsigned char> inlier;
    cv::Mat fundamental = cv::findFundamentalMat(from, to, cv::FM_RANSAC, tolerance_px, 0.999, 1000, inlier);
    for (size_t k = 0; !fundamental.empty() && k < candidate.size(); k++) {
        if (inlier[k]) {
            pairs[(*count)++] = candidate[k];
        }
    }
}

cv::Point2d on_plane(const tsuya_features_view *view, int index)
{
    const cv::Point2f &p = view->features->place[static_cast<size_t>(index)].pt;
    return {(static_cast<double>(p.x) - view->middle.x) / view->focal_px, (static_cast<double>(p.y) - view->middle.y) / view->focal_px};
}

void find_turn(tsuya_mat3 *turn, int *agreeing, const tsuya_features_view *a, const tsuya_features_view *b, const tsuya_feature_pair *pairs,
               int count, double tolerance_px)
{
    std::vector<cv::Point2d> from, to;
    for (int k = 0; k < count; k++) {
        from.push_back(on_plane(a, pairs[k].a));
        to.push_back(on_plane(b, pairs[k].b));
    }
    cv::Mat eye = cv::Mat::eye(3, 3, CV_64F), kept, rotation, way;
    cv::Mat essential = cv::findEssentialMat(from, to, eye, cv::RANSAC, 0.999, tolerance_px / a->focal_px, kept);
    if (essential.rows != 3) {
        return;
    }
    *agreeing = cv::recoverPose(essential, from, to, eye, rotation, way, kept);
    for (int r = 0; r < 3; r++) {
        for (int c = 0; c < 3; c++) {
            turn->e[r][c] = rotation.at<double>(r, c);
        }
    }
}

} // namespace

tsuya_status tsuya_features_find(tsuya_features **features, const tsuya_image *grey, const tsuya_image *mask, int most, int threads)
{
    *features = nullptr;
    try {
        cv::setNumThreads(threads);
        cv::Mat source(grey->height_px, grey->width_px, CV_8U, grey->data, grey->row_bytes), allowed;
        if (mask) {
            allowed = cv::Mat(mask->height_px, mask->width_px, CV_8U, mask->data, mask->row_bytes);
        }
        auto *made = new tsuya_features;
        try {
            cv::SIFT::create(most, 3, 0.03)->detectAndCompute(source, allowed, made->place, made->descriptor);
            take_roots(made->descriptor);
        } catch (...) {
            delete made;
            throw;
        }
        *features = made;
        return TSUYA_OK;
    } catch (const std::bad_alloc &) {
        return tsuya_fail(TSUYA_ERROR_MEMORY, "OpenCV: features: out of memory");
    } catch (const std::exception &error) {
        return tsuya_fail(TSUYA_ERROR_NUMERIC, "OpenCV: features: %.200s", error.what());
    } catch (...) {
        return tsuya_fail(TSUYA_ERROR_NUMERIC, "OpenCV: features failed");
    }
}

void tsuya_features_free(tsuya_features *features) { delete features; }

int tsuya_features_count(const tsuya_features *features) { return static_cast<int>(features->place.size()); }

void tsuya_features_place(const tsuya_features *features, int index, double *x_px, double *y_px)
{
    const cv::Point2f &p = features->place[static_cast<size_t>(index)].pt;
    *x_px = static_cast<double>(p.x);
    *y_px = static_cast<double>(p.y);
}

tsuya_status tsuya_features_match(tsuya_feature_pair *pairs, int *count, const tsuya_features *a, const tsuya_features *b, double tolerance_px)
{
    *count = 0;
    try {
        if (a->place.size() >= 12 && b->place.size() >= 12) {
            match(pairs, count, a, b, tolerance_px);
        }
        return TSUYA_OK;
    } catch (const std::exception &error) {
        return tsuya_fail(TSUYA_ERROR_NUMERIC, "OpenCV: matching: %.200s", error.what());
    } catch (...) {
        return tsuya_fail(TSUYA_ERROR_NUMERIC, "OpenCV: matching failed");
    }
}

tsuya_status tsuya_features_turn(tsuya_mat3 *turn, int *agreeing, const tsuya_features_view *a, const tsuya_features_view *b,
                                 const tsuya_feature_pair *pairs, int count, double tolerance_px)
{
    *agreeing = 0;
    *turn = tsuya_mat3_identity();
    try {
        if (count >= 12) {
            find_turn(turn, agreeing, a, b, pairs, count, tolerance_px);
        }
        return TSUYA_OK;
    } catch (const std::exception &error) {
        return tsuya_fail(TSUYA_ERROR_NUMERIC, "OpenCV: essential matrix: %.200s", error.what());
    } catch (...) {
        return tsuya_fail(TSUYA_ERROR_NUMERIC, "OpenCV: essential matrix failed");
    }
}
