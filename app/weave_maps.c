#include "app/weave_maps.h"

#include "app/shade.h"
#include "core/file.h"
#include "core/memory.h"
#include "core/order.h"

#include <math.h>
#include <string.h>

static const float SEEN = 0.5f;
static const uint8_t UNSEEN[3] = {150, 150, 150};

tsuya_status tsuya_weave_map_create(tsuya_weave_map *map, const tsuya_mesh *mesh, const float *number, int stride)
{
    tsuya_status status = TSUYA_OK;
    float *sorted = NULL;
    *map = (tsuya_weave_map){.high = 1.0};
    TSUYA_NEW(status, map->value, mesh->vertex_count);
    TSUYA_NEW(status, sorted, mesh->vertex_count);
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        bool seen = mesh->weave_confidence[v] >= SEEN;
        map->value[v] = seen ? number[v * (size_t)stride] : NAN;
        if (seen) {
            sorted[map->seen++] = map->value[v];
        }
    }
    if (map->seen > 0) {
        tsuya_sort_floats(sorted, map->seen);
        map->low = (double)sorted[map->seen / 50];
        map->high = (double)sorted[map->seen - 1 - map->seen / 50];
        map->high = map->high > map->low ? map->high : map->low + 1.0;
    }
done:
    tsuya_free(sorted);
    return status;
}

static void color_mesh(tsuya_mesh *mesh, const tsuya_weave_map *map)
{
    for (size_t v = 0; v < mesh->vertex_count; v++) {
        uint8_t *rgb = mesh->color + 3 * v;
        if (isnan(map->value[v])) {
            memcpy(rgb, UNSEEN, sizeof UNSEEN);
        } else {
            tsuya_color_map(rgb, ((double)map->value[v] - map->low) / (map->high - map->low));
        }
    }
}

static tsuya_status save_map(tsuya_json *maps, const char *name, tsuya_mesh *colored, const float *number, int stride, const char *folder, const char *file)
{
    tsuya_weave_map map = {0};
    char *path = tsuya_path_join(folder, file);
    tsuya_status status = path ? tsuya_weave_map_create(&map, colored, number, stride) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        color_mesh(colored, &map);
        status = tsuya_ply_save(colored, path, NULL);
    }
    if (status == TSUYA_OK) {
        tsuya_json *one = tsuya_json_set_object(maps, name);
        tsuya_json_set_text(one, "file", file);
        tsuya_json_set_number(one, "low", map.seen > 0 ? map.low : NAN);
        tsuya_json_set_number(one, "high", map.seen > 0 ? map.high : NAN);
    }
    tsuya_free(map.value);
    tsuya_free(path);
    return status;
}

tsuya_status tsuya_weave_maps_save(tsuya_json *figures, const tsuya_mesh *mesh, const char *folder)
{
    tsuya_mesh colored = {0};
    tsuya_json *maps = tsuya_json_set_object(figures, "maps");
    tsuya_status status = TSUYA_OK;
    TSUYA_GOTO_DONE(status, tsuya_mesh_copy(&colored, mesh));
    TSUYA_GOTO_DONE(status, tsuya_mesh_add_arrays(&colored, TSUYA_MESH_COLOR));
    TSUYA_GOTO_DONE(status, save_map(maps, "shear_deg", &colored, mesh->shear_deg, 1, folder, "shear.ply"));
    TSUYA_GOTO_DONE(status, save_map(maps, "weft_threads_per_m", &colored, mesh->threads_per_m, 2, folder, "weft_threads.ply"));
    TSUYA_GOTO_DONE(status, save_map(maps, "warp_threads_per_m", &colored, mesh->threads_per_m + 1, 2, folder, "warp_threads.ply"));
done:
    tsuya_mesh_free(&colored);
    return status;
}
