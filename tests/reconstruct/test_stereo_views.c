/* Which views stereo compares: by shared points, by poses alone where a view has none, never a held-out one. */
#include "support.h"

#include "reconstruct/stereo_views.h"

enum { VIEWS = 24, POINTS = 240, BARE = 5, SOURCES = 4 };

static tsuya_camera camera = {.lens = TSUYA_LENS_PINHOLE, .width_px = 640, .height_px = 480, .fx_px = 700, .fy_px = 700,
                              .cx_px = 319.5, .cy_px = 239.5};
static uint32_t camera_id = 1;
static tsuya_view view[VIEWS];
static tsuya_point point[POINTS];
static tsuya_track_element track[POINTS][VIEWS];
static tsuya_observation observation[VIEWS][POINTS];
static char names[VIEWS][16];

static double azimuth_rad(int v) { return 2.0 * M_PI * v / VIEWS; }

/* A ring of views, 15 degrees apart, around points on an upright drum; each sees the points that turn to it within 50 degrees,
 * but for BARE, which has none. */
static tsuya_sparse_model ring(void)
{
    for (int v = 0; v < VIEWS; v++) {
        tsuya_vec3 eye = {2.0 * cos(azimuth_rad(v)), 2.0 * sin(azimuth_rad(v)), 0.0};
        snprintf(names[v], sizeof names[v], "%02d.png", v);
        view[v] = (tsuya_view){.image_id = (uint32_t)v + 1, .camera_id = 1, .name = names[v], .observation = observation[v],
                               .camera_from_world = tsuya_pose_look_at(eye, (tsuya_vec3){0, 0, 0}, (tsuya_vec3){0, 0, 1})};
    }
    for (int p = 0; p < POINTS; p++) {
        double a = 2.0 * M_PI * p / POINTS;
        point[p] = (tsuya_point){.position = {0.3 * cos(a), 0.3 * sin(a), 0.2 * (p % 5 - 2) / 2.0}, .track = track[p],
                                 .point_id = (uint64_t)p + 1};
        for (int v = 0; v < VIEWS; v++) {
            if (v != BARE && cos(a - azimuth_rad(v)) > cos(tsuya_rad_from_deg(50.0))) {
                track[p][point[p].track_count++] = (tsuya_track_element){v, view[v].observation_count};
                observation[v][view[v].observation_count++] = (tsuya_observation){320, 240, p};
            }
        }
    }
    return (tsuya_sparse_model){.camera = &camera, .camera_id = &camera_id, .camera_count = 1, .view = view, .view_count = VIEWS,
                                .point = point, .point_count = POINTS};
}

static int steps_apart(int a, int b)
{
    int d = abs(a - b) % VIEWS;
    return d < VIEWS - d ? d : VIEWS - d;
}

static bool has_source(const tsuya_view_plan *plan, int v)
{
    for (int k = 0; k < plan->source_count; k++) {
        if (plan->source[k] == v) {
            return true;
        }
    }
    return false;
}

static void view_without_points_is_given_its_neighbours(void **state)
{
    (void)state;
    tsuya_arena *arena;
    tsuya_view_plan *plan;
    tsuya_sparse_model model = ring();
    assert_ok(tsuya_arena_create(&arena, 1 << 16));
    assert_ok(tsuya_view_plans_make(&plan, &model, NULL, 0, SOURCES, "ring", arena));
    assert_true(plan[BARE].used);
    assert_int_equal(plan[BARE].source_count, SOURCES);
    for (int k = 0; k < SOURCES; k++) { /* two to each side, the nearest two first */
        assert_int_equal(steps_apart(plan[BARE].source[k], BARE), k < 2 ? 1 : 2);
    }
    assert_true(plan[BARE].depth_min < 1.7 && plan[BARE].depth_max > 2.3);
    assert_true(plan[BARE].depth_min > 1.0 && plan[BARE].depth_max < 3.2);
    tsuya_arena_free(arena);
}

static void views_with_points_go_by_them(void **state)
{
    (void)state;
    tsuya_arena *arena;
    tsuya_view_plan *plan;
    tsuya_sparse_model model = ring();
    assert_ok(tsuya_arena_create(&arena, 1 << 16));
    assert_ok(tsuya_view_plans_make(&plan, &model, NULL, 0, SOURCES, "ring", arena));
    for (int v = 0; v < VIEWS; v++) {
        assert_true(plan[v].used);
        assert_int_equal(plan[v].source_count, SOURCES);
        assert_false(has_source(&plan[v], v));
        assert_true(v == BARE || !has_source(&plan[v], BARE)); /* it shares no point with any */
        assert_true(steps_apart(plan[v].source[0], v) <= 2);
    }
    tsuya_arena_free(arena);
}

static void held_out_views_are_neither_reference_nor_source(void **state)
{
    (void)state;
    static const char *const out[] = {"04.png", "12.png"};
    tsuya_arena *arena;
    tsuya_view_plan *plan;
    tsuya_sparse_model model = ring();
    assert_ok(tsuya_arena_create(&arena, 1 << 16));
    assert_ok(tsuya_view_plans_make(&plan, &model, out, 2, SOURCES, "ring", arena));
    for (int v = 0; v < VIEWS; v++) {
        assert_true(plan[v].held_out == (v == 4 || v == 12));
        assert_true(plan[v].used != plan[v].held_out);
        assert_false(has_source(&plan[v], 4) || has_source(&plan[v], 12));
    }
    assert_int_equal(plan[BARE].source[0], 6);
    assert_int_equal(plan[BARE].source_count, 3); /* 45 degrees away is too far to go by poses alone */
    tsuya_arena_free(arena);
}

static void view_that_looks_away_gets_no_map(void **state)
{
    (void)state;
    tsuya_arena *arena;
    tsuya_view_plan *plan;
    tsuya_sparse_model model = ring();
    tsuya_vec3 eye = tsuya_pose_center(view[BARE].camera_from_world);
    view[BARE].camera_from_world = tsuya_pose_look_at(eye, tsuya_vec3_scale(eye, 2.0), (tsuya_vec3){0, 0, 1});
    assert_ok(tsuya_arena_create(&arena, 1 << 16));
    assert_ok(tsuya_view_plans_make(&plan, &model, NULL, 0, SOURCES, "ring", arena));
    assert_false(plan[BARE].used);
    model.point_count = 0;
    assert_fails(tsuya_view_plans_make(&plan, &model, NULL, 0, SOURCES, "ring", arena), "ring/sparse: the model has no points");
    tsuya_arena_free(arena);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(view_without_points_is_given_its_neighbours),
        cmocka_unit_test(views_with_points_go_by_them),
        cmocka_unit_test(held_out_views_are_neither_reference_nor_source),
        cmocka_unit_test(view_that_looks_away_gets_no_map),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
