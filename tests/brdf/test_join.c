/* Spectra: lamps divided out, colours, and a camera joined with a radiometer against a cloth that is known wavelength by wavelength. */
#include "brdf/fit.h"
#include "brdf/samples_color.h"
#include "brdf/samples_join.h"
#include "brdf/truth.h"
#include "core/memory.h"
#include "core/spectrum.h"
#include "support.h"

enum { BANDS = 18, STEP_NM = 20 };

static const double azimuths[] = {0, 45, 90, 135}, few_azimuths[] = {0, 90}, between[] = {22.5, 112.5};

/* A red cloth over grey fibres' sheen, three wavelengths of the truth at a time. */
static void spectral_truth(tsuya_samples *s, const truth_bench *bench)
{
    const char *names[BANDS];
    char text[BANDS][16];
    tsuya_samples frame;
    tsuya_microcylinder cloth = {.warp = {1.5, {0}, 0.2, 4.0, 12.0, 0.7, 4, {-25, -25, 25, 25}, {1, 1, 1}}, .weft = {1.5, {0}, 0.4, 15.0, 30.0, 0.3, 2, {0, 0}, {1}}};
    truth_read(&frame, &cloth, bench);
    for (int b = 0; b < BANDS; ++b) {
        snprintf(text[b], sizeof text[b], "nm%d", 390 + STEP_NM * b);
        names[b] = text[b];
    }
    assert_ok(tsuya_samples_copy_frame(s, &frame, BANDS, names));
    for (int b = 0; b < BANDS; b += 3) {
        double value[3];
        for (int c = 0; c < 3; ++c) {
            double nm = 390 + STEP_NM * (b + c), a = 0.02 + 0.25 / (1.0 + exp(-(nm - 590.0) / 15.0)) + 0.06 * exp(-0.5 * pow((nm - 450.0) / 25.0, 2.0));
            cloth.warp.albedo[c] = a;
            cloth.weft.albedo[c] = 1.2 * a;
        }
        for (int k = 0; k < s->count; ++k) {
            tsuya_microcylinder_eval_reciprocal(&cloth, s->wi[k], s->wo[k], value);
            for (int c = 0; c < 3 && b + c < BANDS; ++c) {
                s->value[k * BANDS + b + c] = value[c] * (1.0 + bench->noise * tsuya_random_normal(bench->seed, 9, (uint64_t)(k * BANDS + b + c)));
            }
        }
    }
    tsuya_samples_free(&frame);
}

static double error_of(const tsuya_material *m, const tsuya_samples *s)
{
    double *g = tsuya_calloc((size_t)s->count * (size_t)s->channel_count, sizeof *g);
    assert_non_null(g);
    tsuya_material_predict(g, m, s);
    double e = tsuya_samples_error(s, g, -1).cbrt;
    tsuya_free(g);
    return e;
}

static double fitted_error(const tsuya_samples *s, const tsuya_samples *held)
{
    tsuya_context context = tsuya_context_default();
    const tsuya_fit_options options = {"cloth", "yarn", NAN};
    tsuya_fit_info fit;
    tsuya_material *m;
    assert_ok(tsuya_brdf_fit(&m, &fit, NULL, NULL, s, &options, &context));
    double e = error_of(m, held);
    tsuya_material_free(m);
    return e;
}

static void test_camera_and_radiometer(void **state)
{
    (void)state;
    static const double device[3] = {1.5, 1.8, 2.1}; /* the camera reads that many times too much */
    const truth_bench dense = {30, 30, azimuths, 4, -48, 48, 6, 0.002, 3}, sparse = {30, 30, few_azimuths, 2, -42, 42, 21, 0.005, 4},
                      held = {30, 30, between, 2, -45, 45, 10, 0, 1};
    tsuya_samples spectra, camera, radiometer, truth, joined;
    tsuya_context context = tsuya_context_default();
    tsuya_join_info info;
    spectral_truth(&spectra, &dense);
    spectral_truth(&radiometer, &sparse);
    spectral_truth(&truth, &held);
    assert_ok(tsuya_samples_to_color(&camera, &spectra, TSUYA_COLOR_RGB));
    for (int k = 0; k < 3 * camera.count; ++k) {
        camera.value[k] *= device[k % 3] * (1.0 + 0.01 * tsuya_random_normal(5, 1, (uint64_t)k));
    }
    camera.relative = true;
    radiometer.scale_sigma = 0.02;
    assert_ok(tsuya_samples_join(&joined, &info, &camera, &radiometer, true, &context));
    double with = fitted_error(&joined, &truth), without = fitted_error(&radiometer, &truth);
    print_message("%d camera + %d radiometer rows, %d linked, rank %d: gains %.4f %.4f %.4f ± %.4f %.4f %.4f (1/%.1f 1/%.1f 1/%.1f); left-out pairs %.4f; every band at "
                  "azimuths nobody measured: joined %.4f, radiometer alone %.4f\n", info.camera, info.radiometer, info.linked, info.rank, info.gain[0], info.gain[1],
                  info.gain[2], info.gain_sigma[0], info.gain_sigma[1], info.gain_sigma[2], device[0], device[1], device[2], info.residual, with, without);
    for (int c = 0; c < 3; ++c) {
        assert_near(info.gain[c] * device[c], 1.0, 3.0 * info.gain_sigma[c] * device[c] + 0.01);
        assert_true(info.gain_sigma[c] * device[c] < 0.03);
    }
    assert_int_equal(joined.channel_count, BANDS);
    assert_false(joined.relative);
    assert_near(info.scale_sigma, 0.02, 1e-12);
    assert_true(with < 0.7 * without && with < 0.05);
    tsuya_samples_free(&joined);

    camera.relative = false; /* both claim a scale: the better one counts more */
    camera.scale_sigma = 0.2;
    assert_ok(tsuya_samples_join(&joined, &info, &camera, &radiometer, false, &context));
    double level = log(info.camera_scale / info.radiometer_scale);
    assert_near(log(info.radiometer_scale), -level * 0.0004 / (0.0004 + 0.04), 1e-4);
    assert_true(info.scale_sigma < 0.02 && joined.channel_count == 3);
    tsuya_samples_free(&joined);
    assert_fails(tsuya_samples_join(&joined, &info, &radiometer, &camera, false, &context), "expected r, g, b");
    assert_fails(tsuya_samples_join(&joined, &info, &camera, &camera, false, &context), "wavelengths");
    for (int k = 0; k < radiometer.count; ++k) { /* where the camera never looked */
        radiometer.wi[k] = radiometer.wo[k] = tsuya_goniometer_direction(75, 20, 3.0 * k, 0);
    }
    assert_fails(tsuya_samples_join(&joined, &info, &camera, &radiometer, false, &context), "at least 4");
    tsuya_samples_free(&spectra);
    tsuya_samples_free(&camera);
    tsuya_samples_free(&radiometer);
    tsuya_samples_free(&truth);
}

/* A white tile under a halogen lamp reads as yellow light, and is white when the lamp is divided out. */
static void test_lamp_is_divided_out(void **state)
{
    (void)state;
    char text[8192], table[4096] = "nm,power\n";
    tsuya_samples s, rgb;
    for (int kind = 0; kind < 3; ++kind) {
        int n = snprintf(text, sizeof text, "# quantity=radiance irradiance=2 illuminant=%s\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg", kind == 0 ? "A" : kind == 1 ? "3000K" : "lamp.csv");
        for (int b = 0; b < BANDS; ++b) {
            n += snprintf(text + n, sizeof text - (size_t)n, ",nm%d", 390 + STEP_NM * b);
        }
        n += snprintf(text + n, sizeof text - (size_t)n, "\n60,0,10,0");
        int at = (int)strlen(table);
        for (int b = 0; b < BANDS; ++b) {
            double nm = 390 + STEP_NM * b, power = kind == 2 ? 0.4 + 0.001 * b : tsuya_blackbody_power(nm, kind ? 3000.0 : TSUYA_ILLUMINANT_A_K);
            n += snprintf(text + n, sizeof text - (size_t)n, ",%.9g", 2.0 * power * 0.5 * 0.8 / M_PI);
            at += kind == 2 ? snprintf(table + at, sizeof table - (size_t)at, "%g,%.9g\n", nm, power) : 0;
        }
        snprintf(text + n, sizeof text - (size_t)n, "\n");
        assert_ok(tsuya_file_write(test_path("lamp.csv"), table, strlen(table)));
        assert_ok(tsuya_file_write(test_path("tile.csv"), text, strlen(text)));
        assert_ok(tsuya_samples_load(&s, test_path("tile.csv")));
        assert_ok(tsuya_samples_to_color(&rgb, &s, TSUYA_COLOR_RGB));
        for (int c = 0; c < 3; ++c) {
            assert_near(rgb.value[c], 0.8 / M_PI, 1e-7);
        }
        assert_false(s.relative);
        tsuya_samples_free(&rgb);
        tsuya_samples_free(&s);
    }
}

static void test_bad_lamps_and_spectra(void **state)
{
    (void)state;
    static const struct { const char *text, *says; } bad[] = {
        {"# quantity=radiance illuminant=F11\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,nm500\n0,0,10,0,1\n", "expected A, D50, D65"},
        {"# quantity=brdf illuminant=A\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,nm500\n0,0,10,0,1\n", "divided out"},
        {"# quantity=radiance illuminant=A\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b\n0,0,10,0,1,1,1\n", "irradiance=R,G,B"},
        {"# quantity=radiance irradiance=1,2\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b\n0,0,10,0,1,1,1\n", "for each of 3 channels"},
        {"# quantity=radiance irradiance=1,2,x\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b\n0,0,10,0,1,1,1\n", "irradiance"},
        {"# quantity=radiance irradiance=1,2,3,4\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b\n0,0,10,0,1,1,1\n", "irradiance"},
        {"# quantity=brdf scale_uncertainty=7\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b\n0,0,10,0,1,1,1\n", "scale_uncertainty"},
        {"# quantity=radiance illuminant=nowhere.csv\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,nm500\n0,0,10,0,1\n", "nowhere.csv"},
    };
    tsuya_samples s, color;
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; ++k) {
        assert_fails(tsuya_samples_parse(&s, bad[k].text, "bad.csv"), bad[k].says);
    }
    assert_ok(tsuya_samples_parse(&s, "# quantity=radiance irradiance=1,2,4\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,b,g,r\n0,0,10,0,4,2,1\n", "t.csv"));
    assert_true(s.value[0] == 1.0 && s.value[1] == 1.0 && s.value[2] == 1.0); /* by channel r, g, b */
    assert_fails(tsuya_samples_to_color(&color, &s, TSUYA_COLOR_RGB), "wavelengths");
    tsuya_samples_free(&s);
    assert_ok(tsuya_samples_parse(&s, "# quantity=brdf\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,nm500,nm600\n0,0,10,0,1,1\n", "t.csv"));
    assert_fails(tsuya_samples_to_color(&color, &s, TSUYA_COLOR_RGB), "430 to 670");
    tsuya_samples_free(&s);
    assert_ok(tsuya_samples_parse(&s, "# quantity=brdf\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,nm400,nm700,nm550\n0,0,10,0,1,1,1\n", "t.csv"));
    assert_fails(tsuya_samples_to_color(&color, &s, TSUYA_COLOR_RGB), "steps of at most 40 nm");
    tsuya_samples_free(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_lamp_is_divided_out),
        cmocka_unit_test(test_bad_lamps_and_spectra),
        cmocka_unit_test(test_camera_and_radiometer),
    };
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return failed;
}
