/* Which of the votes' thread counts are a cloth's. */
#include "support.h"

#include "weave_detect/census.h"

enum { VERTICES = 400 };

typedef struct sheet {
    tsuya_votes votes;
    tsuya_vote vote[VERTICES * TSUYA_VOTES];
    uint8_t count[VERTICES];
    float area[VERTICES];
} sheet;

static void clear(sheet *s)
{
    *s = (sheet){.votes = {.vertex_count = VERTICES, .vote = s->vote, .count = s->count}};
    for (int v = 0; v < VERTICES; v++) {
        s->area[v] = 1.0f;
    }
}

static void add(sheet *s, int v, double period, double confidence)
{
    s->vote[v * TSUYA_VOTES + s->count[v]++] =
        (tsuya_vote){.period_a = (float)period, .period_b = (float)(1.1 * period), .confidence = (float)confidence, .weight = 0.8f, .sigma_rad = 0.01f};
}

static float belief(const sheet *s, int v, int k) { return s->vote[v * TSUYA_VOTES + k].confidence; }

/* A lattice of 6 mm that every photograph sees, threads of 0.8 mm that close-ups of a quarter of the cloth see. */
static void a_print_falls_where_threads_are_seen_through_it(void **state)
{
    (void)state;
    static sheet s;
    clear(&s);
    for (int v = 0; v < VERTICES; v++) {
        add(&s, v, 6e-3, 0.9);
        if (v < VERTICES / 4) {
            add(&s, v, 8e-4, 0.9);
        }
    }
    assert_ok(tsuya_census_apply(&s.votes, s.area));
    for (int v = 0; v < VERTICES; v++) {
        assert_true(belief(&s, v, 0) < 0.2f);
        assert_true(v >= VERTICES / 4 || belief(&s, v, 1) > 0.85f);
    }
}

/* Two cloths side by side, one of 3 mm and one of 0.8 mm: both stay, the seam's few vertices included. */
static void a_coarse_cloth_beside_a_fine_one_stays(void **state)
{
    (void)state;
    static sheet s;
    clear(&s);
    for (int v = 0; v < VERTICES; v++) {
        bool coarse = v < VERTICES / 2, seam = v == VERTICES / 2 || v == VERTICES / 2 - 1;
        add(&s, v, coarse ? 3e-3 : 8e-4, 0.9);
        if (seam) {
            add(&s, v, coarse ? 8e-4 : 3e-3, 0.9);
        }
    }
    assert_ok(tsuya_census_apply(&s.votes, s.area));
    for (int v = 0; v < VERTICES; v++) {
        assert_true(belief(&s, v, 0) > 0.85f);
    }
}

/* Few false votes finer than the threads (a sensor's pattern, say) do not count; nor does their absence. */
static void a_few_finer_votes_mean_nothing(void **state)
{
    (void)state;
    static sheet s;
    clear(&s);
    for (int v = 0; v < VERTICES; v++) {
        add(&s, v, 2e-3, 0.9);
        if (v % 50 == 0) {
            add(&s, v, 4e-4, 0.6);
        }
    }
    assert_ok(tsuya_census_apply(&s.votes, s.area));
    for (int v = 0; v < VERTICES; v++) {
        assert_true(belief(&s, v, 0) > 0.85f);
        assert_true(v % 50 != 0 || belief(&s, v, 1) < 0.2f);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_print_falls_where_threads_are_seen_through_it),
        cmocka_unit_test(a_coarse_cloth_beside_a_fine_one_stays),
        cmocka_unit_test(a_few_finer_votes_mean_nothing),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
