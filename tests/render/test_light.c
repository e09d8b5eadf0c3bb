/* Lamps: their samples have the density that is said of them, and lamp files are read to the letter or refused. */
#include "support.h"

#include "render_scenes.h"

#include "render/lamps.h"

/* ∫ over directions of what a hit reports equals the mean of sample / pdf, for area lamps and skies. */
static void test_samples_match_hits(void **state)
{
    (void)state;
    const tsuya_light lamps[] = {
        {.kind = TSUYA_LIGHT_DISK, .position_m = {0.5, 0.2, 1.0}, .direction = {-0.3, 0.1, -1.0}, .size_m = {0.8, 0.8}, .rgb = {2, 1, 1}},
        {.kind = TSUYA_LIGHT_RECT, .position_m = {-0.5, 0.2, 1.0}, .direction = {0.6, 0.1, -1.0}, .size_m = {0.8, 0.3}, .rgb = {2, 1, 1}},
        {.kind = TSUYA_LIGHT_ENVIRONMENT, .rgb = {2, 1, 1}},
    };
    const tsuya_vec3 p = {0.1, 0.1, 0.1}, n = tsuya_vec3_unit((tsuya_vec3){0.2, -0.1, 1});
    enum { SIDE = 600 };
    for (size_t l = 0; l < 3; ++l) {
        tsuya_light_set set = {0};
        add_light(&set, lamps[l]);
        double by_samples = 0.0, by_hits = 0.0, probability = 0.0;
        for (int k = 0; k < SIDE * SIDE; ++k) {
            const double u[2] = {(k % SIDE + 0.5) / SIDE, (k / SIDE + 0.5) / SIDE};
            tsuya_light_sample sample;
            double distance, rgb[3], pdf;
            if (tsuya_light_sample_at(&set.light[0], p, n, u, &sample)) {
                by_samples += sample.rgb[0] * tsuya_vec3_dot(sample.wi, n) / (sample.pdf * SIDE * SIDE);
                assert_true(tsuya_light_hit(&set.light[0], p, n, sample.wi, &distance, rgb, &pdf));
                assert_true(fabs(pdf - sample.pdf) < 1e-6 * pdf && rgb[0] == sample.rgb[0]);
                assert_true(isinf(distance) || fabs(distance - sample.distance_m) < 1e-9);
            }
            double z = u[0], r = sqrt(1.0 - z * z), phi = 2.0 * M_PI * u[1];
            tsuya_vec3 d = {r * cos(phi), r * sin(phi), z};
            if (tsuya_light_hit(&set.light[0], p, n, d, &distance, rgb, &pdf) && tsuya_vec3_dot(d, n) > 0.0) {
                by_hits += rgb[0] * tsuya_vec3_dot(d, n) * 2.0 * M_PI / (SIDE * SIDE);
                probability += pdf * 2.0 * M_PI / (SIDE * SIDE);
            }
        }
        if (lamps[l].kind != TSUYA_LIGHT_ENVIRONMENT) { /* the sky reaches under z = 0, which the second sum leaves out */
            assert_true(fabs(by_samples - by_hits) < 5e-3 * by_hits && fabs(probability - 1.0) < 5e-3);
        } else {
            assert_true(fabs(by_samples - 2.0 * M_PI) < 1e-6);
        }
        tsuya_light_set_free(&set);
    }
}

/* Whatever can shine on a point has a weight above 0 there. */
static void test_weights_never_lose_a_lamp(void **state)
{
    (void)state;
    tsuya_light_set set = {0};
    const double u[3][2] = {{0.02, 0.5}, {0.98, 0.5}, {0.5, 0.02}};
    for (int k = 0; k < 400; ++k) {
        double a = 0.7 * k, h = 0.02 * (k % 20) - 0.1;
        tsuya_light light = {.kind = k % 2 ? TSUYA_LIGHT_DISK : TSUYA_LIGHT_RECT, .position_m = {cos(a), sin(a), h},
                             .direction = {sin(3.0 * a), cos(a), sin(5.0 * a)}, .size_m = {0.5, 0.5}, .rgb = {0, 0, 1}};
        add_light(&set, light);
        for (int s = 0; s < 3; ++s) {
            tsuya_light_sample sample;
            tsuya_vec3 p = {0, 0, 0}, n = {0, 0, 1};
            if (tsuya_light_sample_at(&set.light[k], p, n, u[s], &sample) && sample.wi.z > 0.0) {
                assert_true(tsuya_light_weight(&set.light[k], p, n) > 0.0);
            }
        }
    }
    tsuya_light_set_free(&set);
}

static void test_file(void **state)
{
    (void)state;
    const char *text = "{\"lights\": [{\"type\": \"spot\", \"position_m\": [1, 2, 3], \"direction\": [0, 0, -2], \"cone_deg\": [20, 30], "
                       "\"rgb\": [1, 2, 3]}, {\"type\": \"disk\", \"position_m\": [0, 0, 1], \"direction\": [0, 0, -1], \"size_m\": [0.5], "
                       "\"rgb\": [1, 1, 1]}, {\"type\": \"environment\", \"rgb\": [0.1, 0.1, 0.1]}]}";
    tsuya_light_set set;
    assert_ok(tsuya_light_set_parse(&set, text, "lights.json", "."));
    assert_int_equal(set.count, 3);
    assert_true(set.light[0].direction.z == -1.0 && fabs(set.light[0].cone_rad[1] - M_PI / 6.0) < 1e-12);
    assert_true(fabs(set.light[1].area_m2 - M_PI / 16.0) < 1e-12);
    tsuya_light_set_free(&set);
    assert_ok(tsuya_light_set_parse(&set, "{\"lights\": []}", "lights.json", "."));
    assert_int_equal(set.count, 0);
}

static void test_hostile_files(void **state)
{
    (void)state;
    static const struct { const char *text, *names; } bad[] = {
        {"", "evil.json"},
        {"[]", "lights"},
        {"{\"lights\": 3}", "lights"},
        {"{\"lights\": [3]}", "type"},
        {"{\"lights\": [{\"type\": \"laser\", \"rgb\": [1,1,1]}]}", "laser"},
        {"{\"lights\": [{\"type\": \"point\", \"rgb\": [1,1,1]}]}", "position_m"},
        {"{\"lights\": [{\"type\": \"point\", \"position_m\": [0,0], \"rgb\": [1,1,1]}]}", "position_m"},
        {"{\"lights\": [{\"type\": \"point\", \"position_m\": [0,0,0], \"rgb\": [1,1,-1]}]}", "rgb"},
        {"{\"lights\": [{\"type\": \"point\", \"position_m\": [0,0,0], \"rbg\": [1,1,1]}]}", "rbg"},
        {"{\"lights\": [{\"type\": \"directional\", \"direction\": [0,0,0], \"rgb\": [1,1,1]}]}", "direction"},
        {"{\"lights\": [{\"type\": \"rect\", \"position_m\": [0,0,0], \"direction\": [0,0,1], \"size_m\": [1,0], \"rgb\": [1,1,1]}]}", "size_m"},
        {"{\"lights\": [{\"type\": \"disk\", \"position_m\": [0,0,0], \"direction\": [0,0,1], \"size_m\": [1,2], \"rgb\": [1,1,1]}]}", "diameter"},
        {"{\"lights\": [{\"type\": \"spot\", \"position_m\": [0,0,0], \"direction\": [0,0,1], \"cone_deg\": [40,20], \"rgb\": [1,1,1]}]}", "cone_deg"},
        {"{\"lights\": [{\"type\": \"environment\", \"file\": \"missing.exr\"}]}", "missing.exr"},
        {"{\"lights\": [{\"type\": \"point\", \"position_m\": [0,0,0], \"rgb\": [1,1,1], \"file\": \"a.exr\"}]}", "environment"},
    };
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; ++k) {
        tsuya_light_set set;
        assert_fails(tsuya_light_set_parse(&set, bad[k].text, "evil.json", "/nowhere"), bad[k].names);
        assert_int_equal(set.count, 0);
        assert_non_null(strstr(tsuya_reason(), strstr(bad[k].names, "missing") ? bad[k].names : "evil.json"));
    }
}

/* The studio lights a white wall that faces its key to a radiance near 1, whatever the scale. */
static void test_studio(void **state)
{
    (void)state;
    for (int k = 0; k < 3; ++k) {
        const double radius = pow(100.0, k - 1);
        tsuya_light_set set;
        tsuya_vec3 center = {1, 2, 3}, eye = {1, 2 - 10 * radius, 3};
        assert_ok(tsuya_light_set_studio(&set, center, radius, eye, (tsuya_vec3){0, 0, 1}));
        double irradiance = 0.0;
        tsuya_vec3 n = tsuya_vec3_unit(tsuya_vec3_sub(set.light[0].position_m, center));
        for (int l = 0; l < set.count; ++l) {
            for (int s = 0; s < 1024; ++s) {
                const double u[2] = {(s % 32 + 0.5) / 32, (s / 32 + 0.5) / 32};
                tsuya_light_sample sample;
                if (tsuya_light_sample_at(&set.light[l], center, n, u, &sample)) {
                    irradiance += sample.rgb[0] * fmax(0.0, tsuya_vec3_dot(n, sample.wi)) / sample.pdf / 1024;
                }
            }
        }
        assert_true(irradiance / M_PI > 0.8 && irradiance / M_PI < 1.2);
        tsuya_light_set_free(&set);
    }
}

static bool near(double a, double b, double tolerance) { return fabs(a - b) <= tolerance * fmax(fabs(a), fabs(b)) || a == b; }

static void random_places(tsuya_planes3 *p, tsuya_planes3 *n, float *u, float *v, float *w, uint64_t stream)
{
    for (int k = 0; k < TSUYA_LANES; ++k) {
        double r[9];
        for (uint64_t i = 0; i < 9; ++i) {
            r[i] = tsuya_random_uniform(stream, i, (uint64_t)k);
        }
        tsuya_planes3_set(p, k, (tsuya_vec3){2 * r[0] - 1, 2 * r[1] - 1, r[2]});
        tsuya_planes3_set(n, k, tsuya_vec3_unit((tsuya_vec3){2 * r[3] - 1, 2 * r[4] - 1, 2 * r[5] - 1}));
        u[k] = (float)(0.999 * r[6]);
        v[k] = (float)(0.999 * r[7]);
        w[k] = (float)(0.999 * r[8]);
    }
}

/* The sample of the lamp that a lane chose, and what a ray along it runs into. */
static void check_lane(const tsuya_lamps *lamps, int k, const tsuya_planes3 *p, const tsuya_planes3 *n, const double u[2], const tsuya_lamp_choice *choice,
                       const tsuya_lamp_samples *s)
{
    tsuya_light_sample one;
    const tsuya_light *light = &lamps->set->light[choice->lamp[k]];
    bool arrives = tsuya_light_sample_at(light, tsuya_planes3_at(p, k), tsuya_planes3_at(n, k), u, &one);
    assert_true(arrives == (s->pdf[k] > 0.0f) || one.pdf > 1e4 /* grazing the lamp */);
    if (!arrives || !(s->pdf[k] > 0.0f)) {
        return;
    }
    assert_true(near((double)s->pdf[k], one.pdf, 1e-3) && near((double)s->distance[k], one.distance_m, 1e-5) && (s->delta[k] > 0.0f) == one.delta);
    assert_true(tsuya_vec3_norm(tsuya_vec3_sub(tsuya_planes3_at(&s->wi, k), one.wi)) < 1e-5);
    for (int c = 0; c < 3; ++c) {
        assert_true(near((double)s->rgb[c][k], one.rgb[c], 1e-5));
    }
}

/* A wave's lamps say what the lamps say one by one. */
static void test_wave_like_one(void **state)
{
    (void)state;
    tsuya_light_set set = {0};
    tsuya_lamps lamps;
    twenty_lamps(&set);
    add_light(&set, (tsuya_light){.kind = TSUYA_LIGHT_POINT, .position_m = {1, -1, 2}, .rgb = {3, 2, 1}});
    add_light(&set, (tsuya_light){.kind = TSUYA_LIGHT_SPOT, .position_m = {-1, 1, 2}, .direction = {1, -1, -2}, .cone_rad = {0.5, 1.2}, .rgb = {3, 2, 1}});
    add_light(&set, (tsuya_light){.kind = TSUYA_LIGHT_DIRECTIONAL, .direction = {1, 1, -1}, .rgb = {1, 1, 0.5}});
    for (int k = 0; k < 20; ++k) { /* more than are kept at once */
        add_light(&set, (tsuya_light){.kind = TSUYA_LIGHT_POINT, .position_m = {cos(k), sin(k), 1}, .rgb = {0.1, 0.1, 0.1}});
    }
    assert_ok(tsuya_lamps_create(&lamps, &set));
    assert_true(lamps.in_the_way);
    for (uint64_t round = 0; round < 40; ++round) {
        tsuya_planes3 p, n;
        float u[TSUYA_LANES], v[TSUYA_LANES], w[TSUYA_LANES], share[TSUYA_LANES];
        static tsuya_lamp_choice choice;
        static tsuya_lamp_samples samples;
        static tsuya_lamp_rays rays;
        random_places(&p, &n, u, v, w, 50 + round);
        tsuya_lamps_choose(&lamps, TSUYA_LANES, &p, &n, w, &choice);
        tsuya_lamps_sample(&lamps, TSUYA_LANES, &p, &n, &choice, (const float *const[2]){u, v}, &samples);
        for (int k = 0; k < TSUYA_LANES; ++k) {
            double sum = 0.0, before = 0.0;
            tsuya_vec3 at = tsuya_planes3_at(&p, k), normal = tsuya_planes3_at(&n, k);
            for (int l = 0; l < set.count; ++l) {
                double weight = tsuya_light_weight(&set.light[l], at, normal);
                before += l < choice.lamp[k] ? weight : 0.0;
                sum += weight;
            }
            double own = tsuya_light_weight(&set.light[choice.lamp[k]], at, normal);
            assert_true(near((double)choice.sum[k], sum, 1e-5) && near((double)choice.probability[k], own / sum, 1e-4));
            assert_true((double)w[k] * sum >= before - 1e-5 * sum && (double)w[k] * sum <= before + own + 1e-5 * sum);
            check_lane(&lamps, k, &p, &n, (const double[2]){(double)u[k], (double)v[k]}, &choice, &samples);
            rays.reach[k] = k % 5 == 0 ? 0.5f : INFINITY;
            rays.pdf[k] = 0.3f;
            rays.weights[k] = choice.sum[k];
        }
        rays.from = p;
        rays.n = n;
        rays.direction = samples.wi;
        rays.shared = true;
        for (int l = 0; l < 21; ++l) { /* those that have an extent */
            bool any = tsuya_lamps_meet(&lamps, l, TSUYA_LANES, &rays, share);
            for (int k = 0; k < TSUYA_LANES; ++k) {
                double distance, rgb[3], pdf, expected = 0.0;
                tsuya_vec3 at = tsuya_planes3_at(&p, k), normal = tsuya_planes3_at(&n, k), along = tsuya_planes3_at(&samples.wi, k);
                if (tsuya_light_hit(&set.light[l], at, normal, along, &distance, rgb, &pdf) && pdf > 0.0 && distance <= (double)rays.reach[k]) {
                    double r = pdf * tsuya_light_weight(&set.light[l], at, normal) / (double)choice.sum[k] / 0.3;
                    expected = 1.0 / (1.0 + r * r);
                }
                assert_true((any || expected == 0.0) && (!any || near((double)share[k], expected, 2e-3) || pdf > 1e4));
            }
        }
    }
    tsuya_lamps_free(&lamps);
    tsuya_light_set_free(&set);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_samples_match_hits), cmocka_unit_test(test_weights_never_lose_a_lamp), cmocka_unit_test(test_file),
        cmocka_unit_test(test_hostile_files),      cmocka_unit_test(test_studio),    cmocka_unit_test(test_wave_like_one),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
