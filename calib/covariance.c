#include "calib/covariance.h"

#include "calib/mrcal_adapter.h"
#include "calib/spline.h"
#include "core/dense.h"
#include "core/memory.h"

#include <string.h>

enum { POSE = 6, FEWEST_CLUSTERS = 4, SMOOTH_MODES = 30 }; /* polynomials to the fourth degree, along x and y */
/* A part that alone determines a direction says nothing about its error. */
static const double MOST_LEVERAGE = 0.9, BIAS_PRIOR = 0.5;

/* The reduced problem: g global parameters (intrinsics that move, bias, shapes).
 *
 * Scatter is told in k directions of the globals, in which the normal equations are the unit matrix: all of them, or, where a spline has
 * more control points than photographs can say anything about, the smooth ones.  `basis` has them as rows over the globals. */
typedef struct reduced {
    const tsuya_solve *solve;
    int n, locked, g, k, shapes; /* n: intrinsics that move; shapes: parameters of each plate's shape */
    double *h;           /* g × g, the sum with the priors; later its Cholesky factor */
    double *slope;       /* g: of the whole, priors and all, downwards */
    double *elimination; /* X = A⁻¹ B, 6 × g a view */
    double *pose_factor; /* Cholesky factor of A, 6 × 6 a view */
    double *basis;       /* k × g */
    double *photo_h, *photo_pull; /* k × k and k of one photograph */
    double *tag_pull, *cell_pull; /* k a tag; k of one (view, tag) */
    double *by_intrinsics; /* 2 × all intrinsics of one corner */
    double *j;           /* 2 × g of one corner; what is not zero stands at `at` */
    int *at, count;
    double *scratch;     /* 4 k² */
} reduced;

static void free_reduced(reduced *r)
{
    double **part[] = {&r->h, &r->slope, &r->elimination, &r->pose_factor, &r->basis, &r->photo_h, &r->photo_pull, &r->tag_pull, &r->cell_pull,
                       &r->by_intrinsics, &r->j, &r->scratch};
    for (size_t i = 0; i < sizeof part / sizeof part[0]; i++) {
        tsuya_free(*part[i]);
    }
    tsuya_free(r->at);
}

static tsuya_status allocate(reduced *r, const tsuya_solve *s)
{
    tsuya_status status = TSUYA_OK;
    int all = tsuya_lens_parameters(&s->camera), locked = tsuya_lens_locked(&s->camera), beside = 1 + tsuya_solve_shape_parameters(s) * s->board->plate_count;
    *r = (reduced){.solve = s, .n = all - locked, .locked = locked, .shapes = tsuya_solve_shape_parameters(s), .g = all - locked + beside};
    r->k = locked && SMOOTH_MODES < r->n ? SMOOTH_MODES + beside : r->g;
    size_t g = (size_t)r->g, k = (size_t)r->k, views = (size_t)s->view_count;
    TSUYA_NEW(status, r->h, g * g);
    TSUYA_NEW(status, r->slope, g);
    TSUYA_NEW(status, r->elimination, POSE * g * (views + 1)); /* and a splined lens' prior */
    TSUYA_NEW(status, r->pose_factor, POSE * POSE * (views + 1));
    TSUYA_NEW(status, r->basis, k * g);
    TSUYA_NEW(status, r->photo_h, k * k);
    TSUYA_NEW(status, r->photo_pull, k);
    TSUYA_NEW(status, r->tag_pull, k * (size_t)s->board->tag_count);
    TSUYA_NEW(status, r->cell_pull, k);
    TSUYA_NEW(status, r->by_intrinsics, 2 * (size_t)all);
    TSUYA_NEW(status, r->j, 2 * g);
    TSUYA_NEW(status, r->at, g);
    TSUYA_NEW(status, r->scratch, 4 * k * k);
done:
    if (status != TSUYA_OK) {
        free_reduced(r);
    }
    return status;
}

/* Derivatives by the intrinsics that move, and where they are not zero. */
static void intrinsics_row(reduced *r, double w)
{
    int all = r->n + r->locked;
    const double *x = r->by_intrinsics + r->locked, *y = x + all;
    for (int i = 0; i < r->count; i++) {
        r->j[r->at[i]] = r->j[r->g + r->at[i]] = 0.0;
    }
    r->count = 0;
    for (int i = 0; i < r->n; i++) {
        if (x[i] != 0.0 || y[i] != 0.0) {
            r->j[i] = w * x[i];
            r->j[r->g + i] = w * y[i];
            r->at[r->count++] = i;
        }
    }
}

/* Derivatives of a point's predicted pixel over its sigma (w: one over it) by the intrinsics (2 × g, in r->j) and by the pose (2 × 6),
 * which has turned the point to `turned`; its pixel.  False for what does not project. */
static bool point_row(double pose[2][POSE], double by_point[6], tsuya_vec2 *pixel, reduced *r, tsuya_vec3 turned, tsuya_vec3 moved, double w)
{
    if (!tsuya_mrcal_project(pixel, by_point, r->by_intrinsics, &r->solve->camera, tsuya_vec3_add(turned, moved))) {
        return false;
    }
    intrinsics_row(r, w);
    for (int k = 0; k < 2; k++) {
        const double *d = by_point + 3 * k;
        const double by[POSE] = {d[2] * turned.y - d[1] * turned.z, d[0] * turned.z - d[2] * turned.x, d[1] * turned.x - d[0] * turned.y, d[0], d[1], d[2]};
        for (int i = 0; i < POSE; i++) {
            pose[k][i] = w * by[i];
        }
    }
    return true;
}

/* The same of a corner and by all globals; the residual over its sigma.  False for outliers and what does not project. */
static bool corner_row(double pose[2][POSE], double residual[2], reduced *r, const tsuya_solve_observation *o)
{
    const tsuya_solve *s = r->solve;
    const tsuya_solve_view *view = &s->view[o->view];
    const tsuya_mat3 *turn = &view->camera_from_plate.rotation;
    tsuya_vec3 turned = tsuya_mat3_apply(*turn, tsuya_solve_point(s, o->tag, o->corner)), arm[TSUYA_SHAPE_PARAMETERS];
    double by_point[6], w = 1.0 / o->weight_sigma_px;
    tsuya_vec2 q;
    if (o->outlier || !point_row(pose, by_point, &q, r, turned, view->camera_from_plate.translation, w)) {
        return false;
    }
    tsuya_plate_shape_gradient(arm, &s->shape[view->plate], s->board, o->tag, o->corner);
    for (int i = 0; i < r->shapes; i++) {
        arm[i] = tsuya_mat3_apply(*turn, arm[i]);
        r->at[r->count++] = r->n + 1 + r->shapes * view->plate + i;
    }
    r->at[r->count++] = r->n;
    for (int k = 0; k < 2; k++) {
        const double *d = by_point + 3 * k;
        double *j = r->j + k * r->g;
        j[r->n] = w * (k ? o->spread_px.y : o->spread_px.x);
        for (int i = 0; i < r->shapes; i++) {
            j[r->n + 1 + r->shapes * view->plate + i] = w * (d[0] * arm[i].x + d[1] * arm[i].y + d[2] * arm[i].z);
        }
        residual[k] = w * (k ? o->residual_px.y : o->residual_px.x);
    }
    return true;
}

/* A corner into the normal equations: A, B and its pull at the pose, the globals' own part. */
static void add_corner(double *a, double *x, double right[POSE], reduced *r, const double p[2][POSE], const double e[2])
{
    int g = r->g;
    for (int k = 0; k < 2; k++) {
        const double *j = r->j + k * g;
        for (int m = 0; m < POSE; m++) {
            right[m] += p[k][m] * e[k];
            for (int q = 0; q < POSE; q++) {
                a[m * POSE + q] += p[k][m] * p[k][q];
            }
            for (int q = 0; q < r->count; q++) {
                x[m * g + r->at[q]] += p[k][m] * j[r->at[q]];
            }
        }
        for (int m = 0; m < r->count; m++) {
            int row = r->at[m];
            r->slope[row] += j[row] * e[k];
            for (int q = 0; q < r->count; q++) {
                r->h[row * g + r->at[q]] += j[row] * j[r->at[q]];
            }
        }
    }
}

/* Takes a pose out of the normal equations. */
static bool eliminate(reduced *r, double *a, double *x, double right[POSE])
{
    int g = r->g;
    if (!tsuya_dense_cholesky(a, POSE)) {
        return false;
    }
    tsuya_dense_forward(a, x, POSE, g);
    tsuya_dense_forward(a, right, POSE, 1);
    for (int k = 0; k < POSE; k++) {
        const double *row = x + k * g;
        for (int m = 0; m < g; m++) {
            r->slope[m] -= row[m] * right[k];
            for (int q = 0; q < g && row[m] != 0.0; q++) {
                r->h[m * g + q] -= row[m] * row[q];
            }
        }
    }
    tsuya_dense_backward(a, x, POSE, g);
    return true;
}

static bool reduce_view(reduced *r, int v)
{
    double *a = r->pose_factor + v * POSE * POSE, *x = r->elimination + (size_t)v * POSE * (size_t)r->g, p[2][POSE], e[2], right[POSE] = {0};
    for (int i = 0; i < r->solve->view[v].count; i++) {
        if (corner_row(p, e, r, &r->solve->observation[r->solve->view[v].first + i])) {
            add_corner(a, x, right, r, p, e);
        }
    }
    return eliminate(r, a, x, right);
}

/* A splined lens' prior is one more view. */
static tsuya_status reduce_prior(bool *determined, reduced *r)
{
    const tsuya_solve *s = r->solve;
    tsuya_status status = TSUYA_OK;
    tsuya_spline_hold *hold = NULL;
    int v = s->view_count;
    double *a = r->pose_factor + v * POSE * POSE, *x = r->elimination + (size_t)v * POSE * (size_t)r->g, p[2][POSE], by_point[6], right[POSE] = {0}, sigma;
    if (!r->locked || s->prior.width_px == 0 || !*determined) {
        return TSUYA_OK;
    }
    TSUYA_NEW(status, hold, (size_t)(s->camera.spline.nx * s->camera.spline.ny));
    int count = tsuya_spline_holds(hold, &sigma, &s->camera.spline, &s->prior);
    for (int i = 0; i < count; i++) {
        tsuya_vec2 q;
        if (point_row(p, by_point, &q, r, tsuya_mat3_apply(s->camera_from_prior.rotation, hold[i].ray), s->camera_from_prior.translation, 1.0 / sigma)) {
            add_corner(a, x, right, r, p, (const double[2]){(hold[i].pixel.x - q.x) / sigma, (hold[i].pixel.y - q.y) / sigma});
        }
    }
    *determined = eliminate(r, a, x, right);
done:
    tsuya_free(hold);
    return status;
}

/* Of a parameter that is no intrinsic: one over the square of what is believed of it. */
static double prior_weight(const reduced *r, int parameter)
{
    double sigma[TSUYA_SHAPE_PARAMETERS] = {BIAS_PRIOR};
    int k = parameter - r->n - 1;
    if (k >= 0) {
        tsuya_plate_shape_prior(sigma, &r->solve->shape[k / r->shapes]);
    }
    double s = sigma[k >= 0 ? k % r->shapes : 0];
    return 1.0 / (s * s);
}

/* What the parameter stands at. */
static double standing(const reduced *r, int parameter)
{
    int k = parameter - r->n - 1;
    const tsuya_plate_shape *shape = &r->solve->shape[k < 0 ? 0 : k / r->shapes];
    return k < 0 ? r->solve->edge_bias : k % r->shapes ? shape->bend_m[k % r->shapes - 1] : shape->growth;
}

/* The priors' part: as rows of their own, which pull the other way. */
static tsuya_status add_priors(reduced *r)
{
    int g = r->g;
    for (int i = r->n; i < g; i++) {
        r->h[i * (g + 1)] += prior_weight(r, i);
        r->slope[i] -= prior_weight(r, i) * standing(r, i);
    }
    return tsuya_mrcal_regularization(r->h, r->slope, g, r->solve);
}

/* `determined` false where the photographs do not determine the globals. */
static tsuya_status reduce(bool *determined, reduced *r)
{
    *determined = true;
    for (int v = 0; v < r->solve->view_count && *determined; v++) {
        *determined = reduce_view(r, v);
    }
    TSUYA_TRY(reduce_prior(determined, r));
    TSUYA_TRY(add_priors(r));
    *determined = *determined && tsuya_dense_cholesky(r->h, r->g);
    return TSUYA_OK;
}

/* Of a spline: its control points moved along x or y as a polynomial of the grid. */
static double smooth_mode(const tsuya_lens_spline *s, int mode, int parameter)
{
    int point = parameter / 2, degree = 0, first = 0, which = mode / 2;
    while (which >= first + degree + 1) {
        first += ++degree;
    }
    double x = 2.0 * (point % s->nx) / (s->nx - 1) - 1.0, y = 2.0 * (point / s->nx) / (s->ny - 1) - 1.0;
    return parameter % 2 == mode % 2 ? pow(x, which - first) * pow(y, degree - which + first) : 0.0;
}

/* The directions that scatter is told in, of unit length under the normal equations: from V (k × g), V H Vᵀ = R Rᵀ, R⁻¹ V. */
static bool span(reduced *r)
{
    int g = r->g, k = r->k, modes = k - (g - r->n);
    double *gram = r->scratch, *row = r->j;
    for (int i = 0; i < k; i++) {
        for (int a = 0; a < g; a++) {
            bool smooth = k < g && i < modes, intrinsic = a < r->n;
            r->basis[i * g + a] = !smooth ? i + g - k == a : intrinsic ? smooth_mode(&r->solve->camera.spline, i, a) : 0.0;
        }
    }
    if (k == g) { /* R is the factor itself */
        tsuya_dense_forward(r->h, r->basis, g, g);
        return true;
    }
    memset(gram, 0, (size_t)(k * k) * sizeof *gram);
    for (int c = 0; c < g; c++) { /* column c of V L */
        for (int i = 0; i < k; i++) {
            row[i] = 0.0;
            for (int a = c; a < g; a++) {
                row[i] += r->basis[i * g + a] * r->h[a * g + c];
            }
        }
        for (int i = 0; i < k * k; i++) {
            gram[i] += row[i / k] * row[i % k];
        }
    }
    memset(r->j, 0, 2 * (size_t)g * sizeof *r->j);
    r->count = 0;
    if (!tsuya_dense_cholesky(gram, k)) {
        return false;
    }
    tsuya_dense_forward(gram, r->basis, k, g);
    return true;
}

/* sum += A u (A u)ᵀ with A = (1 − M)^(−½): what the cluster's pull would be, had the solve not followed it. */
static void add_cluster(double *sum, reduced *r, double *m, const double *u)
{
    int k = r->k;
    double *values = r->scratch, *vectors = r->scratch + k, *pull = vectors + k * k;
    tsuya_dense_eigen(m, values, vectors, k);
    memset(pull, 0, (size_t)k * sizeof *pull);
    for (int v = 0; v < k; v++) {
        double along = 0.0, gain = 1.0 / sqrt(1.0 - fmin(fmax(values[v], 0.0), MOST_LEVERAGE));
        for (int i = 0; i < k; i++) {
            along += vectors[i * k + v] * u[i];
        }
        for (int i = 0; i < k; i++) {
            pull[i] += vectors[i * k + v] * gain * along;
        }
    }
    for (int i = 0; i < k * k; i++) {
        sum[i] += pull[i / k] * pull[i % k];
    }
}

static double trace(const double *m, int n)
{
    double sum = 0.0;
    for (int i = 0; i < n; i++) {
        sum += m[i * (n + 1)];
    }
    return sum;
}

/* How corners pull, gathered by photograph and by tag. */
typedef struct scatters {
    double *photo, *tag; /* k × k: Σ over photographs; Σ_tag − Σ_(view, tag): less what independent corners would give */
    double directions;   /* that the photographs determine */
    int photos, tags;
} scatters;

/* A corner's derivatives in the k directions, its pose following. */
static void corner_directions(double *d, const reduced *r, const double *eliminated, const double p[POSE], int which)
{
    const double *j = r->j + which * r->g;
    for (int i = 0; i < r->k; i++) {
        const double *direction = r->basis + (size_t)i * (size_t)r->g;
        d[i] = 0.0;
        for (int a = 0; a < r->count; a++) {
            d[i] += direction[r->at[a]] * j[r->at[a]];
        }
        for (int q = 0; q < POSE; q++) {
            d[i] -= p[q] * eliminated[q * r->k + i];
        }
    }
}

static void close_cell(scatters *s, reduced *r, int tag)
{
    for (int a = 0; a < r->k; a++) {
        r->photo_pull[a] += r->cell_pull[a];
        r->tag_pull[(size_t)tag * (size_t)r->k + (size_t)a] += r->cell_pull[a];
        for (int b = 0; b < r->k; b++) {
            s->tag[a * r->k + b] -= r->cell_pull[a] * r->cell_pull[b];
        }
    }
    memset(r->cell_pull, 0, (size_t)r->k * sizeof *r->cell_pull);
}

static void pull_of_view(scatters *s, reduced *r, int v)
{
    const tsuya_solve_view *view = &r->solve->view[v];
    int g = r->g, k = r->k;
    double *eliminated = r->scratch, *d = eliminated + POSE * k, p[2][POSE], e[2];
    for (int i = 0; i < POSE * k; i++) { /* X over the directions */
        const double *x = r->elimination + ((size_t)v * POSE + (size_t)(i / k)) * (size_t)g, *direction = r->basis + (size_t)(i % k) * (size_t)g;
        eliminated[i] = 0.0;
        for (int a = 0; a < g; a++) {
            eliminated[i] += x[a] * direction[a];
        }
    }
    for (int i = view->first; i < view->first + view->count; i++) {
        const tsuya_solve_observation *o = &r->solve->observation[i];
        if (i > view->first && o->tag != o[-1].tag) {
            close_cell(s, r, o[-1].tag);
        }
        bool there = corner_row(p, e, r, o);
        for (int which = 0; there && which < 2; which++) {
            corner_directions(d, r, eliminated, p[which], which);
            for (int a = 0; a < k; a++) {
                r->cell_pull[a] += d[a] * e[which];
                for (int b = 0; b < k; b++) {
                    r->photo_h[a * k + b] += d[a] * d[b];
                }
            }
        }
    }
    close_cell(s, r, r->solve->observation[view->first + view->count - 1].tag);
}

static void gather(scatters *s, reduced *r)
{
    const tsuya_solve *solve = r->solve;
    int k = r->k;
    for (int begin = 0, end; begin < solve->view_count; begin = end) {
        memset(r->photo_h, 0, (size_t)(k * k) * sizeof *r->photo_h);
        memset(r->photo_pull, 0, (size_t)k * sizeof *r->photo_pull);
        for (end = begin; end < solve->view_count && solve->view[end].photo == solve->view[begin].photo; end++) {
            pull_of_view(s, r, end);
        }
        s->directions += trace(r->photo_h, k);
        add_cluster(s->photo, r, r->photo_h, r->photo_pull);
        s->photos++;
    }
    for (int t = 0; t < solve->board->tag_count; t++) {
        const double *u = r->tag_pull + (size_t)t * (size_t)k;
        double square = 0.0;
        for (int a = 0; a < k; a++) {
            square += u[a] * u[a];
            for (int b = 0; b < k; b++) {
                s->tag[a * k + b] += u[a] * u[b];
            }
        }
        s->tags += square > 0.0;
    }
}

/* sum += the positive part of `m`. */
static void add_positive(double *sum, double *m, double *scratch, int n)
{
    double *values = scratch, *vectors = scratch + n;
    tsuya_dense_eigen(m, values, vectors, n);
    for (int k = 0; k < n; k++) {
        for (int i = 0; i < n && values[k] > 0.0; i++) {
            for (int j = 0; j < n; j++) {
                sum[i * n + j] += values[k] * vectors[i * n + k] * vectors[j * n + k];
            }
        }
    }
}

/* The covariance in the k directions (`w`, k × k) and its scale elsewhere.  Few clusters tell the size of the scatter better than its
 * shape, so the shape is drawn towards the normal equations'. */
static tsuya_status scatter(tsuya_covariance *c, double *w, double *scale, reduced *r)
{
    int k = r->k;
    tsuya_status status = TSUYA_OK;
    double variance = *scale;
    scatters s = {.photo = w};
    TSUYA_NEW(status, s.tag, (size_t)(k * k));
    memset(w, 0, (size_t)(k * k) * sizeof *w);
    gather(&s, r);
    *scale = trace(w, k) / s.directions;
    double share = s.photos / (s.photos + 2.0 * k);
    if (s.photos < FEWEST_CLUSTERS) {
        *scale = variance;
        share = 0.0;
    }
    for (int i = 0; i < k * k; i++) {
        w[i] = share * w[i] + (1.0 - share) * *scale * (i % (k + 1) == 0);
    }
    c->photo_factor = sqrt(*scale / variance);
    double excess = trace(s.tag, k) / s.directions / *scale;
    if (s.photos >= FEWEST_CLUSTERS && s.tags >= FEWEST_CLUSTERS && excess > 2.0 * sqrt(2.0 / (s.tags * s.directions))) {
        c->tag_factor = sqrt(excess);
        add_positive(w, s.tag, r->scratch, k);
    }
done:
    tsuya_free(s.tag);
    return status;
}

/* The globals' covariance (g × g): scale H⁻¹ + Bᵀ (W − scale) B. */
static void cover_globals(double *out, double *w, double scale, const reduced *r)
{
    int g = r->g, k = r->k;
    memset(out, 0, (size_t)g * (size_t)g * sizeof *out);
    for (int i = 0; i < g; i++) {
        out[i * (g + 1)] = scale;
    }
    tsuya_dense_forward(r->h, out, g, g);
    tsuya_dense_backward(r->h, out, g, g);
    for (int i = 0; i < k * k; i += k + 1) {
        w[i] -= scale;
    }
    for (int a = 0; a < k; a++) {
        const double *left = r->basis + (size_t)a * (size_t)g;
        for (int i = 0; i < g; i++) {
            r->slope[i] = 0.0;
            for (int b = 0; b < k; b++) {
                r->slope[i] += w[a * k + b] * r->basis[b * g + i];
            }
        }
        for (int i = 0; i < g; i++) {
            for (int q = 0; q < g && left[i] != 0.0; q++) {
                out[i * g + q] += left[i] * r->slope[q];
            }
        }
    }
}

/* Of the intrinsics, locked ones with zeros; of the poses: φ A⁻¹ + X C Xᵀ. */
static void spread_out(tsuya_covariance *c, const double *globals, reduced *r, double variance)
{
    int g = r->g, n = r->n, all = c->n;
    for (int i = 0; i < n * n; i++) {
        c->intrinsics[(i / n + r->locked) * all + i % n + r->locked] = globals[i / n * g + i % n];
    }
    for (int v = 0; v < r->solve->view_count; v++) {
        const double *x = r->elimination + (size_t)v * POSE * (size_t)g;
        double own[POSE * POSE] = {0}, *out = c->pose + v * POSE * POSE;
        for (int i = 0; i < POSE; i++) {
            own[i * (POSE + 1)] = 1.0;
        }
        tsuya_dense_forward(r->pose_factor + v * POSE * POSE, own, POSE, POSE);
        tsuya_dense_backward(r->pose_factor + v * POSE * POSE, own, POSE, POSE);
        for (int i = 0; i < POSE * POSE; i++) {
            out[i] = variance * own[i];
        }
        for (int a = 0; a < g; a++) {
            double row[POSE] = {0};
            for (int b = 0; b < g; b++) {
                for (int k = 0; k < POSE; k++) {
                    row[k] += globals[a * g + b] * x[k * g + b];
                }
            }
            for (int i = 0; i < POSE * POSE; i++) {
                out[i] += x[i / POSE * g + a] * row[i % POSE];
            }
        }
    }
}

tsuya_status tsuya_covariance_step(double *step, bool *determined, const tsuya_solve *solve)
{
    reduced r;
    TSUYA_TRY(allocate(&r, solve));
    tsuya_status status = reduce(determined, &r);
    if (status == TSUYA_OK && *determined) {
        tsuya_dense_forward(r.h, r.slope, r.g, 1);
        tsuya_dense_backward(r.h, r.slope, r.g, 1);
        memcpy(step, r.slope + r.n, (size_t)(r.g - r.n) * sizeof *step);
    }
    free_reduced(&r);
    return status;
}

tsuya_status tsuya_covariance_estimate(tsuya_covariance *c, const tsuya_solve *solve, bool clusters)
{
    reduced r;
    double *w = NULL, *globals = NULL, variance = isfinite(solve->variance) ? solve->variance : 1.0, scale = variance;
    bool determined;
    tsuya_status status = TSUYA_OK;
    *c = (tsuya_covariance){.n = tsuya_lens_parameters(&solve->camera), .photo_factor = 1.0};
    TSUYA_TRY(allocate(&r, solve));
    TSUYA_NEW(status, c->intrinsics, (size_t)c->n * (size_t)c->n);
    TSUYA_NEW(status, c->pose, POSE * POSE * (size_t)solve->view_count);
    TSUYA_NEW(status, w, (size_t)(r.k * r.k));
    TSUYA_NEW(status, globals, (size_t)r.g * (size_t)r.g);
    TSUYA_GOTO_DONE(status, reduce(&determined, &r));
    if (!determined || !span(&r)) {
        status = tsuya_fail(TSUYA_ERROR_NUMERIC, "the photographs do not determine the camera: turn and tilt the board more");
        goto done;
    }
    for (int i = 0; i < r.k; i++) {
        w[i * (r.k + 1)] = variance;
    }
    if (clusters) {
        TSUYA_GOTO_DONE(status, scatter(c, w, &scale, &r));
    }
    cover_globals(globals, w, scale, &r);
    spread_out(c, globals, &r, variance);
done:
    free_reduced(&r);
    tsuya_free(w);
    tsuya_free(globals);
    if (status != TSUYA_OK) {
        tsuya_covariance_free(c);
    }
    return status;
}

void tsuya_covariance_free(tsuya_covariance *c)
{
    tsuya_free(c->intrinsics);
    tsuya_free(c->pose);
    *c = (tsuya_covariance){0};
}
