#include "calib/refine_edge.h"

#include <pthread.h>
#include <string.h>

enum { MOST_PIXELS = 8192, MOST_ITERATIONS = 12, FEWEST_PIXELS = 24 };

/* Black levels are kept from 0, where the tone curve is infinitely steep; noise of 8-bit rounding. */
static const double DARKEST = 1e-4, ROUNDING = 1.0 / (12.0 * 255.0 * 255.0);

typedef struct pixel { float u, depth, grey; } pixel;

typedef struct strip {
    pixel pixel[MOST_PIXELS];
    int count;
} strip;

void tsuya_edge_place(tsuya_edge *edge, tsuya_vec2 from, tsuya_vec2 to)
{
    double dx = to.x - from.x, dy = to.y - from.y, length = hypot(dx, dy);
    *edge = (tsuya_edge){.middle = {0.5 * (from.x + to.x), 0.5 * (from.y + to.y)}, .half_length_px = 0.5 * length};
    if (length > 0.0) {
        edge->tangent = (tsuya_vec2){dx / length, dy / length};
        edge->inward = (tsuya_vec2){dy / length, -dx / length};
    }
}

static double depth_of(const tsuya_edge *edge, double x, double y)
{
    return (x - edge->middle.x) * edge->inward.x + (y - edge->middle.y) * edge->inward.y;
}

static double bend(double u) { return u * u - 1.0 / 3.0; }

tsuya_vec2 tsuya_edge_point(const tsuya_edge *edge, double u, tsuya_vec2 *derivative)
{
    const double *p = edge->p;
    double f = p[EDGE_OFFSET] + p[EDGE_SLOPE] * u + p[EDGE_BOW] * bend(u), df = p[EDGE_SLOPE] + 2.0 * p[EDGE_BOW] * u;
    double h = edge->half_length_px;
    *derivative = (tsuya_vec2){h * edge->tangent.x + df * edge->inward.x, h * edge->tangent.y + df * edge->inward.y};
    return (tsuya_vec2){edge->middle.x + h * u * edge->tangent.x + f * edge->inward.x,
                        edge->middle.y + h * u * edge->tangent.y + f * edge->inward.y};
}

/* A pixel counts when it lies in the strip and stays clear of the neighbouring edges. */
static void take_pixel(strip *s, const tsuya_edge *edge, const tsuya_image *grey, const tsuya_edge *before, const tsuya_edge *after,
                       int x, int y, const double reach[2], double margin)
{
    double depth = depth_of(edge, x, y);
    if (depth > reach[0] || depth < -reach[1] || s->count == MOST_PIXELS || depth_of(before, x, y) < margin || depth_of(after, x, y) < margin) {
        return;
    }
    double u = ((x - edge->middle.x) * edge->tangent.x + (y - edge->middle.y) * edge->tangent.y) / edge->half_length_px;
    if (fabs(u) * edge->half_length_px > edge->half_length_px - margin) {
        return;
    }
    s->pixel[s->count++] = (pixel){(float)u, (float)depth, *tsuya_image_f32(grey, x, y)};
}

/* Walks along the axis that the edge is nearer to. */
static void gather(strip *s, const tsuya_edge *edge, const tsuya_image *grey, const tsuya_edge *before, const tsuya_edge *after,
                   const double reach[2], double margin)
{
    bool along_x = fabs(edge->tangent.x) >= fabs(edge->tangent.y);
    double t_along = along_x ? edge->tangent.x : edge->tangent.y, t_across = along_x ? edge->tangent.y : edge->tangent.x;
    double m_along = along_x ? edge->middle.x : edge->middle.y, m_across = along_x ? edge->middle.y : edge->middle.x;
    int along_size = along_x ? grey->width_px : grey->height_px, across_size = along_x ? grey->height_px : grey->width_px;
    double wide = fmax(reach[0], reach[1]), spread = wide / fmax(fabs(t_along), 1e-6);
    double half = edge->half_length_px * fabs(t_along) + wide * fabs(t_across);
    int first = (int)fmax(0.0, ceil(m_along - half)), last = (int)fmin(along_size - 1.0, floor(m_along + half));
    s->count = 0;
    for (int a = first; a <= last; a++) {
        double center = m_across + (a - m_along) * t_across / t_along;
        int low = (int)fmax(0.0, ceil(center - spread)), high = (int)fmin(across_size - 1.0, floor(center + spread));
        for (int b = low; b <= high; b++) {
            take_pixel(s, edge, grey, before, after, along_x ? a : b, along_x ? b : a, reach, margin);
        }
    }
}

/* Levels of the two sides as the first guess; signed contrast, so that a family with a white rim works the same. */
static bool start(double p[EDGE_PARAMETERS], const strip *s, double blur)
{
    double sum[2] = {0}, count[2] = {0};
    for (int i = 0; i < s->count; i++) {
        double d = (double)s->pixel[i].depth;
        if (fabs(d) > 0.5) {
            sum[d > 0.0] += (double)s->pixel[i].grey;
            count[d > 0.0] += 1.0;
        }
    }
    if (count[0] < 6.0 || count[1] < 6.0) {
        return false;
    }
    double tone = p[EDGE_TONE];
    memset(p, 0, EDGE_PARAMETERS * sizeof *p);
    p[EDGE_BLUR] = blur;
    p[EDGE_WHITE] = pow(fmax(sum[0] / count[0], DARKEST), tone);
    p[EDGE_BLACK] = pow(fmax(sum[1] / count[1], DARKEST), tone);
    p[EDGE_TONE] = tone;
    return true;
}

/* The normal distribution and its density in steps of 1/64, between them by their own slopes (cubic Hermite: within 2e-10).  The
 * library's erfc and exp took most of the fit's time. */
enum { NORMAL_STEPS = 64, NORMAL_REACH = 6, NORMAL_COUNT = 2 * NORMAL_REACH * NORMAL_STEPS + 1 };
static double normal_table[NORMAL_COUNT][2];
static pthread_once_t normal_made = PTHREAD_ONCE_INIT;

static void make_normal(void)
{
    for (int i = 0; i < NORMAL_COUNT; i++) {
        double z = (double)i / NORMAL_STEPS - NORMAL_REACH;
        normal_table[i][0] = 0.5 * erfc(-z * M_SQRT1_2);
        normal_table[i][1] = 0.3989422804014327 * exp(-0.5 * z * z);
    }
}

static inline void normal_at(double *share, double *density, double z)
{
    double t = (z + NORMAL_REACH) * NORMAL_STEPS;
    if (!(t > 0.0) || !(t < NORMAL_COUNT - 1)) {
        *share = z > 0.0 ? 1.0 : 0.0;
        *density = 0.0;
        return;
    }
    int i = (int)t;
    double s = t - i, h = 1.0 / NORMAL_STEPS, z0 = (double)i * h - NORMAL_REACH;
    const double *a = normal_table[i], *b = normal_table[i + 1];
    double s2 = s * s, s3 = s2 * s, b0 = 1.0 - 3.0 * s2 + 2.0 * s3, b1 = 3.0 * s2 - 2.0 * s3, d0 = h * (s - 2.0 * s2 + s3), d1 = h * (s3 - s2);
    *share = b0 * a[0] + b1 * b[0] + d0 * a[1] + d1 * b[1];
    *density = b0 * a[1] + b1 * b[1] - d0 * z0 * a[1] - d1 * (z0 + h) * b[1];
}

/* Residual and gradient of one pixel; the tone's part where it is asked for. */
static inline double evaluate(double g[EDGE_PARAMETERS], const double p[EDGE_PARAMETERS], const pixel *q, bool with_tone)
{
    double u = (double)q->u, b = bend(u);
    double z = (p[EDGE_OFFSET] + p[EDGE_SLOPE] * u + p[EDGE_BOW] * b - (double)q->depth) / p[EDGE_BLUR];
    double share, density;
    normal_at(&share, &density, z);
    double black = p[EDGE_BLACK] + p[EDGE_BLACK_SLOPE] * u, contrast = p[EDGE_WHITE] + p[EDGE_WHITE_SLOPE] * u - black;
    double light = fmax(black + contrast * share, DARKEST), tone = p[EDGE_TONE], value = light, rise = 1.0;
    double logarithm = with_tone || tone != 1.0 ? log(light) : 0.0;
    if (tone != 1.0) {
        value = exp(logarithm / tone);
        rise = value / (tone * light);
    }
    double by_offset = rise * contrast * density / p[EDGE_BLUR];
    g[EDGE_OFFSET] = by_offset;
    g[EDGE_SLOPE] = by_offset * u;
    g[EDGE_BOW] = by_offset * b;
    g[EDGE_BLUR] = -by_offset * z;
    g[EDGE_WHITE] = rise * share;
    g[EDGE_WHITE_SLOPE] = rise * share * u;
    g[EDGE_BLACK] = rise * (1.0 - share);
    g[EDGE_BLACK_SLOPE] = rise * (1.0 - share) * u;
    g[EDGE_TONE] = -value * logarithm / (tone * tone);
    return (double)q->grey - value;
}

typedef struct normal { double h[EDGE_PARAMETERS][EDGE_PARAMETERS], g[EDGE_PARAMETERS], squares; } normal;

static void accumulate(normal *n, const double p[EDGE_PARAMETERS], const strip *s, bool with_tone)
{
    int size = with_tone ? EDGE_PARAMETERS : EDGE_TONE;
    memset(n, 0, sizeof *n);
    for (int i = 0; i < s->count; i++) {
        double g[EDGE_PARAMETERS], r = evaluate(g, p, &s->pixel[i], with_tone);
        n->squares += r * r;
        for (int a = 0; a < size; a++) {
            n->g[a] += g[a] * r;
            for (int b = 0; b <= a; b++) {
                n->h[a][b] += g[a] * g[b];
            }
        }
    }
}

/* Cholesky in place of the leading `size` rows; false where it is not positive definite. */
static bool factor(double h[EDGE_PARAMETERS][EDGE_PARAMETERS], int size)
{
    for (int a = 0; a < size; a++) {
        for (int b = 0; b <= a; b++) {
            double sum = h[a][b];
            for (int k = 0; k < b; k++) {
                sum -= h[a][k] * h[b][k];
            }
            if (a == b) {
                if (!(sum > 1e-12 * h[a][a])) {
                    return false;
                }
                h[a][a] = sqrt(sum);
            } else {
                h[a][b] = sum / h[b][b];
            }
        }
    }
    return true;
}

static void solve(double x[EDGE_PARAMETERS], double h[EDGE_PARAMETERS][EDGE_PARAMETERS], int size)
{
    for (int a = 0; a < size; a++) {
        for (int k = 0; k < a; k++) {
            x[a] -= h[a][k] * x[k];
        }
        x[a] /= h[a][a];
    }
    for (int a = size - 1; a >= 0; a--) {
        for (int k = a + 1; k < size; k++) {
            x[a] -= h[k][a] * x[k];
        }
        x[a] /= h[a][a];
    }
}

static double limited(double step, double most) { return step > most ? most : step < -most ? -most : step; }

/* Lenses bend an edge by some thousandths of its length: a prior that matters on short and faint edges only. */
static void add_bow_prior(normal *n, const tsuya_edge *edge, double variance)
{
    double sigma = 0.005 * edge->half_length_px;
    n->h[EDGE_BOW][EDGE_BOW] += variance / (sigma * sigma);
    n->g[EDGE_BOW] -= variance / (sigma * sigma) * edge->p[EDGE_BOW];
}

/* Gauss–Newton; true when the steps have become small. */
static bool iterate(tsuya_edge *edge, const strip *s, normal *last, double *variance, bool with_tone)
{
    double *p = edge->p, moved = INFINITY;
    for (int i = 0; i < MOST_ITERATIONS; i++) {
        accumulate(last, p, s, with_tone);
        *variance = fmax(last->squares / (s->count - EDGE_TONE), ROUNDING);
        add_bow_prior(last, edge, *variance);
        normal work = *last;
        double step[EDGE_PARAMETERS];
        memcpy(step, last->g, sizeof step);
        if (!factor(work.h, EDGE_TONE)) {
            return false;
        }
        solve(step, work.h, EDGE_TONE);
        for (int a = 0; a < EDGE_TONE; a++) {
            double most = a <= EDGE_BOW ? 1.5 : a == EDGE_BLUR ? 0.5 * p[EDGE_BLUR] : 1.0;
            p[a] += limited(step[a], most);
        }
        p[EDGE_BLUR] = fmin(fmax(p[EDGE_BLUR], 0.2), 0.5 * edge->half_length_px + 1.0);
        moved = fabs(step[EDGE_OFFSET]) + fabs(step[EDGE_SLOPE]) + fabs(step[EDGE_BOW]) + 0.2 * fabs(step[EDGE_BLUR]);
        if (moved < 1e-3) {
            return true;
        }
    }
    return moved < 0.02;
}

static void keep_covariance(tsuya_edge *edge, const normal *n, double variance)
{
    normal work = *n;
    if (!factor(work.h, EDGE_TONE)) {
        edge->reason = TSUYA_REFINE_UNLIKE;
        return;
    }
    for (int a = 0; a < 3; a++) {
        double column[EDGE_PARAMETERS] = {0};
        column[a] = 1.0;
        solve(column, work.h, EDGE_TONE);
        for (int b = 0; b < 3; b++) {
            edge->covariance[a][b] = variance * column[b];
        }
    }
}

/* The tone's part of a Gauss–Newton step in which it were free too. */
static void keep_tone_step(tsuya_edge *edge, const normal *n, double variance)
{
    normal work = *n;
    double step[EDGE_PARAMETERS], column[EDGE_PARAMETERS] = {0};
    edge->tone_variance = INFINITY;
    if (factor(work.h, EDGE_PARAMETERS)) {
        memcpy(step, n->g, sizeof step);
        column[EDGE_TONE] = 1.0;
        solve(step, work.h, EDGE_PARAMETERS);
        solve(column, work.h, EDGE_PARAMETERS);
        edge->tone_step = step[EDGE_TONE];
        edge->tone_variance = variance * column[EDGE_TONE];
    }
}

static tsuya_refine_reason judge(const tsuya_edge *edge, double noise, double start_contrast)
{
    const double *p = edge->p;
    double white = pow(fmax(p[EDGE_WHITE], DARKEST), 1.0 / p[EDGE_TONE]), black = pow(fmax(p[EDGE_BLACK], DARKEST), 1.0 / p[EDGE_TONE]);
    double contrast = fabs(white - black), length = 2.0 * edge->half_length_px;
    if (contrast < 10.0 / 255.0 || contrast < 3.0 * noise || contrast < 0.4 * start_contrast) {
        return TSUYA_REFINE_CONTRAST;
    }
    if (fabs(p[EDGE_OFFSET]) + fabs(p[EDGE_SLOPE]) > fmax(3.0, 0.12 * length) || fabs(p[EDGE_BOW]) > 0.04 * length) {
        return TSUYA_REFINE_ASTRAY;
    }
    return noise > 0.2 * contrast ? TSUYA_REFINE_UNLIKE : TSUYA_REFINE_FINE;
}

void tsuya_edge_fit(tsuya_edge *edge, const tsuya_image *grey, const tsuya_edge *before, const tsuya_edge *after, double inner_px,
                    double outer_px, double tone, bool learn_tone)
{
    strip s;
    pthread_once(&normal_made, make_normal);
    double blur = edge->p[EDGE_BLUR] > 0.0 ? edge->p[EDGE_BLUR] : 0.8;
    edge->p[EDGE_TONE] = tone;
    /* Between tag and code, and between tag and neighbour, only what one transition reaches. */
    double reach[2] = {fmin(fmax(inner_px - 2.2 * blur, 1.5), 3.0 * blur + 1.5), fmin(fmax(outer_px - 2.2 * blur, 1.5), 3.0 * blur + 1.5)};
    double margin = fmin(2.5 * blur + 0.7, 0.5 * edge->half_length_px);
    gather(&s, edge, grey, before, after, reach, margin);
    edge->pixels = s.count;
    edge->tone_variance = INFINITY;
    if (s.count < FEWEST_PIXELS || !start(edge->p, &s, blur)) {
        edge->reason = TSUYA_REFINE_OUTSIDE;
        return;
    }
    normal last;
    double variance = 0.0, contrast = fabs(pow(edge->p[EDGE_WHITE], 1.0 / tone) - pow(edge->p[EDGE_BLACK], 1.0 / tone));
    if (!iterate(edge, &s, &last, &variance, learn_tone)) {
        edge->reason = TSUYA_REFINE_UNLIKE;
        return;
    }
    edge->residual = sqrt(variance);
    edge->reason = judge(edge, edge->residual, contrast);
    keep_covariance(edge, &last, variance);
    if (learn_tone) {
        keep_tone_step(edge, &last, variance);
    }
}
