#include "support.h"

#include "core/memory.h"
#include "core/order.h"
#include "reconstruct/prior.h"
#include "scene_stereo.h"

#include <string.h>

static tsuya_context context_of(int threads)
{
    tsuya_context context = tsuya_context_default();
    context.threads = threads;
    return context;
}

static scene_errors errors_of(scene_kind kind, int width_px, int views, int view, bool geometric, bool masked)
{
    tsuya_context context = context_of(2);
    tsuya_patchmatch_options options = tsuya_patchmatch_options_default();
    scene_pictures scene;
    scene_stereo stereo;
    scene_errors errors;
    tsuya_depth_map map;
    assert_true(scene_create(&scene, kind, width_px, views, 0.004));
    assert_true(scene_stereo_create(&stereo, &scene, 3));
    assert_int_equal(scene_stereo_solve(&map, &stereo, view, geometric, masked, &options, &context), TSUYA_OK);
    assert_true(scene_errors_measure(&errors, &scene, view, &map));
    print_message("%-8s median %.3f p90 %.3f gsd, complete %.3f, wrong %.4f, bare wrong %.4f, normals %.1f deg\n",
                  scene_name(kind), errors.median_gsd, errors.p90_gsd, errors.completeness, errors.wrong,
                  errors.wrong_bare, errors.normal_deg);
    tsuya_depth_map_free(&map);
    scene_stereo_free(&stereo);
    scene_free(&scene);
    return errors;
}

static void assert_accurate(scene_errors e)
{
    assert_true(e.median_gsd <= 0.5);
    assert_true(e.p90_gsd <= 1.5);
    assert_true(e.completeness >= 0.95);
    assert_true(e.normal_deg <= 6.0);
}

static void sheet_is_recovered(void **state)
{
    (void)state;
    scene_errors e = errors_of(SCENE_SHEET, 240, 6, 2, true, false);
    assert_accurate(e);
    assert_true(e.wrong <= 0.002);
}

static void cylinder_is_recovered_to_its_flanks(void **state)
{
    (void)state;
    scene_errors e = errors_of(SCENE_CYLINDER, 240, 6, 3, true, true);
    assert_accurate(e);
    assert_true(e.wrong <= 0.01);
}

/* Without a mask the bare backdrop must not take on the depth of what stands before it (0.008 if it does). */
static void backdrop_stays_empty_without_a_mask(void **state)
{
    (void)state;
    scene_errors e = errors_of(SCENE_CYLINDER, 160, 6, 2, true, false);
    assert_accurate(e);
    assert_true(e.wrong <= 0.005);
}

static void grazing_plane_is_recovered(void **state)
{
    (void)state;
    scene_errors e = errors_of(SCENE_GRAZING, 240, 6, 2, true, true);
    assert_accurate(e);
    assert_true(e.wrong <= 0.01);
}

static void slab_is_recovered(void **state)
{
    (void)state;
    scene_errors e = errors_of(SCENE_SLAB, 240, 10, 2, true, true);
    assert_accurate(e);
    assert_true(e.wrong <= 0.01);
}

/* The empty third stays open or is right; beside it nothing suffers. */
static void bare_cloth_stays_open(void **state)
{
    (void)state;
    scene_errors e = errors_of(SCENE_BARE, 240, 6, 2, true, false);
    assert_accurate(e);
    assert_true(e.wrong_bare <= 0.005);
}

/* A moving highlight is the only thing to see there: its image in the cloth has a depth of its own, that of the lamp's
 * reflection.  The flanks must not be taken for cloth; a remainder around the crest is known. */
static void highlight_is_mostly_refused(void **state)
{
    (void)state;
    scene_errors e = errors_of(SCENE_SATIN, 240, 6, 2, true, false);
    assert_accurate(e);
    assert_true(e.wrong_bare <= 0.12);
}

/* Of what stereo leaves open in the empty third of satin, the curved prior closes at least half, as accurately as stereo has
 * to be elsewhere; nothing appears where nothing is. */
static void satin_is_closed_by_the_prior(void **state)
{
    (void)state;
    enum { WIDTH = 240, VIEW = 2, PIXELS = WIDTH * WIDTH * 3 / 4 };
    static float error[PIXELS];
    tsuya_context context = context_of(2);
    tsuya_patchmatch_options options = tsuya_patchmatch_options_default();
    tsuya_prior_options prior_options = tsuya_prior_options_default();
    scene_pictures scene;
    scene_stereo stereo;
    tsuya_depth_map map, prior;
    size_t open = 0, closed = 0;
    assert_true(scene_create(&scene, SCENE_SATIN, WIDTH, 6, 0.004));
    assert_true(scene_stereo_create(&stereo, &scene, 3));
    assert_int_equal(scene_stereo_solve(&map, &stereo, VIEW, true, false, &options, &context), TSUYA_OK);
    tsuya_prior_problem problem = {.reference = &stereo.image[VIEW], .map = &map, .depth_min = 0.3, .depth_max = 2.2};
    assert_int_equal(tsuya_prior(&prior, &problem, &prior_options, &context), TSUYA_OK);
    const scene_view *v = &scene.view[VIEW];
    for (size_t i = 0; i < PIXELS; i++) {
        open += !v->textured[i] && v->depth[i] > 0.0f && !(map.depth[i] > 0.0f);
        if (prior.depth[i] > 0.0f) {
            assert_true(v->depth[i] > 0.0f);
            error[closed++] = fabsf(prior.depth[i] - v->depth[i]) / (v->depth[i] / (float)v->camera.fx_px);
        }
    }
    assert_true(closed > 0);
    tsuya_sort_floats(error, closed);
    print_message("satin    %zu of %zu open bare pixels closed, median %.3f p90 %.3f gsd\n", closed, open, error[closed / 2], error[closed * 9 / 10]);
    assert_true((double)closed >= 0.5 * (double)open);
    assert_true(error[closed / 2] <= 0.5f);
    assert_true(error[closed * 9 / 10] <= 1.5f);
    tsuya_depth_map_free(&prior);
    tsuya_depth_map_free(&map);
    scene_stereo_free(&stereo);
    scene_free(&scene);
}

static void photometric_pass_alone_is_accurate(void **state)
{
    (void)state;
    scene_errors e = errors_of(SCENE_SHEET, 240, 6, 2, false, false);
    assert_true(e.median_gsd <= 0.5);
    assert_true(e.p90_gsd <= 1.5);
}

/* ---- the same bits ---- */

static void solve_small(tsuya_depth_map *map, const scene_pictures *scene, int threads, tsuya_simd simd, uint64_t seed)
{
    tsuya_context context = context_of(threads);
    tsuya_patchmatch_options options = tsuya_patchmatch_options_default();
    scene_stereo stereo;
    options.simd = simd;
    context.seed = seed;
    assert_true(scene_stereo_create(&stereo, scene, 3));
    assert_int_equal(scene_stereo_solve(map, &stereo, 1, true, true, &options, &context), TSUYA_OK);
    scene_stereo_free(&stereo);
}

static bool same_bits(const tsuya_depth_map *a, const tsuya_depth_map *b)
{
    size_t pixels = (size_t)a->width_px * (size_t)a->height_px;
    return a->width_px == b->width_px && a->height_px == b->height_px &&
           memcmp(a->depth, b->depth, pixels * sizeof(float)) == 0 &&
           memcmp(a->normal, b->normal, 3 * pixels * sizeof(float)) == 0 &&
           memcmp(a->cost, b->cost, pixels * sizeof(float)) == 0;
}

static void threads_and_instructions_give_the_same_bits(void **state)
{
    (void)state;
    scene_pictures scene;
    tsuya_depth_map one, other;
    assert_true(scene_create(&scene, SCENE_CYLINDER, 100, 4, 0.004));
    solve_small(&one, &scene, 1, TSUYA_SIMD_AUTO, 1);
    for (int threads = 2; threads <= 5; threads += 3) {
        solve_small(&other, &scene, threads, TSUYA_SIMD_AUTO, 1);
        assert_true(same_bits(&one, &other));
        tsuya_depth_map_free(&other);
    }
    for (int simd = TSUYA_SIMD_PORTABLE; simd <= TSUYA_SIMD_AVX512; simd++) {
        solve_small(&other, &scene, 2, (tsuya_simd)simd, 1);
        assert_true(same_bits(&one, &other));
        tsuya_depth_map_free(&other);
    }
    solve_small(&other, &scene, 2, TSUYA_SIMD_AUTO, 2);
    assert_false(same_bits(&one, &other));
    tsuya_depth_map_free(&other);
    tsuya_depth_map_free(&one);
    scene_free(&scene);
}

/* ---- edges ---- */

static void mask_is_kept_and_normals_face_the_camera(void **state)
{
    (void)state;
    scene_pictures scene;
    tsuya_depth_map map;
    assert_true(scene_create(&scene, SCENE_CYLINDER, 100, 4, 0.004));
    solve_small(&map, &scene, 2, TSUYA_SIMD_AUTO, 1);
    const scene_view *v = &scene.view[1];
    size_t pixels = (size_t)map.width_px * (size_t)map.height_px;
    for (size_t i = 0; i < pixels; i++) {
        if (!(map.depth[i] > 0.0f)) {
            assert_true(map.depth[i] == 0.0f);
            continue;
        }
        assert_true(v->depth[i] > 0.0f);
        double x = ((double)(i % (size_t)map.width_px) - v->camera.cx_px) / v->camera.fx_px;
        double y = ((double)(i / (size_t)map.width_px) - v->camera.cy_px) / v->camera.fy_px;
        const float *n = map.normal + i;
        assert_true(fabsf(n[0] * n[0] + n[pixels] * n[pixels] + n[2 * pixels] * n[2 * pixels] - 1.0f) < 1e-4f);
        assert_true(n[0] * x + n[pixels] * y + n[2 * pixels] < 0.0);
    }
    tsuya_depth_map_free(&map);
    scene_free(&scene);
}

/* One source that sees nothing of the scene, and a picture of one grey: nothing to find, nothing found, no crash. */
static void nothing_to_see_gives_nothing(void **state)
{
    (void)state;
    enum { W = 80, H = 60 };
    static float grey[W * H];
    tsuya_context context = context_of(2);
    tsuya_patchmatch_options options = tsuya_patchmatch_options_default();
    tsuya_camera camera = {.lens = TSUYA_LENS_PINHOLE, .width_px = W, .height_px = H, .fx_px = 90, .fy_px = 90,
                           .cx_px = 39.5, .cy_px = 29.5};
    tsuya_stereo_image reference, away;
    for (int i = 0; i < W * H; i++) {
        grey[i] = 0.5f;
    }
    tsuya_pose here = tsuya_pose_look_at((tsuya_vec3){0, 0, 1}, (tsuya_vec3){0, 0, 0}, (tsuya_vec3){0, 1, 0});
    tsuya_pose back = tsuya_pose_look_at((tsuya_vec3){0, 0, 1}, (tsuya_vec3){0, 0, 2}, (tsuya_vec3){0, 1, 0});
    assert_int_equal(tsuya_stereo_image_create(&reference, grey, &camera, here, 3), TSUYA_OK);
    assert_int_equal(tsuya_stereo_image_create(&away, grey, &camera, back, 3), TSUYA_OK);
    tsuya_patchmatch_source source[2] = {{&away, NULL}, {&reference, NULL}};
    tsuya_patchmatch_problem problem = {.reference = &reference, .source = source, .source_count = 2,
                                        .depth_min = 0.5, .depth_max = 2.0, .filter = true};
    tsuya_depth_map map;
    assert_int_equal(tsuya_patchmatch(&map, &problem, &options, &context), TSUYA_OK);
    for (int i = 0; i < W * H; i++) {
        assert_true(map.depth[i] == 0.0f);
    }
    tsuya_depth_map_free(&map);
    tsuya_stereo_image_free(&reference);
    tsuya_stereo_image_free(&away);
}

static void interruption_is_noticed(void **state)
{
    (void)state;
    tsuya_context context = context_of(2);
    tsuya_patchmatch_options options = tsuya_patchmatch_options_default();
    scene_pictures scene;
    scene_stereo stereo;
    tsuya_depth_map map;
    assert_true(scene_create(&scene, SCENE_SHEET, 64, 3, 0.0));
    assert_true(scene_stereo_create(&stereo, &scene, 3));
    tsuya_interrupt();
    assert_int_equal(scene_stereo_solve(&map, &stereo, 1, false, false, &options, &context), TSUYA_ERROR_INTERRUPTED);
    tsuya_interrupt_clear();
    assert_null(map.depth);
    scene_stereo_free(&stereo);
    scene_free(&scene);
}

static void every_allocation_may_fail(void **state)
{
    (void)state;
    tsuya_context context = context_of(1);
    tsuya_patchmatch_options options = tsuya_patchmatch_options_default();
    scene_pictures scene;
    tsuya_depth_map map;
    tsuya_status status = TSUYA_ERROR_MEMORY;
    assert_true(scene_create(&scene, SCENE_SHEET, 64, 3, 0.0));
    options.coarse_iterations = options.fine_iterations = 1;
    for (uint64_t n = 1; status != TSUYA_OK; n++) {
        scene_stereo stereo;
        assert_in_range(n, 1, 500);
        assert_true(scene_stereo_create(&stereo, &scene, 3));
        tsuya_memory_fail_at(n);
        status = scene_stereo_solve(&map, &stereo, 1, true, true, &options, &context);
        tsuya_memory_fail_at(0);
        assert_true(status == TSUYA_OK || status == TSUYA_ERROR_MEMORY);
        scene_stereo_free(&stereo);
    }
    tsuya_depth_map_free(&map);
    scene_free(&scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(sheet_is_recovered),
        cmocka_unit_test(cylinder_is_recovered_to_its_flanks),
        cmocka_unit_test(backdrop_stays_empty_without_a_mask),
        cmocka_unit_test(grazing_plane_is_recovered),
        cmocka_unit_test(slab_is_recovered),
        cmocka_unit_test(bare_cloth_stays_open),
        cmocka_unit_test(highlight_is_mostly_refused),
        cmocka_unit_test(satin_is_closed_by_the_prior),
        cmocka_unit_test(photometric_pass_alone_is_accurate),
        cmocka_unit_test(threads_and_instructions_give_the_same_bits),
        cmocka_unit_test(mask_is_kept_and_normals_face_the_camera),
        cmocka_unit_test(nothing_to_see_gives_nothing),
        cmocka_unit_test(interruption_is_noticed),
        cmocka_unit_test(every_allocation_may_fail),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
