#include "reconstruct/prior_spline.h"

#include <math.h>
#include <string.h>

enum { MOST_COEFFICIENTS = 1600, SUPPORT = 4, MOST_ORDER = 4 };

tsuya_status tsuya_prior_spline_create(prior_spline *s, int left_px, int top_px, int width_px, int height_px, double cell_px)
{
    *s = (prior_spline){.cell_px = cell_px, .left_px = left_px, .top_px = top_px};
    for (;; s->cell_px *= 1.1) {
        s->columns = (int)ceil(width_px / s->cell_px) + SUPPORT - 1;
        s->rows = (int)ceil(height_px / s->cell_px) + SUPPORT - 1;
        if (s->columns * s->rows <= MOST_COEFFICIENTS) {
            break;
        }
    }
    s->coefficient = tsuya_calloc((size_t)s->columns * (size_t)s->rows, sizeof *s->coefficient);
    return s->coefficient ? TSUYA_OK : TSUYA_ERROR_MEMORY;
}

void tsuya_prior_spline_free(prior_spline *s)
{
    tsuya_free(s->coefficient);
    *s = (prior_spline){0};
}

/* The four functions that reach a place, with first and second derivatives by cells. */
typedef struct basis { int first; double f[3][SUPPORT]; } basis;

static basis basis_at(double at_px, double cell_px, int count)
{
    basis b;
    double t = at_px / cell_px;
    b.first = t < 0.0 ? 0 : (int)t;
    b.first = b.first > count - SUPPORT ? count - SUPPORT : b.first;
    t -= b.first;
    const double s = 1.0 - t;
    const double f[3][SUPPORT] = {
        {s * s * s / 6.0, (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0, (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0, t * t * t / 6.0},
        {-0.5 * s * s, 1.5 * t * t - 2.0 * t, -1.5 * s * s + 2.0 * s, 0.5 * t * t},
        {s, 3.0 * t - 2.0, 3.0 * s - 2.0, t},
    };
    memcpy(b.f, f, sizeof f);
    return b;
}

prior_place tsuya_prior_spline_at(const prior_spline *s, double x_px, double y_px)
{
    const basis x = basis_at(x_px - s->left_px, s->cell_px, s->columns), y = basis_at(y_px - s->top_px, s->cell_px, s->rows);
    double d[3][3] = {{0}}; /* derivatives by x, by y */
    for (int j = 0; j < SUPPORT; j++) {
        const double *c = s->coefficient + (size_t)(y.first + j) * (size_t)s->columns + x.first;
        for (int i = 0; i < SUPPORT; i++) {
            for (int k = 0; k < 3; k++) {
                for (int l = 0; k + l < 3; l++) {
                    d[k][l] += c[i] * x.f[k][i] * y.f[l][j];
                }
            }
        }
    }
    const double mean = 0.5 * (d[2][0] + d[0][2]), half = hypot(0.5 * (d[2][0] - d[0][2]), d[1][1]);
    return (prior_place){d[0][0], {d[1][0] / s->cell_px, d[0][1] / s->cell_px}, (fabs(mean) + half) / (s->cell_px * s->cell_px)};
}

/* ---- normal equations, lower band: entry (row, row − k) at [row·(band + 1) + k] ---- */

typedef struct banded { int count, band; double *matrix, *right; } banded;

/* Adds w·v vᵀ for a short vector of entries with ascending positions. */
static void add_outer(banded *b, const int *at, const double *v, int count, double weight)
{
    for (int i = 0; i < count; i++) {
        double *row = b->matrix + (size_t)at[i] * (size_t)(b->band + 1);
        for (int k = 0; k <= i; k++) {
            row[at[i] - at[k]] += weight * v[i] * v[k];
        }
    }
}

static void add_samples(banded *b, const prior_spline *s, const prior_sample *sample, size_t count)
{
    for (size_t n = 0; n < count; n++) {
        double v[SUPPORT * SUPPORT];
        int at[SUPPORT * SUPPORT];
        const basis x = basis_at(sample[n].x_px - s->left_px, s->cell_px, s->columns);
        const basis y = basis_at(sample[n].y_px - s->top_px, s->cell_px, s->rows);
        if (!(sample[n].weight > 0.0f)) {
            continue;
        }
        for (int k = 0; k < SUPPORT * SUPPORT; k++) {
            at[k] = (y.first + k / SUPPORT) * s->columns + x.first + k % SUPPORT;
            v[k] = x.f[0][k % SUPPORT] * y.f[0][k / SUPPORT];
            b->right[at[k]] += (double)sample[n].weight * v[k] * (double)sample[n].value;
        }
        add_outer(b, at, v, SUPPORT * SUPPORT, (double)sample[n].weight);
    }
}

/* Mixed differences of `order`: across columns k times, across rows order − k times, with the binomial weight that makes
 * the sum the same in every direction. */
static void add_penalty(banded *b, const prior_spline *s, int order, double stiffness)
{
    static const double difference[MOST_ORDER + 1][MOST_ORDER + 1] = {{1}, {-1, 1}, {1, -2, 1}, {-1, 3, -3, 1}, {1, -4, 6, -4, 1}};
    for (int k = 0; k <= order; k++) {
        const int across = k + 1, down = order - k + 1;
        const double weight = stiffness * fabs(difference[order][k]);
        for (int row = 0; row + down <= s->rows; row++) {
            for (int column = 0; column + across <= s->columns; column++) {
                int at[(MOST_ORDER + 1) * (MOST_ORDER + 1)];
                double v[(MOST_ORDER + 1) * (MOST_ORDER + 1)];
                for (int n = 0; n < across * down; n++) {
                    at[n] = (row + n / across) * s->columns + column + n % across;
                    v[n] = difference[k][n % across] * difference[order - k][n / across];
                }
                add_outer(b, at, v, across * down, weight);
            }
        }
    }
}

/* Cholesky and both substitutions in place; false where a pivot vanishes. */
static bool solve(banded *b)
{
    const int band = b->band;
    const size_t stride = (size_t)band + 1;
    for (int i = 0; i < b->count; i++) {
        double *row = b->matrix + (size_t)i * stride;
        for (int j = i > band ? i - band : 0; j <= i; j++) {
            const double *other = b->matrix + (size_t)j * stride;
            double sum = row[i - j];
            int first = i > band ? i - band : 0;
            first = j > band && j - band > first ? j - band : first;
            for (int k = first; k < j; k++) {
                sum -= row[i - k] * other[j - k];
            }
            if (i == j) {
                if (!(sum > 0.0)) {
                    return false;
                }
                row[0] = sqrt(sum);
            } else {
                row[i - j] = sum / other[0];
            }
        }
    }
    for (int i = 0; i < b->count; i++) {
        const double *row = b->matrix + (size_t)i * stride;
        for (int k = i > band ? i - band : 0; k < i; k++) {
            b->right[i] -= row[i - k] * b->right[k];
        }
        b->right[i] /= row[0];
    }
    for (int i = b->count - 1; i >= 0; i--) {
        const double *row = b->matrix + (size_t)i * stride;
        b->right[i] /= row[0];
        for (int k = i > band ? i - band : 0; k < i; k++) {
            b->right[k] -= row[i - k] * b->right[i];
        }
    }
    return true;
}

tsuya_status tsuya_prior_spline_fit(prior_spline *s, bool *solved, const prior_sample *sample, size_t count, int order,
                                    double stiffness)
{
    const int reach = order > SUPPORT - 1 ? order : SUPPORT - 1;
    banded b = {.count = s->columns * s->rows, .band = reach * s->columns + reach};
    tsuya_status status = TSUYA_OK;
    *solved = false;
    TSUYA_NEW(status, b.matrix, (size_t)b.count * (size_t)(b.band + 1));
    TSUYA_NEW(status, b.right, (size_t)b.count);
    add_samples(&b, s, sample, count);
    add_penalty(&b, s, order, stiffness);
    for (int i = 0; i < b.count; i++) { /* what neither samples nor differences hold */
        b.matrix[(size_t)i * (size_t)(b.band + 1)] += 1e-9 * stiffness;
    }
    if (solve(&b)) {
        memcpy(s->coefficient, b.right, (size_t)b.count * sizeof *b.right);
        *solved = true;
    }
done:
    tsuya_free(b.matrix);
    tsuya_free(b.right);
    return status;
}
