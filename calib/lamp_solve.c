#include "calib/lamp_parts.h"

#include "core/dense.h"
#include "core/memory.h"
#include "core/order.h"

#include <string.h>

double tsuya_lamp_median(double *values, int n)
{
    if (n == 0) {
        return NAN;
    }
    tsuya_sort_doubles(values, (size_t)n);
    return n % 2 ? values[n / 2] : 0.5 * (values[n / 2 - 1] + values[n / 2]);
}

void tsuya_lamp_tangents(tsuya_vec3 t[2], tsuya_vec3 n)
{
    tsuya_vec3 other = fabs(n.x) < 0.6 ? (tsuya_vec3){1, 0, 0} : (tsuya_vec3){0, 1, 0};
    t[0] = tsuya_vec3_tangent(other, n);
    t[1] = tsuya_vec3_cross(n, t[0]);
}

tsuya_vec3 tsuya_lamp_turn(tsuya_vec3 u, double a, double b)
{
    tsuya_vec3 t[2];
    tsuya_lamp_tangents(t, u);
    return tsuya_vec3_unit(tsuya_vec3_mad(tsuya_vec3_mad(u, a, t[0]), b, t[1]));
}

typedef struct workspace {
    double *row, *moved_row, *jacobian, *a, *b, *step;
    void *state;
} workspace;

static void release(workspace *w)
{
    tsuya_free(w->row);
    tsuya_free(w->moved_row);
    tsuya_free(w->jacobian);
    tsuya_free(w->a);
    tsuya_free(w->b);
    tsuya_free(w->step);
    tsuya_free(w->state);
}

static tsuya_status allocate(workspace *w, const tsuya_lamp_problem *p)
{
    tsuya_status status = TSUYA_OK;
    size_t n = (size_t)p->n, rows = (size_t)p->rows;
    *w = (workspace){0};
    TSUYA_NEW(status, w->row, rows);
    TSUYA_NEW(status, w->moved_row, rows);
    TSUYA_NEW(status, w->jacobian, n * rows);
    TSUYA_NEW(status, w->a, n * n);
    TSUYA_NEW(status, w->b, n);
    TSUYA_NEW(status, w->step, n);
    w->state = tsuya_calloc(1, p->state_bytes);
    status = w->state ? TSUYA_OK : TSUYA_ERROR_MEMORY;
done:
    if (status != TSUYA_OK) {
        release(w);
    }
    return status;
}

/* JᵀJ and Jᵀr at the state. */
static void linearise(workspace *w, const tsuya_lamp_problem *p)
{
    int n = p->n, rows = p->rows;
    p->residuals(w->row, p->state);
    for (int k = 0; k < n; k++) {
        double *column = w->jacobian + (size_t)k * (size_t)rows;
        memcpy(w->state, p->state, p->state_bytes);
        memset(w->step, 0, (size_t)n * sizeof *w->step);
        w->step[k] = p->nudge[k];
        p->move(w->state, w->step);
        p->residuals(w->moved_row, w->state);
        for (int i = 0; i < rows; i++) {
            column[i] = (w->moved_row[i] - w->row[i]) / p->nudge[k];
        }
    }
    for (int k = 0; k < n; k++) {
        const double *ck = w->jacobian + (size_t)k * (size_t)rows;
        for (int m = 0; m <= k; m++) {
            const double *cm = w->jacobian + (size_t)m * (size_t)rows;
            double sum = 0.0;
            for (int i = 0; i < rows; i++) {
                sum += ck[i] * cm[i];
            }
            w->a[k * n + m] = w->a[m * n + k] = sum;
        }
        w->b[k] = 0.0;
        for (int i = 0; i < rows; i++) {
            w->b[k] -= ck[i] * w->row[i];
        }
    }
}

static double squared(const double *row, int rows)
{
    double sum = 0.0;
    for (int i = 0; i < rows; i++) {
        sum += row[i] * row[i];
    }
    return sum;
}

/* One damped step from the equations of `linearise`; true where it led down. */
static bool try_step(double *cost, workspace *w, double *factor, const tsuya_lamp_problem *p, double damping)
{
    int n = p->n;
    memcpy(factor, w->a, (size_t)n * (size_t)n * sizeof *factor);
    for (int k = 0; k < n; k++) {
        factor[k * n + k] += damping * factor[k * n + k] + 1e-12;
    }
    if (!tsuya_dense_cholesky(factor, n)) {
        return false;
    }
    memcpy(w->step, w->b, (size_t)n * sizeof *w->step);
    tsuya_dense_forward(factor, w->step, n, 1);
    tsuya_dense_backward(factor, w->step, n, 1);
    memcpy(w->state, p->state, p->state_bytes);
    p->move(w->state, w->step);
    p->residuals(w->moved_row, w->state);
    double next = squared(w->moved_row, p->rows);
    if (!(next < *cost)) {
        return false;
    }
    *cost = next;
    memcpy(p->state, w->state, p->state_bytes);
    return true;
}

tsuya_status tsuya_lamp_descend(double *cost, const tsuya_lamp_problem *p, int steps)
{
    workspace w;
    double damping = 1e-3;
    TSUYA_TRY(allocate(&w, p));
    double *factor = tsuya_calloc((size_t)p->n * (size_t)p->n, sizeof *factor);
    p->residuals(w.row, p->state);
    *cost = squared(w.row, p->rows);
    for (int step = 0; factor && step < steps; step++) {
        double before = *cost;
        linearise(&w, p);
        while (!try_step(cost, &w, factor, p, damping) && damping < 1e9) {
            damping *= 5.0;
        }
        if (damping >= 1e9 || before - *cost < 1e-9 * before) {
            break;
        }
        damping = fmax(0.2 * damping, 1e-9);
    }
    tsuya_status status = factor ? TSUYA_OK : TSUYA_ERROR_MEMORY;
    tsuya_free(factor);
    release(&w);
    return status;
}

tsuya_status tsuya_lamp_covariance(double *covariance, const tsuya_lamp_problem *p)
{
    workspace w;
    int n = p->n;
    TSUYA_TRY(allocate(&w, p));
    linearise(&w, p);
    bool fine = tsuya_dense_cholesky(w.a, n);
    memset(covariance, 0, (size_t)n * (size_t)n * sizeof *covariance);
    for (int k = 0; k < n; k++) {
        covariance[k * n + k] = 1.0;
    }
    if (fine) {
        tsuya_dense_forward(w.a, covariance, n, n);
        tsuya_dense_backward(w.a, covariance, n, n);
    }
    release(&w);
    return fine ? TSUYA_OK : tsuya_fail(TSUYA_ERROR_NUMERIC, "the photographs do not determine the lamp");
}
