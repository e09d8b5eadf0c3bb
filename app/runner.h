/* Runs the stages of a job in order, each only when its inputs' hashes, its options or its version changed.
 *
 * state.json is written, atomically, after every stage; a stage's record is taken out before the stage starts, so that a
 * program killed at any moment leaves records of finished stages only. */
#ifndef TSUYA_APP_RUNNER_H
#define TSUYA_APP_RUNNER_H

#include "app/stage.h"

typedef struct tsuya_runner_options {
    int from, to; /* indices into tsuya_stages, both included */
    bool dry_run; /* says what would run, writes nothing */
    bool force;   /* runs the stages of the range even where nothing changed */
} tsuya_runner_options;
tsuya_runner_options tsuya_runner_options_default(void);

/* `result` gets INTERFACE's figures of `run`: stages{name: {seconds, peak_mb, skipped}}, seconds, and every stage's own
 * figures under its name.  Fails where another process holds the job folder, where stages before `from` are not finished,
 * and with the first stage that fails. */
TSUYA_MUST_CHECK tsuya_status tsuya_runner_run(tsuya_json *result, const tsuya_job *job, const tsuya_runner_options *options,
                                               const tsuya_context *context);

#endif
