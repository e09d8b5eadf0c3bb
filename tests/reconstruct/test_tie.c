/* How firmly photographs are tied: predicted against how far poses really scatter, and a photograph that hangs by a thread.
 * The truth of a pose is what the scene was drawn with; the pose under test is found by Gauss–Newton on noisy pixels here. */
#include "support.h"

#include "core/context.h"
#include "core/dense.h"
#include "core/memory.h"
#include "reconstruct/tie.h"

enum { VIEWS = 8, POINTS = 240, TRIALS = 40, LOOSE = 5 };
static const double SIGMA_PX = 0.3;
static const tsuya_camera lens = {.lens = TSUYA_LENS_SIMPLE_RADIAL, .width_px = 1000, .height_px = 800, .fx_px = 1100, .fy_px = 1100,
                                  .cx_px = 499.5, .cy_px = 399.5, .distortion = {-0.05}};

static tsuya_pose true_pose(int v)
{
    double a = 0.3 * (v - 0.5 * (VIEWS - 1)), height = v % 2 ? 0.5 : 0.9;
    return tsuya_pose_look_at((tsuya_vec3){2.0 * cos(a), 2.0 * sin(a), height}, (tsuya_vec3){0, 0, 0.2}, (tsuya_vec3){0, 0, 1});
}

/* In the loose view only points of a small patch; the others see all. */
static bool is_seen(int v, int i, bool loose) { return v != LOOSE || !loose || i < 14; }

static tsuya_vec3 place(int i, bool loose)
{
    uint64_t n = 3 * (uint64_t)i;
    double spread = loose && i < 14 ? 0.04 : 0.45;
    return (tsuya_vec3){spread * (tsuya_random_uniform(1, 1, n) - 0.5), spread * (tsuya_random_uniform(1, 1, n + 1) - 0.5),
                        0.2 + spread * (tsuya_random_uniform(1, 1, n + 2) - 0.5)};
}

static void make(tsuya_sparse_model *m, bool loose, int trial)
{
    *m = (tsuya_sparse_model){.camera = tsuya_calloc(1, sizeof *m->camera), .camera_id = tsuya_calloc(1, sizeof *m->camera_id), .camera_count = 1,
                              .view = tsuya_calloc(VIEWS, sizeof *m->view), .view_count = VIEWS, .point = tsuya_calloc(POINTS, sizeof *m->point),
                              .point_count = POINTS};
    m->camera[0] = lens;
    m->camera_id[0] = 1;
    for (int v = 0; v < VIEWS; v++) {
        char name[16];
        snprintf(name, sizeof name, "v%02d.jpg", v);
        m->view[v] = (tsuya_view){.image_id = (uint32_t)v + 1, .camera_id = 1, .name = tsuya_strdup(name), .camera_from_world = true_pose(v),
                                  .observation = tsuya_calloc(POINTS, sizeof *m->view[v].observation)};
    }
    for (int i = 0; i < POINTS; i++) {
        tsuya_point *p = &m->point[i];
        p->position = place(i, loose);
        p->point_id = (uint64_t)i + 1;
        p->track = tsuya_calloc(VIEWS, sizeof *p->track);
        for (int v = 0; v < VIEWS; v++) {
            tsuya_vec2 pixel;
            uint64_t o = ((uint64_t)trial * POINTS + (uint64_t)i) * VIEWS + (uint64_t)v;
            if (is_seen(v, i, loose)) {
                assert_true(tsuya_camera_project(&lens, tsuya_pose_apply(true_pose(v), p->position), &pixel));
                pixel = (tsuya_vec2){pixel.x + SIGMA_PX * tsuya_random_normal(2, 1, o), pixel.y + SIGMA_PX * tsuya_random_normal(2, 2, o)};
                m->view[v].observation[m->view[v].observation_count] = (tsuya_observation){(float)pixel.x, (float)pixel.y, i};
                p->track[p->track_count++] = (tsuya_track_element){v, m->view[v].observation_count++};
            }
        }
    }
}

/* One step of Gauss–Newton from the true pose over the true points, derivatives by differences of the whole projection. */
static tsuya_pose found_pose(const tsuya_sparse_model *m, int v)
{
    double a[36] = {0}, b[6] = {0};
    const double h = 1e-6;
    const tsuya_view *view = &m->view[v];
    for (int k = 0; k < view->observation_count; k++) {
        tsuya_vec3 world = m->point[view->observation[k].point].position;
        tsuya_vec2 pixel;
        double j[2][6];
        assert_true(tsuya_camera_project(&lens, tsuya_pose_apply(view->camera_from_world, world), &pixel));
        for (int c = 0; c < 6; c++) {
            double x[6] = {0};
            tsuya_vec2 moved;
            x[c] = h;
            tsuya_pose step = {tsuya_mat3_from_rodrigues((tsuya_vec3){x[0], x[1], x[2]}), {x[3], x[4], x[5]}};
            assert_true(tsuya_camera_project(&lens, tsuya_pose_apply(tsuya_pose_compose(step, view->camera_from_world), world), &moved));
            j[0][c] = (moved.x - pixel.x) / h, j[1][c] = (moved.y - pixel.y) / h;
        }
        double r[2] = {(double)view->observation[k].x_px - pixel.x, (double)view->observation[k].y_px - pixel.y};
        for (int i = 0; i < 36; i++) {
            a[i] += j[0][i / 6] * j[0][i % 6] + j[1][i / 6] * j[1][i % 6];
        }
        for (int i = 0; i < 6; i++) {
            b[i] += j[0][i] * r[0] + j[1][i] * r[1];
        }
    }
    assert_true(tsuya_dense_cholesky(a, 6));
    tsuya_dense_forward(a, b, 6, 1);
    tsuya_dense_backward(a, b, 6, 1);
    tsuya_pose step = {tsuya_mat3_from_rodrigues((tsuya_vec3){b[0], b[1], b[2]}), {b[3], b[4], b[5]}};
    return tsuya_pose_compose(step, view->camera_from_world);
}

/* Mean square, per coordinate, of how far points of the scene's middle depth over the whole frame fall from where they belong. */
static double off_px2(tsuya_pose pose, int v)
{
    double sum = 0.0;
    int n = 0;
    for (int y = 80; y < lens.height_px; y += 160) {
        for (int x = 100; x < lens.width_px; x += 200) {
            tsuya_vec3 ray;
            tsuya_vec2 at;
            assert_true(tsuya_camera_unproject(&lens, (tsuya_vec2){x, y}, &ray));
            tsuya_vec3 world = tsuya_pose_apply(tsuya_pose_inverse(true_pose(v)), tsuya_vec3_scale(ray, 2.1 / ray.z));
            assert_true(tsuya_camera_project(&lens, tsuya_pose_apply(pose, world), &at));
            sum += (at.x - x) * (at.x - x) + (at.y - y) * (at.y - y);
            n += 2;
        }
    }
    return sum / n;
}

static void compare(bool loose, double *predicted_px, double *halves_px, double *real_px)
{
    const double sigma[VIEWS] = {SIGMA_PX, SIGMA_PX, SIGMA_PX, SIGMA_PX, SIGMA_PX, SIGMA_PX, SIGMA_PX, SIGMA_PX};
    double real = 0.0, halves = 0.0;
    for (int trial = 0; trial < TRIALS; trial++) {
        tsuya_sparse_model m;
        tsuya_tie tie[VIEWS];
        make(&m, loose, trial);
        m.view[LOOSE].camera_from_world = found_pose(&m, LOOSE);
        real += off_px2(m.view[LOOSE].camera_from_world, LOOSE) / TRIALS;
        assert_ok(tsuya_ties_measure(tie, &m, sigma));
        *predicted_px = tie[LOOSE].normal_px;
        halves += tie[LOOSE].halves_px * tie[LOOSE].halves_px / TRIALS;
        assert_true(tsuya_tie_px(&tie[0]) < 0.5); /* a firm one */
        tsuya_sparse_model_free(&m);
    }
    *real_px = sqrt(real);
    *halves_px = sqrt(halves);
}

static void the_tie_is_how_far_poses_scatter(void **state)
{
    (void)state;
    double predicted, halves, real;
    for (int loose = 0; loose < 2; loose++) {
        compare(loose, &predicted, &halves, &real);
        print_message("%s: predicted %.3f px, by halves %.3f px, really %.3f px\n", loose ? "14 points in a corner" : "240 points", predicted, halves, real);
        assert_true(predicted > 0.75 * real && predicted < 1.4 * real);
        assert_true(halves > 0.6 * real && halves < 1.8 * real);
        assert_true(loose ? predicted > 1.0 : predicted < 0.1);
    }
}

/* Matches of a repeating pattern, off by one period: half of them say one thing, half another. */
static void halves_tell_what_the_scatter_does_not(void **state)
{
    (void)state;
    tsuya_sparse_model m;
    tsuya_tie tie[VIEWS];
    double sigma[VIEWS];
    make(&m, false, 0);
    for (int v = 0; v < VIEWS; v++) {
        sigma[v] = SIGMA_PX;
    }
    for (int k = 0; k < m.view[LOOSE].observation_count; k += 2) {
        m.view[LOOSE].observation[k].x_px += 6.0f;
    }
    assert_ok(tsuya_ties_measure(tie, &m, sigma));
    print_message("half of it 6 px off: by scatter %.3f px, by halves %.3f px\n", tie[LOOSE].normal_px, tie[LOOSE].halves_px);
    assert_true(tie[LOOSE].normal_px < 0.1 && tie[LOOSE].halves_px > 1.0);
    tsuya_sparse_model_free(&m);
}

/* With every point seen by one other view alone, a view is tied in one direction a point; with no points, not at all. */
static void what_does_not_determine_is_infinite(void **state)
{
    (void)state;
    tsuya_sparse_model m;
    tsuya_tie tie[VIEWS];
    double sigma[VIEWS];
    make(&m, true, 0);
    for (int v = 0; v < VIEWS; v++) {
        sigma[v] = SIGMA_PX;
    }
    for (int k = 2; k < m.view[LOOSE].observation_count; k++) {
        m.view[LOOSE].observation[k].point = -1;
    }
    assert_ok(tsuya_ties_measure(tie, &m, sigma));
    assert_int_equal(tie[LOOSE].observations, 2);
    assert_true(isinf(tsuya_tie_px(&tie[LOOSE])));
    m.view[LOOSE].observation_count = 0;
    for (int i = 0; i < POINTS; i++) {
        int kept = 0;
        for (int t = 0; t < m.point[i].track_count; t++) {
            if (m.point[i].track[t].view != LOOSE) {
                m.point[i].track[kept++] = m.point[i].track[t];
            }
        }
        m.point[i].track_count = kept;
    }
    assert_ok(tsuya_ties_measure(tie, &m, sigma));
    assert_true(tie[LOOSE].observations == 0 && isinf(tie[LOOSE].normal_px));
    tsuya_sparse_model_free(&m);
}

static void a_dropped_view_leaves_a_whole_model(void **state)
{
    (void)state;
    tsuya_sparse_model m;
    bool drop[VIEWS] = {false};
    make(&m, true, 0);
    m.point[POINTS - 1].track_count = 2; /* views 0 and 1 alone; the first of them goes */
    for (int v = 2; v < VIEWS; v++) {
        if (v != LOOSE) {
            m.view[v].observation[m.view[v].observation_count - 1].point = -1;
        }
    }
    drop[0] = drop[LOOSE] = true;
    assert_ok(tsuya_views_drop(&m, drop));
    assert_int_equal(m.view_count, VIEWS - 2);
    assert_string_equal(m.view[0].name, "v01.jpg");
    assert_int_equal(m.point_count, POINTS - 1);
    size_t observed = 0, tracked = 0;
    for (size_t i = 0; i < m.point_count; i++) {
        tracked += (size_t)m.point[i].track_count;
        for (int t = 0; t < m.point[i].track_count; t++) {
            const tsuya_track_element *e = &m.point[i].track[t];
            assert_true(e->view >= 0 && e->view < m.view_count);
            assert_int_equal(m.view[e->view].observation[e->observation].point, (int64_t)i);
        }
    }
    for (int v = 0; v < m.view_count; v++) {
        for (int k = 0; k < m.view[v].observation_count; k++) {
            observed += m.view[v].observation[k].point >= 0;
        }
    }
    assert_int_equal(observed, tracked);
    tsuya_sparse_model_free(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(the_tie_is_how_far_poses_scatter),
        cmocka_unit_test(halves_tell_what_the_scatter_does_not),
        cmocka_unit_test(what_does_not_determine_is_infinite),
        cmocka_unit_test(a_dropped_view_leaves_a_whole_model),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
