/* The two yarns: a small dense Levenberg–Marquardt in logarithms. */
#include "brdf/sheen_fit.h"

#include "core/memory.h"

#include <string.h>

tsuya_status tsuya_fit_data_create(tsuya_fit_data *d, const tsuya_samples *s)
{
    tsuya_status status = TSUYA_OK;
    size_t n = (size_t)s->count, channels = (size_t)s->channel_count;
    *d = (tsuya_fit_data){.count = s->count, .channels = s->channel_count, .scale = 0.0, .relative = s->relative};
    TSUYA_NEW(status, d->angles, n);
    TSUYA_NEW(status, d->cosine, n);
    TSUYA_NEW(status, d->value, n * channels);
    TSUYA_NEW(status, d->root, n * channels);
    for (size_t k = 0; k < n * channels; ++k) {
        d->scale = s->value[k] > d->scale ? s->value[k] : d->scale;
    }
    d->scale = d->scale > 0.0 ? d->scale : 1.0;
    for (size_t k = 0; k < n; ++k) {
        d->angles[k] = tsuya_half_angles_of(s->wi[k], s->wo[k]);
        d->cosine[k] = s->wi[k].z;
        for (size_t c = 0; c < channels; ++c) {
            double v = s->value[k * channels + c] / d->scale, root = cbrt(v * s->wi[k].z);
            d->value[k * channels + c] = v;
            d->root[k * channels + c] = root;
            d->root_sum += isnan(root) ? 0.0 : root * root;
        }
    }
    d->root_sum = d->root_sum > 0.0 ? d->root_sum : 1.0;
    return TSUYA_OK;
done:
    tsuya_fit_data_free(d);
    return status;
}

void tsuya_fit_data_free(tsuya_fit_data *d)
{
    tsuya_free(d->angles);
    tsuya_free(d->cosine);
    tsuya_free(d->value);
    tsuya_free(d->root);
    *d = (tsuya_fit_data){0};
}

tsuya_sheen_guide_options tsuya_sheen_guide_options_default(void)
{
    return (tsuya_sheen_guide_options){.spans = 45, .smooth_along = 1e-10, .smooth_across = 3e-6, .iterations = 60, .rounds = 4};
}

/* Parameters: four curves, then per channel ln s_warp, ln s_weft, ln m. */
typedef struct problem {
    const tsuya_fit_data *data;
    const tsuya_sheen_guide_options *options;
    tsuya_sheen *sheen;
    int curve_size, unknowns, usable;
    double smooth[4]; /* of each curve */
    double *rise;     /* of every sample: Fη(wi·h)/Fη(0) − 1 */
    double share[2][TSUYA_MATERIAL_MAX_CHANNELS]; /* of each yarn's strength that follows it */
    double *matrix, *gradient, *step, *saved, *trial; /* unknowns², unknowns … */
} problem;

enum { PARTS = 3, SLANTS = 4, ROW = 16 + PARTS + SLANTS };
static const double strength_floor = 1e-9, strength_ceiling = 1e6;

static double *parameter(const problem *p, int k)
{
    if (k < 4 * p->curve_size) {
        return p->sheen->curve[k / p->curve_size] + k % p->curve_size;
    }
    k -= 4 * p->curve_size;
    if (k < SLANTS) {
        return &p->sheen->slant[k / 2][k % 2];
    }
    k -= SLANTS;
    double *of[PARTS] = {p->sheen->strength[0], p->sheen->strength[1], p->sheen->matte};
    return of[k / p->data->channels] + k % p->data->channels;
}

/* One sample's stencil on the curves: 16 indices into the unknowns and weights; yarn 0 has the first eight. */
static void curve_stencil(int *index, double *weight, const problem *p, const tsuya_half_angles *a)
{
    double wt[4], wb[4];
    int t = tsuya_uniform_weights(wt, a->psi_t, -0.5 * M_PI, 0.5 * M_PI, p->options->spans, false);
    int b = tsuya_uniform_weights(wb, a->psi_b, -0.5 * M_PI, 0.5 * M_PI, p->options->spans, false);
    for (int k = 0; k < 4; ++k) {
        const int at[4] = {b + k, t + k, t + k, b + k};
        const double w[4] = {wb[k], wt[k], wt[k], wb[k]};
        for (int curve = 0; curve < 4; ++curve) {
            index[curve * 4 + k] = curve * p->curve_size + at[curve];
            weight[curve * 4 + k] = w[curve];
        }
    }
}

static void yarns_at(double yarn[2], const problem *p, int k)
{
    tsuya_sheen_yarns(yarn, p->sheen, &p->data->angles[k]);
    yarn[0] = exp(yarn[0]);
    yarn[1] = exp(yarn[1]);
}

/* Terms of one channel and its residual. */
static double residual(double term[PARTS], const problem *p, int k, int c, const double yarn[2])
{
    const tsuya_sheen *s = p->sheen;
    double falloff = p->data->angles[k].falloff, rise = p->rise[k];
    term[0] = s->strength[0][c] * (1.0 + p->share[0][c] * rise) * yarn[0] * falloff;
    term[1] = s->strength[1][c] * (1.0 + p->share[1][c] * rise) * yarn[1] * falloff;
    term[2] = s->matte[c] * falloff;
    double g = term[0] + term[1] + term[2], root = cbrt(g * p->data->cosine[k]);
    for (int j = 0; j < PARTS; ++j) {
        term[j] = g > 0.0 ? root / 3.0 * term[j] / g : 0.0; /* now the derivative by its logarithm */
    }
    return root - p->data->root[k * p->data->channels + c];
}

static double data_term(const problem *p)
{
    double sum = 0.0, yarn[2], term[PARTS];
    for (int k = 0; k < p->data->count; ++k) {
        yarns_at(yarn, p, k);
        for (int c = 0; c < p->data->channels; ++c) {
            if (!isnan(p->data->root[k * p->data->channels + c])) {
                double r = residual(term, p, k, c, yarn);
                sum += r * r;
            }
        }
    }
    return sum / p->data->root_sum;
}

/* The light's slant to a yarn explains little by itself: κ of a few tenths costs as much as the noise of a good bench. */
static const double slant_ridge = 1e-4, convexity = 30.0, level = 1e-2;
/* Coefficients of the differences of order 1, 2, 3. */
static const double pattern[4][4] = {{0}, {-1.0, 1.0}, {1.0, -2.0, 1.0}, {-1.0, 3.0, -3.0, 1.0}};


/* Weights of the squared differences of order 1 to 3 of a curve's control values, without its smoothing: ∫ (a″)² along a yarn;
 * across it ∫ (a‴)², which leaves a Gaussian free, and ∫ max(a″, 0)²: the distribution across a yarn may have shoulders, but a
 * second yarn that is nothing but a hollow where the first one shines is most likely an error of fit; and a little of ∫ (a′)²
 * to stay level where nothing was measured. */
static void curve_weights(double weight[4], const problem *p, int curve)
{
    double h = M_PI / p->options->spans;
    bool across = curve % 2;
    weight[1] = level / h;
    weight[2] = (across ? convexity : 1.0) / (h * h * h);
    weight[3] = across ? 0.1 / (h * h * h * h * h) : 0.0;
}

static double difference(const double *a, int order)
{
    double d = 0.0;
    for (int i = 0; i <= order; ++i) {
        d += pattern[order][i] * a[i];
    }
    return d;
}

static double roughness(const problem *p, int curve)
{
    const double *a = p->sheen->curve[curve];
    double w[4], sum = 0.0;
    curve_weights(w, p, curve);
    for (int order = 1; order <= 3; ++order) {
        for (int k = 0; k + order < p->curve_size && w[order] > 0.0; ++k) {
            double d = difference(a + k, order);
            sum += curve % 2 && order == 2 && d < 0.0 ? 0.0 : w[order] * d * d;
        }
    }
    return sum;
}

static double penalty_term(const problem *p)
{
    double sum = 0.0;
    for (int curve = 0; curve < 4; ++curve) {
        sum += p->smooth[curve] * roughness(p, curve);
    }
    for (int k = 0; k < SLANTS; ++k) {
        double slant = *parameter(p, 4 * p->curve_size + k);
        sum += slant_ridge * slant * slant;
    }
    return sum;
}

static void add_difference(const problem *p, int first, int order, double weight)
{
    double d = 0.0;
    for (int i = 0; i <= order; ++i) {
        d += pattern[order][i] * *parameter(p, first + i);
    }
    if (first / p->curve_size % 2 && order == 2 && d < 0.0) {
        return;
    }
    for (int i = 0; i <= order; ++i) {
        p->gradient[first + i] += weight * pattern[order][i] * d;
        for (int j = 0; j <= order; ++j) {
            p->matrix[(size_t)(first + i) * (size_t)p->unknowns + (size_t)(first + j)] += weight * pattern[order][i] * pattern[order][j];
        }
    }
}

static void add_row(const problem *p, const int *index, const double *row, double r, double weight)
{
    for (int i = 0; i < ROW; ++i) {
        double v = weight * row[i];
        p->gradient[index[i]] += v * r;
        for (int j = 0; j < ROW; ++j) {
            p->matrix[(size_t)index[i] * (size_t)p->unknowns + (size_t)index[j]] += v * row[j];
        }
    }
}

static void assemble(const problem *p)
{
    double yarn[2], term[PARTS], weight[16], row[ROW];
    int index[ROW], channels = p->data->channels;
    memset(p->matrix, 0, (size_t)p->unknowns * (size_t)p->unknowns * sizeof *p->matrix);
    memset(p->gradient, 0, (size_t)p->unknowns * sizeof *p->gradient);
    for (int k = 0; k < p->data->count; ++k) {
        yarns_at(yarn, p, k);
        curve_stencil(index, weight, p, &p->data->angles[k]);
        for (int c = 0; c < channels; ++c) {
            if (isnan(p->data->root[k * channels + c])) {
                continue;
            }
            double r = residual(term, p, k, c, yarn);
            for (int i = 0; i < 16; ++i) {
                row[i] = weight[i] * term[i / 8];
            }
            const tsuya_half_angles *a = &p->data->angles[k];
            const double slant[SLANTS] = {a->db2, a->dt2, a->dt2, a->db2};
            for (int j = 0; j < SLANTS; ++j) {
                row[16 + j] = term[j / 2] * slant[j];
                index[16 + j] = 4 * p->curve_size + j;
            }
            for (int j = 0; j < PARTS; ++j) {
                row[16 + SLANTS + j] = term[j];
                index[16 + SLANTS + j] = 4 * p->curve_size + SLANTS + j * channels + c;
            }
            add_row(p, index, row, r, 1.0 / p->data->root_sum);
        }
    }
    for (int k = 4 * p->curve_size; k < 4 * p->curve_size + SLANTS; ++k) {
        p->gradient[k] += slant_ridge * *parameter(p, k);
        p->matrix[(size_t)k * (size_t)p->unknowns + (size_t)k] += slant_ridge;
    }
    for (int curve = 0; curve < 4; ++curve) {
        double w[4];
        curve_weights(w, p, curve);
        for (int order = 1; order <= 3; ++order) {
            for (int k = 0; k + order < p->curve_size && w[order] > 0.0; ++k) {
                add_difference(p, curve * p->curve_size + k, order, p->smooth[curve] * w[order]);
            }
        }
    }
}

static void substitute(const double *a, double *b, int n)
{
    for (int i = 0; i < n; ++i) {
        const double *row = a + (size_t)i * (size_t)n;
        for (int k = 0; k < i; ++k) {
            b[i] -= row[k] * b[k];
        }
        b[i] /= row[i];
    }
    for (int i = n - 1; i >= 0; --i) {
        b[i] /= a[(size_t)i * (size_t)n + (size_t)i];
        const double *row = a + (size_t)i * (size_t)n;
        for (int k = 0; k < i; ++k) {
            b[k] -= row[k] * b[i];
        }
    }
}

/* Dense Cholesky in the lower triangle, and the solution of A x = b in place; false when A is not positive definite. */
static bool cholesky_solve(double *a, double *b, int n)
{
    for (int j = 0; j < n; ++j) {
        double *row_j = a + (size_t)j * (size_t)n;
        for (int i = j; i < n; ++i) {
            double *row_i = a + (size_t)i * (size_t)n, sum = row_i[j];
            for (int k = 0; k < j; ++k) {
                sum -= row_i[k] * row_j[k];
            }
            if (i == j) {
                if (!(sum > 0.0)) {
                    return false;
                }
                row_j[j] = sqrt(sum);
            } else {
                row_i[j] = sum / row_j[j];
            }
        }
    }
    substitute(a, b, n);
    return true;
}
static void take_step(const problem *p)
{
    for (int k = 0; k < p->unknowns; ++k) {
        double *value = parameter(p, k), step = fmin(fmax(p->step[k], -3.0), 3.0);
        if (k < 4 * p->curve_size + SLANTS) {
            *value = fmin(fmax(*value - step, -60.0), 60.0);
        } else {
            *value = fmin(fmax(*value * exp(-step), strength_floor), strength_ceiling);
        }
    }
}

static void store(double *to, const problem *p)
{
    for (int k = 0; k < p->unknowns; ++k) {
        to[k] = *parameter(p, k);
    }
}

static void restore(const problem *p, const double *from)
{
    for (int k = 0; k < p->unknowns; ++k) {
        *parameter(p, k) = from[k];
    }
}

static double iterate(const problem *p, int iterations)
{
    size_t n = (size_t)p->unknowns;
    double damping = 1e-3, objective = data_term(p) + penalty_term(p);
    for (int i = 0; i < iterations; ++i) {
        assemble(p);
        store(p->saved, p);
        memcpy(p->trial, p->matrix, n * n * sizeof *p->trial);
        double now = INFINITY;
        for (int attempt = 0; attempt < 8 && !(now < objective); ++attempt) {
            memcpy(p->matrix, p->trial, n * n * sizeof *p->matrix);
            for (size_t k = 0; k < n; ++k) {
                p->matrix[k * n + k] += damping * p->matrix[k * n + k] + 1e-9 * damping + 1e-14;
            }
            memcpy(p->step, p->gradient, n * sizeof *p->step);
            if (cholesky_solve(p->matrix, p->step, p->unknowns)) {
                take_step(p);
                now = data_term(p) + penalty_term(p);
            }
            if (!(now < objective)) {
                restore(p, p->saved);
                damping = damping * 8.0;
            }
        }
        if (!(now < objective)) {
            break;
        }
        bool settled = objective - now < 1e-5 * objective;
        objective = now;
        damping = fmax(damping / 5.0, 1e-9);
        if (settled) {
            break;
        }
    }
    return objective;
}

/* Degrees of freedom that a curve uses: its size less smooth · tr(A⁻¹ P). */
static double freedom_of(const problem *p, int curve, const double *inverse)
{
    double w[4], trace = 0.0;
    size_t n = (size_t)p->unknowns;
    curve_weights(w, p, curve);
    for (int order = 1; order <= 3; ++order) {
        for (int k = 0; k + order < p->curve_size && w[order] > 0.0; ++k) {
            const double *block = inverse + (size_t)(curve * p->curve_size + k) * (n + 1);
            for (int i = 0; i <= order; ++i) {
                for (int j = 0; j <= order; ++j) {
                    trace += w[order] * pattern[order][i] * pattern[order][j] * block[(size_t)i * n + (size_t)j];
                }
            }
        }
    }
    return p->curve_size - 1 - p->smooth[curve] * trace;
}

/* Inverse of a symmetric matrix, row after row; the first solve leaves the factor in `a`. */
static bool invert(double *inverse, double *a, int n)
{
    size_t size = (size_t)n;
    memset(inverse, 0, size * size * sizeof *inverse);
    for (int k = 0; k < n; ++k) {
        double *row = inverse + (size_t)k * size;
        row[k] = 1.0;
        if (k > 0) {
            substitute(a, row, n);
        } else if (!cholesky_solve(a, row, n)) {
            return false;
        }
    }
    return true;
}

/* The smoothing along each yarn from the data (MacKay's fixed point): as many degrees of freedom as the curve uses, over its
 * roughness. */
static void update_smoothing(problem *p)
{
    size_t n = (size_t)p->unknowns;
    assemble(p);
    for (size_t k = 0; k < n; ++k) {
        p->matrix[k * n + k] += 1e-14;
    }
    if (!invert(p->trial, p->matrix, p->unknowns)) {
        return;
    }
    double freedom[4], used = p->unknowns - 4.0 * p->curve_size;
    for (int curve = 0; curve < 4; ++curve) {
        freedom[curve] = fmin(fmax(freedom_of(p, curve, p->trial), 0.5), p->curve_size);
        used += freedom[curve];
    }
    double noise = data_term(p) / fmax(p->usable - used, 0.1 * p->usable);
    for (int curve = 0; curve < 4; curve += 2) {
        double smooth = noise * freedom[curve] / fmax(roughness(p, curve), 1e-3);
        p->smooth[curve] = fmin(fmax(smooth, 1e-13), 1e-4);
    }
}

/* Gaussians of the given widths (degrees): warp along, across, weft along, across; strengths of equal parts of the mean. */
static void start_from(tsuya_sheen *s, const tsuya_fit_data *d, const double width_deg[4], double warp_share)
{
    memset(s->slant, 0, sizeof s->slant);
    for (int curve = 0; curve < 4; ++curve) {
        for (int k = 0; k < s->spans + 3; ++k) {
            double psi = -90.0 + 180.0 * (k - 1.0) / s->spans, z = psi / width_deg[curve];
            s->curve[curve][k] = -0.5 * fmin(z * z, 30.0);
        }
    }
    for (int c = 0; c < s->channels; ++c) {
        double top = 0.0, low = INFINITY;
        for (int k = 0; k < d->count; ++k) {
            double v = d->value[k * s->channels + c] / d->angles[k].falloff;
            if (!isnan(v)) {
                top = fmax(top, v);
                low = fmin(low, v);
            }
        }
        low = isfinite(low) ? low : 0.0;
        s->strength[0][c] = fmax(warp_share * (top - low), strength_floor);
        s->strength[1][c] = fmax((1.0 - warp_share) * (top - low), strength_floor);
        s->matte[c] = fmax(0.5 * low, strength_floor);
    }
}

/* Narrow along the yarns, broad across them; one or the other on the face; and no preference. */
static const struct { double width_deg[4], warp_share; } starts[] = {
    {{8, 30, 20, 45}, 0.8},
    {{20, 45, 8, 30}, 0.2},
    {{8, 30, 40, 80}, 0.95},
    {{40, 80, 8, 30}, 0.05},
    {{20, 40, 20, 40}, 0.5},
};

static tsuya_status prepare(problem *p, tsuya_sheen *sheen, const tsuya_fit_data *data, const tsuya_sheen_guide_options *options)
{
    tsuya_status status = TSUYA_OK;
    *p = (problem){.data = data, .options = options, .sheen = sheen, .curve_size = options->spans + 3};
    p->smooth[0] = p->smooth[2] = options->smooth_along;
    p->smooth[1] = p->smooth[3] = options->smooth_across;
    for (size_t k = 0; k < (size_t)data->count * (size_t)data->channels; ++k) {
        p->usable += !isnan(data->root[k]);
    }
    p->unknowns = 4 * p->curve_size + SLANTS + PARTS * data->channels;
    size_t n = (size_t)p->unknowns;
    TSUYA_NEW(status, p->matrix, n * n);
    TSUYA_NEW(status, p->trial, n * n);
    TSUYA_NEW(status, p->gradient, n);
    TSUYA_NEW(status, p->step, n);
    TSUYA_NEW(status, p->rise, (size_t)data->count);
    for (int k = 0; k < data->count; ++k) {
        p->rise[k] = tsuya_sheen_rise(sheen, data->angles[k].cosine);
    }
    TSUYA_NEW(status, p->saved, (2 + sizeof starts / sizeof starts[0]) * n);
done:
    return status;
}


static void take_gloss(problem *p)
{
    tsuya_sheen_find_gloss(p->sheen, p->data);
    for (int k = 0; k < 2 * p->data->channels; ++k) {
        int y = k / p->data->channels, c = k % p->data->channels;
        p->share[y][c] = p->sheen->gloss[y] / p->sheen->strength[y][c];
    }
}

/* A short descent from every start, then the whole procedure from the better half. */
static void search(problem *p, double *kept)
{
    enum { STARTS = sizeof starts / sizeof starts[0], FOLLOWED = 2, SHORT = 25 };
    double objective[STARTS], best = INFINITY, *point[STARTS], *winner = kept + (size_t)STARTS * (size_t)p->unknowns;
    for (int k = 0; k < STARTS; ++k) {
        point[k] = kept + (size_t)k * (size_t)p->unknowns;
        start_from(p->sheen, p->data, starts[k].width_deg, starts[k].warp_share);
        objective[k] = iterate(p, SHORT);
        store(point[k], p);
    }
    for (int turn = 0; turn < FOLLOWED; ++turn) {
        int lowest = 0;
        for (int k = 1; k < STARTS; ++k) {
            lowest = objective[k] < objective[lowest] ? k : lowest;
        }
        objective[lowest] = INFINITY;
        restore(p, point[lowest]);
        p->smooth[0] = p->smooth[2] = p->options->smooth_along;
        double reached = iterate(p, p->options->iterations);
        for (int round = 0; round < p->options->rounds; ++round) {
            update_smoothing(p);
            take_gloss(p);
            reached = iterate(p, p->options->iterations);
        }
        if (reached < best) {
            best = reached;
            store(winner, p);
        }
    }
    restore(p, winner);
}

/* Beyond the outermost readings a curve may fall but not rise: a logarithm that is led on straight would shine without bound. */
static void fall_beyond(const problem *p)
{
    double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY}; /* of ψt and ψb */
    for (int k = 0; k < p->data->count; ++k) {
        const double psi[2] = {p->data->angles[k].psi_t, p->data->angles[k].psi_b};
        for (int i = 0; i < 2; ++i) {
            low[i] = fmin(low[i], psi[i]);
            high[i] = fmax(high[i], psi[i]);
        }
    }
    for (int curve = 0; curve < TSUYA_SHEEN_CURVES; ++curve) {
        double *a = p->sheen->curve[curve], step = M_PI / p->options->spans;
        int over = curve == TSUYA_SHEEN_WARP_ALONG || curve == TSUYA_SHEEN_WEFT_ACROSS; /* the warp runs along b */
        for (int k = p->curve_size - 2; k >= 0; --k) {
            a[k] = -0.5 * M_PI + (k - 1) * step < low[over] ? fmin(a[k], a[k + 1]) : a[k];
        }
        for (int k = 1; k < p->curve_size; ++k) {
            a[k] = -0.5 * M_PI + (k - 1) * step > high[over] ? fmin(a[k], a[k - 1]) : a[k];
        }
    }
}

/* A slant that raises its yarn does so up to the largest difference that was measured: beyond, it would without bound. */
static void hold_slants(const problem *p)
{
    p->sheen->reach[0] = p->sheen->reach[1] = 0.0;
    for (int k = 0; k < p->data->count; ++k) {
        p->sheen->reach[0] = fmax(p->sheen->reach[0], p->data->angles[k].dt2);
        p->sheen->reach[1] = fmax(p->sheen->reach[1], p->data->angles[k].db2);
    }
}

tsuya_status tsuya_sheen_fit_guide(tsuya_sheen *sheen, double *error, const tsuya_fit_data *data, const tsuya_sheen_guide_options *options)
{
    problem p;
    tsuya_sheen_set_fresnel(sheen, data);
    tsuya_status status = prepare(&p, sheen, data, options);
    if (status == TSUYA_OK) {
        search(&p, p.saved + p.unknowns);
        take_gloss(&p);
        fall_beyond(&p);
        hold_slants(&p);
        *error = sqrt(data_term(&p));
    }
    tsuya_free(p.matrix);
    tsuya_free(p.trial);
    tsuya_free(p.gradient);
    tsuya_free(p.step);
    tsuya_free(p.saved);
    tsuya_free(p.rise);
    return status;
}
