#include "app/calib_light.h"

enum { PANEL = 320, RIM = 6 };

/* Blue, white, red for −1, 0, 1. */
static void two_sided(uint8_t rgb[3], double t)
{
    static const double low[3] = {33, 102, 172}, high[3] = {178, 24, 43};
    double s = fmin(fabs(t), 1.0);
    for (int c = 0; c < 3; c++) {
        rgb[c] = (uint8_t)lround((1.0 - s) * 247.0 + s * (t < 0.0 ? low[c] : high[c]));
    }
}

static void fill(tsuya_image *picture, int x0, int y0, int x1, int y1, const uint8_t rgb[3])
{
    for (int y = y0 < 0 ? 0 : y0; y < y1 && y < picture->height_px; y++) {
        for (int x = x0 < 0 ? 0 : x0; x < x1 && x < picture->width_px; x++) {
            for (int c = 0; c < 3; c++) {
                tsuya_image_u8(picture, x, y)[c] = rgb[c];
            }
        }
    }
}

static double residual_of(const tsuya_lamp_reading *r)
{
    double seen = r->rgb[0] + r->rgb[1] + r->rgb[2], expected = r->expected[0] + r->expected[1] + r->expected[2];
    return seen / fmax(expected, 1e-12) - 1.0;
}

tsuya_status tsuya_calib_light_picture(const char *path, const tsuya_lamp_readings *readings, const tsuya_camera *camera, double high)
{
    static const uint8_t ground[3] = {40, 40, 40}, none[3] = {120, 120, 120};
    tsuya_image picture;
    int cols = (int)ceil(sqrt(readings->photos)), rows = (readings->photos + cols - 1) / cols;
    double scale = (double)PANEL / camera->width_px;
    int tall = (int)ceil(scale * camera->height_px);
    TSUYA_TRY(tsuya_image_create(&picture, cols * (PANEL + RIM) + RIM, rows * (tall + RIM) + RIM, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    for (int k = 0; k < readings->photos; k++) {
        int x = RIM + k % cols * (PANEL + RIM), y = RIM + k / cols * (tall + RIM);
        fill(&picture, x, y, x + PANEL, y + tall, ground);
    }
    for (int i = 0; i < readings->count; i++) {
        const tsuya_lamp_reading *r = &readings->reading[i];
        uint8_t rgb[3];
        double half = fmax(0.5 * scale * r->size_px, 2.0), u = RIM + r->photo % cols * (PANEL + RIM) + scale * r->pixel.x,
               v = RIM + r->photo / cols * (tall + RIM) + scale * r->pixel.y;
        two_sided(rgb, residual_of(r) / high);
        fill(&picture, (int)(u - half), (int)(v - half), (int)(u + half) + 1, (int)(v + half) + 1, r->outlier ? none : rgb);
    }
    tsuya_status status = tsuya_image_save(&picture, path, NULL);
    tsuya_image_free(&picture);
    return status;
}
