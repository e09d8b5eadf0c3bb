/* Real photographs, some spoilt on purpose: each of those is named, none of the others. */
#include "support.h"

#include "capture/faults.h"
#include "core/image.h"

#include <math.h>

/* Says both rates; none of the good may be accused, all of the spoilt must be. */
static void report_wrong(const tsuya_check *check, const char *const *spoilt)
{
    int wrong = 0, named = 0, spoilt_count = 0;
    for (int i = 0; i < check->count; i++) {
        const tsuya_checked_photo *p = &check->photo[i];
        bool expected = false;
        for (int k = 0; spoilt[k]; k++) {
            expected = expected || strcmp(p->photo.name, spoilt[k]) == 0;
        }
        spoilt_count += expected;
        named += expected && p->fault_count > 0;
        if (!expected && p->fault_count > 0) {
            print_error("%s: good, but accused: %s\n", p->photo.name, p->fault[0]);
            wrong++;
        }
    }
    print_message("named %d of %d spoilt, accused %d of %d good\n", named, spoilt_count, wrong, check->count - spoilt_count);
    assert_int_equal(wrong, 0);
    assert_int_equal(named, spoilt_count);
}

static void spoilt_photographs_of_a_jacket_are_named(void **state)
{
    (void)state;
    const char *from = test_data("garment/kermit_jacket");
    if (!from) {
        skip();
    }
    const char *folder = test_path("kermit");
    static const char *const spoilt[] = {"kermit001.jpg", "kermit003.jpg", "kermit005.jpg", "kermit007.jpg", "kermit008x.jpg", "kermit020.jpg",
                                         "kermit021.jpg", NULL};
    char source[TEST_PATH], to[TEST_PATH];
    faults_take_all(folder, from);
#define SPOIL(function, name, original, ...)                           \
    snprintf(source, sizeof source, "%s/%s", from, original);          \
    snprintf(to, sizeof to, "%s/%s", folder, name);                    \
    function(to, source, ##__VA_ARGS__)
    SPOIL(fault_gaussian, "kermit001.jpg", "kermit001.jpg", 2.0);
    SPOIL(fault_gain, "kermit003.jpg", "kermit003.jpg", 0.4, 0.4, 0.4);
    SPOIL(fault_gain, "kermit005.jpg", "kermit005.jpg", 0.7, 1.0, 1.35);
    SPOIL(fault_motion, "kermit007.jpg", "kermit007.jpg", 8);
    SPOIL(fault_again, "kermit008x.jpg", "kermit008.jpg");
    snprintf(to, sizeof to, "%s/kermit020.jpg", folder);
    assert_ok(tsuya_file_write(to, "\xFF\xD8\xFF\xE0 not a photograph", 21));
    const char *other = test_data("garment/asclepius/images");
    tsuya_arena *arena;
    char **name;
    int count;
    assert_ok(tsuya_arena_create(&arena, 1 << 12));
    if (other) {
        assert_ok(tsuya_folder_list(&name, &count, other, arena));
        snprintf(source, sizeof source, "%s/%s", other, name[0]);
        snprintf(to, sizeof to, "%s/kermit021.jpg", folder);
        fault_again(to, source);
    }
    tsuya_check check;
    tsuya_check_options options = tsuya_check_options_default();
    tsuya_context context = tsuya_context_default();
    assert_ok(tsuya_check_session(&check, folder, NULL, &options, &context));
    assert_accused(&check, "kermit001.jpg", "blurred");
    assert_accused(&check, "kermit003.jpg", "darker");
    assert_accused(&check, "kermit005.jpg", "white balance");
    assert_accused(&check, "kermit007.jpg", "blurred by motion");
    assert_accused(&check, "kermit008x.jpg", "same view as kermit008.jpg");
    assert_accused(&check, "kermit020.jpg", "cannot be read");
    if (other) {
        assert_accused(&check, "kermit021.jpg", "pixels, the others");
        assert_int_equal(checked(&check, "kermit021.jpg")->neighbours, 0);
    }
    assert_true(fabs(checked(&check, "kermit003.jpg")->exposure_ev - log2(0.4)) < 0.3);
    report_wrong(&check, spoilt);
    print_message("%d photographs, %d accused, %.1f s\n", check.count, check.again, check.seconds);
    tsuya_check_free(&check);
    tsuya_arena_free(arena);
}

static void empty_and_missing_folders_fail_clearly(void **state)
{
    (void)state;
    tsuya_check check;
    tsuya_check_options options = tsuya_check_options_default();
    tsuya_context context = tsuya_context_default();
    const char *empty = test_path("empty");
    assert_ok(tsuya_folder_make(empty));
    assert_fails(tsuya_check_session(&check, empty, NULL, &options, &context), "no photographs");
    assert_fails(tsuya_check_session(&check, test_path("nowhere"), NULL, &options, &context), "nowhere");
    assert_fails(tsuya_check_session(&check, empty, test_path("no-masks"), &options, &context), "no such folder of masks");
}

/* A clean list is no praise where nothing was compared. */
static void a_check_says_what_it_could_not_see(void **state)
{
    (void)state;
    tsuya_checked_photo photo[4] = {{.neighbours = 0}};
    tsuya_check check = {.photo = photo, .count = 4};
    assert_non_null(tsuya_check_blindness(&check));
    photo[0].neighbours = photo[1].neighbours = 1;
    assert_null(tsuya_check_blindness(&check));
    check.count = 2; /* two photographs are no session */
    photo[0].neighbours = photo[1].neighbours = 0;
    assert_null(tsuya_check_blindness(&check));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(spoilt_photographs_of_a_jacket_are_named),
        cmocka_unit_test(a_check_says_what_it_could_not_see),
        cmocka_unit_test(empty_and_missing_folders_fail_clearly),
    };
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
