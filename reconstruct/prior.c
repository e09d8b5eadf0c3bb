#include "reconstruct/prior.h"

#include "core/memory.h"
#include "core/order.h"
#include "reconstruct/prior_spline.h"

#include <string.h>

tsuya_prior_options tsuya_prior_options_default(void)
{
    return (tsuya_prior_options){.min_gap_px = 16, .least_rim = 0.5, .max_parting = 1.0, .max_edge = 0.05f};
}

enum {
    LEAST_BAND_PX = 12, MOST_BAND_PX = 160, /* of reliable pixels around a gap */
    CELLS_ACROSS = 8,                       /* a gap's width */
    LEAST_CELL_PX = 4,
    REWEIGHTINGS = 3,
    LOWER_ORDER = 3,
    WINDOW_PX = 5,
    ISLAND = 1, MAIN = 2,
};
static const double CONTINUOUS_GSD = 4.0; /* neighbours of one surface */
static const double RESIDUAL_GSD = 1.0;   /* at which a reliable pixel counts a quarter */
static const double MOST_BEND = 2.0;      /* of a gap against its band */
static const float GREY_MARGIN = 0.05f;   /* beyond what the band shows */
static const float LEAST_SLOPE = 0.0872f; /* cosine of the steepest view, 85 degrees */
/* What the coefficients' differences weigh against one pixel's depth: errors of 0.1 ground sample distances that are alike
 * over a window of 8 × 8 pixels, against third differences of 1 and fourth ones of 0.3 a cell. */
static const double STIFFNESS[2] = {0.01 * 64.0, 0.01 * 64.0 / 0.09};

typedef struct picture {
    const tsuya_prior_problem *problem;
    const tsuya_prior_options *options;
    const tsuya_stereo_level *level;
    int width_px, height_px;
    float *w, *wx, *wy; /* of the map; w 0: open */
    uint8_t *shut;      /* open pixels that no gap may contain: outside the mask, or on a strong edge */
    int32_t *gap;       /* number of the gap, −1 none */
} picture;

typedef struct gap {
    size_t first, count;              /* pixels, in the picture's list */
    size_t rim, outline;              /* links to reliable pixels, and all */
    int left, top, right, bottom, thickness;
} gap;

static float grey_at(const tsuya_stereo_level *l, int x, int y)
{
    return l->grey[(ptrdiff_t)(y + TSUYA_STEREO_PAD) * l->stride + x + TSUYA_STEREO_PAD];
}

/* ---- the picture ---- */

static void picture_free(picture *p)
{
    tsuya_free(p->w);
    tsuya_free(p->wx);
    tsuya_free(p->wy);
    tsuya_free(p->shut);
    tsuya_free(p->gap);
}

static void set_plane(picture *p, size_t at, int x, int y)
{
    const tsuya_stereo_level *l = p->level;
    const tsuya_depth_map *map = p->problem->map;
    const size_t pixels = (size_t)p->width_px * (size_t)p->height_px;
    const double rx = (x - l->cx_px) / l->fx_px, ry = (y - l->cy_px) / l->fy_px, depth = map->depth[at];
    const double nx = map->normal[at], ny = map->normal[pixels + at], facing = nx * rx + ny * ry + map->normal[2 * pixels + at];
    if (depth > 0.0 && fabs(facing) > 1e-6) {
        p->w[at] = (float)(1.0 / depth);
        p->wx[at] = (float)(nx / (depth * facing * l->fx_px));
        p->wy[at] = (float)(ny / (depth * facing * l->fy_px));
    }
}

static tsuya_status picture_create(picture *p, const tsuya_prior_problem *problem, const tsuya_prior_options *options,
                                   const tsuya_context *context)
{
    const tsuya_stereo_level *l = &problem->reference->level[0];
    const size_t pixels = (size_t)l->width_px * (size_t)l->height_px;
    tsuya_status status = TSUYA_OK;
    *p = (picture){.problem = problem, .options = options, .level = l, .width_px = l->width_px, .height_px = l->height_px};
    TSUYA_NEW(status, p->w, pixels);
    TSUYA_NEW(status, p->wx, pixels);
    TSUYA_NEW(status, p->wy, pixels);
    TSUYA_NEW(status, p->shut, pixels);
    TSUYA_NEW(status, p->gap, pixels);
#pragma omp parallel for schedule(static) num_threads(context->threads)
    for (int y = 0; y < p->height_px; y++) {
        for (int x = 0; x < p->width_px; x++) {
            const size_t at = (size_t)y * (size_t)p->width_px + (size_t)x;
            float edge = fmaxf(fabsf(grey_at(l, x + 1, y) - grey_at(l, x - 1, y)), fabsf(grey_at(l, x, y + 1) - grey_at(l, x, y - 1)));
            set_plane(p, at, x, y);
            p->shut[at] = (problem->mask && !problem->mask[at]) || edge > options->max_edge;
            p->gap[at] = -1;
        }
    }
done:
    return status;
}

/* Neighbours whose planes meet. */
static bool continuous(const picture *p, size_t a, size_t b, int dx, int dy)
{
    const float ahead = p->w[a] + p->wx[a] * (float)dx + p->wy[a] * (float)dy, back = p->w[b] - p->wx[b] * (float)dx - p->wy[b] * (float)dy;
    const float limit = (float)(CONTINUOUS_GSD / p->level->fx_px) * p->w[a];
    return p->w[b] > 0.0f && fminf(fabsf(ahead - p->w[b]), fabsf(back - p->w[a])) <= limit;
}

/* ---- gaps ---- */

static const int step[4][2] = {{-1, 0}, {1, 0}, {0, -1}, {0, 1}};

static bool neighbour(size_t *next, const picture *p, size_t at, int k)
{
    const int x = (int)(at % (size_t)p->width_px) + step[k][0], y = (int)(at / (size_t)p->width_px) + step[k][1];
    *next = (size_t)y * (size_t)p->width_px + (size_t)x;
    return x >= 0 && y >= 0 && x < p->width_px && y < p->height_px;
}

static bool is_open(const picture *p, size_t at) { return !(p->w[at] > 0.0f) && !p->shut[at]; }

/* Fills `list` from its entry `first` with the gap that holds `seed`. */
static gap grow_gap(picture *p, size_t *list, size_t first, size_t seed, int32_t number)
{
    gap g = {.first = first, .left = p->width_px, .top = p->height_px};
    list[first + g.count++] = seed;
    p->gap[seed] = number;
    for (size_t done = 0; done < g.count; done++) {
        const size_t at = list[first + done];
        const int x = (int)(at % (size_t)p->width_px), y = (int)(at / (size_t)p->width_px);
        g.left = x < g.left ? x : g.left, g.right = x > g.right ? x : g.right;
        g.top = y < g.top ? y : g.top, g.bottom = y > g.bottom ? y : g.bottom;
        for (int k = 0; k < 4; k++) {
            size_t next;
            bool inside = neighbour(&next, p, at, k);
            if (inside && is_open(p, next)) {
                if (p->gap[next] < 0) {
                    p->gap[next] = number;
                    list[first + g.count++] = next;
                }
                continue;
            }
            g.outline++;
            g.rim += inside && p->w[next] > 0.0f;
        }
    }
    return g;
}

/* ---- one gap ---- */

typedef struct window {
    const picture *p;
    const gap *g;
    int left, top, width, height, band;
    uint16_t *far; /* steps from the gap's outline, inside it and in the band around it; 0: neither */
    uint8_t *part;   /* of the band: ISLAND or MAIN */
    size_t *queue, queued;
    prior_sample *sample;
    double *full_weight, *first_weight, unit; /* 1 over the squared ground sample distance, times `unit`; islands begin with 0 */
    float *grey;     /* of the band, a window away from the gap */
    float *bend, *band_bend;
    size_t sample_count, grey_count, bend_count;
    prior_spline spline[2];
} window;

static size_t window_at(const window *w, size_t at)
{
    const size_t width = (size_t)w->p->width_px;
    return (at / width - (size_t)w->top) * (size_t)w->width + at % width - (size_t)w->left;
}

static bool in_window(const window *w, size_t at)
{
    const int x = (int)(at % (size_t)w->p->width_px) - w->left, y = (int)(at / (size_t)w->p->width_px) - w->top;
    return x >= 0 && y >= 0 && x < w->width && y < w->height;
}

/* Most steps from the outline to a pixel inside. */
static int depth_of_gap(window *w, const size_t *list, int32_t number)
{
    const picture *p = w->p;
    uint16_t most = 1;
    w->queued = 0;
    for (size_t i = 0; i < w->g->count; i++) {
        const size_t at = list[w->g->first + i];
        bool outer = false;
        for (int k = 0; k < 4; k++) {
            size_t next;
            outer |= neighbour(&next, p, at, k) && p->gap[next] != number;
        }
        if (outer) {
            w->far[window_at(w, at)] = 1;
            w->queue[w->queued++] = at;
        }
    }
    for (size_t done = 0; done < w->queued; done++) {
        const uint16_t here = w->far[window_at(w, w->queue[done])];
        most = here;
        for (int k = 0; k < 4; k++) {
            size_t next;
            if (neighbour(&next, p, w->queue[done], k) && p->gap[next] == number && !w->far[window_at(w, next)] && here < UINT16_MAX) {
                w->far[window_at(w, next)] = (uint16_t)(here + 1);
                w->queue[w->queued++] = next;
            }
        }
    }
    return most;
}

/* The reliable pixels around, as far as surfaces go on, up to the band's width; `far` counts the steps. */
static void collect_band(window *w, const size_t *list, int32_t number)
{
    const picture *p = w->p;
    memset(w->far, 0, (size_t)w->width * (size_t)w->height * sizeof *w->far);
    w->queued = 0;
    for (size_t i = 0; i < w->g->count; i++) {
        for (int k = 0; k < 4; k++) {
            size_t next;
            if (neighbour(&next, p, list[w->g->first + i], k) && p->gap[next] != number && p->w[next] > 0.0f && in_window(w, next) &&
                !w->far[window_at(w, next)]) {
                w->far[window_at(w, next)] = 1;
                w->queue[w->queued++] = next;
            }
        }
    }
    for (size_t done = 0; done < w->queued; done++) {
        const size_t at = w->queue[done];
        const uint16_t here = w->far[window_at(w, at)];
        for (int k = 0; k < 4 && here < w->band; k++) {
            size_t next;
            if (neighbour(&next, p, at, k) && in_window(w, next) && p->w[next] > 0.0f && !w->far[window_at(w, next)] &&
                continuous(p, at, next, step[k][0], step[k][1])) {
                w->far[window_at(w, next)] = (uint16_t)(here + 1);
                w->queue[w->queued++] = next;
            }
        }
    }
}

/* Tells the parts of the band apart: ISLAND has less than a quarter of the gap's pixels.  `queue` behind the band's own
 * entries serves as stack. */
static void weigh_parts(window *w)
{
    const picture *p = w->p;
    size_t *stack = w->queue + w->queued;
    for (size_t i = 0; i < w->queued; i++) {
        if (w->part[window_at(w, w->queue[i])]) {
            continue;
        }
        size_t count = 0;
        stack[count++] = w->queue[i];
        w->part[window_at(w, w->queue[i])] = ISLAND;
        for (size_t done = 0; done < count; done++) {
            for (int k = 0; k < 4; k++) {
                size_t next;
                if (neighbour(&next, p, stack[done], k) && in_window(w, next) && w->far[window_at(w, next)] && !w->part[window_at(w, next)] &&
                    continuous(p, stack[done], next, step[k][0], step[k][1])) {
                    w->part[window_at(w, next)] = ISLAND;
                    stack[count++] = next;
                }
            }
        }
        for (size_t k = 0; k < count && 4 * count >= w->g->count; k++) {
            w->part[window_at(w, stack[k])] = MAIN;
        }
    }
}

/* A lattice of them, four a cell each way, is enough; the first counts `lattice`² times. */
static void set_samples(window *w, double cell_px)
{
    const picture *p = w->p;
    const int lattice = cell_px >= 8.0 ? (int)(cell_px / 4.0) : 1;
    for (size_t i = 0; i < w->queued; i++) {
        const size_t at = w->queue[i];
        const int x = (int)(at % (size_t)p->width_px), y = (int)(at / (size_t)p->width_px);
        const double gsd = p->w[at] / p->level->fx_px;
        if (x % lattice == 0 && y % lattice == 0) {
            const size_t n = w->sample_count++;
            w->sample[n] = (prior_sample){(float)x, (float)y, p->w[at], 0.0f};
            w->full_weight[n] = (double)(lattice * lattice) / (gsd * gsd);
            w->first_weight[n] = w->part[window_at(w, at)] == MAIN ? w->full_weight[n] : 0.0;
        }
        /* Nearer, windows reach over outlines: depth there may be that of what stands before. */
        if (w->far[window_at(w, at)] > WINDOW_PX) {
            w->grey[w->grey_count++] = grey_at(p->level, x, y);
        }
    }
    w->unit = (double)(lattice * lattice);
}

/* Least squares with weights that fall off with the residual (Geman and McClure). */
static tsuya_status fit(window *w, bool *solved, int which)
{
    prior_sample *sample = w->sample;
    const double per_gsd2 = w->full_weight[w->sample_count / 2] / w->unit;
    for (size_t i = 0; i < w->sample_count; i++) {
        sample[i].weight = (float)w->first_weight[i];
    }
    for (int turn = 0; turn < REWEIGHTINGS; turn++) {
        TSUYA_TRY(tsuya_prior_spline_fit(&w->spline[which], solved, sample, w->sample_count, LOWER_ORDER + which, STIFFNESS[which] * per_gsd2));
        for (size_t i = 0; i < w->sample_count && *solved; i++) {
            double off = tsuya_prior_spline_at(&w->spline[which], sample[i].x_px, sample[i].y_px).value - (double)sample[i].value, r2 = off * off * w->full_weight[i] / (w->unit * RESIDUAL_GSD * RESIDUAL_GSD);
            sample[i].weight = (float)(w->full_weight[i] / ((1.0 + r2) * (1.0 + r2)));
        }
        if (!*solved) {
            break;
        }
    }
    return TSUYA_OK;
}

/* Half a cell around, so that surfaces which merely cross do not count as the same. */
static double parting_of(const prior_place *a, const prior_place *b, double cell_px)
{
    return fabs(a->value - b->value) + 0.5 * cell_px * hypot(a->slope[0] - b->slope[0], a->slope[1] - b->slope[1]);
}

/* Writes the pixels that both surfaces agree on; their bends go to `w->bend`. */
static void accept(tsuya_depth_map *prior, window *w, const size_t *list)
{
    const picture *p = w->p;
    const tsuya_stereo_level *l = p->level;
    const size_t pixels = (size_t)p->width_px * (size_t)p->height_px, n = w->grey_count;
    tsuya_sort_floats(w->grey, n);
    const float dark = w->grey[n / 20] - GREY_MARGIN, light = w->grey[n - 1 - n / 20] + GREY_MARGIN;
    for (size_t i = 0; i < w->g->count; i++) {
        const size_t at = list[w->g->first + i];
        const int x = (int)(at % (size_t)p->width_px), y = (int)(at / (size_t)p->width_px);
        const prior_place lower = tsuya_prior_spline_at(&w->spline[0], x, y), v = tsuya_prior_spline_at(&w->spline[1], x, y);
        const double parting = parting_of(&lower, &v, w->spline[1].cell_px) * l->fx_px / v.value;
        const float grey = grey_at(l, x, y);
        const double rx = (x - l->cx_px) / l->fx_px, ry = (y - l->cy_px) / l->fy_px;
        const double nx = v.slope[0] * l->fx_px, ny = v.slope[1] * l->fy_px, nz = v.value - nx * rx - ny * ry;
        const double norm = sqrt(nx * nx + ny * ny + nz * nz), facing = v.value / (norm * sqrt(rx * rx + ry * ry + 1.0));
        if (v.value * p->problem->depth_max >= 1.0 && v.value * p->problem->depth_min <= 1.0 && parting <= p->options->max_parting &&
            facing >= LEAST_SLOPE && grey >= dark && grey <= light) {
            prior->depth[at] = (float)(1.0 / v.value);
            prior->normal[at] = (float)(-nx / norm);
            prior->normal[pixels + at] = (float)(-ny / norm);
            prior->normal[2 * pixels + at] = (float)(-nz / norm);
            prior->cost[at] = (float)parting;
            w->bend[w->bend_count++] = (float)(v.bend * l->fx_px / v.value);
        }
    }
}

/* Ground sample distances a square pixel, of the reliable band at a share of it. */
static float bend_of_band(window *w, double share)
{
    size_t count = 0;
    for (size_t i = 0; i < w->sample_count; i++) {
        if (w->first_weight[i] > 0.0) {
            const prior_place v = tsuya_prior_spline_at(&w->spline[1], w->sample[i].x_px, w->sample[i].y_px);
            w->band_bend[count++] = (float)(v.bend * w->p->level->fx_px / v.value);
        }
    }
    tsuya_sort_floats(w->band_bend, count);
    return count ? w->band_bend[(size_t)(share * (double)(count - 1))] : 0.0f;
}

/* Cloth that bends far more in the gap than all around it is an invention, as over a ledge: all of it is opened again. */
static void open_overbent(tsuya_depth_map *prior, window *w, const size_t *list, int thickness)
{
    const size_t pixels = (size_t)w->p->width_px * (size_t)w->p->height_px;
    const double half = 0.5 * thickness, harmless = 2.0 / (half * half); /* a ground sample distance over half the gap */
    if (w->bend_count == 0) {
        return;
    }
    tsuya_sort_floats(w->bend, w->bend_count);
    const double bend = w->bend[(size_t)(0.9 * (double)(w->bend_count - 1))];
    if (bend <= fmax(harmless, MOST_BEND * (double)bend_of_band(w, 0.9))) {
        return;
    }
    for (size_t i = 0; i < w->g->count; i++) {
        const size_t at = list[w->g->first + i];
        prior->depth[at] = prior->normal[at] = prior->normal[pixels + at] = prior->normal[2 * pixels + at] = prior->cost[at] = 0.0f;
    }
}

static void window_free(window *w)
{
    void *memory[] = {w->far, w->part, w->queue, w->sample, w->full_weight, w->first_weight, w->grey, w->bend, w->band_bend};
    for (size_t i = 0; i < sizeof memory / sizeof *memory; i++) {
        tsuya_free(memory[i]);
    }
    tsuya_prior_spline_free(&w->spline[0]);
    tsuya_prior_spline_free(&w->spline[1]);
}

static tsuya_status window_create(window *w, int margin)
{
    const picture *p = w->p;
    const gap *g = w->g;
    tsuya_status status = TSUYA_OK;
    w->left = g->left > margin ? g->left - margin : 0;
    w->top = g->top > margin ? g->top - margin : 0;
    w->width = (g->right + margin < p->width_px ? g->right + margin + 1 : p->width_px) - w->left;
    w->height = (g->bottom + margin < p->height_px ? g->bottom + margin + 1 : p->height_px) - w->top;
    w->band = margin;
    const size_t pixels = (size_t)w->width * (size_t)w->height;
    TSUYA_NEW(status, w->far, pixels);
    TSUYA_NEW(status, w->part, pixels);
    TSUYA_NEW(status, w->queue, 2 * pixels);
done:
    return status;
}

static tsuya_status fill_gap(tsuya_depth_map *prior, const picture *p, const gap *g, const size_t *list, int32_t number)
{
    window w = {.p = p, .g = g};
    bool solved = false;
    tsuya_status status = TSUYA_OK;
    TSUYA_GOTO_DONE(status, window_create(&w, 0));
    const int thickness = 2 * depth_of_gap(&w, list, number);
    window_free(&w);
    w = (window){.p = p, .g = g};
    int band = thickness < LEAST_BAND_PX ? LEAST_BAND_PX : thickness > MOST_BAND_PX ? MOST_BAND_PX : thickness;
    TSUYA_GOTO_DONE(status, window_create(&w, band));
    collect_band(&w, list, number);
    weigh_parts(&w);
    if (w.queued < LEAST_BAND_PX) {
        goto done;
    }
    TSUYA_NEW(status, w.sample, w.queued);
    TSUYA_NEW(status, w.full_weight, w.queued);
    TSUYA_NEW(status, w.first_weight, w.queued);
    TSUYA_NEW(status, w.grey, w.queued);
    TSUYA_NEW(status, w.band_bend, w.queued);
    TSUYA_NEW(status, w.bend, g->count);
    const double cell = fmax((double)thickness / CELLS_ACROSS, LEAST_CELL_PX);
    set_samples(&w, cell);
    if (w.sample_count < LEAST_BAND_PX || w.grey_count < LEAST_BAND_PX) {
        goto done;
    }
    for (int which = 0; which < 2; which++) {
        TSUYA_GOTO_DONE(status, tsuya_prior_spline_create(&w.spline[which], w.left, w.top, w.width, w.height, cell));
        TSUYA_GOTO_DONE(status, fit(&w, &solved, which));
        if (!solved) {
            goto done;
        }
    }
    accept(prior, &w, list);
    open_overbent(prior, &w, list, thickness);
done:
    window_free(&w);
    return status;
}

/* ---- all gaps ---- */

static tsuya_status find_gaps(gap **gaps, int32_t *gap_count, size_t *list, picture *p)
{
    const size_t pixels = (size_t)p->width_px * (size_t)p->height_px;
    size_t used = 0, capacity = 0;
    for (size_t at = 0; at < pixels; at++) {
        if (p->gap[at] >= 0 || !is_open(p, at)) {
            continue;
        }
        if ((size_t)*gap_count == capacity) {
            capacity = capacity ? 2 * capacity : 256;
            gap *grown = tsuya_realloc(*gaps, capacity, sizeof *grown);
            if (!grown) {
                return TSUYA_ERROR_MEMORY;
            }
            *gaps = grown;
        }
        gap g = grow_gap(p, list, used, at, *gap_count);
        used += g.count;
        (*gaps)[(*gap_count)++] = g;
    }
    return TSUYA_OK;
}

tsuya_status tsuya_prior(tsuya_depth_map *prior, const tsuya_prior_problem *problem, const tsuya_prior_options *options,
                         const tsuya_context *context)
{
    picture p = {0};
    size_t *list = NULL;
    gap *gaps = NULL;
    int32_t count = 0;
    tsuya_status status = TSUYA_OK;
    *prior = (tsuya_depth_map){0};
    TSUYA_GOTO_DONE(status, picture_create(&p, problem, options, context));
    TSUYA_NEW(status, list, (size_t)p.width_px * (size_t)p.height_px);
    TSUYA_GOTO_DONE(status, tsuya_depth_map_create(prior, p.width_px, p.height_px));
    TSUYA_GOTO_DONE(status, find_gaps(&gaps, &count, list, &p));
    bool short_of_memory = false;
#pragma omp parallel for schedule(dynamic, 1) num_threads(context->threads) reduction(|| : short_of_memory)
    for (int32_t i = 0; i < count; i++) {
        const gap *g = &gaps[i];
        if (g->count >= (size_t)options->min_gap_px && (double)g->rim >= options->least_rim * (double)g->outline && !tsuya_interrupted()) {
            short_of_memory = fill_gap(prior, &p, g, list, i) != TSUYA_OK || short_of_memory;
        }
    }
    status = short_of_memory ? TSUYA_ERROR_MEMORY : tsuya_check_interrupt();
done:
    picture_free(&p);
    tsuya_free(list);
    tsuya_free(gaps);
    if (status != TSUYA_OK) {
        tsuya_depth_map_free(prior);
    }
    return status;
}

void tsuya_prior_drop_contradicted(tsuya_depth_map *prior, const tsuya_stereo_image *reference, const tsuya_stereo_image *other,
                                   const float *other_depth, const tsuya_context *context)
{
    const tsuya_stereo_level *r = &reference->level[0], *o = &other->level[0];
    const tsuya_pose relative = tsuya_pose_compose(other->camera_from_world, tsuya_pose_inverse(reference->camera_from_world));
#pragma omp parallel for schedule(static) num_threads(context->threads)
    for (int y = 0; y < prior->height_px; y++) {
        for (int x = 0; x < prior->width_px; x++) {
            const size_t at = (size_t)y * (size_t)prior->width_px + (size_t)x;
            const double depth = prior->depth[at];
            if (!(depth > 0.0)) {
                continue;
            }
            tsuya_vec3 ray = {(x - r->cx_px) / r->fx_px, (y - r->cy_px) / r->fy_px, 1.0};
            tsuya_vec3 q = tsuya_pose_apply(relative, tsuya_vec3_scale(ray, depth));
            const double u = q.x / q.z * o->fx_px + o->cx_px + 0.5, v = q.y / q.z * o->fy_px + o->cy_px + 0.5;
            if (!(q.z > 0.0 && u >= 0.0 && v >= 0.0 && u < o->width_px && v < o->height_px)) {
                continue;
            }
            const double there = other_depth[(size_t)v * (size_t)o->width_px + (size_t)u];
            if (there > 0.0 && there - q.z > CONTINUOUS_GSD * there / o->fx_px) {
                prior->depth[at] = 0.0f;
                prior->normal[at] = prior->normal[(size_t)prior->width_px * (size_t)prior->height_px + at] =
                    prior->normal[2 * (size_t)prior->width_px * (size_t)prior->height_px + at] = 0.0f;
            }
        }
    }
}
