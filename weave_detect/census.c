#include "weave_detect/census.h"

#include "core/memory.h"

#include <math.h>

enum { BINS = 64, SPREAD = 1 };            /* SPREAD bins to both sides count as the same */
static const double BIN = 0.075;           /* of ln period: threads pack closer and wider by as much over a garment */
static const double SHARE = 0.25;          /* of the commonest pair's surface, from which a pair is believed as it stands */

typedef struct census {
    double *sum;  /* BINS × BINS: surface that votes for (finer, coarser) */
    double start; /* ln period of the first bin's lower end */
} census;

static int bin_of(const census *c, float period)
{
    double at = period > 0.0f ? (log((double)period) - c->start) / BIN : -1.0;
    return at >= 0.0 && at < BINS ? (int)at : -1;
}

static bool place_of(int place[2], const census *c, const tsuya_vote *v)
{
    bool swap = v->period_a > v->period_b;
    place[0] = bin_of(c, swap ? v->period_b : v->period_a);
    place[1] = bin_of(c, swap ? v->period_a : v->period_b);
    return place[0] >= 0 && place[1] >= 0;
}

/* The range is set about the mean of ln period, so that it fits any unit. */
static void set_range(census *c, const tsuya_votes *votes)
{
    double sum = 0.0, weight = 0.0;
    for (size_t v = 0; v < votes->vertex_count; v++) {
        for (int k = 0; k < votes->count[v]; k++) {
            const tsuya_vote *vote = &votes->vote[v * TSUYA_VOTES + (size_t)k];
            if (vote->confidence > 0.0f && vote->period_a > 0.0f && vote->period_b > 0.0f) {
                double w = (double)vote->confidence * (double)vote->weight;
                sum += w * 0.5 * log((double)vote->period_a * (double)vote->period_b);
                weight += w;
            }
        }
    }
    c->start = (weight > 0.0 ? sum / weight : 0.0) - 0.5 * BINS * BIN;
}

static void count(census *c, const tsuya_votes *votes, const float *area)
{
    for (size_t v = 0; v < votes->vertex_count; v++) {
        double all = 1e-30;
        for (int k = 0; k < votes->count[v]; k++) {
            all += (double)votes->vote[v * TSUYA_VOTES + (size_t)k].weight;
        }
        for (int k = 0; k < votes->count[v]; k++) {
            const tsuya_vote *vote = &votes->vote[v * TSUYA_VOTES + (size_t)k];
            int place[2];
            if (vote->confidence > 0.0f && place_of(place, c, vote)) {
                c->sum[place[0] * BINS + place[1]] += (double)area[v] * (double)vote->weight * (double)vote->confidence / all;
            }
        }
    }
}

static double around(const census *c, int row, int column)
{
    double sum = 0.0;
    for (int j = row - SPREAD; j <= row + SPREAD; j++) {
        for (int i = column - SPREAD; i <= column + SPREAD; i++) {
            sum += i >= 0 && j >= 0 && i < BINS && j < BINS ? c->sum[j * BINS + i] : 0.0;
        }
    }
    return sum;
}

static void doubt(tsuya_votes *votes, const census *c)
{
    double most = 0.0;
    for (int i = 0; i < BINS * BINS; i++) {
        most = fmax(most, around(c, i / BINS, i % BINS));
    }
    for (size_t v = 0; most > 0.0 && v < votes->vertex_count; v++) {
        for (int k = 0; k < votes->count[v]; k++) {
            tsuya_vote *vote = &votes->vote[v * TSUYA_VOTES + (size_t)k];
            int place[2];
            double held = vote->confidence > 0.0f && place_of(place, c, vote) ? around(c, place[0], place[1]) / most : 0.0;
            double odds = fmin(held / SHARE, 1.0), p = (double)vote->confidence;
            vote->confidence = (float)(p * odds / (p * odds + 1.0 - p + 1e-12));
        }
    }
}

tsuya_status tsuya_census_apply(tsuya_votes *votes, const float *area)
{
    tsuya_status status = TSUYA_OK;
    census c = {0};
    TSUYA_NEW(status, c.sum, (size_t)BINS * BINS);
    set_range(&c, votes);
    count(&c, votes, area);
    doubt(votes, &c);
done:
    tsuya_free(c.sum);
    return status;
}
