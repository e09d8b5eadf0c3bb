/* Stage capture: the check of the photographs into JOB/capture/capture.json.  It advises; it stops no job. */
#include "app/stage.h"

#include "capture/check.h"

tsuya_status tsuya_stage_capture_plan(tsuya_stage_plan *plan, const tsuya_stage_run *run)
{
    tsuya_check_options o = tsuya_check_options_default();
    TSUYA_TRY(tsuya_stage_input(plan, "photos", run->job->photos));
    TSUYA_TRY(tsuya_stage_input(plan, "masks", run->job->masks));
    TSUYA_TRY(tsuya_stage_input(plan, "scale: board", run->job->scale.board));
    tsuya_json_set_number(plan->options, "features", o.features);
    tsuya_json_set_number(plan->options, "blur_ratio", o.blur_ratio);
    tsuya_json_set_number(plan->options, "blur_excess_px", o.blur_excess_px);
    tsuya_json_set_number(plan->options, "clipped_share", o.clipped_share);
    tsuya_json_set_number(plan->options, "exposure_ev", o.exposure_ev);
    tsuya_json_set_number(plan->options, "white_balance_ev", o.white_balance_ev);
    tsuya_json_set_number(plan->options, "shared_features", o.shared_features);
    tsuya_stage_output(plan, "capture/capture.json");
    return TSUYA_OK;
}

tsuya_status tsuya_stage_capture_run(const tsuya_stage_run *run)
{
    tsuya_check_options options = tsuya_check_options_default();
    tsuya_check check;
    const char *path = tsuya_job_path(run->job, "capture/capture.json");
    if (!path) {
        return TSUYA_ERROR_MEMORY;
    }
    options.target = run->job->scale.board;
    TSUYA_TRY(tsuya_check_session(&check, run->job->photos, run->job->masks, &options, run->context));
    tsuya_check_to_json(run->figures, &check);
    for (int i = 0; i < check.count; i++) {
        for (int k = 0; k < check.photo[i].fault_count; k++) {
            tsuya_warn("%s: %s", check.photo[i].photo.name, check.photo[i].fault[k]);
        }
    }
    if (tsuya_check_blindness(&check)) {
        tsuya_warn("%s", tsuya_check_blindness(&check));
    }
    tsuya_check_free(&check);
    return tsuya_json_save(run->figures, path);
}
