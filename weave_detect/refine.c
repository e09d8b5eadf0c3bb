#include "weave_detect/refine.h"

#include "core/clones.h"
#include "core/memory.h"

#include <math.h>
#include <string.h>

static const float TONE_LEVEL = 1.8f;      /* ln(1 + power/noise) of a point that is worth fitting */
static const double RIM = 0.015;            /* of the side on which the window rises */
static const double STRAY_BINS = 0.6;      /* a tone that is farther than that from where the lattice has it is given up */
static const double STRAY_SIGMAS = 2.5;
static const int REACH = 3;                /* lattice points up to |a| ≤ 3 are looked at */

typedef struct tone {
    double a1, a2;      /* place in the lattice */
    double fx, fy;      /* where it is looked at, then where it was found */
    double re, im;      /* amplitude of e^{2πi f·x} from the patch's middle; the tone is 2·Re */
    double raw[6];      /* Σ w v e^{−iφ} {1, x, y}, real and imaginary parts */
    float level;
    double trust;       /* 1, less for a point that stands off the lattice by more than its noise */
    bool lost;
} tone;

/* Transform of the window along one axis, and of x·window (over i), by a table. */
static void make_transform(tsuya_refiner *r)
{
    int n = r->n, steps = n * TSUYA_WINDOW_STEPS + 2;
    for (int k = 0; k < steps; k++) {
        double f = (double)k / (n * TSUYA_WINDOW_STEPS), even = 0.0, odd = 0.0;
        for (int x = 0; x < n; x++) {
            double d = x - 0.5 * (n - 1);
            even += (double)r->window[x] * cos(2.0 * M_PI * f * d);
            odd += (double)r->window[x] * d * sin(2.0 * M_PI * f * d);
        }
        r->transform[2 * k] = (float)even;
        r->transform[2 * k + 1] = (float)odd;
    }
}

tsuya_status tsuya_refiner_create(tsuya_refiner **refiner, int n)
{
    tsuya_status status = TSUYA_OK;
    tsuya_refiner *r = tsuya_calloc(1, sizeof *r);
    *refiner = NULL;
    if (!r) {
        return TSUYA_ERROR_MEMORY;
    }
    r->n = n;
    TSUYA_NEW(status, r->window, (size_t)n);
    TSUYA_NEW(status, r->plain, (size_t)n * (size_t)n);
    TSUYA_NEW(status, r->wave, 4 * (size_t)n);
    TSUYA_NEW(status, r->column, 4 * (size_t)n);
    TSUYA_NEW(status, r->transform, 2 * ((size_t)n * TSUYA_WINDOW_STEPS + 2));
    double xx = 0.0;
    for (int i = 0; i < n; i++) {
        double edge = fmin(i + 0.5, n - i - 0.5) / (RIM * n), d = i - 0.5 * (n - 1);
        r->window[i] = (float)(edge >= 1.0 ? 1.0 : 0.5 - 0.5 * cos(M_PI * edge));
        r->sum += (double)r->window[i];
        xx += (double)r->window[i] * d * d;
    }
    r->sum_xx = xx * r->sum;
    r->sum *= r->sum;
    make_transform(r);
    *refiner = r;
done:
    if (status != TSUYA_OK) {
        tsuya_refiner_free(r);
    }
    return status;
}

void tsuya_refiner_free(tsuya_refiner *r)
{
    if (r) {
        tsuya_free(r->window);
        tsuya_free(r->plain);
        tsuya_free(r->wave);
        tsuya_free(r->column);
        tsuya_free(r->transform);
        tsuya_free(r);
    }
}

int tsuya_refine_points(tsuya_lattice_point *list, int most, const tsuya_spectrum *s, int step_index, const double f[2][2])
{
    const tsuya_step *step = &tsuya_steps[step_index];
    int count = 0, n = step->repeat;
    float worth[TSUYA_TONES]; /* power × their own frequency's square */
    for (int k2 = 0; k2 <= REACH * n; k2++) {
        double a2 = (double)k2 / n, offset = -(double)step->step * a2;
        offset -= floor(offset);
        for (int k1 = -REACH - 1; k1 <= REACH; k1++) {
            double a1 = k1 + offset;
            if (k2 == 0 && a1 < 0.5) {
                continue; /* itself and its mirror */
            }
            double fx = a1 * f[0][0] + a2 * f[1][0], fy = a1 * f[0][1] + a2 * f[1][1], ff = fx * fx + fy * fy;
            if (ff > 0.23 || ff * s->n * s->n < 3.6) {
                continue;
            }
            float level = tsuya_spectrum_level(s, fx, fy);
            if (level < TONE_LEVEL) {
                continue;
            }
            float value = (expf(level) - 1.0f) * (float)(a1 * a1 + a2 * a2 + 0.05);
            int place = count < most ? count++ : most;
            while (place > 0 && worth[place - 1] < value) {
                if (place < most) {
                    list[place] = list[place - 1];
                    worth[place] = worth[place - 1];
                }
                place--;
            }
            if (place < most) {
                list[place] = (tsuya_lattice_point){(float)a1, (float)a2, tsuya_spectrum_power(s, fx, fy)};
                worth[place] = value;
            }
        }
    }
    return count;
}

/* cos, sin, and both times the distance from the middle, of −2πf·x: 4 × n. */
static void set_wave(float *wave, double f, int n)
{
    double c = cos(2.0 * M_PI * f), s = -sin(2.0 * M_PI * f), phase = M_PI * f * (n - 1), re = cos(phase), im = sin(phase);
    for (int x = 0; x < n; x++) {
        float from_middle = (float)(x - 0.5 * (n - 1));
        wave[x] = (float)re;
        wave[n + x] = (float)im;
        wave[2 * n + x] = from_middle * (float)re;
        wave[3 * n + x] = from_middle * (float)im;
        double next = re * c - im * s;
        im = re * s + im * c;
        re = next;
    }
}

/* Eight columns side by side; written out, as loops over them are taken apart otherwise. */
typedef float eight __attribute__((vector_size(32)));

/* Σ over the rows of each column's value times {cos, sin, y·cos, y·sin}: 4 × n. */
TSUYA_CLONES("avx2", "default") static void correlate_columns(float *restrict sum, const float *restrict values, const float *restrict wave, int n)
{
    int whole = n - n % 8;
    for (int x = 0; x < whole; x += 8) {
        eight c = {0}, s = {0}, yc = {0}, ys = {0}, v;
        for (int y = 0; y < n; y++) {
            memcpy(&v, values + (size_t)y * (size_t)n + x, sizeof v);
            c += v * wave[y];
            s += v * wave[n + y];
            yc += v * wave[2 * n + y];
            ys += v * wave[3 * n + y];
        }
        memcpy(sum + x, &c, sizeof c);
        memcpy(sum + n + x, &s, sizeof s);
        memcpy(sum + 2 * n + x, &yc, sizeof yc);
        memcpy(sum + 3 * n + x, &ys, sizeof ys);
    }
    for (int x = whole; x < n; x++) {
        for (int q = 0; q < 4; q++) {
            sum[q * n + x] = 0.0f;
            for (int y = 0; y < n; y++) {
                sum[q * n + x] += values[(size_t)y * (size_t)n + x] * wave[q * n + y];
            }
        }
    }
}

static void correlate(tone *t, tsuya_refiner *r)
{
    int n = r->n;
    double m[6] = {0.0};
    const float *c = r->column, *s = c + n, *yc = c + 2 * n, *ys = c + 3 * n, *wave = r->wave;
    set_wave(r->wave, t->fy, n);
    correlate_columns(r->column, r->plain, r->wave, n);
    set_wave(r->wave, t->fx, n);
    for (int x = 0; x < n; x++) { /* (cos φx + i sin φx)(C + i S) */
        double re = (double)(wave[x] * c[x] - wave[n + x] * s[x]), im = (double)(wave[x] * s[x] + wave[n + x] * c[x]);
        m[0] += re;
        m[1] += im;
        m[2] += (double)(wave[2 * n + x] * c[x] - wave[3 * n + x] * s[x]);
        m[3] += (double)(wave[2 * n + x] * s[x] + wave[3 * n + x] * c[x]);
        m[4] += (double)(wave[x] * yc[x] - wave[n + x] * ys[x]);
        m[5] += (double)(wave[x] * ys[x] + wave[n + x] * yc[x]);
    }
    memcpy(t->raw, m, sizeof t->raw);
}

/* The window's transform at a frequency difference along one axis: even part, and (over i) that of x·window. */
static void window_transform(double out[2], const tsuya_refiner *r, double f)
{
    double at = fabs(f), sign = f < 0.0 ? -1.0 : 1.0;
    at -= floor(at);
    double step = at * r->n * TSUYA_WINDOW_STEPS;
    int k = (int)step;
    double u = step - k;
    const float *p = r->transform + 2 * k;
    out[0] = (double)p[0] + u * (double)(p[2] - p[0]);
    out[1] = sign * ((double)p[1] + u * (double)(p[3] - p[1]));
}

/* What a tone of amplitude 1 at a frequency difference adds to another's moments: plain, and over i along x and y. */
typedef struct leak {
    float plain, along_x, along_y;
} leak;

typedef struct leaks {
    leak own[TSUYA_TONES][TSUYA_TONES], mirror[TSUYA_TONES][TSUYA_TONES]; /* [to][from] */
} leaks;

static leak leak_at(const tsuya_refiner *r, double dx, double dy)
{
    double x[2], y[2];
    window_transform(x, r, dx);
    window_transform(y, r, dy);
    return (leak){(float)(x[0] * y[0]), (float)(x[1] * y[0]), (float)(x[0] * y[1])};
}

static void set_leaks(leaks *out, const tsuya_refiner *r, const tone *list, int count)
{
    for (int t = 0; t < count; t++) {
        out->own[t][t] = (leak){0};
        for (int u = t; u < count; u++) {
            if (u > t) {
                leak l = leak_at(r, list[u].fx - list[t].fx, list[u].fy - list[t].fy);
                out->own[t][u] = l;
                out->own[u][t] = (leak){l.plain, -l.along_x, -l.along_y};
            }
            out->mirror[t][u] = out->mirror[u][t] = leak_at(r, -list[u].fx - list[t].fx, -list[u].fy - list[t].fy);
        }
    }
}

/* Moments of tone `t` without what all tones leak into it; its own mirror is one of them. */
static void clean_moments(double m[6], const leaks *all, const tone *list, int count, int t)
{
    memcpy(m, list[t].raw, 6 * sizeof *m);
    for (int u = 0; u < count; u++) {
        const leak *own = &all->own[t][u], *mirror = &all->mirror[t][u];
        double re = list[u].re, im = list[u].im, even = (double)(own->plain + mirror->plain), odd = (double)(own->plain - mirror->plain);
        m[0] -= re * even;
        m[1] -= im * odd;
        m[2] += im * (double)(own->along_x - mirror->along_x); /* i times the odd part */
        m[3] -= re * (double)(own->along_x + mirror->along_x);
        m[4] += im * (double)(own->along_y - mirror->along_y);
        m[5] -= re * (double)(own->along_y + mirror->along_y);
    }
}

/* The amplitude alone. */
static void clean_amplitude(double m[2], const leaks *all, const tone *list, int count, int t)
{
    m[0] = list[t].raw[0];
    m[1] = list[t].raw[1];
    for (int u = 0; u < count; u++) {
        double own = (double)all->own[t][u].plain, mirror = (double)all->mirror[t][u].plain;
        m[0] -= list[u].re * (own + mirror);
        m[1] -= list[u].im * (own - mirror);
    }
}

/* Amplitudes, by Gauss–Seidel on the leaks; then each tone's own frequency, one Gauss–Newton step from where it was looked at. */
static int measure_tones(tone *list, int count, tsuya_refiner *r)
{
    leaks all;
    double m[6], bin = 1.0 / r->n;
    for (int t = 0; t < count; t++) {
        correlate(&list[t], r);
        list[t].re = list[t].raw[0] / r->sum;
        list[t].im = list[t].raw[1] / r->sum;
    }
    set_leaks(&all, r, list, count);
    for (int round = 0; round < 2; round++) {
        for (int t = 0; t < count; t++) {
            clean_amplitude(m, &all, list, count, t);
            list[t].re = m[0] / r->sum;
            list[t].im = m[1] / r->sum;
        }
    }
    double step[TSUYA_TONES][2];
    for (int t = 0; t < count; t++) {
        clean_moments(m, &all, list, count, t);
        double power = list[t].re * list[t].re + list[t].im * list[t].im, scale = 2.0 * M_PI * power * r->sum_xx;
        /* d/df of A e^{iφ} is 2πi x A e^{iφ}: df = Im(conj(A) M_x) / (2π |A|² Σ w x²) */
        step[t][0] = (list[t].re * m[3] - list[t].im * m[2]) / scale;
        step[t][1] = (list[t].re * m[5] - list[t].im * m[4]) / scale;
        list[t].lost = !(hypot(step[t][0], step[t][1]) < STRAY_BINS * bin);
    }
    int kept = 0;
    for (int t = 0; t < count; t++) {
        if (!list[t].lost) {
            list[kept] = list[t];
            list[kept].fx += step[t][0];
            list[kept++].fy += step[t][1];
        }
    }
    return kept;
}

/* Of the windowed patch, what the tones leave. */
static double left_variance(const tone *list, int count, double energy, double weight)
{
    double explained = 0.0;
    for (int t = 0; t < count; t++) {
        explained += 2.0 * (list[t].re * list[t].raw[0] + list[t].im * list[t].raw[1]);
    }
    return fmax(energy - explained, 1e-4 * energy) / weight;
}

/* Inverse of a symmetric 2 × 2. */
static void invert2(double out[2][2], double xx, double xy, double yy)
{
    double det = xx * yy - xy * xy;
    out[0][0] = yy / det;
    out[0][1] = out[1][0] = -xy / det;
    out[1][1] = xx / det;
}

/* Solves the 4 × 4 symmetric positive system and leaves the inverse in place. */
static bool solve4(double inverse[4][4], double m[4][4])
{
    double a[4][8] = {{0}};
    for (int r = 0; r < 4; r++) {
        memcpy(a[r], m[r], sizeof m[r]);
        a[r][4 + r] = 1.0;
    }
    for (int k = 0; k < 4; k++) {
        if (!(a[k][k] > 0.0)) {
            return false;
        }
        double scale = 1.0 / a[k][k];
        for (int c = 0; c < 8; c++) {
            a[k][c] *= scale;
        }
        for (int r = 0; r < 4; r++) {
            double factor = r == k ? 0.0 : a[r][k];
            for (int c = 0; c < 8; c++) {
                a[r][c] -= factor * a[k][c];
            }
        }
    }
    for (int r = 0; r < 4; r++) {
        memcpy(inverse[r], a[r] + 4, 4 * sizeof(double));
    }
    return true;
}

/* Weighted least squares of f1, f2; `smear`: variance of a family's points along its own frequency, per a². */
static bool solve_lattice(double f[2][2], double inverse[4][4], const tone *list, int count, double tone_variance, const double smear[2])
{
    double m[4][4] = {{0}}, right[4] = {0}, unit[2][2];
    for (int k = 0; k < 2; k++) {
        double length = hypot(f[k][0], f[k][1]);
        unit[k][0] = f[k][0] / length;
        unit[k][1] = f[k][1] / length;
    }
    for (int t = 0; t < count; t++) {
        double own = tone_variance / (list[t].re * list[t].re + list[t].im * list[t].im), w[2][2];
        double q1 = list[t].a1 * list[t].a1 * smear[0], q2 = list[t].a2 * list[t].a2 * smear[1];
        invert2(w, own + q1 * unit[0][0] * unit[0][0] + q2 * unit[1][0] * unit[1][0],
                q1 * unit[0][0] * unit[0][1] + q2 * unit[1][0] * unit[1][1], own + q1 * unit[0][1] * unit[0][1] + q2 * unit[1][1] * unit[1][1]);
        for (int i = 0; i < 4; i++) {
            w[i / 2][i % 2] *= list[t].trust;
        }
        const double a[2] = {list[t].a1, list[t].a2};
        double wf[2] = {w[0][0] * list[t].fx + w[0][1] * list[t].fy, w[1][0] * list[t].fx + w[1][1] * list[t].fy};
        for (int i = 0; i < 2; i++) {
            for (int x = 0; x < 2; x++) {
                right[2 * i + x] += a[i] * wf[x];
                for (int j = 0; j < 2; j++) {
                    for (int y = 0; y < 2; y++) {
                        m[2 * i + x][2 * j + y] += a[i] * a[j] * w[x][y];
                    }
                }
            }
        }
    }
    if (!solve4(inverse, m)) {
        return false;
    }
    for (int r = 0; r < 4; r++) {
        double sum = 0.0;
        for (int c = 0; c < 4; c++) {
            sum += inverse[r][c] * right[c];
        }
        f[r / 2][r % 2] = sum;
    }
    return true;
}

/* Points far off the lattice, in their own deviations and what smears them, lose their say (Huber's weights at STRAY_SIGMAS, squared). */
static void judge_tones(const double f[2][2], tone *list, int count, double tone_variance, const double smear[2])
{
    for (int t = 0; t < count; t++) {
        double dx = list[t].fx - list[t].a1 * f[0][0] - list[t].a2 * f[1][0], dy = list[t].fy - list[t].a1 * f[0][1] - list[t].a2 * f[1][1];
        double own = tone_variance / (list[t].re * list[t].re + list[t].im * list[t].im);
        double all = own + list[t].a1 * list[t].a1 * smear[0] + list[t].a2 * list[t].a2 * smear[1], off = (dx * dx + dy * dy) / (2.0 * all);
        double bound = STRAY_SIGMAS * STRAY_SIGMAS;
        list[t].trust = off > bound ? bound * bound / (off * off) : 1.0;
    }
}

/* How far the points stray along each family's frequency, beyond their own noise. */
static void measure_smear(double smear[2], double *scatter, const double f[2][2], const tone *list, int count, double tone_variance)
{
    double above[2] = {0.0, 0.0}, weight[2] = {0.0, 0.0}, chance[2] = {0.0, 0.0}, sum = 0.0;
    for (int t = 0; t < count; t++) {
        double own = tone_variance / (list[t].re * list[t].re + list[t].im * list[t].im);
        double dx = list[t].fx - list[t].a1 * f[0][0] - list[t].a2 * f[1][0], dy = list[t].fy - list[t].a1 * f[0][1] - list[t].a2 * f[1][1];
        const double a[2] = {list[t].a1, list[t].a2};
        sum += (dx * dx + dy * dy) / (2.0 * own);
        for (int k = 0; k < 2; k++) {
            double length = hypot(f[k][0], f[k][1]), along = (dx * f[k][0] + dy * f[k][1]) / length, aa = a[k] * a[k];
            above[k] += aa * (along * along - own);
            weight[k] += aa * aa;
            chance[k] += 2.0 * aa * aa * own * own;
        }
    }
    for (int k = 0; k < 2; k++) {
        smear[k] = above[k] > 2.0 * sqrt(chance[k]) ? 1.5 * above[k] / weight[k] : 0.0; /* 1.5: four unknowns came out of few points */
    }
    *scatter = sqrt(sum / count);
}

void tsuya_refine_begin(tsuya_refiner *r, const tsuya_spectrum *s)
{
    double energy = 0.0;
    int n = r->n;
    for (int y = 0; y < n; y++) {
        const float *v = s->detrended + (size_t)y * (size_t)n;
        float *out = r->plain + (size_t)y * (size_t)n, wy = r->window[y], lane[8] = {0};
        for (int x = 0; x < n; x++) {
            out[x] = v[x] * wy * r->window[x];
        }
        for (int x = 0; x < n; x += 8) {
            for (int k = 0; k < 8 && x + k < n; k++) {
                lane[k] += out[x + k] * v[x + k];
            }
        }
        energy += (double)(((lane[0] + lane[4]) + (lane[1] + lane[5])) + ((lane[2] + lane[6]) + (lane[3] + lane[7])));
    }
    r->energy = energy;
}

static void set_sigmas(tsuya_refined *out, double inverse[4][4])
{
    for (int k = 0; k < 2; k++) {
        double ff = out->f[k][0] * out->f[k][0] + out->f[k][1] * out->f[k][1], nx = -out->f[k][1], ny = out->f[k][0];
        double across = nx * nx * inverse[2 * k][2 * k] + 2.0 * nx * ny * inverse[2 * k][2 * k + 1] + ny * ny * inverse[2 * k + 1][2 * k + 1];
        out->sigma_rad[k] = sqrt(fmax(across, 0.0)) / ff;
    }
}

bool tsuya_refine_at(tsuya_refined *out, tsuya_refiner *r, const double f[2][2], const tsuya_lattice_point *point, int count)
{
    tone list[TSUYA_TONES];
    double inverse[4][4], smear[2] = {0.0, 0.0};
    *out = (tsuya_refined){.sigma_rad = {0.05, 0.05}};
    memcpy(out->f, f, sizeof out->f);
    for (int t = 0; t < count; t++) {
        double a1 = (double)point[t].a1, a2 = (double)point[t].a2;
        list[t] = (tone){.a1 = a1, .a2 = a2, .trust = 1.0, .fx = a1 * f[0][0] + a2 * f[1][0], .fy = a1 * f[0][1] + a2 * f[1][1]};
    }
    count = measure_tones(list, count, r);
    if (count < 2) {
        return false;
    }
    double variance = left_variance(list, count, r->energy, r->sum), tone_variance = variance / (8.0 * M_PI * M_PI * r->sum_xx);
    for (int pass = 0; pass < 4; pass++) {
        if (!solve_lattice(out->f, inverse, list, count, tone_variance, smear)) {
            memcpy(out->f, f, sizeof out->f);
            return false;
        }
        if (count > 2) {
            measure_smear(smear, &out->scatter, (const double(*)[2])out->f, list, count, tone_variance);
            judge_tones((const double(*)[2])out->f, list, count, tone_variance, smear);
        }
    }
    for (int t = 0; t < count; t++) {
        out->power += list[t].re * list[t].re + list[t].im * list[t].im;
    }
    out->noise = sqrt(variance);
    out->tones = count;
    set_sigmas(out, inverse);
    return true;
}

bool tsuya_refine(tsuya_refined *out, tsuya_refiner *r, const tsuya_spectrum *s, const tsuya_basis *b, int rounds)
{
    *out = (tsuya_refined){.sigma_rad = {0.05, 0.05}};
    memcpy(out->f, b->f, sizeof out->f);
    tsuya_refine_begin(r, s);
    for (int round = 0; round < rounds; round++) {
        tsuya_lattice_point point[TSUYA_TONES];
        double f[2][2];
        memcpy(f, out->f, sizeof f);
        int count = tsuya_refine_points(point, round + 1 < rounds ? TSUYA_TONES_FIRST : TSUYA_TONES, s, b->step, (const double(*)[2])f);
        if (!tsuya_refine_at(out, r, (const double(*)[2])f, point, count)) {
            memcpy(out->f, b->f, sizeof out->f);
            return false;
        }
    }
    return rounds > 0;
}

bool tsuya_refine_single(double f[2], double *sigma_rad, tsuya_refiner *r, const tsuya_spectrum *s, int rounds)
{
    const double start[2] = {f[0], f[1]};
    tsuya_refine_begin(r, s);
    *sigma_rad = 0.05;
    for (int round = 0; round < rounds; round++) {
        tone list[3];
        int count = 0;
        for (int k = 1; k <= 3; k++) {
            tone t = {.a1 = k, .trust = 1.0, .fx = k * f[0], .fy = k * f[1], .level = tsuya_spectrum_level(s, k * f[0], k * f[1])};
            if (k == 1 || (t.level > TONE_LEVEL && k * k * (f[0] * f[0] + f[1] * f[1]) < 0.23)) {
                list[count++] = t;
            }
        }
        count = measure_tones(list, count, r);
        if (count == 0 || list[0].a1 > 1.0) {
            memcpy(f, start, sizeof start);
            return false;
        }
        double x = 0.0, y = 0.0, weight = 0.0;
        for (int t = 0; t < count; t++) {
            double w = list[t].a1 * (list[t].re * list[t].re + list[t].im * list[t].im);
            x += w * list[t].fx;
            y += w * list[t].fy;
            weight += w * list[t].a1;
        }
        f[0] = x / weight;
        f[1] = y / weight;
        double variance = left_variance(list, count, r->energy, r->sum);
        *sigma_rad = sqrt(variance / (8.0 * M_PI * M_PI * r->sum_xx * weight)) / hypot(f[0], f[1]);
    }
    return true;
}
