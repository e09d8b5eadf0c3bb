#include "app/terminal.h"

#include <pthread.h>
#include <signal.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

static struct {
    pthread_mutex_t mutex;
    bool is_terminal, quiet, bar_open;
    char label[96];
    double label_start_s, drawn_s;
    tsuya_json *warnings;
} terminal = {.mutex = PTHREAD_MUTEX_INITIALIZER};

static void on_signal(int number)
{
    tsuya_interrupt();
    signal(number, SIG_DFL);
}

static void end_line_locked(void)
{
    if (terminal.bar_open) {
        fputc('\n', stderr);
        terminal.bar_open = false;
    }
}

static void on_log(void *user, tsuya_log_level level, const char *line)
{
    (void)user;
    pthread_mutex_lock(&terminal.mutex);
    if (level == TSUYA_LOG_WARNING && terminal.warnings) {
        tsuya_json_add_text(terminal.warnings, line);
    }
    if (level == TSUYA_LOG_WARNING || !terminal.quiet) {
        end_line_locked();
        fprintf(stderr, "%s: %s\n", level == TSUYA_LOG_WARNING ? "warning" : "note", line);
    }
    pthread_mutex_unlock(&terminal.mutex);
}

void tsuya_terminal_open(void)
{
    terminal.is_terminal = isatty(STDERR_FILENO);
    tsuya_log_set_sink(on_log, NULL);
    struct sigaction action = {.sa_handler = on_signal};
    sigemptyset(&action.sa_mask);
    sigaction(SIGINT, &action, NULL);
    sigaction(SIGTERM, &action, NULL);
    signal(SIGPIPE, SIG_IGN);
}

void tsuya_terminal_set_quiet(bool quiet) { terminal.quiet = quiet; }

void tsuya_terminal_end_line(void)
{
    pthread_mutex_lock(&terminal.mutex);
    end_line_locked();
    terminal.label[0] = '\0';
    pthread_mutex_unlock(&terminal.mutex);
}

const char *tsuya_format_duration(char text[TSUYA_DURATION_SIZE], double seconds)
{
    long s = seconds > 0.0 && seconds < 1e9 ? (long)(seconds + 0.5) : 0;
    if (s < 60) {
        snprintf(text, TSUYA_DURATION_SIZE, seconds < 9.95 ? "%.1f s" : "%.0f s", seconds > 0.0 ? seconds : 0.0);
    } else if (s < 3600) {
        snprintf(text, TSUYA_DURATION_SIZE, "%ld min %02ld s", s / 60, s % 60);
    } else {
        snprintf(text, TSUYA_DURATION_SIZE, "%ld h %02ld min", s / 3600, s % 3600 / 60);
    }
    return text;
}

/* ETA by the mean pace so far; no guess in the first second or the first percent. */
static void draw_bar(double now_s, double fraction, const char *detail)
{
    enum { CELLS = 24 };
    int filled = (int)(fraction * CELLS + 0.5);
    char bar[CELLS + 1], eta[TSUYA_DURATION_SIZE + 8] = "", duration[TSUYA_DURATION_SIZE];
    for (int i = 0; i < CELLS; i++) {
        bar[i] = i < filled ? '#' : '.';
    }
    bar[CELLS] = '\0';
    double elapsed_s = now_s - terminal.label_start_s;
    if (elapsed_s > 1.0 && fraction > 0.01 && fraction < 1.0) {
        snprintf(eta, sizeof eta, " left %s", tsuya_format_duration(duration, elapsed_s * (1.0 - fraction) / fraction));
    }
    fprintf(stderr, "\r\033[K%-28.28s [%s] %3d%%%s %.40s", terminal.label, bar, (int)(100.0 * fraction), eta, detail);
    fflush(stderr);
    terminal.bar_open = true;
    terminal.drawn_s = now_s;
}

void tsuya_terminal_progress(void *user, const char *label, double done, double total, const char *detail)
{
    (void)user;
    pthread_mutex_lock(&terminal.mutex);
    if (!terminal.quiet) {
        double now_s = tsuya_clock_s();
        double fraction = total > 0.0 ? done / total : 0.0;
        fraction = fraction > 0.0 ? (fraction < 1.0 ? fraction : 1.0) : 0.0;
        bool fresh = strncmp(terminal.label, label, sizeof terminal.label - 1) != 0;
        if (fresh) {
            end_line_locked();
            snprintf(terminal.label, sizeof terminal.label, "%s", label);
            terminal.label_start_s = now_s;
        }
        if (!terminal.is_terminal) {
            if (fresh) {
                fprintf(stderr, "  %s\n", label);
            }
        } else if (fresh || fraction >= 1.0 || now_s - terminal.drawn_s > 0.1) {
            draw_bar(now_s, fraction, detail ? detail : "");
        }
    }
    pthread_mutex_unlock(&terminal.mutex);
}

static void say(const char *prefix, const char *format, va_list arguments)
{
    pthread_mutex_lock(&terminal.mutex);
    end_line_locked();
    fputs(prefix, stderr);
    vfprintf(stderr, format, arguments);
    fputc('\n', stderr);
    pthread_mutex_unlock(&terminal.mutex);
}

void tsuya_terminal_say(const char *format, ...)
{
    va_list arguments;
    va_start(arguments, format);
    say("tsuya: ", format, arguments);
    va_end(arguments);
}

void tsuya_terminal_log(const char *format, ...)
{
    if (terminal.quiet) {
        return;
    }
    va_list arguments;
    va_start(arguments, format);
    say("", format, arguments);
    va_end(arguments);
}

void tsuya_terminal_collect_warnings(tsuya_json *array)
{
    pthread_mutex_lock(&terminal.mutex);
    terminal.warnings = array;
    pthread_mutex_unlock(&terminal.mutex);
}
