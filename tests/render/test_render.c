/* The stage: files in, pictures and render.json out; resumed picture by picture. */
#include "support.h"

#include "brdf/material.h"

#include "core/color.h"
#include "core/image.h"
#include "core/mesh.h"

#include "render/render.h"

#include "render_scenes.h"

static const char *mesh_path, *output;

static int set_up(void **state)
{
    (void)state;
    tsuya_mesh mesh;
    scene_drape(&mesh, 30);
    static char path[TEST_PATH], folder[TEST_PATH];
    snprintf(path, sizeof path, "%s", test_path("weave.ply"));
    snprintf(folder, sizeof folder, "%s", test_path("render"));
    mesh_path = path;
    output = folder;
    tsuya_status status = tsuya_ply_save(&mesh, mesh_path, NULL);
    tsuya_mesh_free(&mesh);
    return status == TSUYA_OK ? 0 : -1;
}

static tsuya_render_options small_options(const char *name)
{
    tsuya_render_options o = tsuya_render_options_default();
    o.mesh_path = mesh_path;
    o.output_folder = output;
    o.name = name;
    o.views = 3;
    o.width_px = 48;
    o.height_px = 36;
    o.spp = 8;
    o.bounces = 2;
    return o;
}

static const char *frame_path(const char *name, int frame, const char *extension)
{
    char text[256];
    snprintf(text, sizeof text, "render/%s/frame_%03d.%s", name, frame, extension);
    return test_path(text);
}

static void test_turntable_and_resume(void **state)
{
    (void)state;
    tsuya_context context = tsuya_context_default();
    tsuya_render_options options = small_options("turn");
    tsuya_render_info info;
    tsuya_image exr, png;
    assert_ok(tsuya_render(&info, &options, &context));
    assert_int_equal(info.frames, 3);
    assert_int_equal(info.frames_reused, 0);
    assert_true(info.rays > 3 * 48 * 36 * 8 && info.default_material && info.has_weft);
    assert_ok(tsuya_image_load(&exr, frame_path("turn", 0, "exr")));
    assert_ok(tsuya_image_load(&png, frame_path("turn", 0, "png")));
    assert_true(exr.width_px == 48 && exr.height_px == 36 && exr.sample == TSUYA_SAMPLE_F32 && png.width_px == 48);
    /* the PNG is the EXR through the transform that render.json states */
    for (int k = 0; k < 48 * 36; k += 7) {
        const float *linear = tsuya_image_f32(&exr, k % 48, k / 48);
        const uint8_t *shown = tsuya_image_u8(&png, k % 48, k / 48);
        for (int c = 0; c < 3; ++c) {
            double expected = 255.0 * tsuya_srgb_encode((float)(linear[c] * exp2(info.exposure_ev)));
            if (!(fabs(expected - shown[c]) < 1.0)) {
                fail_msg("pixel %d, channel %d: %g in linear is %d, expected %g", k, c, (double)linear[c], shown[c], expected);
            }
        }
    }
    tsuya_image_free(&exr);
    tsuya_image_free(&png);
    tsuya_hash before, after;
    assert_ok(tsuya_hash_file(&before, frame_path("turn", 1, "exr")));
    assert_int_equal(unlink(frame_path("turn", 1, "png")), 0);
    assert_ok(tsuya_render(&info, &options, &context));
    assert_int_equal(info.frames_reused, 2);
    assert_ok(tsuya_hash_file(&after, frame_path("turn", 1, "exr")));
    assert_string_equal(before.hex, after.hex);
    options.spp = 9;
    assert_ok(tsuya_render(&info, &options, &context));
    assert_int_equal(info.frames_reused, 0);
    assert_ok(tsuya_file_write(test_path("render/turn/render.json"), "{\"frames\": [", 12));
    assert_ok(tsuya_render(&info, &options, &context));
    assert_int_equal(info.frames_reused, 0);
}

static void test_figures(void **state)
{
    (void)state;
    tsuya_context context = tsuya_context_default();
    tsuya_render_options options = small_options("figures");
    tsuya_render_info info;
    tsuya_json *root;
    char reference[TEST_PATH];
    snprintf(reference, sizeof reference, "%s", frame_path("figures", 0, "exr"));
    options.views = 1;
    options.color = "#7a1f2b";
    assert_ok(tsuya_render(&info, &options, &context));
    options.reference_path = reference;
    assert_ok(tsuya_render(&info, &options, &context));
    assert_true(info.rmse_vs_reference >= 0.0 && info.rmse_vs_reference < 2e-3); /* halves */
    assert_ok(tsuya_json_load(&root, test_path("render/figures/render.json")));
    static const char *const keys[] = {"width", "height", "spp", "rays", "seconds", "mrays_per_s", "rmse_vs_reference", "exposure_ev"};
    for (size_t k = 0; k < sizeof keys / sizeof keys[0]; ++k) {
        assert_true(tsuya_json_is_number(tsuya_json_member(root, keys[k])));
    }
    assert_string_equal(tsuya_json_text_or(tsuya_json_member(root, "color"), ""), "#7a1f2b");
    tsuya_json_free(root);
}

static void test_cameras(void **state)
{
    (void)state;
    const tsuya_camera camera = {.lens = TSUYA_LENS_OPENCV8, .width_px = 40, .height_px = 30, .fx_px = 40, .fy_px = 41, .cx_px = 20, .cy_px = 14,
                                 .distortion = {-0.2, 0.05}};
    tsuya_pose pose = tsuya_pose_look_at((tsuya_vec3){3, 0, 1}, (tsuya_vec3){0, 0, 0}, (tsuya_vec3){0, 0, 1});
    char path[TEST_PATH];
    snprintf(path, sizeof path, "%s", test_path("a.cameramodel"));
    assert_ok(tsuya_cameramodel_save(&camera, pose, path));
    const char *cameras[] = {path, path};
    tsuya_context context = tsuya_context_default();
    tsuya_render_options options = small_options("cameras");
    tsuya_render_info info;
    options.camera_path = cameras;
    options.camera_count = 2;
    options.color = "0.2,0.1,0.05";
    assert_ok(tsuya_render(&info, &options, &context));
    assert_true(info.frames == 2 && info.width_px == 40 && info.height_px == 30);
    tsuya_hash a, b;
    assert_ok(tsuya_hash_file(&a, frame_path("cameras", 0, "png")));
    assert_ok(tsuya_hash_file(&b, frame_path("cameras", 1, "png")));
    assert_string_equal(a.hex, b.hex);
}

/* What may be left out is decided by all cameras of a run: a picture of an earlier run with others may be another one. */
static void test_resume_knows_the_detail(void **state)
{
    (void)state;
    const tsuya_camera camera = {.lens = TSUYA_LENS_PINHOLE, .width_px = 64, .height_px = 48, .fx_px = 64, .fy_px = 64, .cx_px = 31.5, .cy_px = 23.5};
    tsuya_context context = tsuya_context_default();
    tsuya_render_options options = small_options("detail");
    tsuya_render_info info;
    tsuya_mesh mesh;
    char path[2][TEST_PATH], fine[TEST_PATH];
    const char *cameras[] = {path[0], path[1]};
    scene_plane(&mesh, 1.0, 60);
    snprintf(fine, sizeof fine, "%s", test_path("fine.ply"));
    assert_ok(tsuya_ply_save(&mesh, fine, NULL));
    for (int k = 0; k < 2; ++k) {
        snprintf(path[k], TEST_PATH, "%s", test_path(k ? "near.cameramodel" : "far.cameramodel"));
        assert_ok(tsuya_cameramodel_save(&camera, tsuya_pose_look_at((tsuya_vec3){0.1, 0, k ? 0.3 : 8.0}, (tsuya_vec3){0, 0, 0}, (tsuya_vec3){0, 1, 0}), path[k]));
    }
    options.mesh_path = fine;
    options.camera_path = cameras;
    options.camera_count = 1;
    options.exposure_ev = 0.0;
    options.spp = 2; /* finding what can go would cost more than it saves */
    assert_ok(tsuya_render(&info, &options, &context));
    assert_int_equal(info.triangles_rendered, mesh.triangle_count);
    options.spp = 16;
    assert_ok(tsuya_render(&info, &options, &context));
    assert_true(info.triangles_rendered < mesh.triangle_count / 2);
    options.camera_count = 2;
    assert_ok(tsuya_render(&info, &options, &context));
    assert_int_equal(info.triangles_rendered, mesh.triangle_count);
    assert_int_equal(info.frames_reused, 0);
    assert_ok(tsuya_render(&info, &options, &context));
    assert_int_equal(info.frames_reused, 2);
    tsuya_mesh_free(&mesh);
}

static void check_color(const char *text, tsuya_lab expected, double tolerance)
{
    double rgb[3];
    assert_ok(tsuya_render_parse_color(rgb, text));
    double d = tsuya_color_difference(expected, tsuya_lab_from_rgb((tsuya_vec3){rgb[0], rgb[1], rgb[2]}));
    if (!(d < tolerance)) {
        fail_msg("%s is off by %.2f ΔE00", text, d);
    }
}

/* One colour said in five ways. */
static void test_colors_are_read(void **state)
{
    (void)state;
    double rgb[3];
    char path[TEST_PATH];
    assert_ok(tsuya_render_parse_color(rgb, "Indigo"));
    tsuya_lab indigo = tsuya_lab_from_rgb((tsuya_vec3){rgb[0], rgb[1], rgb[2]});
    check_color("#4B0082", indigo, 1e-4);
    char text[96];
    snprintf(text, sizeof text, "%.8f,%.8f, %.8f", rgb[0], rgb[1], rgb[2]);
    check_color(text, indigo, 1e-3);
    snprintf(text, sizeof text, "lab(%.6f, %.6f, %.6f)", indigo.l, indigo.a, indigo.b);
    check_color(text, indigo, 1e-3);
    snprintf(path, sizeof path, "%s", test_path("grey.csv"));
    static const char grey[] = "nm,reflectance\n380,0.18\n560,0.18\n780,0.18\n", wild[] = "nm,reflectance\n380,0.18\n370,0.18\n",
                      laser[] = "nm,reflectance\n380,0\n690,0\n700,1\n710,0\n";
    assert_ok(tsuya_file_write(path, grey, sizeof grey - 1));
    check_color(path, tsuya_lab_from_rgb((tsuya_vec3){0.18, 0.18, 0.18}), 1e-6);
    assert_ok(tsuya_file_write(path, wild, sizeof wild - 1));
    assert_fails(tsuya_render_parse_color(rgb, path), "370");
    assert_ok(tsuya_file_write(path, laser, sizeof laser - 1));
    assert_ok(tsuya_render_parse_color(rgb, path)); /* deep red, too dark to leave the gamut by more than rounding */
    assert_true(rgb[0] > 2.0 * rgb[1]);
    assert_fails(tsuya_render_parse_color(rgb, "crimsom"), "crimson");
    assert_fails(tsuya_render_parse_color(rgb, "lab(50,120,-120)"), "gamut");
    assert_fails(tsuya_render_parse_color(rgb, "lab(50,20"), "lab(L,a,b)");
    assert_fails(tsuya_render_parse_color(rgb, "#12345g"), "#rrggbb");
    assert_fails(tsuya_render_parse_color(rgb, "/nowhere/red.csv"), "/nowhere/red.csv");
}

/* A matte ball of a colour under the default studio shows that colour, light or dark, where it faces the camera. */
static void test_colors_show_as_asked(void **state)
{
    (void)state;
    static const char *const colors[] = {"#7a1f2b", "#d8c9a8", "#2b3a67"};
    tsuya_context context = tsuya_context_default();
    tsuya_render_options options = small_options("shown");
    tsuya_render_info info;
    tsuya_mesh ball;
    tsuya_material *matte;
    char path[TEST_PATH], material_path[TEST_PATH];
    const double black[3] = {0, 0, 0};
    snprintf(path, sizeof path, "%s", test_path("ball.ply"));
    snprintf(material_path, sizeof material_path, "%s", test_path("matte.json"));
    scene_sphere(&ball, 1.0, 40, false);
    assert_ok(tsuya_ply_save(&ball, path, NULL));
    tsuya_mesh_free(&ball);
    assert_ok(tsuya_material_lambert(&matte, black));
    assert_ok(tsuya_material_save(matte, material_path));
    tsuya_material_free(matte);
    const char *materials[] = {material_path};
    options.mesh_path = path;
    options.material_path = materials;
    options.material_count = 1;
    options.views = 1;
    options.spp = 32;
    for (int k = 0; k < 3; ++k) {
        double asked[3], l[16 * 16], a = 0.0, b = 0.0;
        tsuya_image png, linear;
        options.color = colors[k];
        assert_ok(tsuya_render_parse_color(asked, colors[k]));
        assert_ok(tsuya_render(&info, &options, &context));
        assert_ok(tsuya_image_load(&png, frame_path("shown", 0, "png")));
        assert_ok(tsuya_image_convert(&linear, &png, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
        for (int i = 0; i < 16 * 16; ++i) { /* the middle of the ball */
            const float *rgb = tsuya_image_f32(&linear, 48 / 2 - 8 + i % 16, 36 / 2 - 8 + i / 16);
            tsuya_lab lab = tsuya_lab_from_rgb((tsuya_vec3){rgb[0], rgb[1], rgb[2]});
            a += lab.a / 256;
            b += lab.b / 256;
            int at = i;
            for (; at > 0 && l[at - 1] > lab.l; --at) {
                l[at] = l[at - 1];
            }
            l[at] = lab.l;
        }
        tsuya_lab seen = {l[128], a, b};
        double difference = tsuya_color_difference(seen, tsuya_lab_from_rgb((tsuya_vec3){asked[0], asked[1], asked[2]}));
        if (!(difference < 3.0)) {
            fail_msg("%s shows as Lab %.1f %.1f %.1f: ΔE00 %.1f", colors[k], seen.l, seen.a, seen.b, difference);
        }
        tsuya_image_free(&png);
        tsuya_image_free(&linear);
    }
}

/* A photograph that is the render itself, brighter and redder: the figures of both groups, and the comparison's picture. */
static void test_like(void **state)
{
    (void)state;
    const tsuya_camera camera = {.lens = TSUYA_LENS_OPENCV4, .width_px = 64, .height_px = 48, .fx_px = 90, .fy_px = 90, .cx_px = 32, .cy_px = 22,
                                 .distortion = {-0.2, 0.05, 0.001}};
    tsuya_pose pose = tsuya_pose_look_at((tsuya_vec3){3, 0, 1}, (tsuya_vec3){0, 0, 0}, (tsuya_vec3){0, 0, 1});
    char path[TEST_PATH], photo_path[TEST_PATH];
    snprintf(path, sizeof path, "%s", test_path("like.cameramodel"));
    snprintf(photo_path, sizeof photo_path, "%s", test_path("like.tif"));
    assert_ok(tsuya_cameramodel_save(&camera, pose, path));
    const char *cameras[] = {path, path}, *photos[] = {photo_path, photo_path};
    const bool held_out[] = {true, false};
    tsuya_context context = tsuya_context_default();
    tsuya_render_options options = small_options("like");
    tsuya_render_info info;
    options.spp = 64;
    options.camera_path = cameras;
    options.camera_count = 2;
    assert_ok(tsuya_render(&info, &options, &context));
    assert_true(info.like.photos == 0 && info.like_held_out.photos == 0);
    tsuya_image exr, linear, photo;
    assert_ok(tsuya_image_load(&exr, frame_path("like", 0, "exr")));
    assert_ok(tsuya_image_create(&linear, 64, 48, 3, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    for (int k = 0; k < 64 * 48; ++k) {
        for (int c = 0; c < 3; ++c) {
            tsuya_image_f32(&linear, k % 64, k / 64)[c] = tsuya_image_f32(&exr, k % 64, k / 64)[c] * (c == 0 ? 0.6f : 0.4f);
        }
    }
    assert_ok(tsuya_image_convert(&photo, &linear, TSUYA_SAMPLE_U16, TSUYA_ENCODING_SRGB));
    assert_ok(tsuya_image_save(&photo, photo_path, NULL));
    options.photo_path = photos;
    options.held_out = held_out;
    assert_ok(tsuya_render(&info, &options, &context));
    assert_true(info.frames_reused == 2 && info.like.photos == 1 && info.like_held_out.photos == 1);
    assert_true(info.like_held_out.de00_mean < 0.05 && info.like.ssim > 0.999 && info.like.psnr_db > 55.0 && info.like.compared > 0.5);
    assert_true(tsuya_path_exists(frame_path("like", 1, "compare.png")));
    options.gain[0] = options.gain[1] = options.gain[2] = 0.4;
    assert_ok(tsuya_render(&info, &options, &context));
    assert_true(info.like_held_out.de00_mean > 3.0);
    options.longest_side_px = 32; /* smaller pictures of the same camera */
    options.gain[0] = 0.6;
    assert_ok(tsuya_render(&info, &options, &context));
    assert_true(info.width_px == 32 && info.height_px == 24 && info.like_held_out.de00_mean < 1.0);
    tsuya_image_free(&exr);
    tsuya_image_free(&linear);
    tsuya_image_free(&photo);
}

static void test_refusals(void **state)
{
    (void)state;
    tsuya_context context = tsuya_context_default();
    tsuya_render_options options = small_options("bad");
    tsuya_render_info info;
    options.color = "crimson?";
    assert_fails(tsuya_render(&info, &options, &context), "crimson?");
    options.color = "0.2,0.3,1.4";
    assert_fails(tsuya_render(&info, &options, &context), "1.4");
    options.color = NULL;
    options.mesh_path = "/nowhere/weave.ply";
    assert_fails(tsuya_render(&info, &options, &context), "/nowhere/weave.ply");
    options = small_options("bad");
    options.lights_path = "/nowhere/lights.json";
    assert_fails(tsuya_render(&info, &options, &context), "/nowhere/lights.json");
    options = small_options("bad");
    options.spp = 0;
    assert_fails(tsuya_render(&info, &options, &context), "spp");
    options = small_options("bad");
    options.reference_path = mesh_path;
    assert_int_not_equal(tsuya_render(&info, &options, &context), TSUYA_OK);
    options = small_options("bad");
    tsuya_interrupt();
    assert_int_equal(tsuya_render(&info, &options, &context), TSUYA_ERROR_INTERRUPTED);
    tsuya_interrupt_clear();
}

/* A plane whose halves are of two materials, by vertex: each half reflects as its own, dark beside grey under one lamp from above. */
static void test_several_materials(void **state)
{
    (void)state;
    static const double reflectance[2] = {0.2, 0.6};
    tsuya_context context = tsuya_context_default();
    tsuya_render_options options = small_options("two");
    tsuya_render_info info;
    tsuya_mesh plane;
    tsuya_image exr;
    char path[TEST_PATH], lamp[TEST_PATH], file[2][TEST_PATH];
    const char *materials[2] = {file[0], file[1]};
    for (int k = 0; k < 2; ++k) {
        const double rgb[3] = {reflectance[k], reflectance[k], reflectance[k]};
        tsuya_material *matte;
        snprintf(file[k], sizeof file[k], "%s", test_path(k ? "gold.json" : "ground.json"));
        assert_ok(tsuya_material_lambert(&matte, rgb));
        assert_ok(tsuya_material_save(matte, file[k]));
        tsuya_material_free(matte);
    }
    snprintf(path, sizeof path, "%s", test_path("plane.ply"));
    snprintf(lamp, sizeof lamp, "%s", test_path("above.json"));
    assert_ok(tsuya_file_write(lamp, "{\"lights\": [{\"type\": \"directional\", \"direction\": [0, 0, -1], \"rgb\": [1, 1, 1]}]}", 80));
    scene_plane(&plane, 1.0, 20);
    assert_ok(tsuya_mesh_add_arrays(&plane, TSUYA_MESH_MATERIAL));
    for (size_t v = 0; v < plane.vertex_count; ++v) {
        plane.material[v] = plane.position[3 * v] > 0.0f;
    }
    assert_ok(tsuya_ply_save(&plane, path, NULL));
    tsuya_mesh_free(&plane);
    options.mesh_path = path;
    options.material_path = materials;
    options.material_count = 2;
    options.lights_path = lamp;
    options.views = 1;
    options.elevation_deg = 80.0;
    options.bounces = 1;
    assert_ok(tsuya_render(&info, &options, &context));
    assert_ok(tsuya_image_load(&exr, frame_path("two", 0, "exr")));
    for (int k = 0; k < 2; ++k) {
        assert_near((double)tsuya_image_f32(&exr, k ? 30 : 17, 18)[1], reflectance[k] / M_PI, 1e-3);
    }
    tsuya_image_free(&exr);
    options.material_count = 1; /* one serves every index */
    assert_ok(tsuya_render(&info, &options, &context));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_turntable_and_resume),
        cmocka_unit_test(test_figures),
        cmocka_unit_test(test_cameras),
        cmocka_unit_test(test_resume_knows_the_detail),
        cmocka_unit_test(test_colors_are_read),
        cmocka_unit_test(test_colors_show_as_asked),
        cmocka_unit_test(test_several_materials),
        cmocka_unit_test(test_like),
        cmocka_unit_test(test_refusals),
    };
    return cmocka_run_group_tests(tests, set_up, test_folder_tear_down);
}
