/* board.yaml in its three forms, and what is refused; corners there and back. */
#include "support.h"

#include "calib/board.h"
#include "calib/corners.h"
#include "core/memory.h"

static void test_grid(void **state)
{
    (void)state;
    tsuya_board b;
    assert_ok(tsuya_board_parse(&b, "{family: tag36h11, border_bits: 1, cols: 3, rows: 2, tag_mm: 20, gap_mm: 5, first_id: 10}", "b"));
    assert_int_equal(b.tag_count, 6);
    assert_int_equal(tsuya_board_find(&b, 13), 3);
    assert_int_equal(tsuya_board_find(&b, 16), -1);
    assert_int_equal(tsuya_board_find(&b, 9), -1);
    /* Ids run along +x, then +y; corner 0 is the lower left, corner 2 opposite. */
    tsuya_vec3 c = tsuya_board_corner(&b, 4, 2);
    assert_true(fabs(c.x - 0.045) < 1e-12 && fabs(c.y - 0.045) < 1e-12 && c.z == 0.0);
    tsuya_board_free(&b);
}

static void test_listed(void **state)
{
    (void)state;
    tsuya_board b;
    assert_ok(tsuya_board_parse(&b, "family: tag25h9\nboards:\n- name: a\n  tags:\n  - {id: 3, x_mm: 10, y_mm: -5, size_mm: 4}\n"
                                    "- {name: bar, cols: 2, rows: 1, tag_mm: 10, gap_mm: 90, first_id: 7}\n", "b"));
    assert_int_equal(b.plate_count, 2);
    assert_int_equal(b.tag_count, 3);
    assert_int_equal(tsuya_board_find(&b, 8), 2);
    tsuya_vec3 c = tsuya_board_corner(&b, 0, 0);
    assert_true(fabs(c.x - 0.008) < 1e-12 && fabs(c.y + 0.007) < 1e-12);
    assert_string_equal(b.plate[1].name, "bar");
    tsuya_board_free(&b);
}

static void test_kalibr(void **state)
{
    (void)state;
    tsuya_board b;
    assert_ok(tsuya_board_parse(&b, "target_type: 'aprilgrid'\ntagCols: 6\ntagRows: 6\ntagSize: 0.088\ntagSpacing: 0.3\n", "k"));
    assert_int_equal(b.border_bits, 2);
    assert_int_equal(b.tag_count, 36);
    assert_true(fabs(tsuya_board_corner(&b, 7, 0).x - 0.1144) < 1e-12);
    tsuya_board_free(&b);
}

static void test_refused(void **state)
{
    (void)state;
    tsuya_board b;
    assert_fails(tsuya_board_parse(&b, "{family: tag36h12, cols: 1, rows: 1, tag_mm: 1, gap_mm: 0}", "b"), "tag36h11");
    assert_fails(tsuya_board_parse(&b, "{family: tag36h11, cols: 1, rows: 1, tag_mm: 0, gap_mm: 0}", "b"), "tag_mm");
    assert_fails(tsuya_board_parse(&b, "{family: tag36h11, cols: 0, rows: 1, tag_mm: 1, gap_mm: 0}", "b"), "cols");
    assert_fails(tsuya_board_parse(&b, "{family: tag36h11, colls: 1, rows: 1, tag_mm: 1, gap_mm: 0}", "b"), "cols");
    assert_fails(tsuya_board_parse(&b, "{family: tag36h11, border_bits: 3, cols: 1, rows: 1, tag_mm: 1, gap_mm: 0}", "b"), "1 or 2");
    assert_fails(tsuya_board_parse(&b, "{family: tagStandard41h12, border_bits: 2, cols: 1, rows: 1, tag_mm: 1, gap_mm: 0}", "b"), "border of 1");
    assert_fails(tsuya_board_parse(&b, "{family: tag36h11, cols: 1, rows: 1, tag_mm: 1}", "b"), "gap_mm");
    assert_fails(tsuya_board_parse(&b, "{family: tag36h11}", "b"), "cols");
    assert_fails(tsuya_board_parse(&b, "{cols: 1, rows: 1, tag_mm: 1, gap_mm: 0}", "b"), "family");
    assert_fails(tsuya_board_parse(&b, "{family: tag36h11, cols: 99999, rows: 99999, tag_mm: 1, gap_mm: 0}", "b"), "100000");
    assert_fails(tsuya_board_parse(&b, "family: tag36h11\nboards:\n- tags:\n  - {id: 3, x_mm: 1, y_mm: 1, size_mm: 1}\n  - {id: 3, x_mm: 9, y_mm: 1, size_mm: 1}\n", "b"),
                 "twice");
    assert_fails(tsuya_board_parse(&b, "family: tag36h11\nboards:\n- tags:\n  - {id: 3, x_mm: 1, y_mm: 1, size_mm: -1}\n", "b"), "size_mm");
    assert_fails(tsuya_board_parse(&b, "target_type: checkerboard\n", "b"), "aprilgrid");
    assert_fails(tsuya_board_load(&b, "/nowhere/board.yaml"), "/nowhere/board.yaml");
}

static void test_memory(void **state)
{
    (void)state;
    const char *text = "{family: tag36h11, cols: 3, rows: 2, tag_mm: 20, gap_mm: 5}";
    tsuya_board b;
    for (uint64_t n = 1;; n++) {
        tsuya_memory_fail_at(n);
        tsuya_status status = tsuya_board_parse(&b, text, "b");
        uint64_t made = tsuya_memory_fail_at(0);
        if (status == TSUYA_OK) {
            tsuya_board_free(&b);
            assert_true(made < n);
            break;
        }
        assert_int_equal(status, TSUYA_ERROR_MEMORY);
    }
}

static void write_text(const char *path, const char *text) { assert_ok(tsuya_file_write(path, text, strlen(text))); }

static void test_corners(void **state)
{
    (void)state;
    const char *names[] = {"b.jpg", "a.jpg"};
    tsuya_corner_set s, back;
    assert_ok(tsuya_corner_set_create(&s, names, 2));
    assert_string_equal(s.photo[0], "a.jpg");
    assert_ok(tsuya_corner_set_add(&s, (tsuya_corner){.photo = 1, .tag_id = 5, .corner = 2, .x_px = 10.25, .y_px = 20.5, .sigma_px = 0.0625}));
    assert_ok(tsuya_corner_set_add(&s, (tsuya_corner){.photo = 0, .tag_id = 9, .corner = 0, .x_px = 1, .y_px = 2, .sigma_px = 0.5}));
    tsuya_corner_set_sort(&s);
    const char *path = test_path("corners.vnl");
    assert_ok(tsuya_corner_set_save(&s, path));
    assert_ok(tsuya_corner_set_load(&back, path, 100, 100));
    assert_int_equal(back.count, 2);
    assert_string_equal(back.photo[back.corner[1].photo], "b.jpg");
    assert_true(back.corner[1].x_px == 10.25 && back.corner[1].sigma_px == 0.0625 && back.corner[1].corner == 2);
    tsuya_corner_set_free(&back);
    assert_fails(tsuya_corner_set_load(&back, path, 5, 5), "outside");
    write_text(path, "# filename tag_id corner x_px y_px sigma_px\na 1 4 1 1 1\n");
    assert_fails(tsuya_corner_set_load(&back, path, 0, 0), "0, 1, 2 or 3");
    write_text(path, "# filename tag_id corner x_px y_px sigma_px\na 1 0 1 1 0\n");
    assert_fails(tsuya_corner_set_load(&back, path, 0, 0), "sigma_px");
    write_text(path, "# filename tag_id corner x_px y_px sigma_px\na 1 0 1 1 1\na 1 0 2 1 1\n");
    assert_fails(tsuya_corner_set_load(&back, path, 0, 0), "twice");
    write_text(path, "# filename tag_id corner x_px y_px\na 1 0 1 1\n");
    assert_fails(tsuya_corner_set_load(&back, path, 0, 0), "sigma_px");
    write_text(path, "# filename tag_id corner x_px y_px sigma_px\n");
    assert_fails(tsuya_corner_set_load(&back, path, 0, 0), "no corners");
    tsuya_corner_set_free(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_grid), cmocka_unit_test(test_listed), cmocka_unit_test(test_kalibr),
                                       cmocka_unit_test(test_refused), cmocka_unit_test(test_memory), cmocka_unit_test(test_corners)};
    return cmocka_run_group_tests(tests, NULL, test_folder_tear_down);
}
