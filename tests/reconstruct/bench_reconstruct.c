/* Dense stereo: seconds a megapixel (5 sources, 2 threads) beside accuracy and completeness on the tests' scenes, with each
 * part switched off in turn.
 *
 * The bars hold for the whole: 8 s a megapixel where two cores are idle (counted as processor time over two, so that other
 * work on the machine does not count), median error 0.5 and 90 % 1.5 ground sample distances, completeness 95 %. */
#include "support.h"

#include <time.h>

#include "bench.h"
#include "core/memory.h"
#include "reconstruct/prior.h"
#include "scene_stereo.h"

enum { WIDTH = 400, VIEWS = 6, VIEW = 2, THREADS = 2 };

typedef struct variant {
    const char *name, *point; /* in the table, and without commas */
    bool prior, geometric, coarse_to_fine;
    tsuya_simd simd;
} variant;

static const variant variants[] = {
    {"all", "ours", true, true, true, TSUYA_SIMD_AUTO},
    {"no prior", "no prior", false, true, true, TSUYA_SIMD_AUTO},
    {"no geometric pass", "no geometric pass", true, false, true, TSUYA_SIMD_AUTO},
    {"one scale", "one scale", true, true, false, TSUYA_SIMD_AUTO},
    {"SSE4.2", "SSE4.2", true, true, true, TSUYA_SIMD_SSE42},
    {"AVX2", "AVX2", true, true, true, TSUYA_SIMD_AVX2},
    {"portable code", "portable code", true, true, true, TSUYA_SIMD_PORTABLE},
    {"portable, one scale", "portable code and one scale", true, true, false, TSUYA_SIMD_PORTABLE},
};

typedef struct measurement {
    double seconds, cpu_seconds; /* a megapixel */
    scene_errors errors;
    double covered; /* share of the whole surface, bare or not, within 2 ground sample distances */
} measurement;

/* Adds what the prior closes to the map. */
static void close_gaps(tsuya_depth_map *map, const scene_stereo *stereo, const scene_view *v, const tsuya_context *context)
{
    const size_t pixels = (size_t)map->width_px * (size_t)map->height_px;
    const tsuya_prior_options options = tsuya_prior_options_default();
    tsuya_depth_map prior;
    uint8_t *mask = tsuya_calloc(pixels, 1);
    assert_non_null(mask);
    for (size_t i = 0; i < pixels; i++) {
        mask[i] = v->depth[i] > 0.0f;
    }
    tsuya_prior_problem problem = {.reference = &stereo->image[VIEW], .mask = mask, .map = map, .depth_min = 0.3, .depth_max = 2.2};
    assert_ok(tsuya_prior(&prior, &problem, &options, context));
    for (size_t i = 0; i < pixels; i++) {
        for (size_t k = 0; k < 3 && prior.depth[i] > 0.0f; k++) {
            map->depth[i] = prior.depth[i];
            map->normal[k * pixels + i] = prior.normal[k * pixels + i];
        }
    }
    tsuya_depth_map_free(&prior);
    tsuya_free(mask);
}

static double covered(const tsuya_depth_map *map, const scene_view *v)
{
    size_t surface = 0, within = 0;
    for (size_t i = 0; i < (size_t)map->width_px * (size_t)map->height_px; i++) {
        surface += v->depth[i] > 0.0f;
        within += v->depth[i] > 0.0f && fabsf(map->depth[i] - v->depth[i]) <= 2.0f * v->depth[i] / (float)v->camera.fx_px;
    }
    return (double)within / (double)surface;
}

static double cpu_s(void) { return (double)clock() / CLOCKS_PER_SEC; }

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
    m.seconds = scene_stereo_seconds(&stereo, false);
    m.cpu_seconds = scene_stereo_seconds(&stereo, true);
    if (v->prior) {
        const double began = tsuya_clock_s(), cpu = cpu_s(), megapixels = 1e-6 * map.width_px * map.height_px;
        close_gaps(&map, &stereo, &scene->view[VIEW], &context);
        m.seconds += (tsuya_clock_s() - began) / megapixels;
        m.cpu_seconds += (cpu_s() - cpu) / megapixels;
    }
    assert_true(scene_errors_measure(&m.errors, scene, VIEW, &map));
    m.covered = covered(&map, &scene->view[VIEW]);
    tsuya_depth_map_free(&map);
    scene_stereo_free(&stereo);
    return m;
}

static void every_part_pays(void **state)
{
    (void)state;
    static const scene_kind kinds[] = {SCENE_SHEET, SCENE_CYLINDER, SCENE_SATIN};
    print_message("scene     without              s/Mpix  cpu s/Mpix  median gsd  p90 gsd  complete  covered  wrong\n");
    for (size_t k = 0; k < sizeof kinds / sizeof *kinds; k++) {
        scene_pictures scene;
        char part[32];
        assert_true(scene_create(&scene, kinds[k], WIDTH, VIEWS, 0.004));
        for (size_t i = 0; i < sizeof variants / sizeof *variants; i++) {
            measurement m = measure(&scene, &variants[i]);
            print_message("%-9s %-20s %6.2f  %10.2f  %10.3f  %7.3f  %8.4f  %7.4f  %.4f\n", scene_name(kinds[k]), variants[i].name, m.seconds,
                          m.cpu_seconds, m.errors.median_gsd, m.errors.p90_gsd, m.errors.completeness, m.covered, m.errors.wrong);
            bench_point(scene_name(kinds[k]), variants[i].point, m.errors.median_gsd, "gsd", m.cpu_seconds / THREADS, "s/Mpix");
            snprintf(part, sizeof part, "%s left open", scene_name(kinds[k]));
            bench_point(part, variants[i].point, 1.0 - m.covered, "share", m.cpu_seconds / THREADS, "s/Mpix");
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
