/* The power spectrum of a patch, how far it stands above its noise, and its peaks.
 *
 * Mean and slope are taken out (lamp), a Hann window is put on.  Noise is judged by rings of equal frequency: 3/10 of the powers of
 * a ring lie below ln(10/7) of its mean where there is noise alone, and peaks, being few, hardly move that quantile. */
#ifndef TSUYA_WEAVE_DETECT_SPECTRUM_H
#define TSUYA_WEAVE_DETECT_SPECTRUM_H

#include "weave_detect/fourier.h"

#include <stdbool.h>
#include <stdint.h>

enum { TSUYA_PEAKS = 24, TSUYA_DIRECTIONS = 32 };

typedef struct tsuya_peak {
    float fx, fy;  /* cycles a pixel, x right, y down; fy ≥ 0 half plane */
    float level;   /* ln(1 + power / noise) */
} tsuya_peak;

typedef struct tsuya_spectrum {
    int n, size;   /* patch, transform: the next power of two */
    tsuya_fourier fourier;
    float *window, *padded;
    float *power;  /* laid out as in fourier.h */
    float *level;  /* ln(1 + highest power of the 3 × 3 bins around, over noise) */
    float *scratch, *noise, *per_noise;
    int *ring, *order, *ring_start, ring_count;
    uint8_t *direction; /* of each bin, in TSUYA_DIRECTIONS steps of the half turn, along f = (cos, sin) */
    float *steepness;   /* |f|², the weight of a bin among gradients */
    float energy[TSUYA_DIRECTIONS]; /* of gradients above the noise, smoothed, mean 1 */
    float *detrended;  /* n × n: mean and slope out, no window */
    double variance;   /* of detrended */
    tsuya_peak peak[TSUYA_PEAKS]; /* highest level first */
    int peak_count;
} tsuya_spectrum;

/* Patches of n × n pixels, n even, 16 … 512. */
TSUYA_MUST_CHECK tsuya_status tsuya_spectrum_create(tsuya_spectrum **spectrum, int n);
void tsuya_spectrum_free(tsuya_spectrum *spectrum);
/* values: n × n grey, rows top to bottom.  False for a flat patch, whose spectrum is not made. */
bool tsuya_spectrum_run(tsuya_spectrum *spectrum, const float *values);

/* Only `detrended` and `variance`.  False for a flat patch. */
bool tsuya_spectrum_detrend(tsuya_spectrum *spectrum, const float *values);

/* ln of the energy of gradients that run along f. */
float tsuya_spectrum_energy(const tsuya_spectrum *spectrum, double fx, double fy);

/* The level at the bin nearest to a frequency; 0 beyond what pixels carry and near frequency 0. */
float tsuya_spectrum_level(const tsuya_spectrum *spectrum, double fx, double fy);

/* Mean power of the noise in a frequency's ring. */
float tsuya_spectrum_noise(const tsuya_spectrum *spectrum, double fx, double fy);

/* Amplitude² of the strongest wave (as re² + im² of A in 2·Re A e^{iφ}) within a bin of a frequency that pixels carry. */
float tsuya_spectrum_power(const tsuya_spectrum *spectrum, double fx, double fy);

#endif
