/* Stage weave: reconstruct/mesh.ply and the photographs of reconstruct/dense to weave/weave.ply. */
#include "app/regions.h"
#include "app/stage.h"

#include "core/camera.h"
#include "core/file.h"
#include "core/raster.h"
#include "reconstruct/reconstruct.h"
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

static bool has_regions(const tsuya_job *job)
{
    return job->materials.count > 1;
}

static tsuya_status add_region_inputs(tsuya_stage_plan *plan, const tsuya_job *job)
{
    const char *poses = tsuya_job_path(job, "reconstruct/sparse/0/images.bin");
    if (!poses) {
        return TSUYA_ERROR_MEMORY;
    }
    if (has_regions(job)) {
        TSUYA_TRY(tsuya_stage_input(plan, "poses", poses));
    }
    for (int i = 0; has_regions(job) && i < job->materials.count; i++) {
        const char *where = tsuya_job_material_at(job, i)->where;
        const char *label = tsuya_arena_printf(job->arena, "material %d", i);
        if (!label) {
            return TSUYA_ERROR_MEMORY;
        }
        TSUYA_TRY(where ? tsuya_stage_input(plan, label, where) : TSUYA_OK);
    }
    return TSUYA_OK;
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
    TSUYA_TRY(add_region_inputs(plan, run->job));
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

/* White where the photograph sees the surface. */
static tsuya_status draw_silhouette(tsuya_image *mask, const tsuya_mesh *mesh, const tsuya_camera *camera, tsuya_pose camera_from_world,
                                    const tsuya_context *context)
{
    tsuya_raster raster = {0};
    tsuya_status status;
    TSUYA_GOTO_DONE(status, tsuya_raster_create(&raster, camera->width_px, camera->height_px));
    TSUYA_GOTO_DONE(status, tsuya_raster_draw(&raster, mesh, camera, camera_from_world, context));
    TSUYA_GOTO_DONE(status, tsuya_image_create(mask, camera->width_px, camera->height_px, 1, TSUYA_SAMPLE_U8, TSUYA_ENCODING_DATA));
    for (size_t p = 0; p < (size_t)camera->width_px * (size_t)camera->height_px; p++) {
        ((uint8_t *)mask->data)[p] = raster.triangle[p] == UINT32_MAX ? 0 : 255;
    }
done:
    tsuya_raster_free(&raster);
    return status;
}

/* Threads drawn on a photograph where it sees the surface, for the report. */
static tsuya_status draw_overlay(const tsuya_stage_run *run, const tsuya_mesh *mesh, const tsuya_view *view, const tsuya_camera *camera)
{
    tsuya_image photo = {0}, mask = {0}, picture = {0};
    tsuya_patch_grid grid = {0};
    tsuya_patch_options options = tsuya_patch_options_default();
    const char *in = tsuya_job_path(run->job, "reconstruct/dense/images/%s", view->name);
    const char *out = tsuya_job_path(run->job, "weave/overlay/%s.jpg", view->name);
    tsuya_status status = in && out ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    TSUYA_GOTO_DONE(status, status);
    TSUYA_GOTO_DONE(status, tsuya_image_load(&photo, in));
    if (photo.width_px >= options.patch_px && photo.height_px >= options.patch_px) {
        TSUYA_GOTO_DONE(status, draw_silhouette(&mask, mesh, camera, view->camera_from_world, run->context));
        TSUYA_GOTO_DONE(status, tsuya_patches_detect(&grid, &photo, &mask, &options, run->context));
        TSUYA_GOTO_DONE(status, tsuya_patches_overlay(&picture, &photo, &grid));
        TSUYA_GOTO_DONE(status, tsuya_image_save(&picture, out, NULL));
    }
done:
    tsuya_image_free(&photo);
    tsuya_image_free(&mask);
    tsuya_image_free(&picture);
    tsuya_patches_free(&grid);
    return status;
}

static tsuya_status draw_overlays(const tsuya_stage_run *run, const tsuya_mesh *mesh)
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
        const tsuya_view *view = &model.view[(long long)i * model.view_count / count];
        status = draw_overlay(run, mesh, view, &model.camera[view->camera]);
    }
    tsuya_sparse_model_free(&model);
    return status;
}

/* Every mask of a photograph that was placed and is not held out, by view. */
static tsuya_status list_masks(tsuya_region_mask **masks, int *count, const tsuya_job *job, const tsuya_sparse_model *model)
{
    *count = 0;
    *masks = tsuya_arena_alloc(job->arena, (size_t)(job->photo.count * job->materials.count) + 1, sizeof **masks);
    if (!*masks) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int p = 0; p < job->photo.count; p++) {
        int view = tsuya_sparse_model_find(model, job->photo.photo[p].name);
        bool used = view >= 0 && !tsuya_job_holds_out(job, job->photo.photo[p].name);
        for (int i = 0; used && i < job->materials.count; i++) {
            const char *path;
            TSUYA_TRY(tsuya_job_region_mask(&path, job, i, p));
            if (path) {
                (*masks)[(*count)++] = (tsuya_region_mask){(uint8_t)i, view, path};
            }
        }
    }
    return TSUYA_OK;
}

/* What each material got of the surface's vertices. */
static void tell_shares(tsuya_json *figures, const tsuya_mesh *mesh, const tsuya_job *job)
{
    size_t count[256] = {0};
    tsuya_json *list = tsuya_json_set_array(figures, "materials");
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        count[mesh->material[v]]++;
    }
    for (int i = 0; i < job->materials.count; i++) {
        const char *name = tsuya_job_material_at(job, i)->name;
        tsuya_json *item = tsuya_json_add_object(list);
        tsuya_json_set_text(item, "name", name);
        tsuya_json_set_number(item, "share", mesh->vertex_count > 0 ? (double)count[i] / (double)mesh->vertex_count : 0.0);
        if (count[i] == 0) {
            tsuya_warn("materials: %s: its masks show no part of the surface", name);
        }
    }
}

static tsuya_status assign_materials(tsuya_mesh *mesh, const tsuya_stage_run *run)
{
    const tsuya_job *job = run->job;
    const char *folder = tsuya_job_path(job, "reconstruct");
    tsuya_sparse_model model;
    tsuya_region_mask *masks;
    int count;
    uint8_t rest = 0;
    for (int i = 0; i < job->materials.count; i++) {
        rest = tsuya_job_material_at(job, i)->where ? rest : (uint8_t)i;
    }
    if (!folder) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_TRY(tsuya_reconstruct_cameras(&model, folder, tsuya_stage_camera_model(job), job->poses));
    tsuya_status status = list_masks(&masks, &count, job, &model);
    if (status == TSUYA_OK) {
        status = tsuya_regions_vote(mesh, &model, masks, count, rest, run->context);
    }
    if (status == TSUYA_OK) {
        tell_shares(run->figures, mesh, job);
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
        tsuya_warn("weave: no threads to be seen in the photographs; the weft field follows texture and folds, its confidence is low, and pictures take the reflectance's mean over all directions");
    }
    tsuya_weave_mesh_info_to_json(run->figures, &info);
    if (has_regions(run->job)) {
        TSUYA_GOTO_DONE(status, assign_materials(&mesh, run));
    }
    TSUYA_GOTO_DONE(status, tsuya_ply_save(&mesh, out, NULL));
    TSUYA_GOTO_DONE(status, draw_overlays(run, &mesh));
    TSUYA_GOTO_DONE(status, tsuya_json_save(run->figures, json));
done:
    tsuya_weave_mesh_info_free(&info);
    tsuya_mesh_free(&mesh);
    return status;
}
