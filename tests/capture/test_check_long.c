/* The larger sets of real photographs: none of their good ones is accused, the spoilt ones are. */
#include "support.h"

#include "capture/faults.h"

#include <math.h>

/* To be darkened: a photograph that shares features with others.  One that shares none cannot be told from a dark side of the figure. */
enum { DARK = 13 };

/* All of the spoilt, which the test has looked at, and no other. */
static void assert_rates(const tsuya_check *check, int spoilt)
{
    print_message("named %d of %d spoilt, accused %d of %d good\n", spoilt, spoilt, check->again - spoilt, check->count - spoilt);
    for (int i = 0; i < check->count && check->again != spoilt; i++) {
        for (int k = 0; k < check->photo[i].fault_count; k++) {
            print_error("%s: %s\n", check->photo[i].photo.name, check->photo[i].fault[k]);
        }
    }
    assert_int_equal(check->again, spoilt);
}

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
        int i = k == 2 ? DARK : 3 + 8 * k;
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
    assert_accused(&check, name[DARK], "darker");
    assert_accused(&check, name[27], "white balance");
    assert_accused(&check, "zz-copy.jpg", "same view");
    assert_rates(&check, 5);
    print_message("%d photographs, %.1f s\n", check.count, check.seconds);
    tsuya_check_free(&check);
    tsuya_arena_free(arena);
}

static void two_boards_with_spoilt_photographs(void **state)
{
    (void)state;
    const char *from = test_data("calib/two_boards"), *foreign = test_data("garment/kermit_jacket/kermit002.jpg");
    if (!from || !foreign) {
        skip();
    }
    char source[TEST_PATH], to[TEST_PATH];
    const char *folder = test_path("boards");
    faults_take_all(folder, from);
    for (int k = 0; k < 4; k++) {
        static const int spoilt[] = {3, 5, 6, 8};
        snprintf(source, sizeof source, "%s/scene_%02d.png", from, spoilt[k]);
        snprintf(to, sizeof to, k == 1 ? "%s/zz-copy.png" : "%s/scene_%02d.png", folder, spoilt[k]);
        switch (k) {
        case 0: fault_gain(to, source, 0.4, 0.4, 0.4); break;
        case 1: fault_again(to, source); break;
        case 2: fault_motion(to, source, 12); break;
        default: fault_gaussian(to, source, 4.0);
        }
    }
    snprintf(to, sizeof to, "%s/zz-foreign.jpg", folder);
    fault_again(to, foreign);
    tsuya_check check;
    tsuya_check_options options = tsuya_check_options_default();
    tsuya_context context = tsuya_context_default();
    assert_ok(tsuya_check_session(&check, folder, NULL, &options, &context));
    print_message("%d photographs, %.1f s\n", check.count, check.seconds);
    assert_accused(&check, "scene_03.png", "darker");
    assert_accused(&check, "zz-copy.png", "same view");
    assert_accused(&check, "scene_06.png", "blurred by motion");
    assert_accused(&check, "scene_08.png", "blurred");
    assert_accused(&check, "zz-foreign.jpg", "pixels, the others");
    assert_rates(&check, 5);
    tsuya_check_free(&check);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(asclepius_with_spoilt_photographs),
        cmocka_unit_test(two_boards_with_spoilt_photographs),
    };
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
