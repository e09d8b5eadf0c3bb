#include "render/noise.h"

#include "core/color.h"
#include "core/memory.h"

#include <math.h>

enum { BLOCK = TSUYA_NOISE_BLOCK, EMPTY_SPP = BLOCK, AROUND = 3, SIDE = 2 * AROUND + 1 };

static void add_to_block(tsuya_pixel_sum *sum, double luminance)
{
    sum->block += luminance / BLOCK;
    if (sum->samples % BLOCK == 0) {
        double d = sum->block - sum->block_mean;
        sum->block_mean += d / (sum->samples / BLOCK);
        sum->block_spread += d * (sum->block - sum->block_mean);
        sum->block = 0.0;
    }
}

void tsuya_pixel_add(tsuya_pixel_sum *sum, const double rgb[3], bool met)
{
    double luminance = tsuya_rgb_luminance(rgb), d = luminance - sum->mean;
    sum->samples++;
    sum->mean += d * (1.0 / sum->samples); /* the quotient does not wait for d */
    sum->spread += d * (luminance - sum->mean);
    sum->met += met;
    sum->met_sum += met ? luminance : 0.0;
    add_to_block(sum, luminance);
    for (int c = 0; c < 3; ++c) {
        sum->rgb[c] += rgb[c];
    }
}

/* Variance of a mean of n samples, a/n + b/n^1.5: what chance decides, and edges of all kinds, whose stratified samples err
 * by the strata that the edge crosses alone (Mitchell, "Consequences of stratified sampling in graphics", SIGGRAPH 1996). */
typedef struct variance_law { double a, b; } variance_law;

static double variance_of_mean(variance_law law, double n) { return law.a / n + law.b / (n * sqrt(n)); }

/* From the variance of samples, that of means of BLOCK of them, and the part of the former that the cloth's outline makes. */
static variance_law law_from(double of_samples, double of_blocks, double of_outline)
{
    const double edge = 1.0 - 1.0 / sqrt(BLOCK);
    double b = fmin(fmax((of_samples - BLOCK * of_blocks) / edge, of_outline), of_samples);
    return (variance_law){of_samples - b, b};
}

/* Variance that samples would have if cloth and background each were one grey. */
static double outline_variance(const tsuya_pixel_sum *s)
{
    if (s->met == 0 || s->met == s->samples) {
        return 0.0;
    }
    double share = (double)s->met / s->samples, cloth = s->met_sum / s->met;
    double background = (s->mean * s->samples - s->met_sum) / (s->samples - s->met);
    return share * (1.0 - share) * (cloth - background) * (cloth - background);
}

static variance_law own_law(const tsuya_pixel_sum *s)
{
    double n = s->samples, blocks = floor(n / BLOCK), of_samples = n > 1.0 ? s->spread / (n - 1.0) : 0.0;
    return law_from(of_samples, blocks > 1.0 ? s->block_spread / (blocks - 1.0) : of_samples / BLOCK, outline_variance(s));
}

/* Standard error of the mean's luminance. */
double tsuya_pixel_error(const tsuya_pixel_sum *s)
{
    return s->samples > 1 ? sqrt(variance_of_mean(own_law(s), s->samples)) : 0.0;
}

double tsuya_pixel_relative_error(const tsuya_pixel_sum *s) { return s->mean > 0.0 ? tsuya_pixel_error(s) / s->mean : 0.0; }

void tsuya_noise_plan_pilots(const tsuya_noise_plan *p, int pilot_spp)
{
    for (int y = 0; y < p->height_px; ++y) {
        for (int x = 0; x < p->width_px; ++x) {
            uint8_t *here = &p->cloth[(size_t)y * (size_t)p->width_px + (size_t)x];
            for (int k = 0; k < SIDE * SIDE && *here == 0; ++k) {
                int i = x + k % SIDE - AROUND, j = y + k / SIDE - AROUND;
                *here = i >= 0 && i < p->width_px && j >= 0 && j < p->height_px && p->cloth[(size_t)j * (size_t)p->width_px + (size_t)i] == 2;
            }
            int pilot = *here ? pilot_spp : EMPTY_SPP;
            p->target[(size_t)y * (size_t)p->width_px + (size_t)x] = (uint32_t)(pilot < p->spp ? pilot : p->spp);
        }
    }
}

typedef struct around { variance_law law; double level; } around;

static around look_around(const tsuya_noise_plan *p, int x, int y)
{
    double of_samples = 0.0, of_blocks = 0.0, of_outline = 0.0, blocks = 0.0, level = 0.0;
    int count = 0;
    for (int k = 0; k < SIDE * SIDE; ++k) {
        int i = x + k % SIDE - AROUND, j = y + k / SIDE - AROUND;
        if (k != SIDE * SIDE / 2 && i >= 0 && i < p->width_px && j >= 0 && j < p->height_px) {
            const tsuya_pixel_sum *s = &p->sum[(size_t)j * (size_t)p->width_px + (size_t)i];
            of_samples += s->spread / (s->samples - 1);
            of_blocks += s->block_spread;
            of_outline += outline_variance(s);
            blocks += (s->samples / BLOCK) - 1;
            level += s->mean;
            count++;
        }
    }
    count = count > 0 ? count : 1;
    of_samples /= count;
    return (around){law_from(of_samples, blocks > 0.0 ? of_blocks / blocks : of_samples / BLOCK, of_outline / count), level / count};
}

/* Error aimed at: E times the level; where that is darker than the cloth's mean, as photon noise of a photograph has it that
 * reaches E at the mean, down to a tenth of the mean. */
static double aimed_error(double noise, double level, double cloth)
{
    return noise * fmax(fmax(level, sqrt(fmax(level * cloth, 0.0))), 0.1 * cloth);
}

/* What a pixel has ahead of it: how its error falls, and the error aimed at. */
typedef struct prospect {
    float a, b, aim;
} prospect;

/* Samples until the error is `factor` times the one aimed at. */
static double samples_wanted(const prospect *f, double factor)
{
    double square = pow(factor * f->aim, 2.0);
    return square > 0.0 ? f->a / square + cbrt(pow(f->b / square, 2.0)) : 0.0;
}

static uint32_t samples_planned(const tsuya_noise_plan *p, size_t k, const prospect *f, double factor)
{
    return (uint32_t)fmin(fmax(BLOCK * ceil(samples_wanted(f, factor) / BLOCK), p->target[k]), p->spp);
}

/* From what is around each pixel; its own values have no part in it. */
static void look_ahead(prospect *ahead, const tsuya_noise_plan *p)
{
    int width = p->width_px, height = p->height_px;
    double sum = 0.0, pixels = 0.0, noise = p->noise;
    for (size_t k = 0; k < (size_t)width * (size_t)height; ++k) {
        sum += p->cloth[k] ? p->sum[k].mean : 0.0;
        pixels += p->cloth[k] ? 1.0 : 0.0;
    }
#pragma omp parallel for schedule(static) num_threads(p->threads)
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            size_t k = (size_t)y * (size_t)width + (size_t)x;
            around a = look_around(p, x, y);
            double own = p->cloth[k] ? 1.0 : 0.0, rest = pixels - own;
            double cloth = rest > 0.0 ? (sum - own * p->sum[k].mean) / rest : 0.0;
            ahead[k] = (prospect){(float)a.law.a, (float)a.law.b, (float)aimed_error(noise, a.level, cloth)};
        }
    }
}

/* Whether half of the pixels with `parity` that show cloth would be within the noise asked for, by their own pilots. */
static bool enough(const tsuya_noise_plan *p, const prospect *ahead, double factor, size_t parity)
{
    size_t width = (size_t)p->width_px, pixels = width * (size_t)p->height_px, within = 0, all = 0;
    for (size_t k = 0; k < pixels; ++k) {
        if (p->cloth[k] == 2 && ((k % width + k / width) & 1) == parity) {
            double n = samples_planned(p, k, &ahead[k], factor);
            ++all;
            within += variance_of_mean(own_law(&p->sum[k]), n) <= pow(p->noise * p->sum[k].mean, 2.0);
        }
    }
    return 2 * within >= all;
}

tsuya_status tsuya_noise_plan_samples(const tsuya_noise_plan *p)
{
    static const double leniency[] = {3.0, 2.5, 2.0, 1.75, 1.5, 1.25, 1.0};
    size_t width = (size_t)p->width_px, pixels = width * (size_t)p->height_px;
    double factor[2] = {1.0, 1.0};
    tsuya_status status = TSUYA_OK;
    prospect *ahead = NULL;
    TSUYA_NEW(status, ahead, pixels);
    look_ahead(ahead, p);
    for (size_t parity = 0; parity < 2; ++parity) { /* each half follows the other */
        int k = 0;
        while (leniency[k] > 1.0 && !enough(p, ahead, leniency[k], parity)) {
            ++k;
        }
        factor[1 - parity] = leniency[k];
    }
    for (size_t k = 0; k < pixels; ++k) {
        p->target[k] = samples_planned(p, k, &ahead[k], factor[(k % width + k / width) & 1]);
    }
done:
    tsuya_free(ahead);
    return status;
}
