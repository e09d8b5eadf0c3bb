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
 * more than its standard deviation L/√12: 4 px read 1.4, 6 px 2.6, 8 px 4.4.
 *
 * The picture is taken in strips of rows, so that what a strip needs stays in the cache: full size costs little more than reading it. */
#include "capture/check.h"

#include "core/memory.h"
#include "core/order.h"

#include <math.h>
#include <string.h>

static const double SIGMA_1 = 0.8, SIGMA_2 = 2.4;
static const double DIFFERENCE = 1.0 / 3.0; /* variance of the box that a central difference over two pixels is, px² */
static const double SHARP_SHARE = 0.5;    /* of the edges of a direction */
static const float STRONG = 0.6f;         /* of the 98th percentile of the gradients on edges */
static const float NOISE_FACTOR = 6.0f;
enum { FEWEST_EDGES = 60, RADIUS_MOST = 16, MOST_EDGES = 40000, MARGIN = 6, STRIP = 96, NOISE_SAMPLES = 1 << 18 };

typedef struct edge {
    float strength;     /* gradient at SIGMA_1 */
    float sigma2;       /* blur squared */
    float gx, gy;
} edge;

typedef struct edges {
    edge *edge;
    size_t count, room;
} edges;

/* The picture and what every strip is asked. */
typedef struct job {
    const tsuya_image *grey, *mask;
    float kernel_1[2 * RADIUS_MOST + 1], kernel_2[2 * RADIUS_MOST + 1];
    int radius_1, radius_2;
    float threshold; /* of the gradient at SIGMA_1 */
} job;

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

/* Rows of one thread: the padded row that is read, rows smoothed along themselves, rows smoothed both ways, gradients squared. */
typedef struct bench {
    float *padded, *along, *fine, *coarse, *squared;
} bench;

static void read_row(float *padded, const tsuya_image *grey, int y)
{
    int width = grey->width_px;
    float *row = padded + RADIUS_MOST;
    if (grey->sample == TSUYA_SAMPLE_U8) {
        const uint8_t *v = tsuya_image_u8(grey, 0, y);
        for (int x = 0; x < width; x++) {
            row[x] = (float)v[x * grey->channels] / 255.0f;
        }
    } else {
        for (int x = 0; x < width; x++) {
            row[x] = tsuya_image_get(grey, x, y, 0);
        }
    }
    for (int k = 1; k <= RADIUS_MOST; k++) {
        row[-k] = row[0];
        row[width - 1 + k] = row[width - 1];
    }
}

static void add_row(float *to, const float *from, float weight, int width)
{
    for (int x = 0; x < width; x++) {
        to[x] += weight * from[x];
    }
}

/* Rows `first` … `end` − 1 of the picture smoothed; edges repeat. */
static void smooth(float *out, const bench *b, const tsuya_image *grey, int first, int end, const float *kernel, int radius)
{
    int width = grey->width_px, height = grey->height_px;
    size_t row = (size_t)width;
    memset(b->along, 0, row * (size_t)(end - first + 2 * radius) * sizeof *b->along);
    memset(out, 0, row * (size_t)(end - first) * sizeof *out);
    for (int y = first - radius; y < end + radius; y++) {
        read_row(b->padded, grey, clamp(y, height));
        for (int k = -radius; k <= radius; k++) {
            add_row(b->along + (size_t)(y - first + radius) * row, b->padded + RADIUS_MOST + k, kernel[k + radius], width);
        }
    }
    for (int y = 0; y < end - first; y++) {
        for (int k = 0; k <= 2 * radius; k++) {
            add_row(out + (size_t)y * row, b->along + (size_t)(y + k) * row, kernel[k], width);
        }
    }
}

static void gradient(const float *v, int width, float *gx, float *gy)
{
    *gx = 0.5f * (v[1] - v[-1]);
    *gy = 0.5f * (v[width] - v[-width]);
}

/* Of the rows `first` … `end` − 1 of `fine`, which has one more above and below. */
static void square_gradients(float *squared, const float *fine, int width, int rows)
{
    for (int y = 0; y < rows; y++) {
        const float *v = fine + (size_t)(y + 1) * (size_t)width;
        float *to = squared + (size_t)y * (size_t)width;
        to[0] = to[width - 1] = 0.0f;
        for (int x = 1; x < width - 1; x++) {
            float gx = 0.5f * (v[x + 1] - v[x - 1]), gy = 0.5f * (v[x + width] - v[x - width]);
            to[x] = gx * gx + gy * gy;
        }
    }
}

/* A crest: no neighbour across the edge is steeper. */
static bool is_crest(const float *squared, int width, float gx, float gy)
{
    int dx = fabsf(gx) > 0.4142f * fabsf(gy) ? (gx > 0 ? 1 : -1) : 0, dy = fabsf(gy) > 0.4142f * fabsf(gx) ? (gy > 0 ? 1 : -1) : 0;
    ptrdiff_t across = (ptrdiff_t)dy * width + dx;
    return squared[across] <= squared[0] && squared[-across] < squared[0];
}

static bool inside(const tsuya_image *mask, int x, int y)
{
    return !mask || (*tsuya_image_u8(mask, x - MARGIN, y) > 127 && *tsuya_image_u8(mask, x + MARGIN, y) > 127 &&
                     *tsuya_image_u8(mask, x, y - MARGIN) > 127 && *tsuya_image_u8(mask, x, y + MARGIN) > 127);
}

/* False: no edge that smoothing would lower. */
static bool edge_at(edge *e, const float *fine, const float *coarse, int width)
{
    float gx, gy, cx, cy;
    gradient(fine, width, &gx, &gy);
    gradient(coarse, width, &cx, &cy);
    float size = sqrtf(gx * gx + gy * gy), along = (gx * cx + gy * cy) / size; /* in the fine gradient's direction */
    double ratio = along > 0.0f ? (double)(size / along) : 1e6;
    double r2 = ratio * ratio, fine2 = SIGMA_1 * SIGMA_1 + DIFFERENCE, coarse2 = SIGMA_2 * SIGMA_2 + DIFFERENCE;
    if (r2 <= 1.0 + 1e-3) {
        return false;
    }
    *e = (edge){size, (float)fmax((coarse2 - r2 * fine2) / (r2 - 1.0), 0.0), gx, gy};
    return true;
}

static bool keep(edges *found, const edge *e)
{
    if (found->count == found->room) {
        edge *grown = tsuya_realloc(found->edge, 2 * found->room + 1024, sizeof *grown);
        if (!grown) {
            return false;
        }
        found->edge = grown;
        found->room = 2 * found->room + 1024;
    }
    found->edge[found->count++] = *e;
    return true;
}

/* Edges above the threshold in the rows `first` … `end` − 1; false: no memory. */
static bool search_strip(edges *found, const bench *b, const job *j, int first, int end)
{
    int width = j->grey->width_px;
    size_t row = (size_t)width;
    float least = j->threshold * j->threshold;
    smooth(b->fine, b, j->grey, first - 2, end + 2, j->kernel_1, j->radius_1);
    smooth(b->coarse, b, j->grey, first - 1, end + 1, j->kernel_2, j->radius_2);
    square_gradients(b->squared, b->fine, width, end - first + 2);
    for (int y = first; y < end; y++) {
        const float *fine = b->fine + (size_t)(y - first + 2) * row, *coarse = b->coarse + (size_t)(y - first + 1) * row;
        const float *squared = b->squared + (size_t)(y - first + 1) * row;
        for (int x = MARGIN; x < width - MARGIN; x++) {
            if (squared[x] < least) {
                continue;
            }
            float gx, gy;
            edge e;
            gradient(fine + x, width, &gx, &gy);
            if (is_crest(squared + x, width, gx, gy) && inside(j->mask, x, y) && edge_at(&e, fine + x, coarse + x, width) && !keep(found, &e)) {
                return false;
            }
        }
    }
    return true;
}

static bool bench_open(bench *b, int width)
{
    size_t row = (size_t)width;
    b->padded = tsuya_calloc(row + 2 * RADIUS_MOST, sizeof *b->padded);
    b->along = tsuya_calloc(row * (STRIP + 4 + 2 * RADIUS_MOST), sizeof *b->along);
    b->fine = tsuya_calloc(row * (STRIP + 4), sizeof *b->fine);
    b->coarse = tsuya_calloc(row * (STRIP + 4), sizeof *b->coarse);
    b->squared = tsuya_calloc(row * (STRIP + 4), sizeof *b->squared);
    return b->padded && b->along && b->fine && b->coarse && b->squared;
}

static void bench_close(bench *b)
{
    tsuya_free(b->padded);
    tsuya_free(b->along);
    tsuya_free(b->fine);
    tsuya_free(b->coarse);
    tsuya_free(b->squared);
}

/* One list of edges a strip. */
static tsuya_status search(edges *found, int strips, const job *j, const tsuya_context *context)
{
    bool enough = true;
#pragma omp parallel num_threads(context->threads)
    {
        bench b = {0};
        bool own = bench_open(&b, j->grey->width_px);
#pragma omp for schedule(dynamic)
        for (int k = 0; k < strips; k++) {
            int first = MARGIN + k * STRIP, end = first + STRIP;
            end = end > j->grey->height_px - MARGIN ? j->grey->height_px - MARGIN : end;
            own = own && search_strip(&found[k], &b, j, first, end);
        }
        bench_close(&b);
#pragma omp atomic update
        enough &= own;
    }
    return enough ? TSUYA_OK : TSUYA_ERROR_MEMORY;
}

static float at_index(const tsuya_image *grey, size_t i)
{
    return tsuya_image_get(grey, (int)(i % (size_t)grey->width_px), (int)(i / (size_t)grey->width_px), 0);
}

/* Standard deviation of the noise from second differences of rows (Immerkær 1996), the median so that texture counts little. */
static float noise_of(const tsuya_image *grey, float *scratch)
{
    size_t w = (size_t)grey->width_px, pixels = w * (size_t)grey->height_px, step = pixels / NOISE_SAMPLES + 1, count = 0;
    for (size_t i = w + 1; i + w + 1 < pixels && count < NOISE_SAMPLES; i += step) {
        float d = at_index(grey, i - w - 1) - 2 * at_index(grey, i - w) + at_index(grey, i - w + 1) - 2 * at_index(grey, i - 1) +
                  4 * at_index(grey, i) - 2 * at_index(grey, i + 1) + at_index(grey, i + w - 1) - 2 * at_index(grey, i + w) +
                  at_index(grey, i + w + 1);
        scratch[count++] = fabsf(d);
    }
    tsuya_sort_floats(scratch, count);
    return count > 0 ? 1.4826f * scratch[count / 2] / 6.0f : 0.0f;
}

/* The strength that `rank` edges exceed or reach: positive floats are ordered as their bits are, which are counted in two halves. */
static float strength_of_rank(const edges *found, int strips, size_t rank, size_t *bin)
{
    uint32_t high = 0;
    for (int half = 0; half < 2; half++) {
        memset(bin, 0, 65536 * sizeof *bin);
        for (int k = 0; k < strips; k++) {
            for (size_t i = 0; i < found[k].count; i++) {
                uint32_t bits;
                memcpy(&bits, &found[k].edge[i].strength, sizeof bits);
                if (half == 0) {
                    bin[bits >> 16]++;
                } else if (bits >> 16 == high) {
                    bin[bits & 65535]++;
                }
            }
        }
        uint32_t at = 65535;
        while (at > 0 && bin[at] <= rank) {
            rank -= bin[at--];
        }
        high = half == 0 ? at : high << 16 | at;
    }
    float strength;
    memcpy(&strength, &high, sizeof strength);
    return strength;
}

/* The strongest edges of all strips, in `found[0]`. */
static bool keep_strongest(edges *found, int strips, size_t *bin)
{
    size_t count = 0;
    edges kept = {0};
    for (int k = 0; k < strips; k++) {
        count += found[k].count;
    }
    float strong = count > 0 ? STRONG * strength_of_rank(found, strips, count / 50, bin) : 0.0f;
    strong = count > MOST_EDGES ? fmaxf(strong, strength_of_rank(found, strips, MOST_EDGES - 1, bin)) : strong;
    for (int k = 0; k < strips; k++) {
        for (size_t i = 0; i < found[k].count; i++) {
            if (found[k].edge[i].strength >= strong && !keep(&kept, &found[k].edge[i])) {
                tsuya_free(kept.edge);
                return false;
            }
        }
    }
    tsuya_free(found[0].edge);
    found[0] = kept;
    return true;
}

static int direction_of(const edge *e)
{
    int direction = (int)lround(atan2((double)e->gy, (double)e->gx) / (M_PI / TSUYA_BLUR_DIRECTIONS));
    return (direction % TSUYA_BLUR_DIRECTIONS + TSUYA_BLUR_DIRECTIONS) % TSUYA_BLUR_DIRECTIONS;
}

static void summarise(tsuya_blur *blur, const edge *found, size_t count, float *scratch)
{
    blur->best_px = blur->worst_px = NAN;
    for (int d = 0; d < TSUYA_BLUR_DIRECTIONS; d++) {
        int n = 0;
        for (size_t i = 0; i < count; i++) {
            if (direction_of(&found[i]) == d) {
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

static tsuya_status measure(tsuya_blur *blur, edges *found, int strips, job *j, const tsuya_context *context)
{
    tsuya_status status;
    size_t *bin = NULL;
    float *list = NULL;
    TSUYA_NEW(status, bin, 65536);
    TSUYA_NEW(status, list, NOISE_SAMPLES);
    /* white noise of σ leaves σ / (sqrt(8π) s²) in the gradient after smoothing by s */
    float floor_gradient = NOISE_FACTOR * noise_of(j->grey, list) / (float)(sqrt(8.0 * M_PI) * SIGMA_1 * SIGMA_1);
    j->threshold = fmaxf(floor_gradient, 0.004f);
    TSUYA_GOTO_DONE(status, search(found, strips, j, context));
    if (!keep_strongest(found, strips, bin)) {
        status = TSUYA_ERROR_MEMORY;
        goto done;
    }
    tsuya_free(list);
    TSUYA_NEW(status, list, found[0].count);
    summarise(blur, found[0].edge, found[0].count, list);
done:
    tsuya_free(bin);
    tsuya_free(list);
    return status;
}

tsuya_status tsuya_blur_measure(tsuya_blur *blur, const tsuya_image *grey, const tsuya_image *mask, const tsuya_context *context)
{
    *blur = (tsuya_blur){.best_px = NAN, .worst_px = NAN};
    for (int d = 0; d < TSUYA_BLUR_DIRECTIONS; d++) {
        blur->sigma_px[d] = NAN;
    }
    if (grey->width_px < 32 || grey->height_px < 32) {
        return TSUYA_OK;
    }
    job j = {.grey = grey, .mask = mask};
    j.radius_1 = kernel_of(j.kernel_1, SIGMA_1);
    j.radius_2 = kernel_of(j.kernel_2, SIGMA_2);
    int strips = (grey->height_px - 2 * MARGIN + STRIP - 1) / STRIP;
    edges *found;
    tsuya_status status;
    TSUYA_NEW(status, found, (size_t)strips);
    status = measure(blur, found, strips, &j, context);
    for (int k = 0; k < strips; k++) {
        tsuya_free(found[k].edge);
    }
    tsuya_free(found);
done:
    return status;
}
