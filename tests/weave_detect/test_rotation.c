/* Real cloth, turned: the answer must turn with it.  This shows repeatability, not truth. */
#include "support.h"

#include "core/image.h"
#include "core/order.h"
#include "weave_detect/detector.h"
#include "weave_detect/patches.h"

#include <math.h>

enum { N = 64, WIDE = 2 * N, STEP_DEG = 5, MOST_DEG = 40, CENTRES = 9, MOST_IMAGES = 200, MOST_ERRORS = MOST_IMAGES * CENTRES * 17 };

typedef struct tally {
    int images, patches, sure, coarse, coarse_sure; /* patches of whole photographs as `weave image` gives them */
    size_t count;
    double *error_deg;
} tally;

static tsuya_detector *detector, *wide_detector;

/* Keys' cubic, a = −½. */
static void cubic(double w[4], double t)
{
    w[0] = ((-0.5 * t + 1.0) * t - 0.5) * t;
    w[1] = (1.5 * t - 2.5) * t * t + 1.0;
    w[2] = ((-1.5 * t + 2.0) * t + 0.5) * t;
    w[3] = (0.5 * t - 0.5) * t * t;
}

static float sample(const tsuya_image *grey, double x, double y)
{
    int i = (int)floor(x), j = (int)floor(y);
    double wx[4], wy[4], sum = 0.0;
    cubic(wx, x - i);
    cubic(wy, y - j);
    for (int b = 0; b < 4; b++) {
        for (int a = 0; a < 4; a++) {
            sum += wy[b] * wx[a] * (double)*tsuya_image_f32(grey, i - 1 + a, j - 1 + b);
        }
    }
    return (float)sum;
}

/* The patch about (cx, cy) of the image turned counter-clockwise. */
static void turned(float *values, int n, const tsuya_image *grey, double cx, double cy, double turn_rad)
{
    double c = cos(turn_rad), s = sin(turn_rad);
    for (int k = 0; k < n * n; k++) {
        double x = k % n - 0.5 * (n - 1), y = (int)(k / n) - 0.5 * (n - 1);
        values[k] = sample(grey, cx + c * x - s * y, cy + s * x + c * y);
    }
}

/* How far the worse family is from having turned by `turn`. */
static double miss_deg(const tsuya_threads *still, const tsuya_threads *moved, double turn_rad)
{
    double a = still->a.angle_rad + turn_rad, b = still->b.angle_rad + turn_rad;
    double straight = fmax(tsuya_line_difference(moved->a.angle_rad, a), tsuya_line_difference(moved->b.angle_rad, b));
    double swapped = fmax(tsuya_line_difference(moved->b.angle_rad, a), tsuya_line_difference(moved->a.angle_rad, b));
    return fmin(straight, swapped) * 180.0 / M_PI;
}

static void count_sure(tally *t, const tsuya_image *photo)
{
    tsuya_patch_grid grid;
    tsuya_context context = tsuya_context_default();
    tsuya_patch_options options = tsuya_patch_options_default();
    assert_ok(tsuya_patches_detect(&grid, photo, NULL, &options, &context));
    for (size_t k = 0; k < tsuya_patch_count(&grid); k++) {
        const tsuya_threads *p = &grid.patch[k].threads;
        bool coarse = p->a.seen && p->b.seen && p->a.period_px >= 4.0 && p->b.period_px >= 4.0;
        t->patches++;
        t->sure += p->confidence >= 0.8;
        t->coarse += coarse;
        t->coarse_sure += coarse && p->confidence >= 0.8;
    }
    t->images++;
    tsuya_patches_free(&grid);
}

/* The patches about nine points, in the window that turns with them about the image's middle. */
static void look_at(const tsuya_image *grey, double turn_rad, tsuya_threads *threads)
{
    static float values[N * N], wide[WIDE * WIDE];
    static tsuya_finding finding;
    const tsuya_finding *around[1] = {&finding};
    double cx = 0.5 * (grey->width_px - 1), cy = 0.5 * (grey->height_px - 1);
    turned(wide, WIDE, grey, cx, cy, turn_rad);
    tsuya_detector_find(wide_detector, &finding, wide);
    for (int k = 0; k < CENTRES; k++) {
        turned(values, N, grey, cx + 20.0 * (k % 3 - 1), cy + 20.0 * (k / 3 - 1), turn_rad);
        tsuya_detector_follow(detector, &threads[k], around, 1, values);
    }
}

static void look_at_all_turns(tally *t, const tsuya_image *grey)
{
    tsuya_threads still[CENTRES], moved[CENTRES];
    look_at(grey, 0.0, still);
    for (int turn = -MOST_DEG; turn <= MOST_DEG; turn += STEP_DEG) {
        double turn_rad = turn * M_PI / 180.0;
        if (turn == 0) {
            continue;
        }
        look_at(grey, turn_rad, moved);
        for (int k = 0; k < CENTRES; k++) {
            if (still[k].confidence >= 0.8 && moved[k].confidence >= 0.8) {
                t->error_deg[t->count++] = miss_deg(&still[k], &moved[k], turn_rad);
            }
        }
    }
}

static bool run_folder(tally *t, const char *folder, const char *prefix)
{
    tsuya_arena *arena;
    char **names;
    int count;
    *t = (tally){.error_deg = tsuya_calloc(MOST_ERRORS, sizeof(double))};
    assert_non_null(t->error_deg);
    assert_ok(tsuya_arena_create(&arena, 1 << 12));
    assert_ok(tsuya_folder_list(&names, &count, folder, arena));
    for (int i = 0; i < count && t->images < MOST_IMAGES; i++) {
        tsuya_image image, grey;
        char path[TEST_PATH];
        if (strncmp(names[i], prefix, strlen(prefix)) != 0) {
            continue;
        }
        snprintf(path, sizeof path, "%s/%s", folder, names[i]);
        assert_ok(tsuya_image_load(&image, path));
        assert_ok(tsuya_image_grey(&grey, &image, TSUYA_SAMPLE_F32));
        count_sure(t, &image);
        look_at_all_turns(t, &grey);
        tsuya_image_free(&image);
        tsuya_image_free(&grey);
    }
    tsuya_arena_free(arena);
    tsuya_sort_doubles(t->error_deg, t->count);
    printf("%s: %d images, %d patches, %.1f %% sure (%.1f %% of those with threads of 4 px and more); turned: median %.3f, p90 %.3f degrees over %zu\n",
           prefix, t->images, t->patches, 100.0 * t->sure / t->patches, 100.0 * t->coarse_sure / (t->coarse > 0 ? t->coarse : 1),
           t->count ? t->error_deg[t->count / 2] : NAN, t->count ? t->error_deg[(size_t)(0.9 * (double)(t->count - 1))] : NAN, t->count);
    return t->images > 0;
}

static void turns_with(const char *folder, const char *prefix, double median_deg, double p90_deg, double share)
{
    const char *path = test_data(folder);
    tally t;
    if (!path) {
        skip();
    }
    assert_true(run_folder(&t, path, prefix));
    if (median_deg > 0.0) {
        assert_true(t.count > 0 && t.error_deg[t.count / 2] <= median_deg);
        assert_true(t.error_deg[(size_t)(0.9 * (double)(t.count - 1))] <= p90_deg);
        assert_true(t.coarse_sure >= share * t.coarse);
    }
    tsuya_free(t.error_deg);
}

static void test_linen(void **state)
{
    (void)state;
    turns_with("weave/kth_tips", "44-", 0.3, 1.0, 0.7);
}

static void test_cotton(void **state)
{
    (void)state;
    turns_with("weave/kth_tips", "46-", 0.3, 1.0, 0.7);
}

/* Reported, whatever it gives. */
static void test_wool(void **state)
{
    (void)state;
    turns_with("weave/kth_tips2_wool", "22", 0.0, 0.0, 0.0);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_linen), cmocka_unit_test(test_cotton), cmocka_unit_test(test_wool)};
    if (tsuya_detector_create(&detector, N, NULL) != TSUYA_OK || tsuya_detector_create(&wide_detector, WIDE, NULL) != TSUYA_OK) {
        return 1;
    }
    int result = cmocka_run_group_tests(tests, NULL, NULL);
    tsuya_detector_free(detector);
    tsuya_detector_free(wide_detector);
    return result;
}
