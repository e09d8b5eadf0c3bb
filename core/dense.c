#include "core/dense.h"

#include <math.h>

enum { SWEEPS = 40 };

bool tsuya_dense_cholesky(double *a, int n)
{
    for (int c = 0; c < n; c++) {
        double diagonal = a[c * n + c];
        for (int k = 0; k < c; k++) {
            diagonal -= a[c * n + k] * a[c * n + k];
            a[k * n + c] = 0.0;
        }
        if (!(diagonal > 1e-13 * a[c * n + c])) {
            return false;
        }
        a[c * n + c] = sqrt(diagonal);
        for (int r = c + 1; r < n; r++) {
            for (int k = 0; k < c; k++) {
                a[r * n + c] -= a[r * n + k] * a[c * n + k];
            }
            a[r * n + c] /= a[c * n + c];
        }
    }
    return true;
}

void tsuya_dense_forward(const double *l, double *b, int n, int m)
{
    for (int r = 0; r < n; r++) {
        for (int k = 0; k < r; k++) {
            for (int j = 0; j < m; j++) {
                b[r * m + j] -= l[r * n + k] * b[k * m + j];
            }
        }
        for (int j = 0; j < m; j++) {
            b[r * m + j] /= l[r * n + r];
        }
    }
}

void tsuya_dense_backward(const double *l, double *b, int n, int m)
{
    for (int r = n - 1; r >= 0; r--) {
        for (int k = r + 1; k < n; k++) {
            for (int j = 0; j < m; j++) {
                b[r * m + j] -= l[k * n + r] * b[k * m + j];
            }
        }
        for (int j = 0; j < m; j++) {
            b[r * m + j] /= l[r * n + r];
        }
    }
}

/* One rotation that clears a[p][q]. */
static void rotate(double *a, double *vectors, int n, int p, int q)
{
    double apq = a[p * n + q];
    if (apq == 0.0) {
        return;
    }
    double theta = 0.5 * (a[q * n + q] - a[p * n + p]) / apq;
    double t = copysign(1.0, theta) / (fabs(theta) + sqrt(1.0 + theta * theta)), c = 1.0 / sqrt(1.0 + t * t), s = t * c;
    for (int k = 0; k < n; k++) {
        double x = a[k * n + p], y = a[k * n + q];
        a[k * n + p] = c * x - s * y;
        a[k * n + q] = s * x + c * y;
    }
    for (int k = 0; k < n; k++) {
        double x = a[p * n + k], y = a[q * n + k], u = vectors[k * n + p], v = vectors[k * n + q];
        a[p * n + k] = c * x - s * y;
        a[q * n + k] = s * x + c * y;
        vectors[k * n + p] = c * u - s * v;
        vectors[k * n + q] = s * u + c * v;
    }
}

void tsuya_dense_eigen(double *a, double *values, double *vectors, int n)
{
    for (int i = 0; i < n * n; i++) {
        vectors[i] = i % (n + 1) == 0;
    }
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        double off = 0.0, on = 0.0;
        for (int p = 0; p < n; p++) {
            on += a[p * n + p] * a[p * n + p];
            for (int q = p + 1; q < n; q++) {
                off += a[p * n + q] * a[p * n + q];
            }
        }
        if (off <= 1e-28 * on) {
            break;
        }
        for (int p = 0; p < n; p++) {
            for (int q = p + 1; q < n; q++) {
                rotate(a, vectors, n, p, q);
            }
        }
    }
    for (int i = 0; i < n; i++) {
        values[i] = a[i * n + i];
    }
}
