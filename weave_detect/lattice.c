#include "weave_detect/lattice.h"

#include "core/clones.h"

#include "weave_detect/lattice_weights.h"

#include <math.h>
#include <string.h>

enum { CANDIDATES = 44, COMBINED = 7, PAIRS = 26, INFERRED = TSUYA_BASES - PAIRS };
static const double SINE_LEAST = 0.78;       /* at least 51 degrees between the families */
static const double RATIO_MOST = 3.3;        /* of the periods */
static const double PERIOD_LEAST = 2.1;      /* px */
static const double POINT_COST = 2.0;        /* level that a point of a step must have on average to speak for it */
static const double SAME_BINS = 0.8;
static const float LEVEL_SCALE = 0.125f;     /* levels reach about ten */

const tsuya_step tsuya_steps[TSUYA_STEPS] = {
    {2, 1, TSUYA_WEAVE_PLAIN},  {3, 1, TSUYA_WEAVE_TWILL},  {3, -1, TSUYA_WEAVE_TWILL}, {4, 1, TSUYA_WEAVE_TWILL}, {4, -1, TSUYA_WEAVE_TWILL},
    {5, 2, TSUYA_WEAVE_SATIN},  {5, -2, TSUYA_WEAVE_SATIN}, {8, 3, TSUYA_WEAVE_SATIN},  {8, -3, TSUYA_WEAVE_SATIN},
};

static inline double square(double x, double y) { return x * x + y * y; }

typedef struct candidate {
    float fx, fy, level;
} candidate;

static int add_candidate(candidate *list, int count, const tsuya_spectrum *s, double fx, double fy)
{
    if (fy < 0.0 || (fy == 0.0 && fx < 0.0)) {
        fx = -fx;
        fy = -fy;
    }
    double ff = fx * fx + fy * fy, same = SAME_BINS * SAME_BINS / ((double)s->n * s->n);
    if (count >= CANDIDATES || ff > 1.0 / (PERIOD_LEAST * PERIOD_LEAST) || ff * s->n * s->n < 1.8 * 1.8) {
        return count;
    }
    for (int i = 0; i < count; i++) {
        double gx = (double)list[i].fx, gy = (double)list[i].fy;
        if (square(gx - fx, gy - fy) < same || square(gx + fx, gy + fy) < same) {
            return count;
        }
    }
    list[count] = (candidate){(float)fx, (float)fy, tsuya_spectrum_level(s, fx, fy)};
    return list[count].level > 1.0f ? count + 1 : count;
}

/* The peaks, then what the strongest make together. */
static int list_candidates(candidate *list, const tsuya_spectrum *s)
{
    int count = 0;
    for (int i = 0; i < s->peak_count; i++) {
        count = add_candidate(list, count, s, (double)s->peak[i].fx, (double)s->peak[i].fy);
    }
    int strongest = s->peak_count < COMBINED ? s->peak_count : COMBINED;
    for (int i = 0; i < strongest; i++) {
        for (int j = i + 1; j < strongest; j++) {
            const tsuya_peak *p = &s->peak[i], *q = &s->peak[j];
            count = add_candidate(list, count, s, (double)(p->fx + q->fx), (double)(p->fy + q->fy));
            count = add_candidate(list, count, s, (double)(p->fx - q->fx), (double)(p->fy - q->fy));
        }
    }
    return count;
}

static float level_at(const tsuya_spectrum *s, const tsuya_basis *b, double a1, double a2)
{
    return tsuya_spectrum_level(s, a1 * b->f[0][0] + a2 * b->f[1][0], a1 * b->f[0][1] + a2 * b->f[1][1]);
}

/* Into (−½, ½]. */
static double centred(double x) { return x - floor(x + 0.4999); }

/* Mean level over the points of a step that lie nearest to 0, without the threads' own. */
static double step_level(const tsuya_spectrum *s, const tsuya_basis *b, const tsuya_step *step, double *best)
{
    double sum = 0.0;
    int points = 0;
    *best = 0.0;
    for (int k = 1; 2 * k <= step->repeat; k++) {
        double a2 = (double)k / step->repeat, a1 = centred(-(double)step->step * k / step->repeat);
        double level = (double)level_at(s, b, a1, a2);
        if (2 * k == step->repeat && fabs(fabs(a1) - 0.5) < 1e-9) { /* the cell's corner: two points that are not each other's mirror */
            double other = (double)level_at(s, b, -a1, a2);
            sum += other;
            *best = fmax(*best, other);
            points++;
        }
        sum += level;
        *best = fmax(*best, level);
        points++;
    }
    return sum / points;
}

/* Of a frequency in a basis: a1·f1 + a2·f2. */
typedef struct spot {
    double a1, a2;
} spot;

static inline spot spot_of(const tsuya_basis *b, double per_det, const tsuya_peak *peak)
{
    return (spot){((double)peak->fx * b->f[1][1] - (double)peak->fy * b->f[1][0]) * per_det,
                   (b->f[0][0] * (double)peak->fy - b->f[0][1] * (double)peak->fx) * per_det};
}

/* How far that is from the nearest point of the step's lattice, in bins of the patch, squared. */
static inline double miss_bins_squared(const tsuya_spectrum *s, const tsuya_basis *b, const tsuya_step *step, double a1, double a2)
{
    double k2 = rint(a2 * step->repeat) / step->repeat, offset = -step->step * k2, k1 = rint(a1 - offset) + offset;
    double dx = (a1 - k1) * b->f[0][0] + (a2 - k2) * b->f[1][0], dy = (a1 - k1) * b->f[0][1] + (a2 - k2) * b->f[1][1];
    return square(dx, dy) * s->n * s->n;
}

/* What the peaks say about a lattice: the share of their levels that lies on it, and the highest of those that do not. */
typedef struct strangers {
    float explained, any, fine, slow; /* fine: near what pixels just carry; slow: coarser than both families' threads */
    float part;                       /* of those of which a family is a multiple */
    float printed;                    /* share that a print explains too: multiples of the highest stranger, and the lattice shifted by them */
} strangers;

/* The family is a multiple, 2 … 5, of the peak. */
static bool is_multiple(const tsuya_spectrum *s, const double f[2], const tsuya_peak *p)
{
    double px = (double)p->fx, py = (double)p->fy, times = rint((f[0] * px + f[1] * py) / (px * px + py * py));
    return fabs(times) >= 2.0 && fabs(times) <= 5.0 && square(f[0] - times * px, f[1] - times * py) * s->n * s->n < 1.0;
}

/* The peak is a multiple of the stripes' frequency, or a point of the lattice beside it by such a multiple; `at`, `by`: their places. */
static bool is_printed(const tsuya_spectrum *s, const tsuya_basis *b, const tsuya_step *step, const tsuya_peak *p, const tsuya_peak *stripes, spot at, spot by)
{
    double px = (double)stripes->fx, py = (double)stripes->fy, times = rint(((double)p->fx * px + (double)p->fy * py) / (px * px + py * py));
    bool printed = square((double)p->fx - times * px, (double)p->fy - times * py) * s->n * s->n < 1.0;
    for (int k = 1; k <= 2 && !printed; k++) {
        printed = miss_bins_squared(s, b, step, at.a1 + k * by.a1, at.a2 + k * by.a2) < 1.0 || miss_bins_squared(s, b, step, at.a1 - k * by.a1, at.a2 - k * by.a2) < 1.0;
    }
    return printed;
}

static strangers find_strangers(const tsuya_spectrum *s, const tsuya_basis *b, const tsuya_step *step)
{
    strangers out = {0};
    int highest = -1;
    bool on[TSUYA_PEAKS];
    spot at[TSUYA_PEAKS];
    double per_det = 1.0 / (b->f[0][0] * b->f[1][1] - b->f[0][1] * b->f[1][0]);
    float all = 1e-6f, ff = (float)fmin(square(b->f[0][0], b->f[0][1]), square(b->f[1][0], b->f[1][1]));
    for (int i = 0; i < s->peak_count; i++) {
        const tsuya_peak *p = &s->peak[i];
        at[i] = spot_of(b, per_det, p);
        all += p->level;
        if (p->level > out.part && (is_multiple(s, b->f[0], p) || is_multiple(s, b->f[1], p))) {
            out.part = p->level;
        }
        on[i] = miss_bins_squared(s, b, step, at[i].a1, at[i].a2) < 1.0;
        if (on[i]) {
            out.explained += p->level;
            continue;
        }
        highest = highest >= 0 ? highest : i; /* they are sorted */
        out.fine = p->level > out.fine && (fabsf(p->fx) > 0.4f || p->fy > 0.4f) ? p->level : out.fine;
        out.slow = p->level > out.slow && p->fx * p->fx + p->fy * p->fy < 0.5f * ff ? p->level : out.slow;
    }
    out.any = highest >= 0 ? s->peak[highest].level : 0.0f;
    for (int i = 0; i < s->peak_count; i++) {
        bool known = on[i] || is_printed(s, b, step, &s->peak[i], &s->peak[highest], at[i], at[highest]);
        out.printed += known ? s->peak[i].level : 0.0f;
    }
    out.explained /= all;
    out.printed /= all;
    return out;
}

static void choose_step(tsuya_basis *b, const tsuya_spectrum *s, double *mean, double *best, double *second)
{
    double best_score = -1e9;
    *second = -1e9;
    for (int k = 0; k < TSUYA_STEPS; k++) {
        double strongest, level = step_level(s, b, &tsuya_steps[k], &strongest);
        double score = (level - POINT_COST) * sqrt((double)tsuya_steps[k].repeat);
        if (score > best_score) {
            *second = best_score;
            best_score = score;
            b->step = k;
            *mean = level;
            *best = strongest;
        } else if (score > *second) {
            *second = score;
        }
    }
    *second = best_score - *second;
}

/* Of the patch: 0 for 64 px, 1 for 128. */
static float size_feature(const tsuya_spectrum *s) { return (float)fmin(fmax(log2(s->n / 64.0), -1.0), 1.5); }

static float high(float a, float b) { return a > b ? a : b; }
static float low(float a, float b) { return a < b ? a : b; }

/* Levels at the points of the step nearest to 0, k = 1 … 4, and at their neighbours a whole thread farther in along either family. */
static void describe_points(float *feature, const tsuya_basis *b, const tsuya_spectrum *s)
{
    const tsuya_step *step = &tsuya_steps[b->step];
    for (int k = 1; k <= 4 && 2 * k <= step->repeat; k++) {
        double a2 = (double)k / step->repeat, a1 = centred(-(double)step->step * k / step->repeat), out = a1 > 0.0 ? 1.0 : -1.0;
        feature[3 * (k - 1)] = LEVEL_SCALE * level_at(s, b, a1, a2);
        feature[3 * (k - 1) + 1] = LEVEL_SCALE * level_at(s, b, a1 - out, a2);
        feature[3 * (k - 1) + 2] = LEVEL_SCALE * level_at(s, b, a1, a2 - 1.0);
    }
    if (step->repeat == 2) { /* the corner's other point, and its neighbours */
        feature[3] = LEVEL_SCALE * level_at(s, b, -0.5, 0.5);
        feature[4] = LEVEL_SCALE * level_at(s, b, 1.5, 0.5);
        feature[5] = LEVEL_SCALE * level_at(s, b, -0.5, 1.5);
        feature[6] = LEVEL_SCALE * level_at(s, b, -1.5, 0.5);
        feature[7] = LEVEL_SCALE * level_at(s, b, 0.5, 1.5);
    }
}

static float wrapped_level(const tsuya_spectrum *s, double fx, double fy)
{
    return tsuya_spectrum_level(s, 0.9999 * (fx - rint(fx)), 0.9999 * (fy - rint(fy)));
}

/* Signs of what is no cloth, or finer cloth than pixels carry. */
static void describe_doubts(float *feature, const tsuya_basis *b, const tsuya_spectrum *s, const strangers *out)
{
    double ux = 0.5 * (b->f[0][0] + b->f[1][0]), uy = 0.5 * (b->f[0][1] + b->f[1][1]);
    double vx = 0.5 * (b->f[0][0] - b->f[1][0]), vy = 0.5 * (b->f[0][1] - b->f[1][1]);
    float both = high(wrapped_level(s, ux + 0.5, uy + 0.5), wrapped_level(s, vx + 0.5, vy + 0.5));
    float one = high(high(wrapped_level(s, ux + 0.5, uy), wrapped_level(s, ux, uy + 0.5)), high(wrapped_level(s, vx + 0.5, vy), wrapped_level(s, vx, vy + 0.5)));
    float middle = tsuya_spectrum_noise(s, 0.2, 0.0), fine = tsuya_spectrum_noise(s, 0.45, 0.0);
    const float list[8] = {
        LEVEL_SCALE * both, LEVEL_SCALE * one, LEVEL_SCALE * out->any, LEVEL_SCALE * out->fine, LEVEL_SCALE * out->slow,
        LEVEL_SCALE * out->part, out->printed, 0.25f * logf(middle / fine),
    };
    memcpy(feature, list, sizeof list);
}

static void describe(tsuya_basis *b, const tsuya_spectrum *s, float top, bool inferred)
{
    double mean = 0.0, best = 0.0, margin;
    if (level_at(s, b, 0, 1) > level_at(s, b, 1, 0)) {
        double first[2] = {b->f[0][0], b->f[0][1]};
        memcpy(b->f[0], b->f[1], sizeof first);
        memcpy(b->f[1], first, sizeof first);
    }
    choose_step(b, s, &mean, &best, &margin);
    strangers out = find_strangers(s, b, &tsuya_steps[b->step]);
    int repeat = tsuya_steps[b->step].repeat;
    float a[4], c[4];
    for (int k = 1; k <= 3; k++) {
        a[k] = LEVEL_SCALE * level_at(s, b, k, 0);
        c[k] = LEVEL_SCALE * level_at(s, b, 0, k);
    }
    double length[2] = {hypot(b->f[0][0], b->f[0][1]), hypot(b->f[1][0], b->f[1][1])};
    double dot = (b->f[0][0] * b->f[1][0] + b->f[0][1] * b->f[1][1]) / (length[0] * length[1]), ratio = log(length[0] / length[1]);
    float half[2] = {LEVEL_SCALE * level_at(s, b, 0.5, 0), LEVEL_SCALE * level_at(s, b, 0, 0.5)};
    float up = LEVEL_SCALE * level_at(s, b, 1, 1), down = LEVEL_SCALE * level_at(s, b, 1, -1);
    float along[2] = {tsuya_spectrum_energy(s, b->f[0][0], b->f[0][1]), tsuya_spectrum_energy(s, b->f[1][0], b->f[1][1])};
    float between[2] = {tsuya_spectrum_energy(s, b->f[0][0] + b->f[1][0], b->f[0][1] + b->f[1][1]),
                        tsuya_spectrum_energy(s, b->f[0][0] - b->f[1][0], b->f[0][1] - b->f[1][1])};
    float thirds[2] = {LEVEL_SCALE * high(level_at(s, b, 1.0 / 3.0, 0), level_at(s, b, 2.0 / 3.0, 0)),
                       LEVEL_SCALE * high(level_at(s, b, 0, 1.0 / 3.0), level_at(s, b, 0, 2.0 / 3.0))};
    float next = LEVEL_SCALE * 0.5f * (level_at(s, b, 2, 1) + level_at(s, b, 2, -1));
    float beside = LEVEL_SCALE * 0.5f * (level_at(s, b, 1, 2) + level_at(s, b, 1, -2));
    const float feature[36] = {
        a[1], c[1], a[2], c[2], a[3], c[3], high(up, down), low(up, down), half[0], half[1], thirds[0], thirds[1], next, beside,
        LEVEL_SCALE * (float)mean, LEVEL_SCALE * (float)best, LEVEL_SCALE * (float)fmin(margin, 20.0), out.explained,
        (float)(4.0 * dot * dot), (float)(ratio * ratio), (float)log(6.0 * length[0]), (float)log(6.0 * length[1]),
        LEVEL_SCALE * top, size_feature(s), repeat == 2, repeat == 3, repeat == 4, repeat == 5, repeat == 8,
        0.3f * along[0], 0.3f * along[1], 0.3f * high(between[0], between[1]), 0.3f * low(between[0], between[1]),
        a[1] - LEVEL_SCALE * top, 0.1f * (float)s->peak_count, inferred ? 1.0f : 0.0f,
    };
    memcpy(b->feature, feature, sizeof feature);
    describe_points(b->feature + 36, b, s);
    describe_doubts(b->feature + 48, b, s, &out);
}

typedef struct pair {
    int i, j;
    float rank;
} pair;

static bool can_be_threads(const candidate *p, const candidate *q)
{
    double cross = (double)(p->fx * q->fy - p->fy * q->fx), pp = square((double)p->fx, (double)p->fy), qq = square((double)q->fx, (double)q->fy);
    const double ratio = RATIO_MOST * RATIO_MOST;
    return cross * cross > SINE_LEAST * SINE_LEAST * pp * qq && pp < ratio * qq && qq < ratio * pp;
}

/* Keeps the pairs of highest rank, sorted; of equal ones the first. */
static int keep_pair(pair *list, int count, pair p)
{
    int place = count < PAIRS ? count++ : PAIRS;
    while (place > 0 && list[place - 1].rank < p.rank) {
        if (place < PAIRS) {
            list[place] = list[place - 1];
        }
        place--;
    }
    if (place < PAIRS) {
        list[place] = p;
    }
    return count;
}

/* A second family that no peak shows: a strong peak p taken for the first, and a peak g for a point (a1, k/n) of a step, give
 * f2 = (g − a1·p)·n/k. */
typedef struct inferred {
    double f[2][2];
    float rank;
} inferred;

static bool is_listed(const inferred *list, int count, const inferred *new, double n)
{
    for (int i = 0; i < count; i++) {
        const double *f = list[i].f[1], *g = new->f[1];
        bool first = list[i].f[0][0] == new->f[0][0] && list[i].f[0][1] == new->f[0][1];
        if (first && fmin(square(f[0] - g[0], f[1] - g[1]), square(f[0] + g[0], f[1] + g[1])) * n * n < SAME_BINS * SAME_BINS) {
            return true;
        }
    }
    return false;
}

static int keep_inferred(inferred *list, int count, const inferred *new)
{
    int place = count < INFERRED ? count++ : INFERRED;
    while (place > 0 && list[place - 1].rank < new->rank) {
        if (place < INFERRED) {
            list[place] = list[place - 1];
        }
        place--;
    }
    if (place < INFERRED) {
        list[place] = *new;
    }
    return count;
}

/* All second families out of p and g and one step. */
static int infer(inferred *list, int count, const tsuya_spectrum *s, const tsuya_peak *p, const tsuya_peak *g, const tsuya_step *step)
{
    double pp = (double)(p->fx * p->fx + p->fy * p->fy);
    for (int k = 1; 2 * k <= step->repeat; k++) {
        double a1 = centred(-(double)step->step * k / step->repeat), times = (double)step->repeat / k;
        for (int shift = -1; shift <= 1; shift++) {
            inferred new = {.f = {{(double)p->fx, (double)p->fy}}};
            new.f[1][0] = ((double)g->fx - (a1 + shift) * (double)p->fx) * times;
            new.f[1][1] = ((double)g->fy - (a1 + shift) * (double)p->fy) * times;
            double ff = new.f[1][0] * new.f[1][0] + new.f[1][1] * new.f[1][1];
            double dot = new.f[1][0] * (double)p->fx + new.f[1][1] * (double)p->fy;
            if (ff > 4.0 * pp || 4.0 * ff < pp || ff > 1.0 / (PERIOD_LEAST * PERIOD_LEAST) || dot * dot > 0.16 * ff * pp) {
                continue;
            }
            tsuya_basis b = {.f = {{new.f[0][0], new.f[0][1]}, {new.f[1][0], new.f[1][1]}}};
            double best;
            new.rank = (float)(step_level(s, &b, step, &best) * sqrt((double)step->repeat)) + p->level;
            if (!is_listed(list, count < INFERRED ? count : INFERRED, &new, s->n)) {
                count = keep_inferred(list, count, &new);
            }
        }
    }
    return count;
}

static int list_inferred(inferred *list, const tsuya_spectrum *s)
{
    int count = 0, firsts = s->peak_count < 5 ? s->peak_count : 5, points = s->peak_count < 7 ? s->peak_count : 7;
    for (int i = 0; i < firsts; i++) {
        for (int j = 0; j < points; j++) {
            for (int k = 0; i != j && k < TSUYA_STEPS; k++) {
                count = infer(list, count, s, &s->peak[i], &s->peak[j], &tsuya_steps[k]);
            }
        }
    }
    return count;
}

TSUYA_CLONES("avx2", "default") __attribute__((flatten)) static void list_bases(tsuya_bases *bases, const tsuya_spectrum *s)
{
    candidate list[CANDIDATES];
    pair kept[PAIRS];
    inferred more[INFERRED];
    int count = list_candidates(list, s), pairs = 0, more_count = list_inferred(more, s);
    float top = s->peak_count > 0 ? s->peak[0].level : 0.0f;
    for (int i = 0; i < count; i++) {
        for (int j = i + 1; j < count; j++) {
            if (can_be_threads(&list[i], &list[j])) {
                float weaker = low(list[i].level, list[j].level);
                pairs = keep_pair(kept, pairs, (pair){i, j, list[i].level + list[j].level + weaker});
            }
        }
    }
    bases->count = 0;
    for (int k = 0; k < pairs; k++) {
        const candidate *p = &list[kept[k].i], *q = &list[kept[k].j];
        tsuya_basis *b = &bases->basis[bases->count++];
        *b = (tsuya_basis){.f = {{(double)p->fx, (double)p->fy}, {(double)q->fx, (double)q->fy}}};
        describe(b, s, top, false);
    }
    for (int k = 0; k < more_count; k++) {
        tsuya_basis *b = &bases->basis[bases->count++];
        *b = (tsuya_basis){0};
        memcpy(b->f, more[k].f, sizeof b->f);
        describe(b, s, top, true);
    }
    memset(bases->none_feature, 0, sizeof bases->none_feature);
    bases->none_feature[22] = LEVEL_SCALE * top;
    bases->none_feature[23] = size_feature(s);
    bases->none_feature[34] = 0.1f * (float)s->peak_count;
    bases->none_feature[55] = 0.25f * logf(tsuya_spectrum_noise(s, 0.2, 0.0) / tsuya_spectrum_noise(s, 0.45, 0.0));
}

void tsuya_bases_list(tsuya_bases *bases, const tsuya_spectrum *spectrum) { list_bases(bases, spectrum); }

/* Eight lanes, so that the order of additions does not depend on the vector width. */
static inline float score(const float *weight, const float *feature)
{
    const float *out = weight + TSUYA_HIDDEN * (TSUYA_FEATURES + 1);
    float sum = out[TSUYA_HIDDEN];
    for (int h = 0; h < TSUYA_HIDDEN; h++) {
        const float *w = weight + h * (TSUYA_FEATURES + 1);
        float lane[8] = {0};
        for (int f = 0; f < TSUYA_FEATURES; f += 8) {
            for (int k = 0; k < 8; k++) {
                lane[k] += w[f + k] * feature[f + k];
            }
        }
        float in = w[TSUYA_FEATURES] + (((lane[0] + lane[4]) + (lane[1] + lane[5])) + ((lane[2] + lane[6]) + (lane[3] + lane[7])));
        sum += out[h] * (in > 0.0f ? in : 0.1f * in);
    }
    return sum;
}

TSUYA_CLONES("avx2", "default") static void score_all(tsuya_bases *bases, const float *weight)
{
    for (int k = 0; k < bases->count; k++) {
        bases->basis[k].score = score(weight, bases->basis[k].feature);
    }
}

float tsuya_bases_score(const float *weight, const float *feature) { return score(weight, feature); }

void tsuya_bases_weigh(tsuya_bases *bases)
{
    float none = tsuya_bases_score(tsuya_lattice_weights, bases->none_feature), highest = none;
    score_all(bases, tsuya_lattice_weights);
    for (int k = 0; k < bases->count; k++) {
        highest = high(highest, bases->basis[k].score);
    }
    double sum = exp((double)(none - highest));
    bases->none_probability = (float)sum;
    for (int k = 0; k < bases->count; k++) {
        bases->basis[k].probability = (float)exp((double)(bases->basis[k].score - highest));
        sum += (double)bases->basis[k].probability;
    }
    bases->none_probability = (float)((double)bases->none_probability / sum);
    for (int k = 0; k < bases->count; k++) {
        bases->basis[k].probability = (float)((double)bases->basis[k].probability / sum);
    }
}
