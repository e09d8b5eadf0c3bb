/* Lamp from readings of a matte plate and from mirror balls; the truth in lamp_scene.h. */
#include "lamp_scene.h"

#include "calib/lamp.h"
#include "core/memory.h"

enum { COLS = 4, ROWS = 3, RUNS = 24 };

/* Readings as the photographs of the plate would give them: relative noise a reading, an exposure of its own a photograph. */
static void make_readings(tsuya_lamp_readings *r, const lamp_truth *l, int photos, double noise, double exposure, uint64_t seed, double turn)
{
    tsuya_pose camera = lamp_camera();
    tsuya_vec3 eye = tsuya_pose_center(camera);
    *r = (tsuya_lamp_readings){.photos = photos, .plates = 1};
    r->reading = tsuya_calloc((size_t)photos * COLS * ROWS, sizeof *r->reading);
    for (int k = 0; k < photos; k++) {
        tsuya_pose pose = lamp_plate(k);
        pose.rotation = tsuya_mat3_from_rodrigues(tsuya_vec3_scale(tsuya_rodrigues_from_mat3(pose.rotation), turn));
        pose.translation.z *= turn;
        double gain = exp(exposure * tsuya_random_normal(seed, 1, (uint64_t)k));
        for (int i = 0; i < COLS * ROWS; i++) {
            tsuya_lamp_reading *out = &r->reading[r->count++];
            *out = (tsuya_lamp_reading){.photo = k};
            out->place_m = (tsuya_vec2){0.015 + 0.039 * (i % COLS), 0.015 + 0.039 * (i / COLS)};
            out->position_m = tsuya_pose_apply(pose, (tsuya_vec3){out->place_m.x, out->place_m.y, 0});
            out->normal = tsuya_mat3_apply(pose.rotation, (tsuya_vec3){0, 0, 1});
            double v = gain * lamp_radiance(l, out->position_m, out->normal, eye) * (1.0 + noise * tsuya_random_normal(seed, 2, (uint64_t)r->count));
            out->rgb[0] = v, out->rgb[1] = 0.8 * v, out->rgb[2] = 0.5 * v;
        }
    }
}

static double away(tsuya_vec3 a, tsuya_vec3 b) { return tsuya_vec3_norm(tsuya_vec3_sub(a, b)); }

static double degrees(tsuya_vec3 a, tsuya_vec3 b) { return tsuya_deg_from_rad(acos(fmin(tsuya_vec3_dot(tsuya_vec3_unit(a), tsuya_vec3_unit(b)), 1.0))); }

static void say(const char *what, const tsuya_lamp *l, const lamp_truth *truth)
{
    printf("%s: %.1f mm off (sigma %.1f mm along, %.2f deg across), direction %.1f deg off (sigma %.1f), falloff %.2f +- %.2f (%.1f), power %.2f +- %.2f, "
           "intensity %.3f (%.3f), rms %.2f %%, ambient %.4f (%.4f), %d of %d outliers%s\n", what, 1e3 * away(l->position_m, truth->position_m),
           1e3 * l->distance_sigma_m, l->to_lamp_sigma_deg, degrees(l->direction, truth->direction), l->direction_sigma_deg, l->falloff, l->falloff_sigma,
           truth->falloff, l->distance_exponent, l->distance_exponent_sigma, l->rgb[0], truth->intensity, 100 * l->rms, l->ambient[0], truth->ambient, l->outliers,
           l->readings, l->far_away ? ", far away" : "");
}

static tsuya_lamp fit(const lamp_truth *truth, int photos, double noise, double exposure, uint64_t seed, const char *what)
{
    tsuya_lamp lamp;
    tsuya_lamp_readings r;
    tsuya_lamp_options options = tsuya_lamp_options_default();
    options.vignetting_known = true;
    make_readings(&r, truth, photos, noise, exposure, seed, 1.0);
    assert_ok(tsuya_lamp_fit(&lamp, &r, &options));
    tsuya_lamp_readings_free(&r);
    if (what) {
        say(what, &lamp, truth);
    }
    return lamp;
}

static void test_lamps_come_back(void **state)
{
    (void)state;
    lamp_truth disk = lamp_usual();
    tsuya_lamp l = fit(&disk, 14, 0.005, 0.003, 1, "even disk");
    assert_true(away(l.position_m, disk.position_m) < 0.02);
    assert_near(l.rgb[0] / disk.intensity, 1.0, 0.06);
    assert_near(l.rgb[1] / l.rgb[0], 0.8, 0.005);
    lamp_truth point = lamp_usual();
    point.falloff = 0.0;
    l = fit(&point, 14, 0.005, 0.003, 2, "bare point");
    assert_true(away(l.position_m, point.position_m) < 0.02);
    lamp_truth spot = lamp_usual();
    spot.falloff = 8.0;
    l = fit(&spot, 14, 0.005, 0.003, 3, "narrow lobe");
    assert_true(away(l.position_m, spot.position_m) < 0.03 && degrees(l.direction, spot.direction) < 4.0);
    assert_near(l.falloff, 8.0, 1.5);
    lamp_truth far = lamp_usual();
    far.position_m = (tsuya_vec3){72, 48, 96};
    far.direction = (tsuya_vec3){-72, -48, -96};
    far.intensity *= 22000.0;
    l = fit(&far, 14, 0.005, 0.003, 4, "far lamp");
    assert_true(l.far_away && degrees(l.to_lamp, far.position_m) < 1.0);
}

/* Where a ball shows the lamp: the normal that halves the way to the eye and the way to the lamp, from the shortest way's own condition. */
static tsuya_vec3 shown_at(tsuya_vec3 eye, tsuya_vec3 lamp, tsuya_vec3 center, double radius)
{
    tsuya_vec3 q = tsuya_vec3_mad(center, radius, tsuya_vec3_unit(tsuya_vec3_sub(eye, center)));
    for (int k = 0; k < 200; k++) {
        tsuya_vec3 n = tsuya_vec3_unit(tsuya_vec3_add(tsuya_vec3_unit(tsuya_vec3_sub(eye, q)), tsuya_vec3_unit(tsuya_vec3_sub(lamp, q))));
        q = tsuya_vec3_mad(center, radius, n);
    }
    return q;
}

enum { BALLS = 2, VIEWS = 5 };

/* Two balls on a mat that lies still, five photographs: highlights within 0.3 px, balls within 0.5 mm of where they are said to be. */
static void make_highlights(tsuya_lamp_balls *b, const lamp_truth *l, const tsuya_camera *camera, uint64_t seed)
{
    static const double place[BALLS][2] = {{-0.04, 0.05}, {0.20, 0.08}};
    *b = (tsuya_lamp_balls){tsuya_calloc(BALLS, sizeof *b->ball), tsuya_calloc(BALLS * VIEWS, sizeof *b->highlight), BALLS, 0, camera};
    for (int k = 0; k < BALLS; k++) {
        double dx = 0.0005 * tsuya_random_normal(seed, 11, 2 * (uint64_t)k), dy = 0.0005 * tsuya_random_normal(seed, 11, 2 * (uint64_t)k + 1);
        b->ball[k] = (tsuya_lamp_ball){place[k][0] + dx, place[k][1] + dy, 0.03};
        for (int v = 0; v < VIEWS; v++) {
            tsuya_lamp_highlight *h = &b->highlight[b->highlights++];
            tsuya_vec3 eye = {0.08 + 0.35 * sin(1.3 * v), -0.5 + 0.12 * v, 0.6 - 0.03 * v};
            *h = (tsuya_lamp_highlight){.ball = k, .photo = v, .camera_from_world = tsuya_pose_look_at(eye, (tsuya_vec3){0.08, 0.06, 0.0}, (tsuya_vec3){0, 0, 1})};
            tsuya_vec3 q = shown_at(eye, l->position_m, (tsuya_vec3){place[k][0], place[k][1], 0.015}, 0.015);
            assert_true(tsuya_camera_project(camera, tsuya_pose_apply(h->camera_from_world, q), &h->pixel));
            h->pixel.x += 0.3 * tsuya_random_normal(seed, 12, 2 * (uint64_t)b->highlights);
            h->pixel.y += 0.3 * tsuya_random_normal(seed, 12, 2 * (uint64_t)b->highlights + 1);
        }
    }
}

/* Balls alone, and balls with the white of the mat that they lie on: errors and what was stated. */
static void test_balls_with_white(void **state)
{
    (void)state;
    static const tsuya_camera camera = {.lens = TSUYA_LENS_PINHOLE, .width_px = 1600, .height_px = 1200, .fx_px = 2500, .fy_px = 2500, .cx_px = 800, .cy_px = 600};
    lamp_truth truth = lamp_usual();
    truth.gloss = 0.0;
    double alone = 0.0, both = 0.0, stated = 0.0, level = 0.0;
    for (int k = 0; k < RUNS / 2; k++) {
        tsuya_lamp lamp, joint;
        tsuya_lamp_readings r;
        tsuya_lamp_balls b;
        tsuya_lamp_options options = tsuya_lamp_options_default();
        options.vignetting_known = true;
        make_readings(&r, &truth, VIEWS, 0.005, 0.003, 300 + (uint64_t)k, 0.0); /* lies flat in all of them */
        make_highlights(&b, &truth, &camera, 300 + (uint64_t)k);
        assert_ok(tsuya_lamp_ball_fit(&lamp, &b));
        tsuya_free(b.ball);
        tsuya_free(b.highlight);
        make_highlights(&b, &truth, &camera, 300 + (uint64_t)k);
        options.balls = &b;
        assert_ok(tsuya_lamp_fit(&joint, &r, &options));
        tsuya_free(b.ball);
        tsuya_free(b.highlight);
        assert_true(joint.has_intensity && joint.highlights == BALLS * VIEWS && joint.rms_px < 1.0 && joint.rms < 0.01);
        tsuya_vec3 e = tsuya_vec3_sub(lamp.position_m, truth.position_m), f = tsuya_vec3_sub(joint.position_m, truth.position_m);
        alone += tsuya_vec3_dot(e, e);
        both += tsuya_vec3_dot(f, f);
        stated += joint.position_cov_m2[0] + joint.position_cov_m2[4] + joint.position_cov_m2[8];
        level = fmax(level, fabs(joint.rgb[1] / joint.rgb[0] - 0.8));
        tsuya_lamp_readings_free(&r);
    }
    printf("two balls on a mat: %.1f mm off alone, %.1f mm with its white (stated over observed sigma %.2f)\n", 1e3 * sqrt(2 * alone / RUNS), 1e3 * sqrt(2 * both / RUNS),
           sqrt(stated / both));
    assert_true(both < alone && level < 0.005);
    assert_true(sqrt(stated / both) > 0.67 && sqrt(stated / both) < 1.5);
}

/* Stated over observed sigma of the place, over many draws of noise and exposure. */
static void test_sigmas_are_honest(void **state)
{
    (void)state;
    lamp_truth truth = lamp_usual();
    truth.gloss = 0.0;
    truth.diameter_m = 1e-4;
    double stated = 0.0, seen = 0.0, stated_across = 0.0, seen_across = 0.0, falloff = 0.0, falloff_seen = 0.0;
    for (int k = 0; k < RUNS; k++) {
        tsuya_lamp l = fit(&truth, 12, 0.01, 0.01, 100 + (uint64_t)k, NULL);
        tsuya_vec3 e = tsuya_vec3_sub(l.position_m, truth.position_m);
        double along = tsuya_vec3_dot(e, l.to_lamp), across = tsuya_vec3_norm(tsuya_vec3_mad(e, -along, l.to_lamp));
        stated += l.distance_sigma_m * l.distance_sigma_m;
        seen += along * along;
        for (int i = 0; i < 3; i++) {
            stated_across += l.position_cov_m2[4 * i];
        }
        stated_across -= l.distance_sigma_m * l.distance_sigma_m;
        seen_across += across * across;
        falloff += l.falloff_sigma * l.falloff_sigma;
        falloff_seen += (l.falloff - 1.0) * (l.falloff - 1.0);
    }
    printf("stated over observed sigma: along %.2f, across %.2f, falloff %.2f; observed %.1f mm along, %.1f across\n", sqrt(stated / seen),
           sqrt(stated_across / seen_across), sqrt(falloff / falloff_seen), 1e3 * sqrt(seen / RUNS), 1e3 * sqrt(seen_across / RUNS));
    assert_true(sqrt(stated / seen) > 0.75 && sqrt(stated / seen) < 1.33);
    assert_true(sqrt(stated_across / seen_across) > 0.75 && sqrt(stated_across / seen_across) < 1.33);
}

static void test_shadows_and_hands_are_left_out(void **state)
{
    (void)state;
    lamp_truth truth = lamp_usual();
    tsuya_lamp lamp;
    tsuya_lamp_readings r;
    tsuya_lamp_options options = tsuya_lamp_options_default();
    options.vignetting_known = true;
    make_readings(&r, &truth, 14, 0.005, 0.003, 5, 1.0);
    for (int i = 0; i < r.count; i += 7) {
        for (int c = 0; c < 3; c++) {
            r.reading[i].rgb[c] *= i % 2 ? 0.4 : 1.5;
        }
    }
    assert_ok(tsuya_lamp_fit(&lamp, &r, &options));
    say("every seventh tag in a shadow or shining", &lamp, &truth);
    assert_true(away(lamp.position_m, truth.position_m) < 0.03 && lamp.outliers >= r.count / 7);
    tsuya_lamp_readings_free(&r);
}

static void test_refusals(void **state)
{
    (void)state;
    lamp_truth truth = lamp_usual();
    tsuya_lamp lamp;
    tsuya_lamp_readings r;
    tsuya_lamp_options options = tsuya_lamp_options_default();
    make_readings(&r, &truth, 1, 0.005, 0.003, 6, 0.0);
    assert_fails(tsuya_lamp_fit(&lamp, &r, &options), "one plane");
    tsuya_lamp_readings_free(&r);
    make_readings(&r, &truth, 6, 0.005, 0.003, 6, 0.0);
    assert_fails(tsuya_lamp_fit(&lamp, &r, &options), "one plane");
    tsuya_lamp_readings_free(&r);
    make_readings(&r, &truth, 10, 0.005, 0.003, 7, 1.0);
    r.clipped = 200;
    assert_fails(tsuya_lamp_fit(&lamp, &r, &options), "clipped");
    r.clipped = 0;
    r.count = 5;
    assert_fails(tsuya_lamp_fit(&lamp, &r, &options), "are needed");
    tsuya_lamp_readings_free(&r);
    truth.intensity = 1e-4;
    truth.ambient = 1e-4;
    make_readings(&r, &truth, 10, 0.005, 0.003, 8, 1.0);
    assert_fails(tsuya_lamp_fit(&lamp, &r, &options), "not lit");
    tsuya_lamp_readings_free(&r);
    truth = lamp_usual();
    truth.position_m = (tsuya_vec3){0.5, 0.06, 0.01};
    truth.direction = (tsuya_vec3){-1, 0, 0};
    make_readings(&r, &truth, 10, 0.005, 0.003, 9, 0.3);
    for (int i = 0; i < r.count; i++) { /* turned away from the lamp, all of them */
        r.reading[i].normal = tsuya_vec3_unit(tsuya_vec3_sub(r.reading[i].normal, (tsuya_vec3){0.1, 0, 0}));
    }
    assert_fails(tsuya_lamp_fit(&lamp, &r, &options), "the lamp stands in the plate's plane");
    tsuya_lamp_readings_free(&r);
    truth = lamp_usual();
    make_readings(&r, &truth, 10, 0.005, 0.003, 9, 1.0);
    for (int i = 0; i < r.count; i++) { /* another lamp in every photograph */
        for (int c = 0; c < 3; c++) {
            r.reading[i].rgb[c] *= 0.2 + tsuya_random_uniform(10, (uint64_t)r.reading[i].photo, 0) + tsuya_random_uniform(10, 99, (uint64_t)i);
        }
    }
    assert_fails(tsuya_lamp_fit(&lamp, &r, &options), "does not fit one lamp");
    tsuya_lamp_readings_free(&r);
}

/* Three lamps at once: highlights in any order go to their lamps, so that each is found as if it had shone alone. */
static void test_lamps_at_once(void **state)
{
    (void)state;
    enum { LAMPS = 3 };
    static const tsuya_camera camera = {.lens = TSUYA_LENS_PINHOLE, .width_px = 1600, .height_px = 1200, .fx_px = 2500, .fy_px = 2500, .cx_px = 800, .cy_px = 600};
    static const tsuya_vec3 at[LAMPS] = {{0.45, 0.35, 0.70}, {-0.35, 0.40, 0.60}, {0.10, 0.70, 0.30}};
    for (int run = 0; run < RUNS / 2; run++) {
        tsuya_lamp_balls own[LAMPS], all = {tsuya_calloc(BALLS, sizeof *all.ball), tsuya_calloc(LAMPS * BALLS * VIEWS, sizeof *all.highlight), BALLS, 0, &camera};
        bool taken[LAMPS] = {false};
        for (int k = 0; k < LAMPS; k++) {
            lamp_truth truth = lamp_usual();
            truth.position_m = at[k];
            make_highlights(&own[k], &truth, &camera, 500 + (uint64_t)run);
        }
        memcpy(all.ball, own[0].ball, BALLS * sizeof *all.ball);
        for (int g = 0; g < BALLS * VIEWS; g++) {
            for (int k = 0; k < LAMPS; k++) { /* another order in each group */
                all.highlight[all.highlights++] = own[(k * (1 + g % 2) + g / 2) % LAMPS].highlight[g];
            }
        }
        assert_ok(tsuya_lamp_balls_sort(&all, LAMPS));
        for (int k = 0; k < LAMPS; k++) {
            tsuya_lamp_balls one = {NULL, all.highlight + k * BALLS * VIEWS, BALLS, BALLS * VIEWS, &camera};
            int whose = 0;
            for (int i = 1; i < LAMPS; i++) {
                whose = memcmp(&one.highlight[0].pixel, &own[i].highlight[0].pixel, sizeof(tsuya_vec2)) == 0 ? i : whose;
            }
            assert_false(taken[whose]);
            taken[whose] = true;
            for (int g = 0; g < BALLS * VIEWS; g++) {
                assert_memory_equal(&one.highlight[g].pixel, &own[whose].highlight[g].pixel, sizeof(tsuya_vec2));
            }
        }
        for (int k = 0; k < LAMPS; k++) {
            tsuya_free(own[k].ball);
            tsuya_free(own[k].highlight);
        }
        tsuya_free(all.ball);
        tsuya_free(all.highlight);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_lamps_come_back),
        cmocka_unit_test(test_balls_with_white), cmocka_unit_test(test_lamps_at_once),
        cmocka_unit_test(test_sigmas_are_honest),
        cmocka_unit_test(test_shadows_and_hands_are_left_out),
        cmocka_unit_test(test_refusals),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
