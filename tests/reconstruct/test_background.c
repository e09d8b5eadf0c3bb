/* Backgrounds that stand still: of turntables before a fixed camera, told from photographs of a camera that is carried around. */
#include "support.h"

#include "core/context.h"
#include "core/image.h"
#include "core/photo.h"
#include "reconstruct/background.h"

enum { WIDTH = 320, HEIGHT = 240, PHOTOS = 16 };

typedef enum setting { TURNTABLE, BLACK_CLOTH, CARRIED } setting;

static double noise(int photo, int x, int y, int c)
{
    return tsuya_random_normal(3, (uint64_t)(16 * photo + c), (uint64_t)(y * WIDTH + x));
}

/* Patches of random colour, some px wide. */
static double patch(int seed, int x, int y, int c)
{
    uint64_t cell = (uint64_t)((y + 4096) / 9 * 4096 + (x + 4096) / 9);
    return tsuya_random_uniform((uint64_t)seed, (uint64_t)c, cell);
}

/* A body that turns: a bar that is wider than deep, off the axis, so that most places are free in half of the photographs, and a knob on it. */
static bool on_object(int photo, int x, int y)
{
    double turn = 2.0 * M_PI * photo / PHOTOS, middle = 160 + 70 * cos(turn), half = 22 + 18 * fabs(sin(turn));
    bool bar = fabs(x - middle) <= half && y >= 70 && y <= 200;
    return bar || hypot(x - middle - 0.8 * half * cos(turn), y - 55) <= 22;
}

static double level(setting stage, int photo, int x, int y, int c)
{
    if (on_object(photo, x, y)) { /* its texture turns with it; some of it has the background's colour */
        double p = patch(100 + photo, x, y, c);
        return patch(100 + photo, x, y, 7) < 0.15 ? (stage == BLACK_CLOTH ? 0.02 : 0.5) : 0.2 + 0.7 * p;
    }
    switch (stage) {
    case TURNTABLE: return 0.15 + 0.7 * patch(1, x, y, c);
    case BLACK_CLOTH: return 0.03 + 0.02 * (double)x / WIDTH;
    default: return 0.15 + 0.7 * patch(1, x + 13 * photo, y + 5 * photo, c);
    }
}

static void draw(setting stage, const char *folder)
{
    tsuya_image image;
    char path[TEST_PATH];
    assert_ok(tsuya_folder_make(folder));
    assert_ok(tsuya_image_create(&image, WIDTH, HEIGHT, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    for (int i = 0; i < PHOTOS; i++) {
        for (int k = 0; k < WIDTH * HEIGHT; k++) {
            int x = k % WIDTH, y = k / WIDTH;
            for (int c = 0; c < 3; c++) {
                double v = level(stage, i, x, y, c) + 0.006 * noise(i, x, y, c);
                tsuya_image_u8(&image, x, y)[c] = (uint8_t)(255.0 * fmin(fmax(v, 0.0), 1.0) + 0.5);
            }
        }
        snprintf(path, sizeof path, "%.2000s/p%02d.png", folder, i);
        assert_ok(tsuya_image_save(&image, path, NULL));
    }
    tsuya_image_free(&image);
}

static void find(tsuya_background_info *info, const char *photos, const char *masks, int threads)
{
    tsuya_context context = tsuya_context_default();
    tsuya_photo_set set;
    context.threads = threads;
    assert_ok(tsuya_photo_set_load(&set, photos, NULL));
    assert_ok(tsuya_background_masks(info, &set, masks, &context));
    tsuya_photo_set_free(&set);
}

typedef struct shares { double lost, spare; } shares; /* of the object; of the object's size, kept around it */

static shares compare(const char *photos, const char *masks)
{
    tsuya_photo_set set;
    shares most = {0, 0};
    assert_ok(tsuya_photo_set_load(&set, photos, masks)); /* names and sizes are those that masks have */
    for (int i = 0; i < PHOTOS; i++) {
        tsuya_image mask;
        double object = 0, lost = 0, spare = 0;
        assert_non_null(set.photo[i].mask_path);
        assert_ok(tsuya_image_load(&mask, set.photo[i].mask_path));
        for (int k = 0; k < WIDTH * HEIGHT; k++) {
            bool kept = *tsuya_image_u8(&mask, k % WIDTH, k / WIDTH) >= 128, real = on_object(i, k % WIDTH, k / WIDTH);
            object += real;
            lost += real && !kept;
            spare += kept && !real;
        }
        most.lost = fmax(most.lost, lost / object);
        most.spare = fmax(most.spare, spare / object);
        tsuya_image_free(&mask);
    }
    tsuya_photo_set_free(&set);
    return most;
}

static void assert_masked(setting stage, const char *name)
{
    char photos[TEST_PATH], masks[TEST_PATH];
    tsuya_background_info info;
    snprintf(photos, sizeof photos, "%.2000s/%s/photos", test_folder(), name);
    snprintf(masks, sizeof masks, "%.2000s/%s/masks", test_folder(), name);
    draw(stage, photos);
    find(&info, photos, masks, 2);
    shares s = compare(photos, masks);
    print_message("%s: border %.3f, masked %.3f; of the object at most %.4f lost, %.3f of its size kept around it\n", name, info.border, info.masked,
                  s.lost, s.spare);
    assert_true(info.found);
    assert_true(s.lost <= 0.05); /* patches of the background's colour that lie on the outline */
    assert_true(s.spare <= 0.15); /* a rim of two pixels around a bar and a knob */
}

static void what_stands_still_is_masked(void **state)
{
    (void)state;
    assert_masked(TURNTABLE, "turntable");
    assert_masked(BLACK_CLOTH, "cloth");
}

static void a_carried_camera_has_no_background(void **state)
{
    (void)state;
    tsuya_background_info info;
    draw(CARRIED, test_path("carried"));
    find(&info, test_path("carried"), test_path("none"), 2);
    print_message("carried: border %.3f\n", info.border);
    assert_false(info.found);
    assert_true(info.border < 0.3 && info.masked == 0.0);
    assert_false(tsuya_path_exists(test_path("none")));
}

static void threads_change_nothing(void **state)
{
    (void)state;
    tsuya_background_info info;
    tsuya_hash a, b;
    draw(TURNTABLE, test_path("same"));
    find(&info, test_path("same"), test_path("one"), 1);
    find(&info, test_path("same"), test_path("three"), 3);
    assert_ok(tsuya_hash_folder(&a, test_path("one")));
    assert_ok(tsuya_hash_folder(&b, test_path("three")));
    assert_string_equal(a.hex, b.hex);
}

/* Real sets of a camera that is carried around, which have no masks of their own here. */
static void real_sets_have_none(void **state)
{
    (void)state;
    static const char *const set[] = {"mvs/fountain", "garment/asclepius/images", "garment/kermit_jacket"};
    int seen = 0;
    for (size_t i = 0; i < sizeof set / sizeof *set; i++) {
        tsuya_background_info info;
        if (test_data(set[i])) {
            find(&info, test_data(set[i]), test_path("real"), 2);
            print_message("%s: border %.3f\n", set[i], info.border);
            assert_false(info.found);
            seen++;
        }
    }
    if (seen == 0) {
        skip();
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(what_stands_still_is_masked),
        cmocka_unit_test(a_carried_camera_has_no_background),
        cmocka_unit_test(threads_change_nothing),
        cmocka_unit_test(real_sets_have_none),
    };
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
