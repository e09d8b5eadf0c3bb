/* Metric scale and frame from tags and from measured distances.  The truth is projected and drawn by the tests' own lens and
 * sampler; the reconstruction is the true cameras moved, scaled and disturbed. */
#include "support.h"

#include "corners_scene.h"
#include "reconstruct/scale.h"
#include "scene.h"

#include "app/calib_scale.h"

enum { VIEWS = 12, MOST = 4 * 200 * VIEWS };

typedef struct world {
    int views;
    double noise_px;        /* of corners */
    double pose_error;      /* of cameras: rotation (rad) and centre (m, a tenth of it per metre) */
    double growth;          /* of the printed tags */
    double elevation_rad;
    tsuya_pose mat_from_second; /* where the second plate stands */
    uint64_t seed;
} world;

typedef struct made {
    tsuya_sparse_model model;
    tsuya_camera camera;
    uint32_t camera_id;
    tsuya_view view[VIEWS];
    char name[VIEWS][16];
    tsuya_pose truth[VIEWS]; /* camera_from_mat */
    tsuya_similarity model_from_mat;
    tsuya_scale_sighting sighting[MOST];
    tsuya_scale_tag tag[256];
    const char *plate[2];
    tsuya_scale_input input;
} made;

static world usual(void)
{
    return (world){.views = VIEWS, .noise_px = 0.1, .pose_error = 2e-5, .elevation_rad = 0.8, .mat_from_second = tsuya_pose_identity(), .seed = 1};
}

static double draw(const world *w, uint64_t stream, uint64_t k) { return tsuya_random_normal(w->seed, stream, k); }

static tsuya_pose pose_of(const world *w, int v)
{
    double azimuth = 0.9 * v + 0.1 * draw(w, 1, (uint64_t)v), distance = 0.8 + 0.05 * draw(w, 2, (uint64_t)v);
    double elevation = w->elevation_rad + 0.08 * draw(w, 3, (uint64_t)v);
    tsuya_vec3 target = {0.12, 0.10, 0.02};
    tsuya_vec3 eye = {target.x + distance * cos(elevation) * cos(azimuth), target.y + distance * cos(elevation) * sin(azimuth),
                      target.z + distance * sin(elevation)};
    return tsuya_pose_look_at(eye, target, (tsuya_vec3){0, 0, 1});
}

static tsuya_pose disturbed(const world *w, tsuya_pose pose, int v)
{
    double n[6];
    for (int i = 0; i < 6; i++) {
        n[i] = w->pose_error * draw(w, 10 + (uint64_t)v, (uint64_t)i);
    }
    pose.rotation = tsuya_mat3_multiply(tsuya_mat3_from_rodrigues((tsuya_vec3){n[0], n[1], n[2]}), pose.rotation);
    pose.translation = tsuya_vec3_add(pose.translation, (tsuya_vec3){n[3], n[4], n[5]});
    return pose;
}

/* camera_from_model of camera_from_mat, and the camera's unit with it. */
static tsuya_pose into_model(tsuya_similarity s, tsuya_pose p)
{
    tsuya_pose q = {.rotation = tsuya_mat3_multiply(p.rotation, tsuya_mat3_transpose(s.rotation))};
    q.translation = tsuya_vec3_sub(tsuya_vec3_scale(p.translation, s.scale), tsuya_mat3_apply(q.rotation, s.translation));
    return q;
}

static void add_board(made *m, const tsuya_board *board, int plate)
{
    for (int t = 0; t < board->tag_count; t++) {
        m->tag[m->input.tag_count] = (tsuya_scale_tag){.id = board->tag[t].id, .plate = plate};
        for (int c = 0; c < 4; c++) {
            m->tag[m->input.tag_count].corner_m[c] = tsuya_board_corner(board, t, c);
        }
        m->input.tag_count++;
    }
    m->plate[plate] = plate ? "second" : "mat";
    m->input.plate_count = plate + 1;
}

static void sight(made *m, const world *w)
{
    for (int k = 0; k < 4 * m->input.tag_count; k++) {
        const tsuya_scale_tag *tag = &m->tag[k / 4];
        tsuya_vec3 center = tsuya_vec3_scale(tsuya_vec3_add(tag->corner_m[0], tag->corner_m[2]), 0.5);
        tsuya_vec3 p = tsuya_vec3_mad(center, 1.0 + w->growth, tsuya_vec3_sub(tag->corner_m[k % 4], center));
        p = tag->plate ? tsuya_pose_apply(w->mat_from_second, p) : p;
        for (int v = 0; v < w->views; v++) {
            tsuya_vec2 q = scene_pixel(tsuya_pose_apply(m->truth[v], p));
            q.x += w->noise_px * draw(w, 100 + (uint64_t)v, 2 * (uint64_t)k);
            q.y += w->noise_px * draw(w, 100 + (uint64_t)v, 2 * (uint64_t)k + 1);
            m->sighting[m->input.sighting_count++] = (tsuya_scale_sighting){m->name[v], k, q, w->noise_px};
        }
    }
}

static void make_cameras(made *m, const world *w)
{
    m->camera = (tsuya_camera){.lens = TSUYA_LENS_OPENCV4, .width_px = SCENE_WIDTH, .height_px = SCENE_HEIGHT, .fx_px = SCENE_FOCAL, .fy_px = SCENE_FOCAL,
                               .cx_px = SCENE_CX, .cy_px = SCENE_CY, .distortion = {SCENE_K1, SCENE_K2}};
    m->camera_id = 1;
    m->model_from_mat = (tsuya_similarity){7.3, tsuya_mat3_from_rodrigues((tsuya_vec3){0.4, -1.1, 0.7}), {3.0, -2.0, 11.0}};
    for (int v = 0; v < w->views; v++) {
        snprintf(m->name[v], sizeof m->name[v], "v%02d.jpg", v);
        m->truth[v] = pose_of(w, v);
        m->view[v] = (tsuya_view){.image_id = (uint32_t)v + 1, .camera_id = 1, .name = m->name[v],
                                  .camera_from_world = into_model(m->model_from_mat, disturbed(w, m->truth[v], v))};
    }
    m->model = (tsuya_sparse_model){.camera = &m->camera, .camera_id = &m->camera_id, .camera_count = 1, .view = m->view, .view_count = w->views};
    m->input = (tsuya_scale_input){.source = "mat.yaml", .sighting = m->sighting, .tag = m->tag, .plate = m->plate};
}

static void make(made *m, const world *w, int cols, int rows)
{
    tsuya_board board;
    make_cameras(m, w);
    assert_ok(tsuya_board_grid(&board, "tag36h11", 1, cols, rows, 0.030, 0.012, 0));
    add_board(m, &board, 0);
    tsuya_board_free(&board);
    sight(m, w);
}

/* Largest distance of a camera's centre from where it truly is, in the mat's frame. */
static double worst_center_m(const made *m, tsuya_similarity metric)
{
    double worst = 0.0;
    for (int v = 0; v < m->model.view_count; v++) {
        tsuya_vec3 at = tsuya_similarity_apply(metric, tsuya_pose_center(m->view[v].camera_from_world));
        worst = fmax(worst, tsuya_vec3_norm(tsuya_vec3_sub(at, tsuya_pose_center(m->truth[v]))));
    }
    return worst;
}

static void test_scale_and_frame(void **state)
{
    (void)state;
    static made m;
    world w = usual();
    tsuya_similarity metric;
    tsuya_scale_info info;
    make(&m, &w, 6, 4);
    assert_ok(tsuya_scale_find(&metric, &info, &m.model, &m.input));
    printf("6 x 4 tags: scale off by %.1e (sigma %.1e), cameras by %.2f mm, held-out tags %.3f mm, spacing %.3f mm, %.3f px\n", metric.scale * 7.3 - 1.0,
           info.sigma_rel, 1e3 * worst_center_m(&m, metric), 1e3 * info.rms_m, 1e3 * info.spacing_rms_m, info.reprojection_px);
    assert_near(metric.scale, 1.0 / 7.3, 3e-4 / 7.3);
    assert_true(worst_center_m(&m, metric) < 1e-3);
    assert_true(info.rms_m > 0.0 && info.rms_m < 2e-4);
    assert_int_equal(info.tags_used, 24);
    assert_int_equal(info.reference, 0);
    assert_true(info.outliers <= 3);
}

/* A wrong tag edge moves no tag: the distances between them give the scale. */
static void test_growth_does_not_matter(void **state)
{
    (void)state;
    static made m;
    world w = usual();
    tsuya_similarity metric;
    tsuya_scale_info info;
    w.growth = 0.012;
    make(&m, &w, 3, 2);
    assert_ok(tsuya_scale_find(&metric, &info, &m.model, &m.input));
    printf("tags 1.2 %% larger: scale off by %.1e, growth %.4f\n", metric.scale * 7.3 - 1.0, info.plate[0].growth);
    assert_near(metric.scale * 7.3, 1.0, 1e-3);
    assert_near(info.plate[0].growth, 0.012, 0.004);
}

/* Predicted against observed scatter of the scale, over many scenes. */
static void test_sigma_is_honest(void **state)
{
    (void)state;
    static made m;
    double sum = 0.0, predicted = 0.0, rms = 0.0;
    enum { SCENES = 60 };
    for (int i = 0; i < SCENES; i++) {
        world w = usual();
        tsuya_similarity metric;
        tsuya_scale_info info;
        w.seed = 100 + (uint64_t)i;
        w.pose_error = 0.0;
        make(&m, &w, 3, 3);
        assert_ok(tsuya_scale_find(&metric, &info, &m.model, &m.input));
        sum += (metric.scale * 7.3 - 1.0) * (metric.scale * 7.3 - 1.0);
        predicted += info.sigma_rel * info.sigma_rel;
        rms += info.rms_m / SCENES;
    }
    printf("scale: predicted over observed sigma %.2f (observed %.1e); held-out tags %.3f mm\n", sqrt(predicted / sum), sqrt(sum / SCENES), 1e3 * rms);
    assert_true(sqrt(predicted / sum) > 0.8 && sqrt(predicted / sum) < 1.3);
}

static void test_two_plates(void **state)
{
    (void)state;
    static made m;
    world w = usual();
    tsuya_board board;
    tsuya_similarity metric;
    tsuya_scale_info info;
    w.mat_from_second.rotation = tsuya_mat3_from_rodrigues((tsuya_vec3){0.3, 0, 0});
    w.mat_from_second.translation = (tsuya_vec3){0.0, 0.2, 0.05};
    make_cameras(&m, &w);
    assert_ok(tsuya_board_grid(&board, "tag36h11", 1, 3, 3, 0.030, 0.012, 0));
    add_board(&m, &board, 0);
    tsuya_board_free(&board);
    assert_ok(tsuya_board_grid(&board, "tag36h11", 1, 5, 3, 0.020, 0.008, 20));
    add_board(&m, &board, 1);
    tsuya_board_free(&board);
    sight(&m, &w);
    assert_ok(tsuya_scale_find(&metric, &info, &m.model, &m.input));
    assert_near(metric.scale * 7.3, 1.0, 5e-4);
    tsuya_pose p = info.plate[1].plate_from_reference;
    assert_near(tsuya_mat3_rotation_angle_rad(p.rotation), 0.3, 1e-3);
    assert_near(tsuya_vec3_norm(p.translation), hypot(0.2, 0.05), 5e-4);
}

/* Sightings that `keep` refuses are dropped. */
static void filter(made *m, bool (*keep)(const tsuya_scale_sighting *s))
{
    int n = 0;
    for (int i = 0; i < m->input.sighting_count; i++) {
        if (keep(&m->sighting[i])) {
            m->sighting[n++] = m->sighting[i];
        }
    }
    m->input.sighting_count = n;
}
static bool in_one(const tsuya_scale_sighting *s) { return strcmp(s->photo, "v03.jpg") == 0; }
static bool some(const tsuya_scale_sighting *s) { return (s->point / 4 * 7 + atoi(s->photo + 1) * 3) % 4 == 0; }
static bool one_tag(const tsuya_scale_sighting *s) { return s->point / 4 == 8; }

static void test_what_cannot_give_a_scale(void **state)
{
    (void)state;
    static made m;
    world w = usual();
    tsuya_similarity metric;
    tsuya_scale_info info;
    make(&m, &w, 6, 4);
    filter(&m, in_one);
    assert_fails(tsuya_scale_find(&metric, &info, &m.model, &m.input), "mat.yaml: its tags are seen in one registered photograph only");
    make(&m, &w, 6, 4);
    m.model.view_count = 0;
    assert_fails(tsuya_scale_find(&metric, &info, &m.model, &m.input), "none of its tags is seen in a photograph that could be registered");
    make(&m, &w, 6, 4); /* the ids of another board: every tag elsewhere */
    for (int t = 0; t < m.input.tag_count; t++) {
        tsuya_vec3 by = {0.5 * tsuya_random_uniform(9, 1, (uint64_t)t), 0.5 * tsuya_random_uniform(9, 2, (uint64_t)t), 0};
        for (int c = 0; c < 4; c++) {
            m.tag[t].corner_m[c] = tsuya_vec3_add(m.tag[t].corner_m[c], by);
        }
    }
    assert_fails(tsuya_scale_find(&metric, &info, &m.model, &m.input), "do not lie as the file says");
}

static void test_partly_seen_and_partly_wrong(void **state)
{
    (void)state;
    static made m;
    world w = usual();
    tsuya_similarity metric;
    tsuya_scale_info info;
    make(&m, &w, 6, 4);
    filter(&m, some);
    assert_ok(tsuya_scale_find(&metric, &info, &m.model, &m.input));
    assert_near(metric.scale * 7.3, 1.0, 6e-4);
    make(&m, &w, 6, 4); /* four tags glued elsewhere, and one photograph whose corners are all wrong */
    for (int t = 3; t < 24; t += 6) {
        for (int c = 0; c < 4; c++) {
            m.tag[t].corner_m[c].x += 0.011;
        }
    }
    for (int i = 0; i < m.input.sighting_count; i++) {
        m.sighting[i].pixel.x += in_one(&m.sighting[i]) ? 40.0 : 0.0;
    }
    assert_ok(tsuya_scale_find(&metric, &info, &m.model, &m.input));
    assert_near(metric.scale * 7.3, 1.0, 3e-4);
    assert_int_equal(info.tags_used, 20);
    assert_int_equal(info.plate[0].outliers, 16);
    make(&m, &w, 6, 4);
    filter(&m, one_tag);
    assert_ok(tsuya_scale_find(&metric, &info, &m.model, &m.input));
    assert_near(metric.scale * 7.3, 1.0, 3e-3);
    assert_true(isnan(info.rms_m));
}

static void test_distances(void **state)
{
    (void)state;
    static made m;
    world w = usual();
    static const char *const one[] = {"0.21", "v00.jpg - 500,500", "v01.jpg 1,2 3,4"};
    tsuya_scale_distance distance[] = {{0, 4 * 5, 0.210}, {3, 4 * 18 + 3, 0.126}, {0, 4 * 18, 0.126}};
    tsuya_similarity metric;
    tsuya_scale_info info;
    make(&m, &w, 6, 4);
    m.input.tag_count = m.input.plate_count = 0;
    m.input.distance = distance;
    m.input.distance_count = 3;
    assert_ok(tsuya_scale_find(&metric, &info, &m.model, &m.input));
    printf("three distances: scale off by %.1e, each against the others %.3f mm\n", metric.scale * 7.3 - 1.0, 1e3 * info.rms_m);
    assert_near(metric.scale * 7.3, 1.0, 1e-3);
    assert_true(info.rms_m < 3e-4);
    assert_int_equal(info.reference, -1);

    tsuya_photo photo[] = {{.name = "v00.jpg", .width_px = 1600, .height_px = 1200}, {.name = "v01.jpg", .width_px = 1600, .height_px = 1200}};
    tsuya_photo_set photos = {photo, 2, NULL};
    tsuya_yaml_list list = {(void *)one, 3}, all = {&list, 1};
    tsuya_calib_scale s;
    assert_ok(tsuya_calib_scale_from_distances(&s, &all, "JOB.yaml: scale: distances", &photos));
    assert_int_equal(s.input.sighting_count, 3);
    assert_near(s.input.sighting[0].pixel.y, 2.0, 0.0);
    tsuya_calib_scale_free(&s);
    static const char *const bad[][3] = {{"0.21", "v09.jpg 1,2 3,4", "v01.jpg 1,2 3,4"}, {"-1", "v00.jpg 1,2 3,4", "v01.jpg 1,2 3,4"},
                                         {"0.2", "v00.jpg 1;2 3,4", "v01.jpg 1,2 3,4"}, {"0.2", "v00.jpg 1,2 3,4", "v01.jpg 1,2 3000,4"}};
    static const char *const says[] = {"'v09.jpg' is not one of the photographs", "needs metres", "with the pixels of both ends", "outside the photograph"};
    for (int i = 0; i < 4; i++) {
        list.item = (void *)bad[i];
        assert_fails(tsuya_calib_scale_from_distances(&s, &all, "JOB.yaml: scale: distances", &photos), says[i]);
    }
}

/* From pixels: photographs of a mat, its tags found as a job finds them. */
static void test_from_photographs(void **state)
{
    (void)state;
    static made m;
    static const char yaml[] = "{family: tag36h11, border_bits: 1, cols: 5, rows: 4, tag_mm: 30, gap_mm: 12, first_id: 3}";
    world w = usual();
    scene_look look = scene_look_default();
    tsuya_photo_set photos;
    tsuya_calib_scale s;
    tsuya_context context = tsuya_context_default();
    tsuya_similarity metric;
    tsuya_scale_info info;
    tsuya_board board;
    w.views = 4;
    w.pose_error = 0.0;
    make_cameras(&m, &w);
    assert_ok(tsuya_board_parse(&board, yaml, "mat"));
    assert_ok(tsuya_folder_make(test_path("photos")));
    for (int v = 0; v < w.views; v++) {
        tsuya_image image, photo;
        char path[64];
        look.seed = 50 + (uint64_t)v;
        scene_begin(&image, SCENE_WIDTH, SCENE_HEIGHT, &look);
        scene_plate(&image, &board, 0, &m.camera, m.truth[v], &look);
        scene_end(&photo, &image, &look);
        snprintf(path, sizeof path, "photos/v%02d.png", v);
        snprintf(m.name[v], sizeof m.name[v], "v%02d.png", v);
        assert_ok(tsuya_image_save(&photo, test_path(path), NULL));
        tsuya_image_free(&photo);
        tsuya_image_free(&image);
    }
    tsuya_board_free(&board);
    assert_ok(tsuya_file_write(test_path("mat.yaml"), yaml, sizeof yaml - 1));
    assert_ok(tsuya_photo_set_load(&photos, test_path("photos"), NULL));
    assert_ok(tsuya_calib_scale_from_board(&s, test_path("mat.yaml"), &photos, &context));
    assert_ok(tsuya_scale_find(&metric, &info, &m.model, &s.input));
    printf("from photographs: %d of 20 tags, scale off by %.1e (sigma %.1e), cameras by %.2f mm, held-out tags %.3f mm, %.3f px\n", info.tags_used,
           metric.scale * 7.3 - 1.0, info.sigma_rel, 1e3 * worst_center_m(&m, metric), 1e3 * info.rms_m, info.reprojection_px);
    assert_near(metric.scale * 7.3, 1.0, 2e-4);
    assert_true(worst_center_m(&m, metric) < 5e-4);
    assert_true(info.tags_used >= 19 && info.rms_m < 1e-4);
    tsuya_calib_scale_free(&s);
    static const char other[] = "{family: tag36h11, border_bits: 1, cols: 2, rows: 2, tag_mm: 30, gap_mm: 12, first_id: 300}";
    assert_ok(tsuya_file_write(test_path("mat.yaml"), other, sizeof other - 1));
    assert_fails(tsuya_calib_scale_from_board(&s, test_path("mat.yaml"), &photos, &context), "tags with other ids are: is this the right board file?");
    tsuya_photo_set_free(&photos);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_scale_and_frame),
        cmocka_unit_test(test_growth_does_not_matter),
        cmocka_unit_test(test_sigma_is_honest),
        cmocka_unit_test(test_two_plates),
        cmocka_unit_test(test_what_cannot_give_a_scale),
        cmocka_unit_test(test_partly_seen_and_partly_wrong),
        cmocka_unit_test(test_distances),
        cmocka_unit_test(test_from_photographs),
    };
    int result = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return result;
}
