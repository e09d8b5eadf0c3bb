/* B-splines: partition of unity, derivatives against complex steps and differences, knot insertion that keeps the shape, values
 * against SISL. */
#include "brdf/nurbs.h"
#include "core/context.h"
#include "support.h"

#include <complex.h>
#include <math.h>
#include <sisl.h>

enum { MAX = 40 };
static double uniform(uint64_t k) { return tsuya_random_uniform(11, 3, k); }

static tsuya_knots random_open(double *knot, int degree, int count, uint64_t seed)
{
    double x = -0.3;
    for (int i = 0; i < count + degree + 1; ++i) {
        bool end = i <= degree || i > count;
        bool same = !end && degree > 1 && i > degree + 1 && uniform(seed + (uint64_t)i) < 0.2 && knot[i - 1] != knot[i - 2];
        x += end && i != degree + 1 ? (i == count ? 0.5 : 0.0) : same ? 0.0 : 0.1 + uniform(seed + 99 + (uint64_t)i);
        knot[i] = i == count ? x + 0.4 : i > count ? knot[count] : i <= degree ? -0.3 : x;
    }
    return (tsuya_knots){degree, count, false, knot};
}

static tsuya_knots random_periodic(double *knot, int degree, int count, uint64_t seed)
{
    knot[0] = 0.2;
    for (int i = 1; i <= count; ++i) {
        knot[i] = knot[i - 1] + 0.1 + uniform(seed + (uint64_t)i);
    }
    return (tsuya_knots){degree, count, true, knot};
}

static tsuya_knots knots_of_case(double *knot, int k)
{
    int degree = 1 + k % 5, count = degree + 2 + k % 7;
    return k % 2 ? random_periodic(knot, degree, count, (uint64_t)(1000 * k)) : random_open(knot, degree, count, (uint64_t)(1000 * k));
}

static double place(const tsuya_knots *k, int i, int n) { return tsuya_knots_low(k) + (tsuya_knots_high(k) - tsuya_knots_low(k)) * i / n; }

static void test_partition_of_unity(void **state)
{
    (void)state;
    for (int k = 0; k < 40; ++k) {
        double knot[MAX], n[3 * TSUYA_BASIS_MAX_ORDER];
        tsuya_knots knots = knots_of_case(knot, k);
        assert_true(tsuya_knots_valid(&knots));
        for (int i = 0; i <= 200; ++i) {
            tsuya_basis_eval(n, &knots, place(&knots, i, 200), 1);
            double sum = 0.0, slope = 0.0;
            for (int r = 0; r <= knots.degree; ++r) {
                assert_true(n[r] >= -1e-15);
                sum += n[r];
                slope += n[knots.degree + 1 + r];
            }
            assert_true(fabs(sum - 1.0) < 1e-13 && fabs(slope) < 1e-10);
        }
    }
}

/* Cox–de Boor by its definition in complex arithmetic: Im N(x + ih)/h is the derivative to machine precision. */
static double complex definition(const double *t, int i, int p, double complex x, double real)
{
    if (p == 0) {
        return real >= t[i] && real < t[i + 1] ? 1.0 : 0.0;
    }
    double complex a = t[i + p] > t[i] ? (x - t[i]) / (t[i + p] - t[i]) * definition(t, i, p - 1, x, real) : 0.0;
    double complex b = t[i + p + 1] > t[i + 1] ? (t[i + p + 1] - x) / (t[i + p + 1] - t[i + 1]) * definition(t, i + 1, p - 1, x, real) : 0.0;
    return a + b;
}

static void test_derivatives_by_complex_step(void **state)
{
    (void)state;
    for (int k = 0; k < 20; k += 2) {
        double knot[MAX], n[2 * TSUYA_BASIS_MAX_ORDER];
        tsuya_knots knots = knots_of_case(knot, k);
        for (int i = 1; i < 60; ++i) {
            double x = place(&knots, i, 60);
            int first = tsuya_basis_eval(n, &knots, x, 1);
            for (int r = 0; r <= knots.degree; ++r) {
                double complex d = definition(knot, first + r, knots.degree, x + 1e-30 * I, x);
                assert_true(fabs(creal(d) - n[r]) < 1e-13);
                assert_true(fabs(cimag(d) * 1e30 - n[knots.degree + 1 + r]) < 1e-11 * (1.0 + fabs(n[knots.degree + 1 + r])));
            }
        }
    }
}

static void random_points(double *control, double *weight, int count, int dimension, uint64_t seed)
{
    for (int i = 0; i < count * dimension; ++i) {
        control[i] = 2.0 * uniform(seed + (uint64_t)i) - 1.0;
    }
    for (int i = 0; i < count; ++i) {
        weight[i] = 0.3 + 2.0 * uniform(seed + 7777 + (uint64_t)i);
    }
}

static void test_curve_derivatives_and_period(void **state)
{
    (void)state;
    for (int k = 0; k < 24; ++k) {
        double knot[MAX], control[3 * MAX], weight[MAX], p[9], a[9], b[9];
        tsuya_knots knots = knots_of_case(knot, k);
        random_points(control, weight, knots.count, 3, (uint64_t)k);
        tsuya_nurbs_curve curve = {knots, 3, control, k % 3 ? weight : NULL};
        for (int i = 1; i < 50; ++i) {
            const double h = 1e-5;
            double x = place(&knots, i, 50) + 0.001;
            tsuya_nurbs_curve_eval(p, &curve, x, 2);
            tsuya_nurbs_curve_eval(a, &curve, x - h, 1);
            tsuya_nurbs_curve_eval(b, &curve, x + h, 1);
            bool smooth = true; /* differences must not straddle a knot */
            for (int j = 0; j <= knots.count; ++j) {
                smooth &= fabs(knot[j] - x) > 2.0 * h;
            }
            for (int d = 0; d < 3 && smooth && x + h < tsuya_knots_high(&knots); ++d) {
                assert_true(fabs((b[d] - a[d]) / (2 * h) - p[3 + d]) < 1e-5 * (1.0 + fabs(p[3 + d])));
                assert_true(fabs((b[3 + d] - a[3 + d]) / (2 * h) - p[6 + d]) < 1e-4 * (1.0 + fabs(p[6 + d])));
            }
            if (knots.periodic) {
                tsuya_nurbs_curve_eval(a, &curve, x + 3.0 * (tsuya_knots_high(&knots) - tsuya_knots_low(&knots)), 0);
                assert_true(fabs(a[0] - p[0]) < 1e-11);
            }
        }
    }
}

static void test_insertion_keeps_the_curve(void **state)
{
    (void)state;
    for (int k = 0; k < 24; ++k) {
        double knot[MAX], control[2 * MAX], weight[MAX], new_knot[MAX + 1], new_control[2 * MAX + 2], new_weight[MAX + 1], p[2], q[2];
        tsuya_knots knots = knots_of_case(knot, k);
        random_points(control, weight, knots.count, 2, (uint64_t)(50 + k));
        tsuya_nurbs_curve curve = {knots, 2, control, k % 3 ? weight : NULL}, refined;
        for (int j = 1; j < 12; ++j) {
            double at = place(&knots, j, 12) + 0.00037;
            assert_ok(tsuya_nurbs_curve_insert(&refined, new_knot, new_control, new_weight, &curve, at));
            assert_true(tsuya_knots_valid(&refined.u));
            for (int i = 0; i <= 100; ++i) {
                double x = place(&knots, i, 100);
                tsuya_nurbs_curve_eval(p, &curve, x, 0);
                tsuya_nurbs_curve_eval(q, &refined, x, 0);
                assert_true(fabs(p[0] - q[0]) < 1e-12 && fabs(p[1] - q[1]) < 1e-12);
            }
        }
        assert_fails(tsuya_nurbs_curve_insert(&refined, new_knot, new_control, new_weight, &curve, 99.0), "expected one in");
    }
}

static void test_insertion_keeps_the_surface(void **state)
{
    (void)state;
    for (int k = 0; k < 12; ++k) {
        double ku[MAX], kv[MAX], control[3 * 400], weight[400], nk[MAX + 1], nc[3 * 440], nw[440], p[3], q[3], du[3], dv[3], a[3];
        tsuya_knots u = knots_of_case(ku, k), v = knots_of_case(kv, k / 2 + 5);
        random_points(control, weight, u.count * v.count, 3, (uint64_t)(500 + k));
        tsuya_nurbs_surface surface = {u, v, 3, control, k % 3 ? weight : NULL}, refined;
        bool along_v = k % 4 > 1;
        const tsuya_knots *across = along_v ? &v : &u;
        assert_ok(tsuya_nurbs_surface_insert(&refined, nk, nc, nw, &surface, along_v, place(across, 5, 11) + 0.0003));
        for (int i = 1; i < 100; ++i) {
            double x = place(&u, i, 100), y = place(&v, (i * 37) % 100, 100);
            tsuya_nurbs_surface_eval(p, du, dv, &surface, x, y);
            tsuya_nurbs_surface_eval(q, NULL, NULL, &refined, x, y);
            tsuya_nurbs_surface_eval(a, NULL, NULL, &surface, x + 1e-6, y);
            assert_true(fabs(p[0] - q[0]) < 1e-12 && fabs(p[2] - q[2]) < 1e-12);
            assert_true(u.degree < 2 || fabs((a[1] - p[1]) / 1e-6 - du[1]) < 1e-3 * (1.0 + fabs(du[1])));
        }
    }
}

/* SINTEF's spline library as oracle. */
static void test_against_sisl(void **state)
{
    (void)state;
    for (int k = 0; k < 24; k += 2) {
        double knot[MAX], control[2 * MAX], weight[MAX], homogeneous[3 * MAX], p[4], q[4];
        tsuya_knots knots = knots_of_case(knot, k);
        random_points(control, weight, knots.count, 2, (uint64_t)(900 + k));
        for (int i = 0; i < knots.count; ++i) {
            homogeneous[3 * i] = control[2 * i] * weight[i];
            homogeneous[3 * i + 1] = control[2 * i + 1] * weight[i];
            homogeneous[3 * i + 2] = weight[i];
        }
        tsuya_nurbs_curve curve = {knots, 2, control, weight};
        SISLCurve *oracle = newCurve(knots.count, knots.degree + 1, knot, homogeneous, 2, 2, 1);
        for (int i = 1; i < 100; ++i) {
            int left = 0, failed = 0;
            double x = place(&knots, i, 100);
            s1227(oracle, 1, x, &left, q, &failed);
            tsuya_nurbs_curve_eval(p, &curve, x, 1);
            assert_int_equal(failed, 0);
            for (int d = 0; d < 4; ++d) {
                bool kink = d > 1 && knots.degree < 2; /* one-sided derivatives differ at knots of a polygon */
                assert_true(kink || fabs(p[d] - q[d]) <= 1e-12 * fmax(1.0, fabs(q[d])) * 10.0);
            }
        }
        freeCurve(oracle);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_partition_of_unity),          cmocka_unit_test(test_derivatives_by_complex_step),
        cmocka_unit_test(test_curve_derivatives_and_period), cmocka_unit_test(test_insertion_keeps_the_curve),
        cmocka_unit_test(test_insertion_keeps_the_surface),  cmocka_unit_test(test_against_sisl),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
