/* Drafts against weaves drawn by hand, sections against their geometry, and the paper's expectation of satin. */
#include "brdf/predict.h"
#include "brdf/samples.h"
#include "support.h"

static void assert_weave(const char *name, int ends, int picks, const char *rows)
{
    tsuya_draft d;
    assert_ok(tsuya_draft_create(&d, name));
    assert_int_equal(d.ends, ends);
    assert_int_equal(d.picks, picks);
    for (int k = 0; k < ends * picks; ++k) {
        assert_int_equal(d.warp_up[k], rows[k] == 'x');
    }
    tsuya_draft_free(&d);
}

static void test_weaves_by_name(void **state)
{
    (void)state;
    tsuya_draft d;
    assert_weave("plain", 2, 2, "x..x");
    assert_weave("twill-2/1", 3, 3, "x.xxx..xx");
    assert_weave("satin-5", 5, 5, ".xxxx" "xx.xx" "xxxx." "x.xxx" "xxx.x");
    assert_weave("sateen-5/3", 5, 5, "x...." "...x." ".x..." "....x" "..x..");
    static const char *const bad[] = {"", "satn-5", "satin-4", "satin-6", "satin-8/2", "satin-5/4", "twill-0/1", "twill-1/", "plain ", "satin-5/2x", "twill--1/2"};
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; ++k) {
        assert_fails(tsuya_draft_create(&d, bad[k]), "weave '");
    }
}

static const char head[] = "[WIF]\nVersion=1.1\n[WEAVING]\nShafts=4\nTreadles=4\nRising Shed=yes\n[WARP]\nThreads=4\n[WEFT]\nThreads=4\n"
                           "[THREADING]\n1=1\n2=2\n3=3\n4=4 ; straight\n";

static void test_wif(void **state)
{
    (void)state;
    char text[2048];
    tsuya_draft a, b, c;
    snprintf(text, sizeof text, "%s[TIEUP]\n1=1,2\n2=2,3\n3=3,4\n4=1,4\n[TREADLING]\r\n1=1\r\n2=2\r\n3=3\r\n4=4\r\n", head);
    assert_ok(tsuya_draft_parse(&a, text, "twill.wif"));
    static const char rows[] = "xx..", shift[] = ".xx.";
    for (int k = 0; k < 4; ++k) {
        assert_int_equal(a.warp_up[k], rows[k] == 'x');
        assert_int_equal(a.warp_up[4 + k], shift[k] == 'x');
    }
    snprintf(text, sizeof text, "%s[LIFTPLAN]\n1=1,2\n2=2,3\n3=3,4\n4=1,4\n", head);
    assert_ok(tsuya_draft_parse(&b, text, "lift.wif"));
    assert_memory_equal(a.warp_up, b.warp_up, 16);
    snprintf(text, sizeof text, "%s[LIFTPLAN]\n1=3,4\n2=1,4\n3=1,2\n4=2,3\n[WEAVING]\nRising Shed=no\n", head);
    assert_ok(tsuya_draft_parse(&c, text, "sinking.wif"));
    assert_memory_equal(a.warp_up, c.warp_up, 16);
    tsuya_draft_free(&a);
    tsuya_draft_free(&b);
    tsuya_draft_free(&c);
}

static void test_bad_wif(void **state)
{
    (void)state;
    tsuya_draft d;
    assert_fails(tsuya_draft_parse(&d, "[WARP]\nThreads=100000\n", "x.wif"), "x.wif: line 2: '100000': expected a whole number from 1 to 2048");
    assert_fails(tsuya_draft_parse(&d, "[THREADING]\n1=257\n", "x.wif"), "from 0 to 256");
    assert_fails(tsuya_draft_parse(&d, "[TREADLING]\n99999999999=1\n", "x.wif"), "line 2");
    assert_fails(tsuya_draft_parse(&d, "[TIEUP]\n1=-1\n", "x.wif"), "'-1'");
    assert_fails(tsuya_draft_parse(&d, "", "x.wif"), "Threads=");
    assert_fails(tsuya_draft_parse(&d, head, "x.wif"), "ever crosses");
}

static double across_at(const char *section, double turn_deg, int bin)
{
    double density[TSUYA_PREDICT_BINS];
    tsuya_predict_yarn y = tsuya_predict_options_default().warp;
    y.section = section;
    y.turn_deg = turn_deg;
    assert_ok(tsuya_predict_across(density, &y));
    return density[bin];
}

/* An ellipse of half the height: arc length by angle of the normal is ρ = a² b² / (a² sin² + b² cos²)^(3/2). */
static void test_sections(void **state)
{
    (void)state;
    assert_near(across_at("circle", 0.5, 180), 1.0 / M_PI, 0.01 / M_PI);
    assert_near(across_at("circle", 0.5, 280), 1.0 / M_PI, 0.01 / M_PI);
    double s2 = pow(sin(M_PI / 4), 2), ratio = pow(0.25, 1.5) / pow(s2 + 0.25 * s2, 1.5);
    assert_near(across_at("ellipse", 0.5, 270) / across_at("ellipse", 0.5, 180), ratio, 0.02 * ratio);
    assert_true(across_at("triangle", 8, 300) > 5.0 * across_at("triangle", 8, 180)); /* ±60° against the normal */
    assert_near(across_at("triangle", 8, 300), across_at("triangle", 8, 60), 1e-12);
    assert_true(across_at("ribbon", 8, 180) > 20.0 * across_at("ribbon", 8, 230));
    tsuya_predict_yarn y = {.section = "triangel", .turn_deg = 5};
    double density[TSUYA_PREDICT_BINS];
    assert_fails(tsuya_predict_across(density, &y), "nearest known one is triangle");
}

static void test_shares_of_the_face(void **state)
{
    (void)state;
    static const struct { const char *weave; double warp; } cases[] = {{"plain", 0.5}, {"satin-8", 7.0 / 8.0}, {"sateen-5", 0.2}, {"twill-3/1", 0.75}};
    tsuya_predict_yarn y = tsuya_predict_options_default().warp;
    for (size_t k = 0; k < 4; ++k) {
        tsuya_draft d;
        double density[TSUYA_PREDICT_BINS], warp, weft;
        assert_ok(tsuya_draft_create(&d, cases[k].weave));
        tsuya_predict_along(density, &warp, &d, true, &y);
        tsuya_predict_along(density, &weft, &d, false, &y);
        assert_near(warp, cases[k].warp, 1e-12);
        assert_near(warp + weft, 1.0, 1e-12);
        tsuya_draft_free(&d);
    }
}

/* D of the satin along the stage's tilt at an azimuth: f over the falloff 1/(2(cosθi + cosθo)) at ±30°. */
static double facets(const tsuya_material *m, double azimuth_deg, double tilt_deg)
{
    double value[3];
    tsuya_vec3 wi = tsuya_goniometer_direction(30, 0, azimuth_deg, tilt_deg), wo = tsuya_goniometer_direction(30, 180, azimuth_deg, tilt_deg);
    tsuya_material_eval(m, NULL, wi, wo, value);
    return value[1] * 2.0 * (wi.z + wo.z);
}

static void test_satin_of_triangular_fibre(void **state)
{
    (void)state;
    tsuya_draft d;
    tsuya_material *satin, *plain;
    tsuya_predict_options o = tsuya_predict_options_default();
    assert_ok(tsuya_draft_create(&d, "satin-8/3"));
    assert_ok(tsuya_predict(&satin, &d, &o));
    tsuya_draft_free(&d);
    assert_ok(tsuya_draft_create(&d, "plain"));
    assert_ok(tsuya_predict(&plain, &d, &o));
    tsuya_draft_free(&d);
    double top = facets(satin, 90, 0);
    assert_true(facets(satin, 90, 12) < 0.5 * top && facets(satin, 90, -12) < 0.5 * top); /* narrow, at the normal */
    assert_true(facets(satin, 0, 50) > 3.0 * top && facets(satin, 0, -50) > 3.0 * top);   /* two shoulders across */
    assert_true(facets(satin, 0, 20) < facets(satin, 0, 50));
    assert_near(facets(satin, 0, 40), facets(satin, 0, -40), 0.02 * facets(satin, 0, 40));
    assert_near(facets(plain, 0, 25), facets(plain, 90, 25), 1e-6 * facets(plain, 0, 25)); /* plain weave knows no direction */
    double furnace, deficit;
    tsuya_vec3 up = {0, 0, 1};
    double albedo[3];
    tsuya_material_albedo(satin, NULL, up, albedo);
    furnace = albedo[0];
    assert_true(furnace > 0.001 && furnace < 0.1); /* a dielectric's surface, about Fresnel's few per cent */
    deficit = facets(satin, 30, 10) - facets(satin, 210, -10);
    assert_near(deficit, 0.0, 1e-9);
    tsuya_material_free(satin);
    tsuya_material_free(plain);
}

/* Readings that are a multiple of the prediction over a body, one channel without: both are found again. */
static void test_held_against_readings(void **state)
{
    (void)state;
    static const double body[3] = {0.2, 0.05, 0.0};
    enum { COUNT = 120 };
    tsuya_draft d;
    tsuya_material *m;
    tsuya_samples s;
    tsuya_predict_match found;
    tsuya_predict_options o = tsuya_predict_options_default();
    assert_ok(tsuya_draft_create(&d, "satin-5"));
    assert_ok(tsuya_predict(&m, &d, &o));
    assert_ok(tsuya_samples_create(&s, COUNT, 3, NULL));
    for (int k = 0; k < COUNT; ++k) {
        s.wi[k] = tsuya_goniometer_direction(30, 0, 45.0 * (k % 4), k - 50.0);
        s.wo[k] = tsuya_goniometer_direction(30, 180, 45.0 * (k % 4), k - 50.0);
        tsuya_material_eval(m, NULL, s.wi[k], s.wo[k], s.value + 3 * k);
        for (int c = 0; c < 3; ++c) {
            s.value[3 * k + c] = 2.5 * s.value[3 * k + c] + body[c] / M_PI;
        }
    }
    s.value[7] = NAN; /* clipped */
    s.count = 100;    /* all above the surface */
    assert_ok(tsuya_predict_hold_against(&found, m, &s));
    assert_near(found.scale, 2.5, 1e-5);
    for (int c = 0; c < 3; ++c) {
        assert_near(found.body[c], body[c], 1e-5);
    }
    assert_true(found.error_cbrt < 1e-5 && found.error_without_body > 0.05 && found.error_body_alone > 0.05);
    for (int k = 0; k < 3 * COUNT; ++k) { /* a dull cloth: nothing is left for the prediction */
        s.value[k] = body[k % 3 == 0] / M_PI * (1.0 + 0.1 * sin(2.0 * k));
    }
    assert_ok(tsuya_predict_hold_against(&found, m, &s));
    assert_true(found.error_cbrt <= found.error_body_alone && found.scale < 0.05 && found.scale_without_body > 0.1);
    s.channel_count = 1;
    assert_fails(tsuya_predict_hold_against(&found, m, &s), "1 channels");
    s.channel_count = 3;
    s.count = COUNT;
    tsuya_samples_free(&s);
    tsuya_material_free(m);
    tsuya_draft_free(&d);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_weaves_by_name), cmocka_unit_test(test_wif), cmocka_unit_test(test_bad_wif), cmocka_unit_test(test_sections),
        cmocka_unit_test(test_shares_of_the_face), cmocka_unit_test(test_satin_of_triangular_fibre),
        cmocka_unit_test(test_held_against_readings),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
