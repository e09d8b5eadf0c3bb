/* Status of an operation, and the one-line reason of the last failure.
 *
 * Pure mathematics cannot fail and returns values.  Everything else returns a tsuya_status that the caller must look at.
 * The place that fails leaves one line that names the file, the value, and what would be accepted; callers pass the
 * status on and add nothing unless they know better.
 *
 * The reason lives in the thread that failed.  A parallel loop keeps the failure of its lowest index in a tsuya_failure
 * and raises it again after the loop, so that the message does not depend on the number of threads. */
#ifndef TSUYA_CORE_STATUS_H
#define TSUYA_CORE_STATUS_H

#include "core/api.h"

#include <stdarg.h>
#include <stddef.h>

typedef enum tsuya_status {
    TSUYA_OK = 0,
    TSUYA_ERROR_INPUT,       /* a file or value that the user gave cannot be used */
    TSUYA_ERROR_IO,          /* reading, writing, disk full */
    TSUYA_ERROR_MEMORY,      /* an allocation failed */
    TSUYA_ERROR_UNAVAILABLE, /* a program or a part of this build is missing */
    TSUYA_ERROR_NUMERIC,     /* a solve did not converge or is singular */
    TSUYA_ERROR_CHILD,       /* a child process failed */
    TSUYA_ERROR_INTERRUPTED, /* the user asked to stop */
} tsuya_status;

enum { TSUYA_REASON_SIZE = 1024 };

/* Records the reason (printf style, one line, no trailing newline) and returns `status`, for `return tsuya_fail(...)`. */
TSUYA_API tsuya_status tsuya_fail(tsuya_status status, const char *format, ...) TSUYA_PRINTF(2, 3);

/* `tsuya_fail(TSUYA_ERROR_IO, "PATH: ACTION: strerror(errno)")`; ENOSPC reads "no space left on the disk". */
TSUYA_API tsuya_status tsuya_fail_errno(const char *path, const char *action);

/* The reason of this thread's last failure; "" before the first.  Borrowed, valid until the next failure here. */
TSUYA_API const char *tsuya_reason(void);

/* Name of a status, for logs: "input", "io", ... */
TSUYA_API const char *tsuya_status_name(tsuya_status status);

/* A failure kept aside, to be raised in another thread or later.  Zero-initialise. */
typedef struct tsuya_failure {
    tsuya_status status;
    size_t index; /* lowest index that failed so far */
    char reason[TSUYA_REASON_SIZE];
} tsuya_failure;

/* Keeps this thread's last failure under `index` if none with a lower index is kept.  Call inside an OpenMP critical. */
TSUYA_API void tsuya_failure_keep(tsuya_failure *failure, size_t index, tsuya_status status);

/* Returns the kept status and makes its reason this thread's own. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_failure_raise(const tsuya_failure *failure);

/* Warnings and notes: one line each, handed to the sink (app/ prints and collects them).  Without a sink they are dropped. */
typedef enum tsuya_log_level { TSUYA_LOG_NOTE, TSUYA_LOG_WARNING } tsuya_log_level;
typedef void (*tsuya_log_sink)(void *user, tsuya_log_level level, const char *line);
TSUYA_API void tsuya_log_set_sink(tsuya_log_sink sink, void *user);
TSUYA_API void tsuya_note(const char *format, ...) TSUYA_PRINTF(1, 2);
TSUYA_API void tsuya_warn(const char *format, ...) TSUYA_PRINTF(1, 2);

/* `TSUYA_TRY(f(x));` passes a failure on;  `TSUYA_GOTO_DONE(status, f(x));` does so through the clean-up label `done`. */
#define TSUYA_TRY(expression)                      \
    do {                                           \
        tsuya_status try_status_ = (expression);   \
        if (try_status_ != TSUYA_OK) {             \
            return try_status_;                    \
        }                                          \
    } while (0)
#define TSUYA_GOTO_DONE(status, expression)        \
    do {                                           \
        (status) = (expression);                   \
        if ((status) != TSUYA_OK) {                \
            goto done;                             \
        }                                          \
    } while (0)

#endif
