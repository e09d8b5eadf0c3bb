/* Distance of a vertex and a triangle, of two edges (C. Ericson, "Real-Time Collision Detection", 2005, 5.1.5 and 5.1.9). */
#include "capture/drape_parts.h"

static double dot3(const double *a, const double *b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }
static void sub3(double *out, const double *a, const double *b)
{
    for (int i = 0; i < 3; i++) {
        out[i] = a[i] - b[i];
    }
}
static double clamp01(double t) { return t < 0.0 ? 0.0 : t > 1.0 ? 1.0 : t; }

/* Weights of the triangle's corners at the point nearest to p. */
static void nearest_in_triangle(const double *p, const double *a, const double *b, const double *c, double w[3])
{
    double ab[3], ac[3], ap[3], bp[3], cp[3];
    sub3(ab, b, a);
    sub3(ac, c, a);
    sub3(ap, p, a);
    sub3(bp, p, b);
    sub3(cp, p, c);
    double d1 = dot3(ab, ap), d2 = dot3(ac, ap), d3 = dot3(ab, bp), d4 = dot3(ac, bp), d5 = dot3(ab, cp), d6 = dot3(ac, cp);
    double vc = d1 * d4 - d3 * d2, vb = d5 * d2 - d1 * d6, va = d3 * d6 - d5 * d4, t;
    w[0] = w[1] = w[2] = 0.0;
    if (d1 <= 0.0 && d2 <= 0.0) {
        w[0] = 1.0;
    } else if (d3 >= 0.0 && d4 <= d3) {
        w[1] = 1.0;
    } else if (vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0) {
        t = d1 / (d1 - d3);
        w[0] = 1.0 - t;
        w[1] = t;
    } else if (d6 >= 0.0 && d5 <= d6) {
        w[2] = 1.0;
    } else if (vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0) {
        t = d2 / (d2 - d6);
        w[0] = 1.0 - t;
        w[2] = t;
    } else if (va <= 0.0 && d4 - d3 >= 0.0 && d5 - d6 >= 0.0) {
        t = (d4 - d3) / ((d4 - d3) + (d5 - d6));
        w[1] = 1.0 - t;
        w[2] = t;
    } else {
        w[1] = vb / (va + vb + vc);
        w[2] = vc / (va + vb + vc);
        w[0] = 1.0 - w[1] - w[2];
    }
}

static void nearest_on_edges(const double p[12], double *s, double *t)
{
    double d1[3], d2[3], r[3];
    sub3(d1, p + 3, p);
    sub3(d2, p + 9, p + 6);
    sub3(r, p, p + 6);
    double a = dot3(d1, d1), e = dot3(d2, d2), f = dot3(d2, r), c = dot3(d1, r), b = dot3(d1, d2), det = a * e - b * b;
    *s = det > 1e-12 * a * e ? clamp01((b * f - c * e) / det) : 0.5;
    *t = (b * *s + f) / e;
    if (*t < 0.0 || *t > 1.0) {
        *t = clamp01(*t);
        *s = clamp01((b * *t - c) / a);
    } else if (det <= 1e-12 * a * e) {
        *s = clamp01((b * *t - c) / a);
    }
}

double tsuya_drape_pair_distance(const double p[12], bool is_edges, double w[4])
{
    double d[3] = {0, 0, 0};
    if (is_edges) {
        double s, t;
        nearest_on_edges(p, &s, &t);
        w[0] = 1.0 - s;
        w[1] = s;
        w[2] = t - 1.0;
        w[3] = -t;
    } else {
        double c[3];
        nearest_in_triangle(p, p + 3, p + 6, p + 9, c);
        w[0] = 1.0;
        w[1] = -c[0];
        w[2] = -c[1];
        w[3] = -c[2];
    }
    for (int k = 0; k < 4; k++) {
        for (int i = 0; i < 3; i++) {
            d[i] += w[k] * p[3 * k + i];
        }
    }
    return sqrt(dot3(d, d));
}
