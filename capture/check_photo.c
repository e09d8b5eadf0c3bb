/* One photograph alone: edges, clipping, levels, features with their colours. */
#include "capture/check_photo.h"

#include "core/memory.h"

#include <math.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

enum { CLIPPED_HIGH = 254, CLIPPED_LOW = 1, PATCH = 2, PATCH_MOST = 20 };
static const double FOCAL_ASSUMED = 1.0; /* of the longer side: 36 mm equivalent, between telephones and normal lenses */

void tsuya_check_fault(tsuya_checked_photo *photo, const char *format, ...)
{
    if (photo->fault_count == TSUYA_CHECK_FAULTS) {
        return;
    }
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(photo->fault[photo->fault_count++], sizeof photo->fault[0], format, arguments);
    va_end(arguments);
}

void tsuya_check_sight_free(tsuya_check_sight *sight)
{
    if (sight->features) {
        tsuya_features_free(sight->features);
    }
    tsuya_free(sight->color);
    *sight = (tsuya_check_sight){0};
}

/* The mask as one channel of the photograph's size, or an empty image where there is none. */
static tsuya_status load_mask(tsuya_image *mask, const tsuya_checked_photo *p)
{
    tsuya_image loaded = {0};
    *mask = (tsuya_image){0};
    if (!p->photo.mask_path) {
        return TSUYA_OK;
    }
    TSUYA_TRY(tsuya_image_load(&loaded, p->photo.mask_path));
    tsuya_status status;
    if (loaded.width_px != p->photo.width_px || loaded.height_px != p->photo.height_px) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "%s: %d x %d pixels, its photograph has %d x %d; masks of the same size are accepted",
                            p->photo.mask_path, loaded.width_px, loaded.height_px, p->photo.width_px, p->photo.height_px);
    } else {
        status = tsuya_image_grey(mask, &loaded, TSUYA_SAMPLE_U8);
    }
    tsuya_image_free(&loaded);
    return status;
}

static void count_levels(tsuya_checked_photo *p, const tsuya_image *rgb, const tsuya_image *mask, int threads)
{
    uint64_t count[3][256] = {{0}};
    int green = rgb->channels >= 3 ? 1 : 0, blue = rgb->channels >= 3 ? 2 : 0;
#pragma omp parallel for schedule(static) num_threads(threads) reduction(+ : count)
    for (int y = 0; y < rgb->height_px; y++) {
        const uint8_t *v = tsuya_image_u8(rgb, 0, y), *kept = mask->data ? tsuya_image_u8(mask, 0, y) : NULL;
        for (int x = 0; x < rgb->width_px; x++, v += rgb->channels) {
            if (!kept || kept[x] > 127) {
                count[0][v[0]]++;
                count[1][v[green]]++;
                count[2][v[blue]]++;
            }
        }
    }
    uint64_t pixels = 0;
    for (int k = 0; k < 256; k++) {
        pixels += count[0][k];
    }
    for (int c = 0; c < 3; c++) {
        p->level[c] = p->bright_clipped[c] = p->dark_clipped[c] = 0.0;
        for (int k = 0; k < 256 && pixels > 0; k++) {
            double share = (double)count[c][k] / (double)pixels;
            p->level[c] += share * (double)tsuya_srgb_decode((float)k / 255.0f);
            p->bright_clipped[c] += k >= CLIPPED_HIGH ? share : 0.0;
            p->dark_clipped[c] += k <= CLIPPED_LOW ? share : 0.0;
        }
    }
}

/* Over the piece of surface that the feature describes: from near and from far the same. */
static void color_around(float color[3], const tsuya_image *rgb, const float light[256], double x_px, double y_px, double radius_px)
{
    int n = 0, cx = (int)lround(x_px), cy = (int)lround(y_px), reach = (int)lround(fmin(fmax(radius_px, PATCH), PATCH_MOST));
    color[0] = color[1] = color[2] = 0.0f;
    for (int y = cy - reach; y <= cy + reach; y++) {
        for (int x = cx - reach; x <= cx + reach; x++) {
            if (x < 0 || y < 0 || x >= rgb->width_px || y >= rgb->height_px) {
                continue;
            }
            for (int c = 0; c < 3; c++) {
                color[c] += light[tsuya_image_u8(rgb, x, y)[rgb->channels >= 3 ? c : 0]];
            }
            n++;
        }
    }
    for (int c = 0; c < 3 && n > 0; c++) {
        color[c] /= (float)n;
    }
}

/* The ray through the middle of what the mask keeps. */
static void set_gaze(const tsuya_checked_photo *p, tsuya_check_sight *sight, const tsuya_image *mask, int width, int height)
{
    double focal = tsuya_photo_focal_px(&p->photo) * sight->work_scale, x = 0.0, y = 0.0, n = 0.0;
    sight->assumed = !(focal > 0.0);
    sight->focal_px = sight->assumed ? FOCAL_ASSUMED * sight->work_long_side_px : focal;
    sight->middle = (tsuya_vec2){0.5 * (width - 1), 0.5 * (height - 1)};
    for (int j = 0; mask->data && j < height; j++) {
        for (int i = 0; i < width; i++) {
            double kept = *tsuya_image_u8(mask, i, j) > 127 ? 1.0 : 0.0;
            x += kept * i;
            y += kept * j;
            n += kept;
        }
    }
    tsuya_vec2 at = n > 0.0 ? (tsuya_vec2){x / n, y / n} : sight->middle;
    sight->towards = tsuya_vec3_unit((tsuya_vec3){(at.x - sight->middle.x) / sight->focal_px, (at.y - sight->middle.y) / sight->focal_px, 1.0});
}

static tsuya_status find_features(tsuya_checked_photo *p, tsuya_check_sight *sight, const tsuya_image *rgb, const tsuya_image *mask,
                                  const tsuya_check_options *options, const tsuya_context *context)
{
    tsuya_image small = {0}, grey = {0}, small_mask = {0};
    tsuya_status status;
    int longer = rgb->width_px > rgb->height_px ? rgb->width_px : rgb->height_px;
    sight->work_scale = fmin(1.0, (double)options->features_long_side_px / longer);
    int width = (int)fmax(1.0, round(rgb->width_px * sight->work_scale)), height = (int)fmax(1.0, round(rgb->height_px * sight->work_scale));
    sight->work_long_side_px = width > height ? width : height;
    TSUYA_GOTO_DONE(status, tsuya_image_resize(&small, rgb, width, height));
    TSUYA_GOTO_DONE(status, tsuya_image_grey(&grey, &small, TSUYA_SAMPLE_U8));
    if (mask->data) {
        TSUYA_GOTO_DONE(status, tsuya_image_resize(&small_mask, mask, width, height));
        for (int y = 0; y < height; y++) { /* what the reduction made grey lies on the border */
            for (int x = 0; x < width; x++) {
                uint8_t *m = tsuya_image_u8(&small_mask, x, y);
                *m = *m > 250 ? 255 : 0;
            }
        }
    }
    set_gaze(p, sight, &small_mask, width, height);
    TSUYA_GOTO_DONE(status, tsuya_features_find(&sight->features, &grey, mask->data ? &small_mask : NULL, options->features, context->threads));
    p->features = tsuya_features_count(sight->features);
    TSUYA_NEW(status, sight->color, 3 * (size_t)p->features);
    float light[256];
    for (int k = 0; k < 256; k++) {
        light[k] = tsuya_srgb_decode((float)k / 255.0f);
    }
    for (int i = 0; i < p->features; i++) {
        double x, y;
        tsuya_features_place(sight->features, i, &x, &y);
        color_around(sight->color + 3 * i, &small, light, x, y, tsuya_features_radius(sight->features, i));
    }
done:
    tsuya_image_free(&small);
    tsuya_image_free(&grey);
    tsuya_image_free(&small_mask);
    return status;
}

static tsuya_status measure(tsuya_checked_photo *p, tsuya_check_sight *sight, const tsuya_image *loaded, const tsuya_check_options *options,
                            const tsuya_context *context)
{
    tsuya_image converted = {0}, grey = {0}, mask = {0};
    const tsuya_image *rgb = loaded;
    tsuya_status status;
    if (loaded->sample != TSUYA_SAMPLE_U8 || loaded->encoding != TSUYA_ENCODING_SRGB) {
        TSUYA_GOTO_DONE(status, tsuya_image_convert(&converted, loaded, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
        rgb = &converted;
    }
    TSUYA_GOTO_DONE(status, load_mask(&mask, p));
    count_levels(p, rgb, &mask, context->threads);
    TSUYA_GOTO_DONE(status, tsuya_image_grey(&grey, rgb, TSUYA_SAMPLE_U8));
    TSUYA_GOTO_DONE(status, tsuya_blur_measure(&p->blur, &grey, mask.data ? &mask : NULL, context));
    TSUYA_GOTO_DONE(status, find_features(p, sight, rgb, &mask, options, context));
done:
    tsuya_image_free(&converted);
    tsuya_image_free(&grey);
    tsuya_image_free(&mask);
    return status;
}

tsuya_status tsuya_check_photo(tsuya_checked_photo *p, tsuya_check_sight *sight, const tsuya_board *target, const tsuya_check_options *options,
                               const tsuya_context *context)
{
    tsuya_image loaded = {0};
    tsuya_status status = p->readable ? tsuya_image_load(&loaded, p->photo.path) : TSUYA_ERROR_INPUT;
    if (status != TSUYA_OK) {
        if (status == TSUYA_ERROR_MEMORY) {
            return status;
        }
        p->readable = false;
        tsuya_check_fault(p, "cannot be read: %.120s", tsuya_reason());
        return TSUYA_OK;
    }
    status = measure(p, sight, &loaded, options, context);
    status = status == TSUYA_OK && target ? tsuya_check_tags(p, target, &loaded) : status;
    tsuya_image_free(&loaded);
    return status;
}
