#include "brdf/nurbs.h"

#include <math.h>
#include <string.h>

static double binomial(int n, int k)
{
    double b = 1.0;
    for (int i = 1; i <= k; ++i) {
        b = b * (n - k + i) / i;
    }
    return b;
}

/* Homogeneous sums of one derivative: Σ N w P and Σ N w. */
static double curve_sums(double *sum, const tsuya_nurbs_curve *c, const double *basis, int first)
{
    double w = 0.0;
    memset(sum, 0, (size_t)c->dimension * sizeof *sum);
    for (int r = 0; r <= c->u.degree; ++r) {
        int k = (first + r) % c->u.count;
        double b = basis[r] * (c->weight ? c->weight[k] : 1.0);
        w += b;
        for (int d = 0; d < c->dimension; ++d) {
            sum[d] += b * c->control[k * c->dimension + d];
        }
    }
    return w;
}

void tsuya_nurbs_curve_eval(double *point, const tsuya_nurbs_curve *c, double u, int derivatives)
{
    double basis[TSUYA_BASIS_MAX_ORDER * (TSUYA_BASIS_MAX_ORDER + 1)], weight[TSUYA_BASIS_MAX_ORDER + 1];
    int order = derivatives < TSUYA_BASIS_MAX_ORDER ? derivatives : TSUYA_BASIS_MAX_ORDER;
    int first = tsuya_basis_eval(basis, &c->u, u, order), dim = c->dimension;
    for (int k = 0; k <= derivatives; ++k) {
        double *out = point + k * dim;
        if (k > order) {
            memset(out, 0, (size_t)dim * sizeof *out);
            weight[TSUYA_BASIS_MAX_ORDER] = 0.0;
            continue;
        }
        weight[k] = curve_sums(out, c, basis + k * (c->u.degree + 1), first);
        if (!c->weight) {
            continue;
        }
        for (int d = 0; d < dim; ++d) {
            for (int i = 1; i <= k; ++i) {
                out[d] -= binomial(k, i) * weight[i] * point[(k - i) * dim + d];
            }
            out[d] /= weight[0];
        }
    }
}

void tsuya_nurbs_surface_eval(double *point, double *du, double *dv, const tsuya_nurbs_surface *s, double u, double v)
{
    double bu[2 * TSUYA_BASIS_MAX_ORDER], bv[2 * TSUYA_BASIS_MAX_ORDER];
    int order = du || dv ? 1 : 0, pu = s->u.degree, pv = s->v.degree, dim = s->dimension;
    int fu = tsuya_basis_eval(bu, &s->u, u, order), fv = tsuya_basis_eval(bv, &s->v, v, order);
    double sum[3][TSUYA_NURBS_MAX_DIMENSION] = {{0}}, w[3] = {0};
    for (int i = 0; i <= pu; ++i) {
        for (int j = 0; j <= pv; ++j) {
            int k = (fu + i) % s->u.count * s->v.count + (fv + j) % s->v.count;
            double a = s->weight ? s->weight[k] : 1.0;
            const double b[3] = {a * bu[i] * bv[j], order ? a * bu[pu + 1 + i] * bv[j] : 0.0, order ? a * bu[i] * bv[pv + 1 + j] : 0.0};
            for (int m = 0; m < 3; ++m) {
                w[m] += b[m];
                for (int d = 0; d < dim; ++d) {
                    sum[m][d] += b[m] * s->control[k * dim + d];
                }
            }
        }
    }
    for (int d = 0; d < dim; ++d) {
        point[d] = s->weight ? sum[0][d] / w[0] : sum[0][d];
        if (du) {
            du[d] = s->weight ? (sum[1][d] - w[1] * point[d]) / w[0] : sum[1][d];
        }
        if (dv) {
            dv[d] = s->weight ? (sum[2][d] - w[2] * point[d]) / w[0] : sum[2][d];
        }
    }
}

/* Insertion of `at` into a knot vector, and what it does to every row of coefficients. */
typedef struct insertion {
    const tsuya_knots *knots;
    int span;
    double at;
} insertion;

static double knot_of(const tsuya_knots *k, int i)
{
    if (!k->periodic) {
        return k->knot[i];
    }
    int n = k->count, turn = i >= 0 ? i / n : -((n - 1 - i) / n);
    return k->knot[i - turn * n] + turn * (k->knot[n] - k->knot[0]);
}

static tsuya_status begin_insertion(insertion *in, double *knot, const tsuya_knots *k, double at)
{
    double x = at;
    if (!(at >= tsuya_knots_low(k) && at <= tsuya_knots_high(k))) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "knot %g: expected one in [%g, %g]", at, tsuya_knots_low(k), tsuya_knots_high(k));
    }
    *in = (insertion){k, tsuya_knots_span(k, &x), at};
    int total = k->periodic ? k->count + 1 : k->count + k->degree + 1, repeated = 0;
    for (int i = 0; i < total; ++i) {
        repeated += k->knot[i] == at;
    }
    if (repeated >= (k->periodic ? 1 : k->degree)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "knot %g: is there %d times already", at, repeated);
    }
    memcpy(knot, k->knot, (size_t)(in->span + 1) * sizeof *knot);
    knot[in->span + 1] = at;
    memcpy(knot + in->span + 2, k->knot + in->span + 1, (size_t)(total - in->span - 1) * sizeof *knot);
    return TSUYA_OK;
}

/* New coefficient i as (1 − a) old[i − 1] + a old[i]; open and periodic knots alike with indices that may leave one period. */
static double share_of(const insertion *in, int i)
{
    int p = in->knots->degree;
    if (i <= in->span - p) {
        return 1.0;
    }
    if (i > in->span) {
        return 0.0;
    }
    double low = knot_of(in->knots, i), high = knot_of(in->knots, i + p);
    return (in->at - low) / (high - low);
}

/* Function i of a periodic vector starts at knot i; the window that changes is span − p … span. */
static void refine_row(double *to, const insertion *in, const double *from, int stride)
{
    int n = in->knots->count, p = in->knots->degree;
    if (!in->knots->periodic) {
        for (int i = 0; i <= n; ++i) {
            double a = share_of(in, i);
            double old = a < 1.0 ? from[(i - 1) * stride] : 0.0, now = a > 0.0 ? from[i * stride] : 0.0;
            to[i * stride] = (1.0 - a) * old + a * now;
        }
        return;
    }
    for (int k = 0; k <= n; ++k) { /* new index, unwrapped so that the window is in one piece */
        int i = in->span - p + k;
        double a = share_of(in, i);
        int old = ((i - 1) % n + n) % n, now = (i % n + n) % n, target = (i % (n + 1) + n + 1) % (n + 1);
        to[target * stride] = (1.0 - a) * from[old * stride] + a * from[now * stride];
    }
}

static void refine_points(double *control, double *weight, const insertion *in, const double *old_control, const double *old_weight,
                          int dimension, int stride)
{
    int n = in->knots->count;
    if (old_weight) {
        refine_row(weight, in, old_weight, stride);
    }
    for (int d = 0; d < dimension; ++d) {
        if (!old_weight) {
            refine_row(control + d, in, old_control + d, stride * dimension);
            continue;
        }
        for (int i = 0; i <= n; ++i) { /* homogeneous, two old points at a time */
            int j = in->knots->periodic ? in->span - in->knots->degree + i : i;
            double a = share_of(in, j);
            int old = ((j - 1) % n + n) % n * stride, now = (j % n + n) % n * stride;
            int to = (in->knots->periodic ? (j % (n + 1) + n + 1) % (n + 1) : j) * stride;
            double h = a < 1.0 ? (1.0 - a) * old_weight[old] * old_control[old * dimension + d] : 0.0;
            h += a > 0.0 ? a * old_weight[now] * old_control[now * dimension + d] : 0.0;
            control[to * dimension + d] = h / weight[to];
        }
    }
}

tsuya_status tsuya_nurbs_curve_insert(tsuya_nurbs_curve *refined, double *knot, double *control, double *weight,
                                      const tsuya_nurbs_curve *curve, double u)
{
    insertion in;
    TSUYA_TRY(begin_insertion(&in, knot, &curve->u, u));
    refine_points(control, weight, &in, curve->control, curve->weight, curve->dimension, 1);
    *refined = (tsuya_nurbs_curve){{curve->u.degree, curve->u.count + 1, curve->u.periodic, knot}, curve->dimension, control,
                                   curve->weight ? weight : NULL};
    return TSUYA_OK;
}

tsuya_status tsuya_nurbs_surface_insert(tsuya_nurbs_surface *refined, double *knot, double *control, double *weight,
                                        const tsuya_nurbs_surface *s, bool along_v, double at)
{
    insertion in;
    const tsuya_knots *k = along_v ? &s->v : &s->u;
    TSUYA_TRY(begin_insertion(&in, knot, k, at));
    int rows = along_v ? s->u.count : s->v.count, dim = s->dimension, stride = along_v ? 1 : s->v.count;
    for (int r = 0; r < rows; ++r) {
        int from = along_v ? r * s->v.count : r, to = along_v ? r * (s->v.count + 1) : r;
        refine_points(control + to * dim, weight ? weight + to : NULL, &in, s->control + from * dim, s->weight ? s->weight + from : NULL,
                      dim, stride);
    }
    *refined = *s;
    *(along_v ? &refined->v : &refined->u) = (tsuya_knots){k->degree, k->count + 1, k->periodic, knot};
    refined->control = control;
    refined->weight = s->weight ? weight : NULL;
    return TSUYA_OK;
}
