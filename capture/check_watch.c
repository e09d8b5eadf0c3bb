/* A session that grows: what is known of a photograph and of a pair stays while their files stay as they are. */
#include "capture/check_photo.h"

#include "core/file.h"
#include "core/memory.h"

#include <math.h>
#include <string.h>
#include <strings.h>
#include <sys/stat.h>

struct tsuya_check_watch {
    tsuya_check check;
    tsuya_check_sight *sight;
    tsuya_check_relation *relations;
    tsuya_check_options options;
    char *photos, *masks;
    tsuya_board target; /* empty where none was given */
};

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

static void stamp(double to[3], const char *path)
{
    struct stat s;
    memset(to, 0, 3 * sizeof *to);
    if (path && stat(path, &s) == 0) {
        to[0] = 1.0 + (double)s.st_size;
        to[1] = (double)s.st_mtim.tv_sec;
        to[2] = (double)s.st_mtim.tv_nsec;
    }
}

/* The entry of a file as it is now; pixels are not read yet. */
static tsuya_status open_photo(tsuya_checked_photo *p, tsuya_check_sight *sight, const char *path, const char *mask)
{
    *p = (tsuya_checked_photo){.same_as = -1, .exposure_ev = NAN, .red_ev = NAN, .blue_ev = NAN, .azimuth_deg = NAN, .elevation_deg = NAN,
                               .tags = -1, .tags_focal_px = NAN, .tags_focal_sigma_px = NAN, .apart_ev = {NAN, NAN, NAN},
                               .blur = {.best_px = NAN, .worst_px = NAN}};
    tsuya_status status = tsuya_photo_load(&p->photo, path);
    p->readable = status == TSUYA_OK;
    if (!p->readable) {
        if (status == TSUYA_ERROR_MEMORY) {
            return status;
        }
        tsuya_check_fault(p, "cannot be read: %.120s", tsuya_reason());
        p->photo.path = tsuya_strdup(path);
        p->photo.name = tsuya_strdup(tsuya_path_name(path));
        if (!p->photo.path || !p->photo.name) {
            tsuya_photo_free(&p->photo);
            return TSUYA_ERROR_MEMORY;
        }
    }
    if (mask && p->readable && !(p->photo.mask_path = tsuya_strdup(mask))) {
        tsuya_photo_free(&p->photo);
        return TSUYA_ERROR_MEMORY;
    }
    sight->own_faults = p->fault_count;
    return TSUYA_OK;
}

static int known_as(const tsuya_check *check, const char *name)
{
    for (int i = 0; i < check->count; i++) {
        if (check->photo[i].photo.name && strcmp(check->photo[i].photo.name, name) == 0) {
            return i;
        }
    }
    return -1;
}

/* The folder as it stands becomes the watch's; `was`: index of each entry before, −1 where it is new. */
typedef struct listing {
    tsuya_check_watch now;
    int *was;
} listing;

static tsuya_status take_entry(listing *l, tsuya_check_watch *before, const char *name, tsuya_arena *arena)
{
    int k = l->now.check.count, old = known_as(&before->check, name);
    const char *path = tsuya_arena_printf(arena, "%s/%s", before->photos, name);
    char *mask = NULL;
    double own[6];
    tsuya_check_sight *sight = &l->now.sight[k];
    if (!path) {
        return TSUYA_ERROR_MEMORY;
    }
    TSUYA_TRY(before->masks ? find_mask(&mask, before->masks, name, arena) : TSUYA_OK);
    stamp(own, path);
    stamp(own + 3, mask);
    tsuya_status status = TSUYA_OK;
    l->was[k] = -1;
    if (old >= 0 && memcmp(own, before->sight[old].stamp, sizeof own) == 0) {
        l->was[k] = old;
        l->now.check.photo[k] = before->check.photo[old];
        *sight = before->sight[old];
        before->check.photo[old].photo = (tsuya_photo){0};
        before->sight[old] = (tsuya_check_sight){0};
    } else {
        status = open_photo(&l->now.check.photo[k], sight, path, mask);
        memcpy(sight->stamp, own, sizeof own);
    }
    sight->is_new = l->was[k] < 0;
    l->now.check.count += status == TSUYA_OK;
    tsuya_free(mask);
    return status;
}

static void release(tsuya_check_watch *w)
{
    for (int i = 0; w->sight && i < w->check.count; i++) {
        tsuya_check_sight_free(&w->sight[i]);
    }
    tsuya_free(w->sight);
    tsuya_free(w->relations);
    tsuya_check_free(&w->check);
    w->sight = NULL;
    w->relations = NULL;
}

static void carry_relations(listing *l, const tsuya_check_watch *before)
{
    size_t n = (size_t)l->now.check.count, m = (size_t)before->check.count;
    for (size_t i = 0; i < n; i++) {
        for (size_t j = 0; j < n; j++) {
            if (l->was[i] >= 0 && l->was[j] >= 0) {
                l->now.relations[i * n + j] = before->relations[(size_t)l->was[i] * m + (size_t)l->was[j]];
            }
        }
    }
}

static tsuya_status list_folder(tsuya_check_watch *w)
{
    tsuya_status status;
    tsuya_arena *arena = NULL;
    char **name;
    int count, images = 0;
    listing l = {.now = {.options = w->options}};
    TSUYA_GOTO_DONE(status, tsuya_arena_create(&arena, 1 << 14));
    TSUYA_GOTO_DONE(status, tsuya_folder_list(&name, &count, w->photos, arena));
    TSUYA_NEW(status, l.now.check.photo, (size_t)count);
    TSUYA_NEW(status, l.now.sight, (size_t)count);
    TSUYA_NEW(status, l.was, (size_t)count);
    for (int i = 0; i < count; i++) {
        images += is_image(name[i]);
    }
    TSUYA_NEW(status, l.now.relations, (size_t)images * (size_t)images);
    for (int i = 0; i < count; i++) {
        if (is_image(name[i])) {
            TSUYA_GOTO_DONE(status, take_entry(&l, w, name[i], arena));
        } else if (w->check.count == 0) {
            tsuya_note("%s/%s: passed over, it is no image", w->photos, name[i]);
        }
    }
    carry_relations(&l, w);
    release(w);
    w->check = l.now.check;
    w->sight = l.now.sight;
    w->relations = l.now.relations;
    l.now = (tsuya_check_watch){0};
done:
    release(&l.now);
    tsuya_free(l.was);
    tsuya_arena_free(arena);
    return status;
}

static tsuya_status read_photo(tsuya_check_watch *w, int i, const tsuya_context *context)
{
    tsuya_checked_photo *p = &w->check.photo[i];
    tsuya_check_sight *sight = &w->sight[i];
    p->fault_count = sight->own_faults;
    if (sight->measured) {
        return TSUYA_OK;
    }
    tsuya_progress_update(context, "photographs", i, w->check.count, p->photo.name);
    TSUYA_TRY(tsuya_check_interrupt());
    if (p->readable) {
        TSUYA_TRY(tsuya_check_photo(p, sight, w->target.tag_count > 0 ? &w->target : NULL, &w->options, context));
    }
    sight->own_faults = p->fault_count;
    sight->measured = true;
    return TSUYA_OK;
}

tsuya_status tsuya_check_watch_refresh(tsuya_check_watch *w, int *read, const tsuya_context *context)
{
    double start_s = tsuya_clock_s();
    *read = 0;
    TSUYA_TRY(list_folder(w));
    for (int i = 0; i < w->check.count; i++) {
        *read += w->sight[i].is_new;
        TSUYA_TRY(read_photo(w, i, context));
    }
    tsuya_progress_update(context, "photographs", w->check.count, w->check.count, NULL);
    TSUYA_TRY(tsuya_check_relations(&w->check, w->relations, w->sight, &w->options, context));
    TSUYA_TRY(tsuya_check_verdicts(&w->check, &w->options));
    TSUYA_TRY(tsuya_check_cover(&w->check, w->relations, w->sight, &w->options));
    w->check.seconds = tsuya_clock_s() - start_s;
    return TSUYA_OK;
}

tsuya_status tsuya_check_watch_create(tsuya_check_watch **watch, const char *photos, const char *masks, const tsuya_check_options *options)
{
    tsuya_status status = TSUYA_OK;
    tsuya_check_watch *w;
    *watch = NULL;
    if (masks && !tsuya_path_is_folder(masks)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: no such folder of masks", masks);
    }
    TSUYA_NEW(status, w, 1);
    w->options = *options;
    w->photos = tsuya_strdup(photos);
    w->masks = masks ? tsuya_strdup(masks) : NULL;
    status = !w->photos || (masks && !w->masks) ? TSUYA_ERROR_MEMORY : options->target ? tsuya_board_load(&w->target, options->target) : TSUYA_OK;
    if (status != TSUYA_OK) {
        tsuya_check_watch_free(w);
        return status;
    }
    *watch = w;
done:
    return status;
}

const tsuya_check *tsuya_check_watch_result(const tsuya_check_watch *watch) { return &watch->check; }

bool tsuya_check_watch_is_new(const tsuya_check_watch *watch, int photo) { return watch->sight[photo].is_new; }

void tsuya_check_watch_free(tsuya_check_watch *w)
{
    if (w) {
        release(w);
        tsuya_free(w->photos);
        tsuya_free(w->masks);
        tsuya_board_free(&w->target);
        tsuya_free(w);
    }
}

tsuya_status tsuya_check_session(tsuya_check *check, const char *photos, const char *masks, const tsuya_check_options *options,
                                 const tsuya_context *context)
{
    tsuya_check_watch *w;
    int read;
    *check = (tsuya_check){0};
    TSUYA_TRY(tsuya_check_watch_create(&w, photos, masks, options));
    tsuya_status status = tsuya_check_watch_refresh(w, &read, context);
    if (status == TSUYA_OK && w->check.count == 0) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: no photographs; JPEG, PNG, TIFF, EXR or camera raw files are accepted", photos);
    }
    if (status == TSUYA_OK) {
        for (int i = 0; i < w->check.count; i++) {
            tsuya_check_sight_free(&w->sight[i]);
        }
        *check = w->check;
        w->check = (tsuya_check){0};
    }
    tsuya_check_watch_free(w);
    return status;
}
