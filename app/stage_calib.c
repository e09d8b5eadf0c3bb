/* Stage calib: this version takes a ready camera model or none, so there is nothing to run. */
#include "app/stage.h"


tsuya_status tsuya_stage_calib_plan(tsuya_stage_plan *plan, const tsuya_stage_run *run)
{
    plan->not_needed = run->job->camera.model ? "the camera model is given" : "no camera: given, so the job is not calibrated";
    return TSUYA_OK;
}

tsuya_status tsuya_stage_calib_run(const tsuya_stage_run *run)
{
    (void)run;
    return TSUYA_OK;
}
