#include "brdf/polar_fit.h"

#include "brdf/cholmod_adapter.h"
#include "core/clones.h"
#include "core/memory.h"

#include <string.h>

/* How a control value follows from the free ones.  Around the pole the signed-radius form S(φ, −θ) = S(φ + π, θ) ties the line
 * before the pole to the line behind it; one value K for the pole, and a first harmonic for the slopes, make it smooth there:
 *
 *   net[u][0] = net[u + nu/2][2],    net[u][1] = (6 K − net[u][2] − net[u + nu/2][2]) / 4,    net[u][2] = e_u + a cos φu + b sin φu
 *
 * with e_u of period π.  Free values of one layer: K, a, b, e (nu/2), then the lines v ≥ 3. */
typedef struct tie {
    int count, index[8];
    double weight[8];
} tie;

static int free_per_layer(int nu, int nv) { return 3 + nu / 2 + nu * nv; }

static void add(tie *t, int index, double weight)
{
    for (int k = 0; k < t->count; ++k) {
        if (t->index[k] == index) {
            t->weight[k] += weight;
            return;
        }
    }
    t->index[t->count] = index;
    t->weight[t->count++] = weight;
}

static void add_ring(tie *t, int u, int nu, double weight)
{
    double phi = 2.0 * M_PI * (u - 1.0) / nu; /* function u is centred one step before knot u + 1 … u + 2 */
    u = (u % nu + nu) % nu;
    add(t, 1, weight * cos(phi));
    add(t, 2, weight * sin(phi));
    add(t, 3 + u % (nu / 2), weight);
}

static tie tie_of(int point, int nu, int nv)
{
    int layer = point / (nu * (nv + 3)), rest = point % (nu * (nv + 3)), u = rest / (nv + 3), v = rest % (nv + 3);
    tie t = {0};
    if (v == 0) {
        add_ring(&t, u + nu / 2, nu, 1.0);
    } else if (v == 1) {
        add(&t, 0, 1.5);
        add_ring(&t, u, nu, -0.25);
        add_ring(&t, u + nu / 2, nu, -0.25);
    } else if (v == 2) {
        add_ring(&t, u, nu, 1.0);
    } else {
        add(&t, 3 + nu / 2 + u * nv + v - 3, 1.0);
    }
    for (int k = 0; k < t.count; ++k) {
        t.index[k] += layer * free_per_layer(nu, nv);
    }
    return t;
}

typedef struct system {
    const tsuya_polar_options *options;
    int nu, nv, nd, unknowns;
    tie *ties; /* of every control value */
    tsuya_sparse_sum matrix;
    double *right;
} system_state;

/* Adds Σ a_ij x_i x_j (a symmetric, its upper triangle given) and the right side b over control values. */
static tsuya_status add_quadratic(system_state *s, const int *point, int count, const double *a, const double *b)
{
    for (int i = 0; i < count; ++i) {
        const tie *p = &s->ties[point[i]];
        for (int m = 0; m < p->count; ++m) {
            s->right[p->index[m]] += b[i] * p->weight[m];
        }
        for (int j = 0; j < count; ++j) {
            const tie *q = &s->ties[point[j]];
            double value = i < j ? a[i * count + j] : a[j * count + i];
            for (int m = 0; m < p->count && value != 0.0; ++m) {
                for (int n = 0; n < q->count; ++n) {
                    if (p->index[m] <= q->index[n]) {
                        TSUYA_TRY(tsuya_sparse_add(&s->matrix, p->index[m], q->index[n], value * p->weight[m] * q->weight[n]));
                    }
                }
            }
        }
    }
    return TSUYA_OK;
}

/* scale · (Σ w_k x_k)² */
static tsuya_status add_square(system_state *s, const int *point, const double *w, int count, double scale)
{
    double a[9] = {0}, b[3] = {0};
    for (int i = 0; i < count; ++i) {
        for (int j = i; j < count; ++j) {
            a[i * count + j] = scale * w[i] * w[j];
        }
    }
    return add_quadratic(s, point, count, a, b);
}

static int point_at(const system_state *s, int d, int u, int v) { return (d * s->nu + (u % s->nu + s->nu) % s->nu) * (s->nv + 3) + v; }

static tsuya_status add_second_difference(system_state *s, const int point[3], double scale)
{
    const double pattern[3] = {1.0, -2.0, 1.0};
    return add_square(s, point, pattern, 3, scale);
}

static tsuya_status add_penalties(system_state *s)
{
    const tsuya_polar_options *o = s->options;
    int layers = s->nd > 0 ? s->nd + 3 : 1;
    double hu = 2.0 * M_PI / s->nu, hv = 0.5 * M_PI / s->nv, hd = 0.5 * M_PI / (s->nd > 0 ? s->nd : 1);
    double cell = hu * hv * (s->nd > 0 ? hd : 1.0);
    for (int d = 0; d < layers; ++d) {
        for (int u = 0; u < s->nu; ++u) {
            for (int v = 0; v < s->nv + 3; ++v) {
                const int here = point_at(s, d, u, v);
                const double one = 1.0;
                TSUYA_TRY(add_square(s, &here, &one, 1, o->shrink * cell));
                if (v + 1 < s->nv + 3 && o->level > 0.0) {
                    TSUYA_TRY(add_square(s, (int[2]){here, here + 1}, (double[2]){-1.0, 1.0}, 2, o->level * cell / (hv * hv)));
                }
                if (v + 2 < s->nv + 3) {
                    TSUYA_TRY(add_second_difference(s, (int[3]){here, here + 1, here + 2}, o->smooth_theta * cell / pow(hv, 4)));
                }
                TSUYA_TRY(add_second_difference(s, (int[3]){point_at(s, d, u - 1, v), here, point_at(s, d, u + 1, v)}, o->smooth_phi * cell / pow(hu, 4)));
                if (d + 2 < layers) {
                    TSUYA_TRY(add_second_difference(s, (int[3]){here, point_at(s, d + 1, u, v), point_at(s, d + 2, u, v)}, o->smooth_d * cell / pow(hd, 4)));
                }
            }
        }
    }
    return TSUYA_OK;
}

/* The samples of one cell of the net touch the same control values: their sum first, the ties once. */
typedef struct cell_sum {
    double right[64], matrix[64 * 64];
} cell_sum;

TSUYA_CLONES("arch=x86-64-v3", "default") static void add_sample(cell_sum *sum, int count, const double *w, double weight, double target)
{
    for (int i = 0; i < count; ++i) {
        double scaled = weight * w[i], *row = sum->matrix + i * count;
        sum->right[i] += scaled * target;
        for (int j = i; j < count; ++j) {
            row[j] += scaled * w[j];
        }
    }
}

static int cell_of(const system_state *s, const tsuya_half_angles *a)
{
    double w[4];
    int u = tsuya_uniform_weights(w, a->phi_h, 0.0, 2.0 * M_PI, s->nu, true), v = tsuya_uniform_weights(w, a->theta_h, 0.0, 0.5 * M_PI, s->nv, false);
    return ((s->nd > 0 ? tsuya_uniform_weights(w, a->theta_d, 0.0, 0.5 * M_PI, s->nd, false) : 0) * s->nu + u) * s->nv + v;
}

/* Samples in the order of their cells: start has cells + 1 entries. */
static void sort_by_cell(int *order, int *start, int cells, const system_state *s, const tsuya_polar_samples *d)
{
    memset(start, 0, ((size_t)cells + 1) * sizeof *start);
    for (int k = 0; k < d->count; ++k) {
        start[cell_of(s, &d->angles[k]) + 1]++;
    }
    for (int c = 0; c < cells; ++c) {
        start[c + 1] += start[c];
    }
    for (int k = d->count - 1; k >= 0; --k) {
        order[--start[cell_of(s, &d->angles[k]) + 1]] = k; /* leaves start[c + 1] at the beginning of cell c */
    }
    memmove(start, start + 1, (size_t)cells * sizeof *start);
    start[cells] = d->count;
}

static void sum_cell(cell_sum *sum, const system_state *s, const tsuya_polar_samples *d, const int *order, int from, int to)
{
    int index[64], count = s->nd > 0 ? 64 : 16;
    double weight[64];
    memset(sum, 0, sizeof *sum);
    for (int k = from; k < to; ++k) {
        int at = order[k];
        if (d->weight[at] > 0.0) {
            tsuya_sheen_stencil(index, weight, &d->angles[at], s->nu, s->nv, s->nd);
            add_sample(sum, count, weight, d->weight[at], d->target[at]);
        }
    }
}

/* Some cells at a time side by side, added in their order. */
static tsuya_status add_data(system_state *s, const tsuya_polar_samples *d)
{
    enum { TOGETHER = 32 };
    tsuya_status status = TSUYA_OK;
    int cells = s->nu * s->nv * (s->nd > 0 ? s->nd : 1), *order = NULL, *start = NULL, index[64], count = s->nd > 0 ? 64 : 16;
    cell_sum *sum = NULL;
    double weight[64];
    TSUYA_NEW(status, order, (size_t)d->count + 1);
    TSUYA_NEW(status, start, (size_t)cells + 1);
    TSUYA_NEW(status, sum, TOGETHER);
    sort_by_cell(order, start, cells, s, d);
    for (int first = 0; first < cells; first += TOGETHER) {
        int last = first + TOGETHER < cells ? first + TOGETHER : cells;
#pragma omp parallel for schedule(dynamic) if (d->count > 20000)
        for (int c = first; c < last; ++c) {
            if (start[c] < start[c + 1]) {
                sum_cell(&sum[c - first], s, d, order, start[c], start[c + 1]);
            }
        }
        for (int c = first; c < last; ++c) {
            if (start[c] < start[c + 1]) {
                tsuya_sheen_stencil(index, weight, &d->angles[order[start[c]]], s->nu, s->nv, s->nd);
                TSUYA_GOTO_DONE(status, add_quadratic(s, index, count, sum[c - first].matrix, sum[c - first].right));
            }
        }
    }
done:
    tsuya_free(order);
    tsuya_free(start);
    tsuya_free(sum);
    return status;
}

static void untie(double *control, const system_state *s, int points)
{
    for (int k = 0; k < points; ++k) {
        control[k] = 0.0;
        for (int i = 0; i < s->ties[k].count; ++i) {
            control[k] += s->ties[k].weight[i] * s->right[s->ties[k].index[i]];
        }
    }
}

tsuya_status tsuya_polar_fit(double *control, double *reciprocal_condition, int nu, int nv, int nd, const tsuya_polar_samples *samples,
                             const tsuya_polar_options *options)
{
    tsuya_status status = TSUYA_OK;
    int points = tsuya_sheen_net_points(nu, nv, nd), layers = nd > 0 ? nd + 3 : 1;
    system_state s = {.options = options, .nu = nu, .nv = nv, .nd = nd, .unknowns = layers * free_per_layer(nu, nv)};
    s.matrix.size = s.unknowns;
    TSUYA_NEW(status, s.ties, (size_t)points);
    TSUYA_NEW(status, s.right, (size_t)s.unknowns);
    for (int k = 0; k < points; ++k) {
        s.ties[k] = tie_of(k, nu, nv);
    }
    TSUYA_GOTO_DONE(status, add_data(&s, samples));
    TSUYA_GOTO_DONE(status, add_penalties(&s));
    TSUYA_GOTO_DONE(status, tsuya_sparse_solve(s.right, 1, &s.matrix, reciprocal_condition));
    untie(control, &s, points);
done:
    tsuya_sparse_free(&s.matrix);
    tsuya_free(s.ties);
    tsuya_free(s.right);
    return status;
}
