/* The demo: the whole chain on photographs whose truth is known, held against what it reaches. */
#include "support.h"

#include "core/json.h"
#include "core/process.h"

static double figure(const tsuya_json *figures, const char *group, const char *name)
{
    const tsuya_json *object = group ? tsuya_json_member(figures, group) : figures;
    return tsuya_json_number_or(tsuya_json_member(object, name), NAN);
}

static void test_demo_comes_near_its_truth(void **state)
{
    (void)state;
    const char *argv[] = {TSUYA_PROGRAM, "demo", test_path("demo"), "--json", test_path("demo.json"), NULL};
    tsuya_process_info info;
    tsuya_json *figures;
    char *output;
    assert_ok(tsuya_process_capture(&output, &info, argv, NULL));
    tsuya_free(output);
    assert_int_equal(info.exit_code, 0);
    assert_ok(tsuya_json_load(&figures, test_path("demo.json")));
    assert_true(figure(figures, NULL, "focal_rel") <= 0.001);
    assert_true(figure(figures, NULL, "scale_rel") <= 0.001);
    assert_true(figure(figures, "surface_gsd", "median") <= 0.7);
    assert_true(figure(figures, "surface_gsd", "p90") <= 2.0);
    assert_true(figure(figures, "completeness", "fraction") >= 0.9);
    assert_true(figure(figures, "weft_deg", "median") <= 2.0);
    assert_true(figure(figures, "weft_deg", "p90") <= 4.0);
    assert_true(figure(figures, NULL, "covered_fraction") >= 0.2);
    assert_true(figure(figures, "brdf_cbrt", "table") <= 0.05);
    assert_true(figure(figures, "brdf_cbrt", "photos") <= 0.12);
    tsuya_json_free(figures);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_demo_comes_near_its_truth)};
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
