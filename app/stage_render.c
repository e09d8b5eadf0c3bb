/* Stage render: every entry of the job's render list into JOB/render/NAME/. */
#include "app/stage.h"

#include "core/camera.h"
#include "core/file.h"
#include "render/render.h"
#include "render/views.h"

#include <string.h>

enum { SAMPLES_PER_PIXEL = 64, BOUNCES = 3 };

static const char *const mesh_relative = "weave/weave.ply";

tsuya_status tsuya_stage_render_plan(tsuya_stage_plan *plan, const tsuya_stage_run *run)
{
    const tsuya_job *job = run->job;
    const char *mesh = tsuya_job_path(job, "%s", mesh_relative), *model = tsuya_job_path(job, "reconstruct/sparse/0/images.bin");
    const char *material = tsuya_stage_material_path(job, true);
    if (!mesh || !model || !material) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_TRY(tsuya_stage_input(plan, "mesh", mesh));
    TSUYA_TRY(tsuya_stage_input(plan, "cameras", model));
    TSUYA_TRY(tsuya_stage_input(plan, "material", material));
    TSUYA_TRY(tsuya_stage_input(plan, "lights", job->lights));
    tsuya_json_set_number(plan->options, "seed", (double)run->context->seed);
    tsuya_json_set_number(plan->options, "spp", SAMPLES_PER_PIXEL);
    tsuya_json_set_number(plan->options, "bounces", BOUNCES);
    tsuya_json *list = tsuya_json_set_array(plan->options, "render");
    for (int i = 0; i < job->render.count; i++) {
        const tsuya_job_render *r = tsuya_job_render_at(job, i);
        tsuya_json *entry = tsuya_json_add_object(list);
        tsuya_json_set_text(entry, "name", r->name);
        tsuya_json_set_number(entry, "views", r->views);
        tsuya_json_set_numbers(entry, "size", (double[]){r->width_px, r->height_px}, 2);
        tsuya_json_set_text(entry, "color", r->color);
        for (int h = 0; r->like && h < job->hold_out.count; h++) {
            tsuya_json_set_text(entry, tsuya_job_hold_out_at(job, h), "held out");
        }
        const char *output = tsuya_arena_printf(job->arena, "render/%s/render.json", r->name);
        if (!output) {
            return TSUYA_ERROR_MEMORY;
        }
        if (plan->output_count < TSUYA_STAGE_OUTPUTS) {
            tsuya_stage_output(plan, output);
        }
    }
    return TSUYA_OK;
}

/* Sums over the list; the rest is of the last entry. */
static void add_info(tsuya_render_info *total, const tsuya_render_info *info)
{
    uint64_t rays = total->rays + info->rays;
    double seconds = total->seconds + info->seconds, trace_seconds = total->trace_seconds + info->trace_seconds;
    double peak_mb = total->peak_mb > info->peak_mb ? total->peak_mb : info->peak_mb;
    int frames = total->frames + info->frames, reused = total->frames_reused + info->frames_reused;
    *total = *info;
    total->rays = rays;
    total->seconds = seconds;
    total->trace_seconds = trace_seconds;
    total->mrays_per_s = trace_seconds > 0.0 ? 1e-6 * (double)rays / trace_seconds : 0.0;
    total->peak_mb = peak_mb;
    total->frames = frames;
    total->frames_reused = reused;
}

static tsuya_status held_out_views(int *index, int *count, const tsuya_job *job, const tsuya_sparse_model *model)
{
    *count = 0;
    for (int h = 0; h < job->hold_out.count; h++) {
        const char *name = tsuya_job_hold_out_at(job, h);
        int view = tsuya_sparse_model_find(model, name);
        if (view >= 0) {
            index[(*count)++] = view;
        } else {
            tsuya_warn("%s: held out, but not placed by the reconstruction; it is not rendered", name);
        }
    }
    return *count > 0 ? TSUYA_OK : tsuya_fail(TSUYA_ERROR_INPUT, "%s: render: none of the photographs of hold_out: was placed", job->path);
}

static tsuya_status render_entry(tsuya_render_info *info, const tsuya_stage_run *run, const tsuya_job_render *entry,
                                 const tsuya_sparse_model *model, tsuya_vec3 up)
{
    const tsuya_job *job = run->job;
    tsuya_render_options options = tsuya_render_options_default();
    const char *material = tsuya_stage_material_path(job, true);
    int *views = tsuya_arena_alloc(job->arena, (size_t)job->hold_out.count + 1, sizeof *views);
    options.mesh_path = tsuya_job_path(job, "%s", mesh_relative);
    options.output_folder = tsuya_job_path(job, "render");
    if (!material || !views || !options.mesh_path || !options.output_folder) {
        return TSUYA_ERROR_MEMORY;
    }
    options.material_path = &material;
    options.material_count = 1;
    options.lights_path = job->lights;
    options.name = entry->name;
    options.color = entry->color;
    options.spp = SAMPLES_PER_PIXEL;
    options.bounces = BOUNCES;
    options.up = up;
    if (entry->like) {
        options.model = model;
        options.model_view = views;
        TSUYA_TRY(held_out_views(views, &options.model_view_count, job, model));
    } else {
        options.views = entry->views;
        options.width_px = entry->width_px;
        options.height_px = entry->height_px;
    }
    return tsuya_render(info, &options, run->context);
}

static tsuya_status upright(tsuya_vec3 *up, const tsuya_job *job, const tsuya_sparse_model *model)
{
    tsuya_pose *pose = tsuya_arena_alloc(job->arena, (size_t)model->view_count, sizeof *pose);
    if (!pose) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int v = 0; v < model->view_count; v++) {
        pose[v] = model->view[v].camera_from_world;
    }
    *up = tsuya_up_from_cameras(pose, model->view_count);
    return TSUYA_OK;
}

tsuya_status tsuya_stage_render_run(const tsuya_stage_run *run)
{
    const tsuya_job *job = run->job;
    const char *folder = tsuya_job_path(job, "reconstruct/sparse/0");
    tsuya_sparse_model model;
    tsuya_render_info total = {0};
    tsuya_vec3 up;
    if (!folder) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_TRY(tsuya_sparse_model_load(&model, folder));
    tsuya_status status = upright(&up, job, &model);
    for (int i = 0; status == TSUYA_OK && i < job->render.count; i++) {
        tsuya_render_info info = {0};
        status = render_entry(&info, run, tsuya_job_render_at(job, i), &model, up);
        add_info(&total, &info);
    }
    if (status == TSUYA_OK) {
        tsuya_render_info_to_json(run->figures, &total);
    }
    tsuya_sparse_model_free(&model);
    return status;
}
