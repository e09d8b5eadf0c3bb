/* YAML by a schema: every kind of value, what is absent, what is refused and with which words. */
#include "failures.h"

#include "core/yaml.h"

#include <limits.h>

typedef struct item { const char *name; double tag_mm; } item;
typedef struct record {
    const char *name;
    double gap_mm;
    int cols;
    bool flag, has_camera;
    struct { const char *board; int first; } camera;
    tsuya_yaml_list items, numbers, texts, pairs;
} record;

#define AT(member) offsetof(record, member)
static const tsuya_yaml_field camera_fields[] = {
    {.key = "board", .kind = TSUYA_YAML_TEXT, .offset = 0},
    {.key = "first", .kind = TSUYA_YAML_INT, .offset = sizeof(const char *)},
    {0},
};
static const tsuya_yaml_field item_fields[] = {
    {.key = "name", .kind = TSUYA_YAML_TEXT, .offset = offsetof(item, name), .required = true},
    {.key = "tag_mm", .kind = TSUYA_YAML_NUMBER, .offset = offsetof(item, tag_mm)},
    {0},
};
static const tsuya_yaml_field fields[] = {
    {.key = "name", .kind = TSUYA_YAML_TEXT, .offset = AT(name), .required = true},
    {.key = "gap_mm", .kind = TSUYA_YAML_NUMBER, .offset = AT(gap_mm)},
    {.key = "cols", .kind = TSUYA_YAML_INT, .offset = AT(cols)},
    {.key = "flag", .kind = TSUYA_YAML_BOOL, .offset = AT(flag)},
    {.key = "camera", .kind = TSUYA_YAML_RECORD, .offset = AT(camera), .fields = camera_fields, .size = sizeof(((record *)0)->camera), .presence_offset = AT(has_camera)},
    {.key = "items", .kind = TSUYA_YAML_RECORDS, .offset = AT(items), .fields = item_fields, .size = sizeof(item)},
    {.key = "numbers", .kind = TSUYA_YAML_NUMBERS, .offset = AT(numbers)},
    {.key = "texts", .kind = TSUYA_YAML_TEXTS, .offset = AT(texts)},
    {.key = "pairs", .kind = TSUYA_YAML_TEXT_LISTS, .offset = AT(pairs)},
    {0},
};

static tsuya_arena *arena;
static record r;

static tsuya_status parse(const char *text) { return tsuya_yaml_parse(&r, sizeof r, fields, text, "JOB.yaml", arena); }
static void refuse(const char *text, const char *part) { assert_fails(parse(text), part); }

static void test_every_kind(void **state)
{
    (void)state;
    assert_ok(parse("# a job\nname: \"karaori #12\"\ngap_mm: -1.5e1\ncols: 6\nflag: true\ncamera: {board: b.yaml}\n"
                    "items:\n  - {name: a, tag_mm: 88}\n  - name: b\nnumbers: [1, 2.5]\ntexts: [x, '1']\npairs: [[a, 1], [], [c]]\n"));
    assert_string_equal(r.name, "karaori #12");
    assert_near(r.gap_mm, -15, 0);
    assert_int_equal(r.cols, 6);
    assert_true(r.flag && r.has_camera);
    assert_string_equal(r.camera.board, "b.yaml");
    assert_int_equal(r.camera.first, INT_MIN);
    const item *items = r.items.item;
    assert_int_equal(r.items.count, 2);
    assert_near(items[0].tag_mm, 88, 0);
    assert_string_equal(items[1].name, "b");
    assert_true(isnan(items[1].tag_mm));
    assert_near(((const double *)r.numbers.item)[1], 2.5, 0);
    assert_string_equal(((const char *const *)r.texts.item)[1], "1");
    const tsuya_yaml_list *pairs = r.pairs.item;
    assert_int_equal(r.pairs.count, 3);
    assert_int_equal(pairs[1].count, 0);
    assert_string_equal(((const char *const *)pairs[0].item)[1], "1");
}

static void test_what_is_absent(void **state)
{
    (void)state;
    memset(&r, 0x55, sizeof r);
    assert_ok(parse("name: x"));
    assert_true(isnan(r.gap_mm) && r.cols == INT_MIN && !r.flag && !r.has_camera && !r.camera.board && r.camera.first == INT_MIN);
    assert_true(!r.items.item && r.items.count == 0 && !r.pairs.item);
}

static void test_refusals(void **state)
{
    (void)state;
    refuse("name: x\nclos: 3\n", "JOB.yaml: line 2: unknown key \"clos\"; did you mean \"cols\"?");
    refuse("name: x\ncamera: {bord: y}\n", "line 2: unknown key \"bord\"; did you mean \"board\"?");
    refuse("name: x\nitems: [{name: a}, {nmae: b}]\n", "did you mean \"name\"?");
    refuse("name: x\nzzzzzz: 3\n", "unknown key \"zzzzzz\"");
    refuse("cols: 3\n", "line 1: key \"name\" is missing");
    refuse("name: x\nitems:\n  - {tag_mm: 3}\n", "line 3: key \"name\" is missing");
    refuse("name: x\nname: y\n", "line 2: key \"name\" occurs twice");
    refuse("name: x\ncols: 2.5\n", "line 2: cols: a whole number is expected, not \"2.5\"");
    refuse("name: x\ncols: 99999999999\n", "a whole number is expected");
    refuse("name: x\ngap_mm: wide\n", "gap_mm: a number is expected, not \"wide\"");
    refuse("name: x\ngap_mm: .nan\n", "a number is expected");
    refuse("name: x\ngap_mm: .inf\n", "a number is expected");
    refuse("name: x\nflag: yes\n", "flag: true or false is expected, not \"yes\"");
    refuse("name: [x]\n", "name: a text is expected, not \"a list\"");
    refuse("name: x\nnumbers: 3\n", "numbers: a list is expected");
    refuse("name: x\nnumbers: [1, [2]]\n", "a number is expected, not \"a list\"");
    refuse("name: x\ncamera: y\n", "a mapping of keys is expected");
    refuse("name: x\nitems: {name: a}\n", "items: a list is expected, not \"a mapping\"");
    refuse("- name: x\n", "a mapping of keys is expected");
    refuse("", "empty");
    refuse("name: [x\n", "not YAML");
    refuse("name: x\n\tcols: 3\n", "not YAML");
    refuse("name: \"a\\0b\"\n", "without NUL bytes");
    refuse("name: &a x\ntexts: [*a]\n", "line 1: an anchor (&a)");
    refuse("name: x\n---\nname: y\n", "line 2: a second document");
    char *deep = malloc(100001);
    memset(deep, '[', 100000);
    deep[100000] = '\0';
    refuse(deep, "line 1: nested more than 64 deep");
    free(deep);
}

static tsuya_status load(const char *path)
{
    tsuya_arena *own;
    record any;
    TSUYA_TRY(tsuya_arena_create(&own, 1024));
    tsuya_status status = tsuya_yaml_load(&any, sizeof any, fields, path, own);
    tsuya_arena_free(own);
    return status;
}
static tsuya_status load_attempt(void *user) { return load(user); }

static void test_failing_memory_and_damaged_files(void **state)
{
    (void)state;
    static const char text[] = "name: \"karaori #12\"\ngap_mm: -1.5e1\ncols: 6\nflag: true\ncamera: {board: b.yaml, first: 3}\n"
                               "items:\n  - {name: a, tag_mm: 88}\n  - name: b\nnumbers: [1, 2.5]\ntexts: [x, '1']\npairs: [[a, 1], [], [c]]\n";
    test_write(test_path("good.yaml"), text, sizeof text - 1);
    assert_true(test_every_allocation(load_attempt, (void *)(uintptr_t)test_path("good.yaml")) > 3);
    test_damage(load, test_path("damaged.yaml"), test_path("good.yaml"), 0, 3000);
    FILE *file = fopen(test_path("large.yaml"), "w");
    assert_int_equal(ftruncate(fileno(file), (16 << 20) + 1), 0);
    fclose(file);
    assert_fails(load(test_path("large.yaml")), "at most 16777216 are accepted");
}

static int begin(void **state)
{
    (void)state;
    return tsuya_arena_create(&arena, 1 << 14) == TSUYA_OK ? 0 : -1;
}
static int end(void **state)
{
    (void)state;
    tsuya_arena_free(arena);
    return 0;
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_every_kind),
        cmocka_unit_test(test_what_is_absent),
        cmocka_unit_test(test_refusals),
        cmocka_unit_test(test_failing_memory_and_damaged_files),
    };
    int result = cmocka_run_group_tests(tests, begin, end);
    test_folder_remove();
    return result;
}
