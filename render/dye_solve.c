#include "render/dye_solve.h"

#include "core/image.h"
#include "core/memory.h"
#include "core/order.h"

#include <math.h>
#include <string.h>

enum { PLACES_MOST = 4000, GAIN_STEPS = 48, REFINE_STEPS = 40, TURNS = 5 };
/* Spread of a reading: of its own value, of the shine in it (the model of which is the least certain part), and of full scale. */
static const double OF_VALUE = 0.03, OF_SHINE = 0.15, OF_SCALE = 0.004, HUBER = 1.5;
static const double WHITE_BALANCE = 0.1; /* of the lamps' colours against what the camera recorded of them: relative, one sigma */

/* One reading of one place with the light that falls there. */
typedef struct term {
    double weight, value[3], surface[3], white[3];
} term;

static const tsuya_dye_look *find_look(const tsuya_dye_looks *looks, uint32_t vertex, uint32_t view)
{
    for (size_t k = looks->first[vertex]; k < looks->first[vertex + 1]; k++) {
        if (looks->look[k].view == view) {
            return &looks->look[k];
        }
    }
    return NULL;
}

static int terms_of(term list[TSUYA_DYE_READINGS], const tsuya_dye_problem *p, size_t v)
{
    int count = 0;
    for (int k = 0; k < TSUYA_DYE_READINGS; k++) {
        const tsuya_dye_reading *r = &p->reading[TSUYA_DYE_READINGS * v + (size_t)k];
        if (!(r->weight > 0.0f)) {
            continue;
        }
        term *t = &list[count++];
        *t = (term){.weight = (double)r->weight};
        for (int j = 0; j < 3; j++) {
            const tsuya_dye_look *look = find_look(p->looks, p->place[v].corner[j], r->view);
            double w = (double)p->place[v].weight[j];
            for (int c = 0; look && w > 0.0 && c < 3; c++) {
                t->surface[c] += w * (double)look->surface[c];
                t->white[c] += w * (double)look->white[c];
            }
        }
        for (int c = 0; c < 3; c++) {
            t->value[c] = (double)r->value[c];
        }
    }
    return count;
}

static double spread_of(const term *t, int c, double gain) { return OF_VALUE * t->value[c] + OF_SHINE * gain * t->surface[c] + OF_SCALE; }

/* Robust least squares for one channel; NaN where no light gets. */
static double solve_dye(const term *list, int count, int c, double gain)
{
    double dye = NAN;
    for (int turn = 0; turn < TURNS; turn++) {
        double top = 0.0, bottom = 0.0;
        for (int k = 0; k < count; k++) {
            const term *t = &list[k];
            double spread = spread_of(t, c, gain), white = gain * t->white[c], rest = t->value[c] - gain * t->surface[c];
            double off = turn > 0 ? fabs(rest - dye * white) / spread : 0.0, w = t->weight / (spread * spread) * (off > HUBER ? HUBER / off : 1.0);
            top += w * white * rest;
            bottom += w * white * white;
        }
        if (!(bottom > 0.0)) {
            return NAN;
        }
        dye = fmin(fmax(top / bottom, 0.0), 1.0);
    }
    return dye;
}

/* --- gain --- */

typedef struct sample {
    term list[TSUYA_DYE_READINGS];
    int count;
} sample;

/* Disagreement of the readings under a gain: Huber's loss of relative differences. */
static double disagreement(const sample *s, int count, int c, double gain)
{
    double sum = 0.0, weight = 0.0;
    for (int i = 0; i < count; i++) {
        double dye = solve_dye(s[i].list, s[i].count, c, gain);
        for (int k = 0; k < s[i].count && isfinite(dye); k++) {
            const term *t = &s[i].list[k];
            double off = fabs(t->value[c] - gain * (t->surface[c] + dye * t->white[c])) / (OF_VALUE * t->value[c] + OF_SCALE);
            sum += t->weight * (off > HUBER ? HUBER * (2.0 * off - HUBER) : off * off);
            weight += t->weight;
        }
    }
    return weight > 0.0 ? sum / weight : INFINITY;
}

/* Median of value / (S + B): the gain if every place were white; 0 where a channel is dark (a lamp or a dye without it): it tells no gain. */
static double white_gain(double ratio[PLACES_MOST], const sample *s, int count, int c)
{
    int n = 0;
    for (int i = 0; i < count; i++) {
        const term *t = &s[i].list[0];
        double light = t->surface[c] + t->white[c];
        if (light > 0.0) {
            ratio[n++] = t->value[c] / light;
        }
    }
    tsuya_sort_doubles(ratio, (size_t)n);
    return n > 0 ? ratio[n / 2] : 0.0;
}

/* What is minimised over the logarithm of a gain: a share of each channel's disagreement under its own best, and how far a channel may leave the others. */
typedef struct gain_search {
    const sample *list;
    int count, channel, channels; /* of channel and those after it */
    double best[3], looks;
    double common;                /* NaN: none is asked for */
} gain_search;

static double gain_cost(const gain_search *g, double at)
{
    double sum = 0.0, off = (at - g->common) / WHITE_BALANCE;
    for (int c = g->channel; c < g->channel + g->channels; c++) {
        sum += isinf(g->best[c]) ? 0.0 : 0.5 * g->looks * disagreement(g->list, g->count, c, exp(at)) / g->best[c];
    }
    return isnan(g->common) ? sum : sum + 0.5 * off * off;
}

static double golden_section(const gain_search *g, double a, double b)
{
    const double golden = 0.5 * (sqrt(5.0) - 1.0);
    for (int k = 0; k < REFINE_STEPS / 2; k++) {
        double x = b - golden * (b - a), y = a + golden * (b - a);
        if (gain_cost(g, x) < gain_cost(g, y)) {
            b = y;
        } else {
            a = x;
        }
    }
    return 0.5 * (a + b);
}

/* The lamps' colours are told as the camera records them, so one gain is sought for all channels, over a wide range in steps, then about
 * the best.  Each channel may leave it by what its photographs say against WHITE_BALANCE: errors of the model are alike all over a
 * photograph, so that there are as many independent readings as photographs.  A dark channel has the gain of the others.  white: see white_gain. */
static void find_gain(double gain[3], gain_search *g, const double white[3])
{
    double cost[GAIN_STEPS + 1] = {0}, least = INFINITY, step = log(300.0) / GAIN_STEPS;
    int at = 0;
    for (int c = 0; c < 3; c++) {
        least = white[c] > 0.0 ? fmin(least, white[c]) : least;
    }
    const double low = log(0.3 * least);
    for (int c = 0; c < 3; c++) {
        double own[GAIN_STEPS + 1];
        g->best[c] = INFINITY;
        if (!(white[c] > 0.0)) {
            continue;
        }
        for (int k = 0; k <= GAIN_STEPS; k++) {
            own[k] = disagreement(g->list, g->count, c, exp(low + k * step));
            g->best[c] = fmin(g->best[c], own[k]);
        }
        g->best[c] = fmax(g->best[c], 1e-9);
        for (int k = 0; k <= GAIN_STEPS && isfinite(g->best[c]); k++) {
            cost[k] += own[k] / g->best[c];
        }
    }
    for (int k = 1; k <= GAIN_STEPS; k++) {
        at = cost[k] < cost[at] ? k : at;
    }
    g->channel = 0;
    g->channels = 3;
    g->common = NAN;
    double common = golden_section(g, low + (at - 1) * step, low + (at + 1) * step);
    for (int c = 0; c < 3; c++) {
        g->channel = c;
        g->channels = 1;
        g->common = common;
        gain[c] = exp(golden_section(g, common - 5.0 * WHITE_BALANCE, common + 5.0 * WHITE_BALANCE));
    }
}

/* Places that many photographs see, evenly over the mesh. */
static int gather(sample *s, const tsuya_dye_problem *p)
{
    size_t step = p->fine->vertex_count / PLACES_MOST + 1;
    int count = 0;
    for (size_t v = 0; v < p->fine->vertex_count && count < PLACES_MOST; v += step) {
        s[count].count = terms_of(s[count].list, p, v);
        count += s[count].count >= 3;
    }
    return count;
}

static tsuya_status find_gains(tsuya_dye_info *info, const tsuya_dye_problem *p)
{
    tsuya_status status = TSUYA_OK;
    sample *s = NULL;
    double *ratio = NULL, white[3];
    TSUYA_NEW(status, s, PLACES_MOST);
    TSUYA_NEW(status, ratio, PLACES_MOST);
    int count = gather(s, p);
    for (int c = 0; c < 3; c++) {
        white[c] = white_gain(ratio, s, count, c);
    }
    gain_search search = {.list = s, .count = count, .looks = p->view_count};
    find_gain(info->gain, &search, white);
    if (isinf(fmin(search.best[0], fmin(search.best[1], search.best[2])))) {
        status = tsuya_fail(TSUYA_ERROR_INPUT, "dye: no place of the cloth is lit and seen by three photographs; dyes need some");
    }
done:
    tsuya_free(s);
    tsuya_free(ratio);
    return status;
}

/* --- dyes --- */

/* What dyes have of the mesh's own colours, by channel: over places that are seen. */
static void find_shares(double share[3], const tsuya_dye_problem *p, const uint8_t *told)
{
    for (size_t c = 0; c < 3; c++) {
        double top = 0.0, bottom = 0.0;
        for (size_t v = 0; v < p->fine->vertex_count; v++) {
            if (told[v]) {
                top += (double)tsuya_srgb_decode(p->fine->color[3 * v + c] / 255.0f);
                bottom += (double)tsuya_srgb_decode(p->own[3 * v + c] / 255.0f);
            }
        }
        share[c] = bottom > 0.0 ? top / bottom : 1.0;
    }
}

static void dye_place(const tsuya_dye_problem *p, const tsuya_dye_info *info, uint8_t *told, float *residual, size_t v)
{
    term list[TSUYA_DYE_READINGS];
    int count = terms_of(list, p, v);
    double dye[3], sum = 0.0;
    told[v] = count >= 2;
    for (int c = 0; c < 3; c++) {
        dye[c] = solve_dye(list, count, c, info->gain[c]);
        told[v] = told[v] && isfinite(dye[c]);
    }
    residual[v] = NAN;
    if (!told[v]) {
        return;
    }
    for (int c = 0; c < 3; c++) {
        for (int k = 0; k < count; k++) {
            double model = info->gain[c] * (list[k].surface[c] + dye[c] * list[k].white[c]);
            sum += fabs(list[k].value[c] / fmax(model, 1e-6) - 1.0) / (3 * count);
        }
        p->fine->color[3 * v + (size_t)c] = (uint8_t)lroundf(255.0f * tsuya_srgb_encode((float)dye[c]));
    }
    residual[v] = (float)sum;
}

static void finish(tsuya_dye_info *info, const tsuya_dye_problem *p, const uint8_t *told, float *residual)
{
    double share[3];
    size_t seen = 0, count = p->fine->vertex_count;
    find_shares(share, p, told);
    for (size_t v = 0; v < count; v++) {
        if (told[v]) {
            residual[seen++] = residual[v];
            continue;
        }
        for (size_t c = 0; c < 3; c++) {
            float linear = tsuya_srgb_decode(p->own[3 * v + c] / 255.0f) * (float)share[c];
            p->fine->color[3 * v + c] = (uint8_t)lroundf(255.0f * tsuya_srgb_encode(linear));
        }
    }
    info->seen = (double)seen / (double)count;
    info->residual = seen > 0 ? (double)tsuya_select_float(residual, seen, seen / 2) : (double)NAN;
}

tsuya_status tsuya_dye_solve(tsuya_dye_info *info, const tsuya_dye_problem *p, const tsuya_context *context)
{
    tsuya_status status;
    uint8_t *told = NULL;
    float *residual = NULL;
    TSUYA_GOTO_DONE(status, find_gains(info, p));
    TSUYA_NEW(status, told, p->fine->vertex_count);
    TSUYA_NEW(status, residual, p->fine->vertex_count);
#pragma omp parallel for schedule(static) num_threads(context->threads)
    for (size_t v = 0; v < p->fine->vertex_count; v++) {
        dye_place(p, info, told, residual, v);
    }
    finish(info, p, told, residual);
done:
    tsuya_free(told);
    tsuya_free(residual);
    return status;
}
