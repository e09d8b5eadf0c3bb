#include "calib/covariance.h"

#include "calib/mrcal_adapter.h"
#include "core/dense.h"
#include "core/memory.h"

#include <string.h>

enum { POSE = 6, FEWEST_CLUSTERS = 4 };
/* A part that alone determines a direction says nothing about its error. */
static const double MOST_LEVERAGE = 0.9, BIAS_PRIOR = 0.5;

/* The reduced problem: g global parameters (intrinsics, bias, shapes). */
typedef struct reduced {
    const tsuya_solve *solve;
    int n, g, shapes;   /* shapes: parameters of each plate's shape */
    double *h;          /* g × g, the sum with the priors; later its Cholesky factor */
    double *view_h;     /* g × g a view */
    double *view_score; /* g a view */
    double *elimination; /* X = A⁻¹ B, 6 × g a view */
    double *pose_factor; /* Cholesky factor of A, 6 × 6 a view */
    double *photo_h, *photo_score;   /* whitened, g × g and g a photograph */
    double *tag_score, *cell_score;  /* g a tag; g × g: Σ s sᵀ over (view, tag) */
    double *j;          /* 2 × g of one corner */
    double *scratch;    /* 4 g² */
} reduced;

static void free_reduced(reduced *r)
{
    double **part[] = {&r->h, &r->view_h, &r->view_score, &r->elimination, &r->pose_factor, &r->photo_h, &r->photo_score, &r->tag_score, &r->cell_score,
                       &r->j, &r->scratch};
    for (size_t i = 0; i < sizeof part / sizeof part[0]; i++) {
        tsuya_free(*part[i]);
    }
}

static tsuya_status allocate(reduced *r, const tsuya_solve *s)
{
    tsuya_status status = TSUYA_OK;
    int n = tsuya_lens_parameters(s->camera.lens);
    *r = (reduced){.solve = s, .n = n, .shapes = tsuya_solve_shape_parameters(s), .g = n + 1 + tsuya_solve_shape_parameters(s) * s->board->plate_count};
    size_t g = (size_t)r->g, views = (size_t)s->view_count, photos = (size_t)s->photo_count;
    TSUYA_NEW(status, r->h, g * g);
    TSUYA_NEW(status, r->view_h, g * g * views);
    TSUYA_NEW(status, r->view_score, g * views);
    TSUYA_NEW(status, r->elimination, POSE * g * views);
    TSUYA_NEW(status, r->pose_factor, POSE * POSE * views);
    TSUYA_NEW(status, r->photo_h, g * g * photos);
    TSUYA_NEW(status, r->photo_score, g * photos);
    TSUYA_NEW(status, r->tag_score, g * (size_t)s->board->tag_count);
    TSUYA_NEW(status, r->cell_score, g * g);
    TSUYA_NEW(status, r->j, 2 * g);
    TSUYA_NEW(status, r->scratch, 4 * g * g);
done:
    if (status != TSUYA_OK) {
        free_reduced(r);
    }
    return status;
}

/* Derivatives of a corner's predicted pixel over its sigma: by the globals (2 × g, in r->j) and by the pose (2 × 6); the
 * residual over its sigma.  False for outliers and what does not project. */
static bool corner_row(double pose[2][POSE], double residual[2], reduced *r, const tsuya_solve_observation *o)
{
    const tsuya_solve *s = r->solve;
    const tsuya_solve_view *view = &s->view[o->view];
    tsuya_vec3 turned = tsuya_mat3_apply(view->camera_from_plate.rotation, tsuya_solve_point(s, o->tag, o->corner)), arm[TSUYA_SHAPE_PARAMETERS];
    tsuya_vec3 p = tsuya_vec3_add(turned, view->camera_from_plate.translation);
    double by_point[6], by_intrinsics[2 * TSUYA_INTRINSICS_MOST], w = 1.0 / o->weight_sigma_px;
    tsuya_vec2 q;
    if (o->outlier || !tsuya_mrcal_project(&q, by_point, by_intrinsics, &s->camera, p)) {
        return false;
    }
    memset(r->j, 0, 2 * (size_t)r->g * sizeof *r->j);
    tsuya_plate_shape_gradient(arm, &s->shape[view->plate], s->board, o->tag, o->corner);
    for (int i = 0; i < r->shapes; i++) {
        arm[i] = tsuya_mat3_apply(view->camera_from_plate.rotation, arm[i]);
    }
    for (int k = 0; k < 2; k++) {
        const double *d = by_point + 3 * k;
        double *j = r->j + k * r->g;
        for (int i = 0; i < r->n; i++) {
            j[i] = w * by_intrinsics[k * r->n + i];
        }
        j[r->n] = w * (k ? o->spread_px.y : o->spread_px.x);
        for (int i = 0; i < r->shapes; i++) {
            j[r->n + 1 + r->shapes * view->plate + i] = w * (d[0] * arm[i].x + d[1] * arm[i].y + d[2] * arm[i].z);
        }
        const double by[POSE] = {d[2] * turned.y - d[1] * turned.z, d[0] * turned.z - d[2] * turned.x, d[1] * turned.x - d[0] * turned.y, d[0], d[1], d[2]};
        for (int i = 0; i < POSE; i++) {
            pose[k][i] = w * by[i];
        }
        residual[k] = w * (k ? o->residual_px.y : o->residual_px.x);
    }
    return true;
}

/* Eliminates a view's pose. */
static bool reduce_view(reduced *r, int v)
{
    int g = r->g;
    double *a = r->pose_factor + v * POSE * POSE, *x = r->elimination + v * POSE * g, *h = r->view_h + (size_t)v * g * g, *score = r->view_score + v * g;
    double p[2][POSE], e[2], right[POSE] = {0};
    for (int i = 0; i < r->solve->view[v].count; i++) {
        if (!corner_row(p, e, r, &r->solve->observation[r->solve->view[v].first + i])) {
            continue;
        }
        for (int k = 0; k < 2; k++) {
            const double *j = r->j + k * g;
            for (int m = 0; m < POSE; m++) {
                right[m] += p[k][m] * e[k];
                for (int q = 0; q < POSE; q++) {
                    a[m * POSE + q] += p[k][m] * p[k][q];
                }
                for (int q = 0; q < g; q++) {
                    x[m * g + q] += p[k][m] * j[q];
                }
            }
            for (int m = 0; m < g; m++) {
                score[m] += j[m] * e[k];
                for (int q = 0; q < g; q++) {
                    h[m * g + q] += j[m] * j[q];
                }
            }
        }
    }
    if (!tsuya_dense_cholesky(a, POSE)) {
        return false;
    }
    tsuya_dense_forward(a, x, POSE, g);
    tsuya_dense_forward(a, right, POSE, 1);
    for (int m = 0; m < g; m++) {
        for (int k = 0; k < POSE; k++) {
            score[m] -= x[k * g + m] * right[k];
            for (int q = 0; q < g; q++) {
                h[m * g + q] -= x[k * g + m] * x[k * g + q];
            }
        }
    }
    tsuya_dense_backward(a, x, POSE, g);
    return true;
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

static bool reduce(reduced *r)
{
    int g = r->g, views = r->solve->view_count;
    for (int v = 0; v < views; v++) {
        if (!reduce_view(r, v)) {
            return false;
        }
        for (int i = 0; i < g * g; i++) {
            r->h[i] += r->view_h[(size_t)v * g * g + i];
        }
    }
    for (int i = r->n; i < g; i++) {
        r->h[i * (g + 1)] += prior_weight(r, i);
    }
    return tsuya_dense_cholesky(r->h, g);
}

static void transpose(double *m, int n)
{
    for (int i = 0; i < n; i++) {
        for (int k = i + 1; k < n; k++) {
            double t = m[i * n + k];
            m[i * n + k] = m[k * n + i];
            m[k * n + i] = t;
        }
    }
}

/* L⁻¹ · m · L⁻ᵀ in place. */
static void whiten(const reduced *r, double *m)
{
    int g = r->g;
    tsuya_dense_forward(r->h, m, g, g);
    transpose(m, g);
    tsuya_dense_forward(r->h, m, g, g);
}

/* sum += A u (A u)ᵀ with A = (1 − M)^(−½): what the cluster's pull would be, had the solve not followed it. */
static void add_cluster(double *sum, reduced *r, double *m, const double *u)
{
    int g = r->g;
    double *values = r->scratch, *vectors = r->scratch + g, *pull = vectors + g * g;
    tsuya_dense_eigen(m, values, vectors, g);
    memset(pull, 0, (size_t)g * sizeof *pull);
    for (int k = 0; k < g; k++) {
        double along = 0.0, gain = 1.0 / sqrt(1.0 - fmin(fmax(values[k], 0.0), MOST_LEVERAGE));
        for (int i = 0; i < g; i++) {
            along += vectors[i * g + k] * u[i];
        }
        for (int i = 0; i < g; i++) {
            pull[i] += vectors[i * g + k] * gain * along;
        }
    }
    for (int i = 0; i < g; i++) {
        for (int k = 0; k < g; k++) {
            sum[i * g + k] += pull[i] * pull[k];
        }
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

/* Scatter by photograph, whitened, in `sum`; how many photographs, and how many directions they determine. */
static int by_photo(double *sum, double *directions, reduced *r)
{
    const tsuya_solve *s = r->solve;
    int g = r->g, photos = 0;
    *directions = 0.0;
    for (int begin = 0, end; begin < s->view_count; begin = end) {
        double *m = r->photo_h + (size_t)photos * g * g, *u = r->photo_score + (size_t)photos * g;
        for (end = begin; end < s->view_count && s->view[end].photo == s->view[begin].photo; end++) {
            for (int i = 0; i < g * g; i++) {
                m[i] += r->view_h[(size_t)end * g * g + i];
            }
            for (int i = 0; i < g; i++) {
                u[i] += r->view_score[(size_t)end * g + i];
            }
        }
        whiten(r, m);
        tsuya_dense_forward(r->h, u, g, 1);
        *directions += trace(m, g);
        add_cluster(sum, r, m, u);
        photos++;
    }
    return photos;
}

/* Scatter by tag, less what independent corners would give: Σ_tag − Σ_(view, tag).  Whitened. */
static void by_tag(double *sum, int *tags, reduced *r)
{
    const tsuya_solve *s = r->solve;
    int g = r->g;
    double p[2][POSE], e[2], *cell = r->scratch;
    for (int v = 0; v < s->view_count; v++) {
        const double *x = r->elimination + (size_t)v * POSE * g;
        int last = s->view[v].first + s->view[v].count, before = -1;
        for (int i = s->view[v].first; i <= last; i++) {
            const tsuya_solve_observation *o = i < last ? &s->observation[i] : NULL;
            if (before >= 0 && (!o || o->tag != before)) {
                tsuya_dense_forward(r->h, cell, g, 1);
                for (int a = 0; a < g; a++) {
                    r->tag_score[(size_t)before * g + a] += cell[a];
                    for (int b = 0; b < g; b++) {
                        sum[a * g + b] -= cell[a] * cell[b];
                    }
                }
                before = -1;
            }
            if (o && before < 0) {
                memset(cell, 0, (size_t)g * sizeof *cell);
                before = o->tag;
            }
            for (int k = 0; o && corner_row(p, e, r, o) && k < 2; k++) {
                for (int a = 0; a < g; a++) {
                    double d = r->j[k * g + a];
                    for (int q = 0; q < POSE; q++) {
                        d -= p[k][q] * x[q * g + a];
                    }
                    cell[a] += d * e[k];
                }
            }
        }
    }
    *tags = 0;
    for (int t = 0; t < s->board->tag_count; t++) {
        const double *u = r->tag_score + (size_t)t * g;
        double square = 0.0;
        for (int a = 0; a < g; a++) {
            square += u[a] * u[a];
            for (int b = 0; b < g; b++) {
                sum[a * g + b] += u[a] * u[b];
            }
        }
        *tags += square > 0.0;
    }
}

/* sum += the positive part of `m`. */
static void add_positive(double *sum, double *m, double *scratch, int g)
{
    double *values = scratch, *vectors = scratch + g;
    tsuya_dense_eigen(m, values, vectors, g);
    for (int k = 0; k < g; k++) {
        for (int i = 0; i < g && values[k] > 0.0; i++) {
            for (int j = 0; j < g; j++) {
                sum[i * g + j] += values[k] * vectors[i * g + k] * vectors[j * g + k];
            }
        }
    }
}

/* The globals' covariance in whitened coordinates.  Few clusters tell the size of the scatter better than its shape, so the
 * shape is drawn towards the normal equations'. */
static void scatter(tsuya_covariance *c, double *w, reduced *r)
{
    int g = r->g, tags;
    double directions, *m = r->scratch + 3 * g * g, variance = isfinite(r->solve->variance) ? r->solve->variance : 1.0;
    memset(w, 0, (size_t)(g * g) * sizeof *w);
    int photos = by_photo(w, &directions, r);
    double scale = trace(w, g) / directions, share = photos / (photos + 2.0 * g);
    if (photos < FEWEST_CLUSTERS) {
        scale = variance;
        share = 0.0;
    }
    for (int i = 0; i < g * g; i++) {
        w[i] = share * w[i] + (1.0 - share) * scale * (i % (g + 1) == 0);
    }
    c->photo_factor = sqrt(scale / variance);
    memset(m, 0, (size_t)(g * g) * sizeof *m);
    by_tag(m, &tags, r);
    double excess = trace(m, g) / directions / scale;
    if (photos >= FEWEST_CLUSTERS && tags >= FEWEST_CLUSTERS && excess > 2.0 * sqrt(2.0 / (tags * directions))) {
        c->tag_factor = sqrt(excess);
        add_positive(w, m, r->scratch, g);
    }
}

/* `covariance` of the globals (g × g) = L⁻ᵀ W L⁻¹; poses: φ A⁻¹ + X C Xᵀ. */
static void spread_out(tsuya_covariance *c, double *w, reduced *r, double variance)
{
    int g = r->g, n = r->n;
    for (int turn = 0; turn < 2; turn++) {
        tsuya_dense_backward(r->h, w, g, g);
        transpose(w, g);
    }
    for (int i = 0; i < n * n; i++) {
        c->intrinsics[i] = w[i / n * g + i % n];
    }
    for (int v = 0; v < r->solve->view_count; v++) {
        const double *x = r->elimination + (size_t)v * POSE * g;
        double own[POSE * POSE] = {0};
        for (int i = 0; i < POSE; i++) {
            own[i * (POSE + 1)] = 1.0;
        }
        tsuya_dense_forward(r->pose_factor + v * POSE * POSE, own, POSE, POSE);
        tsuya_dense_backward(r->pose_factor + v * POSE * POSE, own, POSE, POSE);
        for (int i = 0; i < POSE; i++) {
            for (int k = 0; k < POSE; k++) {
                double sum = variance * own[i * POSE + k];
                for (int a = 0; a < g; a++) {
                    for (int b = 0; b < g; b++) {
                        sum += x[i * g + a] * w[a * g + b] * x[k * g + b];
                    }
                }
                c->pose[(v * POSE + i) * POSE + k] = sum;
            }
        }
    }
}

/* What the parameter stands at. */
static double standing(const reduced *r, int parameter)
{
    int k = parameter - r->n - 1;
    const tsuya_plate_shape *shape = &r->solve->shape[k < 0 ? 0 : k / r->shapes];
    return k < 0 ? r->solve->edge_bias : k % r->shapes ? shape->bend_m[k % r->shapes - 1] : shape->growth;
}

tsuya_status tsuya_covariance_step(double *step, bool *determined, const tsuya_solve *solve)
{
    reduced r;
    TSUYA_TRY(allocate(&r, solve));
    *determined = reduce(&r);
    if (*determined) {
        double *right = r.scratch;
        for (int i = 0; i < r.g; i++) {
            right[i] = i < r.n ? 0.0 : -prior_weight(&r, i) * standing(&r, i);
            for (int v = 0; v < solve->view_count; v++) {
                right[i] += r.view_score[v * r.g + i];
            }
        }
        tsuya_dense_forward(r.h, right, r.g, 1);
        tsuya_dense_backward(r.h, right, r.g, 1);
        memcpy(step, right + r.n, (size_t)(r.g - r.n) * sizeof *step);
    }
    free_reduced(&r);
    return TSUYA_OK;
}

tsuya_status tsuya_covariance_estimate(tsuya_covariance *c, const tsuya_solve *solve, bool clusters)
{
    reduced r;
    double *w = NULL, variance = isfinite(solve->variance) ? solve->variance : 1.0;
    tsuya_status status = TSUYA_OK;
    *c = (tsuya_covariance){.n = tsuya_lens_parameters(solve->camera.lens), .photo_factor = 1.0};
    TSUYA_TRY(allocate(&r, solve));
    TSUYA_NEW(status, c->pose, POSE * POSE * (size_t)solve->view_count);
    TSUYA_NEW(status, w, (size_t)(r.g * r.g));
    if (!reduce(&r)) {
        status = tsuya_fail(TSUYA_ERROR_NUMERIC, "the photographs do not determine the camera: turn and tilt the board more");
        goto done;
    }
    for (int i = 0; i < r.g; i++) {
        w[i * (r.g + 1)] = variance;
    }
    if (clusters) {
        scatter(c, w, &r);
    }
    spread_out(c, w, &r, variance);
done:
    free_reduced(&r);
    tsuya_free(w);
    if (status != TSUYA_OK) {
        tsuya_covariance_free(c);
    }
    return status;
}

void tsuya_covariance_free(tsuya_covariance *c)
{
    tsuya_free(c->pose);
    *c = (tsuya_covariance){0};
}
