#include "core/process.h"

#include "core/memory.h"
#include "core/one_processor.h" /* made from core/preload */

#include <errno.h>
#include <fcntl.h>
#include <poll.h>
#include <sched.h>
#include <signal.h>
#include <spawn.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <time.h>
#include <unistd.h>

extern char **environ;

enum { LINE_SIZE = 4096, CAPTURE_LIMIT = 1 << 20, POLL_MS = 100 };
static const double PATIENCE_S = 3.0; /* between SIGTERM and SIGKILL */

bool tsuya_process_available(const char *program)
{
    if (strchr(program, '/')) {
        return access(program, X_OK) == 0;
    }
    const char *path = getenv("PATH");
    for (const char *at = path ? path : "/usr/bin:/bin"; *at;) {
        size_t length = strcspn(at, ":");
        char candidate[LINE_SIZE];
        int written = snprintf(candidate, sizeof candidate, "%.*s/%s", (int)length, at, program);
        if (written > 0 && (size_t)written < sizeof candidate && access(candidate, X_OK) == 0) {
            return true;
        }
        at += length + (at[length] == ':');
    }
    return false;
}

static tsuya_status fail_missing(const char *program)
{
    static const char *const PACKAGE[][2] = {{"colmap", "colmap"}, {"gnuplot", "gnuplot-nox"}, {"blender", "blender"},
                                             {"mrcal-calibrate-cameras", "mrcal"}};
    for (size_t i = 0; i < sizeof PACKAGE / sizeof PACKAGE[0]; i++) {
        if (strcmp(PACKAGE[i][0], program) == 0) {
            return tsuya_fail(TSUYA_ERROR_UNAVAILABLE, "%s: program not found; install Debian's package %s (make deps)", program, PACKAGE[i][1]);
        }
    }
    return tsuya_fail(TSUYA_ERROR_UNAVAILABLE, "%s: program not found in PATH", program);
}

typedef struct child {
    pid_t pid;
    int output; /* read end */
    FILE *log;
    const tsuya_process_options *options;
    char line[LINE_SIZE], last[256];
    size_t used;
    char *captured; /* capture only */
    size_t captured_size;
} child;

/* Ours first, which replace what is there; `last` may be NULL. */
static char **merged_environment(const char *const *extra, const char *last)
{
    size_t own = 0, more = 0, used = 0;
    while (environ[own]) {
        own++;
    }
    while (extra && extra[more]) {
        more++;
    }
    char **merged = tsuya_calloc(own + more + 2, sizeof *merged);
    for (size_t i = 0; merged && i < more; i++) {
        merged[used++] = (char *)(uintptr_t)extra[i];
    }
    if (merged && last) {
        merged[used++] = (char *)(uintptr_t)last;
    }
    const size_t ours = used;
    for (size_t i = 0; merged && i < own; i++) {
        bool replaced = false;
        for (size_t k = 0; k < ours; k++) {
            replaced |= strncmp(environ[i], merged[k], strcspn(merged[k], "=") + 1) == 0;
        }
        if (!replaced) {
            merged[used++] = environ[i];
        }
    }
    return merged;
}

/* argv behind setpriv, so that the child dies with this process. */
static const char **wrapped_arguments(const char *const argv[])
{
    static const char *const PREFIX[] = {"setpriv", "--pdeathsig", "KILL", "--"};
    size_t count = 0, before = tsuya_process_available("setpriv") ? 4 : 0;
    while (argv[count]) {
        count++;
    }
    const char **all = tsuya_calloc(count + before + 1, sizeof *all);
    if (all) {
        memcpy(all, PREFIX, before * sizeof *all);
        memcpy(all + before, argv, count * sizeof *all);
    }
    return all;
}

/* This thread, and with it the child that it starts next, on the processor where it runs; false leaves it as it was. */
static bool hold_processor(cpu_set_t *before)
{
    cpu_set_t one;
    int processor = sched_getcpu();
    if (processor < 0 || sched_getaffinity(0, sizeof *before, before) != 0) {
        return false;
    }
    CPU_ZERO(&one);
    CPU_SET(processor, &one);
    return sched_setaffinity(0, sizeof one, &one) == 0;
}

/* The library that says so, as a file without a name; −1 where that cannot be made. */
static int open_one_processor(void)
{
    int file = memfd_create("one_processor", MFD_CLOEXEC);
    if (file >= 0 && write(file, ONE_PROCESSOR, sizeof ONE_PROCESSOR) != (ssize_t)sizeof ONE_PROCESSOR) {
        close(file);
        file = -1;
    }
    return file;
}

enum { PRELOADED = 3 }; /* its number in the child */
static const char PRELOAD[] = "LD_PRELOAD=/proc/self/fd/3";

static tsuya_status spawn(child *c, const char *const argv[], const char *working_folder, const char *const *environment, bool one_processor)
{
    tsuya_status status = TSUYA_OK;
    int pipe_ends[2] = {-1, -1}, preloaded = one_processor ? open_one_processor() : -1;
    posix_spawn_file_actions_t actions;
    posix_spawnattr_t attributes;
    sigset_t none, defaults;
    const char **arguments = wrapped_arguments(argv);
    char **variables = merged_environment(environment, one_processor ? PRELOAD : NULL);
    posix_spawn_file_actions_init(&actions);
    posix_spawnattr_init(&attributes);
    if (!arguments || !variables) {
        status = TSUYA_ERROR_MEMORY;
        goto done;
    }
    if (one_processor && preloaded < 0) {
        status = tsuya_fail_errno(argv[0], "cannot be given one processor");
        goto done;
    }
    if (pipe2(pipe_ends, O_CLOEXEC) != 0) {
        status = tsuya_fail_errno(argv[0], "cannot make a pipe");
        goto done;
    }
    sigemptyset(&none);
    sigfillset(&defaults);
    posix_spawn_file_actions_addopen(&actions, 0, "/dev/null", O_RDONLY, 0);
    posix_spawn_file_actions_adddup2(&actions, pipe_ends[1], 1);
    posix_spawn_file_actions_adddup2(&actions, pipe_ends[1], 2);
    if (one_processor) {
        posix_spawn_file_actions_adddup2(&actions, preloaded, PRELOADED);
    }
    posix_spawn_file_actions_addclosefrom_np(&actions, one_processor ? PRELOADED + 1 : PRELOADED);
    if (working_folder) {
        posix_spawn_file_actions_addchdir_np(&actions, working_folder);
    }
    posix_spawnattr_setsigmask(&attributes, &none);
    posix_spawnattr_setsigdefault(&attributes, &defaults);
    posix_spawnattr_setpgroup(&attributes, 0);
    posix_spawnattr_setflags(&attributes, POSIX_SPAWN_SETPGROUP | POSIX_SPAWN_SETSIGMASK | POSIX_SPAWN_SETSIGDEF);
    int error = posix_spawnp(&c->pid, arguments[0], &actions, &attributes, (char *const *)(uintptr_t)arguments, variables);
    if (error != 0) {
        errno = error;
        status = tsuya_fail_errno(argv[0], "cannot be started");
        goto done;
    }
    c->output = pipe_ends[0];
    pipe_ends[0] = -1;
done:
    for (int i = 0; i < 3; i++) {
        const int file = i < 2 ? pipe_ends[i] : preloaded;
        if (file >= 0) {
            close(file);
        }
    }
    posix_spawn_file_actions_destroy(&actions);
    posix_spawnattr_destroy(&attributes);
    tsuya_free(arguments);
    tsuya_free(variables);
    return status;
}

static void end_line(child *c)
{
    c->line[c->used] = '\0';
    if (c->line[strspn(c->line, " \t\r")] != '\0') {
        snprintf(c->last, sizeof c->last, "%.*s", (int)sizeof c->last - 1, c->line);
    }
    if (c->options && c->options->line) {
        c->options->line(c->options->line_user, c->line);
    }
    c->used = 0;
}

static void take_output(child *c, const char *bytes, size_t size)
{
    if (c->log) {
        fwrite(bytes, 1, size, c->log);
        fflush(c->log);
    }
    if (c->captured) {
        size_t room = CAPTURE_LIMIT - c->captured_size, taken = size < room ? size : room;
        memcpy(c->captured + c->captured_size, bytes, taken);
        c->captured_size += taken;
    }
    for (size_t i = 0; i < size; i++) {
        if (bytes[i] == '\n' || bytes[i] == '\r') {
            if (c->used > 0) {
                end_line(c);
            }
        } else if (c->used + 1 < LINE_SIZE) {
            c->line[c->used++] = bytes[i];
        }
    }
}

/* Reads until the child closes its output and has ended. An interruption ends its whole group. */
static int wait_for(child *c, struct rusage *usage, bool *interrupted)
{
    int result = 0;
    double told = 0.0;
    bool open = true, running = true;
    *interrupted = false;
    while (open || running) {
        struct pollfd descriptor = {.fd = open ? c->output : -1, .events = POLLIN};
        poll(&descriptor, 1, POLL_MS);
        if (open && (descriptor.revents & (POLLIN | POLLHUP | POLLERR))) {
            char bytes[1 << 14];
            ssize_t got = read(c->output, bytes, sizeof bytes);
            if (got > 0) {
                take_output(c, bytes, (size_t)got);
            } else if (got == 0 || errno != EINTR) {
                open = false;
            }
        }
        if (running && wait4(c->pid, &result, WNOHANG, usage) == c->pid) {
            running = false;
            if (open) { /* what is in the pipe still counts; grandchildren may hold it open for ever */
                fcntl(c->output, F_SETFL, O_NONBLOCK);
                char bytes[1 << 14];
                for (ssize_t got; (got = read(c->output, bytes, sizeof bytes)) > 0;) {
                    take_output(c, bytes, (size_t)got);
                }
                open = false;
            }
        }
        if (running && tsuya_interrupted()) {
            double now = tsuya_clock_s();
            if (!*interrupted) {
                *interrupted = true;
                told = now;
                kill(-c->pid, SIGTERM);
            } else if (now - told > PATIENCE_S) {
                kill(-c->pid, SIGKILL);
                told = now;
            }
        }
    }
    kill(-c->pid, SIGKILL); /* what the child may have left behind in its group */
    if (c->used > 0) {
        end_line(c);
    }
    return result;
}

/* "colmap mapper" for messages. */
static const char *title_of(const char *const argv[], char *title, size_t size)
{
    const char *slash = strrchr(argv[0], '/'), *program = slash ? slash + 1 : argv[0];
    bool named = argv[1] && argv[1][0] != '-' && argv[1][0] != '/' && strlen(argv[1]) < 40;
    snprintf(title, size, "%s%s%s", program, named ? " " : "", named ? argv[1] : "");
    return title;
}

static tsuya_status explain(const child *c, const char *const argv[], const tsuya_process_info *info, const char *log_path)
{
    char title[128];
    title_of(argv, title, sizeof title);
    const char *before = log_path ? " (log: " : "", *log = log_path ? log_path : "", *after = log_path ? ")" : "";
    if (info->signal_number) {
        return tsuya_fail(TSUYA_ERROR_CHILD, "%s: ended by signal %d (%s%s); its last line: %s%s%s%s", title, info->signal_number,
                          strsignal(info->signal_number), info->signal_number == SIGKILL ? ", out of memory?" : "",
                          c->last[0] ? c->last : "none", before, log, after);
    }
    return tsuya_fail(TSUYA_ERROR_CHILD, "%s: exited with %d; its last line: %s%s%s%s", title, info->exit_code, c->last[0] ? c->last : "none",
                      before, log, after);
}

static void fill_info(tsuya_process_info *info, int result, const struct rusage *usage, double seconds)
{
    info->exit_code = WIFEXITED(result) ? WEXITSTATUS(result) : -1;
    info->signal_number = WIFSIGNALED(result) ? WTERMSIG(result) : 0;
    info->seconds = seconds;
    info->peak_mb = (double)usage->ru_maxrss / 1024.0;
}

tsuya_status tsuya_process_run(tsuya_process_info *info, const char *const argv[], const tsuya_process_options *options)
{
    tsuya_process_info own = {0};
    child c = {.output = -1, .options = options};
    const char *log_path = options ? options->log_path : NULL;
    if (info) {
        *info = own;
    }
    TSUYA_TRY(tsuya_check_interrupt());
    if (!tsuya_process_available(argv[0])) {
        return fail_missing(argv[0]);
    }
    if (log_path && !(c.log = fopen(log_path, "ae"))) {
        return tsuya_fail_errno(log_path, "cannot write");
    }
    if (c.log) {
        for (size_t i = 0; argv[i]; i++) {
            fprintf(c.log, "%s%s", i ? " " : "$ ", argv[i]);
        }
        fputc('\n', c.log);
        fflush(c.log);
    }
    double start = tsuya_clock_s();
    cpu_set_t before;
    bool held = options && options->one_processor && hold_processor(&before);
    tsuya_status status = spawn(&c, argv, options ? options->working_folder : NULL, options ? options->environment : NULL, options && options->one_processor);
    if (held) {
        sched_setaffinity(0, sizeof before, &before);
    }
    if (status == TSUYA_OK) {
        struct rusage usage = {0};
        bool interrupted;
        int result = wait_for(&c, &usage, &interrupted);
        fill_info(&own, result, &usage, tsuya_clock_s() - start);
        status = interrupted                                ? tsuya_fail(TSUYA_ERROR_INTERRUPTED, "interrupted")
               : own.exit_code != 0 || own.signal_number ? explain(&c, argv, &own, log_path)
                                                            : TSUYA_OK;
        close(c.output);
    }
    if (c.log) {
        fclose(c.log);
    }
    if (info) {
        *info = own;
    }
    return status;
}

tsuya_status tsuya_process_capture(char **output, tsuya_process_info *info, const char *const argv[], const char *const *environment)
{
    tsuya_process_info own = {0};
    child c = {.output = -1};
    *output = NULL;
    if (!tsuya_process_available(argv[0])) {
        return fail_missing(argv[0]);
    }
    if (!(c.captured = tsuya_calloc(CAPTURE_LIMIT + 1, 1))) {
        return TSUYA_ERROR_MEMORY;
    }
    double start = tsuya_clock_s();
    tsuya_status status = spawn(&c, argv, NULL, environment, false);
    if (status == TSUYA_OK) {
        struct rusage usage = {0};
        bool interrupted;
        int result = wait_for(&c, &usage, &interrupted);
        fill_info(&own, result, &usage, tsuya_clock_s() - start);
        close(c.output);
        status = interrupted ? tsuya_fail(TSUYA_ERROR_INTERRUPTED, "interrupted") : TSUYA_OK;
    }
    if (info) {
        *info = own;
    }
    if (status == TSUYA_OK) {
        c.captured[c.captured_size] = '\0';
        *output = c.captured;
    } else {
        tsuya_free(c.captured);
    }
    return status;
}
