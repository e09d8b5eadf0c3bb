/* The stages of a job, each: what it depends on, what it leaves behind, how it runs. */
#ifndef TSUYA_APP_STAGE_H
#define TSUYA_APP_STAGE_H

#include "app/job.h"
#include "app/state.h"
#include "core/context.h"

enum { TSUYA_STAGE_OUTPUTS = 8 };

/* What decides whether a stage has to run. */
typedef struct tsuya_stage_plan {
    tsuya_json *inputs;        /* label: content hash; null where an earlier stage has yet to make it */
    tsuya_json *options;       /* every value that the result depends on */
    const char *output[TSUYA_STAGE_OUTPUTS]; /* relative to the job folder; files are hashed, folders must exist */
    int output_count;
    const char *not_needed;    /* why this job has no such stage; NULL: it has */
} tsuya_stage_plan;

typedef struct tsuya_stage_run {
    const tsuya_job *job;
    const tsuya_context *context;
    const tsuya_state *state; /* of the stages before */
    tsuya_json *figures;      /* to fill */
} tsuya_stage_run;

typedef struct tsuya_stage {
    const char *name; /* of the stage, and of its folder */
    int version;      /* raised when the same inputs and options give another result */
    tsuya_status (*plan)(tsuya_stage_plan *plan, const tsuya_stage_run *run);
    tsuya_status (*run)(const tsuya_stage_run *run);
} tsuya_stage;

enum { TSUYA_STAGE_COUNT = 7 };
extern const tsuya_stage tsuya_stages[TSUYA_STAGE_COUNT]; /* capture calib reconstruct weave brdf render report */

/* Index of a stage's name; −1 for none. */
int tsuya_stage_find(const char *name);

/* A file or folder; NULL adds nothing. */
TSUYA_MUST_CHECK tsuya_status tsuya_stage_input(tsuya_stage_plan *plan, const char *label, const char *path);
void tsuya_stage_output(tsuya_stage_plan *plan, const char *relative_path);

/* Materials of the surface, at least one (a default), and where each is written (arena): in the job folder, or relative to it. */
int tsuya_stage_material_count(const tsuya_job *job);
const char *tsuya_stage_material_path(const tsuya_job *job, int index, bool with_folder);

/* The calibrated camera: given, or stage calib's; NULL where the job has none. */
const char *tsuya_stage_camera_model(const tsuya_job *job);

/* The stage functions, one file each. */
tsuya_status tsuya_stage_capture_plan(tsuya_stage_plan *plan, const tsuya_stage_run *run);
tsuya_status tsuya_stage_capture_run(const tsuya_stage_run *run);
tsuya_status tsuya_stage_calib_plan(tsuya_stage_plan *plan, const tsuya_stage_run *run);
tsuya_status tsuya_stage_calib_run(const tsuya_stage_run *run);
tsuya_status tsuya_stage_reconstruct_plan(tsuya_stage_plan *plan, const tsuya_stage_run *run);
tsuya_status tsuya_stage_reconstruct_run(const tsuya_stage_run *run);
tsuya_status tsuya_stage_weave_plan(tsuya_stage_plan *plan, const tsuya_stage_run *run);
tsuya_status tsuya_stage_weave_run(const tsuya_stage_run *run);
tsuya_status tsuya_stage_brdf_plan(tsuya_stage_plan *plan, const tsuya_stage_run *run);
tsuya_status tsuya_stage_brdf_run(const tsuya_stage_run *run);
tsuya_status tsuya_stage_render_plan(tsuya_stage_plan *plan, const tsuya_stage_run *run);
tsuya_status tsuya_stage_render_run(const tsuya_stage_run *run);
tsuya_status tsuya_stage_report_plan(tsuya_stage_plan *plan, const tsuya_stage_run *run);
tsuya_status tsuya_stage_report_run(const tsuya_stage_run *run);

#endif
