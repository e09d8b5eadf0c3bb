/* The bench's tables, read back by the reader of measured reflectance, which was written from the frame's definition alone. */
#include "support.h"

#include "brdf/samples.h"
#include "capture/microcylinder.h"
#include "capture/studio_goniometer.h"

#include <math.h>

/* Without symmetry, so that every mistaken sign or exchanged axis shows. */
static void lopsided(const void *user, tsuya_vec3 wi, tsuya_vec3 wo, double rgb[3])
{
    (void)user;
    rgb[0] = 0.30 + 0.11 * wi.x - 0.07 * wo.y + 0.03 * wi.y * wo.x;
    rgb[1] = 0.20 - 0.05 * wi.y + 0.09 * wo.x;
    rgb[2] = 0.10 + 0.04 * wi.x * wo.x + 0.02 * wo.z;
}

static void cloth(const void *user, tsuya_vec3 wi, tsuya_vec3 wo, double rgb[3]) { tsuya_microcylinder_eval_reciprocal(user, wi, wo, rgb); }

/* Largest and root mean square relative difference of a table's values to the reflectance. */
static void compare(const char *path, tsuya_reflectance reflectance, const void *user, double *largest, double *rms, int *count)
{
    tsuya_samples samples;
    double squares = 0.0;
    *largest = 0.0;
    assert_ok(tsuya_samples_load(&samples, path));
    for (int k = 0; k < samples.count; k++) {
        double rgb[3];
        reflectance(user, samples.wi[k], samples.wo[k], rgb);
        for (int c = 0; c < 3; c++) {
            double relative = samples.value[3 * k + c] / rgb[c] - 1.0;
            *largest = fmax(*largest, fabs(relative));
            squares += relative * relative;
        }
    }
    *count = samples.count;
    *rms = sqrt(squares / (3.0 * samples.count));
    assert_int_equal(samples.clipped + samples.dropped_below, 0);
    tsuya_samples_free(&samples);
}

static void a_quiet_bench_reads_the_reflectance(void **state)
{
    (void)state;
    tsuya_goniometer bench = tsuya_goniometer_default();
    tsuya_context context = tsuya_context_default();
    double largest, rms;
    int count;
    bench.gain_noise = bench.floor_noise = 0.0;
    bench.irradiance = 2.5;
    bench.light_phi_deg = 20.0;
    assert_ok(tsuya_goniometer_write(test_path("quiet.csv"), &bench, lopsided, NULL, &context));
    compare(test_path("quiet.csv"), lopsided, NULL, &largest, &rms, &count);
    assert_int_equal(count, 4 * 39);
    if (largest > 2e-3) { /* half of a 16-bit step of the dimmest reading */
        fail_msg("largest difference %.2e", largest);
    }
}

static void noise_is_as_asked_for(void **state)
{
    (void)state;
    tsuya_goniometer bench = tsuya_goniometer_default();
    tsuya_context context = tsuya_context_default();
    double largest, rms;
    int count;
    bench.gain_noise = 0.02;
    bench.floor_noise = 0.0;
    bench.tilt_step_deg = 0.25;
    assert_ok(tsuya_goniometer_write(test_path("noisy.csv"), &bench, lopsided, NULL, &context));
    compare(test_path("noisy.csv"), lopsided, NULL, &largest, &rms, &count);
    assert_true(count > 1800);
    assert_true(fabs(rms - 0.02) < 0.001);
}

static void a_bright_reading_is_marked_as_clipped(void **state)
{
    (void)state;
    tsuya_goniometer bench = tsuya_goniometer_default();
    tsuya_context context = tsuya_context_default();
    tsuya_samples samples;
    bench.full_radiance = 0.2;
    assert_ok(tsuya_goniometer_write(test_path("clipped.csv"), &bench, lopsided, NULL, &context));
    assert_ok(tsuya_samples_load(&samples, test_path("clipped.csv")));
    assert_true(samples.clipped > 0);
    tsuya_samples_free(&samples);
}

static void published_cloth_passes_through_the_bench(void **state)
{
    (void)state;
    const char *fits = test_data("brdf/microcylinder_fits.txt");
    tsuya_microcylinder satin;
    tsuya_context context = tsuya_context_default();
    tsuya_goniometer bench = tsuya_goniometer_default();
    double largest, rms;
    int count;
    if (!fits) {
        skip();
    }
    assert_ok(tsuya_microcylinder_load(&satin, fits, "linen_plain"));
    bench.floor_noise = 0.0;
    assert_ok(tsuya_goniometer_write(test_path("linen.csv"), &bench, cloth, &satin, &context));
    compare(test_path("linen.csv"), cloth, &satin, &largest, &rms, &count);
    assert_true(fabs(rms - 0.01) < 0.002);
}

static void senseless_benches_are_refused(void **state)
{
    (void)state;
    tsuya_goniometer bench = tsuya_goniometer_default();
    tsuya_context context = tsuya_context_default();
    bench.tilt_step_deg = 0.0;
    assert_fails(tsuya_goniometer_write(test_path("none.csv"), &bench, lopsided, NULL, &context), "tilt step 0");
    bench = tsuya_goniometer_default();
    bench.tilt_most_deg = 95.0;
    assert_fails(tsuya_goniometer_write(test_path("none.csv"), &bench, lopsided, NULL, &context), "tilts below 90");
    assert_false(tsuya_path_exists(test_path("none.csv")));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(a_quiet_bench_reads_the_reflectance),   cmocka_unit_test(noise_is_as_asked_for),
        cmocka_unit_test(a_bright_reading_is_marked_as_clipped), cmocka_unit_test(published_cloth_passes_through_the_bench),
        cmocka_unit_test(senseless_benches_are_refused),
    };
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
