/* The program from outside: help, version, refusals, exit codes, brdf eval. */
#include "support.h"

#include "app/command.h"
#include "core/image.h"
#include "core/process.h"

static char *output;
static tsuya_process_info info;

static int run(const char *arguments)
{
    char command[TEST_PATH];
    snprintf(command, sizeof command, "%s %s", TSUYA_PROGRAM, arguments);
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

static void test_every_command_opens_its_help_with_an_example(void **state)
{
    (void)state;
    for (const tsuya_command *c = tsuya_commands; c->name; c++) {
        char arguments[128];
        snprintf(arguments, sizeof arguments, "%s --help 2>&1", c->name);
        assert_int_equal(run(arguments), 0);
        assert_int_equal(strncmp(output, "Example:\n", 9), 0);
        for (size_t i = 0; i < 6; i++) {
            static const char *const option[] = {"--threads", "--seed", "--json", "--quiet", "--help", "--version"};
            assert_says(option[i]);
        }
        snprintf(arguments, sizeof arguments, "%s --version", c->name);
        assert_int_equal(run(arguments), 0);
        assert_says("tsuya ");
    }
}

static void test_unknown_words_name_the_nearest(void **state)
{
    (void)state;
    assert_int_equal(run("rnder x.ply"), 2);
    assert_says("did you mean 'render'");
    assert_int_equal(run("capture chek photos"), 2);
    assert_says("did you mean 'capture check'");
    assert_int_equal(run("run --dryrun JOB.yaml"), 2);
    assert_says("did you mean '--dry-run'");
    assert_int_equal(run("run --from wave JOB.yaml"), 2);
    assert_says("did you mean 'weave'");
    assert_int_equal(run("run --threads 0 JOB.yaml"), 2);
    assert_int_equal(run("run --seed x JOB.yaml"), 2);
    assert_int_equal(run(""), 2);
    assert_int_equal(run("capture"), 2);
    assert_says("capture check");
}

static void test_calib_color_refuses(void **state)
{
    (void)state;
    assert_int_equal(run("calib color"), 2);
    assert_says("CHART is missing");
    assert_int_equal(run("calib color chart.tif --corners 1,2"), 2);
    assert_says("is not four points");
    assert_int_equal(run("calib color /nonexistent/chart.tif"), 1);
    assert_says("/nonexistent/chart.tif");
    assert_int_equal(run("reconstruct photos --scale a.yaml --distance '1; a 1,2 3,4'"), 2);
    assert_says("either --scale or --distance");
}

static void test_calib_light_refuses(void **state)
{
    (void)state;
    assert_int_equal(run("calib light"), 2);
    assert_says("--board is missing");
    assert_int_equal(run("calib light --board plate.yaml photos"), 2);
    assert_says("--camera is missing");
    assert_int_equal(run("calib light --board plate.yaml --camera c.cameramodel"), 2);
    assert_says("PHOTOS is missing");
    assert_int_equal(run("calib light --board plate.yaml --camera c.cameramodel --reflectance 2 photos"), 2);
    assert_says("--reflectance");
    assert_int_equal(run("calib light --board /nonexistent/plate.yaml --camera c.cameramodel photos"), 1);
    assert_says("/nonexistent/plate.yaml");
}

static void test_failures_are_one_line_and_exit_1(void **state)
{
    (void)state;
    assert_int_equal(run("run /nonexistent/JOB.yaml"), 1);
    assert_says("/nonexistent/JOB.yaml");
    assert_ptr_equal(strchr(output, '\n'), output + strlen(output) - 1);
}

/* Without colmap the job says so in one line, behind what is done before it. */
static void test_missing_colmap(void **state)
{
    (void)state;
    assert_ok(tsuya_folder_make(test_path("job/photos")));
    for (int i = 0; i < 3; i++) {
        char name[64];
        tsuya_image image;
        snprintf(name, sizeof name, "job/photos/IMG_%d.png", i);
        assert_ok(tsuya_image_create(&image, 64, 48, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
        assert_ok(tsuya_image_save(&image, test_path(name), NULL));
        tsuya_image_free(&image);
    }
    static const char yaml[] = "name: robe\nphotos: photos\n";
    assert_ok(tsuya_file_write(test_path("job/JOB.yaml"), yaml, sizeof yaml - 1));
    char command[2 * TEST_PATH];
    snprintf(command, sizeof command, "PATH=/nonexistent %s run --quiet %s", TSUYA_PROGRAM, test_path("job/JOB.yaml"));
    const char *argv[] = {"sh", "-c", command, NULL};
    tsuya_free(output);
    assert_ok(tsuya_process_capture(&output, &info, argv, NULL));
    assert_int_equal(info.exit_code, 1);
    output[strlen(output) - 1] = '\0';
    char *last = strrchr(output, '\n');
    last = last ? last + 1 : output;
    assert_int_equal(strncmp(last, "tsuya: colmap: not found", 24), 0);
}

static void test_eval_keeps_columns_and_order(void **state)
{
    (void)state;
    static const char material[] =
        "{\"format\": \"tsuya material\", \"version\": \"1.0\", \"name\": \"grey\", \"model\": \"lambert\", "
        "\"channels\": [\"r\", \"g\", \"b\"], \"dye\": {\"reflectance\": [0.1, 0.2, 0.4], \"coupling\": \"lambert\"}, \"parameters\": {}}";
    char arguments[TEST_PATH];
    assert_ok(tsuya_file_write(test_path("grey.json"), material, sizeof material - 1));
    snprintf(arguments, sizeof arguments, "brdf eval %s", test_path("grey.json"));
    char command[2 * TEST_PATH];
    snprintf(command, sizeof command,
             "printf 'phi_o_deg,theta_i_deg,phi_i_deg,theta_o_deg\\n180,30,0,30\\n10,0,0,95\\n' | %s %s", TSUYA_PROGRAM, arguments);
    const char *argv[] = {"sh", "-c", command, NULL};
    tsuya_free(output);
    assert_ok(tsuya_process_capture(&output, &info, argv, NULL));
    assert_int_equal(info.exit_code, 0);
    assert_says("phi_o_deg,theta_i_deg,phi_i_deg,theta_o_deg,r,g,b\n180,30,0,30,0.0318309886,0.0636619772,0.127323954\n");
    assert_says("\n10,0,0,95,0,0,0\n");
    snprintf(command, sizeof command, "printf 'theta_i,phi_i_deg,theta_o_deg,phi_o_deg\\n' | %s %s", TSUYA_PROGRAM, arguments);
    tsuya_free(output);
    assert_ok(tsuya_process_capture(&output, &info, argv, NULL));
    assert_int_equal(info.exit_code, 1);
    assert_says("theta_i_deg");
}

/* Two wavelengths make no colour, and the message names the table. */
static void test_colors_come_of_whole_spectra_only(void **state)
{
    (void)state;
    static const char table[] = "# quantity=brdf\ntheta_i_deg,phi_i_deg,theta_o_deg,phi_o_deg,nm550,nm560\n30,0,30,180,0.1,0.1\n30,0,20,180,0.1,0.1\n";
    char arguments[2 * TEST_PATH];
    assert_ok(tsuya_file_write(test_path("grey.csv"), table, sizeof table - 1));
    snprintf(arguments, sizeof arguments, "brdf fit %s --channels rgb -o %s", test_path("grey.csv"), test_path("none.json"));
    assert_int_equal(run(arguments), 1);
    assert_says("grey.csv: wavelengths from 550 to 560 nm");
    assert_false(tsuya_path_exists(test_path("none.json")));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_every_command_opens_its_help_with_an_example),
        cmocka_unit_test(test_unknown_words_name_the_nearest),
        cmocka_unit_test(test_calib_color_refuses),
        cmocka_unit_test(test_calib_light_refuses),
        cmocka_unit_test(test_failures_are_one_line_and_exit_1),
        cmocka_unit_test(test_missing_colmap),
        cmocka_unit_test(test_eval_keeps_columns_and_order),
        cmocka_unit_test(test_colors_come_of_whole_spectra_only),
    };
    int result = cmocka_run_group_tests(tests, NULL, NULL);
    tsuya_free(output);
    test_folder_remove();
    return result;
}
