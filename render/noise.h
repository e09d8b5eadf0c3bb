/* How far a pixel's mean can be trusted, and how many samples each pixel of a picture gets (tsuya_path_options, noise). */
#ifndef TSUYA_RENDER_NOISE_H
#define TSUYA_RENDER_NOISE_H

#include "core/status.h"

#include <stdbool.h>
#include <stdint.h>

/* Samples that stratify each other. */
enum { TSUYA_NOISE_BLOCK = 4 };

/* Running sums of a pixel, enough to go on with it later. */
typedef struct tsuya_pixel_sum {
    double rgb[3], mean, spread; /* Welford's mean and sum of squares of the luminance */
    double block, block_mean, block_spread; /* the same of the means of blocks of samples */
    double met_sum;              /* of the luminance of samples that met the cloth */
    uint32_t samples, met;
} tsuya_pixel_sum;

void tsuya_pixel_add(tsuya_pixel_sum *sum, const double rgb[3], bool met);
/* Of the mean's luminance; and over that luminance. */
double tsuya_pixel_error(const tsuya_pixel_sum *sum);
double tsuya_pixel_relative_error(const tsuya_pixel_sum *sum);

typedef struct tsuya_noise_plan {
    int width_px, height_px, threads;
    double noise; /* aimed relative error */
    int spp;      /* the most that a pixel gets */
    const tsuya_pixel_sum *sum;
    uint8_t *cloth;   /* 2: met by a ray of its own; 1: near such a pixel */
    uint32_t *target; /* samples that each pixel shall have */
} tsuya_noise_plan;

/* From the pixels that are 2: those near them, and the pilots of all. */
void tsuya_noise_plan_pilots(const tsuya_noise_plan *plan, int pilot_spp);
/* From the pilots' sums: samples that each pixel needs.  Errors may be larger than aimed at, by one factor for the whole picture, as
 * long as half of the cloth is within the noise asked for. */
TSUYA_MUST_CHECK tsuya_status tsuya_noise_plan_samples(const tsuya_noise_plan *plan);

#endif
