/* Photographs, masks and maps of a dense workspace, as stereo and fusion read them (inside reconstruct/). */
#ifndef TSUYA_RECONSTRUCT_STEREO_CACHE_H
#define TSUYA_RECONSTRUCT_STEREO_CACHE_H

#include "core/image.h"
#include "reconstruct/patchmatch.h"

/* The camera of a photograph's maps: its own, reduced so that the longer side is at most `long_side_px` (0: not reduced).
 * Fails on cameras with distortion. */
TSUYA_MUST_CHECK tsuya_status tsuya_map_camera(tsuya_camera *out, const tsuya_sparse_model *model, int view,
                                               int long_side_px, const char *workspace);

/* WORKSPACE/masks/NAME.png at the camera's size, 1 where at least half is white; NULL where the workspace has none. */
TSUYA_MUST_CHECK tsuya_status tsuya_map_mask_load(uint8_t **mask, const char *workspace, const char *name,
                                                  const tsuya_camera *camera);

/* WORKSPACE/stereo/{depth,normal}_maps/NAME.KIND.bin.  Folders are made.  Loading refuses maps of another size than
 * width × height, and numbers that are not finite. */
TSUYA_MUST_CHECK tsuya_status tsuya_map_save(const tsuya_depth_map *map, const char *workspace, const char *name,
                                             const char *kind);
TSUYA_MUST_CHECK tsuya_status tsuya_map_load(tsuya_depth_map *map, const char *workspace, const char *name,
                                             const char *kind, bool normals);
bool tsuya_map_exists(const char *workspace, const char *name, const char *kind);
/* FOLDER/stereo/KIND/NAME.SUFFIX in a fresh string (tsuya_free), NULL when memory is short. */
char *tsuya_map_path(const char *workspace, const char *folder, const char *name, const char *suffix);

/* Photographs ready for stereo, the least recently used dropped when they outgrow the budget. */
typedef struct tsuya_stereo_cache tsuya_stereo_cache;
TSUYA_MUST_CHECK tsuya_status tsuya_stereo_cache_create(tsuya_stereo_cache **cache, const tsuya_sparse_model *model,
                                                        const char *workspace, int long_side_px, int levels,
                                                        size_t budget_bytes);
void tsuya_stereo_cache_free(tsuya_stereo_cache *cache);
/* All of `views` at once, borrowed until the next call. */
TSUYA_MUST_CHECK tsuya_status tsuya_stereo_cache_get(const tsuya_stereo_image **image, tsuya_stereo_cache *cache,
                                                     const int *views, int count);

#endif
