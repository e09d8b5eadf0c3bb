/* Who stands out of a session by brightness or colour: out of pairs whose truth is known. */
#include "support.h"

#include "capture/check_photo.h"

#include <math.h>

enum { COUNT = 24, REACH = 3, GREEN = 1, BLUE = 2 };

typedef struct session {
    tsuya_check check;
    tsuya_checked_photo photo[COUNT];
    tsuya_check_relation relation[COUNT * COUNT];
    double light[COUNT][3];
} session;

/* A chain: each photograph shares surface with the three before and after it; shine spreads each pair's patches by `spread` and moves its
 * median by a part of that. */
static session *chain(double wander_ev, double spread_ev)
{
    session *s = calloc(1, sizeof *s);
    assert_non_null(s);
    s->check = (tsuya_check){.photo = s->photo, .count = COUNT};
    for (int i = 0; i < COUNT; i++) {
        s->light[i][GREEN] = wander_ev * tsuya_random_normal(1, 1, (uint64_t)i);
        s->photo[i].neighbours = REACH;
    }
    for (int k = 0; k < COUNT * COUNT; k++) {
        s->relation[k].spread[0] = s->relation[k].spread[GREEN] = s->relation[k].spread[BLUE] = spread_ev;
    }
    return s;
}

static void relate_and_judge(session *s)
{
    tsuya_check_options options = tsuya_check_options_default();
    for (int i = 0; i < COUNT; i++) {
        for (int j = i + 1; j < COUNT && j <= i + REACH; j++) {
            tsuya_check_relation *r = &s->relation[i * COUNT + j], *back = &s->relation[j * COUNT + i];
            r->used = r->known = true;
            r->shared = 60;
            for (int c = 0; c < 3; c++) {
                r->ratio[c] = s->light[i][c] - s->light[j][c] + 0.5 * r->spread[c] * tsuya_random_normal(2, (uint64_t)c, (uint64_t)(i * COUNT + j));
            }
            *back = *r;
            for (int c = 0; c < 3; c++) {
                back->ratio[c] = -r->ratio[c];
            }
        }
    }
    assert_ok(tsuya_check_light(&s->check, s->relation, &options));
}

static bool stands_out(const session *s, int i, int which) { return fabs(s->photo[i].apart_ev[which]) > s->check.limit_ev[which]; }

static void assert_named(const session *s, int which, int only)
{
    for (int i = 0; i < COUNT; i++) {
        if (stands_out(s, i, which) != (i == only)) {
            fail_msg("photograph %d: %.2f EV apart, limit %.2f", i, s->photo[i].apart_ev[which], s->check.limit_ev[which]);
        }
    }
}

static void one_dark_and_one_blue_photograph_are_named(void **state)
{
    (void)state;
    session *s = chain(0.05, 0.3);
    s->light[7][GREEN] -= 1.0;
    s->light[15][BLUE] += 0.45;
    relate_and_judge(s);
    assert_named(s, GREEN, 7);
    assert_named(s, BLUE, 15);
    assert_true(fabs(s->photo[7].exposure_ev + 1.0) < 0.3 && fabs(s->photo[15].blue_ev - 0.45) < 0.2);
    assert_true(s->check.wander_ev < 0.5);
    free(s);
}

/* Light that fades, or a chain whose ends differ by much, makes no photograph stand out; the session's wandering is said. */
static void a_slow_drift_names_nobody(void **state)
{
    (void)state;
    session *s = chain(0.0, 0.2);
    for (int i = 0; i < COUNT; i++) {
        s->light[i][GREEN] = -0.12 * i;
    }
    relate_and_judge(s);
    assert_named(s, GREEN, -1);
    assert_true(s->check.wander_ev > 1.5);
    free(s);
}

/* A camera that measures light itself: EXIF explains its steps; one that EXIF does not tell of is still named. */
static void exposures_that_are_told_are_taken_off(void **state)
{
    (void)state;
    session *s = chain(0.0, 0.1);
    for (int i = 0; i < COUNT; i++) {
        double told = 0.25 * (i * 7 % 5 - 2); /* within half a step of the session */
        s->photo[i].photo = (tsuya_photo){.exposure_s = 0.01 * exp2(told), .f_number = 8.0, .iso = 100.0};
        s->light[i][GREEN] = told;
    }
    s->light[11][GREEN] -= 0.9;
    relate_and_judge(s);
    assert_named(s, GREEN, 11);
    for (int i = 0; i < COUNT; i++) {
        assert_true(s->photo[i].told_ev == 0.0);
    }
    /* Set two steps darker by hand: EXIF tells it, the pixels confirm it. */
    s->light[11][GREEN] += 0.9;
    s->light[4][GREEN] -= 2.0;
    s->photo[4].photo.exposure_s *= 0.25;
    relate_and_judge(s);
    assert_named(s, GREEN, -1);
    for (int i = 0; i < COUNT; i++) {
        assert_true((s->photo[i].told_ev != 0.0) == (i == 4));
    }
    assert_true(s->photo[4].told_ev < -1.5);
    free(s);
}

/* A session that wanders by itself raises its own limit. */
static void a_restless_session_widens_the_limit(void **state)
{
    (void)state;
    session *calm = chain(0.02, 0.1), *restless = chain(0.5, 0.1);
    relate_and_judge(calm);
    relate_and_judge(restless);
    assert_true(calm->check.limit_ev[GREEN] == tsuya_check_options_default().exposure_ev);
    assert_true(restless->check.limit_ev[GREEN] > 1.0);
    free(calm);
    free(restless);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(one_dark_and_one_blue_photograph_are_named), cmocka_unit_test(a_slow_drift_names_nobody),
        cmocka_unit_test(exposures_that_are_told_are_taken_off),      cmocka_unit_test(a_restless_session_widens_the_limit),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
