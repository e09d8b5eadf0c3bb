/* How wide are the edges?
 *
 * A step edge blurred by a Gaussian σ and then smoothed by σ1 has the gradient a / sqrt(2π (σ² + σ1²)) on its crest.  Two
 * smoothings give a ratio R of gradients that does not know the edge's contrast (Zhuo & Sim, "Defocus map estimation from a
 * single image", Pattern Recognition 44, 2011):
 *
 *     σ² = (σ2² − R² σ1²) / (R² − 1)
 *
 * Soft edges of the object itself only widen this, so only the strongest edges are asked.  A moving
 * camera widens the edges across its path alone, so directions are kept apart.  The edge of a box of length L has a flat crest, which counts as
 * more than its standard deviation L/√12: 4 px read 1.4, 6 px 2.6, 8 px 4.4. */
#include "capture/check.h"

#include "core/memory.h"
#include "core/order.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

static const double SIGMA_1 = 0.8, SIGMA_2 = 2.4;
static const double DIFFERENCE = 1.0 / 3.0; /* variance of the box that a central difference over two pixels is, px² */
static const double SHARP_SHARE = 0.5;    /* of the edges of a direction */
static const float STRONG = 0.6f;         /* of the 98th percentile of the gradients on edges */
static const float NOISE_FACTOR = 6.0f;
enum { FEWEST_EDGES = 60, RADIUS_MOST = 16, MOST_EDGES = 40000 };

typedef struct plane {
    int width, height;
    float *value;
} plane;

static int kernel_of(float kernel[2 * RADIUS_MOST + 1], double sigma)
{
    int radius = (int)ceil(3.5 * sigma);
    double sum = 0.0;
    for (int k = -radius; k <= radius; k++) {
        sum += exp(-0.5 * k * k / (sigma * sigma));
    }
    for (int k = -radius; k <= radius; k++) {
        kernel[k + radius] = (float)(exp(-0.5 * k * k / (sigma * sigma)) / sum);
    }
    return radius;
}

static int clamp(int i, int n) { return i < 0 ? 0 : i >= n ? n - 1 : i; }

/* Rows, then columns; edges repeat. */
static void smooth(plane *out, plane *scratch, const plane *in, double sigma, int threads)
{
    float kernel[2 * RADIUS_MOST + 1];
    int radius = kernel_of(kernel, sigma), width = in->width, height = in->height;
#pragma omp parallel for schedule(static) num_threads(threads)
    for (int y = 0; y < height; y++) {
        const float *row = in->value + (size_t)y * (size_t)width;
        float *to = scratch->value + (size_t)y * (size_t)width;
        for (int x = 0; x < width; x++) {
            float sum = 0.0f;
            if (x >= radius && x < width - radius) {
                for (int k = -radius; k <= radius; k++) {
                    sum += kernel[k + radius] * row[x + k];
                }
            } else {
                for (int k = -radius; k <= radius; k++) {
                    sum += kernel[k + radius] * row[clamp(x + k, width)];
                }
            }
            to[x] = sum;
        }
    }
#pragma omp parallel for schedule(static) num_threads(threads)
    for (int y = 0; y < height; y++) {
        float *to = out->value + (size_t)y * (size_t)width;
        memset(to, 0, (size_t)width * sizeof *to);
        for (int k = -radius; k <= radius; k++) {
            const float *row = scratch->value + (size_t)clamp(y + k, height) * (size_t)width;
            float weight = kernel[k + radius];
            for (int x = 0; x < width; x++) {
                to[x] += weight * row[x];
            }
        }
    }
}

static void gradient(const plane *p, int x, int y, float *gx, float *gy)
{
    const float *v = p->value + (size_t)y * (size_t)p->width + (size_t)x;
    *gx = 0.5f * (v[1] - v[-1]);
    *gy = 0.5f * (v[p->width] - v[-p->width]);
}

static float magnitude(const plane *p, int x, int y)
{
    float gx, gy;
    gradient(p, x, y, &gx, &gy);
    return hypotf(gx, gy);
}

typedef struct edge {
    float strength;     /* gradient at SIGMA_1 */
    float sigma2;       /* blur squared */
    uint8_t direction;
} edge;

/* A crest: no neighbour across the edge is steeper. */
static bool is_crest(const plane *p, int x, int y, float gx, float gy, float size)
{
    int dx = fabsf(gx) > 0.4142f * fabsf(gy) ? (gx > 0 ? 1 : -1) : 0, dy = fabsf(gy) > 0.4142f * fabsf(gx) ? (gy > 0 ? 1 : -1) : 0;
    return magnitude(p, x + dx, y + dy) <= size && magnitude(p, x - dx, y - dy) < size;
}

static bool inside(const tsuya_image *mask, int x, int y, int margin)
{
    return !mask || (*tsuya_image_u8(mask, x - margin, y) > 127 && *tsuya_image_u8(mask, x + margin, y) > 127 &&
                     *tsuya_image_u8(mask, x, y - margin) > 127 && *tsuya_image_u8(mask, x, y + margin) > 127);
}

static bool edge_at(edge *e, const plane *fine, const plane *coarse, int x, int y, float threshold)
{
    float gx, gy, cx, cy;
    gradient(fine, x, y, &gx, &gy);
    float size = hypotf(gx, gy);
    if (size < threshold || !is_crest(fine, x, y, gx, gy, size)) {
        return false;
    }
    gradient(coarse, x, y, &cx, &cy);
    float along = (gx * cx + gy * cy) / size; /* in the fine gradient's direction */
    double ratio = along > 0.0f ? (double)(size / along) : 1e6;
    double r2 = ratio * ratio;
    if (r2 <= 1.0 + 1e-3) {
        return false; /* no edge that smoothing would lower */
    }
    double fine2 = SIGMA_1 * SIGMA_1 + DIFFERENCE, coarse2 = SIGMA_2 * SIGMA_2 + DIFFERENCE;
    double sigma2 = (coarse2 - r2 * fine2) / (r2 - 1.0);
    double angle = atan2((double)gy, (double)gx);
    int direction = (int)lround(angle / (M_PI / TSUYA_BLUR_DIRECTIONS));
    *e = (edge){size, (float)fmax(sigma2, 0.0), (uint8_t)((direction % TSUYA_BLUR_DIRECTIONS + TSUYA_BLUR_DIRECTIONS) % TSUYA_BLUR_DIRECTIONS)};
    return true;
}

static int stronger(const void *a, const void *b)
{
    const edge *x = a, *y = b;
    if (x->strength != y->strength) {
        return x->strength < y->strength ? 1 : -1;
    }
    return (x->sigma2 > y->sigma2) - (x->sigma2 < y->sigma2);
}

/* Standard deviation of the noise from second differences of rows (Immerkær 1996), the median so that texture counts little. */
static float noise_of(const plane *p, float *scratch, size_t room)
{
    size_t count = 0;
    size_t step = (size_t)p->width * (size_t)p->height / room + 1, pixels = (size_t)p->width * (size_t)p->height;
    for (size_t i = (size_t)p->width + 1; i + (size_t)p->width + 1 < pixels && count < room; i += step) {
        const float *v = p->value + i;
        ptrdiff_t w = p->width;
        float d = v[-w - 1] - 2 * v[-w] + v[-w + 1] - 2 * v[-1] + 4 * v[0] - 2 * v[1] + v[w - 1] - 2 * v[w] + v[w + 1];
        scratch[count++] = fabsf(d);
    }
    tsuya_sort_floats(scratch, count);
    return count > 0 ? 1.4826f * scratch[count / 2] / 6.0f : 0.0f;
}

static void summarise(tsuya_blur *blur, const edge *found, size_t count, float *scratch)
{
    blur->best_px = blur->worst_px = NAN;
    for (int d = 0; d < TSUYA_BLUR_DIRECTIONS; d++) {
        int n = 0;
        for (size_t i = 0; i < count; i++) {
            if (found[i].direction == d) {
                scratch[n++] = found[i].sigma2;
            }
        }
        tsuya_sort_floats(scratch, (size_t)n);
        blur->edges[d] = n;
        blur->sigma_px[d] = n < FEWEST_EDGES ? NAN : sqrt((double)scratch[(int)(SHARP_SHARE * n)]);
        blur->best_px = fmin(blur->best_px, blur->sigma_px[d]);
        blur->worst_px = fmax(blur->worst_px, blur->sigma_px[d]);
    }
}

/* Edges above the threshold, at most `room`; the rows' order. */
static size_t gather(edge *found, size_t room, const plane *fine, const plane *coarse, const tsuya_image *mask, float threshold)
{
    enum { MARGIN = 6 };
    size_t count = 0;
    for (int y = MARGIN; y < fine->height - MARGIN; y++) {
        for (int x = MARGIN; x < fine->width - MARGIN; x++) {
            edge e;
            if (inside(mask, x, y, MARGIN) && edge_at(&e, fine, coarse, x, y, threshold) && count < room) {
                found[count++] = e;
            }
        }
    }
    return count;
}

static tsuya_status to_plane(plane *p, const tsuya_image *grey)
{
    *p = (plane){.width = grey->width_px, .height = grey->height_px};
    p->value = tsuya_calloc((size_t)p->width * (size_t)p->height, sizeof *p->value);
    if (!p->value) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int y = 0; y < p->height; y++) {
        for (int x = 0; x < p->width; x++) {
            p->value[(size_t)y * (size_t)p->width + (size_t)x] = tsuya_image_get(grey, x, y, 0);
        }
    }
    return TSUYA_OK;
}

tsuya_status tsuya_blur_measure(tsuya_blur *blur, const tsuya_image *grey, const tsuya_image *mask, const tsuya_context *context)
{
    enum { ROOM = 1 << 21 };
    *blur = (tsuya_blur){.best_px = NAN, .worst_px = NAN};
    for (int d = 0; d < TSUYA_BLUR_DIRECTIONS; d++) {
        blur->sigma_px[d] = NAN;
    }
    if (grey->width_px < 32 || grey->height_px < 32) {
        return TSUYA_OK;
    }
    plane source = {0}, fine = {0}, coarse = {0}, scratch = {0};
    edge *found = NULL;
    float *list = NULL;
    tsuya_status status;
    TSUYA_GOTO_DONE(status, to_plane(&source, grey));
    size_t pixels = (size_t)source.width * (size_t)source.height;
    fine = coarse = scratch = source;
    fine.value = coarse.value = scratch.value = NULL;
    TSUYA_NEW(status, fine.value, pixels);
    TSUYA_NEW(status, coarse.value, pixels);
    TSUYA_NEW(status, scratch.value, pixels);
    TSUYA_NEW(status, found, ROOM);
    TSUYA_NEW(status, list, ROOM);
    smooth(&fine, &scratch, &source, SIGMA_1, context->threads);
    smooth(&coarse, &scratch, &source, SIGMA_2, context->threads);
    float noise = noise_of(&source, list, 1 << 18);
    /* white noise of σ leaves σ / (sqrt(8π) s²) in the gradient after smoothing by s */
    float floor_gradient = NOISE_FACTOR * noise / (float)(sqrt(8.0 * M_PI) * SIGMA_1 * SIGMA_1);
    size_t count = gather(found, ROOM, &fine, &coarse, mask, fmaxf(floor_gradient, 0.004f));
    qsort(found, count, sizeof *found, stronger);
    float strong = count > 0 ? STRONG * found[count / 50].strength : 0.0f;
    while (count > 0 && (found[count - 1].strength < strong || count > MOST_EDGES)) {
        count--;
    }
    summarise(blur, found, count, list);
done:
    tsuya_free(source.value);
    tsuya_free(fine.value);
    tsuya_free(coarse.value);
    tsuya_free(scratch.value);
    tsuya_free(found);
    tsuya_free(list);
    return status;
}
