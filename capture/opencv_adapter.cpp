/* OpenCV behind capture/opencv_adapter.h.  No exception leaves this file. */
#include "capture/opencv_adapter.h"

#include "core/match_chance.h"
#include "core/memory.h"

#include <cmath>
#include <new>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <opencv2/features2d.hpp>
#include <vector>

struct tsuya_features {
    std::vector<cv::KeyPoint> place;
    std::vector<tsuya_sift_position> position;
    std::vector<uint8_t> descriptor; /* Hellinger (square-rooted) distances */
};

namespace {

/* Arandjelović & Zisserman 2012: square roots of L1-normed descriptors, of Euclidean length 512. */
void keep_roots(tsuya_features *made, const cv::Mat &descriptor)
{
    for (const cv::KeyPoint &place : made->place) {
        made->position.push_back({place.pt.x, place.pt.y});
    }
    for (int row = 0; row < descriptor.rows; row++) {
        const float *d = descriptor.ptr<float>(row);
        float sum = 0.0f;
        for (int k = 0; k < TSUYA_DESCRIPTOR_LENGTH; k++) {
            sum += d[k];
        }
        for (int k = 0; k < TSUYA_DESCRIPTOR_LENGTH; k++) {
            made->descriptor.push_back(cv::saturate_cast<uint8_t>(sum > 0.0f ? 512.0f * std::sqrt(d[k] / sum) : 0.0f));
        }
    }
}

tsuya_sift view_of(const tsuya_features *f)
{
    return {static_cast<int>(f->position.size()), const_cast<tsuya_sift_position *>(f->position.data()), const_cast<uint8_t *>(f->descriptor.data())};
}

/* Threads that are all alike match by dozens, and some geometry always fits them (core/match_chance.h). */
bool is_chance(const tsuya_features *a, const tsuya_features *b, int matches, int rigid, double tolerance_px)
{
    tsuya_sift of_a = view_of(a), of_b = view_of(b);
    double chance = std::fmax(tsuya_match_chance(&of_a, tolerance_px), tsuya_match_chance(&of_b, tolerance_px));
    return tsuya_match_false_alarms(matches, rigid, chance) > TSUYA_MATCH_MOST_FALSE_ALARMS;
}

void keep_rigid(tsuya_feature_pair *pairs, int *count, const tsuya_features *a, const tsuya_features *b, const tsuya_match *match, int matches, double tolerance_px)
{
    std::vector<cv::Point2f> from, to;
    for (int k = 0; k < matches; k++) {
        from.push_back(a->place[match[k].a].pt);
        to.push_back(b->place[match[k].b].pt);
    }
    std::vector<unsigned char> inlier;
    cv::Mat fundamental = cv::findFundamentalMat(from, to, cv::FM_RANSAC, tolerance_px, 0.999, 1000, inlier);
    for (int k = 0; !fundamental.empty() && k < matches; k++) {
        if (inlier[static_cast<size_t>(k)]) {
            pairs[(*count)++] = {static_cast<int>(match[k].a), static_cast<int>(match[k].b)};
        }
    }
    if (is_chance(a, b, matches, *count, tolerance_px)) {
        *count = 0;
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
        cv::Mat source(grey->height_px, grey->width_px, CV_8U, grey->data, grey->row_bytes), allowed, descriptor;
        if (mask) {
            allowed = cv::Mat(mask->height_px, mask->width_px, CV_8U, mask->data, mask->row_bytes);
        }
        auto *made = new tsuya_features;
        try {
            cv::SIFT::create(most, 3, 0.03)->detectAndCompute(source, allowed, made->place, descriptor);
            keep_roots(made, descriptor);
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

double tsuya_features_radius(const tsuya_features *features, int index) { return 0.5 * static_cast<double>(features->place[static_cast<size_t>(index)].size); }

tsuya_status tsuya_features_match(tsuya_feature_pair *pairs, int *count, const tsuya_features *a, const tsuya_features *b, double tolerance_px, int threads)
{
    tsuya_match *match;
    tsuya_sift of_a = view_of(a), of_b = view_of(b);
    int matches;
    *count = 0;
    TSUYA_TRY(tsuya_match_features(&match, &matches, &of_a, &of_b, nullptr, threads));
    tsuya_status status = TSUYA_OK;
    try {
        if (matches >= 12) {
            keep_rigid(pairs, count, a, b, match, matches, tolerance_px);
        }
    } catch (const std::exception &error) {
        status = tsuya_fail(TSUYA_ERROR_NUMERIC, "OpenCV: matching: %.200s", error.what());
    } catch (...) {
        status = tsuya_fail(TSUYA_ERROR_NUMERIC, "OpenCV: matching failed");
    }
    tsuya_free(match);
    return status;
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
