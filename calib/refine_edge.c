#include "calib/refine_edge.h"

#include "calib/planar.h"
#include "calib/refine_kernel.h"

#include <string.h>

enum { MOST_ITERATIONS = 12, FEWEST_PIXELS = 24 };

/* Black levels are kept from 0; noise of 8-bit rounding. */
static const double DARKEST = 1e-4, LEAST_LIGHT = 2e-3, ROUNDING = 1.0 / (12.0 * 255.0 * 255.0);

void tsuya_edge_place(tsuya_edge *edge, tsuya_vec2 from, tsuya_vec2 to)
{
    double dx = to.x - from.x, dy = to.y - from.y, length = hypot(dx, dy);
    *edge = (tsuya_edge){.middle = {0.5 * (from.x + to.x), 0.5 * (from.y + to.y)}, .half_length_px = 0.5 * length};
    if (length > 0.0) {
        edge->tangent = (tsuya_vec2){dx / length, dy / length};
        edge->inward = (tsuya_vec2){dy / length, -dx / length};
    }
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

/* Places where c + cx x + cy y ≥ 0. */
typedef struct half_plane { double c, cx, cy; } half_plane;

/* Where n · (p − at) ≥ least. */
static half_plane beyond(tsuya_vec2 n, tsuya_vec2 at, double least) { return (half_plane){-n.x * at.x - n.y * at.y - least, n.x, n.y}; }

static tsuya_vec2 opposite(tsuya_vec2 v) { return (tsuya_vec2){-v.x, -v.y}; }

/* Pixels of one row. */
static void take_row(tsuya_edge_pixels *s, const tsuya_edge *edge, const tsuya_image *grey, int y, int first, int last)
{
    const float *row = tsuya_image_f32(grey, 0, y);
    double dx = first - edge->middle.x, dy = y - edge->middle.y, by_length = 1.0 / edge->half_length_px;
    double u = (dx * edge->tangent.x + dy * edge->tangent.y) * by_length, depth = dx * edge->inward.x + dy * edge->inward.y;
    int n = last - first + 1 < TSUYA_EDGE_MOST_PIXELS - s->count ? last - first + 1 : TSUYA_EDGE_MOST_PIXELS - s->count;
    float *at_u = s->u + s->count, *at_depth = s->depth + s->count, *at_grey = s->grey + s->count;
    for (int i = 0; i < n; i++) {
        at_u[i] = (float)(u + i * edge->tangent.x * by_length);
        at_depth[i] = (float)(depth + i * edge->inward.x);
        at_grey[i] = row[first + i];
    }
    s->count += n;
}

/* Pixels count when they lie in the strip, clear of the neighbouring edges: in a row, from one place to another. */
static void gather(tsuya_edge_pixels *s, const tsuya_edge *edge, const tsuya_image *grey, const tsuya_edge *before, const tsuya_edge *after,
                   const double reach[2], double margin)
{
    double along = edge->half_length_px - margin, wide = fmax(reach[0], reach[1]);
    const half_plane strip[] = {beyond(edge->inward, edge->middle, -reach[1]), beyond(opposite(edge->inward), edge->middle, -reach[0]),
                                beyond(edge->tangent, edge->middle, -along), beyond(opposite(edge->tangent), edge->middle, -along),
                                beyond(before->inward, before->middle, margin), beyond(after->inward, after->middle, margin)};
    double half = along * fabs(edge->tangent.y) + wide * fabs(edge->inward.y);
    int first = (int)fmax(0.0, ceil(edge->middle.y - half)), last = (int)fmin(grey->height_px - 1.0, floor(edge->middle.y + half));
    s->count = 0;
    for (int y = first; y <= last; y++) {
        double low = 0.0, high = grey->width_px - 1.0;
        for (int k = 0; k < 6; k++) {
            double at = strip[k].c + strip[k].cy * y;
            if (fabs(strip[k].cx) > 1e-9) {
                low = strip[k].cx > 0.0 ? fmax(low, -at / strip[k].cx) : low;
                high = strip[k].cx < 0.0 ? fmin(high, -at / strip[k].cx) : high;
            } else if (at < 0.0) {
                high = -1.0;
            }
        }
        if (ceil(low) <= floor(high)) {
            take_row(s, edge, grey, y, (int)ceil(low), (int)floor(high));
        }
    }
}

/* ---- light from elsewhere ---- */

static const double CLEAR = 4.0; /* blurs: farther light does not reach */

bool tsuya_edge_is_narrow(double inner_px, double blur_px) { return inner_px < 7.0 * blur_px + 1.5; }

double tsuya_edge_blur(const tsuya_edge *edge)
{
    const double blur = edge->p[EDGE_BLUR], c = edge->p[EDGE_SHARPENING];
    return 1.0 / ((1.0 + c) / blur - c / tsuya_edge_wide(blur));
}

static double normal(double z) { return 0.5 * erfc(-z * M_SQRT1_2); }

/* Of the white cells about a place, in cells; sigma: the blur along both. */
static double from_code(const tsuya_edge_code *code, tsuya_vec2 at, const double sigma[2])
{
    const int first = code->border, end = code->cells - code->border;
    double sum = 0.0;
    for (int y = first; y < end; y++) {
        if (fabs(at.y - y - 0.5) > CLEAR * sigma[1] + 0.5) {
            continue;
        }
        const double along_y = normal((at.y - y) / sigma[1]) - normal((at.y - y - 1) / sigma[1]);
        for (int x = first; x < end; x++) {
            if (code->white[y][x] && fabs(at.x - x - 0.5) < CLEAR * sigma[0] + 0.5) {
                sum += along_y * (normal((at.x - x) / sigma[0]) - normal((at.x - x - 1) / sigma[0]));
            }
        }
    }
    return sum;
}

/* How dark a neighbouring edge leaves a place. */
static double darkness(const tsuya_edge *neighbour, tsuya_vec2 p, double blur)
{
    const double d = (p.x - neighbour->middle.x) * neighbour->inward.x + (p.y - neighbour->middle.y) * neighbour->inward.y;
    return d < CLEAR * blur ? normal(d / blur) : 1.0;
}

/* By one blur. */
static void add_stray(float *out, const tsuya_edge_pixels *s, const tsuya_edge *edge, const tsuya_edge *before, const tsuya_edge *after,
                      const tsuya_edge_code *code, double inner_px, double blur)
{
    const bool narrow = code->read && tsuya_edge_is_narrow(inner_px, blur);
    /* cells per pixel; `across`: the edge runs along the code's y */
    const double by_along = 0.5 * code->cells / edge->half_length_px, by_depth = code->border / fmax(inner_px, 1e-3);
    const bool across = narrow && fabs(code->cells_from_px.e[0][0] * edge->tangent.x + code->cells_from_px.e[0][1] * edge->tangent.y) <
                                      fabs(code->cells_from_px.e[1][0] * edge->tangent.x + code->cells_from_px.e[1][1] * edge->tangent.y);
    const double sigma[2] = {blur * (across ? by_depth : by_along), blur * (across ? by_along : by_depth)};
    for (int i = 0; i < s->count; i++) {
        const double depth = (double)s->depth[i], along = (double)s->u[i] * edge->half_length_px;
        out[i] = 0.0f;
        if (depth < -2.0 * blur) {
            continue; /* white already */
        }
        const tsuya_vec2 p = {edge->middle.x + along * edge->tangent.x + depth * edge->inward.x, edge->middle.y + along * edge->tangent.y + depth * edge->inward.y};
        double stray = 1.0 - darkness(before, p, blur) * darkness(after, p, blur);
        if (narrow && inner_px - depth < CLEAR * blur) {
            stray += from_code(code, tsuya_homography_apply(code->cells_from_px, p), sigma);
        }
        out[i] = (float)fmin(stray, 0.9);
    }
}

/* Levels of the two sides as the first guess; signed contrast, so that a family with a white rim works the same. */
static bool start(double p[EDGE_PARAMETERS], const tsuya_edge_pixels *s, double blur)
{
    double sum[2] = {0}, count[2] = {0};
    for (int i = 0; i < s->count; i++) {
        double d = (double)s->depth[i];
        if (fabs(d) > 0.5) {
            sum[d > 0.0] += (double)s->grey[i];
            count[d > 0.0] += 1.0;
        }
    }
    if (count[0] < 6.0 || count[1] < 6.0) {
        return false;
    }
    memset(p, 0, EDGE_TONE * sizeof *p);
    p[EDGE_BLUR] = blur;
    p[EDGE_WHITE] = fmax(tsuya_edge_light(sum[0] / count[0], p[EDGE_TONE]), DARKEST);
    p[EDGE_BLACK] = fmax(tsuya_edge_light(sum[1] / count[1], p[EDGE_TONE]), DARKEST);
    return true;
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

static void forward(double x[EDGE_PARAMETERS], double h[EDGE_PARAMETERS][EDGE_PARAMETERS], int size)
{
    for (int a = 0; a < size; a++) {
        for (int k = 0; k < a; k++) {
            x[a] -= h[a][k] * x[k];
        }
        x[a] /= h[a][a];
    }
}

static void solve(double x[EDGE_PARAMETERS], double h[EDGE_PARAMETERS][EDGE_PARAMETERS], int size)
{
    forward(x, h, size);
    for (int a = size - 1; a >= 0; a--) {
        for (int k = a + 1; k < size; k++) {
            x[a] -= h[k][a] * x[k];
        }
        x[a] /= h[a][a];
    }
}

static double limited(double step, double most) { return step > most ? most : step < -most ? -most : step; }

/* Of the light along an edge, beside even and slanting: soft shadows; more is something that covers it. */
static const double ARC_SIGMA = 0.05, ARC_MOST = 0.15, ARC_NONE = 1e-5, ARC_CERTAIN = 3.0;

/* Lenses bend an edge by some thousandths of its length: a prior that matters on short and faint edges only.  An edge that is
 * sharper than a pixel does not tell its blur: that step is damped, for the sums are only as good as floats. */
static void add_priors(tsuya_edge_normal *n, const tsuya_edge *edge, double variance, double arc_sigma)
{
    double sigma = 0.005 * edge->half_length_px;
    n->h[EDGE_BOW][EDGE_BOW] += variance / (sigma * sigma);
    n->g[EDGE_BOW] -= variance / (sigma * sigma) * edge->p[EDGE_BOW];
    n->h[EDGE_ARC][EDGE_ARC] += variance / (arc_sigma * arc_sigma);
    n->g[EDGE_ARC] -= variance / (arc_sigma * arc_sigma) * edge->p[EDGE_ARC];
    n->h[EDGE_BLUR][EDGE_BLUR] += 1e-4 * n->h[EDGE_OFFSET][EDGE_OFFSET];
}

/* Gauss–Newton; true when the steps have become small. */
static bool iterate(tsuya_edge *edge, tsuya_edge_pixels *s, tsuya_edge_normal *last, double *variance, double arc_sigma, bool learn)
{
    double *p = edge->p, moved = INFINITY;
    for (int i = 0; i < MOST_ITERATIONS; i++) {
        tsuya_edge_normal_sum(last, p, s, learn);
        *variance = fmax(last->squares / (s->count - EDGE_TONE), ROUNDING);
        add_priors(last, edge, *variance, arc_sigma);
        tsuya_edge_normal work = *last;
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
        const double least = LEAST_LIGHT * fmax(p[EDGE_WHITE], p[EDGE_BLACK]); /* sharpening would make it darker than black */
        p[EDGE_WHITE] = fmax(p[EDGE_WHITE], least);
        p[EDGE_BLACK] = fmax(p[EDGE_BLACK], least);
        moved = fabs(step[EDGE_OFFSET]) + fabs(step[EDGE_SLOPE]) + fabs(step[EDGE_BOW]) + 0.2 * fabs(step[EDGE_BLUR]);
        if (moved < 1e-3) {
            return true;
        }
    }
    return moved < 0.02;
}

/* Whether a fit without it asks for an arc: what a step in which it were free would make of it, in its own sigmas. */
static bool wants_arc(const tsuya_edge_normal *n, const tsuya_edge *edge, double variance)
{
    const double prior = variance / (ARC_NONE * ARC_NONE);
    tsuya_edge_normal work = *n;
    double step[EDGE_PARAMETERS], column[EDGE_PARAMETERS] = {0};
    work.h[EDGE_ARC][EDGE_ARC] += variance / (ARC_SIGMA * ARC_SIGMA) - prior;
    memcpy(step, n->g, sizeof step);
    step[EDGE_ARC] += prior * edge->p[EDGE_ARC];
    column[EDGE_ARC] = 1.0;
    if (!factor(work.h, EDGE_TONE)) {
        return false;
    }
    solve(step, work.h, EDGE_TONE);
    solve(column, work.h, EDGE_TONE);
    return fabs(step[EDGE_ARC]) > ARC_CERTAIN * sqrt(variance * column[EDGE_ARC]);
}

static void keep_covariance(tsuya_edge *edge, const tsuya_edge_normal *n, double variance)
{
    tsuya_edge_normal work = *n;
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

/* The normal equations of γ and the sharpening, the edge's own parameters eliminated. */
static void keep_look(tsuya_edge *edge, const tsuya_edge_normal *n, double variance)
{
    tsuya_edge_normal work = *n;
    double y[EDGE_PARAMETERS];
    if (!factor(work.h, EDGE_PARAMETERS)) {
        return;
    }
    memcpy(y, work.g, sizeof y);
    forward(y, work.h, EDGE_PARAMETERS);
    const double l[2][2] = {{work.h[EDGE_TONE][EDGE_TONE], 0.0}, {work.h[EDGE_SHARPENING][EDGE_TONE], work.h[EDGE_SHARPENING][EDGE_SHARPENING]}};
    for (int a = 0; a < 2; a++) {
        edge->look_pull[a] = (l[a][0] * y[EDGE_TONE] + l[a][1] * y[EDGE_SHARPENING]) / variance;
        for (int b = 0; b < 2; b++) {
            edge->look_information[a][b] = (l[a][0] * l[b][0] + l[a][1] * l[b][1]) / variance;
        }
    }
}

static tsuya_refine_reason judge(const tsuya_edge *edge, double noise, double start_contrast)
{
    const double *p = edge->p;
    double contrast = fabs(tsuya_edge_value(fmax(p[EDGE_WHITE], DARKEST), p[EDGE_TONE]) - tsuya_edge_value(fmax(p[EDGE_BLACK], DARKEST), p[EDGE_TONE]));
    double length = 2.0 * edge->half_length_px;
    if (contrast < 10.0 / 255.0 || contrast < 3.0 * noise || contrast < 0.4 * start_contrast) {
        return TSUYA_REFINE_CONTRAST;
    }
    if (fabs(p[EDGE_OFFSET]) + fabs(p[EDGE_SLOPE]) > fmax(3.0, 0.12 * length) || fabs(p[EDGE_BOW]) > 0.04 * length) {
        return TSUYA_REFINE_ASTRAY;
    }
    return noise > 0.2 * contrast || fabs(p[EDGE_ARC]) > ARC_MOST ? TSUYA_REFINE_UNLIKE : TSUYA_REFINE_FINE;
}

void tsuya_edge_fit(tsuya_edge *edge, const tsuya_image *grey, const tsuya_edge *before, const tsuya_edge *after, double inner_px,
                    double outer_px, const tsuya_edge_code *code, const tsuya_edge_look *look, bool learn)
{
    tsuya_edge_pixels s;
    double blur = edge->p[EDGE_BLUR] > 0.0 ? edge->p[EDGE_BLUR] : 0.8;
    edge->p[EDGE_TONE] = look->gamma;
    edge->p[EDGE_SHARPENING] = look->sharpening;
    /* Between tag and code, and between tag and neighbour, only what one transition reaches. */
    double reach[2] = {fmin(fmax(inner_px - 2.2 * blur, 1.5), 3.0 * blur + 1.5), fmin(fmax(outer_px - 2.2 * blur, 1.5), 3.0 * blur + 1.5)};
    double margin = fmin(2.5 * blur + 0.7, 0.5 * edge->half_length_px);
    gather(&s, edge, grey, before, after, reach, margin);
    add_stray(s.stray, &s, edge, before, after, code, inner_px, blur);
    if (learn || look->sharpening != 0.0) {
        add_stray(s.stray_wide, &s, edge, before, after, code, inner_px, tsuya_edge_wide(blur));
    }
    edge->pixels = s.count;
    memset(edge->look_pull, 0, sizeof edge->look_pull);
    memset(edge->look_information, 0, sizeof edge->look_information);
    if (s.count < FEWEST_PIXELS || !start(edge->p, &s, blur)) {
        edge->reason = TSUYA_REFINE_OUTSIDE;
        return;
    }
    tsuya_edge_normal last;
    double variance = 0.0, contrast = fabs(tsuya_edge_value(edge->p[EDGE_WHITE], look->gamma) - tsuya_edge_value(edge->p[EDGE_BLACK], look->gamma));
    bool fine = iterate(edge, &s, &last, &variance, ARC_NONE, learn);
    if (fine && wants_arc(&last, edge, variance)) { /* where noise does not tell it, it only adds to that: bow and arc look alike */
        fine = iterate(edge, &s, &last, &variance, ARC_SIGMA, learn);
    }
    if (!fine) {
        edge->reason = TSUYA_REFINE_UNLIKE;
        return;
    }
    edge->residual = sqrt(variance);
    edge->reason = judge(edge, edge->residual, contrast);
    keep_covariance(edge, &last, variance);
    if (learn) {
        keep_look(edge, &last, variance);
    }
}
