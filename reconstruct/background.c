#include "reconstruct/background.h"

#include "core/file.h"
#include "core/image.h"
#include "core/memory.h"
#include "core/order.h"

#include <stdlib.h>
#include <string.h>

/* SAMPLE: photographs that the background is made of, spread over the set.  REACH: of the neighbourhood that has to be alike,
 * which leaves a rim of as many pixels around the object. */
enum { LEAST_PHOTOS = 8, SAMPLE = 48, LONG_SIDE_PX = 640, REACH = 2, NEAR = (2 * REACH + 1) * (2 * REACH + 1), LUMA_MOST = 3 * 255 };
static const double ALIKE = 0.05, STEP = 0.03; /* grey, as in patchmatch_backdrop.c */
static const double AGREE = 2.0 / 3.0, MAJORITY = 0.5, QUARTER = 0.25; /* of the photographs */
static const double LEAST_COMPONENT = 0.01; /* of the largest thing that is kept */
enum { SAME = 1, STATIC = 2, BACKGROUND = 4, SEEN = 8, TWICE = 16 }; /* flags of a pixel in one photograph */

typedef struct background {
    int width_px, height_px, count;
    uint8_t *photo;   /* count × pixels × 3 */
    uint8_t *color;   /* pixels × 3 */
    uint8_t *support; /* photographs that agree */
    uint8_t *trusted; /* so many agree that the object's own texture does not */
} background;

static size_t pixels_of(const background *b) { return (size_t)b->width_px * (size_t)b->height_px; }
static int luma(const uint8_t *rgb) { return rgb[0] + rgb[1] + rgb[2]; }

/* The photograph in 8 bits of sRGB, reduced to the background's size. */
static tsuya_status load_small(uint8_t *rgb, const tsuya_photo *photo, const background *b)
{
    tsuya_image loaded = {0}, small = {0};
    tsuya_status status;
    TSUYA_GOTO_DONE(status, tsuya_image_load(&loaded, photo->path));
    TSUYA_GOTO_DONE(status, tsuya_image_resize(&small, &loaded, b->width_px, b->height_px));
    tsuya_image_free(&loaded);
    TSUYA_GOTO_DONE(status, tsuya_image_convert(&loaded, &small, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    for (size_t i = 0; i < pixels_of(b); i++) {
        const uint8_t *p = tsuya_image_u8(&loaded, (int)(i % (size_t)b->width_px), (int)(i / (size_t)b->width_px));
        for (int c = 0; c < 3; c++) {
            rgb[3 * i + (size_t)c] = p[loaded.channels >= 3 ? c : 0];
        }
    }
done:
    tsuya_image_free(&loaded);
    tsuya_image_free(&small);
    return status;
}

/* The fullest window of ALIKE in luma, the darkest of equals; returns how many lie in it. */
static int fullest_window(int *low, int *sorted, int count)
{
    const int wide = (int)(ALIKE * LUMA_MOST);
    int most = 0;
    tsuya_sort_ints(sorted, (size_t)count);
    for (int first = 0, end = 0; first < count; first++) {
        while (end < count && sorted[end] <= sorted[first] + wide) {
            end++;
        }
        if (end - first > most) {
            most = end - first;
            *low = sorted[first];
        }
    }
    return most;
}

static void model_pixel(background *b, size_t at)
{
    int value[SAMPLE], low = 0;
    for (int i = 0; i < b->count; i++) {
        value[i] = luma(b->photo + 3 * ((size_t)i * pixels_of(b) + at));
    }
    b->support[at] = (uint8_t)fullest_window(&low, value, b->count);
    for (size_t c = 0; c < 3; c++) {
        int n = 0;
        for (int i = 0; i < b->count; i++) {
            const uint8_t *p = b->photo + 3 * ((size_t)i * pixels_of(b) + at);
            if (luma(p) >= low && luma(p) <= low + (int)(ALIKE * LUMA_MOST)) {
                value[n++] = p[c];
            }
        }
        tsuya_sort_ints(value, (size_t)n);
        b->color[3 * at + c] = (uint8_t)value[n / 2];
    }
}

static bool on_border(const background *b, size_t at)
{
    size_t w = (size_t)b->width_px, x = at % w, y = at / w;
    return x == 0 || y == 0 || x + 1 == w || y + 1 == (size_t)b->height_px;
}

/* The square of REACH around a pixel, as far as it lies in the picture. */
static int neighbourhood(size_t near[NEAR], const background *b, size_t at)
{
    const int w = b->width_px, x = (int)(at % (size_t)w), y = (int)(at / (size_t)w);
    int n = 0;
    for (int v = y - REACH > 0 ? y - REACH : 0; v <= y + REACH && v < b->height_px; v++) {
        for (int u = x - REACH > 0 ? x - REACH : 0; u <= x + REACH && u < w; u++) {
            near[n++] = (size_t)v * (size_t)w + (size_t)u;
        }
    }
    return n;
}

/* Half of the photographs, or a quarter where there is contrast all around: a bare object may agree with itself as it turns,
 * its texture does not. */
static void mark_trusted(background *b)
{
    for (size_t i = 0; i < pixels_of(b); i++) {
        size_t near[NEAR];
        int low = LUMA_MOST, high = 0;
        for (int n = neighbourhood(near, b, i); n > 0; n--) {
            int value = luma(b->color + 3 * near[n - 1]);
            low = value < low ? value : low;
            high = value > high ? value : high;
        }
        b->trusted[i] = (double)b->support[i] >= (high - low > 2.0 * ALIKE * LUMA_MOST ? QUARTER : MAJORITY) * b->count;
    }
}

static double border_share(const background *b)
{
    size_t border = 0, agreed = 0;
    for (size_t i = 0; i < pixels_of(b); i++) {
        border += on_border(b, i);
        agreed += on_border(b, i) && (double)b->support[i] >= AGREE * b->count;
    }
    return (double)agreed / (double)border;
}

static tsuya_status make_model(background *b, const tsuya_photo_set *photos, const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    const tsuya_photo *first = &photos->photo[0];
    int longer = first->width_px > first->height_px ? first->width_px : first->height_px, side = longer < LONG_SIDE_PX ? longer : LONG_SIDE_PX;
    b->width_px = (int)((int64_t)first->width_px * side / longer);
    b->height_px = (int)((int64_t)first->height_px * side / longer);
    b->width_px += b->width_px == 0;
    b->height_px += b->height_px == 0;
    b->count = photos->count < SAMPLE ? photos->count : SAMPLE;
    TSUYA_NEW(status, b->photo, 3 * (size_t)b->count * pixels_of(b));
    TSUYA_NEW(status, b->color, 3 * pixels_of(b));
    TSUYA_NEW(status, b->support, pixels_of(b));
    TSUYA_NEW(status, b->trusted, pixels_of(b));
    for (int i = 0; i < b->count; i++) {
        int at = (int)((int64_t)i * photos->count / b->count);
        TSUYA_GOTO_DONE(status, tsuya_check_interrupt());
        TSUYA_GOTO_DONE(status, load_small(b->photo + 3 * (size_t)i * pixels_of(b), &photos->photo[at], b));
    }
#pragma omp parallel for schedule(static) num_threads(context->threads)
    for (size_t at = 0; at < pixels_of(b); at++) {
        model_pixel(b, at);
    }
    mark_trusted(b);
done:
    return status;
}

/* ---- one photograph ---- */

static void mark_static(uint8_t *flag, const uint8_t *photo, const background *b)
{
    for (size_t i = 0; i < pixels_of(b); i++) {
        bool alike = true;
        for (size_t c = 0; c < 3; c++) {
            alike &= abs(photo[3 * i + c] - b->color[3 * i + c]) <= ALIKE * 255.0;
        }
        flag[i] = alike ? SAME : 0;
    }
    for (size_t i = 0; i < pixels_of(b); i++) {
        size_t near[NEAR];
        bool all = true;
        for (int n = neighbourhood(near, b, i); all && n > 0; n--) {
            all = flag[near[n - 1]] & SAME;
        }
        flag[i] |= all ? STATIC : 0;
    }
}

static int neighbours(size_t out[4], const background *b, size_t at)
{
    size_t w = (size_t)b->width_px, x = at % w, y = at / w;
    int n = 0;
    if (x > 0) {
        out[n++] = at - 1;
    }
    if (x + 1 < w) {
        out[n++] = at + 1;
    }
    if (y > 0) {
        out[n++] = at - w;
    }
    if (y + 1 < (size_t)b->height_px) {
        out[n++] = at + w;
    }
    return n;
}

static bool continues(const background *b, size_t from, size_t to)
{
    return b->trusted[to] || abs(luma(b->color + 3 * to) - luma(b->color + 3 * from)) <= STEP * LUMA_MOST;
}

static void flood_from_border(uint8_t *flag, size_t *stack, const background *b)
{
    size_t count = 0, next[4];
    for (size_t i = 0; i < pixels_of(b); i++) {
        if (on_border(b, i) && flag[i] & STATIC && b->trusted[i]) {
            flag[i] |= BACKGROUND;
            stack[count++] = i;
        }
    }
    for (size_t done = 0; done < count; done++) {
        int n = neighbours(next, b, stack[done]);
        for (int k = 0; k < n; k++) {
            if ((flag[next[k]] & (STATIC | BACKGROUND)) == STATIC && continues(b, stack[done], next[k])) {
                flag[next[k]] |= BACKGROUND;
                stack[count++] = next[k];
            }
        }
    }
}

/* The connected part that holds `start`, of what is not background; `mark` is set on it. */
static size_t gather(uint8_t *flag, size_t *stack, const background *b, size_t start, uint8_t mark)
{
    size_t count = 1, next[4];
    stack[0] = start;
    flag[start] |= mark;
    for (size_t done = 0; done < count; done++) {
        int n = neighbours(next, b, stack[done]);
        for (int k = 0; k < n; k++) {
            if (!(flag[next[k]] & (BACKGROUND | mark))) {
                flag[next[k]] |= mark;
                stack[count++] = next[k];
            }
        }
    }
    return count;
}

/* Specks become background, too. */
static void drop_specks(uint8_t *flag, size_t *stack, const background *b)
{
    size_t largest = 0;
    for (int pass = 0; pass < 2; pass++) {
        const uint8_t mark = pass == 0 ? SEEN : TWICE;
        for (size_t i = 0; i < pixels_of(b); i++) {
            if (flag[i] & (BACKGROUND | mark)) {
                continue;
            }
            size_t count = gather(flag, stack, b, i, mark);
            largest = pass == 0 && count > largest ? count : largest;
            for (size_t k = 0; pass == 1 && (double)count < LEAST_COMPONENT * (double)largest && k < count; k++) {
                flag[stack[k]] |= BACKGROUND;
            }
        }
    }
}

/* At the photograph's size; where nothing would be kept, all is. */
static tsuya_status write_mask(double *masked, const char *folder, const tsuya_photo *photo, const uint8_t *flag, const background *b)
{
    tsuya_image mask = {0};
    size_t kept = 0;
    TSUYA_TRY(tsuya_image_create(&mask, photo->width_px, photo->height_px, 1, TSUYA_SAMPLE_U8, TSUYA_ENCODING_DATA));
    for (size_t i = 0; i < pixels_of(b); i++) {
        kept += !(flag[i] & BACKGROUND);
    }
    for (int y = 0; y < mask.height_px; y++) {
        for (int x = 0; x < mask.width_px; x++) {
            int u = (int)((int64_t)x * b->width_px / mask.width_px), v = (int)((int64_t)y * b->height_px / mask.height_px);
            *tsuya_image_u8(&mask, x, y) = kept == 0 || !(flag[v * b->width_px + u] & BACKGROUND) ? 255 : 0;
        }
    }
    *masked += kept > 0 ? 1.0 - (double)kept / (double)pixels_of(b) : 0.0;
    char name[1024];
    snprintf(name, sizeof name, "%s.png", photo->name);
    char *path = tsuya_path_join(folder, name);
    tsuya_status status = path ? tsuya_image_save(&mask, path, NULL) : TSUYA_ERROR_MEMORY;
    tsuya_free(path);
    tsuya_image_free(&mask);
    return status;
}

static tsuya_status make_masks(double *masked, background *b, const tsuya_photo_set *photos, const char *folder, const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    uint8_t *flag = NULL;
    size_t *stack = NULL;
    TSUYA_NEW(status, flag, pixels_of(b));
    TSUYA_NEW(status, stack, pixels_of(b));
    TSUYA_GOTO_DONE(status, tsuya_folder_make(folder));
    for (int i = 0; i < photos->count; i++) {
        TSUYA_GOTO_DONE(status, tsuya_check_interrupt());
        TSUYA_GOTO_DONE(status, load_small(b->photo, &photos->photo[i], b)); /* the model is made; its photographs may go */
        mark_static(flag, b->photo, b);
        flood_from_border(flag, stack, b);
        drop_specks(flag, stack, b);
        TSUYA_GOTO_DONE(status, write_mask(masked, folder, &photos->photo[i], flag, b));
        tsuya_progress_update(context, "background", i + 1.0, photos->count, photos->photo[i].name);
    }
    *masked /= photos->count;
done:
    tsuya_free(flag);
    tsuya_free(stack);
    return status;
}

tsuya_status tsuya_background_masks(tsuya_background_info *info, const tsuya_photo_set *photos, const char *folder, const tsuya_context *context)
{
    background b = {0};
    tsuya_status status = TSUYA_OK;
    *info = (tsuya_background_info){0};
    if (photos->count < LEAST_PHOTOS) {
        return TSUYA_OK;
    }
    TSUYA_GOTO_DONE(status, make_model(&b, photos, context));
    info->border = border_share(&b);
    info->found = info->border >= AGREE;
    if (info->found) {
        status = make_masks(&info->masked, &b, photos, folder, context);
    }
done:
    tsuya_free(b.photo);
    tsuya_free(b.color);
    tsuya_free(b.support);
    tsuya_free(b.trusted);
    return status;
}
