/* Child processes: posix_spawn, output to a log that is kept, the exit explained, no orphans.
 *
 * The child runs in a process group of its own.  It is told to end when this process is interrupted (SIGTERM, and SIGKILL
 * after three seconds) and dies with this process even when that is killed (parent-death signal, set through util-linux'
 * setpriv). */
#ifndef TSUYA_CORE_PROCESS_H
#define TSUYA_CORE_PROCESS_H

#include "core/context.h"

/* Called for every line that the child prints (without its newline), before it is written to the log. */
typedef void (*tsuya_line_sink)(void *user, const char *line);

typedef struct tsuya_process_options {
    const char *log_path;            /* stdout and stderr, appended; NULL drops them */
    const char *working_folder;      /* NULL: this process' own */
    const char *const *environment;  /* extra NAME=VALUE, NULL-terminated; NULL: none */
    tsuya_line_sink line;            /* NULL: none */
    void *line_user;
    bool one_processor;              /* the child has one processor, and is told so by the C library: for programs whose result depends on
                                        the number of threads (a library preloaded from memory; LD_PRELOAD of this process does not reach it) */
} tsuya_process_options;

typedef struct tsuya_process_info {
    int exit_code;       /* −1 when it died by a signal */
    int signal_number;   /* 0 when it exited */
    double seconds, peak_mb;
} tsuya_process_info;

/* Runs argv[0] (looked up in PATH) to its end.  argv is NULL-terminated.  Anything but exit 0 is TSUYA_ERROR_CHILD with the
 * program, how it ended, its last line of output that is not empty, and the log's path; a missing program is
 * TSUYA_ERROR_UNAVAILABLE with its name and the Debian package (core knows colmap, gnuplot); interruption is
 * TSUYA_ERROR_INTERRUPTED. `info` may be NULL. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_process_run(tsuya_process_info *info, const char *const argv[],
                                                          const tsuya_process_options *options /* NULL: none */);
/* Everything that a short command prints (stdout and stderr together), at most 1 MiB; tsuya_free. The exit code is in info
 * and is no failure. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_process_capture(char **output, tsuya_process_info *info, const char *const argv[],
                                                              const char *const *environment);
/* true when the program is in PATH */
TSUYA_API bool tsuya_process_available(const char *program);

#endif
