/* Stage brdf: the job's materials into JOB/brdf/NAME.json. */
#include "app/stage.h"

#include "brdf/material.h"

static const char default_name[] = "default-silk";

tsuya_status tsuya_stage_brdf_plan(tsuya_stage_plan *plan, const tsuya_stage_run *run)
{
    const tsuya_job *job = run->job;
    for (int i = 0; i < job->materials.count; i++) {
        const tsuya_job_material *m = tsuya_job_material_at(job, i);
        TSUYA_TRY(tsuya_stage_input(plan, m->name, m->model));
    }
    tsuya_json_set_bool(plan->options, "default", job->materials.count == 0);
    const char *output = tsuya_stage_material_path(job, false);
    if (!output) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_stage_output(plan, output);
    return TSUYA_OK;
}

const char *tsuya_stage_material_path(const tsuya_job *job, bool with_folder)
{
    const char *name = job->materials.count > 0 ? tsuya_job_material_at(job, 0)->name : default_name;
    return with_folder ? tsuya_job_path(job, "brdf/%s.json", name) : tsuya_arena_printf(job->arena, "brdf/%s.json", name);
}

tsuya_status tsuya_stage_brdf_run(const tsuya_stage_run *run)
{
    const tsuya_job *job = run->job;
    tsuya_material *material = NULL;
    const char *path = tsuya_stage_material_path(job, true);
    if (!path) {
        return TSUYA_ERROR_MEMORY;
    }
    if (job->materials.count > 0) {
        TSUYA_TRY(tsuya_material_load(&material, tsuya_job_material_at(job, 0)->model));
    } else {
        tsuya_warn("no materials: given; the cloth gets a built-in, silk-like default that was measured on nothing");
        TSUYA_TRY(tsuya_material_default_silk(&material));
    }
    tsuya_material_info info = tsuya_material_get_info(material);
    tsuya_json_set_text(run->figures, "model", info.model);
    tsuya_json_set_text(run->figures, "material", info.name);
    tsuya_json_set_bool(run->figures, "default", info.is_default);
    tsuya_json_set_null(run->figures, "samples");
    tsuya_json_set_number(run->figures, "bytes", (double)info.bytes);
    tsuya_json *error = tsuya_json_set_object(run->figures, "error_heldout");
    tsuya_json_set_number(error, "cbrt", info.heldout_cbrt);
    tsuya_json_set_number(error, "log", info.heldout_log);
    tsuya_status status = tsuya_material_save(material, path);
    tsuya_material_free(material);
    return status;
}
