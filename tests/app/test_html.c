/* The HTML writer: nothing from outside becomes markup, pictures come back as they went in. */
#include "support.h"

#include "app/html.h"

static char *written(const char *path)
{
    char *bytes;
    size_t size;
    assert_ok(tsuya_file_load(&bytes, &size, path, 1 << 20));
    return bytes;
}

static void test_text_is_escaped(void **state)
{
    (void)state;
    const char *path = test_path("escape.html");
    tsuya_html html;
    assert_ok(tsuya_html_begin(&html, path, test_folder()));
    tsuya_html_text(&html, "<script>alert(\"x\" & 'y')</script>");
    tsuya_html_raw(&html, "|");
    tsuya_html_text(&html, "\xE8\x89\xB6 \xC3\xA9 \xF0\x9F\x98\x80");
    tsuya_html_raw(&html, "|");
    tsuya_html_text(&html, "a\x01z \xFF\xC0\x80 \xED\xA0\x80 \xE8\x89");
    assert_ok(tsuya_html_commit(&html));
    char *text = written(path);
    assert_string_equal(text, "&lt;script&gt;alert(&quot;x&quot; &amp; &#39;y&#39;)&lt;/script&gt;|"
                              "\xE8\x89\xB6 \xC3\xA9 \xF0\x9F\x98\x80|a?z ??? ??? ??");
    tsuya_free(text);
}

static void test_base64_vectors(void **state)
{
    (void)state;
    /* RFC 4648, section 10 */
    static const char *const vector[][2] = {{"", ""},         {"f", "Zg=="},         {"fo", "Zm8="},        {"foo", "Zm9v"},
                                            {"foob", "Zm9vYg=="}, {"fooba", "Zm9vYmE="}, {"foobar", "Zm9vYmFy"}};
    for (size_t i = 0; i < sizeof vector / sizeof vector[0]; i++) {
        char *text;
        assert_ok(tsuya_base64(&text, vector[i][0], strlen(vector[i][0])));
        assert_string_equal(text, vector[i][1]);
        tsuya_free(text);
    }
}

static void test_picture_is_embedded_and_counted(void **state)
{
    (void)state;
    const char *path = test_path("picture.html");
    tsuya_image image;
    tsuya_html html;
    assert_ok(tsuya_image_create(&image, 3, 2, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    assert_ok(tsuya_html_begin(&html, path, test_folder()));
    tsuya_html_picture(&html, &image, true, "photo", "a \"b\"", "<c>");
    assert_int_equal(html.picture_count, 1);
    assert_ok(tsuya_html_commit(&html));
    char *text = written(path);
    assert_non_null(strstr(text, "alt=\"a &quot;b&quot;\""));
    assert_non_null(strstr(text, "&lt;c&gt;"));
    assert_non_null(strstr(text, "src=\"data:image/png;base64,iVBORw0KGgo"));
    assert_false(tsuya_path_exists(test_path(".picture.png")));
    tsuya_free(text);
    tsuya_image_free(&image);
}

static void test_failure_leaves_no_file(void **state)
{
    (void)state;
    const char *path = test_path("failed.html");
    tsuya_html html;
    tsuya_image empty = {0};
    assert_ok(tsuya_html_begin(&html, path, test_folder()));
    tsuya_html_raw(&html, "x");
    tsuya_html_picture(&html, &empty, true, "photo", "", NULL);
    assert_int_not_equal(tsuya_html_commit(&html), TSUYA_OK);
    assert_false(tsuya_path_exists(path));
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_text_is_escaped),
        cmocka_unit_test(test_base64_vectors),
        cmocka_unit_test(test_picture_is_embedded_and_counted),
        cmocka_unit_test(test_failure_leaves_no_file),
    };
    int result = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return result;
}
