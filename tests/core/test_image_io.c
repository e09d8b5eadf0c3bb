/* Image files: what is written comes back, what is damaged is refused or read, and nothing crashes. */
#include "failures.h"

#include "core/image.h"

#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>

/* Smooth colours with a little noise, so that every codec has something to do. */
static tsuya_image picture(int width, int height, int channels, tsuya_sample sample)
{
    tsuya_image image;
    assert_ok(tsuya_image_create(&image, width, height, channels, sample, sample == TSUYA_SAMPLE_F32 ? TSUYA_ENCODING_LINEAR : TSUYA_ENCODING_SRGB));
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            for (int c = 0; c < channels; c++) {
                double noise = tsuya_random_uniform(4, (uint64_t)c, (uint64_t)(y * width + x));
                double value = 0.5 + 0.4 * sin(0.1 * x * (c + 1)) * cos(0.07 * y) + 0.05 * (noise - 0.5);
                size_t at = (size_t)(x * channels + c);
                if (sample == TSUYA_SAMPLE_U8) {
                    tsuya_image_u8(&image, 0, y)[at] = (uint8_t)(255 * value);
                } else if (sample == TSUYA_SAMPLE_U16) {
                    tsuya_image_u16(&image, 0, y)[at] = (uint16_t)(65535 * value);
                } else {
                    tsuya_image_f32(&image, 0, y)[at] = (float)(value * (c == 0 ? 1000.0 : 1.0) - 0.2);
                }
            }
        }
    }
    return image;
}

static void test_lossless_formats(void **state)
{
    (void)state;
    static const struct { const char *name; tsuya_sample sample; } forms[] = {
        {"a.png", TSUYA_SAMPLE_U8},   {"b.png", TSUYA_SAMPLE_U16}, {"c.tif", TSUYA_SAMPLE_U8},
        {"d.tiff", TSUYA_SAMPLE_U16}, {"e.tif", TSUYA_SAMPLE_F32}, {"f.exr", TSUYA_SAMPLE_F32},
    };
    static const int channels[] = {1, 3, 4};
    for (size_t f = 0; f < sizeof forms / sizeof forms[0]; f++) {
        for (int c = 0; c < 3; c++) {
            tsuya_image image = picture(61, 37, channels[c], forms[f].sample), back;
            int width, height;
            assert_ok(tsuya_image_save(&image, test_path(forms[f].name), NULL));
            assert_ok(tsuya_image_probe(&width, &height, test_path(forms[f].name)));
            assert_true(width == 61 && height == 37);
            assert_ok(tsuya_image_load(&back, test_path(forms[f].name)));
            assert_int_equal(back.sample, image.sample);
            assert_int_equal(back.channels, image.channels);
            assert_int_equal(back.encoding, image.encoding);
            assert_memory_equal(back.data, image.data, 37 * image.row_bytes);
            tsuya_image_free(&back);
            tsuya_image_free(&image);
        }
    }
}

static void test_jpeg(void **state)
{
    (void)state;
    tsuya_image image = picture(61, 37, 3, TSUYA_SAMPLE_U8), back;
    tsuya_image_save_options options = tsuya_image_save_options_default();
    double error[2];
    for (int i = 0; i < 2; i++) {
        options.jpeg_quality = i ? 98 : 30;
        assert_ok(tsuya_image_save(&image, test_path("a.jpg"), &options));
        assert_ok(tsuya_image_load(&back, test_path("a.jpg")));
        assert_true(back.width_px == 61 && back.height_px == 37 && back.channels == 3);
        error[i] = 0;
        for (int k = 0; k < 61 * 37 * 3; k++) {
            error[i] += fabs((double)tsuya_image_u8(&image, 0, 0)[k] - tsuya_image_u8(&back, 0, 0)[k]) / (61 * 37 * 3);
        }
        tsuya_image_free(&back);
    }
    assert_true(error[1] < 3.0 && error[1] < error[0]);
    tsuya_image_free(&image);
}

/* Red stays red: nothing on the way swaps channels. */
static void test_channel_order(void **state)
{
    (void)state;
    static const char *const names[] = {"r.jpg", "r.png", "r.tif", "r.exr"};
    for (int i = 0; i < 4; i++) {
        tsuya_image image, back;
        bool exr = i == 3;
        assert_ok(tsuya_image_create(&image, 16, 16, 3, exr ? TSUYA_SAMPLE_F32 : TSUYA_SAMPLE_U8, TSUYA_ENCODING_LINEAR));
        for (int k = 0; k < 256; k++) {
            if (exr) {
                tsuya_image_f32(&image, 0, 0)[3 * k] = 1.0f;
            } else {
                tsuya_image_u8(&image, 0, 0)[3 * k] = 255;
            }
        }
        assert_ok(tsuya_image_save(&image, test_path(names[i]), NULL));
        assert_ok(tsuya_image_load(&back, test_path(names[i])));
        assert_true(tsuya_image_get(&back, 8, 8, 0) > 0.95f && tsuya_image_get(&back, 8, 8, 2) < 0.05f);
        tsuya_image_free(&back);
        tsuya_image_free(&image);
    }
}

static void test_half_float(void **state)
{
    (void)state;
    static const char *const name[] = {"camera"}, *const value[] = {"left"};
    tsuya_image_save_options options = {.exr_half = true, .attribute_count = 1, .attribute_name = name, .attribute_value = value};
    for (int channels = 1; channels <= 4; channels += channels == 1 ? 2 : 1) {
        tsuya_image image = picture(61, 37, channels, TSUYA_SAMPLE_F32), back;
        assert_ok(tsuya_image_save(&image, test_path("half.exr"), &options));
        assert_ok(tsuya_image_load(&back, test_path("half.exr")));
        assert_int_equal(back.channels, channels);
        for (int k = 0; k < 61 * 37 * channels; k++) {
            double there = tsuya_image_f32(&image, 0, 0)[k], again = tsuya_image_f32(&back, 0, 0)[k];
            assert_near(again, there, fabs(there) / 2048 + 1e-7); /* 11 significant bits */
        }
        tsuya_image_free(&back);
        tsuya_image_free(&image);
    }
}

static void test_the_content_tells_the_format(void **state)
{
    (void)state;
    tsuya_image image = picture(20, 20, 3, TSUYA_SAMPLE_U8), back;
    assert_ok(tsuya_image_save(&image, test_path("true.png"), NULL));
    assert_int_equal(rename(test_path("true.png"), test_path("false.jpg")), 0);
    assert_ok(tsuya_image_load(&back, test_path("false.jpg")));
    tsuya_image_free(&back);
    test_write(test_path("text.jpg"), "no picture", 10);
    assert_fails(tsuya_image_load(&back, test_path("text.jpg")), "text.jpg: not an image; JPEG, PNG");
    test_write(test_path("empty.jpg"), "", 0);
    assert_fails(tsuya_image_load(&back, test_path("empty.jpg")), "empty.jpg: not an image");
    assert_fails(tsuya_image_load(&back, test_path("none.jpg")), "none.jpg: cannot read: No such file");
    assert_fails(tsuya_image_save(&image, test_path("a.gif"), NULL), "a.gif: .png, .jpg, .tif and .exr can be written");
    assert_fails(tsuya_image_save(&image, test_path("a.exr"), NULL), "cannot hold the image's samples");
    assert_fails(tsuya_image_save(&image, test_path("none/a.png"), NULL), "none/");
    tsuya_image_free(&image);
    image = picture(20, 20, 3, TSUYA_SAMPLE_F32);
    assert_fails(tsuya_image_save(&image, test_path("a.png"), NULL), "cannot hold");
    assert_fails(tsuya_image_save(&image, test_path("a.jpg"), NULL), "cannot hold");
    tsuya_image_free(&image);
}

/* A header that says 60000 x 60000 is refused before memory is taken for it. */
static void test_hostile_sizes(void **state)
{
    (void)state;
    tsuya_image image = picture(20, 20, 3, TSUYA_SAMPLE_U8), back;
    char *bytes;
    size_t size;
    static const struct { const char *name; size_t width_at, bytes; } forms[] = {{"h.png", 16, 4}, {"h.jpg", 0, 2}};
    for (int i = 0; i < 2; i++) {
        assert_ok(tsuya_image_save(&image, test_path(forms[i].name), NULL));
        assert_ok(tsuya_file_load(&bytes, &size, test_path(forms[i].name), 1 << 20));
        size_t at = forms[i].width_at;
        for (size_t k = 0; i == 1 && k + 9 < size; k++) { /* the frame header of a baseline JPEG */
            at = !at && memcmp(bytes + k, "\xff\xc0", 2) == 0 ? k + 5 : at;
        }
        memset(bytes + at, 0, 2 * forms[i].bytes);
        for (int k = 1; k <= 2; k++) {
            bytes[at + (size_t)k * forms[i].bytes - 2] = (char)0xea;
        }
        test_write(test_path(forms[i].name), bytes, size);
        tsuya_free(bytes);
        (void)tsuya_memory_fail_at(0);
        assert_fails(tsuya_image_load(&back, test_path(forms[i].name)), "59904 x 59904 pixels; 1 … 65535 a side and 400 megapixels");
    }
    tsuya_image_free(&image);
}

static tsuya_status load(const char *path)
{
    tsuya_image image;
    int width, height;
    TSUYA_TRY(tsuya_image_probe(&width, &height, path));
    TSUYA_TRY(tsuya_image_load(&image, path));
    assert_true(image.width_px == width && image.height_px == height);
    tsuya_image_free(&image);
    return TSUYA_OK;
}

static void test_damaged_files(void **state)
{
    (void)state;
    static const struct { const char *name; tsuya_sample sample; int rounds, slack; bool half; } forms[] = {
        {"g.jpg", TSUYA_SAMPLE_U8, 400, 0, false},  {"g.png", TSUYA_SAMPLE_U8, 400, 0, false},   {"g16.png", TSUYA_SAMPLE_U16, 200, 0, false},
        {"g.tif", TSUYA_SAMPLE_U8, 400, 8, false},  {"g16.tif", TSUYA_SAMPLE_U16, 200, 8, false}, {"g.exr", TSUYA_SAMPLE_F32, 400, 0, false},
        {"gh.exr", TSUYA_SAMPLE_F32, 200, 0, true},
    };
    for (size_t i = 0; i < sizeof forms / sizeof forms[0]; i++) {
        tsuya_image image = picture(40, 30, 3, forms[i].sample);
        tsuya_image_save_options options = tsuya_image_save_options_default();
        options.exr_half = forms[i].half;
        char name[64];
        struct stat about;
        snprintf(name, sizeof name, "bad-%s", forms[i].name);
        assert_ok(tsuya_image_save(&image, test_path(forms[i].name), &options));
        assert_int_equal(stat(test_path(forms[i].name), &about), 0);
        test_damage(load, test_path(name), test_path(forms[i].name), (size_t)about.st_size - (size_t)forms[i].slack, forms[i].rounds);
        tsuya_image_free(&image);
    }
}

/* In a child, whose files may not grow beyond 4 kB. */
static int save_beyond_limit(const tsuya_image *image, const char *name)
{
    struct rlimit limit = {4096, 4096};
    signal(SIGXFSZ, SIG_IGN);
    setrlimit(RLIMIT_FSIZE, &limit);
    return tsuya_image_save(image, test_path(name), NULL) == TSUYA_ERROR_IO && strstr(tsuya_reason(), name) ? 0 : 1;
}

static void test_a_full_disk_leaves_nothing(void **state)
{
    (void)state;
    static const char *const names[] = {"full.png", "full.jpg", "full.tif", "full.exr"};
    for (int i = 0; i < 4; i++) {
        tsuya_image image = picture(200, 200, 3, i == 3 ? TSUYA_SAMPLE_F32 : TSUYA_SAMPLE_U8);
        int status;
        fflush(NULL);
        pid_t pid = fork();
        if (pid == 0) {
            _exit(save_beyond_limit(&image, names[i]));
        }
        assert_int_equal(waitpid(pid, &status, 0), pid);
        if (!WIFEXITED(status) || WEXITSTATUS(status) != 0) {
            fail_msg("%s: a full disk is not said", names[i]);
        }
        assert_false(tsuya_path_exists(test_path(names[i])));
        tsuya_image_free(&image);
    }
}

static tsuya_status save_and_load(void *user)
{
    TSUYA_TRY(tsuya_image_save(user, test_path("memory.exr"), NULL));
    return load(test_path("memory.exr"));
}

static void test_failing_memory(void **state)
{
    (void)state;
    tsuya_image image = picture(20, 20, 3, TSUYA_SAMPLE_F32);
    assert_true(test_every_allocation(save_and_load, &image) > 3);
    tsuya_image_free(&image);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_lossless_formats), cmocka_unit_test(test_jpeg),          cmocka_unit_test(test_channel_order),
        cmocka_unit_test(test_half_float),       cmocka_unit_test(test_the_content_tells_the_format),
        cmocka_unit_test(test_hostile_sizes),    cmocka_unit_test(test_damaged_files), cmocka_unit_test(test_a_full_disk_leaves_nothing),
        cmocka_unit_test(test_failing_memory),
    };
    int result = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return result;
}
