#include "app/stage_dye.h"

#include "brdf/material.h"
#include "core/file.h"
#include "core/mesh.h"
#include "render/dye.h"
#include "render/preset.h"

#include <string.h>

bool tsuya_stage_has_measured_lamps(const tsuya_job *job)
{
    tsuya_json *root;
    if (!job->lights || tsuya_light_preset_find(job->lights) != TSUYA_PRESET_NONE || tsuya_json_load(&root, job->lights) != TSUYA_OK) {
        return false; /* what is wrong with the file, the renderer says */
    }
    bool measured = tsuya_json_member(root, "lights") != NULL;
    tsuya_json_free(root);
    return measured;
}

/* A material of many wavelengths has no dyes in red, green and blue. */
static tsuya_status is_spectral(bool *spectral, const char *path)
{
    tsuya_material *material;
    TSUYA_TRY(tsuya_material_load(&material, path));
    tsuya_material_info info = tsuya_material_get_info(material);
    *spectral = *spectral || info.channel_count != 3 || strcmp(info.channel[0], "r") != 0;
    tsuya_material_free(material);
    return TSUYA_OK;
}

typedef struct session {
    const char **material, **photo, **mask;
    int *view;
    bool spectral;
} session;

static tsuya_status list_session(tsuya_dye_options *o, session *s, const tsuya_job *job, const tsuya_sparse_model *model)
{
    size_t room = (size_t)job->photo.count + 1;
    o->material_count = tsuya_stage_material_count(job);
    s->view = tsuya_arena_alloc(job->arena, room, sizeof *s->view);
    s->photo = tsuya_arena_alloc(job->arena, room, sizeof *s->photo);
    s->mask = tsuya_arena_alloc(job->arena, room, sizeof *s->mask);
    s->material = tsuya_arena_alloc(job->arena, (size_t)o->material_count, sizeof *s->material);
    if (!s->view || !s->photo || !s->mask || !s->material) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int k = 0; k < o->material_count; k++) {
        s->material[k] = tsuya_stage_material_path(job, k, true);
        TSUYA_TRY(s->material[k] ? is_spectral(&s->spectral, s->material[k]) : TSUYA_ERROR_MEMORY);
    }
    for (int p = 0; p < job->photo.count; p++) {
        const tsuya_photo *photo = &job->photo.photo[p];
        int at = tsuya_sparse_model_find(model, photo->name);
        if (at >= 0 && !tsuya_job_holds_out(job, photo->name)) {
            s->view[o->view_count] = at;
            s->photo[o->view_count] = photo->path;
            s->mask[o->view_count++] = job->masks ? photo->mask_path : NULL;
        }
    }
    o->view = s->view;
    o->photo = s->photo;
    o->mask = s->mask;
    o->material_path = s->material;
    return TSUYA_OK;
}

tsuya_status tsuya_stage_dye(const char **path, const tsuya_stage_run *run, const tsuya_sparse_model *model)
{
    const tsuya_job *job = run->job;
    const char *dyed_path = tsuya_job_path(job, "render/dyed.ply"), *mesh_path = tsuya_job_path(job, "weave/weave.ply");
    tsuya_dye_options options = {.lights_path = job->lights, .model = model};
    session own = {.spectral = false};
    tsuya_dye_info info;
    tsuya_mesh mesh = {0}, dyed = {0};
    tsuya_status status = dyed_path && mesh_path ? list_session(&options, &own, job, model) : TSUYA_ERROR_MEMORY;
    TSUYA_GOTO_DONE(status, status);
    if (own.spectral) {
        tsuya_warn("dyes are found for materials in red, green and blue; one here is spectral, so the pattern keeps the photographs' light");
        goto done;
    }
    TSUYA_GOTO_DONE(status, tsuya_ply_load(&mesh, mesh_path));
    if (!mesh.color) {
        goto done; /* a surface without colours: the material's own */
    }
    TSUYA_GOTO_DONE(status, tsuya_dye_from_photographs(&dyed, &info, &mesh, &options, run->context));
    TSUYA_GOTO_DONE(status, tsuya_ply_save(&dyed, dyed_path, NULL));
    tsuya_dye_info_to_json(tsuya_json_set_object(run->figures, "dye"), &info);
    *path = dyed_path;
done:
    tsuya_mesh_free(&mesh);
    tsuya_mesh_free(&dyed);
    return status;
}
