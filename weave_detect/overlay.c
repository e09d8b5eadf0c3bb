#include "weave_detect/patches.h"

#include "core/geometry.h"

static const double WEFT_HALF = 0.42, WARP_HALF = 0.22; /* of a step */

/* Violet, blue-green, yellow: dark to light, readable without colour vision. */
static void confidence_color(double rgb[3], double t)
{
    static const double anchor[4][3] = {{120, 28, 150}, {52, 96, 200}, {30, 175, 140}, {255, 226, 40}};
    double u = 3.0 * fmin(fmax(t, 0.0), 1.0);
    int k = u >= 3.0 ? 2 : (int)u;
    for (int c = 0; c < 3; c++) {
        rgb[c] = anchor[k][c] + (u - k) * (anchor[k + 1][c] - anchor[k][c]);
    }
}

static void blend(tsuya_image *picture, int x, int y, const double rgb[3], double cover)
{
    if (x < 0 || y < 0 || x >= picture->width_px || y >= picture->height_px || cover <= 0.0) {
        return;
    }
    uint8_t *p = tsuya_image_u8(picture, x, y);
    for (int c = 0; c < 3; c++) {
        p[c] = (uint8_t)(p[c] + fmin(cover, 1.0) * (rgb[c] - p[c]) + 0.5);
    }
}

/* A line of `width_px` about its centre, its rim softened over a pixel. */
static void stroke(tsuya_image *picture, tsuya_vec2 centre, double angle_rad, double half_px, double width_px, const double rgb[3])
{
    double cx = cos(angle_rad), cy = -sin(angle_rad), reach = half_px + width_px;
    int x0 = (int)floor(centre.x - reach), x1 = (int)ceil(centre.x + reach);
    int y0 = (int)floor(centre.y - reach), y1 = (int)ceil(centre.y + reach);
    for (int y = y0; y <= y1; y++) {
        for (int x = x0; x <= x1; x++) {
            double dx = x - centre.x, dy = y - centre.y, along = fabs(dx * cx + dy * cy), across = fabs(dx * cy - dy * cx);
            double distance = along > half_px ? hypot(along - half_px, across) : across;
            blend(picture, x, y, rgb, 0.5 * width_px + 0.5 - distance);
        }
    }
}

static void pale(tsuya_image *picture, const tsuya_image *photo)
{
    for (int y = 0; y < picture->height_px; y++) {
        for (int x = 0; x < picture->width_px; x++) {
            for (int c = 0; c < 3; c++) {
                float value = tsuya_image_get(photo, x, y, photo->channels < 3 ? 0 : c);
                value = photo->encoding == TSUYA_ENCODING_LINEAR ? tsuya_srgb_encode(value) : value;
                tsuya_image_u8(picture, x, y)[c] = (uint8_t)(255.0 * (0.2 + 0.7 * fmin(fmax((double)value, 0.0), 1.0)) + 0.5);
            }
        }
    }
}

tsuya_status tsuya_patches_overlay(tsuya_image *picture, const tsuya_image *photo, const tsuya_patch_grid *grid)
{
    TSUYA_TRY(tsuya_image_create(picture, photo->width_px, photo->height_px, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    pale(picture, photo);
    double width = fmax(1.5, grid->step_px / 14.0);
    for (size_t i = 0; i < tsuya_patch_count(grid); i++) {
        const tsuya_patch *p = &grid->patch[i];
        double rgb[3];
        confidence_color(rgb, p->threads.confidence);
        tsuya_vec2 centre = {p->x_px, p->y_px};
        if (p->threads.b.seen) {
            stroke(picture, centre, p->threads.b.angle_rad, WARP_HALF * grid->step_px, 0.6 * width, rgb);
        }
        if (p->threads.a.seen) {
            stroke(picture, centre, p->threads.a.angle_rad, WEFT_HALF * grid->step_px, width, rgb);
        }
    }
    return TSUYA_OK;
}
