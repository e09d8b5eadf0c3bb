/* Progress, the wish to stop, clocks, and random numbers: known statistics, and independence of threads. */
#include "support.h"

#include "core/context.h"
#include "core/memory.h"

#include <pthread.h>
#include <signal.h>

typedef struct heard { int calls, inside; double last; } heard;

static void hear(void *user, const char *label, double done, double total, const char *detail)
{
    heard *h = user;
    assert_int_equal(++h->inside, 1); /* one thread at a time */
    assert_string_equal(label, "rays");
    assert_true(done <= total);
    (void)detail;
    h->calls++;
    h->last = done;
    h->inside--;
}

static void test_progress(void **state)
{
    (void)state;
    heard h = {0};
    tsuya_context context = tsuya_context_default();
    assert_true(context.threads >= 1 && context.seed == 1 && !context.progress);
    tsuya_progress_update(&context, "rays", 1, 2, NULL);
    context.progress = hear;
    context.progress_user = &h;
#pragma omp parallel for num_threads(4)
    for (int i = 0; i < 1000; i++) {
        tsuya_progress_update(&context, "rays", i, 1000, "half way");
    }
    assert_int_equal(h.calls, 1000);
}

static void on_signal(int number)
{
    (void)number;
    tsuya_interrupt();
}

static void test_the_wish_to_stop(void **state)
{
    (void)state;
    assert_ok(tsuya_check_interrupt());
    signal(SIGUSR1, on_signal);
    raise(SIGUSR1);
    assert_true(tsuya_interrupted());
    assert_int_equal(tsuya_check_interrupt(), TSUYA_ERROR_INTERRUPTED);
    assert_string_equal(tsuya_reason(), "interrupted");
    tsuya_interrupt_clear();
    assert_ok(tsuya_check_interrupt());
}

static void test_clock_and_memory(void **state)
{
    (void)state;
    double start = tsuya_clock_s();
    usleep(20000);
    double passed = tsuya_clock_s() - start;
    assert_true(passed >= 0.02 && passed < 10.0);
    size_t size = (size_t)64 << 20;
    tsuya_peak_memory_reset();
    double before = tsuya_peak_memory_mb();
    char *block = tsuya_calloc(size, 1);
    memset(block, 1, size);
    assert_true(tsuya_peak_memory_mb() - before > 60.0);
    tsuya_free(block);
    assert_true(tsuya_peak_memory_mb() - before > 60.0); /* the highest, not the present */
#ifndef __SANITIZE_ADDRESS__
    tsuya_peak_memory_reset();
    assert_true(tsuya_peak_memory_mb() - before < 60.0);
#endif
}

static void test_random_numbers(void **state)
{
    (void)state;
    enum { N = 200000, CELLS = 64 };
    double sum = 0, square = 0, lagged = 0, before = 0;
    int cell[CELLS] = {0};
    for (int i = 0; i < N; i++) {
        double u = tsuya_random_uniform(3, 5, (uint64_t)i);
        assert_true(u >= 0.0 && u < 1.0);
        sum += u - 0.5;
        square += (u - 0.5) * (u - 0.5);
        lagged += i ? (u - 0.5) * (before - 0.5) : 0.0;
        before = u;
        cell[(int)(u * CELLS)]++;
    }
    assert_near(sum / N, 0, 5 * sqrt(1 / 12.0 / N));
    assert_near(square / N, 1 / 12.0, 5 * sqrt(1 / 180.0 / N));
    assert_near(lagged / N, 0, 5 / 12.0 / sqrt(N));
    double chi2 = 0;
    for (int c = 0; c < CELLS; c++) {
        chi2 += pow(cell[c] - (double)N / CELLS, 2) / ((double)N / CELLS);
    }
    assert_true(chi2 > 30 && chi2 < 116); /* 63 degrees of freedom: 0.01 % on either side */
}

static double correlation(uint64_t seed_b, uint64_t stream_b)
{
    enum { N = 100000 };
    double sum = 0;
    for (uint64_t i = 0; i < N; i++) {
        sum += (tsuya_random_uniform(1, 1, i) - 0.5) * (tsuya_random_uniform(seed_b, stream_b, i) - 0.5);
    }
    return sum * 12 / N;
}

static void test_seeds_and_streams_are_independent(void **state)
{
    (void)state;
    for (uint64_t k = 2; k < 12; k++) {
        assert_near(correlation(1, k), 0, 5 / sqrt(100000));
        assert_near(correlation(k, 1), 0, 5 / sqrt(100000));
    }
}

static void test_normal_numbers(void **state)
{
    (void)state;
    enum { N = 200000 };
    double sum = 0, square = 0, fourth = 0;
    for (uint64_t i = 0; i < N; i++) {
        double z = tsuya_random_normal(9, 2, i);
        assert_true(isfinite(z));
        sum += z;
        square += z * z;
        fourth += z * z * z * z;
    }
    assert_near(sum / N, 0, 5 / sqrt(N));
    assert_near(square / N, 1, 5 * sqrt(2.0 / N));
    assert_near(fourth / N, 3, 5 * sqrt(96.0 / N));
}

static void test_no_thread_changes_a_number(void **state)
{
    (void)state;
    enum { N = 10000 };
    static uint64_t one[N], many[N];
    for (int i = 0; i < N; i++) {
        one[i] = tsuya_random_u64(1, 2, (uint64_t)i);
    }
#pragma omp parallel for num_threads(4) schedule(dynamic, 7)
    for (int i = N - 1; i >= 0; i--) {
        many[i] = tsuya_random_u64(1, 2, (uint64_t)i);
    }
    assert_memory_equal(one, many, sizeof one);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_progress),
        cmocka_unit_test(test_the_wish_to_stop),
        cmocka_unit_test(test_clock_and_memory),
        cmocka_unit_test(test_random_numbers),
        cmocka_unit_test(test_seeds_and_streams_are_independent),
        cmocka_unit_test(test_normal_numbers),
        cmocka_unit_test(test_no_thread_changes_a_number),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
