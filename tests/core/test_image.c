/* Images in memory: conversions, the sRGB curve, grey, resizing, sampling. */
#include "failures.h"

#include "core/image.h"

static tsuya_image make(int width, int height, int channels, tsuya_sample sample, tsuya_encoding encoding)
{
    tsuya_image image;
    assert_ok(tsuya_image_create(&image, width, height, channels, sample, encoding));
    return image;
}

static void test_sizes(void **state)
{
    (void)state;
    tsuya_image image;
    static const int bad[][3] = {{0, 1, 1}, {1, 0, 1}, {-1, 1, 1}, {65536, 1, 1}, {1, 65536, 1}, {1, 1, 0}, {1, 1, 65}};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        assert_fails(tsuya_image_create(&image, bad[i][0], bad[i][1], bad[i][2], TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB), "65535 pixels a side");
        assert_null(image.data);
        tsuya_image_free(&image);
    }
    image = make(3, 2, 3, TSUYA_SAMPLE_U16, TSUYA_ENCODING_SRGB);
    assert_int_equal(image.row_bytes, 18);
    assert_ptr_equal((char *)tsuya_image_u16(&image, 2, 1), (char *)image.data + 18 + 12);
    tsuya_image_free(&image);
    tsuya_image_free(&image);
}

static void test_srgb_curve(void **state)
{
    (void)state;
    /* IEC 61966-2-1: pieces join, 0 and 1 stay, mid grey. */
    assert_near(tsuya_srgb_decode(0.0f), 0, 0);
    assert_near(tsuya_srgb_decode(1.0f), 1, 1e-7);
    assert_near(tsuya_srgb_decode(0.5f), 0.21404114, 1e-7);
    assert_near(tsuya_srgb_encode(0.18f), 0.46135613, 1e-6);
    assert_near(tsuya_srgb_encode(0.0031308f), 12.92 * 0.0031308, 1e-6);
    assert_near(tsuya_srgb_encode(0.00313081f), 12.92 * 0.00313081, 1e-6);
    assert_near(tsuya_srgb_encode(NAN), 0, 0);
    assert_near(tsuya_srgb_encode(-1.0f), 0, 0);
    assert_near(tsuya_srgb_encode(INFINITY), 1, 0);
    float before = -1;
    for (int i = 0; i <= 65535; i++) {
        float encoded = (float)i / 65535.0f, linear = tsuya_srgb_decode(encoded);
        assert_true(linear > before);
        assert_near(tsuya_srgb_encode(linear), encoded, 3e-7);
        before = linear;
    }
}

/* Every code of 8 and of 16 bits survives the way through another sample type, and through linear float. */
static void test_codes_survive(void **state)
{
    (void)state;
    for (int bits = 8; bits <= 16; bits += 8) {
        int side = bits == 8 ? 16 : 256;
        tsuya_sample own = bits == 8 ? TSUYA_SAMPLE_U8 : TSUYA_SAMPLE_U16;
        tsuya_image image = make(side, side, 1, own, TSUYA_ENCODING_SRGB);
        for (int i = 0; i < side * side; i++) {
            if (bits == 8) {
                tsuya_image_u8(&image, 0, 0)[i] = (uint8_t)i;
            } else {
                tsuya_image_u16(&image, 0, 0)[i] = (uint16_t)i;
            }
        }
        static const struct { tsuya_sample sample; tsuya_encoding encoding; } ways[] = {
            {TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR}, {TSUYA_SAMPLE_F32, TSUYA_ENCODING_SRGB}, {TSUYA_SAMPLE_U16, TSUYA_ENCODING_SRGB}};
        for (size_t w = 0; w < 3; w++) {
            tsuya_image there, back;
            assert_ok(tsuya_image_convert(&there, &image, ways[w].sample, ways[w].encoding));
            assert_ok(tsuya_image_convert(&back, &there, own, TSUYA_ENCODING_SRGB));
            assert_memory_equal(back.data, image.data, (size_t)side * image.row_bytes);
            tsuya_image_free(&there);
            tsuya_image_free(&back);
        }
        tsuya_image_free(&image);
    }
}

static void test_linear_and_encoded_differ_and_alpha_stays(void **state)
{
    (void)state;
    tsuya_image image = make(1, 1, 4, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB), linear, data;
    memcpy(image.data, (uint8_t[]){0, 128, 255, 128}, 4);
    assert_ok(tsuya_image_convert(&linear, &image, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    const float *p = tsuya_image_f32(&linear, 0, 0);
    assert_near(p[0], 0, 0);
    assert_near(p[1], 0.21586050, 1e-7);
    assert_near(p[2], 1, 1e-7);
    assert_near(p[3], 128 / 255.0, 1e-7); /* alpha has no curve */
    tsuya_image_free(&linear);
    image.encoding = TSUYA_ENCODING_DATA;
    assert_ok(tsuya_image_convert(&data, &image, TSUYA_SAMPLE_U16, TSUYA_ENCODING_LINEAR));
    assert_int_equal(tsuya_image_u16(&data, 0, 0)[1], 128 * 257);
    tsuya_image_free(&data);
    tsuya_image_free(&image);
    image = make(1, 1, 1, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR);
    static const float odd[] = {NAN, -1.0f, 2.0f, INFINITY, 0.5f / 255.0f, 0.49f / 255.0f};
    static const int rounded[] = {0, 0, 255, 255, 1, 0};
    for (int i = 0; i < 6; i++) {
        tsuya_image_f32(&image, 0, 0)[0] = odd[i];
        assert_ok(tsuya_image_convert(&data, &image, TSUYA_SAMPLE_U8, TSUYA_ENCODING_LINEAR));
        assert_int_equal(tsuya_image_u8(&data, 0, 0)[0], rounded[i]);
        tsuya_image_free(&data);
    }
    tsuya_image_free(&image);
}

static void test_grey(void **state)
{
    (void)state;
    tsuya_image image = make(2, 1, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB), grey;
    memcpy(image.data, (uint8_t[]){200, 200, 200, 255, 0, 0}, 6);
    assert_ok(tsuya_image_grey(&grey, &image, TSUYA_SAMPLE_U8));
    assert_int_equal(tsuya_image_u8(&grey, 0, 0)[0], 200);
    assert_int_equal(tsuya_image_u8(&grey, 1, 0)[0], 54); /* 0.2126 · 255 */
    assert_int_equal(grey.encoding, TSUYA_ENCODING_SRGB);
    tsuya_image_free(&grey);
    tsuya_image_free(&image);
}

/* A ramp in pixel coordinates keeps its values at the places x' + ½ = s (x + ½). */
static void test_resizing_keeps_pixel_centres(void **state)
{
    (void)state;
    tsuya_image ramp = make(60, 40, 1, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR), out;
    for (int y = 0; y < 40; y++) {
        for (int x = 0; x < 60; x++) {
            *tsuya_image_f32(&ramp, x, y) = (float)(2 * x + 3 * y);
        }
    }
    static const int sizes[][2] = {{30, 20}, {20, 10}, {60, 40}, {25, 17}, {59, 39}, {120, 80}, {97, 41}, {1, 1}};
    for (size_t i = 0; i < sizeof sizes / sizeof sizes[0]; i++) {
        int w = sizes[i][0], h = sizes[i][1];
        assert_ok(tsuya_image_resize(&out, &ramp, w, h));
        for (int y = 0; y < h; y++) {
            for (int x = 0; x < w; x++) {
                double fx = (x + 0.5) * 60 / w - 0.5, fy = (y + 0.5) * 40 / h - 0.5; /* enlarged edges are clamped */
                fx = fmin(fmax(fx, 0), 59), fy = fmin(fmax(fy, 0), 39);
                /* averages over parts of pixels lie beside their middle, by less than a quarter of a pixel */
                double tolerance = 60 % w == 0 && 40 % h == 0 ? 1e-3 : w > 60 ? 1e-3 : 0.25 * (2 + 3);
                assert_near(*tsuya_image_f32(&out, x, y), 2 * fx + 3 * fy, tolerance);
            }
        }
        tsuya_image_free(&out);
    }
    assert_fails(tsuya_image_resize(&out, &ramp, 0, 10), "0 x 10");
    tsuya_image_free(&ramp);
}

/* Reducing is averaging: the mean does not move, and no bright pixel is passed over. */
static void test_reducing_keeps_the_mean(void **state)
{
    (void)state;
    tsuya_image image = make(77, 53, 1, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR), out;
    double mean = 0, reduced = 0;
    for (int i = 0; i < 77 * 53; i++) {
        float value = (float)tsuya_random_uniform(1, 1, (uint64_t)i) * (i % 50 == 0 ? 100.0f : 1.0f);
        tsuya_image_f32(&image, 0, 0)[i] = value;
        mean += (double)value / (77 * 53);
    }
    assert_ok(tsuya_image_resize(&out, &image, 10, 9));
    for (int i = 0; i < 90; i++) {
        reduced += (double)tsuya_image_f32(&out, 0, 0)[i] / 90;
    }
    assert_near(reduced, mean, 1e-5);
    tsuya_image_free(&out);
    tsuya_image_free(&image);
}

static void test_bilinear(void **state)
{
    (void)state;
    tsuya_image image = make(2, 2, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB);
    memcpy(image.data, (uint8_t[]){0, 10, 0, 100, 10, 0, 200, 10, 0, 40, 10, 255}, 12);
    float v[3];
    tsuya_image_sample_bilinear(&image, 0.5, 0.5, v);
    assert_near(v[0] * 255.0f, 85, 1e-4);
    assert_near(v[1] * 255.0f, 10, 1e-4);
    assert_near(v[2] * 255.0f, 63.75, 1e-4);
    tsuya_image_sample_bilinear(&image, -5, 9, v); /* clamped to the corner */
    assert_near(v[0] * 255.0f, 200, 1e-4);
    assert_near(tsuya_image_get(&image, 1, 1, 2), 1, 0);
    tsuya_image_free(&image);
}

static tsuya_status change(void *user)
{
    tsuya_image a = {0}, b = {0}, c = {0}, d = {0};
    tsuya_status status;
    TSUYA_GOTO_DONE(status, tsuya_image_copy(&a, user));
    TSUYA_GOTO_DONE(status, tsuya_image_convert(&b, &a, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    TSUYA_GOTO_DONE(status, tsuya_image_grey(&c, &b, TSUYA_SAMPLE_U8));
    TSUYA_GOTO_DONE(status, tsuya_image_resize(&d, &c, 5, 5));
done:
    tsuya_image_free(&a);
    tsuya_image_free(&b);
    tsuya_image_free(&c);
    tsuya_image_free(&d);
    return status;
}

static void test_failing_memory(void **state)
{
    (void)state;
    tsuya_image image = make(8, 8, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB);
    assert_int_equal(test_every_allocation(change, &image), 11);
    tsuya_image_free(&image);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_sizes),
        cmocka_unit_test(test_srgb_curve),
        cmocka_unit_test(test_codes_survive),
        cmocka_unit_test(test_linear_and_encoded_differ_and_alpha_stays),
        cmocka_unit_test(test_grey),
        cmocka_unit_test(test_resizing_keeps_pixel_centres),
        cmocka_unit_test(test_reducing_keeps_the_mean),
        cmocka_unit_test(test_bilinear),
        cmocka_unit_test(test_failing_memory),
    };
    return cmocka_run_group_tests(tests, NULL, NULL);
}
