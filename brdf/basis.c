#include "brdf/basis.h"

#include <math.h>
#include <string.h>

bool tsuya_knots_valid(const tsuya_knots *k)
{
    int p = k->degree;
    if (p < 1 || p > TSUYA_BASIS_MAX_DEGREE || k->count < p + 1) {
        return false;
    }
    int knots = k->periodic ? k->count + 1 : k->count + p + 1;
    for (int i = 0; i < knots; ++i) {
        if (!isfinite(k->knot[i]) || (i > 0 && !(k->periodic ? k->knot[i] > k->knot[i - 1] : k->knot[i] >= k->knot[i - 1]))) {
            return false;
        }
    }
    for (int i = 0; !k->periodic && i < k->count; ++i) {
        bool interior = i > 0 && i + p < k->count + p;
        if (!(k->knot[i + p + 1] > k->knot[i]) || (interior && i + p < k->count && !(k->knot[i + p] > k->knot[i]))) {
            return false;
        }
    }
    return true;
}

static double wrapped(const tsuya_knots *k, double x)
{
    double low = k->knot[0], period = k->knot[k->count] - low, t = x - period * floor((x - low) / period);
    return t < k->knot[k->count] && t >= low ? t : low;
}

int tsuya_knots_span(const tsuya_knots *k, double *x)
{
    int low = k->periodic ? 0 : k->degree, high = k->count; /* intervals low … high − 1 */
    if (k->periodic) {
        *x = wrapped(k, *x);
    } else {
        *x = fmin(fmax(*x, k->knot[low]), k->knot[high]);
        if (*x >= k->knot[high]) {
            int i = high - 1;
            while (i > low && k->knot[i] == k->knot[high]) {
                i--;
            }
            return i;
        }
    }
    while (high - low > 1) {
        int middle = (low + high) / 2;
        if (*x < k->knot[middle]) {
            high = middle;
        } else {
            low = middle;
        }
    }
    return low;
}

/* Knot number i, also outside one period. */
static double knot_at(const tsuya_knots *k, int i)
{
    if (!k->periodic) {
        return k->knot[i];
    }
    int n = k->count, turn = i >= 0 ? i / n : -((n - 1 - i) / n);
    return k->knot[i - turn * n] + turn * (k->knot[n] - k->knot[0]);
}

typedef struct triangle {
    double ndu[TSUYA_BASIS_MAX_ORDER][TSUYA_BASIS_MAX_ORDER];
} triangle;

/* t points at the middle of the window: t[1 − p] … t[p]. */
static void fill_triangle(triangle *m, int p, const double *t, double x)
{
    double left[TSUYA_BASIS_MAX_ORDER], right[TSUYA_BASIS_MAX_ORDER];
    m->ndu[0][0] = 1.0;
    for (int j = 1; j <= p; ++j) {
        left[j] = x - t[1 - j];
        right[j] = t[j] - x;
        double saved = 0.0;
        for (int r = 0; r < j; ++r) {
            m->ndu[j][r] = right[r + 1] + left[j - r];
            double part = m->ndu[r][j - 1] / m->ndu[j][r];
            m->ndu[r][j] = saved + right[r + 1] * part;
            saved = left[j - r] * part;
        }
        m->ndu[j][j] = saved;
    }
}

static void derive(double *values, const triangle *m, int p, int r, int order)
{
    double a[2][TSUYA_BASIS_MAX_ORDER] = {{1.0}};
    int now = 0;
    for (int k = 1; k <= order; ++k) {
        int then = 1 - now, rk = r - k, pk = p - k;
        double d = 0.0;
        if (rk >= 0) {
            a[then][0] = a[now][0] / m->ndu[pk + 1][rk];
            d = a[then][0] * m->ndu[rk][pk];
        }
        int from = rk >= -1 ? 1 : -rk, to = r - 1 <= pk ? k - 1 : p - r;
        for (int j = from; j <= to; ++j) {
            a[then][j] = (a[now][j] - a[now][j - 1]) / m->ndu[pk + 1][rk + j];
            d += a[then][j] * m->ndu[rk + j][pk];
        }
        if (r <= pk) {
            a[then][k] = -a[now][k - 1] / m->ndu[pk + 1][r];
            d += a[then][k] * m->ndu[r][pk];
        }
        values[k * (p + 1) + r] = d;
        now = then;
    }
}

int tsuya_basis_eval(double *values, const tsuya_knots *knots, double x, int derivatives)
{
    int p = knots->degree, span = tsuya_knots_span(knots, &x), order = derivatives < p ? derivatives : p;
    double window[2 * TSUYA_BASIS_MAX_ORDER], *t = window + TSUYA_BASIS_MAX_DEGREE;
    for (int j = 1 - p; j <= p; ++j) {
        t[j] = knot_at(knots, span + j);
    }
    triangle m;
    fill_triangle(&m, p, t, x);
    for (int r = 0; r <= p; ++r) {
        values[r] = m.ndu[r][p];
    }
    if (derivatives > 0) {
        memset(values + p + 1, 0, (size_t)(derivatives * (p + 1)) * sizeof *values);
        for (int r = 0; r <= p; ++r) {
            derive(values, &m, p, r, order);
        }
        double factor = p;
        for (int k = 1; k <= order; factor *= p - k, ++k) {
            for (int r = 0; r <= p; ++r) {
                values[k * (p + 1) + r] *= factor;
            }
        }
    }
    int first = span - p;
    return knots->periodic ? (first % knots->count + knots->count) % knots->count : first;
}
