/* A printed board, rendered back at 300 dpi by poppler, is found with the geometry that its board.yaml says. */
#include "support.h"

#include "calib/detect.h"
#include "capture/target.h"
#include "core/process.h"

static const double DOTS = 300.0 / 25.4;

static void round_trip(tsuya_target_options o, int tags)
{
    tsuya_board board;
    tsuya_image image;
    tsuya_corner_set corners;
    tsuya_detect_report report;
    char command[3 * TEST_PATH];
    const char *name = "page.png";
    assert_ok(tsuya_target_save(test_path("page.pdf"), test_path("board.yaml"), &o));
    snprintf(command, sizeof command, "pdftoppm -r 300 -png -singlefile '%s' '%s'", test_path("page.pdf"), test_path("page"));
    assert_int_equal(system(command), 0);
    assert_ok(tsuya_board_load(&board, test_path("board.yaml")));
    assert_ok(tsuya_image_load(&image, test_path(name)));
    tsuya_target_page page = tsuya_target_page_of(&o);
    assert_near(image.width_px, page.width_mm * DOTS, 1.01);
    assert_near(image.height_px, page.height_mm * DOTS, 1.01);
    assert_ok(tsuya_corner_set_create(&corners, &name, 1));
    assert_ok(tsuya_detect_image(&corners, &report, &board, &image, 0, &(tsuya_edge_look){1.0, 0.0}));
    double worst = 0.0;
    for (int i = 0; i < corners.count; i++) {
        const tsuya_corner *c = &corners.corner[i];
        tsuya_vec2 at = board.tag[tsuya_board_find(&board, c->tag_id)].corner_m[c->corner];
        double x = (page.left_mm + 1e3 * at.x) * DOTS - 0.5, y = (page.height_mm - page.bottom_mm - 1e3 * at.y) * DOTS - 0.5;
        worst = fmax(worst, hypot(c->x_px - x, c->y_px - y));
    }
    printf("kind %d, %s, border %d: %d tags, %d corners, worst %.3f px (%.4f mm)\n", (int)o.kind, o.family, o.border_bits, report.tags, corners.count, worst, worst / DOTS);
    assert_int_equal(tsuya_target_tags(NULL, 0, &o), tags);
    assert_int_equal(report.tags, tags);
    assert_int_equal(corners.count, 4 * tags);
    assert_true(worst <= 0.6); /* 0.05 mm */
    tsuya_image_free(&image);
    tsuya_corner_set_free(&corners);
    tsuya_board_free(&board);
}

static tsuya_target_options grid(const char *family, int border_bits, double gap_mm)
{
    tsuya_target_options o = tsuya_target_options_default();
    o.family = family;
    o.border_bits = border_bits;
    o.cols = 4;
    o.rows = 3;
    o.first_id = 5;
    o.tag_mm = 20;
    o.gap_mm = gap_mm;
    return o;
}

static void test_families(void **state)
{
    (void)state;
    if (!tsuya_process_available("pdftoppm")) {
        skip();
    }
    round_trip(grid("tag36h11", 1, 6), 12);
    round_trip(grid("tag36h11", 2, 6), 12);
    round_trip(grid("tag25h9", 1, 8), 12);
    round_trip(grid("tagStandard41h12", 1, 24), 12);
}

/* A mat's origin is its axis: the ring's tags are all as far from it; a bar's end tags are as far apart as it says. */
static void test_mat_and_bar(void **state)
{
    (void)state;
    tsuya_target_tag tag[64];
    tsuya_target_options mat = tsuya_target_options_of(TSUYA_TARGET_MAT), bar = tsuya_target_options_of(TSUYA_TARGET_BAR);
    int tags = tsuya_target_tags(tag, 64, &mat);
    assert_true(tags >= 8 && tags <= 64);
    for (int i = 0; i < tags; i++) {
        assert_near(hypot(tag[i].x_mm, tag[i].y_mm), hypot(tag[0].x_mm, tag[0].y_mm), 1e-9);
        assert_true(hypot(tag[i].x_mm, tag[i].y_mm) + 9 * M_SQRT2 < 95.0);
        for (int k = 0; k < i; k++) {
            assert_true(fmax(fabs(tag[i].x_mm - tag[k].x_mm), fabs(tag[i].y_mm - tag[k].y_mm)) >= 24.0 - 1e-9);
        }
    }
    assert_int_equal(tsuya_target_tags(tag, 64, &bar), 4);
    assert_near(tag[3].x_mm - tag[0].x_mm, 240.0, 1e-12);
    mat.size_mm = 60;
    assert_fails(tsuya_target_save(test_path("bad.pdf"), test_path("bad.yaml"), &mat), "too small");
    bar.size_mm = 70;
    assert_fails(tsuya_target_save(test_path("bad.pdf"), test_path("bad.yaml"), &bar), "too small");
    if (!tsuya_process_available("pdftoppm")) {
        skip();
    }
    mat.size_mm = 190;
    mat.first_id = 40;
    round_trip(mat, tags);
    mat.family = "tag25h9";
    mat.first_id = 0;
    mat.border_bits = 2;
    round_trip(mat, tags);
    bar.size_mm = 240;
    round_trip(bar, 4);
    bar.family = "tagStandard41h12";
    bar.gap_mm = 20;
    round_trip(bar, 4);
}

static void test_refused(void **state)
{
    (void)state;
    tsuya_target_options o = tsuya_target_options_default();
    o.gap_mm = 1;
    assert_fails(tsuya_target_save(test_path("bad.pdf"), test_path("bad.yaml"), &o), "gap of 1 mm");
    o = tsuya_target_options_default();
    o.first_id = 580;
    assert_fails(tsuya_target_save(test_path("bad.pdf"), test_path("bad.yaml"), &o), "has the ids");
    assert_false(tsuya_path_exists(test_path("bad.pdf")));
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_families), cmocka_unit_test(test_mat_and_bar), cmocka_unit_test(test_refused)};
    int failed = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return failed;
}
