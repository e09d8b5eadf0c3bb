/* Stage brdf: the job's materials into JOB/brdf/NAME.json. */
#include "app/brdf_figures.h"
#include "app/stage.h"

#include <math.h>

static const char default_name[] = "default-silk";

tsuya_status tsuya_stage_brdf_plan(tsuya_stage_plan *plan, const tsuya_stage_run *run)
{
    const tsuya_job *job = run->job;
    for (int i = 0; i < job->materials.count; i++) {
        const tsuya_job_material *m = tsuya_job_material_at(job, i);
        TSUYA_TRY(tsuya_stage_input(plan, m->name, m->samples ? m->samples : m->model));
    }
    tsuya_json_set_bool(plan->options, "default", job->materials.count == 0);
    for (int i = 0; i < tsuya_stage_material_count(job) && plan->output_count < TSUYA_STAGE_OUTPUTS; i++) {
        const char *output = tsuya_stage_material_path(job, i, false);
        if (!output) {
            return TSUYA_ERROR_MEMORY;
        }
        tsuya_stage_output(plan, output);
    }
    return TSUYA_OK;
}

int tsuya_stage_material_count(const tsuya_job *job)
{
    return job->materials.count > 0 ? job->materials.count : 1;
}

const char *tsuya_stage_material_path(const tsuya_job *job, int index, bool with_folder)
{
    const char *name = job->materials.count > 0 ? tsuya_job_material_at(job, index)->name : default_name;
    return with_folder ? tsuya_job_path(job, "brdf/%s.json", name) : tsuya_arena_printf(job->arena, "brdf/%s.json", name);
}

/* Measured samples: the model with the lowest held-out error. */
static tsuya_status fit_samples(tsuya_material **material, const tsuya_job_material *m, tsuya_json *figures, const tsuya_stage_run *run)
{
    tsuya_samples samples;
    tsuya_fit_info info, candidates[TSUYA_FIT_MODELS];
    int count = 0;
    const tsuya_fit_options options = {.name = m->name, .model = "auto", .tolerance = NAN};
    TSUYA_TRY(tsuya_samples_load(&samples, m->samples));
    tsuya_status status = tsuya_brdf_fit(material, &info, candidates, &count, &samples, &options, run->context);
    tsuya_samples_free(&samples);
    TSUYA_TRY(status);
    tsuya_brdf_figures(figures, &info);
    tsuya_brdf_candidates(figures, candidates, count);
    return TSUYA_OK;
}

static void copy_figures(const tsuya_material *material, tsuya_json *figures)
{
    tsuya_material_info info = tsuya_material_get_info(material);
    tsuya_json_set_text(figures, "model", info.model);
    tsuya_json_set_null(figures, "samples");
    tsuya_json_set_number(figures, "bytes", (double)info.bytes);
    tsuya_json *error = tsuya_json_set_object(figures, "error_heldout");
    tsuya_json_set_number(error, "cbrt", info.heldout_cbrt);
    tsuya_json_set_number(error, "log", info.heldout_log);
}

static tsuya_status make_material(tsuya_json *figures, int index, const tsuya_stage_run *run)
{
    const tsuya_job *job = run->job;
    tsuya_material *material = NULL;
    const char *path = tsuya_stage_material_path(job, index, true);
    if (!path) {
        return TSUYA_ERROR_MEMORY;
    }
    const tsuya_job_material *m = job->materials.count > 0 ? tsuya_job_material_at(job, index) : NULL;
    if (m && m->samples) {
        TSUYA_TRY(fit_samples(&material, m, figures, run));
    } else if (m) {
        TSUYA_TRY(tsuya_material_load(&material, m->model));
    } else {
        tsuya_warn("no materials: given; the cloth gets a built-in, silk-like default that was measured on nothing");
        TSUYA_TRY(tsuya_material_default_silk(&material));
    }
    if (!m || !m->samples) {
        copy_figures(material, figures);
    }
    tsuya_material_info info = tsuya_material_get_info(material);
    tsuya_json_set_text(figures, "material", info.name);
    tsuya_json_set_bool(figures, "default", info.is_default);
    tsuya_status status = tsuya_material_save(material, path);
    tsuya_material_free(material);
    return status;
}

/* Figures of the first material; those of the others under "others", by name. */
tsuya_status tsuya_stage_brdf_run(const tsuya_stage_run *run)
{
    const tsuya_job *job = run->job;
    TSUYA_TRY(make_material(run->figures, 0, run));
    tsuya_json *others = job->materials.count > 1 ? tsuya_json_set_object(run->figures, "others") : NULL;
    for (int i = 1; i < job->materials.count; i++) {
        TSUYA_TRY(make_material(tsuya_json_set_object(others, tsuya_job_material_at(job, i)->name), i, run));
    }
    return TSUYA_OK;
}
