/* Spectra of samples: lamps divided out, colours, and what cannot be one. */
#include "brdf/samples_color.h"
#include "core/spectrum.h"
#include "support.h"

enum { BANDS = 18, STEP_NM = 20 };

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
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_lamp_is_divided_out), cmocka_unit_test(test_bad_lamps_and_spectra)};
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return failed;
}
