/* Two groups that share no feature, each in a frame of its own, and a mat of tags that both see: one model, in the first one's frame.
 * The truth is what the scene was drawn with. */
#include "support.h"

#include "core/context.h"
#include "core/memory.h"
#include "reconstruct/join.h"

enum { VIEWS = 6, POINTS = 60, TAGS = 12, SIGHTINGS = 2 * VIEWS * TAGS * 4 };
static const double SIGMA_PX = 0.1;
static const tsuya_camera lens = {.lens = TSUYA_LENS_SIMPLE_RADIAL, .width_px = 1000, .height_px = 800, .fx_px = 1100, .fy_px = 1100,
                                  .cx_px = 499.5, .cy_px = 399.5, .distortion = {-0.05}};

static tsuya_pose true_pose(int side, int v)
{
    double a = M_PI * side + 0.3 * (v - 0.5 * (VIEWS - 1)), height = v % 2 ? 0.5 : 0.9;
    return tsuya_pose_look_at((tsuya_vec3){2.0 * cos(a), 2.0 * sin(a), height}, (tsuya_vec3){0, 0, 0.1}, (tsuya_vec3){0, 0, 1});
}

static tsuya_vec3 place(int side, int i)
{
    uint64_t n = 3 * (uint64_t)(side * POINTS + i);
    return (tsuya_vec3){(side ? -1.0 : 1.0) * 0.05, 0.5 * (tsuya_random_uniform(1, 1, n) - 0.5), 0.4 * tsuya_random_uniform(1, 1, n + 1)};
}

static tsuya_vec3 corner(int tag, int c)
{
    return (tsuya_vec3){0.2 * (tag % 4 - 1.5) + 0.1 * (c == 1 || c == 2), 0.2 * (tag / 4 - 1) + 0.1 * (c >= 2), 0.0};
}

/* Names go by turns, so that the views of both interleave. */
static void make(tsuya_sparse_model *m, int side)
{
    *m = (tsuya_sparse_model){.camera = tsuya_calloc(1, sizeof *m->camera), .camera_id = tsuya_calloc(1, sizeof *m->camera_id), .camera_count = 1,
                              .view = tsuya_calloc(VIEWS, sizeof *m->view), .view_count = VIEWS, .point = tsuya_calloc(POINTS, sizeof *m->point),
                              .point_count = POINTS};
    m->camera[0] = lens;
    m->camera_id[0] = 1;
    for (int v = 0; v < VIEWS; v++) {
        char name[16];
        snprintf(name, sizeof name, "v%02d.jpg", 2 * v + side);
        m->view[v] = (tsuya_view){.image_id = (uint32_t)(2 * v + side) + 1, .camera_id = 1, .name = tsuya_strdup(name), .camera_from_world = true_pose(side, v),
                                  .observation = tsuya_calloc(POINTS, sizeof *m->view[v].observation)};
    }
    for (int i = 0; i < POINTS; i++) {
        tsuya_point *p = &m->point[i];
        *p = (tsuya_point){.position = place(side, i), .point_id = (uint64_t)i + 1, .track = tsuya_calloc(VIEWS, sizeof *p->track)};
        for (int v = 0; v < VIEWS; v++) {
            tsuya_vec2 pixel;
            assert_true(tsuya_camera_project(&lens, tsuya_pose_apply(true_pose(side, v), p->position), &pixel));
            m->view[v].observation[m->view[v].observation_count] = (tsuya_observation){(float)pixel.x, (float)pixel.y, i};
            p->track[p->track_count++] = (tsuya_track_element){v, m->view[v].observation_count++};
        }
    }
}

typedef struct mat {
    tsuya_scale_sighting sighting[SIGHTINGS];
    tsuya_scale_tag tag[TAGS];
    char name[2 * VIEWS][16];
    tsuya_scale_input input;
} mat;

/* `wrong`: tags that the second group sees elsewhere than they are. */
static void see_mat(mat *m, int wrong)
{
    *m = (mat){.input = {.source = "mat", .sighting = m->sighting, .tag = m->tag, .tag_count = TAGS}};
    for (int t = 0; t < TAGS; t++) {
        m->tag[t].id = t;
        for (int c = 0; c < 4; c++) {
            m->tag[t].corner_m[c] = corner(t, c);
            for (int v = 0; v < 2 * VIEWS; v++) {
                tsuya_vec2 pixel;
                uint64_t n = (uint64_t)((4 * t + c) * 2 * VIEWS + v);
                tsuya_vec3 p = corner(t, c);
                p.z += v % 2 && t < wrong ? 0.05 * (1 + t % 3) : 0.0;
                snprintf(m->name[v], sizeof m->name[v], "v%02d.jpg", v);
                assert_true(tsuya_camera_project(&lens, tsuya_pose_apply(true_pose(v % 2, v / 2), p), &pixel));
                pixel = (tsuya_vec2){pixel.x + SIGMA_PX * tsuya_random_normal(3, 1, n), pixel.y + SIGMA_PX * tsuya_random_normal(3, 2, n)};
                m->sighting[m->input.sighting_count++] = (tsuya_scale_sighting){m->name[v], 4 * t + c, pixel, SIGMA_PX};
            }
        }
    }
}

static const tsuya_similarity elsewhere = {2.7, {{{0.36, 0.48, -0.8}, {-0.8, 0.6, 0.0}, {0.48, 0.64, 0.6}}}, {4.0, -1.0, 7.0}};

static void check_whole(const tsuya_sparse_model *m)
{
    assert_int_equal(m->view_count, 2 * VIEWS);
    assert_int_equal(m->point_count, 2 * POINTS);
    for (int v = 0; v < m->view_count; v++) {
        tsuya_vec3 at = tsuya_pose_center(m->view[v].camera_from_world), truth = tsuya_pose_center(true_pose(v % 2, v / 2));
        assert_int_equal(m->view[v].image_id, v + 1);
        assert_true(tsuya_vec3_norm(tsuya_vec3_sub(at, truth)) < 2e-3);
        for (int k = 0; k < m->view[v].observation_count; k++) { /* tracks and observations name one another */
            const tsuya_point *p = &m->point[m->view[v].observation[k].point];
            bool named = false;
            for (int j = 0; j < p->track_count; j++) {
                named = named || (p->track[j].view == v && p->track[j].observation == k);
            }
            assert_true(named);
        }
    }
    for (int i = 0; i < 2 * POINTS; i++) {
        assert_int_equal(m->point[i].point_id, i + 1);
        assert_true(tsuya_vec3_norm(tsuya_vec3_sub(m->point[i].position, place(i / POINTS, i % POINTS))) < 2e-3);
    }
}

static void join(int wrong, int expected)
{
    static mat tags;
    tsuya_sparse_model front, back;
    int joined;
    make(&front, 0);
    make(&back, 1);
    see_mat(&tags, wrong);
    tsuya_sparse_model_transform(&back, elsewhere);
    assert_ok(tsuya_models_join(&front, &joined, &back, &tags.input));
    assert_int_equal(joined, expected);
    if (expected > 0) {
        check_whole(&front);
    } else {
        tsuya_vec3 truth = tsuya_similarity_apply(elsewhere, place(1, 5));
        assert_int_equal(front.view_count, VIEWS);
        assert_true(tsuya_vec3_norm(tsuya_vec3_sub(back.point[5].position, truth)) < 1e-9);
    }
    tsuya_sparse_model_free(&front);
    tsuya_sparse_model_free(&back);
}

static void test_front_and_back(void **state)
{
    (void)state;
    join(0, VIEWS);
}

static void test_some_tags_are_elsewhere(void **state)
{
    (void)state;
    join(2, VIEWS);
}

static void test_a_mat_that_was_moved_joins_nothing(void **state)
{
    (void)state;
    join(9, 0);
}

static void test_a_view_of_both_comes_once(void **state)
{
    (void)state;
    static mat tags;
    tsuya_sparse_model front, back;
    int joined;
    make(&front, 0);
    make(&back, 1);
    see_mat(&tags, 0);
    tsuya_free(back.view[0].name);
    back.view[0].name = tsuya_strdup("v00.jpg"); /* by name still in order */
    assert_ok(tsuya_models_join(&front, &joined, &back, &tags.input));
    assert_int_equal(joined, VIEWS - 1);
    assert_int_equal(front.view_count, 2 * VIEWS - 1);
    for (size_t i = POINTS; i < front.point_count; i++) {
        assert_int_equal(front.point[i].track_count, VIEWS - 1);
    }
    tsuya_sparse_model_free(&front);
    tsuya_sparse_model_free(&back);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_front_and_back),
        cmocka_unit_test(test_some_tags_are_elsewhere),
        cmocka_unit_test(test_a_mat_that_was_moved_joins_nothing),
        cmocka_unit_test(test_a_view_of_both_comes_once),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
