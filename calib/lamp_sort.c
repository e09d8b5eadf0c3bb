/* Several lamps at once: which highlight is whose. */
#include "calib/lamp_parts.h"

#include "core/memory.h"

#include <string.h>

enum { ROUNDS = 5 };

/* Highlights in groups of one ball in one photograph. */
typedef struct sorting {
    const tsuya_lamp_balls *balls;
    int lamps, groups;
    int *place; /* groups × lamps: which of the group's highlights is lamp k's */
} sorting;

/* The k-th order of n things. */
static void order_at(int order[TSUYA_LAMPS_MOST], int k, int n)
{
    int left[TSUYA_LAMPS_MOST] = {0, 1, 2, 3};
    for (int i = 0; i < n; i++) {
        int pick = k % (n - i);
        k /= n - i;
        order[i] = left[pick];
        memmove(left + pick, left + pick + 1, (size_t)(n - i - 1 - pick) * sizeof *left);
    }
}

/* The order of least cost, cost[i][k] that of highlight i as lamp k's; true where that is another than before. */
static bool settle(int *place, double (*cost)[TSUYA_LAMPS_MOST], int lamps)
{
    int order[TSUYA_LAMPS_MOST], best[TSUYA_LAMPS_MOST] = {0}, orders = 1;
    double least = INFINITY;
    for (int i = 2; i <= lamps; i++) {
        orders *= i;
    }
    for (int o = 0; o < orders; o++) {
        double sum = 0.0;
        order_at(order, o, lamps);
        for (int k = 0; k < lamps; k++) {
            sum += cost[order[k]][k];
        }
        if (sum < least) {
            least = sum;
            memcpy(best, order, sizeof best);
        }
    }
    bool other = memcmp(place, best, (size_t)lamps * sizeof *place) != 0;
    memcpy(place, best, (size_t)lamps * sizeof *place);
    return other;
}

/* By direction: the first group's are the lamps, each later group joins where it comes nearest to what came before. */
static void sort_by_direction(sorting *s)
{
    tsuya_vec3 sum[TSUYA_LAMPS_MOST] = {{0}};
    for (int g = 0; g < s->groups; g++) {
        double cost[TSUYA_LAMPS_MOST][TSUYA_LAMPS_MOST] = {{0.0}};
        tsuya_vec3 d[TSUYA_LAMPS_MOST];
        for (int i = 0; i < s->lamps; i++) {
            d[i] = tsuya_lamp_ball_mirrored(s->balls, &s->balls->highlight[g * s->lamps + i]);
            for (int k = 0; k < s->lamps; k++) {
                cost[i][k] = g == 0 ? i != k : 1.0 - tsuya_vec3_dot(d[i], tsuya_vec3_unit(sum[k]));
            }
        }
        (void)settle(s->place + g * s->lamps, cost, s->lamps);
        for (int k = 0; k < s->lamps; k++) {
            sum[k] = tsuya_vec3_add(sum[k], d[s->place[g * s->lamps + k]]);
        }
    }
}

/* One lamp's highlights, group by group. */
static void pick(tsuya_lamp_highlight *out, const sorting *s, int lamp)
{
    for (int g = 0; g < s->groups; g++) {
        out[g] = s->balls->highlight[g * s->lamps + s->place[g * s->lamps + lamp]];
    }
}

/* Squared misses of all highlights under one lamp's fit; false where it has none. */
static bool add_misses(double (*cost)[TSUYA_LAMPS_MOST], const sorting *s, int lamp, tsuya_lamp_highlight *own)
{
    static const double still[2 * TSUYA_LAMP_BALLS] = {0.0};
    tsuya_lamp_ball ball[TSUYA_LAMP_BALLS];
    tsuya_lamp found;
    tsuya_lamp_balls b = {ball, own, s->balls->balls, s->groups, s->balls->camera};
    memcpy(ball, s->balls->ball, (size_t)b.balls * sizeof *ball);
    pick(own, s, lamp);
    if (tsuya_lamp_ball_fit(&found, &b) != TSUYA_OK) {
        return false;
    }
    const tsuya_lamp_place place = {tsuya_vec3_mad(found.position_m, -found.distance_m, found.to_lamp), found.to_lamp, 1.0 / found.distance_m};
    for (int i = 0; i < s->groups * s->lamps; i++) {
        double e[2];
        bool seen = tsuya_lamp_ball_miss(e, &b, &s->balls->highlight[i], &place, still);
        cost[i][lamp] = seen ? e[0] * e[0] + e[1] * e[1] : 1e6;
    }
    return true;
}

/* By the fits; what has none is told by the caller's own fit. */
static void sort_by_fits(sorting *s, double (*cost)[TSUYA_LAMPS_MOST], tsuya_lamp_highlight *own)
{
    bool moved = true;
    for (int round = 0; moved && round < ROUNDS; round++) {
        for (int k = 0; k < s->lamps; k++) {
            if (!add_misses(cost, s, k, own)) {
                return;
            }
        }
        moved = false;
        for (int g = 0; g < s->groups; g++) {
            moved |= settle(s->place + g * s->lamps, cost + g * s->lamps, s->lamps);
        }
    }
}

tsuya_status tsuya_lamp_balls_sort(tsuya_lamp_balls *balls, int lamps)
{
    sorting s = {balls, lamps, balls->highlights / lamps, NULL};
    double(*cost)[TSUYA_LAMPS_MOST] = NULL;
    tsuya_lamp_highlight *sorted = NULL, *own = NULL;
    tsuya_status status = TSUYA_OK;
    TSUYA_NEW(status, s.place, (size_t)(s.groups * lamps) + 1);
    TSUYA_NEW(status, cost, (size_t)(s.groups * lamps) + 1);
    TSUYA_NEW(status, own, (size_t)s.groups + 1);
    TSUYA_NEW(status, sorted, (size_t)(s.groups * lamps) + 1);
    sort_by_direction(&s);
    sort_by_fits(&s, cost, own);
    for (int k = 0; k < lamps; k++) {
        pick(sorted + k * s.groups, &s, k);
    }
    memcpy(balls->highlight, sorted, (size_t)(s.groups * lamps) * sizeof *sorted);
done:
    tsuya_free(s.place);
    tsuya_free(cost);
    tsuya_free(own);
    tsuya_free(sorted);
    return status;
}
