#include "calib/color.h"

#include "core/dense.h"
#include "core/memory.h"
#include "core/order.h"

#include <string.h>

enum { UNKNOWNS = 9, STEPS = 60, WHITE = TSUYA_CHART_FIRST_GREY, BLACK = TSUYA_CHART_PATCHES - 1 };

static const double CLIPPED = 0.02, DARK_L = 40.0, GRADIENT_SIGMA = 0.3, WRONG_CHART = 15.0;

/* The problem: balanced values, their places on the chart (−1 … 1), references, and ΔE00's metric there. */
typedef struct problem {
    tsuya_vec3 value[TSUYA_CHART_PATCHES];
    double place[TSUYA_CHART_PATCHES][2];
    tsuya_lab reference[TSUYA_CHART_PATCHES];
    double metric[TSUYA_CHART_PATCHES][9]; /* Lᵀ of the local metric: |Lᵀ δ| is ΔE00 */
    bool use[TSUYA_CHART_PATCHES];
} problem;

/* x: the matrix' six free entries (01 02 10 12 20 21), log exposure, the light's gradient. */
static tsuya_mat3 matrix_of(const double x[UNKNOWNS])
{
    return (tsuya_mat3){{{1 - x[0] - x[1], x[0], x[1]}, {x[2], 1 - x[2] - x[3], x[3]}, {x[4], x[5], 1 - x[4] - x[5]}}};
}

static tsuya_lab lab_of(const problem *p, const double x[UNKNOWNS], int patch)
{
    double light = exp(x[6] - x[7] * p->place[patch][0] - x[8] * p->place[patch][1]);
    return tsuya_lab_from_rgb(tsuya_vec3_scale(tsuya_mat3_apply(matrix_of(x), p->value[patch]), light));
}

static void residual(double r[3], const problem *p, const double x[UNKNOWNS], int patch)
{
    tsuya_lab lab = lab_of(p, x, patch), *to = (tsuya_lab *)&p->reference[patch];
    double d[3] = {lab.l - to->l, lab.a - to->a, lab.b - to->b};
    const double *m = p->metric[patch];
    for (int i = 0; i < 3; i++) {
        r[i] = m[3 * i] * d[0] + m[3 * i + 1] * d[1] + m[3 * i + 2] * d[2];
    }
}

static double squared(tsuya_lab a, double dl, double da, double db)
{
    double e = tsuya_color_difference(a, (tsuya_lab){a.l + dl, a.a + da, a.b + db});
    return e * e;
}

/* ΔE00² near a colour is a quadratic form; its Cholesky factor. */
static void find_metric(double factor[9], tsuya_lab at)
{
    const double h = 0.5;
    double q[9], d[3][3] = {{h, 0, 0}, {0, h, 0}, {0, 0, h}};
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            double plus[3], minus[3];
            for (int k = 0; k < 3; k++) {
                plus[k] = d[i][k] + d[j][k];
                minus[k] = d[i][k] - d[j][k];
            }
            q[3 * i + j] = (squared(at, plus[0], plus[1], plus[2]) - squared(at, minus[0], minus[1], minus[2])) / (4.0 * h * h);
        }
    }
    for (int i = 0; i < 3; i++) {
        q[3 * i + i] += 1e-6;
    }
    if (!tsuya_dense_cholesky(q, 3)) {
        memset(q, 0, sizeof q);
        q[0] = q[4] = q[8] = 1.0;
    }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            factor[3 * i + j] = q[3 * j + i];
        }
    }
}

static double cost_of(const problem *p, const double x[UNKNOWNS])
{
    double sum = (x[7] * x[7] + x[8] * x[8]) / (GRADIENT_SIGMA * GRADIENT_SIGMA), r[3];
    for (int i = 0; i < TSUYA_CHART_PATCHES; i++) {
        if (p->use[i]) {
            residual(r, p, x, i);
            sum += r[0] * r[0] + r[1] * r[1] + r[2] * r[2];
        }
    }
    return sum;
}

static void normal_equations(double a[UNKNOWNS * UNKNOWNS], double b[UNKNOWNS], const problem *p, const double x[UNKNOWNS])
{
    memset(a, 0, UNKNOWNS * UNKNOWNS * sizeof *a);
    for (int k = 0; k < UNKNOWNS; k++) {
        double prior = k >= 7 ? 1.0 / (GRADIENT_SIGMA * GRADIENT_SIGMA) : 0.0;
        a[k * UNKNOWNS + k] = prior;
        b[k] = -prior * x[k];
    }
    for (int i = 0; i < TSUYA_CHART_PATCHES; i++) {
        double j[UNKNOWNS][3], r[3], moved[UNKNOWNS];
        if (!p->use[i]) {
            continue;
        }
        residual(r, p, x, i);
        for (int k = 0; k < UNKNOWNS; k++) {
            memcpy(moved, x, sizeof moved);
            moved[k] += 1e-5;
            residual(j[k], p, moved, i);
            for (int c = 0; c < 3; c++) {
                j[k][c] = (j[k][c] - r[c]) / 1e-5;
            }
        }
        for (int k = 0; k < UNKNOWNS; k++) {
            for (int m = 0; m < UNKNOWNS; m++) {
                a[k * UNKNOWNS + m] += j[k][0] * j[m][0] + j[k][1] * j[m][1] + j[k][2] * j[m][2];
            }
            b[k] -= j[k][0] * r[0] + j[k][1] * r[1] + j[k][2] * r[2];
        }
    }
}

static void solve(double x[UNKNOWNS], const problem *p)
{
    double damping = 1e-3, cost = cost_of(p, x);
    for (int step = 0; step < STEPS; step++) {
        double a[UNKNOWNS * UNKNOWNS], b[UNKNOWNS], moved[UNKNOWNS];
        normal_equations(a, b, p, x);
        for (int k = 0; k < UNKNOWNS; k++) {
            a[k * UNKNOWNS + k] *= 1.0 + damping;
        }
        if (!tsuya_dense_cholesky(a, UNKNOWNS)) {
            return;
        }
        tsuya_dense_forward(a, b, UNKNOWNS, 1);
        tsuya_dense_backward(a, b, UNKNOWNS, 1);
        for (int k = 0; k < UNKNOWNS; k++) {
            moved[k] = x[k] + b[k];
        }
        double next = cost_of(p, moved);
        if (next < cost) {
            bool done = cost - next < 1e-10 * cost;
            memcpy(x, moved, sizeof moved);
            cost = next;
            damping *= 0.2;
            if (done) {
                return;
            }
        } else if ((damping *= 5.0) > 1e8) {
            return;
        }
    }
}

static tsuya_status check_greys(const tsuya_color *color, const tsuya_chart *chart, const char *name)
{
    for (int i = WHITE + 1; i < BLACK; i++) {
        if (color->left_out[i]) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: grey patch %d of the chart is clipped; expose less (the white patch at 80 %% of the range)", name, i + 1);
        }
    }
    for (int c = 0; c < 3; c++) {
        if (!(chart->patch[WHITE + 1].rgb[c] > 0.002)) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "%s: grey patch %d of the chart is black in channel %d; expose more", name, WHITE + 2, c + 1);
        }
    }
    return TSUYA_OK;
}

/* Gains that make patches 20 … 23 grey, green 1; exposure that gives patch 20 its luminance. */
static void balance(tsuya_color *color, const double value[][3])
{
    double sum[3] = {0, 0, 0};
    for (int i = WHITE + 1; i < BLACK; i++) {
        tsuya_vec3 want = tsuya_rgb_from_lab(color->reference[i]);
        double w[3] = {want.x, want.y, want.z};
        for (int c = 0; c < 3; c++) {
            sum[c] += log(w[c] / w[1]) - log(fmax(value[i][c], 1e-6) / fmax(value[i][1], 1e-6));
        }
    }
    for (int c = 0; c < 3; c++) {
        color->white_balance[c] = exp(sum[c] / (BLACK - WHITE - 1));
    }
}

/* Greys against their reflectance, the light's gradient taken out: slope of the logarithms, and the worst one's deviation from
 * the line that patches 20 … 22 give. */
static void check_linearity(tsuya_color *color, const problem *p, const double x[UNKNOWNS])
{
    double sl = 0.0, sv = 0.0, sll = 0.0, slv = 0.0, ratio[TSUYA_CHART_PATCHES], level = 0.0;
    int n = 0;
    for (int i = WHITE; i <= BLACK; i++) {
        double y = tsuya_rgb_from_lab(color->reference[i]).y, v = p->value[i].y * exp(-x[7] * p->place[i][0] - x[8] * p->place[i][1]);
        ratio[i] = v / y;
        level += i > WHITE && i < WHITE + 4 ? log(ratio[i]) / 3.0 : 0.0;
        if (!color->left_out[i] && i < BLACK) {
            sl += log(y), sv += log(v), sll += log(y) * log(y), slv += log(y) * log(v);
            n++;
        }
    }
    color->gamma = (n * slv - sl * sv) / (n * sll - sl * sl);
    for (int i = WHITE; i < BLACK; i++) {
        double d = ratio[i] / exp(level) - 1.0;
        if (!color->left_out[i] && fabs(d) > fabs(color->grey_deviation)) {
            color->grey_deviation = d;
            color->grey_worst = i;
        }
    }
}

static tsuya_color_stats stats_of(const double *de, const tsuya_lab *reference, double low, double high)
{
    double kept[TSUYA_CHART_PATCHES], sum = 0.0;
    int n = 0;
    for (int i = 0; i < TSUYA_CHART_PATCHES; i++) {
        if (isfinite(de[i]) && reference[i].l >= low && reference[i].l < high) {
            kept[n++] = de[i];
            sum += de[i];
        }
    }
    if (n == 0) {
        return (tsuya_color_stats){NAN, NAN, NAN, 0};
    }
    tsuya_sort_doubles(kept, (size_t)n);
    return (tsuya_color_stats){sum / n, kept[n / 2], kept[n - 1], n};
}

static void hold_out(tsuya_color *color, problem *p, const double x[UNKNOWNS])
{
    for (int i = 0; i < TSUYA_CHART_PATCHES; i++) {
        double other[UNKNOWNS];
        color->de00_heldout[i] = NAN;
        if (p->use[i]) {
            memcpy(other, x, sizeof other);
            p->use[i] = false;
            solve(other, p);
            p->use[i] = true;
            color->de00_heldout[i] = tsuya_color_difference(lab_of(p, other, i), color->reference[i]);
        }
    }
}

static void prepare(problem *p, tsuya_color *color, const tsuya_chart *chart, const tsuya_lab *reference_d50)
{
    double value[TSUYA_CHART_PATCHES][3];
    *p = (problem){0};
    for (int i = 0; i < TSUYA_CHART_PATCHES; i++) {
        const tsuya_chart_patch *patch = &chart->patch[i];
        double light = tsuya_vignetting_at(&color->vignetting, patch->center_px.x, patch->center_px.y);
        color->left_out[i] = patch->clipped > CLIPPED;
        color->reference[i] = tsuya_lab_from_xyz(tsuya_chart_xyz_d65(reference_d50[i]), tsuya_white_d65());
        for (int c = 0; c < 3; c++) {
            value[i][c] = patch->rgb[c] / light;
        }
    }
    balance(color, value);
    for (int i = 0; i < TSUYA_CHART_PATCHES; i++) {
        const double *w = color->white_balance;
        p->value[i] = (tsuya_vec3){w[0] * value[i][0], w[1] * value[i][1], w[2] * value[i][2]};
        p->place[i][0] = (i % TSUYA_CHART_COLS) / 2.5 - 1.0;
        p->place[i][1] = (i / TSUYA_CHART_COLS) / 1.5 - 1.0;
        p->reference[i] = color->reference[i];
        p->use[i] = !color->left_out[i];
        find_metric(p->metric[i], p->reference[i]);
    }
}

tsuya_status tsuya_color_fit(tsuya_color *color, const tsuya_chart *chart, const tsuya_lab reference_d50[TSUYA_CHART_PATCHES],
                             const tsuya_vignetting *vignetting, const char *name)
{
    problem p;
    double x[UNKNOWNS] = {0}, none[TSUYA_CHART_PATCHES];
    *color = (tsuya_color){.has_matrix = true, .vignetting = vignetting ? *vignetting : (tsuya_vignetting){0}};
    prepare(&p, color, chart, reference_d50);
    TSUYA_TRY(check_greys(color, chart, name));
    x[6] = log(tsuya_rgb_from_lab(color->reference[WHITE + 2]).y / p.value[WHITE + 2].y);
    solve(x, &p);
    color->matrix = matrix_of(x);
    color->exposure = exp(x[6]);
    color->light_gradient[0] = x[7];
    color->light_gradient[1] = x[8];
    for (int i = 0; i < TSUYA_CHART_PATCHES; i++) {
        color->measured[i] = lab_of(&p, x, i);
        color->de00[i] = none[i] = color->left_out[i] ? NAN : tsuya_color_difference(color->measured[i], color->reference[i]);
    }
    color->light = stats_of(color->de00, color->reference, DARK_L, INFINITY);
    color->dark = stats_of(color->de00, color->reference, -INFINITY, DARK_L);
    if (!(stats_of(none, color->reference, -INFINITY, INFINITY).median < WRONG_CHART)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "%s: the patches are not those of the reference (median difference %.1f); is the chart upside down, or another one?",
                          name, stats_of(none, color->reference, -INFINITY, INFINITY).median);
    }
    check_linearity(color, &p, x);
    hold_out(color, &p, x);
    color->heldout = stats_of(color->de00_heldout, color->reference, -INFINITY, INFINITY);
    return TSUYA_OK;
}

tsuya_vec3 tsuya_color_apply(const tsuya_color *color, const double value[3], double x_px, double y_px)
{
    double s = color->exposure / tsuya_vignetting_at(&color->vignetting, x_px, y_px);
    const double *w = color->white_balance;
    return tsuya_mat3_apply(color->matrix, (tsuya_vec3){s * w[0] * value[0], s * w[1] * value[1], s * w[2] * value[2]});
}
