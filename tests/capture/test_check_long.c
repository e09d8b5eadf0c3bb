/* The larger sets of real photographs: none of their good ones is accused, the spoilt ones are. */
#include "support.h"

#include "capture/faults.h"

#include <math.h>

/* To be darkened: a photograph that shares features with others.  One that shares none cannot be told from a dark side of the figure. */
enum { DARK = 13 };

/* Shaken when it was taken (1/17 s; its contours are double to the eye), and no good photograph before anybody spoils it. */
static const char SHAKEN[] = "IMG_20161118_162134.jpg";

/* All of the spoilt, which the test has looked at, and no other. */
static void assert_rates(const tsuya_check *check, int spoilt)
{
    print_message("named %d of %d spoilt, accused %d of %d good\n", spoilt, spoilt, check->again - spoilt, check->count - spoilt);
    fflush(stdout);
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
    const char *foreign = test_data("garment/kermit_jacket/kermit002.jpg");
    if (!from || !masks || !foreign) {
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
    snprintf(to, sizeof to, "%s/zz-foreign.jpg", folder);
    fault_foreign(to, foreign, 1305, 2320);
    tsuya_check check;
    tsuya_check_options options = tsuya_check_options_default();
    tsuya_context context = tsuya_context_default();
    assert_ok(tsuya_check_session(&check, folder, masks, &options, &context));
    assert_accused(&check, name[3], "blurred");
    assert_accused(&check, name[11], "blurred by motion");
    assert_accused(&check, name[DARK], "darker");
    assert_accused(&check, name[27], "white balance");
    assert_accused(&check, "zz-copy.jpg", "same view");
    assert_accused(&check, "zz-foreign.jpg", "foreign");
    assert_true(checked(&check, SHAKEN)->fault_count > 0);
    assert_rates(&check, 7);
    print_message("%d photographs, %d placed, %.0f %% covered, %.1f s\n", check.count, check.placed, 100.0 * check.covered, check.seconds);
    assert_true(check.placed >= 0.9 * check.count);
    tsuya_check_free(&check);
    tsuya_arena_free(arena);
}

static void two_boards_with_spoilt_photographs(void **state)
{
    (void)state;
    const char *from = test_data("calib/two_boards"), *boards = test_data("calib/two_boards/boards.yaml"), *foreign = test_data("garment/kermit_jacket/kermit002.jpg");
    if (!from || !boards || !foreign) {
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
    snprintf(source, sizeof source, "%s/scene_04.png", from);
    snprintf(to, sizeof to, "%s/scene_04.png", folder);
    fault_zoom(to, source, 1.08);
    snprintf(to, sizeof to, "%s/zz-foreign.jpg", folder);
    fault_again(to, foreign);
    tsuya_check check;
    tsuya_check_options options = tsuya_check_options_default();
    tsuya_context context = tsuya_context_default();
    options.target = boards;
    assert_ok(tsuya_check_session(&check, folder, NULL, &options, &context));
    print_message("%d photographs, %.1f s; by the tags %.0f px\n", check.count, check.seconds, check.tags_focal_px);
    for (int i = 0; i < check.count; i++) {
        const tsuya_checked_photo *p = &check.photo[i];
        print_message("%-16s %2d tags, %.0f px +- %.0f\n", p->photo.name, p->tags, p->tags_focal_px, p->tags_focal_sigma_px);
    }
    assert_accused(&check, "scene_04.png", "zoomed");
    assert_accused(&check, "scene_03.png", "darker");
    assert_accused(&check, "zz-copy.png", "same view");
    assert_accused(&check, "scene_06.png", "blurred by motion");
    assert_accused(&check, "scene_08.png", "blurred");
    assert_accused(&check, "zz-foreign.jpg", "pixels, the others");
    assert_rates(&check, 6);
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
