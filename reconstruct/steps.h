/* The steps of a reconstruction, so that a run that was ended goes on where it was: FOLDER/steps.json holds for each step
 * the hash of everything that it depends on, and what it cost. */
#ifndef TSUYA_RECONSTRUCT_STEPS_H
#define TSUYA_RECONSTRUCT_STEPS_H

#include "core/context.h"
#include "core/file.h"
#include "core/json.h"

enum { TSUYA_STEP_NAME = 24, TSUYA_STEPS_MOST = 16 };

typedef struct tsuya_step {
    char name[TSUYA_STEP_NAME];
    double seconds, peak_mb;
    bool skipped; /* finished by an earlier run */
} tsuya_step;

typedef struct tsuya_steps {
    char *path;
    tsuya_json *record;
    tsuya_hash key;   /* of the step at work: its own options and all that came before */
    double start_s;
    double child_mb;  /* highest memory of the step's child processes, set by who runs them */
    tsuya_step step[TSUYA_STEPS_MOST];
    int count;
} tsuya_steps;

/* `inputs`: hash of all that the first step depends on.  A damaged steps.json counts as none. */
TSUYA_MUST_CHECK tsuya_status tsuya_steps_load(tsuya_steps *steps, const char *folder, tsuya_hash inputs);
void tsuya_steps_free(tsuya_steps *steps);

/* Opens the next step; true when it is finished with the same key and `output` (NULL: nothing to look for) exists. */
bool tsuya_step_begin(tsuya_steps *steps, const char *name, const char *options, const char *output);
/* Closes it and saves the record.  `figures` may be NULL; copied. */
TSUYA_MUST_CHECK tsuya_status tsuya_step_end(tsuya_steps *steps, const tsuya_json *figures);
/* What a finished step noted, NULL for nothing. */
const tsuya_json *tsuya_step_figures(const tsuya_steps *steps, const char *name);

#endif
