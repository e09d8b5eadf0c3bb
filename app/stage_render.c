/* Stage render: every entry of the job's render list into JOB/render/NAME/. */
#include "app/stage.h"
#include "app/stage_dye.h"

#include "core/camera.h"
#include "core/file.h"
#include "reconstruct/reconstruct.h"
#include "render/render.h"
#include "render/views.h"

#include <math.h>
#include <string.h>

enum { SAMPLES_PER_PIXEL = 48, BOUNCES = 3, OTHERS = 4 };
static const double NOISE = 0.02; /* beside a photograph, 4 % alone would cost a colour difference of 1 */

static const char *const mesh_relative = "weave/weave.ply";

static bool wears_photographs(const tsuya_job_render *entry) { return !entry->color || strcmp(entry->color, "photographs") == 0; }

/* Photographs and masks count where pictures are compared with them, or dyes are found from them. */
static tsuya_status add_like_inputs(tsuya_stage_plan *plan, const tsuya_job *job)
{
    bool like = tsuya_stage_has_measured_lamps(job);
    for (int i = 0; i < job->render.count; i++) {
        like = like || tsuya_job_render_at(job, i)->like;
    }
    if (like) {
        TSUYA_TRY(tsuya_stage_input(plan, "photos", job->photos));
        TSUYA_TRY(tsuya_stage_input(plan, "masks", job->masks));
    }
    return TSUYA_OK;
}

static tsuya_status add_material_inputs(tsuya_stage_plan *plan, const tsuya_job *job)
{
    for (int i = 0; i < tsuya_stage_material_count(job); i++) {
        const char *path = tsuya_stage_material_path(job, i, true);
        const char *label = i == 0 ? "material" : tsuya_arena_printf(job->arena, "material %d", i);
        if (!path || !label) {
            return TSUYA_ERROR_MEMORY;
        }
        TSUYA_TRY(tsuya_stage_input(plan, label, path));
    }
    return TSUYA_OK;
}

/* What single entries bring along. */
static tsuya_status add_entry_inputs(tsuya_stage_plan *plan, const tsuya_job *job, const tsuya_job_render *entry)
{
    const char *lights = tsuya_arena_printf(job->arena, "lights of %s", entry->name);
    const char *model = tsuya_arena_printf(job->arena, "model of %s", entry->name);
    if (!lights || !model) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_TRY(tsuya_stage_input(plan, lights, entry->lights));
    return tsuya_stage_input(plan, model, entry->model);
}

tsuya_status tsuya_stage_render_plan(tsuya_stage_plan *plan, const tsuya_stage_run *run)
{
    const tsuya_job *job = run->job;
    const char *mesh = tsuya_job_path(job, "%s", mesh_relative), *model = tsuya_job_path(job, "reconstruct/sparse/0/images.bin");
    if (!mesh || !model) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_TRY(tsuya_stage_input(plan, "mesh", mesh));
    TSUYA_TRY(tsuya_stage_input(plan, "cameras", model));
    TSUYA_TRY(add_material_inputs(plan, job));
    TSUYA_TRY(tsuya_stage_input(plan, "lights", job->lights));
    TSUYA_TRY(add_like_inputs(plan, job));
    tsuya_json_set_number(plan->options, "seed", (double)run->context->seed);
    tsuya_json_set_number(plan->options, "spp", SAMPLES_PER_PIXEL);
    tsuya_json_set_number(plan->options, "noise", NOISE);
    tsuya_json_set_number(plan->options, "bounces", BOUNCES);
    tsuya_json *list = tsuya_json_set_array(plan->options, "render");
    for (int i = 0; i < job->render.count; i++) {
        const tsuya_job_render *r = tsuya_job_render_at(job, i);
        TSUYA_TRY(add_entry_inputs(plan, job, r));
        tsuya_json *entry = tsuya_json_add_object(list);
        tsuya_json_set_text(entry, "name", r->name);
        tsuya_json_set_number(entry, "views", r->views);
        tsuya_json_set_numbers(entry, "size", (double[]){r->width_px, r->height_px}, 2);
        tsuya_json_set_text(entry, "color", r->color);
        if (isfinite(r->elevation_deg)) {
            tsuya_json_set_number(entry, "elevation", r->elevation_deg);
        }
        if (isfinite(r->exposure_ev)) {
            tsuya_json_set_number(entry, "exposure", r->exposure_ev);
        }
        if (isfinite(r->tolerance)) {
            tsuya_json_set_number(entry, "tolerance", r->tolerance);
        }
        for (int h = 0; r->like && h < job->hold_out.count; h++) {
            tsuya_json_set_text(entry, tsuya_job_hold_out_at(job, h), "held out");
        }
        tsuya_json_set_text(entry, "like", r->like);
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
    tsuya_render_like like = info->like.photos > 0 ? info->like : total->like;
    tsuya_render_like held_out = info->like_held_out.photos > 0 ? info->like_held_out : total->like_held_out;
    *total = *info;
    total->like = like;
    total->like_held_out = held_out;
    total->rays = rays;
    total->seconds = seconds;
    total->trace_seconds = trace_seconds;
    total->mrays_per_s = trace_seconds > 0.0 ? 1e-6 * (double)rays / trace_seconds : 0.0;
    total->peak_mb = peak_mb;
    total->frames = frames;
    total->frames_reused = reused;
}

/* The pictures of a `like:` entry: every photograph of hold_out, and some of the others to tell what holding out costs. */
typedef struct like_views {
    int *view; /* in the sparse model */
    const char **photo, **mask;
    bool *held_out;
    int count;
} like_views;

static void add_like(like_views *like, const tsuya_job *job, const tsuya_photo *photo, const tsuya_sparse_model *model, bool held_out)
{
    int view = tsuya_sparse_model_find(model, photo->name);
    if (view < 0) {
        if (held_out) {
            tsuya_warn("%s: held out, but not placed by the reconstruction; it is not rendered", photo->name);
        }
        return;
    }
    like->view[like->count] = view;
    like->photo[like->count] = photo->path;
    like->mask[like->count] = job->masks ? photo->mask_path : NULL;
    like->held_out[like->count++] = held_out;
}

/* As many of the others as are held out, at least OTHERS, spread evenly over the photographs. */
static tsuya_status find_like(like_views *like, const tsuya_job *job, const tsuya_sparse_model *model)
{
    int photos = job->photo.count, others = 0;
    size_t room = (size_t)photos + 1;
    int *other = tsuya_arena_alloc(job->arena, room, sizeof *other);
    like->view = tsuya_arena_alloc(job->arena, room, sizeof *like->view);
    like->photo = tsuya_arena_alloc(job->arena, room, sizeof *like->photo);
    like->mask = tsuya_arena_alloc(job->arena, room, sizeof *like->mask);
    like->held_out = tsuya_arena_alloc(job->arena, room, sizeof *like->held_out);
    if (!other || !like->view || !like->photo || !like->mask || !like->held_out) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int p = 0; p < photos; p++) {
        if (tsuya_job_holds_out(job, job->photo.photo[p].name)) {
            add_like(like, job, &job->photo.photo[p], model, true);
        } else {
            other[others++] = p;
        }
    }
    if (like->count == 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: render: none of the photographs of hold_out: was placed", job->path);
    }
    int wanted = like->count > OTHERS ? like->count : OTHERS;
    wanted = wanted < others ? wanted : others;
    for (int k = 0; k < wanted; k++) {
        add_like(like, job, &job->photo.photo[other[k * others / wanted]], model, false);
    }
    return TSUYA_OK;
}

/* Where no threads were seen, the field follows texture and folds, and glints would follow its patches. */
static bool saw_threads(const tsuya_job *job)
{
    const char *path = tsuya_job_path(job, "weave/weave.json");
    tsuya_json *root;
    bool seen = true;
    if (path && tsuya_path_exists(path) && tsuya_json_load(&root, path) == TSUYA_OK) {
        if (tsuya_json_get_bool(&seen, root, "threads_seen") != TSUYA_OK) {
            seen = true;
        }
        tsuya_json_free(root);
    }
    return seen;
}

/* What all entries of a job share. */
typedef struct common_look {
    const char *dyed; /* the mesh with its dyes; NULL where they are not known */
    bool threads_seen;
} common_look;

static tsuya_status render_entry(tsuya_render_info *info, const tsuya_stage_run *run, const tsuya_job_render *entry,
                                 const tsuya_sparse_model *model, tsuya_vec3 up, const common_look *look)
{
    const tsuya_job *job = run->job;
    tsuya_render_options options = tsuya_render_options_default();
    int materials = tsuya_stage_material_count(job);
    const char **material = tsuya_arena_alloc(job->arena, (size_t)materials, sizeof *material);
    like_views like = {0};
    bool wears = look->dyed && wears_photographs(entry);
    options.mesh_path = wears ? look->dyed : tsuya_job_path(job, "%s", mesh_relative);
    options.without_weft = !look->threads_seen;
    options.vertex_dye_scale = wears ? 1.0 : options.vertex_dye_scale;
    options.output_folder = tsuya_job_path(job, "render");
    if (!material || !options.mesh_path || !options.output_folder) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int i = 0; i < materials; i++) {
        material[i] = tsuya_stage_material_path(job, i, true);
        if (!material[i]) {
            return TSUYA_ERROR_MEMORY;
        }
    }
    options.material_path = entry->model ? &entry->model : material;
    options.material_count = entry->model ? 1 : materials;
    options.lights_path = entry->lights ? entry->lights : job->lights;
    options.name = entry->name;
    options.color = entry->color;
    options.spp = SAMPLES_PER_PIXEL;
    options.noise = NOISE;
    options.bounces = BOUNCES;
    options.tolerance = isfinite(entry->tolerance) ? entry->tolerance : 0.0;
    options.up = up;
    if (entry->like) {
        TSUYA_TRY(find_like(&like, job, model));
        options.model = model;
        options.model_view = like.view;
        options.model_view_count = like.count;
        options.photo_path = like.photo;
        options.mask_path = like.mask;
        options.held_out = like.held_out;
    } else {
        options.views = entry->views;
        options.width_px = entry->width_px;
        options.height_px = entry->height_px;
        options.exposure_ev = entry->exposure_ev;
        options.elevation_deg = isfinite(entry->elevation_deg) ? entry->elevation_deg : options.elevation_deg;
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
    const char *folder = tsuya_job_path(job, "reconstruct");
    tsuya_sparse_model model;
    tsuya_render_info total = {0};
    common_look look = {.threads_seen = saw_threads(job)};
    tsuya_vec3 up;
    if (!folder) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_TRY(tsuya_reconstruct_cameras(&model, folder, tsuya_stage_camera_model(job), job->poses));
    tsuya_status status = upright(&up, job, &model);
    bool worn = false;
    for (int i = 0; i < job->render.count; i++) {
        worn = worn || wears_photographs(tsuya_job_render_at(job, i));
    }
    if (status == TSUYA_OK && worn && tsuya_stage_has_measured_lamps(job)) {
        status = tsuya_stage_dye(&look.dyed, run, &model);
    }
    for (int i = 0; status == TSUYA_OK && i < job->render.count; i++) {
        tsuya_render_info info = {0};
        status = render_entry(&info, run, tsuya_job_render_at(job, i), &model, up, &look);
        add_info(&total, &info);
    }
    if (status == TSUYA_OK) {
        tsuya_render_info_to_json(run->figures, &total);
    }
    tsuya_sparse_model_free(&model);
    return status;
}
