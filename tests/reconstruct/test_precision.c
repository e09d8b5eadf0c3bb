/* The step that a tolerance chooses: as cheap as it may be, as fine as it must, and true when it is taken. */
#include "support.h"

#include "core/memory.h"
#include "core/order.h"
#include "reconstruct/fusion.h"
#include "reconstruct/precision.h"
#include "reconstruct/stereo.h"
#include "scene_workspace.h"

enum { WIDTH = 320, VIEWS = 7 };

typedef struct world { scene_pictures scene; const char *folder; tsuya_sparse_model model; tsuya_arena *arena; double gsd; } world;

static void world_create(world *w)
{
    static char sparse[TEST_PATH];
    w->folder = test_path("workspace");
    assert_true(scene_create(&w->scene, SCENE_SHEET, WIDTH, VIEWS, 0.004));
    assert_ok(scene_workspace_write(&w->scene, w->folder, false));
    snprintf(sparse, sizeof sparse, "%.4000s/sparse", w->folder);
    assert_ok(tsuya_sparse_model_load(&w->model, sparse));
    assert_ok(tsuya_arena_create(&w->arena, 1 << 16));
    w->gsd = scene_gsd_m(&w->scene);
}

static tsuya_precision choose(world *w, double tolerance, int side_px, int sources)
{
    tsuya_precision p;
    tsuya_precision_step given = {.long_side_px = side_px, .source_views = sources};
    assert_ok(tsuya_precision_choose(&p, &w->model, w->gsd, WIDTH, tolerance, given, w->arena));
    return p;
}

/* 95 % of the cloud's distances from the true sheet. */
static double error_of_step(const world *w, tsuya_precision_step step)
{
    tsuya_context context = tsuya_context_default();
    tsuya_stereo_options stereo = tsuya_stereo_options_default();
    tsuya_fusion_options fusion = tsuya_fusion_options_default();
    tsuya_stereo_info stereo_info;
    tsuya_fusion_info fusion_info;
    tsuya_mesh cloud;
    context.threads = 2;
    stereo.workspace = fusion.workspace = w->folder;
    stereo.long_side_px = step.long_side_px;
    stereo.source_views = step.source_views;
    assert_ok(tsuya_stereo(&stereo_info, &stereo, &context));
    assert_int_equal(stereo_info.width_px, step.long_side_px);
    assert_ok(tsuya_fusion(&cloud, &fusion_info, &fusion, &context));
    double *error = tsuya_calloc(cloud.vertex_count, sizeof *error);
    assert_non_null(error);
    for (size_t i = 0; i < cloud.vertex_count; i++) {
        error[i] = scene_distance_m(SCENE_SHEET, tsuya_mesh_position(&cloud, i));
    }
    tsuya_sort_doubles(error, cloud.vertex_count);
    double p95 = error[(size_t)(0.95 * (double)cloud.vertex_count)];
    tsuya_free(error);
    tsuya_mesh_free(&cloud);
    return p95;
}

static void tolerance_chooses_the_step(void **state)
{
    (void)state;
    world w = {0};
    world_create(&w);
    tsuya_precision before = {0};
    bool coarse = false, fine = false;
    for (double t = 16.0 * w.gsd; t > 0.05 * w.gsd; t *= 0.7) {
        tsuya_precision p = choose(&w, t, 0, 0);
        assert_true(p.reached == (p.chosen.error <= 0.8 * t));
        assert_near(p.mesh_tolerance, 0.5 * t, 1e-12);
        assert_in_range(p.chosen.long_side_px, 160, WIDTH);
        assert_true(before.chosen.cost <= p.chosen.cost); /* less error never costs less */
        assert_true(p.finer.long_side_px == 0 || (p.finer.error <= 0.9 * p.chosen.error && p.finer.cost > p.chosen.cost));
        assert_true(p.reached || p.finer.long_side_px == 0);
        coarse |= p.chosen.long_side_px == 160;
        fine |= !p.reached && p.chosen.long_side_px == WIDTH;
        before = p;
    }
    assert_true(coarse && fine);
    tsuya_precision kept = choose(&w, 4.0 * w.gsd, 200, 4);
    assert_int_equal(kept.chosen.long_side_px, 200);
    assert_int_equal(kept.chosen.source_views, 4);
    tsuya_precision plain = choose(&w, 0.0, 160, 5);
    assert_int_equal(plain.chosen.long_side_px, 160);
    assert_true(plain.mesh_tolerance == 0.0 && plain.reached && plain.finer.long_side_px > 0);
    tsuya_precision middle = choose(&w, 2.5 * w.gsd, 0, 0);
    double p95 = error_of_step(&w, middle.chosen);
    print_message("tolerance %.2f gsd: %d px, %d sources, expected %.3f, 95 %% within %.3f gsd\n", 2.5, middle.chosen.long_side_px,
                  middle.chosen.source_views, middle.chosen.error / w.gsd, p95 / w.gsd);
    assert_true(middle.reached && p95 <= middle.chosen.error);
    tsuya_sparse_model_free(&w.model);
    tsuya_arena_free(w.arena);
    scene_free(&w.scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(tolerance_chooses_the_step)};
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return failed;
}
