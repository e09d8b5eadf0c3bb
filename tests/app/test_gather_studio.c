/* Reflectance out of photographs of the virtual studio: its stage's swatch, and a draped cloth with a pattern. */
#include "support.h"

#include "app/gather_input.h"
#include "brdf/fit.h"
#include "capture/simulate_parts.h"
#include "capture/studio.h"

#include <math.h>

static const char *write_scene(const char *name, const char *text)
{
    const char *path = test_path(name);
    assert_ok(tsuya_file_write(path, text, strlen(text)));
    return path;
}

static void simulate(tsuya_simulate_scene *scene, const char *name, const char *text, const char *folder)
{
    tsuya_simulate_info info;
    tsuya_context context = tsuya_context_default();
    assert_ok(tsuya_simulate_scene_load(scene, write_scene(name, text)));
    assert_ok(tsuya_simulate(&info, scene, folder, &context));
}

static const char *in(const char *folder, const char *name)
{
    static char buffer[8][TEST_PATH];
    static int turn;
    char *path = buffer[turn++ % 8];
    snprintf(path, TEST_PATH, "%s/%s", folder, name);
    return path;
}

static const char SWATCH[] =
    "cloth: {kind: closed, side_m: 0.3, spacing_m: 0.03, reflectance: satin, weft_mm: 0.9, warp_mm: 0.7}\n"
    "camera: {size: [120, 90], focal_px: 200, spp: 4, f_number: 0, format: tif, full_well_e: 60000}\n"
    "views: [{count: 3, elevation_deg: 30, distance_m: 3}]\nhold_out: 0\n"
    "goniometer: {tilt_step_deg: 9, dye: [0.36, 0.3, 0.25], photos: true, spectra: true}\n";

/* e_cbrt of a material on the truth's directions, and on stage positions between the photographed ones. */
static void compare_material(double *everywhere, double *between, const tsuya_material *material, const tsuya_microcylinder *cloth,
                             const float dye[3], const char *table)
{
    tsuya_samples truth;
    double *g;
    assert_ok(tsuya_samples_load(&truth, table));
    g = calloc(3 * (size_t)truth.count, sizeof *g);
    tsuya_material_predict(g, material, &truth);
    *everywhere = tsuya_samples_error(&truth, g, -1).cbrt;
    tsuya_samples_free(&truth);
    free(g);
    assert_ok(tsuya_samples_create(&truth, 8 * 12, 3, NULL));
    g = calloc(3 * (size_t)truth.count, sizeof *g);
    for (int k = 0; k < truth.count; k++) {
        double azimuth = 22.5 * (k / 12), tilt = 4.5 + 7.0 * (k % 12 - 6);
        truth.wi[k] = tsuya_goniometer_direction(30, 0, azimuth, tilt);
        truth.wo[k] = tsuya_goniometer_direction(30, 180, azimuth, tilt);
        tsuya_studio_reflectance(cloth, dye, truth.wi[k], truth.wo[k], truth.value + 3 * k);
    }
    tsuya_material_predict(g, material, &truth);
    *between = tsuya_samples_error(&truth, g, -1).cbrt;
    tsuya_samples_free(&truth);
    free(g);
}

static void swatch_photographs_give_the_cloth(void **state)
{
    (void)state;
    tsuya_simulate_scene scene;
    const char *folder = test_path("swatch-job");
    simulate(&scene, "swatch.yaml", SWATCH, folder);
    const tsuya_microcylinder *cloth = tsuya_simulate_reflectance(&scene);
    tsuya_gather_options options = tsuya_gather_options_default();
    tsuya_context context = tsuya_context_default();
    tsuya_gather_session session;
    tsuya_gathered out;
    const float dye[3] = {0.36f, 0.3f, 0.25f};
    options.pattern = false;
    const tsuya_gather_paths paths = {.photos = in(folder, "swatch"), .poses = in(folder, "truth/swatch"), .surface = in(folder, "truth/swatch.ply"),
                                      .lights = in(folder, "swatch/lights.json"), .reference = in(folder, "swatch/reference.csv"), .lamps_with_camera = true};
    assert_ok(tsuya_gather_photos(&session, &paths, &options, &context));
    assert_ok(tsuya_gather_finish(&out, session.gather));
    double *truth = calloc(3 * (size_t)out.samples.count, sizeof *truth), logs = 0.0, everywhere, between;
    for (int k = 0; k < out.samples.count; k++) {
        tsuya_studio_reflectance(cloth, dye, out.samples.wi[k], out.samples.wo[k], truth + 3 * k);
        logs += log(out.samples.value[3 * k + 1] / truth[3 * k + 1]) / out.samples.count;
    }
    double rows = tsuya_samples_error(&out.samples, truth, -1).cbrt;
    tsuya_fit_info info;
    tsuya_material *material;
    const tsuya_fit_options fit = {.name = "swatch", .model = "yarn", .tolerance = NAN};
    assert_ok(tsuya_brdf_fit(&material, &info, NULL, NULL, &out.samples, &fit, &context));
    compare_material(&everywhere, &between, material, cloth, dye, in(folder, "truth/reflectance.csv"));
    print_message("%d photographs, %d rows: scale off by %+.1f %%, rows e_cbrt %.3f; fitted: %.3f between the positions, %.3f over both hemispheres\n",
                  session.photos, out.samples.count, 100.0 * (exp(logs) - 1.0), rows, between, everywhere);
    assert_true(fabs(logs) < 0.05);
    assert_true(rows <= 0.12);
    assert_true(between <= 0.12);
    assert_true(everywhere <= 0.12);
    tsuya_samples spectra;
    assert_ok(tsuya_samples_load(&spectra, in(folder, "spectra.csv")));
    assert_int_equal(spectra.channel_count, 35);
    tsuya_samples_free(&spectra);
    tsuya_material_free(material);
    tsuya_gathered_free(&out);
    tsuya_gather_session_free(&session);
    tsuya_simulate_scene_free(&scene);
    free(truth);
}

static const char GARMENT[] =
    "cloth: {kind: closed, side_m: 0.3, spacing_m: 0.006, reflectance: satin, weft_mm: 0.9, warp_mm: 0.7}\n"
    "stand: {kind: disc, radius_m: 0.08, height_m: 0.16}\n"
    "camera: {size: [160, 120], focal_px: 190, spp: 4, f_number: 0, format: tif, exposure_ev: -1}\n"
    "views: [{count: 7, elevation_deg: 25, distance_m: 0.5}, {count: 7, elevation_deg: 50, distance_m: 0.5, azimuth_deg: 20}]\nhold_out: 0\n"
    "lamps: [{type: disk, position_m: [0.6, -0.4, 0.8], size_m: [0.05], rgb: [600, 600, 600]}]\n"
    "mat: {cols: 5, rows: 5, tag_mm: 60, gap_mm: 20}\nchart: true\n";

/* Rows against the truth under the even dye that explains them best; that dye. */
static double against_truth(double dye[3], const tsuya_gathered *out, const tsuya_microcylinder *cloth)
{
    const float none[3] = {0, 0, 0}, white[3] = {1, 1, 1};
    size_t n = (size_t)out->samples.count;
    double *truth = calloc(3 * n, sizeof *truth), *volume = calloc(3 * n, sizeof *volume), product[3] = {0}, square[3] = {0};
    for (size_t k = 0; k < n; k++) {
        tsuya_studio_reflectance(cloth, none, out->samples.wi[k], out->samples.wo[k], truth + 3 * k);
        tsuya_studio_reflectance(cloth, white, out->samples.wi[k], out->samples.wo[k], volume + 3 * k);
        for (size_t c = 0; c < 3; c++) {
            volume[3 * k + c] -= truth[3 * k + c];
            product[c] += (out->samples.value[3 * k + c] - truth[3 * k + c]) * volume[3 * k + c];
            square[c] += volume[3 * k + c] * volume[3 * k + c];
        }
    }
    for (size_t i = 0; i < 3 * n; i++) {
        dye[i % 3] = product[i % 3] / square[i % 3];
        truth[i] += dye[i % 3] * volume[i];
    }
    double error = tsuya_samples_error(&out->samples, truth, -1).cbrt;
    free(truth);
    free(volume);
    return error;
}

static void a_draped_pattern_is_told_from_the_surface(void **state)
{
    (void)state;
    tsuya_simulate_scene scene;
    const char *folder = test_path("garment-job");
    simulate(&scene, "garment.yaml", GARMENT, folder);
    const tsuya_microcylinder *cloth = tsuya_simulate_reflectance(&scene);
    tsuya_context context = tsuya_context_default();
    double error[2], dye[3];
    for (int pattern = 0; pattern < 2; pattern++) {
        tsuya_gather_options options = tsuya_gather_options_default();
        tsuya_gather_session session;
        tsuya_gathered out;
        tsuya_gather_wish wish[4];
        int wishes = 0, cells = 0;
        options.pattern = pattern == 1;
        const tsuya_gather_paths paths = {.photos = in(folder, "photos"), .masks = in(folder, "masks"), .poses = in(folder, "truth/sparse"),
                                          .surface = in(folder, "truth/mesh.ply"), .lights = in(folder, "truth/lights.json"), .reference = in(folder, "truth/chart.csv")};
        assert_ok(tsuya_gather_photos(&session, &paths, &options, &context));
        assert_ok(tsuya_gather_finish(&out, session.gather));
        error[pattern] = against_truth(dye, &out, cloth);
        for (int k = 0; k < TSUYA_GATHER_SECTORS * TSUYA_GATHER_TILTS; k++) {
            cells += out.covered[k / TSUYA_GATHER_TILTS][k % TSUYA_GATHER_TILTS] > 0;
        }
        print_message("%s: %d rows in %d cells of half vectors, e_cbrt %.3f, mean dye %.2f %.2f %.2f, pattern %.3f; %zu pixels used, %zu in shadow\n",
                      pattern ? "pattern separated" : "one dye", out.samples.count, cells, error[pattern], dye[0], dye[1], dye[2], out.pattern_spread[0],
                      session.counts.used, session.counts.shadowed);
        if (pattern) {
            assert_ok(tsuya_gather_wishes(wish, &wishes, 4, session.gather, &out, &session.lamps, session.distance_m, &context));
            for (int k = 0; k < wishes; k++) {
                print_message("wish: azimuth %.0f, elevation %.0f: %d cells\n", wish[k].azimuth_deg, wish[k].elevation_deg, wish[k].cells);
                assert_true(wish[k].cells > 0 && (k == 0 || wish[k].cells <= wish[k - 1].cells));
            }
            assert_true(out.pattern_spread[0] > 0.01);
        }
        assert_true(session.counts.shadowed > 1000);
        assert_true(cells > 30);
        tsuya_gathered_free(&out);
        tsuya_gather_session_free(&session);
    }
    assert_true(error[1] <= 0.12);
    assert_true(error[1] < 0.8 * error[0]);
    tsuya_simulate_scene_free(&scene);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(swatch_photographs_give_the_cloth),
        cmocka_unit_test(a_draped_pattern_is_told_from_the_surface),
    };
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
