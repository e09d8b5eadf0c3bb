/* Photographs from which nothing can be made: one clear line each. */
#include "support.h"

#include "core/image.h"
#include "core/process.h"
#include "reconstruct/reconstruct.h"

#include <unistd.h>

enum { WIDTH = 160, HEIGHT = 120 };

/* Blobs that `seed` decides: photographs of different seeds show different things. */
static void photograph(const char *folder, int index, uint64_t seed)
{
    char path[TEST_PATH];
    tsuya_image image;
    snprintf(path, sizeof path, "%.2000s/photos", folder);
    assert_ok(tsuya_folder_make(path));
    assert_ok(tsuya_image_create(&image, WIDTH, HEIGHT, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++) {
            uint8_t grey = (uint8_t)(tsuya_random_u64(seed, 1, (uint64_t)(y / 5 * WIDTH + x / 5)) >> 56);
            memset(tsuya_image_u8(&image, x, y), grey, 3);
        }
    }
    snprintf(path, sizeof path, "%.2000s/photos/%02d.jpg", folder, index);
    assert_ok(tsuya_image_save(&image, path, NULL));
    tsuya_image_free(&image);
}

static tsuya_status reconstruct(const char *folder)
{
    char photos[TEST_PATH], output[TEST_PATH];
    tsuya_context context = tsuya_context_default();
    tsuya_reconstruct_options options = tsuya_reconstruct_options_default();
    tsuya_reconstruct_info info;
    context.threads = 2;
    snprintf(photos, sizeof photos, "%.2000s/photos", folder);
    snprintf(output, sizeof output, "%.2000s/out", folder);
    options.photos = photos;
    options.output = output;
    tsuya_status status = tsuya_reconstruct(&info, &options, &context);
    if (status == TSUYA_OK) {
        tsuya_reconstruct_info_free(&info);
    }
    return status;
}

static void two_photographs_are_too_few(void **state)
{
    (void)state;
    const char *folder = test_path("two");
    photograph(folder, 0, 1);
    photograph(folder, 1, 2);
    assert_fails(reconstruct(folder), "2 photographs; at least 3 are needed");
}

static void identical_photographs_are_named_as_such(void **state)
{
    (void)state;
    const char *folder = test_path("same");
    for (int i = 0; i < 4; i++) {
        photograph(folder, i, 1);
    }
    assert_fails(reconstruct(folder), "all 4 photographs are the same file");
}

static void truncated_photograph_is_named(void **state)
{
    (void)state;
    const char *folder = test_path("cut");
    for (int i = 0; i < 3; i++) {
        photograph(folder, i, (uint64_t)i);
    }
    char path[TEST_PATH];
    snprintf(path, sizeof path, "%.2000s/photos/01.jpg", folder);
    struct stat file;
    assert_int_equal(stat(path, &file), 0);
    assert_int_equal(truncate(path, file.st_size / 2), 0);
    assert_fails(reconstruct(folder), "01.jpg: the image is truncated or damaged");
}

static void photographs_of_different_things_are_refused(void **state)
{
    (void)state;
    if (!tsuya_process_available("colmap")) {
        skip();
    }
    const char *folder = test_path("apart");
    for (int i = 0; i < 4; i++) {
        photograph(folder, i, 10 + (uint64_t)i);
    }
    assert_fails(reconstruct(folder), "overlap");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(two_photographs_are_too_few),
        cmocka_unit_test(identical_photographs_are_named_as_such),
        cmocka_unit_test(truncated_photograph_is_named),
        cmocka_unit_test(photographs_of_different_things_are_refused),
    };
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return failed;
}
