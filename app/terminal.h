/* What goes to stderr: a progress bar on a terminal, one line a step otherwise, warnings and notes.
 *
 * One per process, because tsuya_log_set_sink is. */
#ifndef TSUYA_APP_TERMINAL_H
#define TSUYA_APP_TERMINAL_H

#include "core/context.h"
#include "core/json.h"

/* Takes the log sink, and SIGINT and SIGTERM as the wish to stop (a second one ends the program at once). */
void tsuya_terminal_open(void);
/* Progress and notes off, warnings stay. */
void tsuya_terminal_set_quiet(bool quiet);
/* Ends a bar that is being drawn, so that other text starts on a line of its own. */
void tsuya_terminal_end_line(void);
/* A tsuya_progress_sink. */
void tsuya_terminal_progress(void *user, const char *label, double done, double total, const char *detail);
/* "tsuya: …" on stderr, also when quiet. */
void tsuya_terminal_say(const char *format, ...) TSUYA_PRINTF(1, 2);
/* A plain line on stderr, silent when quiet. */
void tsuya_terminal_log(const char *format, ...) TSUYA_PRINTF(1, 2);
/* While set, warnings are also appended to this JSON array; NULL ends it. */
void tsuya_terminal_collect_warnings(tsuya_json *array);

/* "12 s", "3 min 05 s", "1 h 02 min" */
enum { TSUYA_DURATION_SIZE = 32 };
const char *tsuya_format_duration(char text[TSUYA_DURATION_SIZE], double seconds);

#endif
