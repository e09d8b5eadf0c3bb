#include "core/match_chance.h"

#include <math.h>

enum { SAMPLE = 7 }; /* matches that fix a fundamental matrix */

static double log10_binomial(int n, int k)
{
    return (lgamma(n + 1.0) - lgamma(k + 1.0) - lgamma(n - k + 1.0)) / log(10.0);
}

double tsuya_match_false_alarms(int matches, int inliers, double chance)
{
    if (inliers <= SAMPLE) {
        return 0.0;
    }
    int n = matches > inliers ? matches : inliers;
    return log10(n - SAMPLE) + log10_binomial(n, inliers) + log10_binomial(inliers, SAMPLE) + (inliers - SAMPLE) * log10(chance);
}

double tsuya_match_chance(const tsuya_sift *features, double off_px)
{
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
    for (int i = 0; i < features->count; i++) {
        const double at[2] = {(double)features->position[i].x, (double)features->position[i].y};
        for (int d = 0; d < 2; d++) {
            low[d] = fmin(low[d], at[d]);
            high[d] = fmax(high[d], at[d]);
        }
    }
    double width = high[0] - low[0], height = high[1] - low[1], share = 2.0 * off_px * hypot(width, height) / (width * height);
    return share < 1.0 ? share : 1.0; /* also where there is no box */
}
