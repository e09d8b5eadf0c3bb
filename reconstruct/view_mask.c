#include "reconstruct/view_mask.h"

#include "core/file.h"
#include "core/memory.h"

#include <string.h>

tsuya_status tsuya_view_mask_load(tsuya_image *mask, const char *workspace, const char *name, const tsuya_camera *camera)
{
    *mask = (tsuya_image){0};
    tsuya_status status = TSUYA_OK;
    tsuya_arena *arena = NULL;
    tsuya_image loaded = {0};
    TSUYA_GOTO_DONE(status, tsuya_arena_create(&arena, 4096));
    const char *path = tsuya_arena_printf(arena, "%s/masks/%s.png", workspace, name);
    if (!path) {
        status = TSUYA_ERROR_MEMORY;
        goto done;
    }
    if (!tsuya_path_exists(path)) {
        goto done;
    }
    TSUYA_GOTO_DONE(status, tsuya_image_load(&loaded, path));
    if (loaded.width_px != camera->width_px || loaded.height_px != camera->height_px) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d × %d pixels; its photograph has %d × %d", path, loaded.width_px,
                            loaded.height_px, camera->width_px, camera->height_px);
        goto done;
    }
    if (loaded.channels == 1 && loaded.sample == TSUYA_SAMPLE_U8) {
        *mask = loaded;
        loaded = (tsuya_image){0};
    } else {
        status = tsuya_image_grey(mask, &loaded, TSUYA_SAMPLE_U8);
    }
done:
    tsuya_image_free(&loaded);
    tsuya_arena_free(arena);
    return status;
}

static uint16_t nearer(uint16_t here, uint16_t neighbour)
{
    return neighbour < here - 1 ? (uint16_t)(neighbour + 1) : here;
}

/* Over the three pixels next to x in the row above or below. */
static uint16_t nearest_of_row(uint16_t here, const uint16_t *row, int x, int width_px)
{
    for (int k = x > 0 ? x - 1 : 0; k <= x + 1 && k < width_px; k++) {
        here = nearer(here, row[k]);
    }
    return here;
}

void tsuya_distance_to_marked(uint16_t *distance, int width_px, int height_px)
{
    size_t w = (size_t)width_px, h = (size_t)height_px;
    for (size_t p = 0; p < w * h; p++) {
        distance[p] = distance[p] ? 0 : UINT16_MAX;
    }
    for (size_t y = 0; y < h; y++) {
        uint16_t *row = distance + y * w;
        for (int x = 0; x < width_px; x++) {
            row[x] = x > 0 ? nearer(row[x], row[x - 1]) : row[x];
            row[x] = y > 0 ? nearest_of_row(row[x], row - w, x, width_px) : row[x];
        }
    }
    for (size_t y = h; y-- > 0;) {
        uint16_t *row = distance + y * w;
        for (int x = width_px - 1; x >= 0; x--) {
            row[x] = x + 1 < width_px ? nearer(row[x], row[x + 1]) : row[x];
            row[x] = y + 1 < h ? nearest_of_row(row[x], row + w, x, width_px) : row[x];
        }
    }
}
