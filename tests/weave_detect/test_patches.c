/* The patches of a photograph: where they stand, what the table holds, what is refused. */
#include "support.h"

#include "core/context.h"
#include "core/table.h"
#include "weave_detect/detector.h"
#include "weave_detect/label.h"
#include "weave_detect/patches.h"

#include <math.h>

/* Two crossed gratings at 20° and 110°, periods 6 and 8 px, under some noise: the detector's confidence was learnt on photographs, which have it. */
static void draw_gratings(tsuya_image *image, int width, int height)
{
    assert_ok(tsuya_image_create(image, width, height, 1, TSUYA_SAMPLE_F32, TSUYA_ENCODING_SRGB));
    double a = 20.0 * M_PI / 180.0;
    for (int y = 0; y < height; y++) {
        for (int x = 0; x < width; x++) {
            double across = -sin(a) * x - cos(a) * y, along = cos(a) * x - sin(a) * y;
            double ridge = 0.5 * cos(2.0 * M_PI * across / 6.0) + 0.4 * cos(2.0 * M_PI * along / 8.0);
            *tsuya_image_f32(image, x, y) = (float)(0.3 + 0.2 * ridge + 0.05 * tsuya_random_normal(1, 1, (uint64_t)(y * width + x)));
        }
    }
}

static void detect(tsuya_patch_grid *grid, const tsuya_image *image, const tsuya_image *mask, int threads)
{
    tsuya_patch_options options = tsuya_patch_options_default();
    tsuya_context context = tsuya_context_default();
    context.threads = threads;
    assert_ok(tsuya_patches_detect(grid, image, mask, &options, &context));
}

static void test_one_patch_of_a_small_image(void **state)
{
    (void)state;
    tsuya_image image;
    tsuya_patch_grid grid;
    draw_gratings(&image, 64, 64);
    detect(&grid, &image, NULL, 1);
    assert_int_equal(tsuya_patch_count(&grid), 1);
    const tsuya_threads *t = &grid.patch[0].threads;
    assert_float_equal(grid.patch[0].x_px, 31.5, 0.0);
    assert_true(t->a.seen && t->b.seen);
    assert_int_equal(grid.weft_told, TSUYA_WEFT_COUNT); /* the coarser threads, though the finer are nearer to the horizontal */
    assert_true(tsuya_line_difference(t->a.angle_rad, 110.0 * M_PI / 180.0) < 0.01);
    assert_true(tsuya_line_difference(t->b.angle_rad, 20.0 * M_PI / 180.0) < 0.01);
    assert_float_equal(t->a.period_px, 8.0, 0.08);
    assert_float_equal(t->b.period_px, 6.0, 0.05);
    tsuya_patches_free(&grid);
    tsuya_image_free(&image);
}

static void test_the_user_names_the_weft(void **state)
{
    (void)state;
    tsuya_image image;
    tsuya_patch_grid grid;
    tsuya_patch_options options = tsuya_patch_options_default();
    tsuya_context context = tsuya_context_default();
    draw_gratings(&image, 64, 64);
    options.weft_deg = 100.0;
    assert_ok(tsuya_patches_detect(&grid, &image, NULL, &options, &context));
    assert_true(tsuya_line_difference(grid.patch[0].threads.a.angle_rad, 110.0 * M_PI / 180.0) < 0.01);
    tsuya_patches_free(&grid);
    tsuya_image_free(&image);
}

static void draw_picks(tsuya_patch_grid *grid, tsuya_patch *patch, int count, double warp_px)
{
    *grid = (tsuya_patch_grid){.columns = count, .rows = 1, .patch = patch};
    for (int i = 0; i < count; i++) { /* now one family first, now the other */
        tsuya_thread_family weft = {true, 1.1 + 0.05 * (i % 3), 6.0, 0.001}, warp = {true, 2.7 - 0.05 * (i % 2), warp_px, 0.001};
        patch[i] = (tsuya_patch){.threads = {.a = i % 2 ? weft : warp, .b = i % 2 ? warp : weft, .confidence = 0.9}};
    }
}

static void test_the_coarser_threads_are_the_weft(void **state)
{
    (void)state;
    enum { COUNT = 9 };
    tsuya_patch patch[COUNT];
    tsuya_patch_grid grid;
    draw_picks(&grid, patch, COUNT, 5.0);
    tsuya_patches_label(&grid, NAN);
    assert_int_equal(grid.weft_told, TSUYA_WEFT_COUNT);
    for (int i = 0; i < COUNT; i++) {
        assert_float_equal(patch[i].threads.a.period_px, 6.0, 0.0);
    }
    draw_picks(&grid, patch, COUNT, 5.8); /* too alike to tell: one name for each family all the same */
    tsuya_patches_label(&grid, NAN);
    assert_int_equal(grid.weft_told, TSUYA_WEFT_UNKNOWN);
    for (int i = 1; i < COUNT; i++) {
        assert_float_equal(patch[i].threads.a.period_px, patch[0].threads.a.period_px, 0.0);
    }
    tsuya_patches_label(&grid, 150.0);
    assert_int_equal(grid.weft_told, TSUYA_WEFT_USER);
    assert_float_equal(patch[0].threads.a.period_px, 5.8, 0.0);
}

static void test_table_and_threads(void **state)
{
    (void)state;
    static const char *const columns[] = {"x_px", "y_px", "weft_deg", "warp_deg", "period_weft_px", "period_warp_px", "confidence", NULL};
    static const char *const kind_columns[] = {"x_px", "y_px", "kind", "diagonal_deg", NULL}, *const text[] = {"kind", NULL};
    tsuya_image image;
    tsuya_patch_grid grid;
    tsuya_table table;
    tsuya_hash one, two;
    tsuya_table_options options = {.required = columns, .known = columns, .allow_empty = true};
    tsuya_table_options kinds = {.required = kind_columns, .known = kind_columns, .text = text, .allow_empty = true};
    draw_gratings(&image, 300, 200);
    for (int threads = 1; threads <= 2; threads++) {
        detect(&grid, &image, NULL, threads);
        assert_int_equal(grid.columns, (300 - 64) / 32 + 1);
        assert_int_equal(grid.rows, (200 - 64) / 32 + 1);
        assert_ok(tsuya_patches_save(&grid, test_path(threads == 1 ? "one.csv" : "two.csv")));
        assert_ok(tsuya_patches_save_kinds(&grid, test_path("kinds.csv")));
        tsuya_patches_free(&grid);
    }
    assert_ok(tsuya_table_load(&table, test_path("kinds.csv"), &kinds));
    assert_int_equal(table.row_count, 8 * 5);
    tsuya_table_free(&table);
    assert_ok(tsuya_hash_file(&one, test_path("one.csv")));
    assert_ok(tsuya_hash_file(&two, test_path("two.csv")));
    assert_string_equal(one.hex, two.hex);
    assert_ok(tsuya_table_load(&table, test_path("one.csv"), &options));
    assert_int_equal(table.row_count, 8 * 5);
    assert_float_equal(tsuya_table_at(&table, 1, 0), 63.5, 1e-9);
    for (size_t r = 0; r < table.row_count; r++) {
        double confidence = tsuya_table_at(&table, r, 6), weft = tsuya_table_at(&table, r, 2);
        assert_true(confidence >= 0.0 && confidence <= 1.0);
        assert_true(isnan(weft) || (weft >= 0.0 && weft < 180.0));
    }
    tsuya_table_free(&table);
    tsuya_image_free(&image);
}

static void test_grey_and_masked_patches_are_empty(void **state)
{
    (void)state;
    tsuya_image image, mask;
    tsuya_patch_grid grid;
    draw_gratings(&image, 192, 64);
    for (int y = 0; y < 64; y++) {
        for (int x = 128; x < 192; x++) {
            *tsuya_image_f32(&image, x, y) = 0.5f;
        }
    }
    assert_ok(tsuya_image_create(&mask, 192, 64, 1, TSUYA_SAMPLE_U8, TSUYA_ENCODING_DATA));
    for (int y = 0; y < 64; y++) {
        for (int x = 70; x < 192; x++) {
            *tsuya_image_u8(&mask, x, y) = 255;
        }
    }
    detect(&grid, &image, &mask, 1);
    assert_float_equal(grid.patch[0].threads.confidence, 0.0, 0.0);
    assert_false(grid.patch[0].threads.a.seen);
    assert_true(grid.patch[2].threads.a.seen);
    assert_float_equal(grid.patch[4].threads.confidence, 0.0, 0.0);
    assert_false(grid.patch[4].threads.a.seen || grid.patch[4].threads.b.seen);
    tsuya_patches_free(&grid);
    for (int i = 0; i < 24 * 24; i++) { /* a hole in the middle of patch 2 */
        *tsuya_image_u8(&mask, 84 + i % 24, 20 + i / 24) = 0;
    }
    detect(&grid, &image, &mask, 1);
    assert_false(grid.patch[2].threads.a.seen);
    tsuya_patches_free(&grid);
    tsuya_image_free(&image);
    tsuya_image_free(&mask);
}

static void test_refusals(void **state)
{
    (void)state;
    tsuya_image image, mask;
    tsuya_patch_grid grid;
    tsuya_context context = tsuya_context_default();
    tsuya_patch_options options = tsuya_patch_options_default();
    draw_gratings(&image, 60, 200);
    assert_fails(tsuya_patches_detect(&grid, &image, NULL, &options, &context), "60 × 200 px is smaller than one patch of 64");
    options.patch_px = 33;
    assert_fails(tsuya_patches_detect(&grid, &image, NULL, &options, &context), "even sizes from 16 to 512");
    options.patch_px = 32;
    assert_ok(tsuya_image_create(&mask, 60, 201, 1, TSUYA_SAMPLE_U8, TSUYA_ENCODING_DATA));
    assert_fails(tsuya_patches_detect(&grid, &image, &mask, &options, &context), "the same size");
    options.step_px = 0;
    assert_fails(tsuya_patches_detect(&grid, &image, NULL, &options, &context), "step of 0 px");
    tsuya_image_free(&image);
    tsuya_image_free(&mask);
}

/* A window that holds one pair for threads, so surely, and else none. */
static tsuya_finding window_of(double angle_deg, float probability)
{
    tsuya_finding f = {.count = 1, .none_probability = 1.0f - probability};
    double a = angle_deg * M_PI / 180.0;
    f.alternative[0] = (tsuya_alternative){.f = {{0.2, 0.0}, {0.0, 0.2}}, .angle_rad = {a, a + 0.5 * M_PI}, .length = {0.2, 0.2}, .probability = probability};
    tsuya_finding_believe(&f);
    return f;
}

static void test_windows_listen_to_those_around(void **state)
{
    (void)state;
    float chance[3]; /* the middle window's threads after neighbours that see the same, others, none */
    for (int k = 0; k < 3; k++) {
        double around_deg = k == 1 ? 60.0 : 20.0;
        float sure = k == 2 ? 0.05f : 0.95f;
        tsuya_finding list[3] = {window_of(around_deg, sure), window_of(20.0, 0.5f), window_of(around_deg, sure)};
        assert_ok(tsuya_findings_pool(list, 3, 1));
        chance[k] = list[1].alternative[0].probability;
        assert_float_equal((double)(chance[k] + list[1].none_probability), 1.0, 1e-6);
    }
    assert_true(chance[0] > 0.65f && chance[1] < 0.5f && chance[2] < 0.35f);
    tsuya_finding alone = window_of(20.0, 0.5f);
    assert_ok(tsuya_findings_pool(&alone, 1, 1));
    assert_float_equal((double)alone.alternative[0].probability, 0.5, 1e-6);
}

static void test_overlay_keeps_the_photograph(void **state)
{
    (void)state;
    tsuya_image image, picture;
    tsuya_patch_grid grid;
    draw_gratings(&image, 128, 96);
    detect(&grid, &image, NULL, 1);
    assert_ok(tsuya_patches_overlay(&picture, &image, &grid));
    assert_int_equal(picture.width_px, 128);
    assert_int_equal(picture.channels, 3);
    const uint8_t *corner = tsuya_image_u8(&picture, 0, 0), *centre = tsuya_image_u8(&picture, 32, 32);
    assert_int_equal(corner[0], corner[1]);
    assert_true(abs(centre[0] - centre[1]) + abs(centre[1] - centre[2]) > 20);
    tsuya_image_free(&picture);
    tsuya_patches_free(&grid);
    tsuya_image_free(&image);
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_one_patch_of_a_small_image), cmocka_unit_test(test_the_user_names_the_weft),
        cmocka_unit_test(test_the_coarser_threads_are_the_weft),
        cmocka_unit_test(test_table_and_threads),          cmocka_unit_test(test_grey_and_masked_patches_are_empty),
        cmocka_unit_test(test_refusals),                   cmocka_unit_test(test_overlay_keeps_the_photograph),
        cmocka_unit_test(test_windows_listen_to_those_around),
    };
    int result = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return result;
}
