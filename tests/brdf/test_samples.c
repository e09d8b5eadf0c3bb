/* Sample tables: the goniometer's geometry, every quantity, clipping, and bad tables that are told apart. */
#include "brdf/samples.h"
#include "support.h"

#include <math.h>

static void near3(tsuya_vec3 a, double x, double y, double z)
{
    assert_true(fabs(a.x - x) < 1e-12 && fabs(a.y - y) < 1e-12 && fabs(a.z - z) < 1e-12);
}

static void test_goniometer_geometry(void **state)
{
    (void)state;
    const double d = M_PI / 180.0;
    near3(tsuya_goniometer_direction(30, 0, 90, 10), 0, sin(20 * d), cos(20 * d));
    near3(tsuya_goniometer_direction(30, 180, 90, 10), 0, -sin(40 * d), cos(40 * d));
    for (int a = 0; a < 360; a += 45) { /* tilt 0 is the mirror position; the half vector lies at |τ|, azimuth a for τ < 0 */
        for (int tilt = -40; tilt <= 40; tilt += 8) {
            tsuya_vec3 h = tsuya_vec3_unit(tsuya_vec3_add(tsuya_goniometer_direction(30, 0, a, tilt), tsuya_goniometer_direction(30, 180, a, tilt)));
            near3(h, -sin(tilt * d) * cos(a * d), -sin(tilt * d) * sin(a * d), cos(tilt * d));
        }
    }
}

static const char *const bench = "# light_theta_deg=30 light_phi_deg=0 view_theta_deg=30 view_phi_deg=180 quantity=%s\n"
                                 "azimuth_deg,tilt_deg,r,g,b\n0,0,0.1,0.2,0.3\n90,10,0.2,0.2,0.2\n";

static void check_quantity(const char *quantity, double factor_0, double factor_1)
{
    char text[400];
    tsuya_samples s;
    snprintf(text, sizeof text, bench, quantity);
    assert_ok(tsuya_samples_parse(&s, text, "t.csv"));
    assert_int_equal(s.count, 2);
    assert_true(fabs(s.value[1] - 0.2 * factor_0) < 1e-12 && fabs(s.value[3] - 0.2 * factor_1) < 1e-12);
    assert_true(s.azimuth_deg[1] == 90.0 && s.tilt_deg[1] == 10.0);
    tsuya_samples_free(&s);
}

static void test_quantities(void **state)
{
    (void)state;
    double c0 = cos(M_PI / 6), c1 = cos(M_PI / 9);
    check_quantity("brdf", 1, 1);
    check_quantity("brdf_cos", 1 / c0, 1 / c1);
    check_quantity("radiance_factor", 1 / M_PI, 1 / M_PI);
    check_quantity("radiance irradiance=4", 0.25 / c0, 0.25 / c1);
    check_quantity("radiance", 1 / c0, 1 / c1);
    tsuya_samples s;
    char text[400];
    snprintf(text, sizeof text, bench, "radiance");
    assert_ok(tsuya_samples_parse(&s, text, "t.csv"));
    assert_true(s.relative);
    tsuya_samples_free(&s);
}

static void test_directions_and_clip(void **state)
{
    (void)state;
    tsuya_samples s;
    assert_ok(tsuya_samples_parse(&s, "# quantity=brdf clip=0.9\nphi_o_deg,theta_o_deg,phi_i_deg,theta_i_deg,nm400,nm500,nm600,nm700\n"
                                      "180,30,0,30,0.1,0.9,0.2,0.95\n0,95,0,30,1,1,1,1\n45,-20,0,0,0,0,0,0\n", "t.csv"));
    assert_int_equal(s.count, 2);
    assert_int_equal(s.dropped_below, 1);
    assert_int_equal(s.clipped, 2);
    assert_int_equal(s.channel_count, 4);
    assert_true(isnan(s.value[1]) && isnan(s.value[3]) && s.value[2] == 0.2);
    near3(s.wi[0], 0.5, 0, cos(M_PI / 6));
    near3(s.wo[0], -0.5, 0, cos(M_PI / 6));
    tsuya_samples_free(&s);
}

static void test_bad_tables(void **state)
{
    (void)state;
    static const struct { const char *text, *says; } bad[] = {
        {"theta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b\n0,0,0,0,1,1,1\n", "quantity"},
        {"# quantity=lux\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b\n0,0,0,0,1,1,1\n", "radiance_factor"},
        {"# quantity=brdf\ntheta_i_deg,phi_i_deg,theta_o_deg,r,g,b\n0,0,0,1,1,1\n", "phi_o_deg is missing"},
        {"# quantity=brdf\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g\n0,0,0,0,1,1\n", "r, g, b"},
        {"# quantity=brdf\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg\n0,0,0,0\n", "channels"},
        {"# quantity=brdf\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b\n0,0,0,0,1,-1,1\n", "line 3, column g"},
        {"# quantity=brdf\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b\n0,0,999,0,1,1,1\n", "line 3, column theta_o_deg"},
        {"# quantity=brdf\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b\n0,0,0,0,1,nan,1\n", "line 3"},
        {"# quantity=brdf\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b\n100,0,0,0,1,1,1\n", "above the surface"},
        {"# quantity=brdf\nazimuth_deg,tilt_deg,r,g,b\n0,0,1,1,1\n", "light_theta_deg"},
        {"# quantity=brdf lihgt_theta_deg=30\nazimuth_deg,tilt_deg,r,g,b\n0,0,1,1,1\n", "light_theta_deg"},
        {"# quantity=brdf clip=x\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b\n0,0,0,0,1,1,1\n", "clip"},
        {"# quantity=brdf\ntheta_i_dge,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b\n0,0,0,0,1,1,1\n", "theta_i_deg"},
        {"# quantity=brdf\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b\n0.11,0.5,0.3,1.2,1,1,1\n0.51,0.5,0.31,1.2,1,1,1\n0.21,0.5,0.33,1.2,1,1,1\n"
         "0.31,0.52,0.3,1.2,1,1,1\n0.41,0.5,0.3,3.1,1,1,1\n0.61,0.5,0.9,1.2,1,1,1\n0.71,0.5,0.73,1.2,1,1,1\n0.91,0.5,1.3,1.2,1,1,1\n", "radians"},
        {"# quantity=brdf\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b\n", "no rows"},
    };
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; ++k) {
        tsuya_samples s;
        assert_fails(tsuya_samples_parse(&s, bad[k].text, "bad.csv"), bad[k].says);
        assert_non_null(strstr(tsuya_reason(), "bad.csv"));
        assert_null(s.value);
    }
}

static void test_repeated_rows(void **state)
{
    (void)state;
    tsuya_samples s;
    assert_ok(tsuya_samples_parse(&s, "# quantity=brdf\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,r,g,b\n10,0,20,0,1,1,1\n30,0,20,0,1,1,1\n"
                                      "10,0,20,0,1.02,1,1\n30,0,20,0,1,2,1\n", "t.csv"));
    assert_int_equal(s.count, 4);
    assert_int_equal(s.disagreeing, 1);
    tsuya_samples_free(&s);
}

static void test_klems(void **state)
{
    (void)state;
    const char *path = test_data("brdf/woven_shade_klems.xml");
    if (!path) {
        skip();
    }
    tsuya_samples s;
    assert_ok(tsuya_samples_load(&s, path));
    assert_int_equal(s.count, 145 * 145);
    double albedo = 0.0, solid = 0.0; /* at the normal: Σ f cosθo over the patches, cosines weighted by the rings' own limits */
    static const double edge[] = {0, 5, 15, 25, 35, 45, 55, 65, 75, 90};
    static const int patches[] = {1, 8, 16, 20, 24, 24, 24, 16, 12};
    for (int ring = 0, k = 0; ring < 9; ++ring) {
        double a = sin(edge[ring] * M_PI / 180), b = sin(edge[ring + 1] * M_PI / 180), weight = M_PI * (b * b - a * a) / patches[ring];
        for (int i = 0; i < patches[ring]; ++i, ++k) {
            albedo += weight * s.value[k * 145];
            solid += weight;
        }
    }
    assert_true(fabs(solid - M_PI) < 1e-9);
    assert_true(fabs(albedo - 0.40) < 0.02);
    tsuya_samples_free(&s);
    assert_fails(tsuya_samples_load(&s, test_path("none.xml")), "none.xml");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_goniometer_geometry), cmocka_unit_test(test_quantities),   cmocka_unit_test(test_directions_and_clip),
        cmocka_unit_test(test_bad_tables),          cmocka_unit_test(test_repeated_rows), cmocka_unit_test(test_klems),
    };
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return failed;
}
