/* Readings of all photographs become rows of a table: the rest of the light taken off, the dye's pattern separated, cells averaged. */
#include "brdf/gather_parts.h"

#include "core/memory.h"
#include "core/order.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { REST_ROUNDS = 4, PATTERN_ROUNDS = 30, CORRELATED_PX = 8 }; /* neighbouring pixels see the same yarn */
static const double PATCH_PRIOR = 0.02, BASE_PRIOR = 0.5; /* weight of "no pattern" and of B = 1/π, shares of the usual weight */

typedef struct solve {
    const tsuya_gather *g;
    gather_reading *reading; /* sorted by cell, photograph, patch */
    size_t count;
    size_t *first;           /* of each cell, cells + 1 entries */
    size_t cells;
    double mean[3];          /* mean of f */
    double *surface, *base;  /* a cell: S (3), B */
    double *delta;           /* a patch: 3 */
} solve;

static int by_place(const void *a, const void *b)
{
    const gather_reading *x = a, *y = b;
    if (x->cell != y->cell) {
        return x->cell < y->cell ? -1 : 1;
    }
    if (x->photo != y->photo) {
        return x->photo < y->photo ? -1 : 1;
    }
    return x->patch < y->patch ? -1 : x->patch > y->patch;
}

static double reading_of(const solve *s, const gather_reading *r, int c)
{
    return (double)r->value[c] - s->mean[c] * (double)r->other[c];
}

/* The median reflectance, which the rest of the light is taken off with, and which depends on that again. */
static tsuya_status take_rest(solve *s)
{
    tsuya_status status = TSUYA_OK;
    float *list;
    TSUYA_NEW(status, list, s->count);
    for (int round = 0; round < REST_ROUNDS; round++) {
        for (int c = 0; c < 3; c++) {
            for (size_t i = 0; i < s->count; i++) {
                list[i] = (float)reading_of(s, &s->reading[i], c);
            }
            tsuya_sort_floats(list, s->count);
            s->mean[c] = fmax(0.0, (double)list[s->count / 2]);
        }
    }
    tsuya_free(list);
done:
    return status;
}

static double weight_of(const gather_reading *r) { return r->pixels; }

static void solve_surface(solve *s)
{
    for (size_t k = 0; k < s->cells; k++) {
        double sum[3] = {0}, weight = 0.0;
        for (size_t i = s->first[k]; i < s->first[k + 1]; i++) {
            const gather_reading *r = &s->reading[i];
            for (int c = 0; c < 3; c++) {
                sum[c] += weight_of(r) * (reading_of(s, r, c) - s->delta[3 * r->patch + (uint32_t)c] * s->base[k]);
            }
            weight += weight_of(r);
        }
        for (size_t c = 0; c < 3; c++) {
            s->surface[3 * k + c] = sum[c] / weight;
        }
    }
}

static void solve_base(solve *s)
{
    double usual = 0.0;
    for (int pass = 0; pass < 2; pass++) {
        for (size_t k = 0; k < s->cells; k++) {
            double product = 0.0, square = 0.0;
            for (size_t i = s->first[k]; i < s->first[k + 1]; i++) {
                const gather_reading *r = &s->reading[i];
                for (size_t c = 0; c < 3; c++) {
                    double d = s->delta[3 * r->patch + c];
                    product += weight_of(r) * d * (reading_of(s, r, (int)c) - s->surface[3 * k + c]);
                    square += weight_of(r) * d * d;
                }
            }
            usual += pass == 0 ? square / (double)s->cells : 0.0;
            if (pass == 1) {
                double prior = BASE_PRIOR * usual + 1e-30;
                s->base[k] = fmax(0.0, (product + prior / M_PI) / (square + prior));
            }
        }
    }
}

/* `sum`: 4 a patch. */
static void solve_delta(solve *s, double *sum)
{
    size_t patches = s->g->patches;
    double mean[3] = {0}, weight = 0.0, usual = 0.0;
    memset(sum, 0, 4 * patches * sizeof *sum);
    for (size_t k = 0; k < s->cells; k++) {
        for (size_t i = s->first[k]; i < s->first[k + 1]; i++) {
            const gather_reading *r = &s->reading[i];
            double *own = sum + 4 * (size_t)r->patch;
            for (size_t c = 0; c < 3; c++) {
                own[c] += weight_of(r) * s->base[k] * (reading_of(s, r, (int)c) - s->surface[3 * k + c]);
            }
            own[3] += weight_of(r) * s->base[k] * s->base[k];
        }
    }
    for (size_t p = 0; p < patches; p++) {
        usual += sum[4 * p + 3] / (double)patches;
    }
    for (size_t p = 0; p < patches; p++) {
        for (size_t c = 0; c < 3; c++) {
            s->delta[3 * p + c] = sum[4 * p + c] / (sum[4 * p + 3] + PATCH_PRIOR * usual + 1e-30);
            mean[c] += sum[4 * p + 3] * s->delta[3 * p + c];
        }
        weight += sum[4 * p + 3];
    }
    for (size_t p = 0; p < patches; p++) {
        for (size_t c = 0; c < 3 && weight > 0.0; c++) {
            s->delta[3 * p + c] -= mean[c] / weight;
        }
    }
}

static tsuya_status separate(solve *s)
{
    tsuya_status status = TSUYA_OK;
    double *sum;
    TSUYA_NEW(status, sum, 4 * (size_t)s->g->patches);
    solve_surface(s);
    for (int round = 0; round < PATTERN_ROUNDS && s->g->options.pattern; round++) {
        solve_delta(s, sum);
        if (round >= PATTERN_ROUNDS / 3) {
            solve_base(s);
        }
        solve_surface(s);
    }
    tsuya_free(sum);
done:
    return status;
}

static void spread_of(double spread[3], const solve *s)
{
    double square[3] = {0}, weight = 0.0;
    for (size_t k = 0; k < s->cells; k++) {
        for (size_t i = s->first[k]; i < s->first[k + 1]; i++) {
            for (size_t c = 0; c < 3; c++) {
                double d = s->delta[3 * s->reading[i].patch + c] * s->base[k];
                square[c] += weight_of(&s->reading[i]) * d * d;
            }
            weight += weight_of(&s->reading[i]);
        }
    }
    for (int c = 0; c < 3; c++) {
        spread[c] = sqrt(square[c] / fmax(weight, 1.0));
    }
}

/* One row out of a cell; false where too few pixels had part in it. */
static bool write_row(tsuya_gathered *out, const solve *s, size_t k)
{
    int row = out->samples.count, photos = 0, last = -1;
    double wi[3] = {0}, wo[3] = {0}, pixels = 0.0, noise = 0.0, rest = 0.0, scatter = 0.0;
    for (size_t i = s->first[k]; i < s->first[k + 1]; i++) {
        const gather_reading *r = &s->reading[i];
        double n = weight_of(r), off = reading_of(s, r, 1) - s->delta[3 * r->patch + 1] * s->base[k] - s->surface[3 * k + 1];
        for (int c = 0; c < 3; c++) {
            wi[c] += n * (double)r->wi[c];
            wo[c] += n * (double)r->wo[c];
        }
        noise += n * (double)r->square;
        scatter += n * off * off;
        rest += n * s->mean[1] * (double)r->other[1];
        pixels += n;
        photos += r->photo != last;
        last = r->photo;
    }
    double value = s->surface[3 * k + 1];
    if (pixels < s->g->options.fewest_px || !(value > 0.0)) {
        return false;
    }
    out->samples.wi[row] = tsuya_vec3_unit((tsuya_vec3){wi[0], wi[1], wi[2]});
    out->samples.wo[row] = tsuya_vec3_unit((tsuya_vec3){wo[0], wo[1], wo[2]});
    for (int c = 0; c < 3; c++) {
        out->samples.value[3 * row + c] = fmax(0.0, s->surface[3 * k + (size_t)c]);
    }
    double independent = fmax(1.0, pixels / CORRELATED_PX);
    out->sigma[row] = sqrt((noise + scatter) / pixels / independent + 0.09 * rest * rest / (pixels * pixels)) / value;
    out->photos[row] = photos;
    out->samples.count++;
    int sector, tilt;
    if (tsuya_gather_cell(&sector, &tilt, out->samples.wi[row], out->samples.wo[row])) {
        out->covered[sector][tilt]++;
    }
    return true;
}

static tsuya_status sort_readings(solve *s)
{
    tsuya_status status = TSUYA_OK;
    TSUYA_NEW(status, s->reading, s->count);
    memcpy(s->reading, s->g->reading, s->count * sizeof *s->reading);
    qsort(s->reading, s->count, sizeof *s->reading, by_place);
    TSUYA_NEW(status, s->first, s->count + 1);
    for (size_t i = 0; i < s->count; i++) {
        if (i == 0 || s->reading[i].cell != s->reading[i - 1].cell) {
            s->first[s->cells++] = i;
        }
    }
    s->first[s->cells] = s->count;
    TSUYA_NEW(status, s->surface, 3 * s->cells);
    TSUYA_NEW(status, s->base, s->cells);
    TSUYA_NEW(status, s->delta, 3 * (size_t)s->g->patches);
    for (size_t k = 0; k < s->cells; k++) {
        s->base[k] = 1.0 / M_PI;
    }
done:
    return status;
}

tsuya_status tsuya_gather_finish(tsuya_gathered *gathered, const tsuya_gather *g)
{
    tsuya_status status;
    solve s = {.g = g, .count = g->count};
    *gathered = (tsuya_gathered){0};
    if (g->count == 0) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "no pixel of %d photographs sees the surface under one lamp, unclipped", g->photos);
    }
    TSUYA_GOTO_DONE(status, sort_readings(&s));
    TSUYA_GOTO_DONE(status, take_rest(&s));
    TSUYA_GOTO_DONE(status, separate(&s));
    TSUYA_GOTO_DONE(status, tsuya_samples_create(&gathered->samples, (int)s.cells, 3, NULL));
    TSUYA_NEW(status, gathered->sigma, s.cells);
    TSUYA_NEW(status, gathered->photos, s.cells);
    gathered->samples.count = 0;
    for (size_t k = 0; k < s.cells; k++) {
        (void)write_row(gathered, &s, k);
    }
    spread_of(gathered->pattern_spread, &s);
    memcpy(gathered->mean_reflectance, s.mean, sizeof s.mean);
    if (gathered->samples.count == 0) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "no cell of directions has %d pixels; more photographs or larger cells are needed", g->options.fewest_px);
    }
done:
    tsuya_free(s.reading);
    tsuya_free(s.first);
    tsuya_free(s.surface);
    tsuya_free(s.base);
    tsuya_free(s.delta);
    if (status != TSUYA_OK) {
        tsuya_gathered_free(gathered);
    }
    return status;
}

void tsuya_gathered_free(tsuya_gathered *gathered)
{
    tsuya_samples_free(&gathered->samples);
    tsuya_free(gathered->sigma);
    tsuya_free(gathered->photos);
    *gathered = (tsuya_gathered){0};
}
