#include "brdf/energy.h"

#include "brdf/albedo_grid.h"
#include "core/memory.h"

#include <string.h>

enum { SIDE_FINE = 33, SIDE_COARSE = 17, FINE_CHANNELS = 4, DRAWS = 2048, BLOCK = 128, ROUNDS = 80 };
/* What a node may reflect: the rest is for the quadrature and for what lies between the nodes. */
static const double ceiling = 0.99, brightest = 1e30;

typedef struct quadrature {
    const tsuya_brdf_model *model;
    const void *state;
    int channels, side;
    float *shared; /* 3 × DRAWS: what the draws of all viewers have in common; NULL: nothing */
} quadrature;

static double van_der_corput(uint32_t i)
{
    i = (i << 16) | (i >> 16);
    i = ((i & 0x00ff00ffu) << 8) | ((i & 0xff00ff00u) >> 8);
    i = ((i & 0x0f0f0f0fu) << 4) | ((i & 0xf0f0f0f0u) >> 4);
    i = ((i & 0x33333333u) << 2) | ((i & 0xccccccccu) >> 2);
    i = ((i & 0x55555555u) << 1) | ((i & 0xaaaaaaaau) >> 1);
    return i * 0x1.0p-32;
}

/* Draws of one viewer: a Hammersley set through the model's own sampling.  weight: cosθi / (pdf DRAWS), or 0. */
typedef struct draws {
    float wi[3][BLOCK], wo[3][BLOCK], weight[BLOCK];
} draws;

static void take(draws *d, const quadrature *q, tsuya_vec3 wo, int from)
{
    if (q->shared) {
        q->model->take_draws(q->state, wo, q->shared + from, DRAWS, from, BLOCK, (float *const[3]){d->wi[0], d->wi[1], d->wi[2]}, d->weight);
        return;
    }
    for (int k = 0; k < BLOCK; ++k) {
        const double u[2] = {(from + k + 0.5) / DRAWS, van_der_corput((uint32_t)(from + k))};
        tsuya_vec3 wi = {0.0, 0.0, 1.0};
        double pdf = 0.0;
        bool up = q->model->sample(q->state, wo, u, &wi) && (pdf = q->model->pdf(q->state, wi, wo)) > 0.0;
        d->weight[k] = up ? (float)(wi.z / (pdf * DRAWS)) : 0.0f;
        d->wi[0][k] = up ? (float)wi.x : 0.0f;
        d->wi[1][k] = up ? (float)wi.y : 0.0f;
        d->wi[2][k] = up ? (float)wi.z : 1.0f;
    }
}

/* Where the draws lie among the nodes: the first of four, and the weights of all. */
typedef struct spots {
    int node[BLOCK];
    float weight[BLOCK][4];
} spots;

static void find_spots(spots *s, const draws *d, int side)
{
    for (int k = 0; k < BLOCK; ++k) {
        double u, v;
        tsuya_grid_from_direction(&u, &v, (tsuya_vec3){d->wi[0][k], d->wi[1][k], fmin(d->wi[2][k], 1.0)});
        u *= side - 1;
        v *= side - 1;
        int i = (int)fmin(u, side - 2), j = (int)fmin(v, side - 2);
        float a = (float)(u - i), b = (float)(v - j);
        s->node[k] = j * side + i;
        const float four[4] = {(1.0f - a) * (1.0f - b), a * (1.0f - b), (1.0f - a) * b, a * b};
        memcpy(s->weight[k], four, sizeof four);
    }
}

/* ∫ f cosθ dw of every channel; with `row`, channels × nodes numbers, also by the nodes on which the light falls. */
static void integrate(double *albedo, float *row, const quadrature *q, tsuya_vec3 wo)
{
    draws d;
    spots s;
    float value[TSUYA_MATERIAL_MAX_CHANNELS * BLOCK];
    const tsuya_direction_batch batch = {BLOCK, d.wi[0], d.wi[1], d.wi[2], d.wo[0], d.wo[1], d.wo[2]};
    for (int k = 0; k < BLOCK; ++k) {
        d.wo[0][k] = (float)wo.x;
        d.wo[1][k] = (float)wo.y;
        d.wo[2][k] = (float)wo.z;
    }
    memset(albedo, 0, (size_t)q->channels * sizeof *albedo);
    for (int from = 0; from < DRAWS; from += BLOCK) {
        take(&d, q, wo, from);
        q->model->eval_batch(q->state, q->channels, &batch, value);
        if (row) {
            find_spots(&s, &d, q->side);
        }
        for (int c = 0; c < q->channels; ++c) {
            float *part = row ? row + (size_t)c * (size_t)(q->side * q->side) : NULL;
            for (int k = 0; k < BLOCK; ++k) {
                double v = (double)d.weight[k] * (double)value[c * BLOCK + k];
                v = v > 0.0 ? fmin(v, brightest) : 0.0; /* NaN gives 0 */
                albedo[c] += v;
                for (int corner = 0; part && corner < 4; ++corner) {
                    part[s.node[k] + corner % 2 + corner / 2 * q->side] += (float)v * s.weight[k][corner];
                }
            }
        }
    }
}

/* Nodes that stand for one direction, the pole's row and the seam; and those that mirror each other. */
static int representative(const quadrature *q, int node)
{
    int turn = q->side - 1, row = node / q->side, i = node % q->side % turn;
    if (row == 0) {
        return 0;
    }
    if (q->model->mirrored) {
        i = i > turn / 2 ? turn - i : i;
        i = i < turn / 4 ? turn / 2 - i : i;
    }
    return row * q->side + i;
}

static double fill(tsuya_albedo_table *t, float *kernel, const quadrature *q)
{
    int nodes = q->side * q->side, channels = q->channels;
    double top = 0.0;
#pragma omp parallel for schedule(dynamic, 8) reduction(max : top)
    for (int node = 0; node < nodes; ++node) {
        double albedo[TSUYA_MATERIAL_MAX_CHANNELS];
        if (representative(q, node) != node) {
            continue;
        }
        tsuya_vec3 w = tsuya_grid_node(node, q->side);
        if (q->model->albedo && !kernel) {
            q->model->albedo(q->state, channels, w, albedo);
        } else {
            integrate(albedo, kernel ? kernel + (size_t)node * (size_t)channels * (size_t)nodes : NULL, q, w);
        }
        for (int c = 0; c < channels; ++c) {
            top = fmax(top, albedo[c]);
            t->value[node * channels + c] = (float)(albedo[c] > 0.0 ? fmin(albedo[c], 1.0) : 0.0);
        }
    }
    return top;
}

static void copy_to_twins(tsuya_albedo_table *t, const quadrature *q)
{
    for (int node = 0; node < t->side * t->side; ++node) {
        int from = representative(q, node);
        memmove(t->value + node * t->channels, t->value + from * t->channels, (size_t)t->channels * sizeof *t->value);
    }
}

/* Σ_j kernel s_j of every channel of a node. */
static void reflect(double *value, const float *row, const float *factor, int channels, int nodes)
{
    for (int c = 0; c < channels; ++c) {
        float part[8] = {0};
        for (int j = 0; j + 8 <= nodes; j += 8) {
            for (int lane = 0; lane < 8; ++lane) {
                part[lane] += row[(size_t)c * (size_t)nodes + (size_t)(j + lane)] * factor[j + lane];
            }
        }
        value[c] = 0.0;
        for (int j = nodes & ~7; j < nodes; ++j) {
            value[c] += (double)row[(size_t)c * (size_t)nodes + (size_t)j] * (double)factor[j];
        }
        for (int lane = 0; lane < 8; ++lane) {
            value[c] += (double)part[lane];
        }
    }
}

/* The largest of a node and its neighbours, so that what lies between nodes keeps the bound too; the pole has a whole ring. */
static double around(const double *albedo, const quadrature *q, int node)
{
    double largest = 0.0;
    int side = q->side, i = node % side, j = node / side, reach = j == 0 ? side / 2 : 1;
    for (int v = j > 0 ? j - 1 : 0; v <= j + 1 && v < side; ++v) {
        for (int di = -reach; di <= reach; ++di) {
            largest = fmax(largest, albedo[representative(q, v * side + (i + di + side - 1) % (side - 1))]);
        }
    }
    return largest;
}

/* The largest albedo of each node under the factors, over the channels. */
static void all_albedos(double *albedo, const float *kernel, const tsuya_albedo_table *limit, const quadrature *q)
{
    int nodes = q->side * q->side, channels = q->channels;
#pragma omp parallel for schedule(static)
    for (int node = 0; node < nodes; ++node) {
        double value[TSUYA_MATERIAL_MAX_CHANNELS];
        albedo[node] = 0.0;
        if (representative(q, node) == node) {
            reflect(value, kernel + (size_t)node * (size_t)channels * (size_t)nodes, limit->value, channels, nodes);
            for (int c = 0; c < channels; ++c) {
                albedo[node] = fmax(albedo[node], value[c]);
            }
        }
    }
}

/* s ← min(1, √(ceiling s / (largest ∫ f s around))); returns by how much a logarithm changed. */
static double scale_once(tsuya_albedo_table *limit, const double *albedo, const quadrature *q)
{
    double change = 0.0;
    for (int node = 0; node < q->side * q->side; ++node) {
        if (representative(q, node) == node) {
            double s = (double)limit->value[node], seen = s * around(albedo, q, node) / ceiling;
            double next = seen > s * s ? s / sqrt(seen) : 1.0;
            change = fmax(change, fabs(log(next / s)));
            limit->value[node] = (float)next;
        }
    }
    copy_to_twins(limit, q);
    return change;
}

/* Until the factors stay; then by whatever common factor is still missing.  `albedo` (nodes) ends as what is left. */
static void settle(tsuya_albedo_table *limit, double *albedo, const float *kernel, const quadrature *q)
{
    int nodes = q->side * q->side;
    double excess = 1.0;
    for (int round = 0; round < ROUNDS; ++round) {
        all_albedos(albedo, kernel, limit, q);
        if (scale_once(limit, albedo, q) < 1e-3) {
            break;
        }
    }
    all_albedos(albedo, kernel, limit, q);
    for (int node = 0; node < nodes; ++node) {
        excess = fmax(excess, (double)limit->value[node] * around(albedo, q, node) / ceiling);
    }
    for (int node = 0; node < nodes; ++node) {
        limit->value[node] = (float)((double)limit->value[node] / sqrt(excess));
    }
}

static tsuya_status make_limit(tsuya_albedo_table *albedo, tsuya_albedo_table **limit, const quadrature *q)
{
    tsuya_status status = TSUYA_OK;
    size_t nodes = (size_t)q->side * (size_t)q->side, channels = (size_t)q->channels;
    float *kernel = NULL; /* [node, channel, node] */
    double *left = NULL;
    TSUYA_NEW(status, kernel, nodes * channels * nodes);
    TSUYA_NEW(status, left, nodes);
    TSUYA_GOTO_DONE(status, tsuya_albedo_table_create(limit, q->side, 1));
    for (size_t node = 0; node < nodes; ++node) {
        (*limit)->value[node] = 1.0f;
    }
    fill(albedo, kernel, q);
    settle(*limit, left, kernel, q);
    for (size_t node = 0; node < nodes; ++node) {
        double value[TSUYA_MATERIAL_MAX_CHANNELS], s = (double)(*limit)->value[node];
        reflect(value, kernel + node * channels * nodes, (*limit)->value, q->channels, (int)nodes);
        for (size_t c = 0; c < channels; ++c) {
            albedo->value[node * channels + c] = (float)fmin(s * value[c], 1.0);
        }
    }
    copy_to_twins(albedo, q);
done:
    tsuya_free(kernel);
    tsuya_free(left);
    return status;
}

tsuya_status tsuya_energy_tables_create(tsuya_albedo_table **albedo, tsuya_albedo_table **limit, const tsuya_brdf_model *model,
                                        const void *state, int channels)
{
    tsuya_status status = TSUYA_OK;
    quadrature q = {.model = model, .state = state, .channels = channels, .side = channels <= FINE_CHANNELS ? SIDE_FINE : SIDE_COARSE};
    *albedo = *limit = NULL;
    if (model->shared_draws) {
        TSUYA_NEW(status, q.shared, 3 * DRAWS);
        model->shared_draws(state, DRAWS, q.shared);
    }
    TSUYA_GOTO_DONE(status, tsuya_albedo_table_create(albedo, q.side, channels));
    double highest = fill(*albedo, NULL, &q);
    copy_to_twins(*albedo, &q);
    if (model->unbounded && highest > ceiling) {
        TSUYA_GOTO_DONE(status, make_limit(*albedo, limit, &q));
        tsuya_limit_find_level(*limit);
    }
    tsuya_albedo_table_fill_mean(*albedo);
done:
    tsuya_free(q.shared);
    if (status != TSUYA_OK) {
        tsuya_albedo_table_free(*albedo);
        tsuya_albedo_table_free(*limit);
        *albedo = *limit = NULL;
    }
    return status;
}
