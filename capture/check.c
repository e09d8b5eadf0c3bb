#include "capture/check_photo.h"

#include "core/file.h"
#include "core/memory.h"

#include <math.h>
#include <string.h>
#include <stdio.h>
#include <strings.h>

tsuya_check_options tsuya_check_options_default(void)
{
    return (tsuya_check_options){.blur_ratio = 1.5, .blur_excess_px = 0.8, .clipped_share = 0.05, .exposure_ev = 0.6, .white_balance_ev = 0.3,
                                 .shared_features = 16, .features = 800, .features_long_side_px = 1000};
}

static bool is_image(const char *name)
{
    static const char *const known[] = {".jpg", ".jpeg", ".png", ".tif", ".tiff", ".bmp", ".webp", ".exr", ".dng", ".nef",
                                        ".cr2", ".cr3", ".arw", ".raf", ".orf", ".rw2", ".pef", ".srw"};
    for (size_t i = 0; i < sizeof known / sizeof known[0]; i++) {
        if (strcasecmp(tsuya_path_extension(name), known[i]) == 0) {
            return true;
        }
    }
    return false;
}

/* MASKS/NAME.jpg.png or MASKS/NAME.png; NULL where there is neither. */
static tsuya_status find_mask(char **path, const char *masks, const char *name, tsuya_arena *arena)
{
    int stem = (int)(strlen(name) - strlen(tsuya_path_extension(name)));
    const char *candidate[2] = {tsuya_arena_printf(arena, "%s/%s.png", masks, name), tsuya_arena_printf(arena, "%s/%.*s.png", masks, stem, name)};
    *path = NULL;
    for (int k = 0; k < 2 && !*path; k++) {
        if (!candidate[k]) {
            return TSUYA_ERROR_MEMORY;
        }
        if (tsuya_path_exists(candidate[k]) && !(*path = tsuya_strdup(candidate[k]))) {
            return TSUYA_ERROR_MEMORY;
        }
    }
    return TSUYA_OK;
}

static tsuya_status add(tsuya_check *check, const char *photos, const char *masks, const char *name, tsuya_arena *arena)
{
    tsuya_checked_photo *p = &check->photo[check->count];
    const char *path = tsuya_arena_printf(arena, "%s/%s", photos, name);
    if (!path) {
        return TSUYA_ERROR_MEMORY;
    }
    *p = (tsuya_checked_photo){.same_as = -1, .exposure_ev = NAN, .red_ev = NAN, .blue_ev = NAN,
                               .blur = {.best_px = NAN, .worst_px = NAN}};
    tsuya_status status = tsuya_photo_load(&p->photo, path);
    p->readable = status == TSUYA_OK;
    if (!p->readable) {
        p->photo.path = tsuya_strdup(path);
        p->photo.name = tsuya_strdup(name);
        if (status == TSUYA_ERROR_MEMORY || !p->photo.path || !p->photo.name) {
            tsuya_photo_free(&p->photo);
            return TSUYA_ERROR_MEMORY;
        }
        tsuya_check_fault(p, "cannot be read: %.120s", tsuya_reason());
    }
    check->count++;
    return masks && p->readable ? find_mask(&p->photo.mask_path, masks, name, arena) : TSUYA_OK;
}

static tsuya_status list_photos(tsuya_check *check, const char *photos, const char *masks, tsuya_arena *arena)
{
    char **name;
    int count;
    if (masks && !tsuya_path_is_folder(masks)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: no such folder of masks", masks);
    }
    TSUYA_TRY(tsuya_folder_list(&name, &count, photos, arena));
    check->photo = tsuya_calloc((size_t)count, sizeof *check->photo);
    if (!check->photo) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int i = 0; i < count; i++) {
        if (is_image(name[i])) {
            TSUYA_TRY(add(check, photos, masks, name[i], arena));
        } else {
            tsuya_note("%s/%s: passed over, it is no image", photos, name[i]);
        }
    }
    if (check->count == 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: no photographs; JPEG, PNG, TIFF, EXR or camera raw files are accepted", photos);
    }
    return TSUYA_OK;
}

tsuya_status tsuya_check_session(tsuya_check *check, const char *photos, const char *masks, const tsuya_check_options *options,
                                 const tsuya_context *context)
{
    tsuya_arena *arena = NULL;
    tsuya_check_sight *sight = NULL;
    tsuya_status status;
    double start_s = tsuya_clock_s();
    *check = (tsuya_check){0};
    TSUYA_GOTO_DONE(status, tsuya_arena_create(&arena, 1 << 14));
    TSUYA_GOTO_DONE(status, list_photos(check, photos, masks, arena));
    TSUYA_NEW(status, sight, (size_t)check->count);
    for (int i = 0; i < check->count; i++) {
        tsuya_progress_update(context, "photographs", i, check->count, check->photo[i].photo.name);
        TSUYA_GOTO_DONE(status, tsuya_check_interrupt());
        if (check->photo[i].readable) {
            TSUYA_GOTO_DONE(status, tsuya_check_photo(&check->photo[i], &sight[i], options, context));
        }
    }
    tsuya_progress_update(context, "photographs", check->count, check->count, NULL);
    TSUYA_GOTO_DONE(status, tsuya_check_relations(check, sight, options, context));
    TSUYA_GOTO_DONE(status, tsuya_check_verdicts(check, options));
    check->seconds = tsuya_clock_s() - start_s;
done:
    for (int i = 0; sight && i < check->count; i++) {
        tsuya_check_sight_free(&sight[i]);
    }
    tsuya_free(sight);
    tsuya_arena_free(arena);
    if (status != TSUYA_OK) {
        tsuya_check_free(check);
    }
    return status;
}

void tsuya_check_free(tsuya_check *check)
{
    for (int i = 0; i < check->count; i++) {
        tsuya_photo_free(&check->photo[i].photo);
    }
    tsuya_free(check->photo);
    *check = (tsuya_check){0};
}

static void photo_to_json(tsuya_json *object, const tsuya_check *check, const tsuya_checked_photo *p)
{
    tsuya_json_set_text(object, "name", p->photo.name);
    tsuya_json_set_bool(object, "again", p->fault_count > 0);
    tsuya_json_set_number(object, "blur_px", p->blur.worst_px);
    tsuya_json_set_number(object, "blur_best_px", p->blur.best_px);
    tsuya_json_set_number(object, "clipped_red", p->bright_clipped[0]);
    tsuya_json_set_number(object, "clipped_green", p->bright_clipped[1]);
    tsuya_json_set_number(object, "clipped_blue", p->bright_clipped[2]);
    tsuya_json_set_number(object, "black", fmin(p->dark_clipped[0], fmin(p->dark_clipped[1], p->dark_clipped[2])));
    tsuya_json_set_number(object, "exposure_ev", p->exposure_ev);
    tsuya_json_set_number(object, "red_ev", p->red_ev);
    tsuya_json_set_number(object, "blue_ev", p->blue_ev);
    tsuya_json_set_number(object, "focal_mm", p->photo.focal_mm > 0.0 ? p->photo.focal_mm : NAN);
    tsuya_json_set_number(object, "neighbours", p->neighbours);
    tsuya_json_set_number(object, "shared_features", p->strongest);
    tsuya_json_set_text(object, "same_as", p->same_as >= 0 ? check->photo[p->same_as].photo.name : NULL);
    tsuya_json *why = tsuya_json_set_array(object, "why");
    for (int k = 0; k < p->fault_count; k++) {
        tsuya_json_add_text(why, p->fault[k]);
    }
}

void tsuya_check_to_json(tsuya_json *object, const tsuya_check *check)
{
    tsuya_json_set_number(object, "photos", check->count);
    tsuya_json_set_number(object, "take_again", check->again);
    tsuya_json_set_number(object, "blur_px", check->blur_px);
    tsuya_json_set_number(object, "focal_mm", check->focal_mm > 0.0 ? check->focal_mm : NAN);
    tsuya_json_set_number(object, "seconds", check->seconds);
    tsuya_json *again = tsuya_json_set_array(object, "again");
    for (int i = 0; i < check->count; i++) {
        const tsuya_checked_photo *p = &check->photo[i];
        for (int k = 0; k < p->fault_count; k++) {
            char line[512];
            snprintf(line, sizeof line, "%s: %s", p->photo.name, p->fault[k]);
            tsuya_json_add_text(again, line);
        }
    }
    tsuya_json *list = tsuya_json_set_array(object, "photographs");
    for (int i = 0; i < check->count; i++) {
        photo_to_json(tsuya_json_add_object(list), check, &check->photo[i]);
    }
}
