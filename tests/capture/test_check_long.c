/* The larger sets of real photographs: none of their good ones is accused, the spoilt ones are. */
#include "support.h"

#include "capture/faults.h"

#include <math.h>

static void asclepius_with_spoilt_photographs(void **state)
{
    (void)state;
    const char *from = test_data("garment/asclepius/images"), *masks = test_data("garment/asclepius/masks");
    if (!from || !masks) {
        skip();
    }
    tsuya_arena *arena;
    char **name, source[TEST_PATH], to[TEST_PATH];
    int count;
    const char *folder = test_path("asclepius");
    faults_take_all(folder, from);
    assert_ok(tsuya_arena_create(&arena, 1 << 14));
    assert_ok(tsuya_folder_list(&name, &count, from, arena));
    for (int k = 0; k < 5; k++) {
        int i = 3 + 8 * k;
        snprintf(source, sizeof source, "%s/%s", from, name[i]);
        snprintf(to, sizeof to, "%s/%s", folder, name[i]);
        switch (k) {
        case 0: fault_gaussian(to, source, 2.5); break;
        case 1: fault_motion(to, source, 10); break;
        case 2: fault_gain(to, source, 0.5, 0.5, 0.5); break;
        case 3: fault_gain(to, source, 0.72, 1.0, 1.3); break;
        default: snprintf(to, sizeof to, "%s/zz-copy.jpg", folder); fault_again(to, source);
        }
    }
    tsuya_check check;
    tsuya_check_options options = tsuya_check_options_default();
    tsuya_context context = tsuya_context_default();
    assert_ok(tsuya_check_session(&check, folder, masks, &options, &context));
    assert_accused(&check, name[3], "blurred");
    assert_accused(&check, name[11], "blurred by motion");
    assert_accused(&check, name[19], "darker");
    assert_accused(&check, name[27], "white balance");
    assert_accused(&check, "zz-copy.jpg", "same view");
    if (check.again != 5) {
        for (int i = 0; i < check.count; i++) {
            for (int k = 0; k < check.photo[i].fault_count; k++) {
                print_error("%s: %s\n", check.photo[i].photo.name, check.photo[i].fault[k]);
            }
        }
    }
    assert_int_equal(check.again, 5);
    print_message("%d photographs, %.1f s\n", check.count, check.seconds);
    tsuya_check_free(&check);
    tsuya_arena_free(arena);
}

static void boards_are_not_accused(void **state)
{
    (void)state;
    const char *from = test_data("calib/two_boards");
    if (!from) {
        skip();
    }
    tsuya_check check;
    tsuya_check_options options = tsuya_check_options_default();
    tsuya_context context = tsuya_context_default();
    assert_ok(tsuya_check_session(&check, from, NULL, &options, &context));
    for (int i = 0; i < check.count; i++) {
        const tsuya_checked_photo *p = &check.photo[i];
        print_message("%s: edges %.2f px (best %.2f)%s%s\n", p->photo.name, p->blur.worst_px, p->blur.best_px, p->fault_count ? "  " : "",
                      p->fault_count ? p->fault[0] : "");
        for (int k = 0; k < p->fault_count; k++) {
            assert_non_null(strstr(p->fault[k], "blurred"));
        }
    }
    assert_in_range(check.again, 0, 4);
    tsuya_check_free(&check);
}

static int tear_down(void **state)
{
    (void)state;
    test_folder_remove();
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(asclepius_with_spoilt_photographs),
        cmocka_unit_test(boards_are_not_accused),
    };
    return cmocka_run_group_tests(tests, NULL, tear_down);
}
