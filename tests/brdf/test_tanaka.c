/* The paper's own surface: its angles, what it reproduces, and how far it is from physics. */
#include "brdf/fit.h"
#include "brdf/tanaka.h"
#include "brdf/truth.h"
#include "core/context.h"
#include "core/memory.h"
#include "support.h"

/* The bench of the paper: γu = 0 and γv = 2τ at every tilt; when the light passes the normal, u turns by 180° and v changes sign. */
static void test_bench_runs_along_spokes(void **state)
{
    (void)state;
    for (int azimuth = 0; azimuth < 360; azimuth += 15) {
        for (int tilt = -57; tilt <= 57; tilt += 3) {
            tsuya_half_angles place;
            tsuya_vec3 wi = tsuya_goniometer_direction(30, 0, azimuth, tilt), wo = tsuya_goniometer_direction(30, 180, azimuth, tilt);
            if (tilt == 30) {
                assert_false(tsuya_tanaka_place(&place, (tsuya_vec3){0, 0, 1}, wo));
                continue;
            }
            assert_true(tsuya_tanaka_place(&place, wi, wo));
            assert_near(place.theta_h, abs(tilt) * M_PI / 180.0, 1e-9);
            double spoke = (azimuth + (tilt < 0 ? 180 : 0)) * M_PI / 180.0;
            assert_near(tilt == 0 ? 0.0 : remainder(place.phi_h - spoke, 2.0 * M_PI), 0.0, 1e-9);
        }
    }
}

/* γu grows with the viewer's azimuth at the mirror direction. */
static void test_out_of_plane(void **state)
{
    (void)state;
    tsuya_half_angles place;
    const double t = 40.0 * M_PI / 180.0, d = 10.0 * M_PI / 180.0;
    tsuya_vec3 wi = {sin(t), 0, cos(t)}, wo = {-sin(t) * cos(d), -sin(t) * sin(d), cos(t)};
    assert_true(tsuya_tanaka_place(&place, wi, wo));
    double u = asin(sin(t) * sin(d)), v = atan2(sin(t) * cos(d), cos(t)) - t; /* a little above the mirror: v < 0 */
    assert_near(place.theta_h, -0.5 * v, 1e-12);
    assert_near(remainder(place.phi_h - u - M_PI, 2.0 * M_PI), 0.0, 1e-12);
}

static double error_on(const tsuya_material *m, const tsuya_samples *s)
{
    double *g = tsuya_calloc((size_t)s->count * 3, sizeof *g);
    assert_non_null(g);
    tsuya_material_predict(g, m, s);
    double e = tsuya_samples_error(s, g, -1).cbrt;
    tsuya_free(g);
    return e;
}

/* A satin of the tests' own.  The curves come back; between them the surface knows nothing; and it is not physical. */
static void test_satin(void **state)
{
    (void)state;
    const tsuya_microcylinder satin = {
        .warp = {1.5, {0.05, 0.02, 0.01}, 0.1, 4.0, 8.0, 0.8, 4, {-25, -10, 10, 25}, {1, 2, 1}},
        .weft = {1.5, {0.2, 0.1, 0.05}, 0.5, 20.0, 40.0, 0.2, 2, {0, 0}, {1}},
    };
    truth_set set;
    tsuya_material *m;
    tsuya_fit_info info;
    tsuya_context context = tsuya_context_default();
    const tsuya_fit_options options = {"satin", "tanaka", NAN};
    truth_set_read(&set, &satin, 0.01, 1);
    assert_ok(tsuya_brdf_fit(&m, &info, NULL, NULL, &set.fit, &options, &context));
    double tilts = error_on(m, &set.tilts), azimuths = error_on(m, &set.azimuths), geometry = error_on(m, &set.geometry);
    print_message("tanaka on a satin: fit %.4f, tilts %.4f, azimuths %.4f, geometry %.4f; reciprocity %.3f, furnace %.3f\n", info.fit.cbrt,
                  tilts, azimuths, geometry, info.reciprocity_deficit, info.furnace);
    assert_true(info.fit.cbrt < 0.035 && tilts < 0.015); /* the fit sees the four readings with the light at the normal, where S is a mean */
    assert_true(azimuths < 0.25 && geometry < 0.25);
    assert_true(info.reciprocity_deficit > 0.01); /* a measure that sees what is there */
    assert_true(info.bytes <= 65536);
    tsuya_material_free(m);
    truth_set_free(&set);
}

/* The light through the normal: the mean over u there, a jump beside it that is reported. */
static void test_light_at_the_normal(void **state)
{
    (void)state;
    tsuya_tanaka *t;
    double at[1], sum = 0.0, low = INFINITY, high = 0.0, one;
    assert_ok(tsuya_tanaka_create(&t, 1, 8, 10));
    for (int u = 0; u < 8; ++u) {
        for (int v = 0; v < 13; ++v) {
            t->net[(size_t)(u * 13 + v) * 4] = (float)(1 + u);
        }
    }
    assert_ok(tsuya_tanaka_prepare(t));
    const tsuya_vec3 wo = {sin(0.5), 0, cos(0.5)};
    tsuya_brdf_tanaka.eval(t, 1, (tsuya_vec3){0, 0, 1}, wo, at);
    for (int k = 0; k < 64; ++k) {
        double phi = 2.0 * M_PI * k / 64;
        tsuya_brdf_tanaka.eval(t, 1, (tsuya_vec3){1e-9 * cos(phi), 1e-9 * sin(phi), 1}, wo, &one);
        low = fmin(low, one);
        high = fmax(high, one);
        sum += one / 64;
    }
    print_message("tanaka, light at the normal: %.3f; beside it %.3f to %.3f\n", at[0], low, high);
    assert_near(at[0], 4.5, 1e-6);
    assert_true(low > 0.0 && high < 9.0 && fabs(sum - 4.5) < 1.5);
    tsuya_tanaka_free(t);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_bench_runs_along_spokes),
        cmocka_unit_test(test_out_of_plane),
        cmocka_unit_test(test_satin),
        cmocka_unit_test(test_light_at_the_normal),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
