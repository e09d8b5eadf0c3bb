/* OpenCV's decoders and encoders behind core/image_adapters.h.  No exception leaves this file. */
#include "core/image_adapters.h"

#include <cstring>
#include <iostream>
#include <mutex>
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace {

constexpr int TIFF_LZW = 5; /* unsaid, OpenCV writes three floats as SGI LogLuv, which keeps 8 bits of colour */

/* OpenCV writes a line to std::cerr when a file is damaged; the status says it. */
class silence {
public:
    silence()
    {
        std::lock_guard<std::mutex> guard(mutex);
        if (users++ == 0) {
            kept = std::cerr.rdstate();
            std::cerr.setstate(std::ios_base::failbit);
        }
    }
    ~silence()
    {
        std::lock_guard<std::mutex> guard(mutex);
        if (--users == 0) {
            std::cerr.clear(kept);
        }
    }
    silence(const silence &) = delete;
    silence &operator=(const silence &) = delete;

private:
    static inline std::mutex mutex;
    static inline int users = 0;
    static inline std::ios_base::iostate kept = std::ios_base::goodbit;
};

tsuya_status from_mat(tsuya_image *image, const cv::Mat &decoded, const char *path)
{
    tsuya_sample sample;
    switch (decoded.depth()) {
    case CV_8U: sample = TSUYA_SAMPLE_U8; break;
    case CV_16U: sample = TSUYA_SAMPLE_U16; break;
    case CV_32F: sample = TSUYA_SAMPLE_F32; break;
    default: return tsuya_fail(TSUYA_ERROR_INPUT, "%s: samples of 8 or 16 bits or 32-bit floats are accepted", path);
    }
    int channels = decoded.channels();
    if (channels != 1 && channels != 3 && channels != 4) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d channels; 1, 3 or 4 are accepted", path, channels);
    }
    TSUYA_TRY(tsuya_image_create(image, decoded.cols, decoded.rows, channels, sample,
                                 sample == TSUYA_SAMPLE_F32 ? TSUYA_ENCODING_LINEAR : TSUYA_ENCODING_SRGB));
    cv::Mat target(decoded.rows, decoded.cols, decoded.type(), image->data, image->row_bytes);
    if (channels == 1) {
        decoded.copyTo(target);
    } else {
        cv::cvtColor(decoded, target, channels == 3 ? cv::COLOR_BGR2RGB : cv::COLOR_BGRA2RGBA);
    }
    return TSUYA_OK;
}

} // namespace

tsuya_status tsuya_opencv_decode(tsuya_image *image, const char *bytes, size_t size, const char *path)
{
    try {
        silence quiet;
        cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
        if (size > INT32_MAX) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %zu bytes, at most 2 GiB are accepted", path, size);
        }
        cv::Mat encoded(1, static_cast<int>(size), CV_8U, const_cast<char *>(bytes));
        cv::Mat decoded = cv::imdecode(encoded, cv::IMREAD_UNCHANGED | cv::IMREAD_IGNORE_ORIENTATION);
        if (decoded.empty()) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: cannot be decoded as an image", path);
        }
        return from_mat(image, decoded, path);
    } catch (const std::exception &error) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: cannot be decoded as an image: %.200s", path, error.what());
    } catch (...) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: cannot be decoded as an image", path);
    }
}

tsuya_status tsuya_opencv_encode(const tsuya_image *image, const char *path, int jpeg_quality)
{
    try {
        silence quiet;
        int depth = image->sample == TSUYA_SAMPLE_U8 ? CV_8U : image->sample == TSUYA_SAMPLE_U16 ? CV_16U : CV_32F;
        cv::Mat source(image->height_px, image->width_px, CV_MAKETYPE(depth, image->channels), image->data, image->row_bytes);
        cv::Mat swapped; /* of its own: the caller's pixels stay as they are */
        if (image->channels == 1) {
            swapped = source;
        } else if (image->channels == 3) {
            cv::cvtColor(source, swapped, cv::COLOR_RGB2BGR);
        } else if (image->channels == 4) {
            cv::cvtColor(source, swapped, cv::COLOR_RGBA2BGRA);
        }
        std::vector<int> parameters = {cv::IMWRITE_JPEG_QUALITY, jpeg_quality, cv::IMWRITE_PNG_COMPRESSION, 4,
                                       cv::IMWRITE_TIFF_COMPRESSION, TIFF_LZW};
        if (!cv::imwrite(path, swapped, parameters)) {
            return tsuya_fail(TSUYA_ERROR_IO, "%s: cannot write the image", path);
        }
        return TSUYA_OK;
    } catch (const std::exception &error) {
        return tsuya_fail(TSUYA_ERROR_IO, "%s: cannot write the image: %.200s", path, error.what());
    } catch (...) {
        return tsuya_fail(TSUYA_ERROR_IO, "%s: cannot write the image", path);
    }
}
