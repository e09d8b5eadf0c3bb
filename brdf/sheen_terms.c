/* S as a sum of a few products of curves, from a control net: alternating least squares (J. D. Carroll, J.-J. Chang, "Analysis of
 * individual differences in multidimensional scaling", Psychometrika 35(3), 1970), one term after the other.
 *
 * A factor of such a sum is a combination of the net's own lines, so whatever linear relation all of these keep, it keeps too.  The
 * net is therefore taken apart first: its mean over φ, the rest that repeats after π, and the rest that changes its sign after π.  In
 * each of them the lines through the pole are even or odd, and all but the mean vanish there: the sum passes the pole as the net did. */
#include "brdf/sheen.h"

#include "core/memory.h"

#include <string.h>

enum { MODES = 4, KINDS = 3, MOST = TSUYA_SHEEN_TERMS, USED = 6, FIRST_TURNS = 12, LAST_TURNS = 60, LONGEST = 260 }; /* LONGEST: of a file's sides and of channels, 256, and three */
static const double ridge = 1e-8, good_enough = 1e-3; /* of a logarithm, root mean square */

/* One of the three parts: its numbers in the order θd, φ, θ, channel, and its terms so far; f[mode][i * MOST + term]. */
typedef struct part {
    const int *size;
    double *x, *f[MODES];
    int terms;
} part;

static size_t entries(const int *size) { return (size_t)size[0] * (size_t)size[1] * (size_t)size[2] * (size_t)size[3]; }

static double entry_of(const part *p, const int *i)
{
    double sum = 0.0;
    for (int r = 0; r < p->terms; ++r) {
        sum += p->f[0][i[0] * MOST + r] * p->f[1][i[1] * MOST + r] * p->f[2][i[2] * MOST + r] * p->f[3][i[3] * MOST + r];
    }
    return sum;
}

/* The next entry in the order of x; false after the last. */
static bool step(int *i, const int *size)
{
    for (int mode = MODES - 1; mode >= 0; --mode) {
        if (++i[mode] < size[mode]) {
            return true;
        }
        i[mode] = 0;
    }
    return false;
}

/* Solves (gram + ridge) z = right for every row of `right`, in place. */
static void solve_rows(double *right, int rows, double gram[MOST][MOST], int n)
{
    double trace = 0.0;
    for (int i = 0; i < n; ++i) {
        trace += gram[i][i];
    }
    for (int j = 0; j < n; ++j) {
        gram[j][j] += ridge * trace / n + 1e-300;
        for (int i = j; i < n; ++i) {
            double sum = gram[i][j];
            for (int k = 0; k < j; ++k) {
                sum -= gram[i][k] * gram[j][k];
            }
            gram[i][j] = i == j ? sqrt(fmax(sum, 1e-300)) : sum / gram[j][j];
        }
    }
    for (double *z = right; z < right + rows * MOST; z += MOST) {
        for (int i = 0; i < n; ++i) {
            for (int k = 0; k < i; ++k) {
                z[i] -= gram[i][k] * z[k];
            }
            z[i] /= gram[i][i];
        }
        for (int i = n - 1; i >= 0; --i) {
            z[i] /= gram[i][i];
            for (int k = 0; k < i; ++k) {
                z[k] -= gram[i][k] * z[i];
            }
        }
    }
}

/* Every column but the channels' to length 1. */
static void level(double *f, int rows, int terms)
{
    for (int r = 0; r < terms; ++r) {
        double sum = 0.0;
        for (int i = 0; i < rows; ++i) {
            sum += f[i * MOST + r] * f[i * MOST + r];
        }
        for (int i = 0; i < rows && sum > 0.0; ++i) {
            f[i * MOST + r] /= sqrt(sum);
        }
    }
}

/* The factors of one mode from those of the others. */
static void update(part *p, int mode)
{
    static const double ones[MOST] = {1, 1, 1, 1, 1, 1, 1, 1};
    double gram[MOST][MOST], *to = p->f[mode], across[MOST];
    int i[MODES] = {0};
    const double *x = p->x;
    for (int r = 0; r < p->terms * p->terms; ++r) {
        int a = r / p->terms, b = r % p->terms;
        gram[a][b] = 1.0;
        for (int other = 0; other < MODES; ++other) {
            double sum = 0.0;
            for (int k = 0; k < p->size[other] && other != mode; ++k) {
                sum += p->f[other][k * MOST + a] * p->f[other][k * MOST + b];
            }
            gram[a][b] *= other == mode ? 1.0 : sum;
        }
    }
    memset(to, 0, (size_t)p->size[mode] * MOST * sizeof *to);
    do {
        const double *f[MODES];
        for (int other = 0; other < MODES; ++other) {
            f[other] = other == mode ? ones : p->f[other] + i[other] * MOST;
        }
        for (int r = 0; r < MOST; ++r) {
            across[r] = f[0][r] * f[1][r] * f[2][r];
        }
        for (int c = 0; c < p->size[3]; ++c, f[3] += mode == 3 ? 0 : MOST) {
            double *row = to + (mode == 3 ? c : i[mode]) * MOST;
            for (int r = 0; r < MOST; ++r) {
                row[r] += *x * across[r] * f[3][r];
            }
            x++;
        }
        i[3] = p->size[3] - 1;
    } while (step(i, p->size));
    solve_rows(to, p->size[mode], gram, p->terms);
    if (mode != 3) {
        level(to, p->size[mode], p->terms);
    }
}

static void descend(part *p, int turns)
{
    for (int turn = 0; turn < turns && p->terms > 0; ++turn) {
        for (int mode = 0; mode < MODES; ++mode) {
            update(p, mode);
        }
    }
}

/* Σ of squares of what the terms leave; `most` is where it is largest. */
static double rest_of(const part *p, int *most)
{
    double sum = 0.0, highest = -1.0;
    int i[MODES] = {0};
    const double *x = p->x;
    do {
        double d = *x++ - entry_of(p, i);
        sum += d * d;
        if (fabs(d) > highest) {
            highest = fabs(d);
            memcpy(most, i, MODES * sizeof *most);
        }
    } while (step(i, p->size));
    return sum;
}

/* A term more: the lines of the rest through its largest entry. */
static void add_term(part *p, const int *most)
{
    double line[MODES][LONGEST];
    for (int mode = 0; mode < MODES; ++mode) {
        int i[MODES];
        memcpy(i, most, sizeof i);
        for (int k = 0; k < p->size[mode]; ++k) {
            i[mode] = k;
            size_t at = (((size_t)i[0] * (size_t)p->size[1] + (size_t)i[1]) * (size_t)p->size[2] + (size_t)i[2]) * (size_t)p->size[3] + (size_t)i[3];
            line[mode][k] = p->x[at] - entry_of(p, i);
        }
    }
    for (int mode = 0; mode < MODES; ++mode) {
        for (int k = 0; k < p->size[mode]; ++k) {
            p->f[mode][k * MOST + p->terms] = line[mode][k];
        }
    }
    p->terms++;
    for (int mode = 0; mode < MODES - 1; ++mode) {
        level(p->f[mode], p->size[mode], p->terms);
    }
    update(p, 3);
}

/* The part of a kind of a net, weighted by line and layer. */
static void take_apart(part *p, int kind, const tsuya_sheen *s, const double *const weight[MODES])
{
    int i[MODES] = {0}, nu = s->nu, points = s->nv + 3;
    double *x = p->x;
    do {
        size_t first = ((size_t)i[0] * (size_t)nu * (size_t)points + (size_t)i[2]) * (size_t)s->line + (size_t)i[3], around = (size_t)points * (size_t)s->line;
        double mean = 0.0, here = (double)s->net[first + (size_t)i[1] * around];
        double opposite = nu % 2 ? here : (double)s->net[first + (size_t)((i[1] + nu / 2) % nu) * around];
        for (int u = 0; u < nu; ++u) {
            mean += (double)s->net[first + (size_t)u * around] / nu;
        }
        double value = kind == 0 ? mean : kind == 1 ? 0.5 * (here + opposite) - mean : 0.5 * (here - opposite);
        *x++ = value * weight[0][i[0]] * weight[2][i[2]];
    } while (step(i, p->size));
}

/* Terms where they take most away, until all are used or what is left does not matter. */
static void spend(part parts[KINDS])
{
    int used = 0, most[KINDS][MODES];
    double rest[KINDS];
    for (int kind = 0; kind < KINDS; ++kind) {
        rest[kind] = rest_of(&parts[kind], most[kind]);
    }
    while (used < USED && rest[0] + rest[1] + rest[2] > good_enough * good_enough * (double)entries(parts[0].size)) {
        int worst = rest[1] > rest[0] ? 1 : 0;
        worst = rest[2] > rest[worst] ? 2 : worst;
        add_term(&parts[worst], most[worst]);
        descend(&parts[worst], FIRST_TURNS);
        rest[worst] = rest_of(&parts[worst], most[worst]);
        used++;
    }
    for (int kind = 0; kind < KINDS; ++kind) {
        descend(&parts[kind], LAST_TURNS);
    }
}

static void store(tsuya_sheen *s, const part parts[KINDS], const double *const weight[MODES])
{
    s->terms = 0;
    for (int kind = 0; kind < KINDS; ++kind) {
        for (int r = 0; r < parts[kind].terms; ++r, ++s->terms) {
            for (int mode = 0; mode < MODES; ++mode) {
                int n = parts[kind].size[mode];
                for (int i = 0; i < n; ++i) {
                    s->factor[mode][s->terms * n + i] = parts[kind].f[mode][i * MOST + r] / weight[mode][i];
                }
            }
        }
    }
}

tsuya_status tsuya_sheen_separate(tsuya_sheen *s, const double *weight_tilt, const double *weight_deep)
{
    tsuya_status status = TSUYA_OK;
    const int size[MODES] = {tsuya_sheen_layers(s), s->nu, s->nv + 3, s->channels};
    const double *weight[MODES];
    double *ones = NULL;
    part parts[KINDS] = {0};
    if (s->nu == 0) {
        return TSUYA_OK;
    }
    TSUYA_NEW(status, ones, LONGEST);
    for (int k = 0; k < LONGEST; ++k) {
        ones[k] = 1.0;
    }
    weight[0] = weight_deep ? weight_deep : ones;
    weight[1] = weight[3] = ones;
    weight[2] = weight_tilt ? weight_tilt : ones;
    for (int kind = 0; kind < KINDS; ++kind) {
        parts[kind].size = size;
        TSUYA_NEW(status, parts[kind].x, entries(size));
        for (int mode = 0; mode < MODES; ++mode) {
            TSUYA_NEW(status, parts[kind].f[mode], (size_t)size[mode] * MOST);
        }
        take_apart(&parts[kind], kind, s, weight);
    }
    spend(parts);
    store(s, parts, weight);
    tsuya_free(s->net);
    s->net = NULL;
done:
    for (int kind = 0; kind < KINDS; ++kind) {
        tsuya_free(parts[kind].x);
        for (int mode = 0; mode < MODES; ++mode) {
            tsuya_free(parts[kind].f[mode]);
        }
    }
    tsuya_free(ones);
    return status;
}
