/* Stage weave: reconstruct/mesh.ply and the photographs of reconstruct/dense to weave/weave.ply. */
#include "app/stage.h"

#include "core/camera.h"
#include "core/file.h"
#include "weave_detect/mesh_field.h"
#include "weave_detect/patches.h"

#include <string.h>

enum { OVERLAYS = 4 };

static tsuya_weave_mesh_options options_of(const tsuya_job *job)
{
    tsuya_weave_mesh_options options = tsuya_weave_mesh_options_default();
    options.workspace = tsuya_job_path(job, "reconstruct/dense");
    options.hold_out = job->hold_out.item;
    options.hold_out_count = job->hold_out.count;
    return options;
}

tsuya_status tsuya_stage_weave_plan(tsuya_stage_plan *plan, const tsuya_stage_run *run)
{
    tsuya_weave_mesh_options options = options_of(run->job);
    const char *mesh = tsuya_job_path(run->job, "reconstruct/mesh.ply"), *images = tsuya_job_path(run->job, "reconstruct/dense/images");
    const char *cameras = tsuya_job_path(run->job, "reconstruct/dense/sparse");
    if (!options.workspace || !mesh || !images || !cameras) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_TRY(tsuya_stage_input(plan, "mesh", mesh));
    TSUYA_TRY(tsuya_stage_input(plan, "photographs", images));
    TSUYA_TRY(tsuya_stage_input(plan, "cameras", cameras));
    tsuya_json_set_number(plan->options, "patch_px", options.patch_px);
    tsuya_json_set_number(plan->options, "step_px", options.step_px);
    tsuya_json *hold_out = tsuya_json_set_array(plan->options, "hold_out");
    for (int i = 0; i < options.hold_out_count; i++) {
        tsuya_json_add_text(hold_out, options.hold_out[i]);
    }
    tsuya_stage_output(plan, "weave/weave.ply");
    tsuya_stage_output(plan, "weave/weave.json");
    tsuya_stage_output(plan, "weave/overlay");
    return TSUYA_OK;
}

/* Threads drawn on a photograph, for the report. */
static tsuya_status draw_overlay(const tsuya_stage_run *run, const char *name)
{
    tsuya_image photo = {0}, picture = {0};
    tsuya_patch_grid grid = {0};
    tsuya_patch_options options = tsuya_patch_options_default();
    const char *in = tsuya_job_path(run->job, "reconstruct/dense/images/%s", name);
    const char *out = tsuya_job_path(run->job, "weave/overlay/%s.jpg", name);
    tsuya_status status = in && out ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    TSUYA_GOTO_DONE(status, status);
    TSUYA_GOTO_DONE(status, tsuya_image_load(&photo, in));
    if (photo.width_px >= options.patch_px && photo.height_px >= options.patch_px) {
        TSUYA_GOTO_DONE(status, tsuya_patches_detect(&grid, &photo, NULL, &options, run->context));
        TSUYA_GOTO_DONE(status, tsuya_patches_overlay(&picture, &photo, &grid));
        TSUYA_GOTO_DONE(status, tsuya_image_save(&picture, out, NULL));
    }
done:
    tsuya_image_free(&photo);
    tsuya_image_free(&picture);
    tsuya_patches_free(&grid);
    return status;
}

static tsuya_status draw_overlays(const tsuya_stage_run *run)
{
    tsuya_sparse_model model = {0};
    const char *sparse = tsuya_job_path(run->job, "reconstruct/dense/sparse"), *folder = tsuya_job_path(run->job, "weave/overlay");
    if (!sparse || !folder) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_TRY(tsuya_folder_remove(folder));
    TSUYA_TRY(tsuya_folder_make(folder));
    TSUYA_TRY(tsuya_sparse_model_load(&model, sparse));
    tsuya_status status = TSUYA_OK;
    int count = model.view_count < OVERLAYS ? model.view_count : OVERLAYS;
    for (int i = 0; status == TSUYA_OK && i < count; i++) {
        status = draw_overlay(run, model.view[(long long)i * model.view_count / count].name);
    }
    tsuya_sparse_model_free(&model);
    return status;
}

tsuya_status tsuya_stage_weave_run(const tsuya_stage_run *run)
{
    tsuya_mesh mesh = {0};
    tsuya_weave_mesh_info info = {0};
    tsuya_weave_mesh_options options = options_of(run->job);
    const char *folder = tsuya_job_path(run->job, "weave"), *in = tsuya_job_path(run->job, "reconstruct/mesh.ply");
    const char *out = tsuya_job_path(run->job, "weave/weave.ply"), *json = tsuya_job_path(run->job, "weave/weave.json");
    if (!options.workspace || !folder || !in || !out || !json) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_TRY(tsuya_folder_make(folder));
    TSUYA_TRY(tsuya_ply_load(&mesh, in));
    tsuya_status status;
    TSUYA_GOTO_DONE(status, tsuya_weave_mesh(&mesh, &info, &options, run->context));
    if (!info.threads_seen) {
        tsuya_warn("weave: no threads to be seen in the photographs; the weft field follows texture and folds, its confidence is low");
    }
    tsuya_weave_mesh_info_to_json(run->figures, &info);
    TSUYA_GOTO_DONE(status, tsuya_ply_save(&mesh, out, NULL));
    TSUYA_GOTO_DONE(status, draw_overlays(run));
    TSUYA_GOTO_DONE(status, tsuya_json_save(run->figures, json));
done:
    tsuya_mesh_free(&mesh);
    return status;
}
