#include "app/job_files.h"

#include "brdf/material.h"
#include "brdf/samples.h"
#include "render/bands.h"
#include "render/render.h"

static tsuya_status check_samples(const char *path, bool rendered)
{
    tsuya_samples samples;
    const char *channel[TSUYA_MATERIAL_MAX_CHANNELS];
    bool spectral;
    TSUYA_TRY(tsuya_samples_load(&samples, path));
    for (int c = 0; c < samples.channel_count && c < TSUYA_MATERIAL_MAX_CHANNELS; c++) {
        channel[c] = samples.channel[c];
    }
    tsuya_status status = rendered ? tsuya_bands_check(&spectral, channel, samples.channel_count, path) : TSUYA_OK;
    tsuya_samples_free(&samples);
    return status;
}

static tsuya_status check_model(const char *path, bool rendered)
{
    tsuya_material *material;
    bool spectral;
    TSUYA_TRY(tsuya_material_load(&material, path));
    tsuya_material_info info = tsuya_material_get_info(material);
    tsuya_status status = rendered ? tsuya_bands_check(&spectral, info.channel, info.channel_count, path) : TSUYA_OK;
    tsuya_material_free(material);
    return status;
}

tsuya_status tsuya_job_check_files(const tsuya_job *job, bool rendered)
{
    for (int i = 0; i < job->materials.count; i++) {
        const tsuya_job_material *m = tsuya_job_material_at(job, i);
        TSUYA_TRY(m->samples ? check_samples(m->samples, rendered) : check_model(m->model, rendered));
    }
    if (rendered && job->lights) {
        TSUYA_TRY(tsuya_render_check_lights(job->lights));
    }
    for (int i = 0; rendered && i < job->render.count; i++) {
        const tsuya_job_render *r = tsuya_job_render_at(job, i);
        if (r->lights) {
            TSUYA_TRY(tsuya_render_check_lights(r->lights));
        }
        if (r->model) {
            TSUYA_TRY(check_model(r->model, true));
        }
    }
    return TSUYA_OK;
}
