/* What a detector of threads must not be fooled by: pictures of 192 px, patch by patch as a photograph's.
 *
 * "Wrong" is a patch with confidence ≥ 0.8 whose cross is none of those that the picture shows (2 degrees). */
#include "support.h"

#include "core/image.h"
#include "weave_detect/detector.h"
#include "weave_detect/patches.h"
#include "scene_hard.h"

#include <math.h>

enum { N = 192, PICTURES = 40, SEED = 51 };

typedef struct tally {
    int patches, sure, wrong, right;
} tally;

static bool is_cross(const tsuya_threads *t, double weft_deg, double warp_deg)
{
    const double bound = 2.0 * M_PI / 180.0, weft = weft_deg * M_PI / 180.0, warp = warp_deg * M_PI / 180.0;
    double straight = fmax(tsuya_line_difference(t->a.angle_rad, weft), tsuya_line_difference(t->b.angle_rad, warp));
    double swapped = fmax(tsuya_line_difference(t->b.angle_rad, weft), tsuya_line_difference(t->a.angle_rad, warp));
    return t->a.seen && t->b.seen && fmin(straight, swapped) < bound;
}

static void judge(tally *sum, const tsuya_patch_grid *grid, const hard_truth *truth)
{
    for (size_t i = 0; i < tsuya_patch_count(grid); i++) {
        const tsuya_threads *t = &grid->patch[i].threads;
        bool right = false, sure = t->confidence >= 0.8;
        for (int k = 0; k < truth->count; k++) {
            right = right || is_cross(t, truth->weft_deg[k], truth->warp_deg[k]);
        }
        sum->patches++;
        sum->right += right;
        sum->sure += sure;
        sum->wrong += sure && !right;
    }
}

/* What a file of 8 bits keeps; coarsely compressed where blocks are the case. */
static void keep(tsuya_image *image, const float *values, hard_kind kind)
{
    tsuya_image_save_options options = tsuya_image_save_options_default();
    bool coarse = kind == HARD_BLOCKS || kind == HARD_BLOCKED;
    const char *path = test_path(coarse ? "hard.jpg" : "hard.png");
    tsuya_image drawn;
    assert_ok(tsuya_image_create(&drawn, N, N, 1, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
    for (int i = 0; i < N * N; i++) {
        *tsuya_image_u8(&drawn, i % N, i / N) = (uint8_t)fminf(fmaxf(255.0f * values[i] + 0.5f, 0.0f), 255.0f);
    }
    options.jpeg_quality = 25;
    assert_ok(tsuya_image_save(&drawn, path, &options));
    tsuya_image_free(&drawn);
    assert_ok(tsuya_image_load(image, path));
}

static void run(tally *sum, hard_kind kind)
{
    static float values[N * N];
    tsuya_context context = tsuya_context_default();
    tsuya_patch_options options = tsuya_patch_options_default();
    *sum = (tally){0};
    for (int k = 0; k < PICTURES; k++) {
        tsuya_image image;
        tsuya_patch_grid grid;
        hard_truth truth;
        hard_draw(values, N, &truth, kind, SEED, (uint64_t)k);
        keep(&image, values, kind);
        assert_ok(tsuya_patches_detect(&grid, &image, NULL, &options, &context));
        judge(sum, &grid, &truth);
        tsuya_patches_free(&grid);
        tsuya_image_free(&image);
    }
    printf("%-20s sure %5.1f %%, sure and wrong %4.1f %%, right %5.1f %% of %d patches\n", hard_name(kind), 100.0 * sum->sure / sum->patches,
           100.0 * sum->wrong / sum->patches, 100.0 * sum->right / sum->patches, sum->patches);
}

static void test_nothing_is_made_up(void **state)
{
    (void)state;
    static const hard_kind none[] = {HARD_KNIT, HARD_MOIRE, HARD_FINE, HARD_BLOCKS, HARD_BAYER_WALL};
    int failed = 0;
    for (size_t k = 0; k < sizeof none / sizeof *none; k++) {
        tally t;
        run(&t, none[k]);
        failed += t.wrong > 0.05 * t.patches;
    }
    assert_int_equal(failed, 0);
}

static void test_threads_are_found_or_left_open(void **state)
{
    (void)state;
    static const struct {
        hard_kind kind;
        double right;
    } some[] = {{HARD_PRINT, 0.8}, {HARD_BLOCKED, 0.7}, {HARD_BAYER, 0.8}, {HARD_HIGHLIGHT, 0.7}, {HARD_SEAM, 0.7}, {HARD_BACKGROUND, 0.4}};
    int failed = 0;
    for (size_t k = 0; k < sizeof some / sizeof *some; k++) {
        tally t;
        run(&t, some[k].kind);
        failed += t.wrong > 0.05 * t.patches || t.right < some[k].right * t.patches;
    }
    assert_int_equal(failed, 0);
}

static void test_grey_stays_empty(void **state)
{
    (void)state;
    tsuya_image image;
    tsuya_patch_grid grid;
    tsuya_context context = tsuya_context_default();
    tsuya_patch_options options = tsuya_patch_options_default();
    for (int level = 0; level <= 255; level += 85) {
        assert_ok(tsuya_image_create(&image, N, N, 3, TSUYA_SAMPLE_U8, TSUYA_ENCODING_SRGB));
        memset(image.data, level, 3 * N * N);
        assert_ok(tsuya_patches_detect(&grid, &image, NULL, &options, &context));
        for (size_t i = 0; i < tsuya_patch_count(&grid); i++) {
            const tsuya_threads *t = &grid.patch[i].threads;
            assert_true(!t->a.seen && !t->b.seen && t->confidence == 0.0 && t->kind == TSUYA_WEAVE_UNKNOWN);
        }
        tsuya_patches_free(&grid);
        tsuya_image_free(&image);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_nothing_is_made_up), cmocka_unit_test(test_threads_are_found_or_left_open),
                                       cmocka_unit_test(test_grey_stays_empty)};
    int result = cmocka_run_group_tests(tests, NULL, NULL);
    test_folder_remove();
    return result;
}
