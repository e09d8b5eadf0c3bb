#include "core/photo.h"

#include "core/exif_adapter.h"
#include "core/file.h"
#include "core/image.h"
#include "core/image_adapters.h"

#include <math.h>
#include <string.h>
#include <strings.h>

/* Diagonal of a 36 × 24 mm frame. */
static const double FULL_FRAME_DIAGONAL_MM = 43.266615305567875;

void tsuya_photo_free(tsuya_photo *photo)
{
    tsuya_free(photo->path);
    tsuya_free(photo->name);
    tsuya_free(photo->mask_path);
    *photo = (tsuya_photo){0};
}

tsuya_status tsuya_photo_load(tsuya_photo *photo, const char *path)
{
    *photo = (tsuya_photo){.orientation = 1};
    photo->path = tsuya_strdup(path);
    photo->name = tsuya_strdup(tsuya_path_name(path));
    tsuya_status status = photo->path && photo->name ? tsuya_image_probe(&photo->width_px, &photo->height_px, path) : TSUYA_ERROR_MEMORY;
    if (status == TSUYA_OK) {
        (tsuya_raw_extension(path) ? tsuya_raw_exif_read : tsuya_exif_read)(photo, path);
    } else {
        tsuya_photo_free(photo);
    }
    return status;
}

double tsuya_photo_focal_px(const tsuya_photo *photo)
{
    return photo->focal_35mm * hypot(photo->width_px, photo->height_px) / FULL_FRAME_DIAGONAL_MM;
}

static bool image_extension(const char *name)
{
    static const char *const KNOWN[] = {".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp", ".webp", ".exr"};
    for (size_t i = 0; i < sizeof KNOWN / sizeof KNOWN[0]; i++) {
        if (strcasecmp(tsuya_path_extension(name), KNOWN[i]) == 0) {
            return true;
        }
    }
    return tsuya_raw_extension(name);
}

/* NAME.jpg.png before NAME.png; NULL where there is neither. */
static tsuya_status find_mask(char **mask, const tsuya_photo *photo, const char *folder)
{
    char name[4096];
    *mask = NULL;
    for (int stem = 0; stem < 2 && !*mask; stem++) {
        int length = (int)(strlen(photo->name) - (stem ? strlen(tsuya_path_extension(photo->name)) : 0));
        snprintf(name, sizeof name, "%.*s.png", length, photo->name);
        char *path = tsuya_path_join(folder, name);
        if (!path) {
            return TSUYA_ERROR_MEMORY;
        }
        if (tsuya_path_exists(path)) {
            *mask = path;
        } else {
            tsuya_free(path);
        }
    }
    return TSUYA_OK;
}

static tsuya_status add_mask(tsuya_photo *photo, const char *folder)
{
    int width, height;
    TSUYA_TRY(find_mask(&photo->mask_path, photo, folder));
    if (!photo->mask_path) {
        return TSUYA_OK;
    }
    TSUYA_TRY(tsuya_image_probe(&width, &height, photo->mask_path));
    if (width != photo->width_px || height != photo->height_px) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d x %d pixels, its photograph %s has %d x %d; masks of the same size are accepted",
                          photo->mask_path, width, height, photo->name, photo->width_px, photo->height_px);
    }
    return TSUYA_OK;
}

static tsuya_status add_photo(tsuya_photo_set *set, const char *folder, const char *name, const char *mask_folder)
{
    tsuya_photo *photo = &set->photo[set->count];
    char *path = tsuya_path_join(folder, name);
    if (!path) {
        return TSUYA_ERROR_MEMORY;
    }
    tsuya_status status = tsuya_photo_load(photo, path);
    tsuya_free(path);
    TSUYA_TRY(status);
    set->count++;
    const tsuya_photo *first = &set->photo[0];
    if (photo->width_px != first->width_px || photo->height_px != first->height_px) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: photographs of mixed size: %s has %d x %d pixels, %s has %d x %d; one size is accepted", folder,
                          first->name, first->width_px, first->height_px, photo->name, photo->width_px, photo->height_px);
    }
    return mask_folder ? add_mask(photo, mask_folder) : TSUYA_OK;
}

tsuya_status tsuya_photo_set_load(tsuya_photo_set *set, const char *folder, const char *mask_folder)
{
    tsuya_status status;
    tsuya_arena *arena = NULL;
    char **name;
    int count;
    *set = (tsuya_photo_set){0};
    TSUYA_GOTO_DONE(status, tsuya_arena_create(&arena, 1 << 14));
    TSUYA_GOTO_DONE(status, tsuya_folder_list(&name, &count, folder, arena));
    if (mask_folder && !tsuya_path_is_folder(mask_folder)) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: no such folder of masks", mask_folder);
        goto done;
    }
    TSUYA_NEW(status, set->photo, (size_t)count);
    if (!(set->folder = tsuya_strdup(folder))) {
        status = TSUYA_ERROR_MEMORY;
        goto done;
    }
    for (int i = 0; i < count; i++) {
        char *path = tsuya_arena_printf(arena, "%s/%s", folder, name[i]);
        if (!path) {
            status = TSUYA_ERROR_MEMORY;
            goto done;
        }
        if (tsuya_path_is_folder(path) || !image_extension(name[i])) {
            tsuya_note("%s: passed over, it is no image", path);
            continue;
        }
        TSUYA_GOTO_DONE(status, add_photo(set, folder, name[i], mask_folder));
    }
    if (set->count == 0) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: no photographs; JPEG, PNG, TIFF, EXR or camera raw files are accepted", folder);
    }
done:
    tsuya_arena_free(arena);
    if (status != TSUYA_OK) {
        tsuya_photo_set_free(set);
    }
    return status;
}

void tsuya_photo_set_free(tsuya_photo_set *set)
{
    for (int i = 0; i < set->count; i++) {
        tsuya_photo_free(&set->photo[i]);
    }
    tsuya_free(set->photo);
    tsuya_free(set->folder);
    *set = (tsuya_photo_set){0};
}
