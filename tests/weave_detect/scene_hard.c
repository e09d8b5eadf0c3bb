#include "scene_hard.h"

#include "scene_other.h"
#include "scene_weave.h"

#include "core/context.h"

#include <math.h>
#include <stdlib.h>

const char *hard_name(hard_kind kind)
{
    static const char *const name[] = {"knit",         "print askew", "moire", "one pixel a thread", "blocks on a wall", "blocks on cloth",
                                       "Bayer on a wall", "Bayer on cloth", "clipped highlight", "seam", "background"};
    return name[kind];
}

static double line_difference_deg(double a, double b) { return fabs(remainder(a - b, 180.0)); }

void hard_print(float *values, int n, double weft_deg, double warp_deg, uint64_t seed, uint64_t index)
{
    double r[8], deg = 0.0, c = 0.5 * (n - 1);
    for (int k = 0; k < 8; k++) {
        r[k] = tsuya_random_uniform(seed, 400 + index, (uint64_t)k);
    }
    for (uint64_t k = 0; k == 0 || line_difference_deg(deg, weft_deg) < 12.0 || line_difference_deg(deg, warp_deg) < 12.0; k++) {
        deg = 180.0 * tsuya_random_uniform(seed, 401 + index, 10 + k);
    }
    double a = deg * M_PI / 180.0, period = 7.0 * pow(5.0, r[0]), share = 0.25 + 0.5 * r[1], depth = 0.15 + 0.5 * r[2], edge = 0.15 + 0.4 * r[3];
    for (int i = 0; i < n * n; i++) {
        double x = i % n - c, y = (int)(i / n) - c, at = (-sin(a) * x - cos(a) * y) / period + r[4], inside = at - floor(at);
        double from_middle = fabs(inside - 0.5) - 0.5 * share; /* of the stripe; < 0 in it */
        double dyed = 1.0 / (1.0 + exp(8.0 * from_middle * (period / (2.0 * edge * 4.0))));
        if (r[5] < 0.4) { /* a narrower one beside it */
            double second = fabs(remainder(inside - 0.05, 1.0)) - 0.08;
            dyed = fmax(dyed, 1.0 / (1.0 + exp(8.0 * second * (period / (2.0 * edge * 4.0)))));
        }
        values[i] *= (float)(1.0 - depth * dyed);
    }
}

void hard_join(float *values, const float *other, int n, uint64_t seed, uint64_t index)
{
    double r[4];
    for (int k = 0; k < 4; k++) {
        r[k] = tsuya_random_uniform(seed, 500 + index, (uint64_t)k);
    }
    double a = 2.0 * M_PI * r[0], offset = 0.3 * n * (r[1] - 0.5), width = 1.5 + 2.0 * r[2], dark = 0.5 * r[3];
    for (int i = 0; i < n * n; i++) {
        double x = i % n - 0.5 * (n - 1), y = (int)(i / n) - 0.5 * (n - 1), d = cos(a) * x + sin(a) * y - offset;
        values[i] = d > 0.0 ? other[i] : values[i];
        values[i] *= (float)(1.0 - dark * exp(-d * d / (width * width)));
    }
}

static void set_truth(hard_truth *truth, const weave_cloth *c)
{
    int k = truth->count++;
    truth->weft_deg[k] = c->weft_deg;
    truth->warp_deg[k] = c->warp_deg;
    truth->weft_px[k] = c->weft_px;
    truth->warp_px[k] = c->warp_px;
}

/* Cloth that a patch can tell: contrast from 1, periods from 4.5 to 9 px. */
static void tellable(weave_cloth *cloth, weave_camera *camera, uint64_t seed, uint64_t index)
{
    weave_random(cloth, camera, seed, index);
    cloth->weft_px = 4.5 + 3.5 * tsuya_random_uniform(seed, index, 60);
    cloth->warp_px = cloth->weft_px * (0.85 + 0.3 * tsuya_random_uniform(seed, index, 61));
    camera->contrast = fmax(camera->contrast, 1.0);
    camera->gradient *= 0.3;
}

static void draw_cloth(float *values, int n, hard_truth *truth, uint64_t seed, uint64_t index)
{
    weave_cloth cloth;
    weave_camera camera;
    tellable(&cloth, &camera, seed, index);
    weave_draw(values, n, &cloth, &camera);
    set_truth(truth, &cloth);
}

static void draw_finer(float *values, int n, double least_px, double most_px, uint64_t seed, uint64_t index)
{
    weave_cloth cloth;
    weave_camera camera;
    weave_random(&cloth, &camera, seed, index);
    cloth.weft_px = least_px + (most_px - least_px) * tsuya_random_uniform(seed, index, 60);
    cloth.warp_px = cloth.weft_px * (0.9 + 0.2 * tsuya_random_uniform(seed, index, 61));
    cloth.uneven = 0.0;
    camera.blur_px = 0.3;
    camera.contrast = 2.0;
    weave_draw(values, n, &cloth, &camera);
}

static void draw_wall(float *values, int n, uint64_t seed, uint64_t index)
{
    double a = 6.283 * tsuya_random_uniform(seed, index, 70), slope = 0.3 * tsuya_random_uniform(seed, index, 71) / n;
    double wave = 0.05 + 0.1 * tsuya_random_uniform(seed, index, 72), turn = 6.283 * tsuya_random_uniform(seed, index, 73);
    for (int i = 0; i < n * n; i++) {
        double x = i % n - 0.5 * n, y = (int)(i / n) - 0.5 * n;
        double soft = 0.5 + slope * (cos(a) * x + sin(a) * y) + 0.1 * sin(wave * (cos(turn) * x + sin(turn) * y) + 0.02 * x);
        values[i] = (float)(soft + 0.01 * tsuya_random_normal(seed, 900 + index, (uint64_t)i));
    }
}

void hard_mosaic(float *values, int n, uint64_t seed, uint64_t index)
{
    double red = 0.3 + 0.7 * tsuya_random_uniform(seed, index, 80), blue = 0.3 + 0.7 * tsuya_random_uniform(seed, index, 81);
    for (int i = 0; i < n * n; i++) {
        int x = i % n, y = i / n;
        values[i] *= (float)(x % 2 != y % 2 ? 1.0 : y % 2 == 0 ? red : blue);
    }
}

static void put_highlight(float *values, int n, uint64_t seed, uint64_t index)
{
    double cx = n * (0.3 + 0.4 * tsuya_random_uniform(seed, index, 82)), cy = n * (0.3 + 0.4 * tsuya_random_uniform(seed, index, 83));
    double size = n * (0.15 + 0.2 * tsuya_random_uniform(seed, index, 84));
    for (int i = 0; i < n * n; i++) {
        double x = i % n - cx, y = (int)(i / n) - cy, value = (double)values[i] * (0.8 + 1.8 * exp(-0.5 * (x * x + y * y) / (size * size)));
        values[i] = (float)fmin(value, 1.0);
    }
}

static void put_background(float *values, int n, uint64_t seed, uint64_t index)
{
    float *other = malloc((size_t)n * (size_t)n * sizeof *other);
    if (!other) {
        abort();
    }
    other_draw(other, n, OTHER_CLOUDS, seed, index);
    hard_join(values, other, n, seed, index);
    free(other);
}

static void put_seam(float *values, int n, hard_truth *truth, uint64_t seed, uint64_t index)
{
    weave_cloth cloth;
    weave_camera camera;
    float *other = malloc((size_t)n * (size_t)n * sizeof *other);
    if (!other) {
        abort();
    }
    tellable(&cloth, &camera, seed, index); /* the same cloth, cut at another angle */
    double turn = 15.0 + 60.0 * tsuya_random_uniform(seed, index, 85);
    cloth.weft_deg += turn;
    cloth.warp_deg += turn;
    cloth.seed += 5;
    camera.seed += 5;
    weave_draw(other, n, &cloth, &camera);
    set_truth(truth, &cloth);
    hard_join(values, other, n, seed, index);
    free(other);
}

void hard_draw(float *values, int n, hard_truth *truth, hard_kind kind, uint64_t seed, uint64_t index)
{
    *truth = (hard_truth){0};
    switch (kind) {
    case HARD_KNIT: other_draw(values, n, OTHER_KNIT, seed, index); return;
    case HARD_MOIRE: draw_finer(values, n, 1.15, 1.9, seed, index); return;
    case HARD_FINE: draw_finer(values, n, 0.9, 1.15, seed, index); return;
    case HARD_BLOCKS: draw_wall(values, n, seed, index); return;
    case HARD_BAYER_WALL:
        draw_wall(values, n, seed, index);
        hard_mosaic(values, n, seed, index);
        return;
    default: draw_cloth(values, n, truth, seed, index);
    }
    switch (kind) {
    case HARD_PRINT: hard_print(values, n, truth->weft_deg[0], truth->warp_deg[0], seed, index); return;
    case HARD_BAYER: hard_mosaic(values, n, seed, index); return;
    case HARD_HIGHLIGHT: put_highlight(values, n, seed, index); return;
    case HARD_SEAM: put_seam(values, n, truth, seed, index); return;
    case HARD_BACKGROUND: put_background(values, n, seed, index); return;
    default: return;
    }
}
