/* S, the logarithm of what the two yarns leave: penalised linear least squares on the control net. */
#include "brdf/cholmod_adapter.h"
#include "brdf/sheen_fit.h"

#include "core/memory.h"

#include <string.h>

/* How a control value follows from the free ones.  Around the pole the signed-radius form S(φ, −θ) = S(φ + π, θ) ties the line
 * before the pole to the line behind it; one value K for the pole, and a first harmonic for the slopes, make it smooth there:
 *
 *   net[u][0] = net[u + nu/2][2],    net[u][1] = (6 K − net[u][2] − net[u + nu/2][2]) / 4,    net[u][2] = e_u + a cos φu + b sin φu
 *
 * with e_u of period π.  Free values of one layer: K, a, b, e (nu/2), then the lines v ≥ 3. */
tsuya_sheen_surface_options tsuya_sheen_surface_options_default(void)
{
    return (tsuya_sheen_surface_options){.smooth_phi = 1e-6, .smooth_theta = 1e-8, .smooth_d = 1e-6, .shrink = 1e-7};
}

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
    const tsuya_sheen_surface_options *options;
    int nu, nv, nd, unknowns;
    tie *ties;          /* of every control value */
    tsuya_sparse_sum matrix;
    double *right;
} system_state;

/* weight · (Σ w_k x_k − target)² over control values. */
static tsuya_status add_equation(system_state *s, const int *point, const double *weight, int count, double target, double scale)
{
    int index[64 * 8], used = 0;
    double w[64 * 8];
    for (int k = 0; k < count; ++k) {
        const tie *t = &s->ties[point[k]];
        for (int i = 0; i < t->count; ++i) {
            index[used] = t->index[i];
            w[used++] = weight[k] * t->weight[i];
        }
    }
    for (int i = 0; i < used; ++i) { /* gather repeated unknowns (they come in runs, and near the pole) */
        for (int j = i + 1; j < used && w[i] != 0.0; ++j) {
            if (index[j] == index[i]) {
                w[i] += w[j];
                w[j] = 0.0;
            }
        }
    }
    for (int i = 0; i < used; ++i) {
        if (w[i] == 0.0) {
            continue;
        }
        s->right[index[i]] += scale * w[i] * target;
        for (int j = i; j < used; ++j) {
            if (w[j] != 0.0) {
                TSUYA_TRY(tsuya_sparse_add(&s->matrix, index[i], index[j], scale * w[i] * w[j]));
            }
        }
    }
    return TSUYA_OK;
}

static int point_at(const system_state *s, int d, int u, int v) { return (d * s->nu + (u % s->nu + s->nu) % s->nu) * (s->nv + 3) + v; }

static tsuya_status add_second_difference(system_state *s, const int point[3], double scale)
{
    const double pattern[3] = {1.0, -2.0, 1.0};
    return add_equation(s, point, pattern, 3, 0.0, scale);
}

static tsuya_status add_penalties(system_state *s)
{
    const tsuya_sheen_surface_options *o = s->options;
    int layers = s->nd > 0 ? s->nd + 3 : 1;
    double hu = 2.0 * M_PI / s->nu, hv = 0.5 * M_PI / s->nv, hd = 0.5 * M_PI / (s->nd > 0 ? s->nd : 1);
    double cell = hu * hv * (s->nd > 0 ? hd : 1.0);
    for (int d = 0; d < layers; ++d) {
        for (int u = 0; u < s->nu; ++u) {
            for (int v = 0; v < s->nv + 3; ++v) {
                const int here = point_at(s, d, u, v);
                const double one = 1.0;
                TSUYA_TRY(add_equation(s, &here, &one, 1, 0.0, o->shrink * cell));
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

static tsuya_status add_data(system_state *s, const tsuya_sheen *sheen, const tsuya_fit_data *data, int c, const double *guide)
{
    int index[64];
    double weight[64];
    for (int k = 0; k < data->count; ++k) {
        double f = data->value[k * data->channels + c], root = data->root[k * data->channels + c], g = guide[k * data->channels + c];
        if (!(f > 0.0 && g > 0.0)) {
            continue;
        }
        int count = tsuya_sheen_stencil(index, weight, &data->angles[k], sheen->nu, sheen->nv, sheen->nd);
        TSUYA_TRY(add_equation(s, index, weight, count, log(f / g), root * root / (9.0 * data->root_sum)));
    }
    return TSUYA_OK;
}

tsuya_status tsuya_sheen_fit_surface(tsuya_sheen *sheen, double *reciprocal_condition, const tsuya_fit_data *data,
                                     const tsuya_sheen_surface_options *options)
{
    tsuya_status status = TSUYA_OK;
    int points = tsuya_sheen_net_points(sheen->nu, sheen->nv, sheen->nd), layers = sheen->nd > 0 ? sheen->nd + 3 : 1;
    system_state s = {.options = options, .nu = sheen->nu, .nv = sheen->nv, .nd = sheen->nd, .unknowns = layers * free_per_layer(sheen->nu, sheen->nv)};
    double *guide = NULL;
    *reciprocal_condition = 1.0;
    TSUYA_NEW(status, s.ties, (size_t)points);
    TSUYA_NEW(status, s.right, (size_t)s.unknowns);
    TSUYA_NEW(status, guide, (size_t)data->count * (size_t)data->channels);
    for (int k = 0; k < points; ++k) {
        s.ties[k] = tie_of(k, sheen->nu, sheen->nv);
    }
    for (int k = 0; k < data->count; ++k) {
        tsuya_sheen_guide(guide + k * data->channels, sheen, &data->angles[k]);
    }
    for (int c = 0; c < data->channels; ++c) {
        double condition;
        s.matrix.count = 0;
        s.matrix.size = s.unknowns;
        memset(s.right, 0, (size_t)s.unknowns * sizeof *s.right);
        TSUYA_GOTO_DONE(status, add_data(&s, sheen, data, c, guide));
        TSUYA_GOTO_DONE(status, add_penalties(&s));
        TSUYA_GOTO_DONE(status, tsuya_sparse_solve(s.right, 1, &s.matrix, &condition));
        *reciprocal_condition = fmin(*reciprocal_condition, condition);
        for (int k = 0; k < points; ++k) {
            double sum = 0.0;
            for (int i = 0; i < s.ties[k].count; ++i) {
                sum += s.ties[k].weight[i] * s.right[s.ties[k].index[i]];
            }
            sheen->net[(size_t)k * (size_t)sheen->line + (size_t)c] = (float)sum;
        }
    }
done:
    tsuya_sparse_free(&s.matrix);
    tsuya_free(s.ties);
    tsuya_free(s.right);
    tsuya_free(guide);
    return status;
}
