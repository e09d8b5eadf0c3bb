/* The random numbers of the path tracer: stratified, uniform, and a function of nothing but their key. */
#include "support.h"

#include <math.h>

#include "render/sampler.h"

/* Every elementary interval of area 2^-m holds one of the first 2^m points: a (0, m, 2)-net, for each Owen scrambling. */
static void test_net(void **state)
{
    (void)state;
    for (int m = 1; m <= 10; ++m) {
        for (int split = 0; split <= m; ++split) {
            for (uint32_t pixel = 0; pixel < 3; ++pixel) {
                uint8_t seen[1024] = {0};
                for (uint32_t k = 0; k < 1u << m; ++k) {
                    double u[2];
                    tsuya_sampler_pair(tsuya_sampler_start(9, pixel, k), 5, u);
                    int a = (int)(u[0] * (1 << split)), b = (int)(u[1] * (1 << (m - split)));
                    assert_true(u[0] >= 0.0 && u[0] < 1.0 && u[1] >= 0.0 && u[1] < 1.0);
                    assert_int_equal(seen[a << (m - split) | b]++, 0);
                }
            }
        }
    }
}

/* One sample alone is uniform over the pixels, and pairs of dimensions, pixels and seeds have nothing in common. */
static void test_uniform_and_independent(void **state)
{
    (void)state;
    enum { COUNT = 200000 };
    double mean[2] = {0}, across_pairs = 0.0, across_pixels = 0.0, across_seeds = 0.0, within = 0.0;
    for (uint32_t k = 0; k < COUNT; ++k) {
        double a[2], b[2], c[2], d[2];
        tsuya_sampler_pair(tsuya_sampler_start(1, k, 3), 7, a);
        tsuya_sampler_pair(tsuya_sampler_start(1, k, 3), 8, b);
        tsuya_sampler_pair(tsuya_sampler_start(1, k + 1, 3), 7, c);
        tsuya_sampler_pair(tsuya_sampler_start(2, k, 3), 7, d);
        mean[0] += a[0];
        mean[1] += a[1];
        across_pairs += (a[0] - 0.5) * (b[0] - 0.5);
        across_pixels += (a[0] - 0.5) * (c[0] - 0.5);
        across_seeds += (a[0] - 0.5) * (d[0] - 0.5);
        within += (a[0] - 0.5) * (a[1] - 0.5);
    }
    double sigma_mean = sqrt(1.0 / 12.0 / COUNT), sigma_product = 1.0 / 12.0 / sqrt(COUNT);
    assert_true(fabs(mean[0] / COUNT - 0.5) < 4.0 * sigma_mean && fabs(mean[1] / COUNT - 0.5) < 4.0 * sigma_mean);
    assert_true(fabs(across_pairs / COUNT) < 4.0 * sigma_product && fabs(across_pixels / COUNT) < 4.0 * sigma_product);
    assert_true(fabs(across_seeds / COUNT) < 4.0 * sigma_product && fabs(within / COUNT) < 4.0 * sigma_product);
}

/* Sixteen at a time say the same in 24 bits. */
static void test_many(void **state)
{
    (void)state;
    uint32_t key[16], sample[16];
    float u[2][16];
    for (uint32_t pair = 0; pair < 50; ++pair) {
        for (uint32_t k = 0; k < 16; ++k) {
            tsuya_sampler s = tsuya_sampler_start(4, pair + k / 3, k);
            key[k] = s.key;
            sample[k] = s.sample;
        }
        tsuya_sampler_pairs(key, sample, 16, pair, u[0], u[1]);
        for (int k = 0; k < 16; ++k) {
            double one[2];
            tsuya_sampler_pair((tsuya_sampler){key[k], sample[k]}, pair, one);
            for (int c = 0; c < 2; ++c) {
                assert_true((double)u[c][k] == floor(one[c] * 0x1p24) * 0x1p-24);
            }
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_net),
        cmocka_unit_test(test_uniform_and_independent),
        cmocka_unit_test(test_many),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
