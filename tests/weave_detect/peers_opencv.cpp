#include "peers_opencv.h"

#include <opencv2/imgproc.hpp>

#include <cmath>

static double wrap(double a)
{
    a = std::fmod(a, CV_PI);
    return a < 0 ? a + CV_PI : a;
}

static void tensor(double angle[2], const cv::Mat &dx, const cv::Mat &dy)
{
    double xx = dx.dot(dx), yy = dy.dot(dy), xy = dx.dot(dy);
    angle[0] = wrap(-0.5 * std::atan2(2 * xy, xx - yy) + CV_PI / 2);
    angle[1] = wrap(angle[0] + CV_PI / 2);
}

void peer_structure_tensor(double angle[2], const float *values, int n)
{
    cv::Mat image(n, n, CV_32F, const_cast<float *>(values)), dx, dy;
    cv::Sobel(image, dx, CV_32F, 1, 0);
    cv::Sobel(image, dy, CV_32F, 0, 1);
    tensor(angle, dx, dy);
}

void peer_gaussian_derivative(double angle[2], const float *values, int n)
{
    cv::Mat image(n, n, CV_32F, const_cast<float *>(values)), smooth, dx, dy;
    cv::GaussianBlur(image, smooth, cv::Size(), 1.5);
    cv::Sobel(smooth, dx, CV_32F, 1, 0);
    cv::Sobel(smooth, dy, CV_32F, 0, 1);
    cv::Rect inner(5, 5, n - 10, n - 10);
    tensor(angle, cv::Mat(dx, inner), cv::Mat(dy, inner));
}

void peer_sobel_histogram(double angle[2], const float *values, int n)
{
    cv::Mat image(n, n, CV_32F, const_cast<float *>(values)), dx, dy;
    cv::Sobel(image, dx, CV_32F, 1, 0);
    cv::Sobel(image, dy, CV_32F, 0, 1);
    double bin[180] = {0}, smooth[180];
    for (int y = 0; y < n; y++) {
        for (int x = 0; x < n; x++) {
            double gx = dx.at<float>(y, x), gy = dy.at<float>(y, x);
            bin[int(wrap(std::atan2(gx, gy)) * 180 / CV_PI) % 180] += gx * gx + gy * gy; /* along the edge, y up */
        }
    }
    int best = 0, second = -1;
    for (int i = 0; i < 180; i++) {
        smooth[i] = 0;
        for (int k = -4; k <= 4; k++) {
            smooth[i] += (5 - std::abs(k)) * bin[(i + k + 180) % 180];
        }
    }
    for (int i = 0; i < 180; i++) {
        best = smooth[i] > smooth[best] ? i : best;
    }
    for (int i = 0; i < 180; i++) {
        int apart = std::abs(i - best);
        apart = apart > 90 ? 180 - apart : apart;
        if (apart >= 45 && (second < 0 || smooth[i] > smooth[second])) {
            second = i;
        }
    }
    angle[0] = (best + 0.5) * CV_PI / 180;
    angle[1] = (second + 0.5) * CV_PI / 180;
}

void peer_fourier_peak(double angle[2], const float *values, int n)
{
    cv::Mat image(n, n, CV_32F, const_cast<float *>(values)), window, spectrum;
    cv::createHanningWindow(window, cv::Size(n, n), CV_32F);
    cv::Mat flat = (image - cv::mean(image)[0]).mul(window);
    cv::dft(flat, spectrum, cv::DFT_COMPLEX_OUTPUT);
    auto power = [&](int x, int y) {
        cv::Vec2f v = spectrum.at<cv::Vec2f>((y + n) % n, (x + n) % n);
        return std::log(double(v[0]) * v[0] + double(v[1]) * v[1] + 1e-20);
    };
    double fx[2] = {1, 0}, fy[2] = {0, 1};
    for (int k = 0; k < 2; k++) {
        double best = -1e9;
        for (int y = 0; y < n / 2; y++) {
            for (int x = -n / 2 + 1; x < n / 2; x++) {
                double r = std::hypot(x, y);
                if (r < 3 || (k == 1 && std::fabs(x * fy[0] - y * fx[0]) < 0.7071 * r * std::hypot(fx[0], fy[0])) || power(x, y) <= best) {
                    continue;
                }
                best = power(x, y);
                auto vertex = [&](double a, double b, double c) { return a - 2 * b + c < 0 ? 0.5 * (a - c) / (a - 2 * b + c) : 0.0; };
                fx[k] = x + vertex(power(x - 1, y), best, power(x + 1, y));
                fy[k] = y + vertex(power(x, y - 1), best, power(x, y + 1));
            }
        }
        angle[k] = wrap(std::atan2(fx[k], fy[k]));
    }
}
