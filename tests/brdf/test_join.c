/* A camera joined with a radiometer against a cloth that is known wavelength by wavelength. */
#include "brdf/fit.h"
#include "brdf/samples_color.h"
#include "brdf/samples_join.h"
#include "brdf/truth.h"
#include "core/memory.h"
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
    static const double device[3] = {15, 18, 21}; /* the camera reads that many times too much: far beyond what a cloth can reflect */
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

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_camera_and_radiometer)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
