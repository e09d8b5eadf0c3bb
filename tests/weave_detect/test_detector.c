/* The threads of one patch: accuracy against the bound, which peaks are threads, how sure it is, and what is no cloth. */
#include "support.h"

#include "core/context.h"
#include "core/memory.h"
#include "core/order.h"
#include "weave_detect/detector.h"
#include "scene_other.h"
#include "scene_weave.h"

#include <math.h>

enum { N = 64, WIDE = 2 * N, DRAWS = 900, SEED = 31 };

static float values[N * N];
static tsuya_detector *detector, *wide_detector;

static double degrees(double rad) { return rad * 180.0 / M_PI; }

/* The worse of the two families, degrees; 90 where one was not seen. */
static double error_deg(const tsuya_threads *t, const weave_cloth *cloth)
{
    if (!t->a.seen || !t->b.seen) {
        return 90.0;
    }
    double weft = cloth->weft_deg * M_PI / 180.0, warp = cloth->warp_deg * M_PI / 180.0;
    double straight = fmax(tsuya_line_difference(t->a.angle_rad, weft), tsuya_line_difference(t->b.angle_rad, warp));
    double swapped = fmax(tsuya_line_difference(t->b.angle_rad, weft), tsuya_line_difference(t->a.angle_rad, warp));
    return degrees(fmin(straight, swapped));
}

/* The middle patch of a drawn window, as a photograph's patches are looked at. */
static void run_drawn(tsuya_threads *t, const weave_cloth *cloth, const weave_camera *camera)
{
    static float wide[WIDE * WIDE];
    static tsuya_finding finding;
    const tsuya_finding *around[1] = {&finding};
    weave_draw(wide, WIDE, cloth, camera);
    tsuya_detector_find(wide_detector, &finding, wide);
    for (int y = 0; y < N; y++) {
        memcpy(values + y * N, wide + (y + N / 2) * WIDE + N / 2, N * sizeof(float));
    }
    tsuya_detector_follow(detector, t, around, 1, values);
}

/* One sinusoid of amplitude equal to the noise's σ, period 6 px: the bound for 64 px is 0.065°. */
static void test_one_sinusoid_near_the_bound(void **state)
{
    (void)state;
    enum { TRIES = 300 };
    double square = 0.0;
    int seen = 0, sure = 0;
    for (int k = 0; k < TRIES; k++) {
        double a = M_PI * tsuya_random_uniform(SEED, 1, (uint64_t)k), phase = 6.28 * tsuya_random_uniform(SEED, 2, (uint64_t)k);
        for (int i = 0; i < N * N; i++) {
            double x = i % N, y = (int)(i / N), across = -sin(a) * x - cos(a) * y;
            values[i] = (float)(0.5 + 0.05 * sin(2.0 * M_PI * across / 6.0 + phase) + 0.05 * tsuya_random_normal(SEED, (uint64_t)(100 + k), (uint64_t)i));
        }
        tsuya_threads t;
        tsuya_detector_run(detector, &t, values);
        if (t.a.seen) {
            double e = tsuya_line_difference(t.a.angle_rad, a);
            e = t.b.seen ? fmin(e, tsuya_line_difference(t.b.angle_rad, a)) : e;
            square += degrees(e) * degrees(e);
            seen++;
        }
        sure += t.confidence >= 0.8;
    }
    printf("one sinusoid: %.4f degrees rms, seen in %d of %d, taken for cloth in %d\n", sqrt(square / seen), seen, TRIES, sure);
    assert_true(sure <= TRIES / 50);
    assert_int_equal(seen, TRIES);
    assert_true(sqrt(square / seen) <= 0.075);
}

/* Among the draws, those that can be told: contrast ≥ 0.5, period ≥ 4 px, the repeat fits the patch. */
static bool is_plain_sailing(const weave_cloth *cloth, const weave_camera *camera)
{
    double longest = fmax(cloth->weft_px, cloth->warp_px) * weave_draft_repeat(cloth->draft);
    return camera->contrast >= 0.5 && cloth->weft_px >= 4.0 && cloth->warp_px >= 4.0 && longest <= N;
}

typedef struct kind_tally {
    int said[4][4]; /* [true][said] */
    int diagonals, wrong_diagonals;
} kind_tally;

static tsuya_weave_kind true_kind(const weave_cloth *c)
{
    return c->draft == WEAVE_PLAIN ? TSUYA_WEAVE_PLAIN : c->draft <= WEAVE_TWILL_31 ? TSUYA_WEAVE_TWILL : TSUYA_WEAVE_SATIN;
}

/* Of sure patches.  Twill lines run where the next pick shows the next end: across the gradient of end − pick. */
static void note_kind(kind_tally *sum, const tsuya_threads *t, const weave_cloth *c)
{
    if (t->confidence < 0.8) {
        return;
    }
    tsuya_weave_kind kind = true_kind(c);
    sum->said[kind][t->kind]++;
    if (kind == TSUYA_WEAVE_TWILL && t->kind == kind) {
        double weft = c->weft_deg * M_PI / 180.0, warp = c->warp_deg * M_PI / 180.0;
        double x = sin(warp) / c->warp_px + sin(weft) / c->weft_px, y = cos(warp) / c->warp_px + cos(weft) / c->weft_px;
        sum->diagonals++;
        sum->wrong_diagonals += degrees(tsuya_line_difference(t->diagonal_rad, tsuya_line_wrap(atan2(x, y)))) > 3.0;
    }
}

static void check_kinds(const kind_tally *sum)
{
    int named = 0, right = 0, all = 0;
    printf("%-8s %8s %8s %8s %8s\n", "", "unknown", "plain", "twill", "satin");
    for (int k = 1; k < 4; k++) {
        const int *s = sum->said[k];
        printf("%-8s %8d %8d %8d %8d\n", tsuya_weave_kind_name((tsuya_weave_kind)k), s[0], s[1], s[2], s[3]);
        all += s[0] + s[1] + s[2] + s[3];
        named += s[1] + s[2] + s[3];
        right += s[k];
    }
    printf("kind told on %.1f %% of sure patches, right on %.1f %% of these; diagonal wrong on %d of %d\n", 100.0 * named / all, 100.0 * right / named,
           sum->wrong_diagonals, sum->diagonals);
    assert_true(named >= 0.7 * all);
    assert_true(right >= 0.95 * named);
    assert_true(sum->wrong_diagonals <= 0.01 * sum->diagonals);
}

static void test_drawn_cloth(void **state)
{
    (void)state;
    static double error[DRAWS];
    double surplus[10] = {0};
    kind_tally kinds = {0};
    int count = 0, within = 0, sure = 0, sure_right = 0;
    for (int k = 0; k < DRAWS; k++) {
        weave_cloth cloth;
        weave_camera camera;
        tsuya_threads t;
        weave_random(&cloth, &camera, SEED, (uint64_t)k);
        run_drawn(&t, &cloth, &camera);
        double e = error_deg(&t, &cloth);
        assert_true(t.confidence >= 0.0 && t.confidence <= 1.0);
        surplus[(int)(9.999 * t.confidence)] += t.confidence - (e < 2.0);
        if (is_plain_sailing(&cloth, &camera)) {
            note_kind(&kinds, &t, &cloth);
            error[count++] = e;
            within += e < 1.0;
            sure += t.confidence >= 0.8;
            sure_right += t.confidence >= 0.8 && e < 2.0;
        }
    }
    double calibration = 0.0;
    for (int k = 0; k < 10; k++) {
        calibration += fabs(surplus[k]) / DRAWS;
    }
    tsuya_sort_doubles(error, (size_t)count);
    printf("drawn cloth, %d patches: worse family %.3f degrees median, %.1f %% within 1 degree, %.1f %% sure, of these %.1f %% right; calibration "
           "error %.3f over %d\n", count, error[count / 2], 100.0 * within / count, 100.0 * sure / count, 100.0 * sure_right / sure, calibration, DRAWS);
    assert_true(error[count / 2] <= 0.15);
    assert_true(sure_right >= 0.95 * sure);
    assert_true(within >= 0.90 * count);
    assert_true(sure >= 0.80 * count);
    assert_true(calibration <= 0.05);
    check_kinds(&kinds);
}

/* Regular cloth of known draft, contrast 2: every draft's threads, none of its diagonals. */
static void test_every_draft(void **state)
{
    (void)state;
    for (int draft = 0; draft < WEAVE_DRAFT_COUNT; draft++) {
        int right = 0, named = 0, tries = 40;
        for (int k = 0; k < tries; k++) {
            weave_cloth cloth = weave_cloth_default();
            weave_camera camera = weave_camera_default();
            tsuya_threads t;
            cloth.draft = (weave_draft)draft;
            cloth.weft_deg = 180.0 * tsuya_random_uniform(SEED, 7, (uint64_t)k);
            cloth.warp_deg = cloth.weft_deg + 90.0;
            cloth.weft_px = 5.5;
            cloth.warp_px = 5.0;
            cloth.lamp_azimuth_deg = 360.0 * tsuya_random_uniform(SEED, 8, (uint64_t)k);
            camera.seed = (uint64_t)(k + 1);
            weave_draw(values, N, &cloth, &camera);
            tsuya_detector_run(detector, &t, values);
            right += error_deg(&t, &cloth) < 1.0;
            named += t.kind == true_kind(&cloth);
        }
        printf("%s: %d of %d right, %d named\n", weave_draft_name((weave_draft)draft), right, tries, named);
        assert_true(right >= tries * 4 / 5);
    }
}

static void test_nothing_is_said_of_what_is_no_cloth(void **state)
{
    (void)state;
    for (int kind = 0; kind < OTHER_KIND_COUNT; kind++) {
        int sure = 0, tries = kind == OTHER_GREY ? 1 : 60;
        for (int k = 0; k < tries; k++) {
            tsuya_threads t;
            other_draw(values, N, (other_kind)kind, SEED, (uint64_t)k);
            tsuya_detector_run(detector, &t, values);
            sure += t.confidence >= 0.8;
            assert_true(kind != OTHER_GREY || (!t.a.seen && !t.b.seen && t.confidence == 0.0));
        }
        printf("%s: sure of threads in %d of %d\n", other_name((other_kind)kind), sure, tries);
        assert_true(sure <= tries / 20);
    }
}

/* One pixel a thread and less: what is seen is moiré, and must not be believed. */
static void test_unresolved_threads_are_unknown(void **state)
{
    (void)state;
    int sure = 0, tries = 60;
    for (int k = 0; k < tries; k++) {
        weave_cloth cloth = weave_cloth_default();
        weave_camera camera = weave_camera_default();
        tsuya_threads t;
        cloth.weft_deg = 180.0 * tsuya_random_uniform(SEED, 11, (uint64_t)k);
        cloth.warp_deg = cloth.weft_deg + 90.0;
        cloth.weft_px = cloth.warp_px = 0.9 + 0.3 * tsuya_random_uniform(SEED, 12, (uint64_t)k);
        weave_draw(values, N, &cloth, &camera);
        tsuya_detector_run(detector, &t, values);
        sure += t.confidence >= 0.8;
    }
    printf("one pixel a thread: sure in %d of %d\n", sure, tries);
    assert_true(sure <= tries / 10); /* the aim is one in twenty; patch by patch in windows: test_hard_cloth */
}

static void test_every_allocation_may_fail(void **state)
{
    (void)state;
    tsuya_detector *d;
    tsuya_memory_fail_at(0);
    assert_ok(tsuya_detector_create(&d, N, NULL));
    tsuya_detector_free(d);
    uint64_t count = tsuya_memory_fail_at(0);
    assert_true(count > 10);
    for (uint64_t k = 1; k <= count; k++) {
        tsuya_memory_fail_at(k);
        assert_int_equal(tsuya_detector_create(&d, N, NULL), TSUYA_ERROR_MEMORY);
        assert_null(d);
    }
    tsuya_memory_fail_at(0);
    assert_fails(tsuya_detector_create(&d, 63, NULL), "even sizes from 16 to 512");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_one_sinusoid_near_the_bound), cmocka_unit_test(test_drawn_cloth), cmocka_unit_test(test_every_draft),
        cmocka_unit_test(test_nothing_is_said_of_what_is_no_cloth), cmocka_unit_test(test_unresolved_threads_are_unknown),
        cmocka_unit_test(test_every_allocation_may_fail),
    };
    if (tsuya_detector_create(&detector, N, NULL) != TSUYA_OK || tsuya_detector_create(&wide_detector, WIDE, NULL) != TSUYA_OK) {
        return 1;
    }
    int result = cmocka_run_group_tests(tests, NULL, NULL);
    tsuya_detector_free(detector);
    tsuya_detector_free(wide_detector);
    return result;
}
