/* state.json of a job folder: one record a finished stage. */
#ifndef TSUYA_APP_STATE_H
#define TSUYA_APP_STATE_H

#include "core/json.h"

/* {"format": 1, "program": "0.1.0", "job": NAME, "stages": {NAME: RECORD}} with
 * RECORD {"inputs": {label: hash}, "options": {…}, "version": n, "program", "key", "outputs": {path: hash or "folder"},
 *         "seconds", "peak_mb", "finished": "2026-01-31T12:00:00Z", "figures": {…}, "warnings": […]}. */
typedef struct tsuya_state {
    tsuya_json *root;
    tsuya_json *stages; /* borrowed from root */
    char *path;
} tsuya_state;

/* FOLDER/state.json, or an empty state where there is none.  A newer format is refused. */
TSUYA_MUST_CHECK tsuya_status tsuya_state_load(tsuya_state *state, const char *folder, const char *job_name);
TSUYA_MUST_CHECK tsuya_status tsuya_state_save(const tsuya_state *state);
void tsuya_state_free(tsuya_state *state);
/* The record of a stage, NULL where it has not been finished. */
const tsuya_json *tsuya_state_record(const tsuya_state *state, const char *stage);

#endif
