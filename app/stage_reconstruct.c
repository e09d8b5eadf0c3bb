/* Stage reconstruct. */
#include "app/stage.h"

#include "app/calib_scale.h"
#include "core/process.h"
#include "reconstruct/reconstruct.h"

static tsuya_reconstruct_options options_of(const tsuya_job *job)
{
    tsuya_reconstruct_options options = tsuya_reconstruct_options_default();
    options.photos = job->photos;
    options.masks = job->masks;
    options.output = tsuya_job_path(job, "reconstruct");
    options.poses = job->poses;
    options.camera_model = tsuya_stage_camera_model(job);
    options.hold_out = job->hold_out.item;
    options.hold_out_count = job->hold_out.count;
    options.tolerance = job->tolerance_units;
    options.tolerance_in_metres = job->tolerance_in_metres;
    return options;
}

static void set_distances(tsuya_json *array, const tsuya_yaml_list *distances)
{
    const tsuya_yaml_list *list = distances->item;
    for (int i = 0; i < distances->count; i++) {
        tsuya_json *one = tsuya_json_add_array(array);
        for (int k = 0; k < list[i].count; k++) {
            tsuya_json_add_text(one, ((const char *const *)list[i].item)[k]);
        }
    }
}

static tsuya_status find_scale(tsuya_calib_scale *scale, const tsuya_stage_run *run)
{
    const tsuya_job *job = run->job;
    const char *where = tsuya_arena_printf(job->arena, "%s: scale: distances", job->path);
    if (job->scale.board) {
        return tsuya_calib_scale_from_board(scale, job->scale.board, &job->photo, run->context);
    }
    return where ? tsuya_calib_scale_from_distances(scale, &job->scale.distances, where, &job->photo) : TSUYA_ERROR_MEMORY;
}

tsuya_status tsuya_stage_reconstruct_plan(tsuya_stage_plan *plan, const tsuya_stage_run *run)
{
    tsuya_reconstruct_options options = options_of(run->job);
    TSUYA_TRY(tsuya_stage_input(plan, "photos", options.photos));
    TSUYA_TRY(tsuya_stage_input(plan, "masks", options.masks));
    TSUYA_TRY(tsuya_stage_input(plan, "poses", options.poses));
    TSUYA_TRY(tsuya_stage_input(plan, "camera", options.camera_model));
    TSUYA_TRY(tsuya_stage_input(plan, "scale", run->job->scale.board));
    if (run->job->scale.distances.count) {
        set_distances(tsuya_json_set_array(plan->options, "distances"), &run->job->scale.distances);
    }
    tsuya_json_set_number(plan->options, "seed", (double)run->context->seed);
    tsuya_json_set_number(plan->options, "dense_long_side_px", options.dense_long_side_px);
    tsuya_json_set_number(plan->options, "source_views", options.source_views);
    tsuya_json_set_number(plan->options, "tolerance", options.tolerance);
    tsuya_json *hold_out = tsuya_json_set_array(plan->options, "hold_out");
    for (int i = 0; i < options.hold_out_count; i++) {
        tsuya_json_add_text(hold_out, options.hold_out[i]);
    }
    tsuya_stage_output(plan, "reconstruct/mesh.ply");
    tsuya_stage_output(plan, "reconstruct/cloud.ply");
    tsuya_stage_output(plan, "reconstruct/sparse/0/images.bin");
    tsuya_stage_output(plan, "reconstruct/dense/sparse");
    tsuya_stage_output(plan, "reconstruct/dense/images");
    tsuya_stage_output(plan, "reconstruct/dense/stereo/depth_maps");
    return TSUYA_OK;
}

tsuya_status tsuya_stage_reconstruct_run(const tsuya_stage_run *run)
{
    if (!tsuya_process_available("colmap")) {
        return tsuya_fail(TSUYA_ERROR_UNAVAILABLE, "colmap: not found in PATH; on Debian: apt-get install colmap");
    }
    if (!run->job->has_camera && !run->job->poses) {
        tsuya_warn("not calibrated: no camera: given, so the focal length comes from EXIF and is refined");
    }
    tsuya_reconstruct_options options = options_of(run->job);
    tsuya_reconstruct_info info = {0};
    tsuya_calib_scale scale = {0};
    if (run->job->has_scale) {
        TSUYA_TRY(find_scale(&scale, run));
        options.scale = &scale.input;
    }
    tsuya_status status = tsuya_reconstruct(&info, &options, run->context);
    tsuya_calib_scale_free(&scale);
    TSUYA_TRY(status);
    tsuya_reconstruct_info_to_json(run->figures, &info);
    tsuya_reconstruct_info_free(&info);
    return TSUYA_OK;
}
