#include "weave_detect/spectrum.h"

#include "core/clones.h"
#include "core/memory.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { RING_LEAST = 48 };
static const double LOWEST_BINS = 1.8;      /* in bins of the patch: below is the window's own lobe about 0 */
static const float LEAST_LEVEL = 2.2f;      /* power eight times the noise: noise alone makes about one such peak a patch */
static const double FLOOR = 1e-7;           /* of the highest power: below it single precision and leakage speak */
static const double FLAT_VARIANCE = 2.5e-7; /* an eighth of a grey level of 8 bits, squared */
static const double NOISE_QUANTILE = 0.3;

static inline int bin_index(const tsuya_spectrum *s, int kx, int ky)
{
    if (ky < 0) {
        kx = -kx;
        ky = -ky;
    }
    return (kx & (s->size - 1)) * s->fourier.stride + ky;
}

static int signed_bin(const tsuya_spectrum *s, int kx) { return kx <= s->size / 2 ? kx : kx - s->size; }

/* Rings of at least RING_LEAST bins, inside out; bins near 0 belong to none. */
static void make_rings(tsuya_spectrum *s)
{
    int half = s->size / 2, count = 0, widest = (int)(1.5 * half) + 2;
    int *tally = s->ring_start;
    double lowest = LOWEST_BINS * s->size / s->n;
    for (int kx = 0; kx < s->size; kx++) {
        for (int ky = 0; ky <= half; ky++) {
            double r = hypot(signed_bin(s, kx), ky);
            s->ring[bin_index(s, kx, ky)] = r < lowest ? -1 : (int)r;
            tally[r < lowest ? widest : (int)r] += r >= lowest;
        }
    }
    int *name = s->order; /* borrowed: from radius to ring */
    for (int r = 0, sum = 0; r < widest; r++) {
        name[r] = count;
        sum += tally[r];
        if (sum >= RING_LEAST) {
            sum = 0;
            count++;
        }
        s->ring_count = name[r] + 1;
    }
    memset(tally, 0, ((size_t)widest + 2) * sizeof *tally);
    for (int kx = 0; kx < s->size; kx++) {
        for (int ky = 0; ky <= half; ky++) {
            int *ring = &s->ring[bin_index(s, kx, ky)];
            *ring = *ring < 0 ? -1 : name[*ring];
        }
    }
}

static void make_order(tsuya_spectrum *s)
{
    int at = 0;
    for (int r = 0; r < s->ring_count; r++) {
        s->ring_start[r] = at;
        for (int kx = 0; kx < s->size; kx++) {
            for (int ky = 0; ky <= s->size / 2; ky++) {
                if (s->ring[bin_index(s, kx, ky)] == r) {
                    s->order[at++] = bin_index(s, kx, ky);
                }
            }
        }
    }
    s->ring_start[s->ring_count] = at;
}

static int direction_of(double fx, double fy)
{
    double turn = atan2(fy, fx) / M_PI;
    return (int)floor((turn - floor(turn)) * TSUYA_DIRECTIONS) % TSUYA_DIRECTIONS;
}

static void make_directions(tsuya_spectrum *s)
{
    for (int kx = 0; kx < s->size; kx++) {
        for (int ky = 0; ky <= s->size / 2; ky++) {
            int i = bin_index(s, kx, ky);
            double fx = (double)signed_bin(s, kx) / s->size, fy = (double)ky / s->size, ff = fx * fx + fy * fy;
            s->direction[i] = (uint8_t)direction_of(fx, fy);
            s->steepness[i] = ff <= 0.25 ? (float)ff : 0.0f; /* the corners would favour the diagonals */
        }
    }
}

tsuya_status tsuya_spectrum_create(tsuya_spectrum **spectrum, int n)
{
    *spectrum = NULL;
    if (n < 16 || n > 512 || n % 2 != 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "a patch of %d px; even sizes from 16 to 512 are accepted", n);
    }
    tsuya_status status = TSUYA_OK;
    tsuya_spectrum *s = tsuya_calloc(1, sizeof *s);
    if (!s) {
        return TSUYA_ERROR_MEMORY;
    }
    s->n = n;
    for (s->size = 16; s->size < n; s->size *= 2) {
    }
    TSUYA_GOTO_DONE(status, tsuya_fourier_create(&s->fourier, s->size));
    size_t area = (size_t)s->size * (size_t)s->fourier.stride;
    TSUYA_NEW(status, s->window, (size_t)n);
    TSUYA_NEW(status, s->padded, (size_t)s->size * (size_t)s->size);
    TSUYA_NEW(status, s->detrended, (size_t)n * (size_t)n);
    TSUYA_NEW(status, s->power, area);
    TSUYA_NEW(status, s->level, area);
    TSUYA_NEW(status, s->scratch, area);
    TSUYA_NEW(status, s->per_noise, area);
    TSUYA_NEW(status, s->ring, area);
    TSUYA_NEW(status, s->order, area);
    TSUYA_NEW(status, s->direction, area);
    TSUYA_NEW(status, s->steepness, area);
    TSUYA_NEW(status, s->ring_start, 2 * (size_t)s->size);
    TSUYA_NEW(status, s->noise, 2 * (size_t)s->size);
    for (int i = 0; i < n; i++) {
        s->window[i] = (float)(0.5 - 0.5 * cos(2.0 * M_PI * (i + 0.5) / n)); /* Hann */
    }
    make_rings(s);
    make_order(s);
    make_directions(s);
    *spectrum = s;
done:
    if (status != TSUYA_OK) {
        tsuya_spectrum_free(s);
    }
    return status;
}

void tsuya_spectrum_free(tsuya_spectrum *s)
{
    if (s) {
        tsuya_fourier_free(&s->fourier);
        tsuya_free(s->window);
        tsuya_free(s->padded);
        tsuya_free(s->detrended);
        tsuya_free(s->power);
        tsuya_free(s->level);
        tsuya_free(s->scratch);
        tsuya_free(s->per_noise);
        tsuya_free(s->ring);
        tsuya_free(s->order);
        tsuya_free(s->direction);
        tsuya_free(s->steepness);
        tsuya_free(s->ring_start);
        tsuya_free(s->noise);
        tsuya_free(s);
    }
}

/* Σ v, Σ v·x, Σ v² of a row in eight lanes, so that the order of additions does not depend on the vector width; x from the middle. */
TSUYA_CLONES("avx2", "default") static void row_sums(float sum[3], const float *v, int n)
{
    float s0[8] = {0}, s1[8] = {0}, s2[8] = {0};
    int x = 0;
    for (; x + 8 <= n; x += 8) {
        for (int k = 0; k < 8; k++) {
            float value = v[x + k];
            s0[k] += value;
            s1[k] += value * ((float)(x + k) - 0.5f * (float)(n - 1));
            s2[k] += value * value;
        }
    }
    for (; x < n; x++) {
        s0[0] += v[x];
        s1[0] += v[x] * ((float)x - 0.5f * (float)(n - 1));
        s2[0] += v[x] * v[x];
    }
    for (int k = 0; k < 3; k++) {
        const float *s = k == 0 ? s0 : k == 1 ? s1 : s2;
        sum[k] = ((s[0] + s[4]) + (s[1] + s[5])) + ((s[2] + s[6]) + (s[3] + s[7]));
    }
}

TSUYA_CLONES("avx2", "default") static void window_row(float *restrict plain, float *restrict windowed,
                                                                         const float *restrict v, const float *restrict window,
                                                                         float base, float slope, float row_window, int n)
{
    for (int x = 0; x < n; x++) {
        float value = v[x] - base - slope * ((float)x - 0.5f * (float)(n - 1));
        plain[x] = value;
        windowed[x] = value * window[x] * row_window;
    }
}

/* Mean and slope out, window on; false for a flat patch. */
bool tsuya_spectrum_detrend(tsuya_spectrum *s, const float *v)
{
    int n = s->n;
    double mean = 0.0, sx = 0.0, sy = 0.0, square = 0.0, count = (double)n * n;
    for (int y = 0; y < n; y++) {
        float sum[3];
        row_sums(sum, v + (size_t)y * (size_t)n, n);
        mean += (double)sum[0];
        sx += (double)sum[1];
        sy += (double)sum[0] * (y - 0.5 * (n - 1));
        square += (double)sum[2];
    }
    double xx = count * ((double)n * n - 1.0) / 12.0;
    mean /= count;
    s->variance = square / count - mean * mean - (sx * sx + sy * sy) / (xx * count);
    if (!(isfinite(s->variance) && s->variance > FLAT_VARIANCE)) {
        return false;
    }
    for (int y = 0; y < n; y++) {
        double base = mean + sy / xx * (y - 0.5 * (n - 1));
        window_row(s->detrended + (size_t)y * (size_t)n, s->padded + (size_t)y * (size_t)s->size, v + (size_t)y * (size_t)n, s->window,
                   (float)base, (float)(sx / xx), s->window[y], n);
    }
    return true;
}

TSUYA_CLONES("avx2", "default") static void square_all(float *restrict power, const float *restrict re,
                                                                         const float *restrict im, int count)
{
    for (int i = 0; i < count; i++) {
        power[i] = re[i] * re[i] + im[i] * im[i];
    }
}

/* The k-th smallest of `count` (Hoare); reorders. */
static float select_kth(float *v, int count, int k)
{
    int low = 0, high = count - 1;
    while (low < high) {
        float pivot = v[(low + high) / 2];
        int i = low, j = high;
        while (i <= j) {
            while (v[i] < pivot) {
                i++;
            }
            while (v[j] > pivot) {
                j--;
            }
            if (i <= j) {
                float swap = v[i];
                v[i++] = v[j];
                v[j--] = swap;
            }
        }
        if (k <= j) {
            high = j;
        } else if (k >= i) {
            low = i;
        } else {
            break;
        }
    }
    return v[k];
}

static void judge_noise(tsuya_spectrum *s)
{
    float highest = 0.0f;
    int count = s->ring_start[s->ring_count];
    for (int i = 0; i < count; i++) {
        s->scratch[i] = s->power[s->order[i]];
        highest = fmaxf(highest, s->scratch[i]);
    }
    float least = (float)FLOOR * highest + 1e-20f;
    for (int r = 0; r < s->ring_count; r++) {
        int first = s->ring_start[r], n = s->ring_start[r + 1] - first;
        if (n > 2 * RING_LEAST) { /* every other one is enough */
            n /= 2;
            for (int i = 0; i < n; i++) {
                s->scratch[first + i] = s->scratch[first + 2 * i];
            }
        }
        float q = n > 0 ? select_kth(s->scratch + first, n, (int)(NOISE_QUANTILE * n)) : 0.0f;
        s->noise[r] = fmaxf((float)((double)q / -log(1.0 - NOISE_QUANTILE)), least);
    }
}

TSUYA_CLONES("avx2", "default") static void highest_of_three(float *restrict out, const float *restrict a,
                                                                               const float *restrict b, const float *restrict c, int n)
{
    for (int i = 0; i < n; i++) {
        float ab = a[i] > b[i] ? a[i] : b[i];
        out[i] = ab > c[i] ? ab : c[i];
    }
}

/* scratch: highest power of the 3 × 3 bins around. */
static void dilate(tsuya_spectrum *s)
{
    int size = s->size, half = size / 2, stride = s->fourier.stride;
    float *across = s->level; /* borrowed */
    for (int kx = 0; kx < size; kx++) {
        highest_of_three(across + kx * stride, s->power + ((kx + size - 1) & (size - 1)) * stride, s->power + kx * stride,
                         s->power + ((kx + 1) & (size - 1)) * stride, stride);
    }
    for (int kx = 0; kx < size; kx++) {
        const float *row = across + kx * stride;
        float *out = s->scratch + kx * stride;
        highest_of_three(out + 1, row, row + 1, row + 2, half - 1);
        int mirror = ((size - kx) & (size - 1)) * stride;
        out[0] = fmaxf(fmaxf(row[0], row[1]), across[mirror + 1]);
        out[half] = fmaxf(fmaxf(row[half], row[half - 1]), across[mirror + half - 1]);
    }
}

static double parabola(float left, float middle, float right)
{
    double a = log((double)left + 1e-30), b = log((double)middle + 1e-30), c = log((double)right + 1e-30), curve = a - 2.0 * b + c;
    double offset = curve < -1e-12 ? 0.5 * (a - c) / curve : 0.0;
    return fmin(fmax(offset, -0.5), 0.5);
}

static void keep_peak(tsuya_spectrum *s, int kx, int ky, float level)
{
    const float *p = s->power;
    int x = signed_bin(s, kx);
    tsuya_peak peak = {.level = level};
    peak.fx = (float)((x + parabola(p[bin_index(s, x - 1, ky)], p[bin_index(s, x, ky)], p[bin_index(s, x + 1, ky)])) / s->size);
    peak.fy = (float)((ky + parabola(p[bin_index(s, x, ky - 1)], p[bin_index(s, x, ky)], p[bin_index(s, x, ky + 1)])) / s->size);
    int place = s->peak_count < TSUYA_PEAKS ? s->peak_count++ : TSUYA_PEAKS;
    while (place > 0 && s->peak[place - 1].level < level) {
        if (place < TSUYA_PEAKS) {
            s->peak[place] = s->peak[place - 1];
        }
        place--;
    }
    if (place < TSUYA_PEAKS) {
        s->peak[place] = peak;
    }
}

/* ln(1 + x) for x ≥ 0 to 1e-4: the exponent, and a polynomial on the mantissa (Chebyshev on [1, 2)). */
static inline float ln1p(float x)
{
    union {
        float f;
        uint32_t u;
    } v = {.f = 1.0f + x};
    float exponent = (float)((int)(v.u >> 23) - 127);
    v.u = (v.u & 0x007fffffu) | 0x3f800000u;
    float m = v.f - 1.0f;
    float p = m * (0.99949556f + m * (-0.49190896f + m * (0.28947478f + m * (-0.13606275f + m * 0.03215845f))));
    return 0.69314718f * exponent + p;
}

TSUYA_CLONES("avx2", "default") static void make_levels(float *restrict level, const float *restrict highest,
                                                                          const float *restrict per_noise, int count)
{
    for (int i = 0; i < count; i++) {
        level[i] = ln1p(highest[i] * per_noise[i]);
    }
}

/* Levels everywhere, and the local maxima among the powers. */
static void find_peaks(tsuya_spectrum *s)
{
    int size = s->size, half = size / 2, stride = s->fourier.stride;
    s->peak_count = 0;
    float *inverse = s->noise + s->ring_count + 1; /* inverse[−1]: of the bins near 0 */
    inverse[-1] = 0.0f;
    for (int r = 0; r < s->ring_count; r++) {
        inverse[r] = 1.0f / s->noise[r];
    }
    for (int i = 0; i < size * stride; i++) {
        s->per_noise[i] = inverse[s->ring[i]];
    }
    make_levels(s->level, s->scratch, s->per_noise, size * stride);
    for (int kx = 0; kx < size; kx++) {
        for (int ky = 0; ky < half; ky++) {
            int i = kx * stride + ky;
            bool own = s->level[i] > LEAST_LEVEL && s->scratch[i] == s->power[i]; /* highest of its neighbours */
            if (own && kx != half && (ky > 0 || kx < half)) {
                keep_peak(s, kx, ky, s->level[i]);
            }
        }
    }
}

static void sum_directions(tsuya_spectrum *s)
{
    float sum[TSUYA_DIRECTIONS] = {0}, other[TSUYA_DIRECTIONS] = {0}, all = 1e-20f; /* by turns, so that one does not wait for the other */
    for (int r = 0; r < s->ring_count; r++) {
        float noise = s->noise[r];
        for (int k = s->ring_start[r]; k < s->ring_start[r + 1]; k++) {
            int i = s->order[k];
            float above = s->power[i] - noise;
            (k & 1 ? other : sum)[s->direction[i]] += above > 0.0f ? above * s->steepness[i] : 0.0f;
        }
    }
    for (int d = 0; d < TSUYA_DIRECTIONS; d++) {
        sum[d] += other[d];
    }
    for (int d = 0; d < TSUYA_DIRECTIONS; d++) {
        int before = (d + TSUYA_DIRECTIONS - 1) % TSUYA_DIRECTIONS, after = (d + 1) % TSUYA_DIRECTIONS;
        s->energy[d] = sum[before] + 2.0f * sum[d] + sum[after];
        all += s->energy[d];
    }
    for (int d = 0; d < TSUYA_DIRECTIONS; d++) {
        s->energy[d] *= TSUYA_DIRECTIONS / all;
    }
}

bool tsuya_spectrum_run(tsuya_spectrum *s, const float *values)
{
    s->peak_count = 0;
    if (!tsuya_spectrum_detrend(s, values)) {
        return false;
    }
    tsuya_fourier_run(&s->fourier, s->padded);
    square_all(s->power, s->fourier.re, s->fourier.im, s->size * s->fourier.stride);
    judge_noise(s);
    dilate(s);
    find_peaks(s);
    sum_directions(s);
    return true;
}

float tsuya_spectrum_level(const tsuya_spectrum *s, double fx, double fy)
{
    if (!(fabs(fx) < 0.5 && fabs(fy) < 0.5)) {
        return 0.0f;
    }
    return s->level[bin_index(s, (int)lrint(fx * s->size), (int)lrint(fy * s->size))];
}

float tsuya_spectrum_noise(const tsuya_spectrum *s, double fx, double fy)
{
    int ring = s->ring[bin_index(s, (int)lrint(fx * s->size), (int)lrint(fy * s->size))];
    return s->noise[ring < 0 ? 0 : ring];
}

float tsuya_spectrum_power(const tsuya_spectrum *s, double fx, double fy)
{
    int kx = (int)lrint(fx * s->size), ky = (int)lrint(fy * s->size);
    float highest = 0.0f, sum = 0.25f * (float)s->n * (float)s->n; /* of the window */
    for (int k = 0; k < 9; k++) {
        highest = fmaxf(highest, s->power[bin_index(s, kx + k % 3 - 1, ky + k / 3 - 1)]);
    }
    return highest / (sum * sum);
}

float tsuya_spectrum_energy(const tsuya_spectrum *s, double fx, double fy) { return logf(s->energy[direction_of(fx, fy)] + 0.02f); }
