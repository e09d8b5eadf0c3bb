/* Camera raw by way of a DNG that this test writes (Adobe, "Digital Negative Specification", 1.4): a Bayer mosaic without
 * compression of a scene with known colours. */
#include "failures.h"

#include "core/image.h"
#include "core/photo.h"
#include "tiff_writer.h"

enum { WIDTH = 96, HEIGHT = 64, BLACK = 64, WHITE = 4095 };

static tiff t;

/* Linear camera values of the scene: grey on the left, twice as much on the right. */
static int scene(int x) { return x < WIDTH / 2 ? 800 : 1600; }

static void write_dng(const char *path, int orientation)
{
    tiff_begin(&t, false);
    size_t at = tiff_folder(&t, 23);
    tiff_number(&t, &at, 254, TIFF_LONG, 0);
    tiff_number(&t, &at, 256, TIFF_LONG, WIDTH);
    tiff_number(&t, &at, 257, TIFF_LONG, HEIGHT);
    tiff_number(&t, &at, 258, TIFF_SHORT, 16);
    tiff_number(&t, &at, 259, TIFF_SHORT, 1);
    tiff_number(&t, &at, 262, TIFF_SHORT, 32803); /* colour filter array */
    tiff_text(&t, &at, 271, "Maker");
    tiff_text(&t, &at, 272, "Model One");
    size_t strip = at;
    at += 12;
    tiff_number(&t, &at, 274, TIFF_SHORT, (uint32_t)orientation);
    tiff_number(&t, &at, 277, TIFF_SHORT, 1);
    tiff_number(&t, &at, 278, TIFF_LONG, HEIGHT);
    tiff_number(&t, &at, 279, TIFF_LONG, WIDTH * HEIGHT * 2);
    tiff_number(&t, &at, 284, TIFF_SHORT, 1);
    tiff_entry(&t, &at, 33421, TIFF_SHORT, 2, (const uint32_t[]){2, 2});
    tiff_entry(&t, &at, 33422, TIFF_BYTE, 4, (const uint32_t[]){0, 1, 1, 2}); /* R G G B */
    tiff_number(&t, &at, 34665, TIFF_LONG, (uint32_t)t.size);
    size_t exif = tiff_folder(&t, 4);
    tiff_ratio(&t, &exif, 33434, 1, 60);
    tiff_ratio(&t, &exif, 33437, 8, 1);
    tiff_number(&t, &exif, 34855, TIFF_SHORT, 200);
    tiff_ratio(&t, &exif, 37386, 50, 1);
    tiff_entry(&t, &at, 50706, TIFF_BYTE, 4, (const uint32_t[]){1, 4, 0, 0});
    tiff_text(&t, &at, 50708, "Model One");
    tiff_number(&t, &at, 50714, TIFF_SHORT, BLACK);
    tiff_number(&t, &at, 50717, TIFF_SHORT, WHITE);
    /* The camera sees linear sRGB: its matrix takes XYZ (D65) there. */
    static const int matrix[9] = {32405, -15371, -4985, -9693, 18760, 416, 556, -2040, 10572};
    uint32_t ratios[18];
    for (int k = 0; k < 9; k++) {
        ratios[2 * k] = (uint32_t)matrix[k];
        ratios[2 * k + 1] = 10000;
    }
    tiff_entry(&t, &at, 50721, TIFF_SRATIONAL, 9, ratios);
    tiff_entry(&t, &at, 50728, TIFF_RATIONAL, 3, (const uint32_t[]){1, 1, 1, 1, 1, 1});
    tiff_number(&t, &strip, 273, TIFF_LONG, (uint32_t)t.size);
    for (int y = 0; y < HEIGHT; y++) {
        for (int x = 0; x < WIDTH; x++, t.size += 2) {
            tiff_put(&t, t.size, (uint32_t)(BLACK + scene(x)), 2);
        }
    }
    test_write(path, t.bytes, t.size);
}

static void test_values_are_linear_and_unrotated(void **state)
{
    (void)state;
    for (int orientation = 1; orientation <= 6; orientation += 5) {
        write_dng(test_path("a.dng"), orientation);
        tsuya_image image;
        int width, height;
        assert_ok(tsuya_image_probe(&width, &height, test_path("a.dng")));
        assert_true(width == WIDTH && height == HEIGHT);
        assert_ok(tsuya_image_load(&image, test_path("a.dng")));
        assert_true(image.width_px == WIDTH && image.height_px == HEIGHT && image.channels == 3);
        assert_true(image.sample == TSUYA_SAMPLE_U16 && image.encoding == TSUYA_ENCODING_LINEAR);
        for (int y = 8; y < HEIGHT - 8; y += 8) {
            for (int c = 0; c < 3; c++) {
                double left = tsuya_image_get(&image, WIDTH / 4, y, c), right = tsuya_image_get(&image, 3 * WIDTH / 4, y, c);
                assert_near(right / left, 2.0, 0.01); /* light twice as strong, value twice as large: no curve, no black offset */
                assert_near(left, 800.0 / (WHITE - BLACK), 0.02 * left + 0.002); /* and no automatic brightness */
            }
        }
        tsuya_image_free(&image);
    }
}

static void test_exif_of_raw(void **state)
{
    (void)state;
    tsuya_photo photo;
    write_dng(test_path("b.dng"), 6);
    assert_ok(tsuya_photo_load(&photo, test_path("b.dng")));
    assert_true(photo.width_px == WIDTH && photo.height_px == HEIGHT && photo.orientation == 6);
    assert_string_equal(photo.make, "Maker");
    assert_string_equal(photo.model, "Model One");
    assert_near(photo.exposure_s, 1 / 60.0, 1e-6);
    assert_near(photo.f_number, 8, 1e-6);
    assert_near(photo.iso, 200, 0);
    assert_near(photo.focal_mm, 50, 1e-6);
    tsuya_photo_free(&photo);
}

static tsuya_status load(const char *path)
{
    tsuya_image image;
    tsuya_photo photo;
    tsuya_status status = tsuya_photo_load(&photo, path);
    if (status == TSUYA_OK) {
        tsuya_photo_free(&photo);
        status = tsuya_image_load(&image, path);
    }
    if (status == TSUYA_OK) {
        tsuya_image_free(&image);
    }
    return status;
}

static void test_damaged_files(void **state)
{
    (void)state;
    write_dng(test_path("c.dng"), 1);
    test_damage(load, test_path("damaged.dng"), test_path("c.dng"), t.size, 100);
    test_write(test_path("text.nef"), "no raw at all", 13);
    assert_fails(load(test_path("text.nef")), "text.nef: not camera raw that can be read");
    test_write(test_path("empty.cr2"), "", 0);
    assert_fails(load(test_path("empty.cr2")), "empty.cr2: ");
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_values_are_linear_and_unrotated),
        cmocka_unit_test(test_exif_of_raw),
        cmocka_unit_test(test_damaged_files),
    };
    int result = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return result;
}
