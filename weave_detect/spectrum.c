#include "weave_detect/spectrum.h"

#include "core/memory.h"
#include "weave_detect/opencv_adapter.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

#ifndef M_PI
#define M_PI 3.14159265358979323846
#endif

enum { MOST_PEAKS = 10, MOST_RINGS = 1024 };
/* Threads from 2.6 px (just above what pixels can carry) to a quarter of the patch. */
static const double SHORTEST_PERIOD = 2.6, PERIODS_LEAST = 4.0;
/* A peak must stand this far above the median of its ring; noise alone (exponential) passes it once in e^-14 bins. */
static const double LEAST_CONTRAST = 20.0;

typedef struct peak {
    double fx, fy; /* cycles a pixel, x right, y down; fy ≥ 0 half plane */
    double power, contrast;
} peak;

struct tsuya_spectrum {
    int n, size; /* patch, zero-padded transform */
    float *window, *padded, *power, *ring_median, *scratch;
    int *ring_count;
};

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
    s->size = 2 * n;
    size_t area = (size_t)s->size * (size_t)s->size;
    TSUYA_NEW(status, s->window, (size_t)n);
    TSUYA_NEW(status, s->padded, area);
    TSUYA_NEW(status, s->power, area);
    TSUYA_NEW(status, s->ring_median, (size_t)s->size);
    TSUYA_NEW(status, s->scratch, area);
    TSUYA_NEW(status, s->ring_count, (size_t)s->size);
    for (int i = 0; i < n; i++) {
        s->window[i] = (float)(0.5 - 0.5 * cos(2.0 * M_PI * (i + 0.5) / n)); /* Hann */
    }
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
        tsuya_free(s->window);
        tsuya_free(s->padded);
        tsuya_free(s->power);
        tsuya_free(s->ring_median);
        tsuya_free(s->scratch);
        tsuya_free(s->ring_count);
        tsuya_free(s);
    }
}

/* Mean and linear slope out (lamp gradient), window on; false for a flat patch. */
static bool prepare(tsuya_spectrum *s, float *v)
{
    int n = s->n;
    double mean = 0.0, sx = 0.0, sy = 0.0, sxx = 0.0, energy = 0.0;
    for (int y = 0; y < n; y++) {
        for (int x = 0; x < n; x++) {
            double dx = x - 0.5 * (n - 1), dy = y - 0.5 * (n - 1), value = (double)v[y * n + x];
            mean += value;
            sx += dx * value;
            sy += dy * value;
            sxx += dx * dx;
        }
    }
    mean /= (double)n * n;
    memset(s->padded, 0, (size_t)s->size * (size_t)s->size * sizeof *s->padded);
    for (int y = 0; y < n; y++) {
        for (int x = 0; x < n; x++) {
            double dx = x - 0.5 * (n - 1), dy = y - 0.5 * (n - 1);
            double value = (double)v[y * n + x] - mean - (sx * dx + sy * dy) / sxx;
            energy += value * value;
            s->padded[y * s->size + x] = (float)value * s->window[x] * s->window[y];
        }
    }
    return isfinite(energy) && energy / ((double)n * n) > 1e-8; /* a four-thousandth of a grey level of 8 bits, squared */
}

static int signed_bin(int i, int size)
{
    return i < size / 2 ? i : i - size;
}

static int compare_floats(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return x < y ? -1 : x > y;
}

/* Median power of every ring of frequencies: what a peak is held against. */
static void ring_medians(tsuya_spectrum *s)
{
    int size = s->size, rings = size / 2;
    memset(s->ring_count, 0, (size_t)size * sizeof *s->ring_count);
    int *start = s->ring_count; /* counts, then ends */
    for (int y = 0; y <= size / 2; y++) {
        for (int x = 0; x < size; x++) {
            int r = (int)(hypot(signed_bin(x, size), signed_bin(y, size)) + 0.5);
            start[r < rings ? r : rings]++;
        }
    }
    int sum = 0;
    for (int r = 0; r <= rings; r++) {
        int count = start[r];
        start[r] = sum;
        sum += count;
    }
    for (int y = 0; y <= size / 2; y++) {
        for (int x = 0; x < size; x++) {
            int r = (int)(hypot(signed_bin(x, size), signed_bin(y, size)) + 0.5);
            s->scratch[start[r < rings ? r : rings]++] = s->power[y * size + x];
        }
    }
    for (int r = 0, first = 0; r <= rings; r++) {
        int count = start[r] - first;
        qsort(s->scratch + first, (size_t)count, sizeof *s->scratch, compare_floats);
        s->ring_median[r] = count > 0 ? s->scratch[first + count / 2] : 0.0f;
        first = start[r];
    }
}

static float power_at(const tsuya_spectrum *s, int x, int y)
{
    int size = s->size;
    return s->power[((y % size + size) % size) * size + (x % size + size) % size];
}

/* Vertex of the parabola through the logarithms of three powers, in (−½, ½). */
static double parabola(double left, double middle, double right)
{
    double a = log(left + 1e-30), b = log(middle + 1e-30), c = log(right + 1e-30), curve = a - 2.0 * b + c;
    double offset = curve < -1e-12 ? 0.5 * (a - c) / curve : 0.0;
    return fmin(fmax(offset, -0.5), 0.5);
}

/* Power near a frequency over its ring's median: is there something? */
static double contrast_at(const tsuya_spectrum *s, double fx, double fy)
{
    int size = s->size, bx = (int)lround(fx * size), by = (int)lround(fy * size);
    if (abs(bx) > size / 2 - 2 || abs(by) > size / 2 - 2) {
        return 0.0;
    }
    float best = 0.0f;
    for (int j = -1; j <= 1; j++) {
        for (int i = -1; i <= 1; i++) {
            best = fmaxf(best, power_at(s, bx + i, by + j));
        }
    }
    int r = (int)(hypot(bx, by) + 0.5);
    return (double)best / ((double)s->ring_median[r < size / 2 ? r : size / 2] + 1e-20);
}

/* The strongest local maxima of the upper half plane, by power. */
static int find_peaks(const tsuya_spectrum *s, peak *list)
{
    int size = s->size, count = 0;
    double nearest = PERIODS_LEAST / s->n, farthest = 1.0 / SHORTEST_PERIOD;
    for (int y = 0; y <= size / 2 - 2; y++) {
        for (int x = -(size / 2 - 2); x <= size / 2 - 2; x++) {
            double f = hypot(x, y) / size;
            if (f < nearest || f > farthest || (y == 0 && x < 0)) {
                continue;
            }
            float value = power_at(s, x, y);
            bool highest = true;
            for (int j = -2; j <= 2 && highest; j++) {
                for (int i = -2; i <= 2 && highest; i++) {
                    highest = (i == 0 && j == 0) || power_at(s, x + i, y + j) <= value;
                }
            }
            double contrast = highest ? contrast_at(s, (double)x / size, (double)y / size) : 0.0;
            if (contrast < LEAST_CONTRAST) {
                continue;
            }
            peak p = {.power = (double)value, .contrast = contrast};
            p.fx = (x + parabola((double)power_at(s, x - 1, y), (double)value, (double)power_at(s, x + 1, y))) / size;
            p.fy = (y + parabola((double)power_at(s, x, y - 1), (double)value, (double)power_at(s, x, y + 1))) / size;
            int place = count < MOST_PEAKS ? count++ : MOST_PEAKS;
            while (place > 0 && list[place - 1].power < p.power) {
                if (place < MOST_PEAKS) {
                    list[place] = list[place - 1];
                }
                place--;
            }
            if (place < MOST_PEAKS) {
                list[place] = p;
            }
        }
    }
    return count;
}

static double sine_between(const peak *a, const peak *b)
{
    return fabs(a->fx * b->fy - a->fy * b->fx) / (hypot(a->fx, a->fy) * hypot(b->fx, b->fy));
}

/* What speaks for a pair: both contrasts and those of the second harmonics, in logarithms. */
static double pair_score(const tsuya_spectrum *s, const peak *a, const peak *b)
{
    double own = log(a->contrast) + log(b->contrast);
    double harmonics = log(1.0 + contrast_at(s, 2 * a->fx, 2 * a->fy)) + log(1.0 + contrast_at(s, 2 * b->fx, 2 * b->fy));
    return (own + 0.5 * harmonics) * sine_between(a, b);
}

/* The listed peak nearest to a frequency (or its opposite) within a bin and a half; NULL where there is none. */
static const peak *near(const tsuya_spectrum *s, const peak *list, int count, double fx, double fy)
{
    for (int i = 0; i < count; i++) {
        double there = hypot(list[i].fx - fx, list[i].fy - fy), opposite = hypot(list[i].fx + fx, list[i].fy + fy);
        if (fmin(there, opposite) * s->size < 1.5) {
            return &list[i];
        }
    }
    return NULL;
}

static tsuya_thread_family family_of(const peak *p)
{
    double along = atan2(p->fx, p->fy); /* image y down: frequency (fx, fy) down means (fx, −fy) up; threads at right angles */
    double angle = fmod(along + 2.0 * M_PI, M_PI);
    return (tsuya_thread_family){true, angle, 1.0 / hypot(p->fx, p->fy), 0.01};
}

static double logistic(double x)
{
    return 1.0 / (1.0 + exp(-x));
}

tsuya_status tsuya_spectrum_threads(tsuya_spectrum *s, tsuya_threads *threads, float *values)
{
    peak list[MOST_PEAKS];
    *threads = (tsuya_threads){0};
    if (!prepare(s, values)) {
        return TSUYA_OK;
    }
    TSUYA_TRY(tsuya_opencv_power_spectrum(s->power, s->padded, s->size));
    ring_medians(s);
    int count = find_peaks(s, list);
    if (count == 0) {
        return TSUYA_OK;
    }
    const peak *a = NULL, *b = NULL;
    double best = 0.0;
    for (int i = 0; i < count; i++) {
        for (int j = i + 1; j < count; j++) {
            if (sine_between(&list[i], &list[j]) > 0.77 && pair_score(s, &list[i], &list[j]) > best) { /* within 40° of square */
                best = pair_score(s, &list[i], &list[j]);
                a = &list[i];
                b = &list[j];
            }
        }
    }
    if (!a) {
        threads->a = family_of(&list[0]);
        threads->confidence = 0.1; /* one family: which of the two, nobody knows */
        return TSUYA_OK;
    }
    const peak *sum = near(s, list, count, a->fx + b->fx, a->fy + b->fy), *difference = near(s, list, count, a->fx - b->fx, a->fy - b->fy);
    if (sum && difference && sum != difference) { /* the pair was the crossing pattern */
        a = sum->power >= difference->power ? sum : difference;
        b = a == sum ? difference : sum;
    }
    threads->a = family_of(a);
    threads->b = family_of(b);
    double weaker = fmin(a->contrast, b->contrast), shared = 0.0, all = 0.0;
    for (int i = 0; i < count; i++) {
        all += list[i].power;
        shared += &list[i] == a || &list[i] == b ? list[i].power : 0.0;
    }
    threads->confidence = logistic(1.6 * (log(weaker) - log(150.0))) * fmin(1.0, 0.4 + shared / all);
    return TSUYA_OK;
}
