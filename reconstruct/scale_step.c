#include "reconstruct/scale_step.h"

const char *tsuya_scale_unscaled(const tsuya_reconstruction *r)
{
    return tsuya_reconstruction_path(r, r->options->scale ? "unscaled" : "sparse/0");
}

tsuya_status tsuya_scale_hash(tsuya_hash *hash, const tsuya_scale_input *in)
{
    tsuya_hasher *hasher;
    TSUYA_TRY(tsuya_hasher_create(&hasher));
    for (int i = 0; i < in->sighting_count; i++) {
        const tsuya_scale_sighting *s = &in->sighting[i];
        tsuya_hasher_add_text(hasher, s->photo);
        tsuya_hasher_add(hasher, &s->point, sizeof s->point);
        tsuya_hasher_add(hasher, &s->pixel, sizeof s->pixel);
        tsuya_hasher_add(hasher, &s->sigma_px, sizeof s->sigma_px);
    }
    for (int i = 0; i < in->tag_count; i++) {
        tsuya_hasher_add(hasher, &in->tag[i].plate, sizeof in->tag[i].plate);
        tsuya_hasher_add(hasher, in->tag[i].corner_m, sizeof in->tag[i].corner_m);
    }
    for (int i = 0; i < in->distance_count; i++) {
        tsuya_hasher_add(hasher, &in->distance[i].a, 2 * sizeof in->distance[i].a);
        tsuya_hasher_add(hasher, &in->distance[i].distance_m, sizeof in->distance[i].distance_m);
    }
    *hash = tsuya_hasher_end(hasher);
    return TSUYA_OK;
}

/* What a user has to know about the scale. */
static void warn(const tsuya_scale_info *info, const tsuya_scale_input *in)
{
    if (!(info->rms_m >= 0.0)) {
        tsuya_warn("%s: the scale rests on one %s alone, so nothing checks it", in->source, in->tag_count ? "tag" : "distance");
    }
    if (info->sigma_rel > 0.002) {
        tsuya_warn("%s: the scale is known to %.1f %% only; show more tags, from more sides", in->source, 100.0 * info->sigma_rel);
    }
    for (int k = 0; k < in->plate_count; k++) {
        const tsuya_scale_plate *p = &info->plate[k];
        if (p->outliers > p->corners) {
            tsuya_warn("%s: plate %s: %d of %d corners do not lie as the file says and are left out", in->source, in->plate[k], p->outliers,
                       p->outliers + p->corners);
        }
    }
}

static tsuya_status scale(tsuya_json *figures, tsuya_reconstruction *r)
{
    tsuya_sparse_model model;
    tsuya_similarity metric;
    tsuya_scale_info info;
    TSUYA_TRY(tsuya_sparse_model_load(&model, tsuya_scale_unscaled(r)));
    tsuya_status status = tsuya_scale_find(&metric, &info, &model, r->options->scale);
    if (status == TSUYA_OK) {
        warn(&info, r->options->scale);
        tsuya_scale_info_to_json(figures, &info, r->options->scale);
        tsuya_sparse_model_transform(&model, metric);
        status = tsuya_sparse_model_save_binary(&model, tsuya_reconstruction_path(r, "sparse/0"));
    }
    tsuya_sparse_model_free(&model);
    return status;
}

tsuya_status tsuya_scale_step(tsuya_reconstruction *r)
{
    tsuya_hash hash;
    if (!r->options->scale) {
        return TSUYA_OK;
    }
    TSUYA_TRY(tsuya_scale_hash(&hash, r->options->scale));
    if (tsuya_step_begin(&r->steps, "scale", hash.hex, tsuya_reconstruction_path(r, "sparse/0/points3D.bin"))) {
        return TSUYA_OK;
    }
    tsuya_json *figures = tsuya_json_create_object();
    tsuya_status status = figures ? scale(figures, r) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        status = tsuya_reconstruction_end_step(r, figures);
    }
    tsuya_json_free(figures);
    return status;
}
