/* The test against chance: its closed form, wrong matches under the best of many geometries, right ones among wrong ones. */
#include "tests/support.h"

#include "core/context.h"
#include "core/match_chance.h"
#include "reconstruct/verify.h"

enum { WIDTH = 800, HEIGHT = 600, GEOMETRIES = 20000, SETS = 8 };
static const double OFF_PX = 4.0, FOCAL_PX = 1000.0, MOST = -6.0;

static double draw(uint64_t stream, uint64_t k) { return tsuya_random_uniform(77, stream, k); }

static void test_closed_form(void **state)
{
    (void)state;
    assert_near(tsuya_match_false_alarms(8, 8, 0.1), log10(8.0 * 0.1), 1e-12);
    /* 3 C(10, 9) C(9, 7) 0.01^2 */
    assert_near(tsuya_match_false_alarms(10, 9, 0.01), log10(3.0 * 10.0 * 36.0 * 1e-4), 1e-12);
    assert_true(tsuya_match_false_alarms(100, 7, 0.01) == 0.0 && tsuya_match_false_alarms(0, 0, 0.01) == 0.0);
    assert_true(isfinite(tsuya_match_false_alarms(100000, 90000, 1e-12)));
    assert_near(tsuya_match_false_alarms(5, 20, 0.5), tsuya_match_false_alarms(20, 20, 0.5), 0.0); /* guided matches exceed the free ones */
}

static void test_share_of_a_line(void **state)
{
    (void)state;
    tsuya_sift_position corner[] = {{0, 0}, {800, 600}, {10, 20}};
    tsuya_sift f = {.count = 3, .position = corner};
    assert_near(tsuya_match_chance(&f, 4.0), 8.0 * 1000.0 / 480000.0, 1e-12);
    f.count = 1; /* no box */
    assert_true(tsuya_match_chance(&f, 4.0) == 1.0);
    f.count = 0;
    assert_true(tsuya_match_chance(&f, 4.0) == 1.0);
}

static tsuya_vec3 ray(uint64_t stream, uint64_t k)
{
    return (tsuya_vec3){(draw(stream, 2 * k) - 0.5) * WIDTH / FOCAL_PX, (draw(stream, 2 * k + 1) - 0.5) * HEIGHT / FOCAL_PX, 1.0};
}

/* Distance of b from a's epipolar line, px. */
static double off(tsuya_pose pose, tsuya_vec3 a, tsuya_vec3 b)
{
    tsuya_vec3 line = tsuya_vec3_cross(pose.translation, tsuya_mat3_apply(pose.rotation, a));
    return fabs(tsuya_vec3_dot(line, b)) / hypot(line.x, line.y) * FOCAL_PX;
}

static tsuya_pose pose_of(uint64_t set, uint64_t k)
{
    tsuya_vec3 turn = {0.6 * (draw(300 + set, 6 * k) - 0.5), 0.6 * (draw(300 + set, 6 * k + 1) - 0.5), 2.0 * (draw(300 + set, 6 * k + 2) - 0.5)};
    tsuya_vec3 step = {draw(300 + set, 6 * k + 3) - 0.5, draw(300 + set, 6 * k + 4) - 0.5, draw(300 + set, 6 * k + 5) - 0.5};
    return (tsuya_pose){tsuya_mat3_from_rodrigues(turn), tsuya_vec3_unit(step)};
}

static void test_wrong_matches(void **state)
{
    (void)state;
    const double chance = 2.0 * OFF_PX * hypot(WIDTH, HEIGHT) / (WIDTH * HEIGHT);
    for (uint64_t set = 0; set < SETS; set++) {
        int best = 0, n = 30 + 40 * (int)set;
        for (uint64_t g = 0; g < GEOMETRIES; g++) {
            tsuya_pose pose = pose_of(set, g);
            int near = 0;
            for (int m = 0; m < n; m++) {
                near += off(pose, ray(100 + set, (uint64_t)m), ray(200 + set, (uint64_t)m)) < OFF_PX;
            }
            best = near > best ? near : best;
        }
        assert_true(best > 0);
        assert_true(tsuya_match_false_alarms(n, best, chance) > MOST);
    }
}

/* As many right matches as COLMAP asks of a pair stand out among as many wrong ones only where they are most of all. */
static void test_right_matches(void **state)
{
    (void)state;
    const double chance = 2.0 * OFF_PX * hypot(WIDTH, HEIGHT) / (WIDTH * HEIGHT);
    assert_true(tsuya_match_false_alarms(15, 15, chance) < MOST);
    assert_true(tsuya_match_false_alarms(40, 25, chance) < MOST);
    assert_true(tsuya_match_false_alarms(200, 60, chance) < MOST);
    assert_true(tsuya_match_false_alarms(100, 24, chance) > MOST);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_closed_form), cmocka_unit_test(test_share_of_a_line), cmocka_unit_test(test_wrong_matches), cmocka_unit_test(test_right_matches),
    };
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
