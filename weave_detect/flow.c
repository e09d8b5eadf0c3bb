#include "weave_detect/flow.h"

#include <math.h>
#include <stddef.h>

/* Sums over a row of gx², gy², gx·gy; eight lanes, so that the order of additions does not depend on the vector width. */
static void row_sums(double sum[3], const float *above, const float *middle, const float *below, int n)
{
    float xx[8] = {0}, yy[8] = {0}, xy[8] = {0};
    int x = 1;
    for (; x + 8 < n; x += 8) {
        for (int k = 0; k < 8; k++) {
            int i = x + k;
            float gx = 3.0f * (above[i + 1] - above[i - 1] + below[i + 1] - below[i - 1]) + 10.0f * (middle[i + 1] - middle[i - 1]);
            float gy = 3.0f * (below[i - 1] - above[i - 1] + below[i + 1] - above[i + 1]) + 10.0f * (below[i] - above[i]);
            xx[k] += gx * gx;
            yy[k] += gy * gy;
            xy[k] += gx * gy;
        }
    }
    for (int k = 0; k < 8; k++) {
        sum[0] += (double)xx[k];
        sum[1] += (double)yy[k];
        sum[2] += (double)xy[k];
    }
}

void tsuya_flow(tsuya_threads *threads, const float *values, int n)
{
    double sum[3] = {0.0, 0.0, 0.0};
    for (int y = 1; y + 1 < n; y++) {
        const float *row = values + (size_t)y * (size_t)n;
        row_sums(sum, row - n, row, row + n, n);
    }
    double difference = sum[0] - sum[1], twice = 2.0 * sum[2], trace = sum[0] + sum[1];
    double across = 0.5 * atan2(-twice, difference); /* y up turns the sign of the mixed term */
    threads->flow_rad = tsuya_line_wrap(across + 0.5 * 3.14159265358979323846);
    double floor_power = 1e-6 * (double)n * (double)n; /* gradients of the order of 1e-4 grey: nothing there */
    threads->flow_coherence = trace > floor_power ? hypot(difference, twice) / trace : 0.0;
}
