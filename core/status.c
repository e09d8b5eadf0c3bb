#include "core/status.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>

static _Thread_local char reason[TSUYA_REASON_SIZE];
static tsuya_log_sink log_sink;
static void *log_user;

/* One line: control characters become spaces, so that a hostile file name cannot forge a message. */
static void make_one_line(char *text)
{
    for (; *text; text++) {
        if ((unsigned char)*text < 0x20 || *text == 0x7f) {
            *text = ' ';
        }
    }
}

tsuya_status tsuya_fail(tsuya_status status, const char *format, ...)
{
    char line[TSUYA_REASON_SIZE]; /* the arguments may point into the old reason */
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(line, sizeof line, format, arguments);
    va_end(arguments);
    make_one_line(line);
    memcpy(reason, line, sizeof reason);
    return status;
}

tsuya_status tsuya_fail_errno(const char *path, const char *action)
{
    int number = errno;
    char text[256];
    const char *what = number == ENOSPC ? "no space left on the disk" : strerror_r(number, text, sizeof text);
    return tsuya_fail(number == ENOMEM ? TSUYA_ERROR_MEMORY : TSUYA_ERROR_IO, "%s: %s: %s", path, action, what);
}

const char *tsuya_reason(void)
{
    return reason;
}

const char *tsuya_status_name(tsuya_status status)
{
    switch (status) {
    case TSUYA_OK: return "ok";
    case TSUYA_ERROR_INPUT: return "input";
    case TSUYA_ERROR_IO: return "io";
    case TSUYA_ERROR_MEMORY: return "memory";
    case TSUYA_ERROR_UNAVAILABLE: return "unavailable";
    case TSUYA_ERROR_NUMERIC: return "numeric";
    case TSUYA_ERROR_CHILD: return "child";
    case TSUYA_ERROR_INTERRUPTED: return "interrupted";
    }
    return "unknown";
}

void tsuya_failure_keep(tsuya_failure *failure, size_t index, tsuya_status status)
{
    if (status == TSUYA_OK || (failure->status != TSUYA_OK && failure->index <= index)) {
        return;
    }
    failure->status = status;
    failure->index = index;
    memcpy(failure->reason, reason, sizeof failure->reason);
}

tsuya_status tsuya_failure_raise(const tsuya_failure *failure)
{
    return failure->status == TSUYA_OK ? TSUYA_OK : tsuya_fail(failure->status, "%s", failure->reason);
}

void tsuya_log_set_sink(tsuya_log_sink sink, void *user)
{
    log_sink = sink;
    log_user = user;
}

static void emit(tsuya_log_level level, const char *format, va_list arguments)
{
    char line[TSUYA_REASON_SIZE];
    vsnprintf(line, sizeof line, format, arguments);
    make_one_line(line);
#pragma omp critical(tsuya_log)
    {
        if (log_sink) {
            log_sink(log_user, level, line);
        }
    }
}

void tsuya_note(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    emit(TSUYA_LOG_NOTE, format, arguments);
    va_end(arguments);
}

void tsuya_warn(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    emit(TSUYA_LOG_WARNING, format, arguments);
    va_end(arguments);
}
