/* The observer's analytic fit against the CIE's own table, over measured reflectances. */
#include "core/color.h"
#include "core/order.h"
#include "core/process.h"
#include "core/spectrum.h"
#include "core/table.h"
#include "support.h"

enum { LINES = 401, SAMPLES = 99 };

static double reflectance[SAMPLES][LINES], wavelength[LINES];

static void read_reflectances(const char *path)
{
    char *text;
    tsuya_process_info info;
    const char *const argv[] = {"gzip", "-dc", path, NULL};
    assert_ok(tsuya_process_capture(&text, &info, argv, NULL));
    char *at = text;
    for (int k = 0; k < LINES; ++k) {
        wavelength[k] = strtod(at, &at);
        for (int s = 0; s < SAMPLES; ++s) {
            reflectance[s][k] = *at == ',' ? strtod(at + 1, &at) : 0.0;
        }
        at += strcspn(at, "\n");
        wavelength[k] = wavelength[k] > 0.0 ? wavelength[k] : 380.0 + k;
    }
    tsuya_free(text);
}

/* XYZ under D65 by the table of the CIE, white normalised to D65's. */
static tsuya_vec3 by_table(const tsuya_table *t, const double *r)
{
    tsuya_vec3 sum = {0, 0, 0}, white = {0, 0, 0}, d65 = tsuya_white_d65();
    for (size_t row = 0; row < t->row_count; ++row) {
        int nm = (int)tsuya_table_at(t, row, 0);
        if (nm >= 380 && nm <= 780) {
            tsuya_vec3 seen = {tsuya_table_at(t, row, 1), tsuya_table_at(t, row, 2), tsuya_table_at(t, row, 3)};
            seen = tsuya_vec3_scale(seen, tsuya_daylight_power(nm, 6504.0));
            sum = tsuya_vec3_mad(sum, r[nm - 380], seen);
            white = tsuya_vec3_add(white, seen);
        }
    }
    return (tsuya_vec3){d65.x * sum.x / white.x, d65.y * sum.y / white.y, d65.z * sum.z / white.z};
}

static void test_observer_against_the_table(void **state)
{
    (void)state;
    const char *spectra = test_data("spectral/tcs_cfi2017_1_nm.csv.gz"), *observer = test_data("spectral/cie1931_2deg_xyz_1nm.csv");
    if (!spectra || !observer) {
        skip();
    }
    tsuya_table table;
    const tsuya_table_options options = {0};
    double error[SAMPLES], coarse[SAMPLES];
    assert_ok(tsuya_table_load(&table, observer, &options));
    read_reflectances(spectra);
    for (int s = 0; s < SAMPLES; ++s) {
        double nm[35], few[35];
        for (int k = 0; k < 35; ++k) { /* as a radiometer of 390 … 730 nm gives them */
            nm[k] = 390.0 + 10.0 * k;
            few[k] = reflectance[s][(int)nm[k] - 380];
        }
        tsuya_lab truth = tsuya_lab_from_xyz(by_table(&table, reflectance[s]), tsuya_white_d65());
        error[s] = tsuya_color_difference(truth, tsuya_lab_from_xyz(tsuya_xyz_of_reflectance(wavelength, reflectance[s], LINES), tsuya_white_d65()));
        coarse[s] = tsuya_color_difference(truth, tsuya_lab_from_xyz(tsuya_xyz_of_reflectance(nm, few, 35), tsuya_white_d65()));
    }
    tsuya_table_free(&table);
    tsuya_sort_doubles(error, SAMPLES);
    tsuya_sort_doubles(coarse, SAMPLES);
    print_message("CIEDE2000 over %d reflectances: every 1 nm median %.2f, p90 %.2f, largest %.2f; 390 … 730 nm every 10 median %.2f, largest %.2f\n", SAMPLES,
                  error[49], error[89], error[98], coarse[49], coarse[98]);
    assert_true(error[49] < 0.3 && error[98] < 1.2 && coarse[98] < 1.3);
}

static void test_a_grey_is_grey(void **state)
{
    (void)state;
    const double nm[2] = {390, 730}, grey[2] = {0.37, 0.37};
    tsuya_vec3 rgb = tsuya_rgb_of_reflectance(nm, grey, 2), xyz = tsuya_xyz_of_reflectance(nm, grey, 2), white = tsuya_white_d65();
    assert_near(rgb.x, 0.37, 1e-9);
    assert_near(rgb.y, 0.37, 1e-9);
    assert_near(rgb.z, 0.37, 1e-9);
    assert_near(xyz.z, 0.37 * white.z, 1e-9);
}

static void test_illuminant_a(void **state)
{
    (void)state;
    const char *path = test_data("spectral/cie_illuminant_A.csv");
    if (!path) {
        skip();
    }
    tsuya_table table;
    const tsuya_table_options options = {0};
    assert_ok(tsuya_table_load(&table, path, &options));
    for (size_t row = 0; row < table.row_count; ++row) {
        double nm = tsuya_table_at(&table, row, 0), power = tsuya_table_at(&table, row, 1) / 100.0;
        assert_near(tsuya_blackbody_power(nm, TSUYA_ILLUMINANT_A_K) / power, 1.0, 1e-4);
    }
    tsuya_table_free(&table);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_observer_against_the_table),
        cmocka_unit_test(test_a_grey_is_grey),
        cmocka_unit_test(test_illuminant_a),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
