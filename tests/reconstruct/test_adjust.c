/* The adjustment after the mapper: wrong matches within COLMAP's 4 px no longer bend cameras and lens. */
#include "support.h"

#include "core/memory.h"
#include "reconstruct/adjust.h"
#include "reconstruct/adjust_tags.h"

#include <math.h>
#include <string.h>

enum { VIEWS = 14, POINTS = 500 };

static double noise(uint64_t stream, uint64_t i) { return tsuya_random_normal(5, stream, i); }

static tsuya_pose true_pose(int v)
{
    double a = 2.0 * M_PI * v / VIEWS, height = v % 2 ? 0.5 : 1.1;
    return tsuya_pose_look_at((tsuya_vec3){2.0 * cos(a), 2.0 * sin(a), height}, (tsuya_vec3){0, 0, 0.2}, (tsuya_vec3){0, 0, 1});
}

static const tsuya_camera lens = {.lens = TSUYA_LENS_SIMPLE_RADIAL, .width_px = 1000, .height_px = 800, .fx_px = 1100, .fy_px = 1100,
                                  .cx_px = 507.5, .cy_px = 393.5, .distortion = {-0.05}};

/* Each point is seen by 4 neighbouring views; `wrong` of the observations slid along a pattern, all to the same side. */
static void make_points(tsuya_sparse_model *m, int points, double wrong, bool exact_start)
{
    *m = (tsuya_sparse_model){.camera = tsuya_calloc(1, sizeof *m->camera), .camera_id = tsuya_calloc(1, sizeof *m->camera_id), .camera_count = 1,
                              .view = tsuya_calloc(VIEWS, sizeof *m->view), .view_count = VIEWS, .point = tsuya_calloc((size_t)points, sizeof *m->point),
                              .point_count = (size_t)points};
    m->camera[0] = lens;
    m->camera_id[0] = 1;
    if (!exact_start) { /* what EXIF tells */
        m->camera[0].fx_px = m->camera[0].fy_px = 1090;
        m->camera[0].cx_px = 499.5;
        m->camera[0].cy_px = 399.5;
    }
    for (int v = 0; v < VIEWS; v++) {
        char name[16];
        snprintf(name, sizeof name, "v%02d.jpg", v);
        m->view[v] = (tsuya_view){.image_id = (uint32_t)v + 1, .camera_id = 1, .name = tsuya_strdup(name), .camera_from_world = true_pose(v),
                                  .observation = tsuya_calloc((size_t)points, sizeof *m->view[v].observation)};
    }
    for (int i = 0; i < points; i++) {
        uint64_t n = (uint64_t)i;
        tsuya_point *p = &m->point[i];
        p->position = (tsuya_vec3){0.35 * noise(1, 3 * n), 0.35 * noise(1, 3 * n + 1), 0.2 + 0.25 * noise(1, 3 * n + 2)};
        p->point_id = n + 1;
        p->track = tsuya_calloc(4, sizeof *p->track);
        for (int k = 0; k < 4; k++) {
            int v = (i + k) % VIEWS;
            tsuya_vec2 pixel;
            assert_true(tsuya_camera_project(&lens, tsuya_pose_apply(true_pose(v), p->position), &pixel));
            uint64_t o = 4 * n + (uint64_t)k;
            bool slid = tsuya_random_uniform(6, 1, o) < wrong;
            m->view[v].observation[m->view[v].observation_count] =
                (tsuya_observation){(float)(pixel.x + 0.1 * noise(2, o) + (slid ? 2.0 : 0.0)), (float)(pixel.y + 0.1 * noise(3, o)), i};
            p->track[p->track_count++] = (tsuya_track_element){v, m->view[v].observation_count++};
        }
    }
}

static void make(tsuya_sparse_model *m, double wrong, bool exact_start) { make_points(m, POINTS, wrong, exact_start); }

/* rms of the camera centres after the best similarity, in units of the scene (2 is the distance of the cameras). */
static double center_error(const tsuya_sparse_model *m)
{
    tsuya_vec3 own[VIEWS], truth[VIEWS];
    tsuya_similarity s;
    double rms;
    for (int v = 0; v < VIEWS; v++) {
        own[v] = tsuya_pose_center(m->view[v].camera_from_world);
        truth[v] = tsuya_pose_center(true_pose(v));
    }
    assert_true(tsuya_similarity_align(&s, &rms, truth, own, VIEWS));
    return rms;
}

static void open_folder(tsuya_colmap *colmap, const tsuya_context *context)
{
    assert_ok(tsuya_colmap_create(colmap, test_folder(), test_folder(), context));
}

/* What least squares make of it: where the mapper ends. */
static void squares(tsuya_sparse_model *m, tsuya_colmap *colmap, double wrong)
{
    make(m, wrong, false);
    assert_ok(tsuya_folder_make(test_path("plain")));
    assert_ok(tsuya_sparse_model_save_binary(m, test_path("plain")));
    tsuya_sparse_model_free(m);
    assert_ok(tsuya_colmap_adjust(colmap, "plain", "plain2", TSUYA_ADJUST_LENS));
    assert_ok(tsuya_sparse_model_load(m, test_path("plain2")));
}

static void test_wrong_matches_are_left_out(void **state)
{
    (void)state;
    tsuya_context context = tsuya_context_default();
    tsuya_colmap colmap;
    tsuya_sparse_model clean, plain, wrong;
    tsuya_adjust_info info;
    open_folder(&colmap, &context);
    squares(&plain, &colmap, 0.08);
    squares(&wrong, &colmap, 0.08);
    squares(&clean, &colmap, 0.0);
    assert_ok(tsuya_adjust(&clean, &info, NULL, &colmap, false, NULL));
    assert_true((double)info.kept >= 0.98 * (double)info.observations); /* nothing is wrong but the lens at the start */
    assert_ok(tsuya_adjust(&wrong, &info, NULL, &colmap, false, NULL));
    double e_plain = center_error(&plain), e_clean = center_error(&clean), e = center_error(&wrong);
    print_message("centres: %.2g plain, %.2g adjusted, %.2g without wrong matches; focal %.3f, centre %.2f %.2f; kept %zu of %zu, sigma %.3f px, %d rounds\n",
                  e_plain, e, e_clean, wrong.camera[0].fx_px, wrong.camera[0].cx_px, wrong.camera[0].cy_px, info.kept, info.observations, info.sigma_px, info.rounds);
    assert_true(e <= 0.35 * e_plain);
    assert_true(e <= 1.7 * e_clean);
    assert_true(fabs(wrong.camera[0].fx_px / 1100.0 - 1.0) <= 0.001);
    assert_near(wrong.camera[0].cx_px, lens.cx_px, 0.8);
    assert_near(wrong.camera[0].cy_px, lens.cy_px, 0.8);
    assert_true(info.sigma_px > 0.07 && info.sigma_px < 0.12);
    tsuya_sparse_model_free(&clean);
    tsuya_sparse_model_free(&plain);
    tsuya_sparse_model_free(&wrong);
}

/* From 50,000 residuals on COLMAP's adjustment takes as many threads as it finds processors, whose sums come in any order. */
static void test_many_residuals_twice_are_the_same(void **state)
{
    (void)state;
    enum { MANY = 7000 };
    tsuya_context context = tsuya_context_default();
    tsuya_colmap colmap;
    tsuya_sparse_model m;
    char *bytes[3];
    size_t size[3];
    open_folder(&colmap, &context);
    make_points(&m, MANY, 0.02, false);
    assert_ok(tsuya_folder_make(test_path("many")));
    assert_ok(tsuya_sparse_model_save_binary(&m, test_path("many")));
    tsuya_sparse_model_free(&m);
    for (int i = 0; i < 3; i++) {
        assert_ok(tsuya_colmap_adjust(&colmap, "many", "again", TSUYA_ADJUST_LENS));
        assert_ok(tsuya_file_load(&bytes[i], &size[i], test_path("again/points3D.bin"), 1 << 26));
    }
    for (int i = 1; i < 3; i++) {
        assert_true(size[i] == size[0] && memcmp(bytes[i], bytes[0], size[0]) == 0);
    }
    for (int i = 0; i < 3; i++) {
        tsuya_free(bytes[i]);
    }
}

static void test_known_lens_stays_and_twice_is_the_same(void **state)
{
    (void)state;
    tsuya_context context = tsuya_context_default();
    tsuya_colmap colmap;
    tsuya_sparse_model a, b;
    tsuya_adjust_info info;
    open_folder(&colmap, &context);
    make(&a, 0.08, true);
    make(&b, 0.08, true);
    assert_ok(tsuya_adjust(&a, &info, NULL, &colmap, true, NULL));
    assert_ok(tsuya_adjust(&b, &info, NULL, &colmap, true, NULL));
    assert_memory_equal(&a.camera[0], &lens, sizeof lens);
    assert_int_equal(a.point_count, b.point_count);
    for (int v = 0; v < VIEWS; v++) {
        assert_memory_equal(&a.view[v].camera_from_world, &b.view[v].camera_from_world, sizeof a.view[v].camera_from_world);
    }
    for (size_t i = 0; i < a.point_count; i++) {
        assert_memory_equal(&a.point[i].position, &b.point[i].position, sizeof a.point[i].position);
        assert_true(a.point[i].track_count >= 2);
    }
    tsuya_sparse_model_free(&a);
    tsuya_sparse_model_free(&b);
}

/* ---- tags ---- */

enum { TAG_COUNT = 40, SIGHTINGS = 4 * TAG_COUNT * VIEWS };

typedef struct tags {
    tsuya_scale_sighting sighting[SIGHTINGS];
    tsuya_scale_tag tag[TAG_COUNT];
    char name[VIEWS][16];
    const char *plate[1];
    tsuya_scale_input input;
} tags;

/* A mat of tags below the scene, seen by every camera, a twentieth of a pixel sharp. */
static void make_tags(tags *t)
{
    *t = (tags){.plate = {"mat"}};
    t->input = (tsuya_scale_input){.source = "mat.yaml", .sighting = t->sighting, .tag = t->tag, .tag_count = TAG_COUNT, .plate = t->plate, .plate_count = 1};
    for (int v = 0; v < VIEWS; v++) {
        snprintf(t->name[v], sizeof t->name[v], "v%02d.jpg", v);
    }
    for (int k = 0; k < 4 * TAG_COUNT; k++) {
        int i = k / 4, c = k % 4;
        tsuya_vec3 p = {-0.35 + 0.1 * (i % 8) + (c == 1 || c == 2 ? 0.06 : 0.0), -0.2 + 0.1 * (i / 8) + (c >= 2 ? 0.06 : 0.0), 0.0};
        t->tag[i].id = i;
        t->tag[i].corner_m[c] = p;
        for (int v = 0; v < VIEWS; v++) {
            tsuya_vec2 pixel;
            uint64_t o = (uint64_t)k * VIEWS + (uint64_t)v;
            assert_true(tsuya_camera_project(&lens, tsuya_pose_apply(true_pose(v), p), &pixel));
            pixel = (tsuya_vec2){pixel.x + 0.05 * noise(7, o), pixel.y + 0.05 * noise(8, o)};
            t->sighting[t->input.sighting_count++] = (tsuya_scale_sighting){t->name[v], k, pixel, 0.05};
        }
    }
}

static void test_tags_hold_the_cameras(void **state)
{
    (void)state;
    static tags t;
    tsuya_context context = tsuya_context_default();
    tsuya_colmap colmap;
    tsuya_sparse_model without, with;
    tsuya_adjust_info info;
    make_tags(&t);
    open_folder(&colmap, &context);
    squares(&without, &colmap, 0.08);
    squares(&with, &colmap, 0.08);
    assert_ok(tsuya_adjust(&without, &info, NULL, &colmap, false, NULL));
    assert_int_equal(info.tag_observations, 0);
    assert_ok(tsuya_adjust(&with, &info, NULL, &colmap, false, &t.input));
    double before = center_error(&without), after = center_error(&with);
    print_message("centres: %.2g without tags, %.2g with %zu observations of corners; %zu and %zu points\n", before, after, info.tag_observations, without.point_count, with.point_count);
    assert_true(info.tag_observations >= SIGHTINGS);
    assert_true(after <= 0.75 * before);
    assert_true(with.point_count <= POINTS && with.point_count >= without.point_count * 9 / 10);
    for (int v = 0; v < VIEWS; v++) { /* nothing but features is left */
        assert_int_equal(with.view[v].observation_count, without.view[v].observation_count);
    }
    for (size_t i = 0; i < with.point_count; i++) {
        for (int k = 0; k < with.point[i].track_count; k++) {
            const tsuya_track_element *e = &with.point[i].track[k];
            assert_true(e->observation < with.view[e->view].observation_count);
            assert_int_equal(with.view[e->view].observation[e->observation].point, (int64_t)i);
        }
    }
    tsuya_sparse_model_free(&without);
    tsuya_sparse_model_free(&with);
}

/* One view out of the model, as if it had no features; another photograph shows tags of somewhere else. */
static void test_tags_place_a_photograph(void **state)
{
    (void)state;
    enum { GONE = 5 };
    static tags t;
    tsuya_sparse_model m;
    tsuya_database_image image[VIEWS];
    tsuya_database database = {.image = image, .image_count = VIEWS};
    int placed;
    make_tags(&t);
    make(&m, 0.0, true);
    for (int v = 0; v < VIEWS; v++) {
        image[v] = (tsuya_database_image){.image_id = (uint32_t)v + 1, .camera_id = 1, .name = t.name[v]};
    }
    for (size_t i = 0; i < m.point_count; i++) { /* tracks of the view and then the view */
        tsuya_point *p = &m.point[i];
        int kept = 0;
        for (int k = 0; k < p->track_count; k++) {
            tsuya_track_element e = p->track[k];
            if (e.view != GONE) {
                p->track[kept++] = (tsuya_track_element){e.view - (e.view > GONE), e.observation};
            }
        }
        p->track_count = kept;
    }
    tsuya_free(m.view[GONE].name);
    tsuya_free(m.view[GONE].observation);
    memmove(&m.view[GONE], &m.view[GONE + 1], (VIEWS - GONE - 1) * sizeof *m.view);
    m.view_count--;
    assert_ok(tsuya_tags_place(&m, &placed, &database, &t.input));
    assert_int_equal(placed, 1);
    assert_int_equal(m.view_count, VIEWS);
    assert_string_equal(m.view[GONE].name, "v05.jpg");
    assert_int_equal(m.view[GONE].image_id, GONE + 1);
    tsuya_pose off = tsuya_pose_compose(m.view[GONE].camera_from_world, tsuya_pose_inverse(true_pose(GONE)));
    print_message("placed by tags: %.2g rad, %.2g of 2 off\n", tsuya_mat3_rotation_angle_rad(off.rotation), tsuya_vec3_norm(off.translation));
    assert_true(tsuya_mat3_rotation_angle_rad(off.rotation) < 1e-3);
    assert_true(tsuya_vec3_norm(off.translation) < 2e-3);
    for (size_t i = 0; i < m.point_count; i++) {
        for (int k = 0; k < m.point[i].track_count; k++) {
            const tsuya_track_element *e = &m.point[i].track[k];
            assert_int_equal(m.view[e->view].observation[e->observation].point, (int64_t)i);
        }
    }
    tsuya_sparse_model_free(&m);
}

static void test_tags_that_do_not_agree_place_nothing(void **state)
{
    (void)state;
    static tags t;
    tsuya_sparse_model m;
    char stranger[] = "w.jpg";
    tsuya_database_image image = {.image_id = 77, .camera_id = 1, .name = stranger};
    tsuya_database database = {.image = &image, .image_count = 1};
    int placed;
    make_tags(&t);
    make(&m, 0.0, true);
    for (int i = 0; i < t.input.sighting_count; i++) { /* the last view's tags are scattered over another photograph */
        if (t.sighting[i].photo == t.name[VIEWS - 1]) {
            t.sighting[i].photo = stranger;
            t.sighting[i].pixel = (tsuya_vec2){1000.0 * tsuya_random_uniform(9, 1, (uint64_t)i), 800.0 * tsuya_random_uniform(9, 2, (uint64_t)i)};
        }
    }
    assert_ok(tsuya_tags_place(&m, &placed, &database, &t.input));
    assert_int_equal(placed, 0);
    assert_int_equal(m.view_count, VIEWS);
    tsuya_sparse_model_free(&m);
}

static void test_empty_model_stays(void **state)
{
    (void)state;
    tsuya_context context = tsuya_context_default();
    tsuya_colmap colmap;
    tsuya_sparse_model m;
    tsuya_adjust_info info;
    open_folder(&colmap, &context);
    make(&m, 0.0, true);
    size_t points = m.point_count;
    m.point_count = 0;
    assert_ok(tsuya_adjust(&m, &info, NULL, &colmap, true, NULL));
    assert_int_equal(info.rounds, 0);
    assert_int_equal(m.view_count, VIEWS);
    m.point_count = points;
    tsuya_sparse_model_free(&m);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_wrong_matches_are_left_out),
        cmocka_unit_test(test_many_residuals_twice_are_the_same),
        cmocka_unit_test(test_known_lens_stays_and_twice_is_the_same),
        cmocka_unit_test(test_tags_hold_the_cameras),
        cmocka_unit_test(test_tags_place_a_photograph),
        cmocka_unit_test(test_tags_that_do_not_agree_place_nothing),
        cmocka_unit_test(test_empty_model_stays),
    };
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
