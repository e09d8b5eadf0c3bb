/* Sorted numbers and their ranks, against counting. */
#include "core/context.h"
#include "core/order.h"
#include "support.h"

enum { COUNT = 257 };

static void test_sorted(void **state)
{
    (void)state;
    double d[COUNT];
    float f[COUNT];
    int i[COUNT], sum = 0;
    for (int k = 0; k < COUNT; ++k) {
        i[k] = (int)(40.0 * tsuya_random_uniform(1, 1, (uint64_t)k)) - 20; /* many twice */
        sum += i[k];
        d[k] = i[k] + 0.5;
        f[k] = (float)-i[k];
    }
    i[3] = 2147483647; /* differences of such overflow */
    i[4] = -2147483647 - 1;
    tsuya_sort_doubles(d, COUNT);
    tsuya_sort_floats(f, COUNT);
    tsuya_sort_ints(i, COUNT);
    double left = 0.0;
    for (int k = 0; k < COUNT; ++k) {
        assert_true(k == 0 || (d[k - 1] <= d[k] && f[k - 1] <= f[k] && i[k - 1] <= i[k]));
        left += d[k] + (double)f[COUNT - 1 - k];
    }
    assert_true(left == 0.5 * COUNT && sum != 0);
    for (int value = -25; value < 25; ++value) {
        size_t less = 0;
        for (int k = 0; k < COUNT; ++k) {
            less += i[k] < value;
        }
        assert_true(tsuya_rank_of_int(i, COUNT, value) == less);
    }
    tsuya_sort_ints(i, 0);
    assert_true(tsuya_rank_of_int(i, 0, 1) == 0);
}

/* Whatever the order before: rising, falling, all alike, many twice. */
static void test_selected(void **state)
{
    (void)state;
    for (int kind = 0; kind < 4; ++kind) {
        for (size_t count = 1; count < COUNT; count += 1 + count / 3) {
            for (size_t place = 0; place < count; place += 1 + count / 7) {
                float some[COUNT], sorted[COUNT];
                for (size_t k = 0; k < count; ++k) {
                    float many = (float)(int)(20.0 * tsuya_random_uniform(2, 1, (uint64_t)k));
                    sorted[k] = some[k] = kind == 0 ? (float)k : kind == 1 ? -(float)k : kind == 2 ? 3.0f : many;
                }
                tsuya_sort_floats(sorted, count);
                assert_true(tsuya_select_float(some, count, place) == sorted[place]);
                tsuya_sort_floats(some, count);
                assert_memory_equal(some, sorted, count * sizeof *some);
            }
        }
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_sorted), cmocka_unit_test(test_selected)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
