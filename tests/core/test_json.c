/* JSON: reading with messages, building, the text that comes out, damage. */
#include "failures.h"

#include "core/json.h"

static tsuya_json *parse_ok(const char *text)
{
    tsuya_json *root;
    assert_ok(tsuya_json_parse(&root, text, "calib.json"));
    return root;
}

static void test_getters(void **state)
{
    (void)state;
    tsuya_json *root = parse_ok("{\"n\": -1.5e3, \"i\": 7, \"half\": 0.5, \"flag\": true, \"text\": \"\\u00e9\\n\", \"list\": [1, 2, 3], \"nothing\": null,"
                                " \"inner\": {\"a\": 1, \"b\": 2}}");
    double number, list[3];
    int whole;
    bool flag;
    const char *text;
    assert_ok(tsuya_json_get_number(&number, root, "n"));
    assert_near(number, -1500, 0);
    assert_ok(tsuya_json_get_int(&whole, root, "i"));
    assert_int_equal(whole, 7);
    assert_ok(tsuya_json_get_bool(&flag, root, "flag"));
    assert_true(flag);
    assert_ok(tsuya_json_get_text(&text, root, "text"));
    assert_string_equal(text, "\xc3\xa9\n");
    assert_ok(tsuya_json_get_numbers(list, 3, root, "list"));
    assert_near(list[2], 3, 0);
    const tsuya_json *inner = tsuya_json_member(root, "inner");
    assert_int_equal(tsuya_json_count(inner), 2);
    assert_string_equal(tsuya_json_key(tsuya_json_next(tsuya_json_first(inner))), "b");
    assert_null(tsuya_json_next(tsuya_json_next(tsuya_json_first(inner))));
    assert_null(tsuya_json_element(tsuya_json_member(root, "list"), 3));
    assert_null(tsuya_json_element(tsuya_json_member(root, "list"), -1));
    assert_null(tsuya_json_member(NULL, "x"));
    assert_true(tsuya_json_is_null(tsuya_json_member(root, "nothing")));
    assert_near(tsuya_json_number_or(tsuya_json_member(root, "text"), 3), 3, 0);
    assert_string_equal(tsuya_json_text_or(NULL, "-"), "-");
    assert_fails(tsuya_json_get_number(&number, root, "missing"), "calib.json: missing: expected a number and is missing");
    assert_fails(tsuya_json_get_number(&number, root, "text"), "calib.json: text: expected a number");
    assert_fails(tsuya_json_get_int(&whole, root, "half"), "half: expected a whole number");
    assert_fails(tsuya_json_get_bool(&flag, root, "i"), "i: expected true or false");
    assert_fails(tsuya_json_get_text(&text, root, "i"), "i: expected a text");
    assert_fails(tsuya_json_get_numbers(list, 2, root, "list"), "list: expected an array of 2 numbers");
    assert_fails(tsuya_json_get_number(&number, inner, "c"), "inner: c: expected a number");
    tsuya_json_free(root);
}

static void test_refusals(void **state)
{
    (void)state;
    tsuya_json *root;
    static const char *const bad[] = {"", "{", "{\"a\": 1,}", "[1 2]", "{\"a\": 1} x", "{\"a\": nan}", "{'a': 1}", "\"text\"", "3", "{\"a\": \"\\ud800\"}"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        assert_fails(tsuya_json_parse(&root, bad[i], "bad.json"), "bad.json: ");
        assert_null(root);
    }
    assert_fails(tsuya_json_parse(&root, "{\n\n\"a\": }", "bad.json"), "line 3");
    char *deep = malloc(200001);
    memset(deep, '[', 200000);
    deep[200000] = '\0';
    assert_fails(tsuya_json_parse(&root, deep, "deep.json"), "nested 200000 deep, at most 200");
    free(deep);
    root = parse_ok("[\"[[[[\\\"[[[\"]");
    tsuya_json_free(root);
    test_write(test_path("nul.json"), "{}\0{}", 5);
    assert_fails(tsuya_json_load(&root, test_path("nul.json")), "nul.json: not JSON: a NUL byte at 2");
}

static void test_written_text_reads_back_the_same(void **state)
{
    (void)state;
    tsuya_json *root = tsuya_json_create_object();
    const double values[] = {0.1, 1.0 / 3.0, 1e300, 5e-324, -0.0, 123456789012345678.0, 2.5};
    tsuya_json_set_numbers(root, "values", values, 7);
    tsuya_json_set_number(root, "nan", NAN);
    tsuya_json_set_number(root, "infinity", INFINITY);
    tsuya_json_set_text(root, "text", "quote \" backslash \\ tab \t bell \x07 \xe8\x89\xb6");
    tsuya_json_set_text(root, "none", NULL);
    tsuya_json_set_bool(root, "flag", true);
    tsuya_json_set_number(root, "again", 1);
    tsuya_json_set_text(root, "again", "replaced, in its place");
    tsuya_json *inner = tsuya_json_set_object(root, "inner"), *array = tsuya_json_set_array(inner, "list");
    tsuya_json_set_bool(tsuya_json_add_object(array), "x", false);
    tsuya_json_add_number(tsuya_json_add_array(array), 1);
    tsuya_json_set_number(root, "gone", 1);
    tsuya_json_remove(root, "gone");
    assert_ok(tsuya_json_save(root, test_path("out.json")));
    tsuya_json *back;
    double read[7];
    assert_ok(tsuya_json_load(&back, test_path("out.json")));
    assert_ok(tsuya_json_get_numbers(read, 7, back, "values"));
    assert_memory_equal(read, values, sizeof values);
    assert_true(tsuya_json_is_null(tsuya_json_member(back, "nan")) && tsuya_json_is_null(tsuya_json_member(back, "infinity")));
    assert_string_equal(tsuya_json_text_or(tsuya_json_member(back, "text"), ""), "quote \" backslash \\ tab \t bell \x07 \xe8\x89\xb6");
    assert_string_equal(tsuya_json_text_or(tsuya_json_member(back, "again"), ""), "replaced, in its place");
    assert_null(tsuya_json_member(back, "gone"));
    char *first, *second;
    assert_ok(tsuya_json_print(&first, root));
    assert_ok(tsuya_json_print(&second, back));
    assert_string_equal(first, second);
    assert_non_null(strstr(first, "0.1,"));
    assert_null(strstr(first, "0.10000"));
    assert_int_equal(first[strlen(first) - 1], '\n');
    tsuya_free(first);
    tsuya_free(second);
    tsuya_json_free(root);
    tsuya_json_free(back);
}

static tsuya_status build(void *user)
{
    (void)user;
    char *text = NULL;
    tsuya_json *root = tsuya_json_create_object();
    tsuya_json *inner = tsuya_json_set_object(root, "inner"), *list = tsuya_json_set_array(inner, "list");
    tsuya_json_add_text(list, "a");
    tsuya_json_add_number(list, 1);
    tsuya_json_set_numbers(root, "numbers", (const double[]){1, 2}, 2);
    tsuya_json_set_text(root, "inner2", "text");
    tsuya_json_set_copy(root, "copy", inner);
    tsuya_json_set_number(tsuya_json_add_object(list), "deep", 1);
    tsuya_status status = tsuya_json_print(&text, root);
    tsuya_free(text);
    tsuya_json_free(root);
    return status;
}

static tsuya_status load(const char *path)
{
    tsuya_json *root;
    TSUYA_TRY(tsuya_json_load(&root, path));
    char *text;
    tsuya_status status = tsuya_json_print(&text, root);
    tsuya_free(text);
    tsuya_json_free(root);
    return status;
}
static tsuya_status load_attempt(void *user) { return load(user); }

static void test_failing_memory_and_damaged_files(void **state)
{
    (void)state;
    assert_true(test_every_allocation(build, NULL) > 20);
    static const char text[] = "{\"format\": \"tsuya material\", \"version\": \"1.0\", \"channels\": [\"r\", \"g\", \"b\"], \"x\": {\"y\": [1.5, -2e-3, [[]], "
                               "{\"z\": null, \"w\": true}]}, \"escape\": \"\\u00e9\\ud83d\\ude00\\\\\\\"\"}";
    test_write(test_path("good.json"), text, sizeof text - 1);
    assert_true(test_every_allocation(load_attempt, (void *)(uintptr_t)test_path("good.json")) > 20);
    test_damage(load, test_path("damaged.json"), test_path("good.json"), sizeof text - 1, 3000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_getters),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_written_text_reads_back_the_same),
        cmocka_unit_test(test_failing_memory_and_damaged_files),
    };
    int result = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return result;
}
