#include "weave_detect/evidence.h"

#include <math.h>

static const double AGREE_RAD = 6.0 * M_PI / 180.0;
static const double CHANCE = 0.2; /* confidence below which a cross does not hold the field: it is wrong more often than the places around */

/* 0: the families match as they stand; 1: swapped; −1: they do not match. */
static int pairing(const tsuya_vote *v, const tsuya_vote *w)
{
    double aa = tsuya_line_difference((double)v->a_rad, (double)w->a_rad), bb = tsuya_line_difference((double)v->b_rad, (double)w->b_rad);
    double ab = tsuya_line_difference((double)v->a_rad, (double)w->b_rad), ba = tsuya_line_difference((double)v->b_rad, (double)w->a_rad);
    if (fmax(aa, bb) <= fmax(ab, ba)) {
        return fmax(aa, bb) < AGREE_RAD ? 0 : -1;
    }
    return fmax(ab, ba) < AGREE_RAD ? 1 : -1;
}

static double strength(const tsuya_vote *v) { return (double)v->weight * (double)v->confidence; }

/* The vote that the others support most, and how much of all the strength that is. */
static int best_supported(double *share, const tsuya_vote *vote, int count)
{
    double best = 0.0, all = 0.0;
    int index = -1;
    for (int i = 0; i < count; i++) {
        double support = 0.0;
        all += strength(&vote[i]);
        for (int j = 0; strength(&vote[i]) > 0.0 && j < count; j++) {
            support += pairing(&vote[i], &vote[j]) >= 0 ? strength(&vote[j]) : 0.0;
        }
        if (support > best) {
            best = support;
            index = i;
        }
    }
    *share = all > 0.0 ? best / all : 0.0;
    return index;
}

static void merge_flow(tsuya_evidence *e, const tsuya_vote *vote, int count)
{
    double re = 0.0, im = 0.0, all = 0.0;
    for (int i = 0; i < count; i++) {
        double w = (double)vote[i].weight, angle = 2.0 * (double)vote[i].flow_rad;
        re += w * (double)vote[i].flow_weight * cos(angle);
        im += w * (double)vote[i].flow_weight * sin(angle);
        all += w;
    }
    e->flow_rad = (float)tsuya_line_wrap(0.5 * atan2(im, re));
    e->flow_weight = all > 0.0 ? (float)(hypot(re, im) / all) : 0.0f;
}

void tsuya_evidence_merge(tsuya_evidence *e, const tsuya_vote *vote, int count)
{
    double share, a[2] = {0, 0}, b[2] = {0, 0}, period[2] = {0, 0}, sum = 0.0, disbelief = 1.0;
    int best = best_supported(&share, vote, count);
    *e = (tsuya_evidence){0};
    merge_flow(e, vote, count);
    if (best < 0) {
        return;
    }
    for (int i = 0; i < count; i++) {
        int swap = pairing(&vote[best], &vote[i]);
        if (swap < 0 || strength(&vote[i]) <= 0.0) {
            continue;
        }
        double sigma = fmax((double)vote[i].sigma_rad, 1e-3), w = strength(&vote[i]) / (sigma * sigma + 1e-5);
        double first = (double)(swap ? vote[i].b_rad : vote[i].a_rad), second = (double)(swap ? vote[i].a_rad : vote[i].b_rad);
        a[0] += w * cos(2.0 * first);
        a[1] += w * sin(2.0 * first);
        b[0] += w * cos(2.0 * second);
        b[1] += w * sin(2.0 * second);
        period[0] += w * (double)(swap ? vote[i].period_b : vote[i].period_a);
        period[1] += w * (double)(swap ? vote[i].period_a : vote[i].period_b);
        sum += w;
        disbelief = fmin(disbelief, 1.0 - (double)vote[i].confidence);
    }
    e->a_rad = (float)tsuya_line_wrap(0.5 * atan2(a[1], a[0]));
    e->b_rad = (float)tsuya_line_wrap(0.5 * atan2(b[1], b[0]));
    e->period_a = (float)(period[0] / sum);
    e->period_b = (float)(period[1] / sum);
    e->confidence = (float)((1.0 - disbelief) * share);
    double above = fmax((double)e->confidence - CHANCE, 0.0) / (1.0 - CHANCE);
    e->weight = (float)(above * above);
}
