/* Dense stereo: seconds a megapixel (5 sources, 2 threads) beside accuracy and completeness on the tests' scenes, with each
 * part switched off in turn.
 *
 * The bars hold for the whole: 8 s a megapixel where two cores are idle (counted as processor time over two, so that other
 * work on the machine does not count), median error 0.5 and 90 % 1.5 ground sample distances, completeness 95 %. */
#include "support.h"

#include "bench.h"
#include "scene_stereo.h"

enum { WIDTH = 400, VIEWS = 6, VIEW = 2, THREADS = 2 };

typedef struct variant {
    const char *name, *point; /* in the table, and without commas */
    bool geometric, coarse_to_fine;
    tsuya_simd simd;
} variant;

static const variant variants[] = {
    {"all", "ours", true, true, TSUYA_SIMD_AUTO},
    {"no geometric pass", "no geometric pass", false, true, TSUYA_SIMD_AUTO},
    {"one scale", "one scale", true, false, TSUYA_SIMD_AUTO},
    {"portable code", "portable code", true, true, TSUYA_SIMD_PORTABLE},
    {"portable, one scale", "portable code and one scale", true, false, TSUYA_SIMD_PORTABLE},
};

typedef struct measurement {
    double seconds, cpu_seconds; /* a megapixel */
    scene_errors errors;
} measurement;

static measurement measure(const scene_pictures *scene, const variant *v)
{
    measurement m;
    tsuya_context context = tsuya_context_default();
    tsuya_patchmatch_options options = tsuya_patchmatch_options_default();
    scene_stereo stereo;
    tsuya_depth_map map;
    context.threads = THREADS;
    options.coarse_to_fine = v->coarse_to_fine;
    options.simd = v->simd;
    if (!v->coarse_to_fine) { /* chance needs as many turns as all scales together have */
        options.coarse_iterations = 8;
    }
    assert_true(scene_stereo_create(&stereo, scene, 3));
    assert_ok(scene_stereo_solve(&map, &stereo, VIEW, v->geometric, true, &options, &context));
    assert_true(scene_errors_measure(&m.errors, scene, VIEW, &map));
    m.seconds = scene_stereo_seconds(&stereo, false);
    m.cpu_seconds = scene_stereo_seconds(&stereo, true);
    tsuya_depth_map_free(&map);
    scene_stereo_free(&stereo);
    return m;
}

static void every_part_pays(void **state)
{
    (void)state;
    static const scene_kind kinds[] = {SCENE_SHEET, SCENE_CYLINDER, SCENE_BARE};
    print_message("scene     without              s/Mpix  cpu s/Mpix  median gsd  p90 gsd  complete  wrong\n");
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++) {
        scene_pictures scene;
        assert_true(scene_create(&scene, kinds[k], WIDTH, VIEWS, 0.004));
        for (size_t i = 0; i < sizeof variants / sizeof *variants; i++) {
            measurement m = measure(&scene, &variants[i]);
            print_message("%-9s %-20s %6.2f  %10.2f  %10.3f  %7.3f  %8.4f  %.4f\n", scene_name(kinds[k]), variants[i].name, m.seconds,
                          m.cpu_seconds, m.errors.median_gsd, m.errors.p90_gsd, m.errors.completeness, m.errors.wrong);
            bench_point(scene_name(kinds[k]), variants[i].point, m.errors.median_gsd, "gsd", m.cpu_seconds / THREADS, "s/Mpix");
            if (i == 0) {
                assert_true(m.cpu_seconds / THREADS <= 8.0);
                assert_true(m.errors.median_gsd <= 0.5);
                assert_true(m.errors.p90_gsd <= 1.5);
                assert_true(m.errors.completeness >= 0.95);
            }
        }
        scene_free(&scene);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(every_part_pays),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
