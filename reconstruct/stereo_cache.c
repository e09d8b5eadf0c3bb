#include "reconstruct/stereo_cache.h"

#include "core/file.h"

#include <assert.h>
#include <stdio.h>
#include <string.h>

tsuya_status tsuya_map_camera(tsuya_camera *out, const tsuya_sparse_model *model, int view, int long_side_px,
                              const char *workspace)
{
    const tsuya_camera *camera = &model->camera[model->view[view].camera];
    if (camera->lens != TSUYA_LENS_PINHOLE && camera->lens != TSUYA_LENS_SIMPLE_PINHOLE) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s/sparse: the camera of %s has lens distortion; stereo wants undistorted "
                          "photographs (PINHOLE, as image_undistorter writes)", workspace, model->view[view].name);
    }
    int longer = camera->width_px > camera->height_px ? camera->width_px : camera->height_px;
    *out = *camera;
    if (long_side_px > 0 && longer > long_side_px) {
        double s = (double)long_side_px / longer;
        int width = (int)lrint(camera->width_px * s), height = (int)lrint(camera->height_px * s);
        *out = tsuya_camera_scaled(camera, width > 0 ? width : 1, height > 0 ? height : 1);
    }
    return TSUYA_OK;
}

char *tsuya_map_path(const char *workspace, const char *folder, const char *name, const char *suffix)
{
    size_t size = strlen(workspace) + strlen(folder) + strlen(name) + strlen(suffix) + 12;
    char *path = tsuya_calloc(size, 1);
    if (path) {
        snprintf(path, size, "%s/stereo/%s/%s%s", workspace, folder, name, suffix);
    }
    return path;
}

tsuya_status tsuya_map_mask_load(uint8_t **mask, const char *workspace, const char *name, const tsuya_camera *camera)
{
    *mask = NULL;
    tsuya_status status = TSUYA_OK;
    tsuya_image stored = {0}, grey = {0}, small = {0};
    const size_t pixels = (size_t)camera->width_px * (size_t)camera->height_px;
    size_t size = strlen(workspace) + strlen(name) + 16;
    char *path;
    TSUYA_NEW(status, path, size);
    snprintf(path, size, "%s/masks/%s.png", workspace, name);
    if (!tsuya_path_exists(path)) {
        goto done;
    }
    TSUYA_GOTO_DONE(status, tsuya_image_load(&stored, path));
    TSUYA_GOTO_DONE(status, tsuya_image_grey(&grey, &stored, TSUYA_SAMPLE_F32));
    TSUYA_GOTO_DONE(status, tsuya_image_resize(&small, &grey, camera->width_px, camera->height_px));
    TSUYA_NEW(status, *mask, pixels);
    for (int y = 0; y < camera->height_px; y++) {
        for (int x = 0; x < camera->width_px; x++) {
            (*mask)[(size_t)y * (size_t)camera->width_px + (size_t)x] = *tsuya_image_f32(&small, x, y) >= 0.5f;
        }
    }
done:
    tsuya_image_free(&stored);
    tsuya_image_free(&grey);
    tsuya_image_free(&small);
    tsuya_free(path);
    return status;
}

/* ---- maps ---- */

static tsuya_status save_one(const char *workspace, const char *folder, const char *name, const char *suffix,
                             const tsuya_depth_map *map, int channels, const float *values)
{
    char *path = tsuya_map_path(workspace, folder, name, suffix);
    char *parent = path ? tsuya_path_folder(path) : NULL;
    tsuya_status status = parent ? tsuya_folder_make(parent) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        status = tsuya_colmap_map_save(path, map->width_px, map->height_px, channels, values);
    }
    tsuya_free(parent);
    tsuya_free(path);
    return status;
}

static void kind_suffix(char suffix[32], const char *kind) { snprintf(suffix, 32, ".%s.bin", kind); }

tsuya_status tsuya_map_save(const tsuya_depth_map *map, const char *workspace, const char *name, const char *kind)
{
    char suffix[32];
    kind_suffix(suffix, kind);
    TSUYA_TRY(save_one(workspace, "depth_maps", name, suffix, map, 1, map->depth));
    return save_one(workspace, "normal_maps", name, suffix, map, 3, map->normal);
}

static tsuya_status load_one(float **values, int *width_px, int *height_px, int channels, const char *workspace,
                             const char *folder, const char *name, const char *kind)
{
    char suffix[32];
    kind_suffix(suffix, kind);
    char *path = tsuya_map_path(workspace, folder, name, suffix);
    int stored = 0;
    tsuya_status status = path ? tsuya_colmap_map_load(values, width_px, height_px, &stored, path) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK && stored != channels) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d channels, %d expected", path, stored, channels);
    }
    if (status == TSUYA_OK) {
        const size_t count = (size_t)*width_px * (size_t)*height_px * (size_t)channels;
        for (size_t i = 0; i < count; i++) {
            if (!isfinite((*values)[i])) {
                status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: value %zu is not finite", path, i);
                break;
            }
        }
    }
    tsuya_free(path);
    return status;
}

tsuya_status tsuya_map_load(tsuya_depth_map *map, const char *workspace, const char *name, const char *kind, bool normals)
{
    int width = 0, height = 0;
    *map = (tsuya_depth_map){0};
    tsuya_status status = load_one(&map->depth, &map->width_px, &map->height_px, 1, workspace, "depth_maps", name, kind);
    if (status == TSUYA_OK && normals) {
        status = load_one(&map->normal, &width, &height, 3, workspace, "normal_maps", name, kind);
        if (status == TSUYA_OK && (width != map->width_px || height != map->height_px)) {
            status = tsuya_fail(TSUYA_ERROR_INPUT, "%s/stereo: the normal map of %s is %d x %d, its depth map %d x %d",
                                workspace, name, width, height, map->width_px, map->height_px);
        }
    }
    if (status != TSUYA_OK) {
        tsuya_depth_map_free(map);
    }
    return status;
}

bool tsuya_map_exists(const char *workspace, const char *name, const char *kind)
{
    char suffix[32];
    kind_suffix(suffix, kind);
    char *depth = tsuya_map_path(workspace, "depth_maps", name, suffix);
    char *normal = tsuya_map_path(workspace, "normal_maps", name, suffix);
    bool there = depth && normal && tsuya_path_exists(depth) && tsuya_path_exists(normal);
    tsuya_free(depth);
    tsuya_free(normal);
    return there;
}

/* ---- photographs ---- */

typedef struct cache_entry {
    tsuya_stereo_image image;
    uint64_t used; /* clock of the last use; 0: not loaded */
} cache_entry;

struct tsuya_stereo_cache {
    const tsuya_sparse_model *model;
    const char *workspace;
    int long_side_px, levels;
    size_t budget_bytes, bytes;
    uint64_t clock;
    cache_entry *entry;
};

tsuya_status tsuya_stereo_cache_create(tsuya_stereo_cache **out, const tsuya_sparse_model *model, const char *workspace,
                                       int long_side_px, int levels, size_t budget_bytes)
{
    tsuya_stereo_cache *cache = tsuya_calloc(1, sizeof *cache);
    cache_entry *entry = tsuya_calloc((size_t)model->view_count, sizeof *entry);
    if (!cache || !entry) {
        tsuya_free(cache);
        tsuya_free(entry);
        return TSUYA_ERROR_MEMORY;
    }
    *cache = (tsuya_stereo_cache){.model = model, .workspace = workspace, .long_side_px = long_side_px,
                                  .levels = levels, .budget_bytes = budget_bytes, .entry = entry};
    *out = cache;
    return TSUYA_OK;
}

void tsuya_stereo_cache_free(tsuya_stereo_cache *cache)
{
    if (!cache) {
        return;
    }
    for (int v = 0; v < cache->model->view_count; v++) {
        tsuya_stereo_image_free(&cache->entry[v].image);
    }
    tsuya_free(cache->entry);
    tsuya_free(cache);
}

static tsuya_status load_photograph(tsuya_stereo_image *image, const tsuya_stereo_cache *cache, int view)
{
    const tsuya_view *v = &cache->model->view[view];
    const tsuya_camera *full = &cache->model->camera[v->camera];
    tsuya_camera camera;
    TSUYA_TRY(tsuya_map_camera(&camera, cache->model, view, cache->long_side_px, cache->workspace));
    tsuya_status status = TSUYA_OK;
    tsuya_image stored = {0}, grey = {0}, small = {0};
    size_t size = strlen(cache->workspace) + strlen(v->name) + 16;
    char *path;
    TSUYA_NEW(status, path, size);
    snprintf(path, size, "%s/images/%s", cache->workspace, v->name);
    TSUYA_GOTO_DONE(status, tsuya_image_load(&stored, path));
    if (stored.width_px != full->width_px || stored.height_px != full->height_px) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: is %d x %d, but its camera in %s/sparse is %d x %d", path,
                            stored.width_px, stored.height_px, cache->workspace, full->width_px, full->height_px);
        goto done;
    }
    TSUYA_GOTO_DONE(status, tsuya_image_grey(&grey, &stored, TSUYA_SAMPLE_F32));
    tsuya_image_free(&stored);
    TSUYA_GOTO_DONE(status, tsuya_image_resize(&small, &grey, camera.width_px, camera.height_px));
    assert(small.row_bytes == (size_t)small.width_px * sizeof(float));
    TSUYA_GOTO_DONE(status, tsuya_stereo_image_create(image, small.data, &camera, v->camera_from_world, cache->levels));
done:
    tsuya_image_free(&stored);
    tsuya_image_free(&grey);
    tsuya_image_free(&small);
    tsuya_free(path);
    return status;
}

/* Drops what was used before `since`, oldest first, until the budget holds. */
static void cache_shrink(tsuya_stereo_cache *cache, uint64_t since)
{
    while (cache->bytes > cache->budget_bytes) {
        cache_entry *oldest = NULL;
        for (int v = 0; v < cache->model->view_count; v++) {
            cache_entry *e = &cache->entry[v];
            if (e->used && e->used < since && (!oldest || e->used < oldest->used)) {
                oldest = e;
            }
        }
        if (!oldest) {
            return;
        }
        cache->bytes -= tsuya_stereo_image_bytes(&oldest->image);
        tsuya_stereo_image_free(&oldest->image);
        oldest->used = 0;
    }
}

tsuya_status tsuya_stereo_cache_get(const tsuya_stereo_image **image, tsuya_stereo_cache *cache, const int *views, int count)
{
    const uint64_t since = cache->clock + 1;
    for (int i = 0; i < count; i++) {
        cache_entry *e = &cache->entry[views[i]];
        if (!e->used) {
            TSUYA_TRY(load_photograph(&e->image, cache, views[i]));
            cache->bytes += tsuya_stereo_image_bytes(&e->image);
        }
        e->used = ++cache->clock;
        image[i] = &e->image;
    }
    cache_shrink(cache, since);
    return TSUYA_OK;
}
