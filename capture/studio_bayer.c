/* A colour filter mosaic (RGGB) and its interpolation: gradient-corrected linear (H. S. Malvar, L. He, R. Cutler, "High-Quality
 * Linear Interpolation for Demosaicing of Bayer-Patterned Color Images", ICASSP 2004). */
#include "capture/studio_sensor.h"

#include <string.h>

int tsuya_studio_bayer_channel(int x, int y) { return y % 2 == 0 ? (x % 2 == 0 ? 0 : 1) : (x % 2 == 0 ? 1 : 2); }

/* Eighths, rows from the top. */
static const float GREEN[25] = {0, 0, -1, 0, 0, 0, 0, 2, 0, 0, -1, 2, 4, 2, -1, 0, 0, 2, 0, 0, 0, 0, -1, 0, 0};
static const float ROW[25] = {0, 0, 0.5f, 0, 0, 0, -1, 0, -1, 0, -1, 4, 5, 4, -1, 0, -1, 0, -1, 0, 0, 0, 0.5f, 0, 0};
static const float COLUMN[25] = {0, 0, -1, 0, 0, 0, -1, 4, -1, 0, 0.5f, 0, 5, 0, 0.5f, 0, -1, 4, -1, 0, 0, 0, -1, 0, 0};
static const float CORNER[25] = {0, 0, -1.5f, 0, 0, 0, 2, 0, 2, 0, -1.5f, 0, 6, 0, -1.5f, 0, 2, 0, 2, 0, 0, 0, -1.5f, 0, 0};

/* Mirrored about the outermost pixels, which keeps the colours' places. */
static int mirrored(int i, int n) { return i < 0 ? -i : i >= n ? 2 * n - 2 - i : i; }

static float filtered(const float *mosaic, int width, int height, int x, int y, const float kernel[25])
{
    float sum = 0.0f;
    for (int j = 0; j < 5; j++) {
        const float *row = mosaic + (size_t)mirrored(y + j - 2, height) * (size_t)width;
        for (int i = 0; i < 5; i++) {
            sum += kernel[5 * j + i] * row[mirrored(x + i - 2, width)];
        }
    }
    return sum / 8.0f;
}

void tsuya_studio_demosaic(float rgb[3], const float *mosaic, int width, int height, int x, int y)
{
    int own = tsuya_studio_bayer_channel(x, y), beside = tsuya_studio_bayer_channel(x + 1, y);
    rgb[own] = mosaic[(size_t)y * (size_t)width + (size_t)x];
    if (own == 1) {
        rgb[beside] = filtered(mosaic, width, height, x, y, ROW);
        rgb[2 - beside] = filtered(mosaic, width, height, x, y, COLUMN);
    } else {
        rgb[1] = filtered(mosaic, width, height, x, y, GREEN);
        rgb[2 - own] = filtered(mosaic, width, height, x, y, CORNER);
    }
}
