/* Stage calib: photographs of a board to calib/camera.cameramodel; passed over where the model is given. */
#include "app/calib_run.h"
#include "app/stage.h"

const char *tsuya_stage_camera_model(const tsuya_job *job)
{
    return job->camera.board ? tsuya_job_path(job, "calib/camera.cameramodel") : job->camera.model;
}

tsuya_status tsuya_stage_calib_plan(tsuya_stage_plan *plan, const tsuya_stage_run *run)
{
    const tsuya_job *job = run->job;
    if (!job->camera.board) {
        plan->not_needed = job->camera.model ? "the camera model is given" : "no camera: given, so the job is not calibrated";
        return TSUYA_OK;
    }
    TSUYA_TRY(tsuya_stage_input(plan, "board", job->camera.board));
    TSUYA_TRY(tsuya_stage_input(plan, "photos", job->camera.photos));
    tsuya_calibrate_options options = tsuya_calibrate_options_default();
    tsuya_json_set_number(plan->options, "tolerance_px", options.tolerance_px);
    tsuya_json_set_text(plan->options, "largest", tsuya_lens_name(options.largest));
    tsuya_stage_output(plan, "calib/camera.cameramodel");
    tsuya_stage_output(plan, "calib/calib.json");
    tsuya_stage_output(plan, "calib/corners.vnl");
    tsuya_stage_output(plan, "calib/calib.html");
    return TSUYA_OK;
}

tsuya_status tsuya_stage_calib_run(const tsuya_stage_run *run)
{
    const tsuya_job *job = run->job;
    tsuya_calib_input input = {.board = job->camera.board, .photos = &job->camera.photos, .photo_count = 1,
                               .folder = tsuya_job_path(job, "calib"), .model = tsuya_stage_camera_model(job),
                               .options = tsuya_calibrate_options_default()};
    return input.folder && input.model ? tsuya_calib_run(run->figures, &input, run->context) : TSUYA_ERROR_MEMORY;
}
