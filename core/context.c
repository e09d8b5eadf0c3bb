#include "core/context.h"

#include <assert.h>
#include <math.h>
#include <omp.h>
#include <stdatomic.h>
#include <stdio.h>
#include <time.h>

/* Set by a signal handler, read by every thread: a lock-free atomic may do both (C17 7.14.1.1). */
static atomic_int interrupt_flag;
static_assert(ATOMIC_INT_LOCK_FREE == 2, "a signal handler may not take a lock");

tsuya_context tsuya_context_default(void)
{
    return (tsuya_context){.threads = omp_get_num_procs(), .seed = 1};
}

void tsuya_progress_update(const tsuya_context *context, const char *label, double done, double total, const char *detail)
{
    if (!context->progress) {
        return;
    }
#pragma omp critical(tsuya_progress)
    context->progress(context->progress_user, label, done, total, detail);
}

void tsuya_interrupt(void)
{
    atomic_store_explicit(&interrupt_flag, 1, memory_order_relaxed);
}

void tsuya_interrupt_clear(void)
{
    atomic_store_explicit(&interrupt_flag, 0, memory_order_relaxed);
}

bool tsuya_interrupted(void)
{
    return atomic_load_explicit(&interrupt_flag, memory_order_relaxed) != 0;
}

tsuya_status tsuya_check_interrupt(void)
{
    return tsuya_interrupted() ? tsuya_fail(TSUYA_ERROR_INTERRUPTED, "interrupted") : TSUYA_OK;
}

double tsuya_clock_s(void)
{
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (double)now.tv_sec + 1e-9 * (double)now.tv_nsec;
}

double tsuya_peak_memory_mb(void)
{
    FILE *status = fopen("/proc/self/status", "re");
    if (!status) {
        return 0.0;
    }
    char line[256];
    unsigned long long kibibytes = 0;
    while (fgets(line, sizeof line, status) && sscanf(line, "VmHWM: %llu", &kibibytes) != 1) {
    }
    fclose(status);
    return (double)kibibytes / 1024.0;
}

void tsuya_peak_memory_reset(void)
{
    FILE *clear = fopen("/proc/self/clear_refs", "we");
    if (clear) {
        fputs("5", clear); /* proc(5): resets VmHWM to the current size */
        fclose(clear);
    }
}

/* PCG output permutation (RXS-M-XS 64/64), used as a hash. */
static uint64_t pcg_hash(uint64_t value)
{
    uint64_t state = value * 6364136223846793005u + 1442695040888963407u;
    uint64_t word = ((state >> ((state >> 59) + 5)) ^ state) * 12605985483714917081u;
    return (word >> 43) ^ word;
}

uint64_t tsuya_random_u64(uint64_t seed, uint64_t stream, uint64_t counter)
{
    return pcg_hash(pcg_hash(pcg_hash(counter) + stream) + seed);
}

double tsuya_random_normal(uint64_t seed, uint64_t stream, uint64_t counter)
{
    double u = 1.0 - tsuya_random_uniform(seed, stream, 2 * counter); /* (0, 1] */
    double v = tsuya_random_uniform(seed, stream, 2 * counter + 1);
    return sqrt(-2.0 * log(u)) * cos(2.0 * 3.14159265358979323846 * v);
}
