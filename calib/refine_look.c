/* What a camera makes of an edge, learnt from edges of some tags together. */
#include "calib/refine_quad.h"

#include <stdlib.h>
#include <string.h>

enum { TONE_TAGS = 20, TONE_ROUNDS = 8 };

/* Steeper than TONE_MOST is no camera's curve; within TONE_NEAR of the other usual one than the file says, edges are believed. */
static const double SRGB_TONE = 2.4, TONE_MOST = 3.1, TONE_NEAR = 0.3;

/* Information and pull of what scatters by `scatter` (variances) besides: (1 + I F)⁻¹ I. */
static void loosen(double pull[2], double information[2][2], const tsuya_edge *e, const double scatter[2])
{
    const double(*const i)[2] = e->look_information;
    const double m[2][2] = {{1.0 + i[0][0] * scatter[0], i[0][1] * scatter[1]}, {i[1][0] * scatter[0], 1.0 + i[1][1] * scatter[1]}};
    const double determinant = m[0][0] * m[1][1] - m[0][1] * m[1][0];
    const double inverse[2][2] = {{m[1][1] / determinant, -m[0][1] / determinant}, {-m[1][0] / determinant, m[0][0] / determinant}};
    for (int a = 0; a < 2; a++) {
        pull[a] = inverse[a][0] * e->look_pull[0] + inverse[a][1] * e->look_pull[1];
        for (int b = 0; b < 2; b++) {
            information[a][b] = inverse[a][0] * i[0][b] + inverse[a][1] * i[1][b];
        }
    }
}

/* What is free: γ, c, or both. */
typedef enum freedom { FREE_TONE, FREE_SHARPENING, FREE_BOTH } freedom;

static bool solve_free(double x[2], const double h[2][2], const double g[2], freedom freely)
{
    const double determinant = h[0][0] * h[1][1] - h[0][1] * h[1][0];
    x[0] = freely == FREE_TONE && h[0][0] > 0.0 ? g[0] / h[0][0] : 0.0;
    x[1] = freely == FREE_SHARPENING && h[1][1] > 0.0 ? g[1] / h[1][1] : 0.0;
    if (freely == FREE_BOTH && determinant > 1e-12 * h[0][0] * h[1][1]) {
        x[0] = (h[1][1] * g[0] - h[0][1] * g[1]) / determinant;
        x[1] = (h[0][0] * g[1] - h[1][0] * g[0]) / determinant;
    }
    return h[0][0] > 0.0 && determinant > 0.0;
}

/* Of one edge: γ and c scatter by so much beside what its pixels tell.  What is believed of c beforehand, and its ends. */
static const double GAMMA_FLOOR = 0.01, SHARPENING_FLOOR = 0.03, SHARPENING_PRIOR = 0.5, SHARPENING_LEAST = -0.3, SHARPENING_MOST = 3.0;

/* One joint step over the edges of some tags, and its normal equations; edges that ask for more than four of their own sigmas beside the
 * rest count with that much. */
static bool look_step(double step[2], double h[2][2], const tsuya_edge_quad *q, int count, double sharpening, double most_blur_px, freedom freely)
{
    const double prior = 1.0 / (SHARPENING_PRIOR * SHARPENING_PRIOR);
    const double scatter[2] = {GAMMA_FLOOR * GAMMA_FLOOR, freely == FREE_TONE ? 0.0 : SHARPENING_FLOOR * SHARPENING_FLOOR};
    bool known = true;
    step[0] = step[1] = 0.0;
    for (int pass = 0; pass < 3 && known; pass++) {
        double g[2] = {0.0, -prior * sharpening};
        memset(h, 0, 4 * sizeof h[0][0]);
        h[1][1] = prior;
        for (int i = 0; i < 4 * count; i++) {
            const tsuya_edge *e = &q[i / 4].edge[i % 4];
            double pull[2], information[2][2], left[2], off[2], w = 1.0;
            if (e->reason != TSUYA_REFINE_FINE || e->p[EDGE_BLUR] > most_blur_px || !(e->look_information[0][0] > 0.0)) {
                continue;
            }
            loosen(pull, information, e, scatter);
            for (int a = 0; a < 2; a++) {
                left[a] = pull[a] - information[a][0] * step[0] - information[a][1] * step[1];
            }
            if (pass > 0 && solve_free(off, (const double(*)[2])information, left, freely)) {
                const double away = sqrt(fmax(left[0] * off[0] + left[1] * off[1], 0.0));
                w = away > 4.0 ? 4.0 / away : 1.0;
            }
            for (int a = 0; a < 2; a++) {
                g[a] += w * pull[a];
                h[a][0] += w * information[a][0];
                h[a][1] += w * information[a][1];
            }
        }
        known = solve_free(step, (const double(*)[2])h, g, freely);
    }
    return known;
}

static int compare_numbers(const void *pa, const void *pb)
{
    const double *a = pa, *b = pb;
    return (*a > *b) - (*a < *b);
}

/* Of the sharper edges: the lower quartile of the blurs. */
static double sharp_blur(const tsuya_edge_quad *q, int count)
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

static double usual_tone(double gamma) { return gamma > 0.5 * (1.0 + SRGB_TONE) ? SRGB_TONE : 1.0; }

static double limited(double step, double most) { return fmin(fmax(step, -most), most); }
static const double GAMMA_STEP = 0.7, SHARPENING_STEP = 0.5; /* at most, in a round */

typedef struct lesson { tsuya_edge_quad q[TONE_TAGS]; tsuya_vec2 corner[TONE_TAGS][4]; int count; } lesson;

/* Tags spread over the photograph's. */
static void begin_lesson(lesson *l, const tsuya_tag_sighting *sighting, int count)
{
    memset(l, 0, sizeof *l);
    l->count = count < TONE_TAGS ? count : TONE_TAGS;
    for (int t = 0; t < l->count; t++) {
        memcpy(l->corner[t], sighting[(size_t)t * (size_t)count / (size_t)l->count].corner_px, sizeof l->corner[t]);
        tsuya_edge_quad_start(&l->q[t], 0.8);
    }
}

/* Rounds of fits and joint steps, from the look as it stands.  False where nothing is learnt; else the sigmas of what is free. */
static bool learn(tsuya_edge_look *look, double sigma[2], double *blur_px, lesson *l, const tsuya_image *grey, const tsuya_edge_grid *grid, freedom freely)
{
    for (int round = 0; round < TONE_ROUNDS; round++) {
        double step[2], h[2][2];
#pragma omp parallel for schedule(static)
        for (int t = 0; t < l->count; t++) {
            tsuya_edge_quad_settle(&l->q[t], l->corner[t], grey, grid, look, true);
        }
        *blur_px = sharp_blur(l->q, l->count);
        if (!look_step(step, h, l->q, l->count, look->sharpening, 1.3 * *blur_px, freely)) {
            return false;
        }
        look->gamma = fmin(fmax(look->gamma + limited(step[0], GAMMA_STEP), 0.4), 4.0);
        look->sharpening = fmin(fmax(look->sharpening + limited(step[1], SHARPENING_STEP), SHARPENING_LEAST), SHARPENING_MOST);
        const double shared = freely == FREE_BOTH ? 1.0 - h[0][1] * h[1][0] / (h[0][0] * h[1][1]) : 1.0;
        sigma[0] = 1.0 / sqrt(h[0][0] * shared);
        sigma[1] = 1.0 / sqrt(h[1][1] * shared);
        if (fabs(step[0]) < fmax(0.2 * sigma[0], 1e-3) && fabs(step[1]) < fmax(0.2 * sigma[1], 0.01)) {
            break;
        }
    }
    return true;
}

tsuya_refine_tone tsuya_refine_estimate_tone(const tsuya_image *grey, const tsuya_tag_sighting *sighting, int count, int cells, int border_bits)
{
    lesson l;
    tsuya_edge_grid grid = {cells, border_bits};
    tsuya_refine_tone tone = TSUYA_REFINE_TONE_UNKNOWN;
    double sigma[2], blur_px;
    begin_lesson(&l, sighting, count);
    const double said = grey->encoding == TSUYA_ENCODING_SRGB ? SRGB_TONE : 1.0, other = 1.0 + SRGB_TONE - said;
    tsuya_edge_look look = {said, 0.0}; /* near by; the rounds go on from there */
    if (learn(&look, sigma, &tone.blur_px, &l, grey, &grid, FREE_TONE)) {
        tone.gamma = look.gamma;
        tone.sigma = sigma[0];
    }
    look.gamma = said;
    begin_lesson(&l, sighting, count);
    if (learn(&look, sigma, &blur_px, &l, grey, &grid, FREE_BOTH)) {
        look.gamma = tone.usual = fabs(look.gamma - other) < TONE_NEAR ? other : said;
        if (learn(&look, sigma, &blur_px, &l, grey, &grid, FREE_SHARPENING)) {
            tone.sharpening = look.sharpening;
            tone.sharpening_sigma = sigma[1];
        }
    }
    return tone;
}

static int compare_tones(const void *pa, const void *pb)
{
    return compare_numbers(&((const tsuya_refine_tone *)pa)->gamma, &((const tsuya_refine_tone *)pb)->gamma);
}

static double common_gamma(tsuya_refine_tone *tone, int count)
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
    const double spread = count > 2 ? tone[count - 1 - count / 6].gamma - tone[count / 6].gamma : 0.0;
    const bool told = weight > 0.0 && spread < 0.6 && fabs(gamma - 1.0) > 3.0 / sqrt(weight) && gamma <= TONE_MOST;
    return told ? gamma : usual_tone(gamma);
}

static int compare_sharpenings(const void *pa, const void *pb)
{
    return compare_numbers(&((const tsuya_refine_tone *)pa)->sharpening, &((const tsuya_refine_tone *)pb)->sharpening);
}

/* Photographs that agree within SHARPENING_AGREED and by SHARPENING_CERTAIN sigmas show at least SHARPENING_TOLD.  More than SHARPENING_USED
 * takes off no more of the edges' displacement (0.25 to 0.5 do), but lets more of the mosaic's noise in. */
static const double SHARPENING_AGREED = 0.35, SHARPENING_CERTAIN = 4.0, SHARPENING_TOLD = 0.2, SHARPENING_USED = 0.4;

tsuya_edge_look tsuya_refine_common_look(tsuya_refine_tone *tone, int count)
{
    int known = 0;
    for (int i = 0; i < count; i++) {
        if (isfinite(tone[i].sharpening_sigma)) {
            const tsuya_refine_tone own = tone[i];
            tone[i] = tone[known];
            tone[known++] = own;
        }
    }
    qsort(tone, (size_t)known, sizeof *tone, compare_sharpenings);
    const tsuya_refine_tone *middle = &tone[known / 2];
    if (2 * known > count && tone[known - 1 - known / 6].sharpening - tone[known / 6].sharpening < SHARPENING_AGREED &&
        middle->sharpening > fmax(SHARPENING_TOLD, SHARPENING_CERTAIN * middle->sharpening_sigma)) {
        return (tsuya_edge_look){middle->usual, fmin(middle->sharpening, SHARPENING_USED)};
    }
    return (tsuya_edge_look){common_gamma(tone, count), 0.0};
}
