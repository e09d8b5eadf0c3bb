/* Photographs: EXIF of a file made here, of real ones, folders with masks, what is refused. */
#include "failures.h"

#include "core/image.h"
#include "core/photo.h"
#include "tiff_writer.h"

static void write_picture(const char *path, int width, int height, int channels)
{
    tsuya_image image;
    assert_ok(tsuya_image_create(&image, width, height, channels, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    assert_ok(tsuya_image_save(&image, path, NULL));
    tsuya_image_free(&image);
}

/* A JPEG with an APP1 block put behind its first marker. */
static void write_exif_jpeg(const char *path, const tiff *t)
{
    char *bytes;
    size_t size;
    write_picture(path, 400, 300, 3);
    assert_ok(tsuya_file_load(&bytes, &size, path, 1 << 20));
    size_t length = 2 + 6 + t->size;
    unsigned char head[10] = {0xff, 0xe1, (unsigned char)(length >> 8), (unsigned char)length, 'E', 'x', 'i', 'f', 0, 0};
    unlink(path);
    FILE *file = fopen(path, "wb");
    fwrite(bytes, 1, 2, file);
    fwrite(head, 1, sizeof head, file);
    fwrite(t->bytes, 1, t->size, file);
    fwrite(bytes + 2, 1, size - 2, file);
    assert_int_equal(fclose(file), 0);
    tsuya_free(bytes);
}

static tiff t;

static void make_exif(bool big_endian)
{
    tiff_begin(&t, big_endian);
    size_t main_folder = tiff_folder(&t, 4);
    tiff_text(&t, &main_folder, 0x010f, "Maker  ");
    tiff_text(&t, &main_folder, 0x0110, "Model One");
    tiff_number(&t, &main_folder, 0x0112, TIFF_SHORT, 6);
    tiff_number(&t, &main_folder, 0x8769, TIFF_LONG, (uint32_t)t.size);
    size_t exif_folder = tiff_folder(&t, 6);
    tiff_ratio(&t, &exif_folder, 0x829a, 1, 125);
    tiff_ratio(&t, &exif_folder, 0x829d, 56, 10);
    tiff_number(&t, &exif_folder, 0x8827, TIFF_SHORT, 400);
    tiff_text(&t, &exif_folder, 0x9003, "2026:01:31 10:20:30");
    tiff_ratio(&t, &exif_folder, 0x920a, 5406, 1000);
    tiff_number(&t, &exif_folder, 0xa405, TIFF_SHORT, 28);
}

static void test_exif(void **state)
{
    (void)state;
    for (int big = 0; big < 2; big++) {
        tsuya_photo photo;
        make_exif(big);
        write_exif_jpeg(test_path("exif.jpg"), &t);
        assert_ok(tsuya_photo_load(&photo, test_path("exif.jpg")));
        assert_true(photo.width_px == 400 && photo.height_px == 300); /* as stored: orientation 6 turns nothing */
        assert_int_equal(photo.orientation, 6);
        assert_string_equal(photo.name, "exif.jpg");
        assert_string_equal(photo.make, "Maker");
        assert_string_equal(photo.model, "Model One");
        assert_string_equal(photo.taken, "2026:01:31 10:20:30");
        assert_near(photo.focal_mm, 5.406, 1e-12);
        assert_near(photo.focal_35mm, 28, 0);
        assert_near(photo.exposure_s, 0.008, 1e-12);
        assert_near(photo.f_number, 5.6, 1e-12);
        assert_near(photo.iso, 400, 0);
        assert_near(tsuya_photo_focal_px(&photo), 28 * 500 / sqrt(36.0 * 36 + 24 * 24), 1e-9);
        tsuya_photo_free(&photo);
    }
}

static void test_no_exif_is_fine(void **state)
{
    (void)state;
    static const char *const names[] = {"plain.jpg", "plain.png", "plain.tif"};
    for (int i = 0; i < 3; i++) {
        tsuya_photo photo;
        write_picture(test_path(names[i]), 40, 30, 3);
        assert_ok(tsuya_photo_load(&photo, test_path(names[i])));
        assert_true(photo.width_px == 40 && photo.height_px == 30 && photo.orientation == 1);
        assert_near(tsuya_photo_focal_px(&photo), 0, 0);
        assert_string_equal(photo.make, "");
        tsuya_photo_free(&photo);
    }
}

static tsuya_status load(const char *path)
{
    tsuya_photo photo;
    TSUYA_TRY(tsuya_photo_load(&photo, path));
    assert_true(photo.orientation >= 1 && photo.orientation <= 8 && photo.focal_mm >= 0 && photo.exposure_s >= 0 && isfinite(photo.focal_35mm));
    assert_non_null(memchr(photo.model, 0, sizeof photo.model));
    tsuya_photo_free(&photo);
    return TSUYA_OK;
}

static void test_odd_and_damaged_exif(void **state)
{
    (void)state;
    tiff_begin(&t, false);
    size_t folder = tiff_folder(&t, 4);
    tiff_number(&t, &folder, 0x0112, TIFF_SHORT, 77);
    tiff_ratio(&t, &folder, 0x920a, 5, 0);
    tiff_entry(&t, &folder, 0x829a, TIFF_SRATIONAL, 1, (const uint32_t[]){(uint32_t)-1, 100});
    tiff_number(&t, &folder, 0x0110, TIFF_SHORT, 3); /* a model that is a number */
    write_exif_jpeg(test_path("odd.jpg"), &t);
    tsuya_photo photo;
    assert_ok(tsuya_photo_load(&photo, test_path("odd.jpg")));
    assert_true(photo.orientation == 1 && photo.focal_mm == 0 && photo.exposure_s == 0 && photo.model[0] == '\0');
    tsuya_photo_free(&photo);
    make_exif(true);
    write_exif_jpeg(test_path("exif.jpg"), &t);
    test_damage(load, test_path("damaged.jpg"), test_path("exif.jpg"), 0, 2000);
}

static void test_real_photographs(void **state)
{
    (void)state;
    const char *robe = test_data("garment/asclepius/images"), *jacket = test_data("garment/kermit_jacket");
    if (!robe || !jacket) {
        skip();
    }
    tsuya_photo_set set;
    assert_ok(tsuya_photo_set_load(&set, robe, test_data("garment/asclepius/masks")));
    assert_int_equal(set.count, 40);
    for (int i = 0; i < set.count; i++) {
        assert_true(set.photo[i].width_px == 1305 && set.photo[i].height_px == 2320);
        assert_non_null(set.photo[i].mask_path);
        assert_near(tsuya_photo_focal_px(&set.photo[i]), 1538, 2);
    }
    tsuya_photo_set_free(&set);
    assert_ok(tsuya_photo_set_load(&set, jacket, NULL));
    assert_int_equal(set.count, 11);
    assert_near(set.photo[0].focal_mm, 5.406, 1e-3);
    tsuya_photo_set_free(&set);
}

static char notes[TSUYA_REASON_SIZE];
static void keep_note(void *user, tsuya_log_level level, const char *line)
{
    (void)user, (void)level;
    snprintf(notes, sizeof notes, "%s", line);
}

static void fresh(void)
{
    assert_ok(tsuya_folder_remove(test_path("set")));
    assert_ok(tsuya_folder_make(test_path("set/photos")));
    assert_ok(tsuya_folder_make(test_path("set/masks")));
    for (int i = 0; i < 3; i++) {
        char name[64];
        snprintf(name, sizeof name, "set/photos/IMG_%d.%s", i, i == 1 ? "JPG" : "png");
        write_picture(test_path("set/made.jpg"), 40, 30, 3);
        assert_int_equal(rename(test_path("set/made.jpg"), test_path(name)), 0);
    }
}

static void test_folders(void **state)
{
    (void)state;
    tsuya_photo_set set;
    fresh();
    write_picture(test_path("set/masks/IMG_0.png"), 40, 30, 1);
    write_picture(test_path("set/masks/IMG_1.png"), 40, 30, 1);
    write_picture(test_path("set/masks/IMG_1.JPG.png"), 40, 30, 1);
    assert_ok(tsuya_file_write(test_path("set/photos/notes.txt"), "x", 1));
    assert_ok(tsuya_file_write(test_path("set/photos/.hidden.jpg"), "x", 1));
    tsuya_log_set_sink(keep_note, NULL);
    assert_ok(tsuya_photo_set_load(&set, test_path("set/photos"), test_path("set/masks")));
    tsuya_log_set_sink(NULL, NULL);
    assert_non_null(strstr(notes, "notes.txt: passed over, it is no image"));
    assert_int_equal(set.count, 3);
    assert_string_equal(set.photo[1].name, "IMG_1.JPG");
    assert_string_equal(tsuya_path_name(set.photo[0].mask_path), "IMG_0.png");
    assert_string_equal(tsuya_path_name(set.photo[1].mask_path), "IMG_1.JPG.png"); /* COLMAP's name goes first */
    assert_null(set.photo[2].mask_path);
    tsuya_photo_set_free(&set);
}

static void test_refusals(void **state)
{
    (void)state;
    tsuya_photo_set set;
    fresh();
    write_picture(test_path("set/masks/IMG_2.png"), 30, 40, 1);
    assert_fails(tsuya_photo_set_load(&set, test_path("set/photos"), test_path("set/masks")), "IMG_2.png: 30 x 40 pixels, its photograph IMG_2.png has 40 x 30");
    assert_fails(tsuya_photo_set_load(&set, test_path("set/photos"), test_path("set/none")), "none: no such folder of masks");
    assert_fails(tsuya_photo_set_load(&set, test_path("set/none"), NULL), "cannot read the folder");
    write_picture(test_path("set/photos/IMG_3.png"), 30, 40, 3);
    assert_fails(tsuya_photo_set_load(&set, test_path("set/photos"), NULL),
                 "photographs of mixed size: IMG_0.png has 40 x 30 pixels, IMG_3.png has 30 x 40; one size is accepted");
    test_write(test_path("set/photos/IMG_1.JPG"), "\xff\xd8\xff\xe0 broken", 11);
    assert_fails(tsuya_photo_set_load(&set, test_path("set/photos"), NULL), "IMG_1.JPG: the image is truncated or damaged");
    assert_int_equal(set.count, 0);
    assert_fails(tsuya_photo_set_load(&set, test_path("set/masks/../../set"), NULL), "no photographs");
}

static tsuya_status attempt(void *user)
{
    tsuya_photo_set set;
    (void)user;
    TSUYA_TRY(tsuya_photo_set_load(&set, test_path("set/photos"), test_path("set/masks")));
    tsuya_photo_set_free(&set);
    return TSUYA_OK;
}

static void test_failing_memory(void **state)
{
    (void)state;
    fresh();
    write_picture(test_path("set/masks/IMG_0.png"), 40, 30, 1);
    assert_true(test_every_allocation(attempt, NULL) > 20);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_exif),
        cmocka_unit_test(test_no_exif_is_fine),
        cmocka_unit_test(test_odd_and_damaged_exif),
        cmocka_unit_test(test_real_photographs),
        cmocka_unit_test(test_folders),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_failing_memory),
    };
    int result = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return result;
}
