#include "reconstruct/fusion_views.h"

#include "core/memory.h"
#include "reconstruct/stereo_cache.h"

#include <stdio.h>
#include <string.h>

struct tsuya_fusion_views {
    const tsuya_sparse_model *model;
    const char *workspace, *kind;
    bool prior;
    int capacity;
    uint64_t clock;
    tsuya_fusion_view *slot;
};

tsuya_status tsuya_fusion_views_create(tsuya_fusion_views **out, const tsuya_sparse_model *model, const char *workspace,
                                       const char *kind, bool prior, int capacity)
{
    tsuya_fusion_views *views = tsuya_calloc(1, sizeof *views);
    tsuya_fusion_view *slot = tsuya_calloc((size_t)capacity, sizeof *slot);
    if (!views || !slot) {
        tsuya_free(views);
        tsuya_free(slot);
        return TSUYA_ERROR_MEMORY;
    }
    *views = (tsuya_fusion_views){.model = model, .workspace = workspace, 
                                  .kind = kind, .prior = prior, .capacity = capacity, .slot = slot};
    *out = views;
    return TSUYA_OK;
}

static void slot_free(tsuya_fusion_view *v)
{
    tsuya_depth_map_free(&v->map);
    tsuya_image_free(&v->color);
    tsuya_free(v->prior);
    memset(v, 0, sizeof *v);
}

void tsuya_fusion_views_free(tsuya_fusion_views *views)
{
    if (!views) {
        return;
    }
    for (int i = 0; i < views->capacity; i++) {
        slot_free(&views->slot[i]);
    }
    tsuya_free(views->slot);
    tsuya_free(views);
}

static tsuya_status load_color(tsuya_image *color, const tsuya_fusion_views *views, const char *name, int width_px,
                               int height_px)
{
    tsuya_status status = TSUYA_OK;
    tsuya_image stored = {0}, eight = {0};
    size_t size = strlen(views->workspace) + strlen(name) + 16;
    char *path;
    TSUYA_NEW(status, path, size);
    snprintf(path, size, "%s/images/%s", views->workspace, name);
    TSUYA_GOTO_DONE(status, tsuya_image_load(&stored, path));
    TSUYA_GOTO_DONE(status, tsuya_image_convert(&eight, &stored, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    tsuya_image_free(&stored);
    TSUYA_GOTO_DONE(status, tsuya_image_resize(color, &eight, width_px, height_px));
done:
    tsuya_image_free(&stored);
    tsuya_image_free(&eight);
    tsuya_free(path);
    return status;
}

/* The prior's pixels into the map's gaps. */
static tsuya_status add_prior(tsuya_fusion_view *out, const tsuya_fusion_views *views, const char *name)
{
    const size_t pixels = (size_t)out->map.width_px * (size_t)out->map.height_px;
    tsuya_depth_map prior = {0};
    if (!views->prior || !tsuya_map_exists(views->workspace, name, "prior")) {
        return TSUYA_OK;
    }
    tsuya_status status = TSUYA_OK;
    TSUYA_GOTO_DONE(status, tsuya_map_load(&prior, views->workspace, name, "prior", true));
    if (prior.width_px != out->map.width_px || prior.height_px != out->map.height_px) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s/stereo: the prior map of %s is %d x %d, its %s map %d x %d", views->workspace, name,
                            prior.width_px, prior.height_px, views->kind, out->map.width_px, out->map.height_px);
        goto done;
    }
    TSUYA_NEW(status, out->prior, pixels);
    for (size_t i = 0; i < pixels; i++) {
        out->prior[i] = !(out->map.depth[i] > 0.0f) && prior.depth[i] > 0.0f;
        if (out->prior[i]) {
            out->map.depth[i] = prior.depth[i];
            for (size_t k = 0; k < 3; k++) {
                out->map.normal[k * pixels + i] = prior.normal[k * pixels + i];
            }
        }
    }
done:
    tsuya_depth_map_free(&prior);
    return status;
}

static tsuya_status slot_load(tsuya_fusion_view *out, const tsuya_fusion_views *views, int index)
{
    const tsuya_view *v = &views->model->view[index];
    tsuya_camera full;
    TSUYA_TRY(tsuya_map_camera(&full, views->model, index, 0, views->workspace));
    if (!tsuya_map_exists(views->workspace, v->name, views->kind)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s/stereo: no %s map of %s (stereo writes it)", views->workspace,
                          views->kind, v->name);
    }
    TSUYA_TRY(tsuya_map_load(&out->map, views->workspace, v->name, views->kind, true));
    tsuya_status status = add_prior(out, views, v->name);
    if (status == TSUYA_OK) {
        status = load_color(&out->color, views, v->name, out->map.width_px, out->map.height_px);
    }
    if (status != TSUYA_OK) {
        slot_free(out);
        return status;
    }
    out->view = index;
    out->camera = tsuya_camera_scaled(&full, out->map.width_px, out->map.height_px);
    out->camera_from_world = v->camera_from_world;
    out->world_from_camera = tsuya_pose_inverse(v->camera_from_world);
    return TSUYA_OK;
}

/* The slot of a view, else an empty one, else the one that was used longest ago. */
static tsuya_fusion_view *slot_for(tsuya_fusion_views *views, int index)
{
    tsuya_fusion_view *oldest = &views->slot[0];
    for (int i = 0; i < views->capacity; i++) {
        tsuya_fusion_view *s = &views->slot[i];
        if (s->used && s->view == index) {
            return s;
        }
        if (s->used < oldest->used) {
            oldest = s;
        }
    }
    return oldest;
}

tsuya_status tsuya_fusion_views_get(tsuya_fusion_view **out, tsuya_fusion_views *views, const int *index, int count)
{
    /* What is already here is marked first, so that loading the others does not push it out. */
    for (int i = 0; i < count; i++) {
        tsuya_fusion_view *s = slot_for(views, index[i]);
        if (s->used && s->view == index[i]) {
            s->used = ++views->clock;
        }
    }
    for (int i = 0; i < count; i++) {
        tsuya_fusion_view *s = slot_for(views, index[i]);
        if (!s->used || s->view != index[i]) {
            slot_free(s);
            TSUYA_TRY(slot_load(s, views, index[i]));
        }
        s->used = ++views->clock;
        out[i] = s;
    }
    return TSUYA_OK;
}
