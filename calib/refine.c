#include "calib/refine.h"

#include "calib/planar.h"
#include "calib/refine_edge.h"

#include <stdlib.h>
#include <string.h>

enum { TONE_TAGS = 20, TONE_ROUNDS = 6, MOST_PASSES = 3 };

/* Steeper than TONE_MOST is no camera's curve but sharpening, the colour filter's interpolation for one, which an edge shows alike. */
static const double SRGB_TONE = 2.2, TONE_MOST = 2.8;

typedef struct quad { tsuya_edge edge[4]; tsuya_edge_code code; } quad;
typedef struct tag_code { int cells, border_bits; } tag_code;

static double depth_between(const tsuya_edge *edge, tsuya_vec2 p)
{
    return (p.x - edge->middle.x) * edge->inward.x + (p.y - edge->middle.y) * edge->inward.y;
}

/* The blur of an earlier fit stays as the next one's start. */
static void place(quad *q, const tsuya_vec2 corner[4])
{
    for (int i = 0; i < 4; i++) {
        double blur = q->edge[i].p[EDGE_BLUR];
        tsuya_edge_place(&q->edge[i], corner[i], corner[(i + 1) % 4]);
        q->edge[i].p[EDGE_BLUR] = blur;
    }
}

/* Mean depth of a cell behind edge i. */
static double cell_px(const quad *q, int i, int cells) { return depth_between(&q->edge[i], q->edge[(i + 2) % 4].middle) / cells; }

static double grey_at(const tsuya_image *grey, tsuya_vec2 p)
{
    const double x = fmin(fmax(p.x, 0.0), grey->width_px - 1.0), y = fmin(fmax(p.y, 0.0), grey->height_px - 1.0);
    return (double)*tsuya_image_f32(grey, (int)(x + 0.5), (int)(y + 0.5));
}

typedef struct level { double sum, least, most; int count; } level;

static void add_level(level *l, double v)
{
    l->least = l->count > 0 ? fmin(l->least, v) : v;
    l->most = l->count > 0 ? fmax(l->most, v) : v;
    l->sum += v;
    l->count++;
}

/* Greys of the cells' middles, and of the border and of what is around the tag. */
static void sample_cells(double value[EDGE_MOST_CELLS][EDGE_MOST_CELLS], level *border, level *around, tsuya_mat3 px_from_cells, const tsuya_image *grey,
                         const tag_code *code)
{
    const int end = code->cells - code->border_bits;
    for (int y = -1; y <= code->cells; y++) {
        for (int x = -1; x <= code->cells; x++) {
            const double v = grey_at(grey, tsuya_homography_apply(px_from_cells, (tsuya_vec2){x + 0.5, y + 0.5}));
            const bool beside = x < 0 || x == code->cells, above = y < 0 || y == code->cells;
            if (beside || above) {
                if (beside != above) { /* some grids have black squares at their corners */
                    add_level(around, v);
                }
                continue;
            }
            value[y][x] = v;
            if (x < code->border_bits || y < code->border_bits || x >= end || y >= end) {
                add_level(border, v);
            }
        }
    }
}

/* Reads the code from the middles of its cells, where they are small beside the blur and what is around the tag is even: cells like that,
 * white but for families with a white border, send their light into the border. */
static void read_code(quad *q, const tsuya_vec2 corner[4], const tsuya_image *grey, const tag_code *code)
{
    const double n = code->cells;
    const tsuya_vec2 plane[4] = {{0, 0}, {n, 0}, {n, n}, {0, n}};
    double value[EDGE_MOST_CELLS][EDGE_MOST_CELLS];
    level border = {0}, around = {0};
    tsuya_mat3 h;
    bool narrow = false;
    for (int i = 0; i < 4; i++) {
        narrow = narrow || tsuya_edge_is_narrow(code->border_bits * cell_px(q, i, code->cells), fmax(q->edge[i].p[EDGE_BLUR], 0.8));
    }
    q->code = (tsuya_edge_code){.cells = code->cells, .border = code->border_bits};
    if (!narrow || code->cells > EDGE_MOST_CELLS || !tsuya_homography_fit(&h, plane, corner, 4) || !tsuya_homography_fit(&q->code.cells_from_px, corner, plane, 4)) {
        return;
    }
    sample_cells(value, &border, &around, h, grey, code);
    const double dark = border.sum / border.count, light = around.sum / around.count;
    for (int k = 0; k < code->cells * code->cells; k++) {
        const double v = value[k / code->cells][k % code->cells];
        q->code.white[k / code->cells][k % code->cells] = fabs(v - light) < fabs(v - dark);
    }
    q->code.read = around.most - around.least < 0.5 * fabs(light - dark);
}

static void fit_edge(quad *q, int i, const tsuya_image *grey, const tag_code *code, double tone, bool learn)
{
    const double cell = cell_px(q, i, code->cells);
    tsuya_edge_fit(&q->edge[i], grey, &q->edge[(i + 3) % 4], &q->edge[(i + 1) % 4], code->border_bits * cell, cell, &q->code, tone, learn);
}

static void fit_quad(quad *q, const tsuya_image *grey, const tag_code *code, double tone, bool learn)
{
    for (int i = 0; i < 4; i++) {
        fit_edge(q, i, grey, code, tone, learn);
    }
}

/* Where two neighbouring curves meet (Newton), and how their errors move that point. */
static bool meet(tsuya_vec2 *corner, double *sigma_px, const tsuya_edge *in, const tsuya_edge *out)
{
    double u = 1.0, v = -1.0;
    tsuya_vec2 a, b, da, db;
    for (int i = 0; i < 6; i++) {
        a = tsuya_edge_point(in, u, &da);
        b = tsuya_edge_point(out, v, &db);
        double ex = b.x - a.x, ey = b.y - a.y, determinant = -da.x * db.y + db.x * da.y;
        if (fabs(determinant) < 1e-6 * in->half_length_px * out->half_length_px) {
            return false;
        }
        u += (-ex * db.y + ey * db.x) / determinant;
        v += (da.x * ey - da.y * ex) / determinant;
    }
    if (!(fabs(u - 1.0) < 0.5) || !(fabs(v + 1.0) < 0.5)) {
        return false;
    }
    *corner = tsuya_edge_point(in, u, &da);
    double g[2][3] = {{1.0, u, u * u - 1.0 / 3.0}, {1.0, v, v * v - 1.0 / 3.0}}, variance[2] = {0};
    for (int i = 0; i < 3; i++) {
        for (int k = 0; k < 3; k++) {
            variance[0] += g[0][i] * in->covariance[i][k] * g[0][k];
            variance[1] += g[1][i] * out->covariance[i][k] * g[1][k];
        }
    }
    double sine = in->inward.x * out->inward.y - in->inward.y * out->inward.x;
    *sigma_px = sqrt(0.5 * (variance[0] + variance[1])) / fmax(fabs(sine), 1e-6);
    return isfinite(*sigma_px);
}

/* Corners of the fitted curves; false where an edge failed, and the corner is left as it was. */
static bool corner_of(tsuya_vec2 *corner, double *sigma_px, const quad *q, int i)
{
    const tsuya_edge *in = &q->edge[(i + 3) % 4], *out = &q->edge[i];
    *sigma_px = INFINITY;
    return in->reason == TSUYA_REFINE_FINE && out->reason == TSUYA_REFINE_FINE && meet(corner, sigma_px, in, out);
}

/* The corners of the last fit; how far the farthest went. */
static double follow(tsuya_vec2 corner[4], const quad *q)
{
    double farthest = 0.0, sigma_px;
    for (int i = 0; i < 4; i++) {
        tsuya_vec2 old = corner[i];
        (void)corner_of(&corner[i], &sigma_px, q, i);
        farthest = fmax(farthest, hypot(corner[i].x - old.x, corner[i].y - old.y));
    }
    return farthest;
}

/* Fits until the strips lie where the edges are and are as wide as the blur asks. */
static void settle(quad *q, tsuya_vec2 corner[4], const tsuya_image *grey, const tag_code *code, double tone, bool learn)
{
    for (int pass = 0; pass < MOST_PASSES; pass++) {
        double blur[4], change = 0.0;
        for (int i = 0; i < 4; i++) {
            blur[i] = q->edge[i].p[EDGE_BLUR];
        }
        place(q, corner);
        read_code(q, corner, grey, code);
        fit_quad(q, grey, code, tone, learn);
        for (int i = 0; i < 4; i++) {
            change = q->edge[i].reason == TSUYA_REFINE_FINE ? fmax(change, fabs(q->edge[i].p[EDGE_BLUR] / blur[i] - 1.0)) : change;
        }
        const bool close = q->code.read; /* light from the code wants blur and corners as they are */
        if (follow(corner, q) < (close ? 0.1 : 0.75) && change < (close ? 0.05 : 0.3)) {
            return;
        }
    }
}

static void start_blur(quad *q, double blur_px)
{
    for (int i = 0; i < 4; i++) {
        q->edge[i].p[EDGE_BLUR] = blur_px;
    }
}

/* Edges that move outwards by their blur: n·δ = s for both normals. */
static tsuya_vec2 spread_of(const quad *q, int i)
{
    const tsuya_edge *a = &q->edge[(i + 3) % 4], *b = &q->edge[i];
    double sine = a->inward.x * b->inward.y - a->inward.y * b->inward.x, ra = -a->p[EDGE_BLUR], rb = -b->p[EDGE_BLUR];
    return fabs(sine) < 0.05 ? (tsuya_vec2){0, 0} : (tsuya_vec2){(ra * b->inward.y - rb * a->inward.y) / sine, (a->inward.x * rb - b->inward.x * ra) / sine};
}

static void refine_tag(tsuya_refined_tag *tag, const tsuya_tag_sighting *sighting, const tsuya_image *grey, const tag_code *code, double tone,
                       double blur_px)
{
    quad q = {0};
    memcpy(tag->corner_px, sighting->corner_px, sizeof tag->corner_px);
    start_blur(&q, blur_px);
    settle(&q, tag->corner_px, grey, code, tone, false);
    for (int i = 0; i < 4; i++) {
        if (!corner_of(&tag->corner_px[i], &tag->sigma_px[i], &q, i)) {
            tag->sigma_px[i] = INFINITY;
        }
        tag->spread_px[i] = spread_of(&q, i);
        tag->edge[i] = q.edge[i].reason;
        tag->blur_px[i] = q.edge[i].reason == TSUYA_REFINE_FINE ? q.edge[i].p[EDGE_BLUR] : NAN;
    }
}

/* One joint step of the tone over the edges of some tags; edges that ask for more than four of their own sigmas beside the
 * mean count with that much. */
static double tone_step(double *sigma, const quad *q, int count, double most_blur_px)
{
    double step = 0.0, weight = 0.0;
    for (int pass = 0; pass < 3; pass++) {
        double sum = 0.0;
        weight = 0.0;
        for (int i = 0; i < 4 * count; i++) {
            const tsuya_edge *e = &q[i / 4].edge[i % 4];
            if (e->reason == TSUYA_REFINE_FINE && isfinite(e->tone_variance) && e->p[EDGE_BLUR] <= most_blur_px) {
                double w = 1.0 / (e->tone_variance + 1e-4), away = fabs(e->tone_step - step) * sqrt(w);
                w = pass == 0 || away < 4.0 ? w : w * 4.0 / away;
                weight += w;
                sum += w * e->tone_step;
            }
        }
        step = weight > 0.0 ? sum / weight : 0.0;
    }
    *sigma = weight > 0.0 ? 1.0 / sqrt(weight) : INFINITY;
    return step;
}

static int compare_numbers(const void *pa, const void *pb)
{
    const double *a = pa, *b = pb;
    return (*a > *b) - (*a < *b);
}

/* Of the sharper edges: the lower quartile of the blurs. */
static double sharp_blur(const quad *q, int count)
{
    double blur[4 * TONE_TAGS];
    int n = 0;
    for (int i = 0; i < 4 * count; i++) {
        if (q[i / 4].edge[i % 4].reason == TSUYA_REFINE_FINE) {
            blur[n++] = q[i / 4].edge[i % 4].p[EDGE_BLUR];
        }
    }
    if (n == 0) {
        return 0.8;
    }
    qsort(blur, (size_t)n, sizeof *blur, compare_numbers);
    return blur[n / 4];
}

tsuya_refine_tone tsuya_refine_estimate_tone(const tsuya_image *grey, const tsuya_tag_sighting *sighting, int count, int cells, int border_bits)
{
    quad q[TONE_TAGS];
    tag_code code = {cells, border_bits};
    tsuya_vec2 corner[TONE_TAGS][4];
    tsuya_refine_tone tone = {1.0, INFINITY, 0.8};
    int used = count < TONE_TAGS ? count : TONE_TAGS;
    memset(q, 0, sizeof q);
    for (int t = 0; t < used; t++) {
        memcpy(corner[t], sighting[(size_t)t * (size_t)count / (size_t)used].corner_px, sizeof corner[t]);
        start_blur(&q[t], 0.8);
    }
    if (grey->encoding == TSUYA_ENCODING_SRGB) {
        tone.gamma = SRGB_TONE; /* near by; the rounds go on from there */
    }
    for (int round = 0; round < TONE_ROUNDS; round++) {
#pragma omp parallel for schedule(static)
        for (int t = 0; t < used; t++) {
            settle(&q[t], corner[t], grey, &code, tone.gamma, true);
        }
        tone.blur_px = sharp_blur(q, used);
        double step = tone_step(&tone.sigma, q, used, 1.3 * tone.blur_px);
        tone.gamma = fmin(fmax(tone.gamma + step, 0.4), 4.0);
        if (fabs(step) < 0.2 * tone.sigma || fabs(step) < 1e-3) {
            break;
        }
    }
    return tone;
}

static int compare_tones(const void *pa, const void *pb)
{
    return compare_numbers(&((const tsuya_refine_tone *)pa)->gamma, &((const tsuya_refine_tone *)pb)->gamma);
}

double tsuya_refine_common_tone(tsuya_refine_tone *tone, int count)
{
    double weight = 0.0, half = 0.0, gamma = 1.0;
    qsort(tone, (size_t)count, sizeof *tone, compare_tones);
    for (int i = 0; i < count; i++) {
        weight += isfinite(tone[i].sigma) ? 1.0 / (tone[i].sigma * tone[i].sigma + 0.0025) : 0.0;
    }
    for (int i = 0; i < count && half < 0.5 * weight; i++) {
        half += isfinite(tone[i].sigma) ? 1.0 / (tone[i].sigma * tone[i].sigma + 0.0025) : 0.0;
        gamma = tone[i].gamma;
    }
    /* In-camera sharpening is no tone curve; photographs that disagree say so. */
    double spread = count > 2 ? tone[count - 1 - count / 6].gamma - tone[count / 6].gamma : 0.0;
    const bool told = weight > 0.0 && spread < 0.6 && fabs(gamma - 1.0) > 3.0 / sqrt(weight) && gamma <= TONE_MOST;
    return told ? gamma : gamma > 0.5 * (1.0 + SRGB_TONE) ? SRGB_TONE : 1.0;
}

static void count_reasons(tsuya_refine_info *info, const tsuya_refined_tag *tag, int count)
{
    for (int t = 0; t < count; t++) {
        for (int i = 0; i < 4; i++) {
            info->failed[tag[t].edge[i]]++;
            info->edges++;
        }
    }
}

tsuya_status tsuya_refine_tags(tsuya_refined_tag *refined, tsuya_refine_info *info, const tsuya_image *grey,
                               const tsuya_tag_sighting *sighting, int count, const tsuya_refine_options *options)
{
    tag_code code = {options->cells, options->border_bits};
    *info = (tsuya_refine_info){0};
    if (grey->channels != 1 || grey->sample != TSUYA_SAMPLE_F32) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "corner refinement: a grey image of floats is expected");
    }
#pragma omp parallel for schedule(static)
    for (int t = 0; t < count; t++) {
        refine_tag(&refined[t], &sighting[t], grey, &code, options->gamma, options->blur_px);
    }
    count_reasons(info, refined, count);
    return TSUYA_OK;
}

const char *tsuya_refine_reason_text(tsuya_refine_reason reason)
{
    static const char *const text[] = {"fine", "too small, or at the image's edge", "too little contrast", "edge not where the tag was seen",
                                       "does not look like an edge"};
    return text[reason];
}
