/* What every long operation is given: threads, seed, progress, the wish to stop. */
#ifndef TSUYA_CORE_CONTEXT_H
#define TSUYA_CORE_CONTEXT_H

#include "core/status.h"

#include <stdbool.h>
#include <stdint.h>

/* done in [0, total]; `detail` may be NULL.  Called from one thread at a time. */
typedef void (*tsuya_progress_sink)(void *user, const char *label, double done, double total, const char *detail);

typedef struct tsuya_context {
    int threads;   /* ≥ 1; results never depend on it */
    uint64_t seed; /* of every random choice */
    tsuya_progress_sink progress; /* NULL: silent */
    void *progress_user;
} tsuya_context;

TSUYA_API tsuya_context tsuya_context_default(void); /* all cores, seed 1, silent */

/* Reports progress; drops it when there is no sink.  Thread safe. */
TSUYA_API void tsuya_progress_update(const tsuya_context *context, const char *label, double done, double total,
                                     const char *detail);

/* The wish to stop (SIGINT, SIGTERM) as a flag that long loops look at.  Async-signal-safe to set. */
TSUYA_API void tsuya_interrupt(void);
TSUYA_API void tsuya_interrupt_clear(void);
TSUYA_API bool tsuya_interrupted(void);
/* TSUYA_ERROR_INTERRUPTED with the reason "interrupted" when the flag is set. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_check_interrupt(void);

/* Monotonic clock, seconds. */
TSUYA_API double tsuya_clock_s(void);
/* Highest resident memory of this process since the last reset, MiB (Linux VmHWM). */
TSUYA_API double tsuya_peak_memory_mb(void);
TSUYA_API void tsuya_peak_memory_reset(void);

/* Counter-based random numbers: a pure function of (seed, stream, counter), so that no result depends on the order of
 * threads.  PCG-style hash of Jarzynski & Olano, "Hash functions for GPU rendering", JCGT 9(3), 2020. */
TSUYA_API uint64_t tsuya_random_u64(uint64_t seed, uint64_t stream, uint64_t counter);
/* [0, 1), 53 bits */
static inline double tsuya_random_uniform(uint64_t seed, uint64_t stream, uint64_t counter)
{
    return (double)(tsuya_random_u64(seed, stream, counter) >> 11) * 0x1.0p-53;
}
/* Standard normal; uses the counters 2c and 2c+1 of its stream. */
TSUYA_API double tsuya_random_normal(uint64_t seed, uint64_t stream, uint64_t counter);

#endif
