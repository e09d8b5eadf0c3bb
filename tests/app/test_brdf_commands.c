/* The commands `tsuya brdf plot | predict | plan | compare | export` from outside, and the places of readings in their pictures. */
#include "support.h"

#include "app/brdf_plot.h"
#include "core/image.h"
#include "core/memory.h"
#include "core/process.h"

static char *output;

static int run(const char *arguments)
{
    char command[3 * TEST_PATH];
    tsuya_process_info info;
    snprintf(command, sizeof command, "cd %s && %s %s", test_folder(), TSUYA_PROGRAM, arguments);
    const char *argv[] = {"sh", "-c", command, NULL};
    tsuya_free(output);
    output = NULL;
    assert_ok(tsuya_process_capture(&output, &info, argv, NULL));
    return info.exit_code;
}

static void assert_says(const char *part)
{
    if (!strstr(output, part)) {
        fail_msg("\"%s\" is not in the output:\n%s", part, output);
    }
}

/* A failure of one line, and exit 1. */
static void assert_refused(const char *arguments, const char *part)
{
    assert_int_equal(run(arguments), 1);
    assert_says(part);
    assert_ptr_equal(strchr(output, '\n'), output + strlen(output) - 1);
}

static const char grey[] = "{\"format\": \"tsuya material\", \"version\": \"1.0\", \"name\": \"grey `touch ran` 'cloth'\", \"model\": \"lambert\", "
                           "\"channels\": [\"r\", \"g\", \"b\"], \"dye\": {\"reflectance\": [0.1, 0.2, 0.4], \"coupling\": \"lambert\"}, \"parameters\": {}}";

static void write_bench(const char *name, double light_deg, double view_deg, double azimuth_step)
{
    char text[1 << 16];
    int n = snprintf(text, sizeof text, "# quantity=brdf\n# light_theta_deg=%g\n# light_phi_deg=0\n# view_theta_deg=%g\n# view_phi_deg=180\nazimuth_deg,tilt_deg,r,g,b\n",
                     light_deg, view_deg);
    for (double a = 0; a < 180; a += azimuth_step) {
        for (int t = -24; t <= 24; t += 6) {
            double shine = 0.03 + 0.2 * exp(-0.01 * t * t);
            n += snprintf(text + n, sizeof text - (size_t)n, "%g,%d,%.5f,%.5f,%.5f\n", a, t, shine, shine, 0.5 * shine);
        }
    }
    assert_ok(tsuya_file_write(test_path(name), text, (size_t)n));
}

static void assert_picture(const char *name, int width, int height)
{
    tsuya_image image;
    assert_ok(tsuya_image_load(&image, test_path(name)));
    assert_int_equal(image.width_px, width);
    assert_int_equal(image.height_px, height);
    int marked = 0;
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            const uint8_t *p = tsuya_image_u8(&image, x, y);
            marked += abs(p[0] - p[2]) > 60;
        }
    }
    assert_true(marked > 150); /* coloured lines and points */
    tsuya_image_free(&image);
}

static int setup(void **state)
{
    (void)state;
    assert_ok(tsuya_file_write(test_path("grey.json"), grey, sizeof grey - 1));
    write_bench("bench.csv", 30, 30, 45);
    return 0;
}

static int teardown(void **state)
{
    (void)state;
    tsuya_free(output);
    test_folder_remove();
    return 0;
}

static void test_plot_draws_three_figures(void **state)
{
    (void)state;
    assert_int_equal(run("brdf plot grey.json bench.csv -o cloth.png --json plot.json"), 0);
    assert_picture("cloth.png", 900, 600);
    assert_picture("cloth-surface.png", 900, 720);
    assert_picture("cloth-polar.png", 960, 660);
    assert_says("points                               36");
    assert_false(tsuya_path_exists(test_path("ran"))); /* a name is a text, never a command */
    assert_int_equal(run("brdf plot bench.csv --model lambert --figure polar -o figures/ && ls -A figures"), 0);
    assert_says("polar.png");
    assert_null(strstr(output, "curves.png"));
    assert_null(strstr(output, ".tmp"));
}

static void test_plot_refuses(void **state)
{
    (void)state;
    assert_refused("brdf plot grey.json --channel nm550", "channel 'nm550' is not there; the channels go from r to b");
    assert_int_equal(run("brdf plot grey.json --figure pie"), 2);
    assert_int_equal(run("brdf plot grey.json --light 30"), 2);
    assert_refused("brdf plot none.json", "none.json");
}

/* Directions alone are put where the stage had made them, also where lamp and camera do not stand alike. */
static void test_directions_find_their_stage_angles(void **state)
{
    (void)state;
    static const double benches[][2] = {{30, 30}, {60, 10}, {20, 45}};
    for (size_t b = 0; b < sizeof benches / sizeof benches[0]; ++b) {
        tsuya_samples stage;
        tsuya_plot_data with, without;
        tsuya_brdf_picture picture = {.samples = &stage};
        write_bench("other.csv", benches[b][0], benches[b][1], 22.5);
        assert_ok(tsuya_samples_load(&stage, test_path("other.csv")));
        assert_true(tsuya_plot_bench_of(&picture.bench, &stage));
        assert_near(picture.bench.light_deg[0], benches[b][0], 1e-9);
        assert_near(fabs(picture.bench.view_deg[1]), 180.0, 1e-9);
        assert_ok(tsuya_plot_data_create(&with, &picture));
        tsuya_free(stage.azimuth_deg);
        tsuya_free(stage.tilt_deg);
        stage.azimuth_deg = stage.tilt_deg = NULL;
        assert_ok(tsuya_plot_data_create(&without, &picture));
        assert_int_equal(without.left_out, 0);
        assert_int_equal(without.count, with.count);
        for (int k = 0; k < with.count; ++k) {
            bool pole = fabs(with.point[k].tilt_deg) < 1e-9 && b == 0; /* there every azimuth and its opposite are one */
            double turn = remainder(without.point[k].azimuth_deg - with.point[k].azimuth_deg, 180.0);
            double sign = fabs(remainder(without.point[k].azimuth_deg - with.point[k].azimuth_deg, 360.0)) > 90.0 ? -1.0 : 1.0;
            assert_near(turn, 0.0, 1e-4);
            assert_near(pole ? fabs(without.point[k].tilt_deg) : without.point[k].tilt_deg, (pole ? 1.0 : sign) * with.point[k].tilt_deg, 1e-4);
            assert_near(without.point[k].intensity, with.point[k].intensity, 1e-12);
        }
        tsuya_plot_data_free(&with);
        tsuya_plot_data_free(&without);
        tsuya_samples_free(&stage);
    }
}

/* The stage beyond 180° shows the same facet from the other side: the point stands there with the cosine of the lamp that would shine. */
static void test_folded_points_take_the_other_cosine(void **state)
{
    (void)state;
    static const char table[] = "# quantity=brdf\n# light_theta_deg=30\n# light_phi_deg=0\n# view_theta_deg=30\n# view_phi_deg=180\nazimuth_deg,tilt_deg,r,g,b\n"
                                "20,-15,0.2,0.2,0.2\n200,-15,0.2,0.2,0.2\n200,25,0.1,0.1,0.1\n315,40,0.3,0.3,0.3\n";
    tsuya_samples stage;
    tsuya_plot_data data;
    tsuya_brdf_picture picture = {.samples = &stage};
    assert_ok(tsuya_file_write(test_path("fold.csv"), table, sizeof table - 1));
    assert_ok(tsuya_samples_load(&stage, test_path("fold.csv")));
    assert_true(tsuya_plot_bench_of(&picture.bench, &stage));
    assert_ok(tsuya_plot_data_create(&data, &picture));
    assert_int_equal(data.count, 4);
    const double f[4] = {0.2, 0.2, 0.1, 0.3}, azimuth[4] = {20, 20, 20, 135}, tilt[4] = {-15, 15, -25, -40};
    for (int k = 0; k < 4; ++k) {
        tsuya_vec3 lamp = tsuya_goniometer_direction(30, 0, azimuth[k], tilt[k]); /* of the place where the point is drawn */
        assert_near(data.point[k].azimuth_deg, azimuth[k], 1e-9);
        assert_near(data.point[k].tilt_deg, tilt[k], 1e-9);
        assert_near(data.point[k].intensity, f[k] * lamp.z, 1e-9);
    }
    tsuya_plot_data_free(&data);
    tsuya_samples_free(&stage);
}

/* A Lambertian cloth of that reflectance, drawn at a scale over a body. */
static void draw_pair(tsuya_image *drawn, const char *name, double scale, double body, double dull)
{
    static const char table[] = "# quantity=brdf\n# light_theta_deg=30\n# light_phi_deg=0\n# view_theta_deg=30\n# view_phi_deg=180\nazimuth_deg,tilt_deg,r,g,b\n"
                                "0,-40,0.1,0.1,0.1\n0,40,0.1,0.1,0.1\n";
    const double rgb[3] = {dull, dull, dull};
    tsuya_samples stage;
    tsuya_plot_data data;
    tsuya_material *m;
    assert_ok(tsuya_file_write(test_path("level.csv"), table, sizeof table - 1));
    assert_ok(tsuya_samples_load(&stage, test_path("level.csv")));
    assert_ok(tsuya_material_lambert(&m, rgb));
    tsuya_brdf_picture picture = {.material = m, .samples = &stage, .title = "dull", .scale = scale, .body = body};
    assert_true(tsuya_plot_bench_of(&picture.bench, &stage));
    assert_ok(tsuya_plot_data_create(&data, &picture));
    assert_ok(tsuya_plot_pair(test_path(name), &picture, &data));
    assert_ok(tsuya_image_load(drawn, test_path(name)));
    tsuya_plot_data_free(&data);
    tsuya_material_free(m);
    tsuya_samples_free(&stage);
}

/* Where a prediction adds nothing the picture shows the body, and not the prediction as it is. */
static void test_pair_at_scale_zero(void **state)
{
    (void)state;
    tsuya_image body, cloth, other;
    draw_pair(&body, "body.png", 0.0, 0.5, 0.9);
    draw_pair(&cloth, "cloth.png", 1.0, 0.0, 0.5);
    draw_pair(&other, "other.png", 1.0, 0.0, 0.9);
    const size_t titles = 75 * body.row_bytes, size = (size_t)body.height_px * body.row_bytes - titles; /* titles name the numbers */
    assert_int_equal(body.row_bytes, cloth.row_bytes);
    assert_memory_equal((char *)body.data + titles, (char *)cloth.data + titles, size);
    assert_memory_not_equal((char *)other.data + titles, (char *)cloth.data + titles, size);
    tsuya_image_free(&body);
    tsuya_image_free(&cloth);
    tsuya_image_free(&other);
}

static void test_predict_writes_a_material(void **state)
{
    (void)state;
    assert_int_equal(run("brdf predict --fibre ribbon --weave twill-3/1 --metal 1,0.7,0.3 bench.csv -o gold/gold.json"), 0);
    assert_says("warp_share                           0.75");
    assert_picture("gold/predicted.png", 1300, 560);
    assert_int_equal(run("brdf plot gold/gold.json --figure curves -o gold.png"), 0);
    assert_refused("brdf predict --fibre ribon", "the nearest known one is ribbon");
    assert_refused("brdf predict --weave satin-6", "satin-6");
    assert_refused("brdf predict --weave none.wif", "none.wif");
}

static void test_plan_writes_stage_angles(void **state)
{
    (void)state;
    assert_int_equal(run("brdf plan --weave satin-8 --azimuth-step 15 --tilt-step 6 --readings 9 -o plan.csv && cat plan.csv"), 0);
    assert_says("azimuth_deg,tilt_deg,gain\n");
    assert_int_equal(run("brdf plan gold/gold.json bench.csv --azimuth-step 15 --tilt-step 6 --readings 5 -o next.csv --json -"), 0);
    assert_says("\"taken\": 36");
    assert_refused("brdf plan --readings 8000", "8000 readings");
    assert_int_equal(run("brdf plan --fibre circle bench.csv"), 2);
}

static void test_compare_draws_and_takes_spectra(void **state)
{
    (void)state;
    assert_int_equal(run("brdf compare bench.csv --threads 1 --truth bench.csv -o all/"), 0);
    assert_picture("all/compare.png", 1000, 560);
    assert_says("tanaka");
    write_bench("one.csv", 30, 30, 180); /* one azimuth: none can be held out, and the picture has no bars for it */
    assert_int_equal(run("brdf compare one.csv --threads 1 -o one/"), 0);
    assert_picture("one/compare.png", 1000, 560);
    assert_refused("brdf compare bench.csv --with bench.csv -o all/", "bench.csv with bench.csv");
    assert_int_equal(run("brdf compare bench.csv --channels xyz"), 2);
}

static void test_export_states_its_loss(void **state)
{
    (void)state;
    assert_int_equal(run("brdf export grey.json -o out/grey.bsdf --json rgl.json && cat rgl.json"), 0);
    assert_says("\"format\": \"RGL\"");
    assert_says("\"error_cbrt\": 0.00");
    assert_int_equal(run("brdf export grey.json -o out/grey.gltf && cat out/grey.gltf"), 0);
    assert_says("de00_p95");
    assert_says("KHR_materials_anisotropy");
    assert_int_equal(run("brdf export grey.json -o out/grey.binary && ls -A out"), 0);
    assert_says("the cloth's anisotropy is lost");
    assert_null(strstr(output, ".tmp"));
    assert_refused("brdf export none.json -o out/none.bsdf", "none.json");
    assert_int_equal(run("brdf export grey.json -o out/grey.obj"), 2);
    assert_says("expected FILE.bsdf, FILE.binary or FILE.gltf");
    assert_int_equal(run("brdf export grey.json grey.json"), 2);
    assert_int_equal(run("brdf export"), 2);
    assert_says("MATERIAL.json is missing");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_plot_draws_three_figures), cmocka_unit_test(test_plot_refuses), cmocka_unit_test(test_directions_find_their_stage_angles),
        cmocka_unit_test(test_folded_points_take_the_other_cosine), cmocka_unit_test(test_pair_at_scale_zero),
        cmocka_unit_test(test_predict_writes_a_material), cmocka_unit_test(test_plan_writes_stage_angles), cmocka_unit_test(test_compare_draws_and_takes_spectra), cmocka_unit_test(test_export_states_its_loss),
    };
    return cmocka_run_group_tests(tests, setup, teardown);
}
