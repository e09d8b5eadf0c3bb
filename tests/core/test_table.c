/* CSV and vnlog tables, numbers, the nearest name. */
#include "failures.h"

#include "core/table.h"

static tsuya_table table;

static void parse_ok(const char *text, const tsuya_table_options *options)
{
    assert_ok(tsuya_table_parse(&table, text, "t.csv", options));
}

static void refuse(const char *text, const tsuya_table_options *options, const char *part)
{
    tsuya_table t;
    assert_fails(tsuya_table_parse(&t, text, "t.csv", options), part);
    assert_int_equal(strncmp(tsuya_reason(), "t.csv: ", 7), 0);
    assert_null(t.value);
}

static void test_columns_rows_and_keys(void **state)
{
    (void)state;
    static const char text[] = "\xef\xbb\xbf# quantity=brdf\n# light_theta_deg=30 light_phi_deg=0\n# a note = with blanks\n# prose\n"
                               " theta_i_deg , r\r\n\r\n 30 , 1e-3\r\n# clip = 4\n-.5,+2.5E2\r";
    parse_ok(text, NULL);
    assert_int_equal(table.column_count, 2);
    assert_string_equal(table.column[0], "theta_i_deg");
    assert_int_equal(table.row_count, 2);
    assert_near(tsuya_table_at(&table, 0, 1), 1e-3, 0.0);
    assert_near(tsuya_table_at(&table, 1, 0), -0.5, 0.0);
    assert_near(tsuya_table_at(&table, 1, tsuya_table_column(&table, "r")), 250.0, 0.0);
    assert_int_equal(table.line[0], 7);
    assert_int_equal(table.line[1], 9);
    assert_int_equal(tsuya_table_column(&table, "g"), -1);
    assert_string_equal(tsuya_table_key(&table, "quantity"), "brdf");
    assert_string_equal(tsuya_table_key(&table, "light_phi_deg"), "0");
    assert_string_equal(tsuya_table_key(&table, "a note"), "with blanks");
    assert_string_equal(tsuya_table_key(&table, "clip"), "4");
    assert_null(tsuya_table_key(&table, "prose"));
    tsuya_table_free(&table);
}

static void test_text_quotes_and_empty_cells(void **state)
{
    (void)state;
    static const char *const text_columns[] = {"name", NULL};
    tsuya_table_options options = {.text = text_columns, .allow_empty = true};
    parse_ok("name,x_px\n\" a, \"\"b\"\" \", 1\nplain,\n\"\"\"q\",2\n", &options);
    assert_string_equal(table.text[0], " a, \"b\" ");
    assert_string_equal(table.text[2], "plain");
    assert_string_equal(table.text[4], "\"q");
    assert_true(isnan(tsuya_table_at(&table, 0, 0)));
    assert_true(isnan(tsuya_table_at(&table, 1, 1)));
    assert_null(table.text[1]);
    tsuya_table_free(&table);
    options.allow_empty = false;
    refuse("name,x_px\na,\n", &options, "line 2: column x_px: \"\"; a finite number is expected");
    refuse("name,x_px\n\"a,1\n", &options, "line 2: a quoted cell");
    refuse("name,x_px\n\"a\"b,1\n", &options, "line 2: a quoted cell");
}

static bool is_wavelength(const char *name) { return strncmp(name, "nm", 2) == 0; }

static void test_names_are_checked(void **state)
{
    (void)state;
    static const char *const required[] = {"theta_i_deg", "r", NULL}, *const known[] = {"theta_i_deg", "phi_i_deg", "r", "g", "b", NULL};
    tsuya_table_options options = {.required = required, .known = known, .known_name = is_wavelength};
    parse_ok("r,theta_i_deg,nm390\n1,2,3\n", &options);
    tsuya_table_free(&table);
    refuse("r,theta_i\n", &options, "unknown column \"theta_i\"; did you mean \"theta_i_deg\"?");
    refuse("r,theta_i_rad\n", &options, "did you mean \"theta_i_deg\"?");
    refuse("r,phi_i_dgr,theta_i_deg\n", &options, "did you mean \"phi_i_deg\"?");
    refuse("r,temperature\n", &options, "unknown column \"temperature\"");
    refuse("theta_i_deg\n1\n", &options, "column \"r\" is missing");
    refuse("r,r\n", &options, "occurs twice");
    refuse("r,,theta_i_deg\n", &options, "has no name");
}

static void test_damage_is_named(void **state)
{
    (void)state;
    refuse("", NULL, "no header");
    refuse("# only=comments\n", NULL, "no header");
    refuse("a_m,b_m\n1,2\n1\n", NULL, "line 3: 1 cells, the header has 2 columns");
    refuse("a_m,b_m\n1,2,3\n", NULL, "line 2: 3 cells");
    static const char *const bad[] = {"nan", "NaN", "inf", "-inf", "1e999", "0x10", "1e5x", "1,5e", "1 2", "--1", "1e", "."};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        char text[64];
        snprintf(text, sizeof text, "a_m\n1\n\"%s\"\n", bad[i]);
        refuse(text, NULL, "line 3: column a_m");
    }
    char *wide = malloc(5000 * 2 + 1);
    for (int i = 0; i < 5000; i++) {
        memcpy(wide + 2 * i, "a,", 3);
    }
    refuse(wide, NULL, "more than 4096 columns");
    free(wide);
    test_write(test_path("nul.csv"), "a_m\n1\0\n", 7);
    assert_fails(tsuya_table_load(&table, test_path("nul.csv"), NULL), "NUL byte at 5");
    assert_fails(tsuya_table_load(&table, test_path("missing.csv"), NULL), "missing.csv: cannot read");
}

static void test_vnlog(void **state)
{
    (void)state;
    static const char *const text_columns[] = {"filename", NULL};
    tsuya_table_options options = {.vnlog = true, .text = text_columns, .allow_empty = true};
    parse_ok("#! generated\n## by hand, option=3\n#\n# filename tag_id  x_px\nIMG_1.jpg 3 1.5\n# note\nIMG_2.jpg - 2\n", &options);
    assert_int_equal(table.column_count, 3);
    assert_int_equal(table.row_count, 2);
    assert_string_equal(table.text[3], "IMG_2.jpg");
    assert_true(isnan(tsuya_table_at(&table, 1, 1)));
    tsuya_table_free(&table);
    refuse("IMG_1.jpg 3\n", &options, "a header \"# name name");
    refuse("# filename x_px\nIMG_1.jpg\n", &options, "line 2: 1 cells");
}

static void test_numbers(void **state)
{
    (void)state;
    double number = 0;
    long long whole = 0;
    assert_true(tsuya_parse_number(&number, "-1.25e2"));
    assert_near(number, -125.0, 0.0);
    static const char *const bad[] = {"", " 1", "1 ", "nan", "inf", "0x1p3", "1e5x", "1e400", "1,5"};
    for (size_t i = 0; i < sizeof bad / sizeof bad[0]; i++) {
        assert_false(tsuya_parse_number(&number, bad[i]));
    }
    assert_true(tsuya_parse_int(&whole, "-42"));
    assert_int_equal(whole, -42);
    static const char *const no_int[] = {"", " 1", "1 ", "1.0", "1e3", "0x10", "99999999999999999999", "x"};
    for (size_t i = 0; i < sizeof no_int / sizeof no_int[0]; i++) {
        assert_false(tsuya_parse_int(&whole, no_int[i]));
    }
}

static void test_nearest_name(void **state)
{
    (void)state;
    static const char *const names[] = {"render", "reconstruct", "run", "capture check", "theta_i_deg", NULL};
    assert_string_equal(tsuya_nearest_name("rnder", names), "render");
    assert_string_equal(tsuya_nearest_name("capture chek", names), "capture check");
    assert_string_equal(tsuya_nearest_name("theta_i", names), "theta_i_deg");
    assert_string_equal(tsuya_nearest_name("rum", names), "run");
    assert_null(tsuya_nearest_name("zzzzzz", names));
    assert_null(tsuya_nearest_name("t", names));
    char *overlong = malloc(10001);
    memset(overlong, 'r', 10000);
    overlong[10000] = '\0';
    (void)tsuya_nearest_name(overlong, names);
    free(overlong);
}

static const char *const ALL_TEXT[] = {"name", NULL};
static const tsuya_table_options MIXED = {.text = ALL_TEXT};

static tsuya_status load_mixed(const char *path)
{
    tsuya_table t;
    TSUYA_TRY(tsuya_table_load(&t, path, &MIXED));
    tsuya_table_free(&t);
    return TSUYA_OK;
}

static tsuya_status attempt(void *user) { return load_mixed(user); }

static void test_failing_memory_and_damaged_files(void **state)
{
    (void)state;
    FILE *file = fopen(test_path("good.csv"), "w");
    fputs("# quantity=brdf\n# a=1 b=2 c=3\nname,x_px,y_px\n", file);
    for (int i = 0; i < 100; i++) {
        fprintf(file, "\"photo %d\",%d.5,%g\n", i, i, 1.0 / (i + 1));
    }
    fclose(file);
    assert_true(test_every_allocation(attempt, (void *)(uintptr_t)test_path("good.csv")) > 100);
    test_damage(load_mixed, test_path("damaged.csv"), test_path("good.csv"), 0, 2000);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_columns_rows_and_keys), cmocka_unit_test(test_text_quotes_and_empty_cells),
        cmocka_unit_test(test_names_are_checked),     cmocka_unit_test(test_damage_is_named),
        cmocka_unit_test(test_vnlog),                 cmocka_unit_test(test_numbers),
        cmocka_unit_test(test_nearest_name),          cmocka_unit_test(test_failing_memory_and_damaged_files),
    };
    int result = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return result;
}
