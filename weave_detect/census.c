#include "weave_detect/census.h"

#include "core/memory.h"

#include <math.h>

enum { BINS = 64, SPREAD = 1 };            /* SPREAD bins to both sides count as the same */
static const double BIN = 0.075;           /* of ln period: threads pack closer and wider by as much over a garment */
static const double SHARE = 0.25;          /* of the commonest pair's surface, from which a pair is believed as it stands */

/* Threads are the finest that repeats on a cloth.  A count that others, finer in both periods by FINER bins and held by KNOWN of the
 * commonest pair's surface, are seen through in this share of its places is a print's. */
enum { FINER = 8 };
static const double KNOWN = 0.1, PRINT = 0.02;

typedef struct census {
    double *sum;  /* BINS × BINS: surface that votes for (finer, coarser) */
    double *print; /* the part of it where finer threads are seen as well */
    double most;  /* surface of the commonest pair */
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

static double around(const double *bins, int row, int column)
{
    double sum = 0.0;
    for (int j = row - SPREAD; j <= row + SPREAD; j++) {
        for (int i = column - SPREAD; i <= column + SPREAD; i++) {
            sum += i >= 0 && j >= 0 && i < BINS && j < BINS ? bins[j * BINS + i] : 0.0;
        }
    }
    return sum;
}

/* Whether one of a vertex' votes sees finer threads, known ones, than the pair at `place`. */
static bool sees_finer(const census *c, const tsuya_votes *votes, size_t v, const int place[2])
{
    for (int k = 0; k < votes->count[v]; k++) {
        const tsuya_vote *vote = &votes->vote[v * TSUYA_VOTES + (size_t)k];
        int own[2];
        if (vote->confidence > 0.0f && vote->weight > 0.0f && place_of(own, c, vote) && own[0] <= place[0] - FINER && own[1] <= place[1] - FINER &&
            around(c->sum, own[0], own[1]) >= KNOWN * c->most) {
            return true;
        }
    }
    return false;
}

/* Surface by pairs into `bins`: of all votes, or of those through which finer threads are seen. */
static void count(double *bins, const census *c, const tsuya_votes *votes, const float *area, bool prints)
{
    for (size_t v = 0; v < votes->vertex_count; v++) {
        double all = 1e-30;
        for (int k = 0; k < votes->count[v]; k++) {
            all += (double)votes->vote[v * TSUYA_VOTES + (size_t)k].weight;
        }
        for (int k = 0; k < votes->count[v]; k++) {
            const tsuya_vote *vote = &votes->vote[v * TSUYA_VOTES + (size_t)k];
            int place[2];
            if (vote->confidence > 0.0f && place_of(place, c, vote) && (!prints || sees_finer(c, votes, v, place))) {
                bins[place[0] * BINS + place[1]] += (double)area[v] * (double)vote->weight * (double)vote->confidence / all;
            }
        }
    }
}

/* Odds that the pair is a cloth's and no print's, by what is seen through it. */
static double cloth_odds(const census *c, int row, int column)
{
    double held = around(c->sum, row, column), print = held > 0.0 ? around(c->print, row, column) / held / PRINT : 0.0;
    return 1.0 / (1.0 + print * print);
}

static void doubt(tsuya_votes *votes, const census *c)
{
    double most = 0.0; /* surface of the commonest cloth */
    for (int i = 0; i < BINS * BINS; i++) {
        most = fmax(most, around(c->sum, i / BINS, i % BINS) * cloth_odds(c, i / BINS, i % BINS));
    }
    for (size_t v = 0; most > 0.0 && v < votes->vertex_count; v++) {
        for (int k = 0; k < votes->count[v]; k++) {
            tsuya_vote *vote = &votes->vote[v * TSUYA_VOTES + (size_t)k];
            int place[2];
            bool placed = vote->confidence > 0.0f && place_of(place, c, vote);
            double held = placed ? around(c->sum, place[0], place[1]) : 0.0, p = (double)vote->confidence;
            double odds = placed ? fmin(held / (SHARE * most), 1.0) * cloth_odds(c, place[0], place[1]) : 0.0;
            vote->confidence = (float)(p * odds / (p * odds + 1.0 - p + 1e-12));
        }
    }
}

tsuya_status tsuya_census_apply(tsuya_votes *votes, const float *area)
{
    tsuya_status status = TSUYA_OK;
    census c = {0};
    TSUYA_NEW(status, c.sum, (size_t)BINS * BINS);
    TSUYA_NEW(status, c.print, (size_t)BINS * BINS);
    set_range(&c, votes);
    count(c.sum, &c, votes, area, false);
    for (int i = 0; i < BINS * BINS; i++) {
        c.most = fmax(c.most, around(c.sum, i / BINS, i % BINS));
    }
    count(c.print, &c, votes, area, true);
    doubt(votes, &c);
done:
    tsuya_free(c.sum);
    tsuya_free(c.print);
    return status;
}
