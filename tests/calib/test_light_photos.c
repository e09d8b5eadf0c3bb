/* tsuya calib light from drawn photographs; the truth in lamp_scene.h, the balls by rays. */
#include "lamp_scene.h"
#include "scene.h"

#include "core/json.h"
#include "core/memory.h"
#include "core/process.h"
#include "render/light.h"

enum { FOCAL = 2500, W = 1600, H = 1200, PHOTOS = 9 };

static char *output;
static tsuya_process_info info;

static int run(const char *arguments)
{
    char command[2 * TEST_PATH];
    snprintf(command, sizeof command, "cd %s && %s calib light --board board.yaml --camera cam.cameramodel --linear --quiet %s 2>&1", test_folder(), TSUYA_PROGRAM, arguments);
    const char *argv[] = {"sh", "-c", command, NULL};
    tsuya_free(output);
    output = NULL;
    assert_ok(tsuya_process_capture(&output, &info, argv, NULL));
    return info.exit_code;
}

static void assert_refused(const char *arguments, const char *part)
{
    if (run(arguments) != 1 || !strstr(output, part) || strchr(output, '\n') != output + strlen(output) - 1) {
        fail_msg("%s: exit %d, \"%s\" expected in one line:\n%s", arguments, info.exit_code, part, output);
    }
    printf("%s", output);
}

static tsuya_camera camera(void)
{
    return (tsuya_camera){.lens = TSUYA_LENS_OPENCV4, .width_px = W, .height_px = H, .fx_px = FOCAL, .fy_px = FOCAL, .cx_px = 805, .cy_px = 596, .distortion = {-0.08, 0.03}};
}

typedef struct shine { const lamp_truth *lamp; tsuya_pose plate; double exposure; tsuya_vec3 eye; } shine;

static double shine_at(const void *user, double x, double y)
{
    const shine *s = user;
    tsuya_vec3 p = tsuya_pose_apply(s->plate, (tsuya_vec3){x, y, 0}), n = tsuya_mat3_apply(s->plate.rotation, (tsuya_vec3){0, 0, 1});
    return s->exposure * lamp_radiance(s->lamp, p, n, s->eye);
}

/* Grey to the camera's colours, its lens' fall-off (cos⁴) on the way. */
static void save_photo(tsuya_image *image, const scene_look *look, const char *name)
{
    static const double color[3] = {1.0, 0.8, 0.5};
    tsuya_image grey, rgb;
    for (int y = 0; y < H; y++) {
        for (int x = 0; x < W; x++) {
            double u = (x - 805.0) / FOCAL, v = (y - 596.0) / FOCAL, c2 = 1.0 / (1.0 + u * u + v * v);
            *tsuya_image_f32(image, x, y) *= (float)(c2 * c2);
        }
    }
    scene_end(&grey, image, look);
    assert_ok(tsuya_image_create(&rgb, W, H, 3, TSUYA_SAMPLE_U16, TSUYA_ENCODING_LINEAR));
    for (int i = 0; i < W * H; i++) {
        for (int c = 0; c < 3; c++) {
            tsuya_image_u16(&rgb, i % W, i / W)[c] = (uint16_t)lround(color[c] * *tsuya_image_u16(&grey, i % W, i / W));
        }
    }
    assert_ok(tsuya_image_save(&rgb, test_path(name), NULL));
    tsuya_image_free(&grey);
    tsuya_image_free(&rgb);
}

static scene_look look_of(int k)
{
    scene_look look = scene_look_default();
    look.black = 0.05;
    look.white = 1.0;
    look.background = 0.01;
    look.noise = 0.002;
    look.sample = TSUYA_SAMPLE_U16;
    look.seed = (uint64_t)k + 1;
    return look;
}

/* Photographs of the plate in a folder. */
static void draw_plates(const lamp_truth *lamp, const char *folder, int photos, double exposure, bool flat)
{
    tsuya_board board;
    tsuya_camera cam = camera();
    tsuya_pose from_world = lamp_camera();
    assert_ok(tsuya_board_load(&board, test_path("board.yaml")));
    assert_ok(tsuya_folder_make(test_path(folder)));
    for (int k = 0; k < photos; k++) {
        tsuya_image image;
        char name[64];
        shine s = {lamp, lamp_plate(flat ? 0 : k), exposure, tsuya_pose_center(from_world)};
        scene_look look = look_of(k);
        look.light = shine_at;
        look.light_user = &s;
        scene_begin(&image, W, H, &look);
        scene_plate(&image, &board, 0, &cam, tsuya_pose_compose(from_world, s.plate), &look);
        snprintf(name, sizeof name, "%s/IMG_%02d.tif", folder, k);
        save_photo(&image, &look, name);
    }
    tsuya_board_free(&board);
}

static void begin(void)
{
    static const char yaml[] = "{family: tag36h11, border_bits: 1, cols: 4, rows: 3, tag_mm: 30, gap_mm: 9, first_id: 0}\n";
    tsuya_camera cam = camera();
    assert_ok(tsuya_file_write(test_path("board.yaml"), yaml, sizeof yaml - 1));
    assert_ok(tsuya_cameramodel_save(&cam, tsuya_pose_identity(), test_path("cam.cameramodel")));
}

static double away(const double a[3], tsuya_vec3 b) { return tsuya_vec3_norm(tsuya_vec3_sub((tsuya_vec3){a[0], a[1], a[2]}, b)); }

/* Irradiance that the written lamps give, through render's own reader. */
static double written_irradiance(const char *path, tsuya_vec3 p, tsuya_vec3 n)
{
    tsuya_light_set set;
    double sum = 0.0, u[2] = {0.5, 0.5};
    assert_ok(tsuya_light_set_load(&set, path));
    for (int i = 0; i < set.count; i++) {
        tsuya_light_sample s;
        if (tsuya_light_sample_at(&set.light[i], p, n, u, &s)) {
            sum += s.rgb[0] / s.pdf * fmax(tsuya_vec3_dot(s.wi, n), 0.0);
        }
    }
    tsuya_light_set_free(&set);
    return sum;
}

/* The lens' fall-off as tsuya calib color would write it: the logarithm of cos⁴, developed. */
static void write_color(void)
{
    double h2 = 0.25 * ((double)W * W + (double)H * H) / ((double)FOCAL * FOCAL);
    tsuya_json *root = tsuya_json_create_object(), *v;
    tsuya_json_set_text(root, "format", "tsuya color");
    tsuya_json_set_text(root, "version", "1.0");
    tsuya_json_set_numbers(root, "white_balance", (double[]){1, 1, 1}, 3);
    tsuya_json_set_number(root, "exposure", 1.0);
    tsuya_json_set_numbers(root, "matrix", (double[]){1, 0, 0, 0, 1, 0, 0, 0, 1}, 9);
    v = tsuya_json_set_object(root, "vignetting");
    tsuya_json_set_numbers(v, "size_px", (double[]){W, H}, 2);
    tsuya_json_set_numbers(v, "log_polynomial", (double[]){-2.0 * h2, h2 * h2, -2.0 / 3.0 * h2 * h2 * h2}, 3);
    assert_ok(tsuya_json_save(root, test_path("color.json")));
    tsuya_json_free(root);
}

static void test_plate(void **state)
{
    (void)state;
    lamp_truth truth = lamp_usual();
    double position[3], sigma[3], falloff, exponent, rms;
    begin();
    draw_plates(&truth, "plate", PHOTOS, 0.7, false);
    write_color();
    if (run("plate --color color.json -o light.json") != 0) {
        fail_msg("%s", output);
    }
    tsuya_json *root;
    assert_ok(tsuya_json_load(&root, test_path("light.json")));
    const tsuya_json *lamp = tsuya_json_member(root, "lamp");
    assert_ok(tsuya_json_get_numbers(position, 3, lamp, "position_m"));
    assert_ok(tsuya_json_get_numbers(sigma, 3, lamp, "position_sigma_m"));
    assert_ok(tsuya_json_get_number(&falloff, lamp, "falloff"));
    assert_ok(tsuya_json_get_number(&exponent, lamp, "distance_exponent"));
    assert_ok(tsuya_json_get_number(&rms, root, "rms"));
    /* The world is where the plate lay first: shifted against the scene's. */
    tsuya_vec3 want = tsuya_pose_apply(tsuya_pose_inverse(lamp_plate(0)), truth.position_m);
    printf("lamp %.1f mm off (sigma %.1f %.1f %.1f mm), falloff %.2f, distance's power %.2f, rms %.2f %%\n", 1e3 * away(position, want), 1e3 * sigma[0], 1e3 * sigma[1],
           1e3 * sigma[2], falloff, exponent, 100 * rms);
    assert_true(away(position, want) < 0.03 && away(position, want) < 2.5 * sqrt(sigma[0] * sigma[0] + sigma[1] * sigma[1] + sigma[2] * sigma[2]));
    assert_near(exponent, 2.0, 0.15);
    assert_true(rms < 0.015);
    tsuya_json_free(root);
    double worst = 0.0;
    for (int k = 0; k < 9; k++) {
        tsuya_vec3 p = {0.08 * (k % 3 - 1) + 0.07, 0.08 * (k / 3 - 1) + 0.05, 0.02 * k}, n = {0, 0, 1};
        lamp_truth bare = truth;
        bare.gloss = bare.ambient = 0.0;
        double real = 0.7 * M_PI / 0.85 * lamp_radiance(&bare, tsuya_pose_apply(lamp_plate(0), p), n, (tsuya_vec3){0, -0.5, 0.8});
        worst = fmax(worst, fabs(written_irradiance(test_path("light.json"), p, n) / real - 1.0));
    }
    printf("irradiance of the written lamps within %.1f %% of the truth\n", 100 * worst);
    assert_true(worst < 0.03);
    assert_true(tsuya_path_exists(test_path("light.png")));
}

/* Two folders, a lamp each; the camera stands where it stood. */
static void test_two_lamps(void **state)
{
    (void)state;
    lamp_truth left = lamp_usual(), right = lamp_usual();
    tsuya_json *root;
    double position[3];
    right.position_m = (tsuya_vec3){-0.35, 0.25, 0.75};
    right.direction = (tsuya_vec3){0.40, -0.20, -0.75};
    draw_plates(&right, "right", 8, 0.7, false);
    if (run("plate/ right/ --color color.json -o lamps.json") != 0) {
        fail_msg("%s", output);
    }
    assert_ok(tsuya_json_load(&root, test_path("lamps.json")));
    const tsuya_json *lamps = tsuya_json_member(root, "lamps");
    assert_int_equal(tsuya_json_count(lamps), 2);
    for (int k = 0; k < 2; k++) {
        const tsuya_json *lamp = tsuya_json_element(lamps, k);
        tsuya_vec3 want = tsuya_pose_apply(tsuya_pose_inverse(lamp_plate(0)), k ? right.position_m : left.position_m);
        assert_string_equal(tsuya_json_text_or(tsuya_json_member(lamp, "name"), ""), k ? "right" : "plate");
        assert_ok(tsuya_json_get_numbers(position, 3, tsuya_json_member(lamp, "lamp"), "position_m"));
        printf("lamp %s: %.1f mm off\n", k ? "right" : "plate", 1e3 * away(position, want));
        assert_true(away(position, want) < 0.03);
    }
    tsuya_json_free(root);
    left.gloss = left.ambient = right.gloss = right.ambient = 0.0;
    tsuya_vec3 p = {0.07, 0.05, 0.0}, n = {0, 0, 1}, at = tsuya_pose_apply(lamp_plate(0), p), eye = {0, -0.5, 0.8};
    double real = 0.7 * M_PI / 0.85 * (lamp_radiance(&left, at, n, eye) + lamp_radiance(&right, at, n, eye));
    assert_near(written_irradiance(test_path("lamps.json"), p, n) / real, 1.0, 0.03);
    assert_true(tsuya_path_exists(test_path("lamps_right.png")) && tsuya_path_exists(test_path("lamps_plate.png")));
    assert_refused("plate plate/IMG_00.tif -o none.json", "a folder for each lamp");
    assert_refused("plate right/../plate -o none.json", "each folder names a lamp");
}

static void test_refusals(void **state)
{
    (void)state;
    lamp_truth truth = lamp_usual();
    assert_refused("plate/IMG_00.tif -o none.json", "one plane");
    draw_plates(&truth, "clipped", 2, 12.0, false);
    assert_refused("clipped -o none.json", "clipped");
    truth.intensity = 0.002;
    truth.ambient = 0.15;
    truth.position_m = (tsuya_vec3){0.05, 0.05, -0.8}; /* behind the plate: the room's light alone */
    draw_plates(&truth, "unlit", 4, 0.7, false);
    assert_refused("unlit -o none.json", "lamp");
    assert_false(tsuya_path_exists(test_path("none.json")));
}

/* A mirror ball on the plate, by rays: lamps (each half as bright as the one before), plate and a dim room are seen in it. */
static void draw_ball(tsuya_image *image, const tsuya_camera *cam, tsuya_pose from_world, tsuya_vec3 center, double radius, const tsuya_vec3 *lamp, int lamps,
                      double lamp_radius)
{
    tsuya_vec2 at;
    tsuya_vec3 eye = tsuya_pose_center(from_world);
    assert_true(tsuya_camera_project(cam, tsuya_pose_apply(from_world, center), &at));
    int reach = (int)(1.5 * cam->fx_px * radius / tsuya_pose_apply(from_world, center).z) + 4;
    for (int y = (int)at.y - reach; y <= (int)at.y + reach; y++) {
        for (int x = (int)at.x - reach; x <= (int)at.x + reach; x++) {
            double sum = 0.0;
            for (int k = 0; k < 16; k++) {
                tsuya_vec3 ray, d, n, p, r;
                assert_true(tsuya_camera_unproject(cam, (tsuya_vec2){x + (k % 4 - 1.5) / 4.0, y + (k / 4 - 1.5) / 4.0}, &ray));
                d = tsuya_mat3_apply_transposed(from_world.rotation, ray);
                tsuya_vec3 to = tsuya_vec3_sub(center, eye);
                double along = tsuya_vec3_dot(to, d), s2 = radius * radius - tsuya_vec3_dot(to, to) + along * along;
                if (s2 < 0.0) {
                    sum += (double)*tsuya_image_f32(image, x, y);
                    continue;
                }
                p = tsuya_vec3_mad(eye, along - sqrt(s2), d);
                n = tsuya_vec3_scale(tsuya_vec3_sub(p, center), 1.0 / radius);
                r = tsuya_vec3_mad(d, -2.0 * tsuya_vec3_dot(d, n), n);
                double seen = r.z < 0.0 ? 0.06 : 0.01;
                for (int i = 0; i < lamps; i++) {
                    tsuya_vec3 l = tsuya_vec3_sub(lamp[i], p);
                    double closest = tsuya_vec3_dot(l, r), off2 = tsuya_vec3_dot(l, l) - closest * closest;
                    seen = closest > 0.0 && off2 < lamp_radius * lamp_radius ? 8.0 / (1 << i) : seen;
                }
                sum += seen;
            }
            *tsuya_image_f32(image, x, y) = (float)(0.9 * sum / 16.0);
        }
    }
}

static const double ball_place[2][2] = {{-0.04, 0.05}, {0.20, 0.08}};

/* Two balls on a mat that lies still, five photographs; the first lamp lights the mat. */
static void draw_balls(const char *folder, const lamp_truth *truth, const tsuya_vec3 *lamp, int lamps)
{
    tsuya_board board;
    tsuya_camera cam = camera();
    assert_ok(tsuya_board_load(&board, test_path("board.yaml")));
    assert_ok(tsuya_folder_make(test_path(folder)));
    for (int k = 0; k < 5; k++) {
        tsuya_image image;
        char name[64];
        tsuya_vec3 eye = {0.08 + 0.35 * sin(1.3 * k), -0.5 + 0.12 * k, 0.6 - 0.03 * k};
        tsuya_pose from_world = tsuya_pose_look_at(eye, (tsuya_vec3){0.08, 0.06, 0.0}, (tsuya_vec3){0, 0, 1});
        scene_look look = look_of(k);
        shine s = {truth, tsuya_pose_identity(), 0.4, eye};
        look.light = shine_at;
        look.light_user = &s;
        scene_begin(&image, W, H, &look);
        scene_plate(&image, &board, 0, &cam, from_world, &look);
        for (int b = 0; b < 2; b++) {
            draw_ball(&image, &cam, from_world, (tsuya_vec3){ball_place[b][0] + 0.0004, ball_place[b][1] - 0.0003, 0.015}, 0.015, lamp, lamps, 0.02);
        }
        snprintf(name, sizeof name, "%s/IMG_%d.tif", folder, k);
        save_photo(&image, &look, name);
    }
    tsuya_board_free(&board);
}

/* Both shine at once; the weaker one is found as well as the stronger. */
static void test_two_lamps_in_a_ball(void **state)
{
    (void)state;
    static const tsuya_vec3 lamp[2] = {{0.35, 0.30, 0.55}, {-0.30, 0.35, 0.50}};
    lamp_truth truth = lamp_usual();
    truth.position_m = lamp[0];
    begin();
    draw_balls("two", &truth, lamp, 2);
    if (run("two --lamps 2 --ball '-40,50,30' --ball '200,80,30' -o two.json") != 0) {
        fail_msg("%s", output);
    }
    tsuya_json *root;
    bool found[2] = {false, false};
    assert_ok(tsuya_json_load(&root, test_path("two.json")));
    assert_int_equal(tsuya_json_count(tsuya_json_member(root, "lamps")), 2);
    for (int k = 0; k < 2; k++) {
        double position[3], rms;
        const tsuya_json *one = tsuya_json_element(tsuya_json_member(root, "lamps"), k);
        assert_ok(tsuya_json_get_numbers(position, 3, tsuya_json_member(one, "lamp"), "position_m"));
        assert_ok(tsuya_json_get_number(&rms, one, "rms_px"));
        int whose = away(position, lamp[1]) < away(position, lamp[0]);
        printf("two lamps in a ball: %.1f mm off, highlights %.2f px\n", 1e3 * away(position, lamp[whose]), rms);
        assert_true(away(position, lamp[whose]) < 0.05 && rms < 0.6 && !found[whose]);
        found[whose] = true;
    }
    tsuya_json_free(root);
    assert_true(tsuya_path_exists(test_path("two_1.png")) && tsuya_path_exists(test_path("two_2.png")));
    assert_int_equal(run("two --lamps 3 --ball '-40,50,30; IMG_0.tif' -o none.json"), 1);
    assert_non_null(strstr(output, "2 highlights in the ball"));
    (void)run("two --ball '-40,50,30' --ball '200,80,30' -o one.json"); /* where both look alike, neither is taken for the only one */
    assert_non_null(strstr(output, "--lamps says how many shine at once"));
    assert_int_equal(run("two --lamps 2 --white --ball '-40,50,30' -o none.json"), 2);
}

static void test_balls(void **state)
{
    (void)state;
    lamp_truth truth = lamp_usual();
    truth.position_m = (tsuya_vec3){0.35, 0.30, 0.55};
    tsuya_vec3 lamp = truth.position_m;
    begin();
    draw_balls("balls", &truth, &lamp, 1);
    if (run("balls --ball '-40,50,30' --ball '200,80,30' -o ball.json") != 0) {
        fail_msg("%s", output);
    }
    tsuya_json *root;
    double position[3], sigma[3], rms;
    assert_ok(tsuya_json_load(&root, test_path("ball.json")));
    assert_ok(tsuya_json_get_numbers(position, 3, tsuya_json_member(root, "lamp"), "position_m"));
    assert_ok(tsuya_json_get_numbers(sigma, 3, tsuya_json_member(root, "lamp"), "position_sigma_m"));
    assert_ok(tsuya_json_get_number(&rms, root, "rms_px"));
    tsuya_json_free(root);
    double size = sqrt(sigma[0] * sigma[0] + sigma[1] * sigma[1] + sigma[2] * sigma[2]);
    printf("balls: lamp %.1f mm off (sigma %.1f %.1f %.1f mm), highlights %.2f px\n", 1e3 * away(position, lamp), 1e3 * sigma[0], 1e3 * sigma[1], 1e3 * sigma[2], rms);
    assert_true(away(position, lamp) < 0.05 && away(position, lamp) < 2.5 * size && rms < 0.6);
    /* The mat's white beside the balls: place and irradiance from one estimate. */
    if (run("balls --white --ball '-40,50,30' --ball '200,80,30' -o both.json") != 0) {
        fail_msg("%s", output);
    }
    assert_ok(tsuya_json_load(&root, test_path("both.json")));
    assert_ok(tsuya_json_get_numbers(position, 3, tsuya_json_member(root, "lamp"), "position_m"));
    assert_ok(tsuya_json_get_numbers(sigma, 3, tsuya_json_member(root, "lamp"), "position_sigma_m"));
    tsuya_json_free(root);
    size = sqrt(sigma[0] * sigma[0] + sigma[1] * sigma[1] + sigma[2] * sigma[2]);
    truth.gloss = truth.ambient = 0.0;
    tsuya_vec3 p = {0.07, 0.05, 0.0}, n = {0, 0, 1};
    double real = 0.4 * M_PI / 0.85 * lamp_radiance(&truth, p, n, (tsuya_vec3){0, -0.5, 0.8}), written = written_irradiance(test_path("both.json"), p, n);
    printf("balls and white: lamp %.1f mm off (sigma %.1f %.1f %.1f mm), irradiance of the mat %.1f %% off\n", 1e3 * away(position, lamp), 1e3 * sigma[0], 1e3 * sigma[1],
           1e3 * sigma[2], 100.0 * (written / real - 1.0));
    assert_true(away(position, lamp) < 0.04 && away(position, lamp) < 2.5 * size);
    assert_near(written / real, 1.0, 0.03);
    assert_refused("balls --ball '-40,50,30; IMG_0.tif' -o none.json", "no distance");
    assert_refused("balls --ball '-40,50' -o none.json", "X,Y,DIAMETER");
    assert_refused("balls --ball '-40,50,30; IMG_9.tif' -o none.json", "none of the photographs");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_plate),
        cmocka_unit_test(test_two_lamps),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_balls), cmocka_unit_test(test_two_lamps_in_a_ball),
    };
    int result = cmocka_run_group_tests(tests, NULL, NULL);
    tsuya_free(output);
    if (!getenv("TSUYA_KEEP")) {
        test_folder_remove();
    } else {
        printf("%s\n", test_folder());
    }
    return result;
}
