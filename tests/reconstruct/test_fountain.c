/* Eleven photographs of a fountain with published cameras (Strecha, von Hansen, Van Gool, Fua, Thoennessen, CVPR 2008): poses
 * found from scratch against the published ones, and depth maps against the colours of a photograph they never saw. */
#include "support.h"

#include "core/image.h"
#include "core/order.h"
#include "core/process.h"
#include "published.h"
#include "reconstruct/reconstruct.h"
#include "reconstruct/sparse_steps.h"
#include "reconstruct/stereo_cache.h"

enum { REDUCED = 2, MOST_VIEWS = 64 };

static const char *const FOLDER = "mvs/fountain", *const HELD_OUT = "0005.jpg";

static void lay_out(tsuya_sparse_model *model, const char *name)
{
    assert_ok(published_strecha(model, test_data(FOLDER), REDUCED));
    assert_int_equal(model->view_count, 11);
    assert_ok(published_lay_out(model, test_data(FOLDER), test_path(name)));
}

/* ---- poses ---- */

static void centres_are_found_from_scratch(void **state)
{
    (void)state;
    tsuya_context context = tsuya_context_default();
    tsuya_sparse_model truth, found;
    tsuya_vec3 a[MOST_VIEWS], b[MOST_VIEWS];
    tsuya_reconstruct_info info = {0};
    tsuya_reconstruct_options options = tsuya_reconstruct_options_default();
    int count = 0;
    context.threads = 2;
    lay_out(&truth, "scratch");
    options.photos = test_path("scratch/photos");
    options.output = test_path("scratch/out");
    tsuya_reconstruction r = {.options = &options, .context = &context, .info = &info};
    assert_ok(tsuya_arena_create(&r.arena, 1 << 16));
    assert_ok(tsuya_folder_make(options.output));
    assert_ok(tsuya_photo_set_load(&r.photos, options.photos, NULL));
    assert_ok(tsuya_steps_load(&r.steps, options.output, tsuya_hash_bytes("scratch", 7)));
    assert_ok(tsuya_colmap_create(&r.colmap, options.output, options.photos, &context));
    assert_ok(tsuya_sparse_steps(&r));
    assert_ok(tsuya_sparse_model_load(&found, test_path("scratch/out/sparse/0")));
    for (int v = 0; v < truth.view_count; v++) {
        int at = tsuya_sparse_model_find(&found, truth.view[v].name);
        assert_true(at >= 0);
        a[count] = tsuya_pose_center(truth.view[v].camera_from_world);
        b[count++] = tsuya_pose_center(found.view[at].camera_from_world);
    }
    tsuya_similarity world_from_found;
    double rms, most = 0.0;
    assert_true(tsuya_similarity_align(&world_from_found, &rms, a, b, count));
    for (int v = 0; v < count; v++) {
        most = fmax(most, tsuya_vec3_norm(tsuya_vec3_sub(tsuya_similarity_apply(world_from_found, b[v]), a[v])));
    }
    print_message("fountain: %d centres, rms %.2f mm, farthest %.2f mm\n", count, 1e3 * rms, 1e3 * most);
    assert_true(most <= 0.005);
    tsuya_steps_free(&r.steps);
    tsuya_photo_set_free(&r.photos);
    tsuya_arena_free(r.arena);
    tsuya_sparse_model_free(&found);
    tsuya_sparse_model_free(&truth);
}

/* ---- depth maps against a photograph that they never saw ---- */

typedef struct picture {
    int width_px, height_px;
    float *depth, *grey; /* depth 0: nothing */
} picture;

static void load_grey(tsuya_image *grey, const char *path, const tsuya_camera *camera)
{
    tsuya_image full, small;
    assert_ok(tsuya_image_load(&full, path));
    assert_ok(tsuya_image_resize(&small, &full, camera->width_px, camera->height_px));
    assert_ok(tsuya_image_grey(grey, &small, TSUYA_SAMPLE_F32));
    tsuya_image_free(&full);
    tsuya_image_free(&small);
}

typedef struct source {
    tsuya_camera camera;
    tsuya_pose camera_from_world;
    tsuya_depth_map map;
    tsuya_image grey;
} source;

static void source_load(source *s, const tsuya_sparse_model *model, int v, const char *workspace, int long_side_px)
{
    char path[TEST_PATH];
    assert_ok(tsuya_map_camera(&s->camera, model, v, long_side_px, workspace));
    assert_ok(tsuya_map_load(&s->map, workspace, model->view[v].name, "geometric", false));
    snprintf(path, sizeof path, "%s/images/%s", workspace, model->view[v].name);
    load_grey(&s->grey, path, &s->camera);
    s->camera_from_world = model->view[v].camera_from_world;
}

/* The nearest of a view's depth at every pixel of the held-out camera, two pixels wide, so that nothing shines through. */
static void draw_depth(picture *out, const source *s, const tsuya_camera *target, tsuya_pose target_pose)
{
    tsuya_pose target_from_view = tsuya_pose_compose(target_pose, tsuya_pose_inverse(s->camera_from_world));
    for (int i = 0; i < s->map.width_px * s->map.height_px; i++) {
        double z = s->map.depth[i];
        tsuya_vec2 pixel;
        tsuya_vec3 p = {(i % s->map.width_px - s->camera.cx_px) / s->camera.fx_px * z, (i / s->map.width_px - s->camera.cy_px) / s->camera.fy_px * z, z};
        p = tsuya_pose_apply(target_from_view, p);
        for (int k = 0; z > 0.0 && k < 4 && tsuya_camera_project(target, p, &pixel); k++) {
            int x = (int)floor(pixel.x) + k % 2, y = (int)floor(pixel.y) + k / 2;
            if (x >= 0 && y >= 0 && x < out->width_px && y < out->height_px) {
                float *there = &out->depth[(size_t)y * (size_t)out->width_px + (size_t)x];
                *there = !(*there > 0.0f) || (float)p.z < *there ? (float)p.z : *there;
            }
        }
    }
}

/* A view's grey where it sees the point, too: its own depth there agrees to a hundredth. */
static bool sample(float *grey, const source *s, tsuya_vec3 world)
{
    tsuya_vec2 pixel;
    tsuya_vec3 p = tsuya_pose_apply(s->camera_from_world, world);
    if (!tsuya_camera_project(&s->camera, p, &pixel) ||
        !(pixel.x >= 0.0 && pixel.y >= 0.0 && pixel.x <= s->map.width_px - 1.0 && pixel.y <= s->map.height_px - 1.0)) {
        return false;
    }
    double own = s->map.depth[(size_t)lrint(pixel.y) * (size_t)s->map.width_px + (size_t)lrint(pixel.x)];
    tsuya_image_sample_bilinear(&s->grey, pixel.x, pixel.y, grey);
    return own > 0.0 && fabs(own - p.z) <= 0.01 * p.z;
}

/* Every pixel with a depth gets the mean of the views that see it; where none does, it has none after all. */
static void draw_colour(picture *out, const source *s, int count, const tsuya_camera *target, tsuya_pose target_pose)
{
    tsuya_pose world_from_target = tsuya_pose_inverse(target_pose);
    for (int i = 0; i < out->width_px * out->height_px; i++) {
        double z = out->depth[i], sum = 0.0;
        int n = 0;
        float grey;
        tsuya_vec3 p = {(i % out->width_px - target->cx_px) / target->fx_px * z, (i / out->width_px - target->cy_px) / target->fy_px * z, z};
        for (int k = 0; z > 0.0 && k < count; k++) {
            if (sample(&grey, &s[k], tsuya_pose_apply(world_from_target, p))) {
                sum += grey;
                n++;
            }
        }
        out->depth[i] = n > 0 ? out->depth[i] : 0.0f;
        out->grey[i] = n > 0 ? (float)(sum / n) : 0.0f;
    }
}

/* Normalised cross-correlation over a window of 11 pixels; −2 where a tenth of it is empty or nothing is to be seen. */
static double window_ncc(const picture *a, const tsuya_image *b, int x, int y)
{
    enum { RADIUS = 5 };
    double n = 0, sa = 0, sb = 0, saa = 0, sbb = 0, sab = 0;
    for (int dy = -RADIUS; dy <= RADIUS; dy++) {
        for (int dx = -RADIUS; dx <= RADIUS; dx++) {
            size_t at = (size_t)(y + dy) * (size_t)a->width_px + (size_t)(x + dx);
            if (a->depth[at] > 0.0f) {
                double u = a->grey[at], v = *tsuya_image_f32(b, x + dx, y + dy);
                n++, sa += u, sb += v, saa += u * u, sbb += v * v, sab += u * v;
            }
        }
    }
    double va = saa - sa * sa / n, vb = sbb - sb * sb / n, side = 2 * RADIUS + 1;
    bool seen = n >= 0.9 * side * side && vb / n > 0.01 * 0.01;
    return seen ? (sab - sa * sb / n) / sqrt(fmax(va * vb, 1e-12)) : -2.0;
}

static void assert_colours_agree(const picture *drawn, const tsuya_image *seen)
{
    enum { MOST = 100000, STEP = 4, EDGE = 8 };
    static double ncc[MOST];
    size_t count = 0, windows = 0, good = 0;
    for (int y = EDGE; y < drawn->height_px - EDGE; y += STEP) {
        for (int x = EDGE; x < drawn->width_px - EDGE; x += STEP) {
            double c = window_ncc(drawn, seen, x, y);
            windows++;
            if (c > -1.5 && count < MOST) {
                good += c >= 0.8;
                ncc[count++] = c;
            }
        }
    }
    assert_true(count > 0);
    tsuya_sort_doubles(ncc, count);
    print_message("fountain: held-out %s: %.1f %% of its windows drawn; NCC median %.3f, lower decile %.3f, %.1f %% above 0.8\n", HELD_OUT,
                  100.0 * (double)count / (double)windows, ncc[count / 2], ncc[count / 10], 100.0 * (double)good / (double)count);
    assert_true((double)count >= 0.6 * (double)windows);
    assert_true(ncc[count / 2] >= 0.9);
    assert_true((double)good >= 0.75 * (double)count);
}

static void depth_agrees_with_a_photograph_never_seen(void **state)
{
    (void)state;
    tsuya_context context = tsuya_context_default();
    tsuya_sparse_model truth, dense;
    tsuya_reconstruct_info info;
    tsuya_reconstruct_options options = tsuya_reconstruct_options_default();
    tsuya_camera target;
    tsuya_image seen;
    static source seen_by[MOST_VIEWS];
    int sources = 0;
    context.threads = 2;
    lay_out(&truth, "posed");
    options.photos = test_path("posed/photos");
    options.poses = test_path("posed/poses");
    options.output = test_path("posed/out");
    options.dense_long_side_px = 768;
    options.hold_out = &HELD_OUT;
    options.hold_out_count = 1;
    assert_ok(tsuya_reconstruct(&info, &options, &context));
    assert_int_equal(info.registered, 11);
    const char *workspace = test_path("posed/out/dense");
    assert_ok(tsuya_sparse_model_load(&dense, test_path("posed/out/dense/sparse")));
    int held_out = tsuya_sparse_model_find(&dense, HELD_OUT);
    assert_true(held_out >= 0);
    assert_ok(tsuya_map_camera(&target, &dense, held_out, info.dense_long_side_px, workspace));
    const tsuya_pose target_pose = dense.view[held_out].camera_from_world;
    size_t pixels = (size_t)target.width_px * (size_t)target.height_px;
    picture drawn = {target.width_px, target.height_px, calloc(pixels, sizeof(float)), calloc(pixels, sizeof(float))};
    assert_true(drawn.depth && drawn.grey);
    for (int v = 0; v < dense.view_count; v++) {
        if (v != held_out && tsuya_map_exists(workspace, dense.view[v].name, "geometric")) {
            source_load(&seen_by[sources], &dense, v, workspace, info.dense_long_side_px);
            draw_depth(&drawn, &seen_by[sources++], &target, target_pose);
        }
    }
    assert_int_equal(sources, dense.view_count - 1);
    draw_colour(&drawn, seen_by, sources, &target, target_pose);
    load_grey(&seen, test_path("posed/out/dense/images/0005.jpg"), &target);
    assert_colours_agree(&drawn, &seen);
    for (int k = 0; k < sources; k++) {
        tsuya_depth_map_free(&seen_by[k].map);
        tsuya_image_free(&seen_by[k].grey);
    }
    tsuya_image_free(&seen);
    free(drawn.depth);
    free(drawn.grey);
    tsuya_reconstruct_info_free(&info);
    tsuya_sparse_model_free(&dense);
    tsuya_sparse_model_free(&truth);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(centres_are_found_from_scratch),
        cmocka_unit_test(depth_agrees_with_a_photograph_never_seen),
    };
    if (!test_data(FOLDER) || !tsuya_process_available("colmap")) {
        print_message("skipped: no %s, or no colmap\n", FOLDER);
        return TEST_SKIPPED;
    }
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return failed;
}
