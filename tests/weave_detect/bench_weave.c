/* Error beside time: the detector, what one would do with OpenCV alone, and the Cramér–Rao bound.
 *
 *     bench_weave [DRAWS]            error beside time, and the confidence
 *     bench_weave --detail [DRAWS]   what goes wrong, by weave, period and contrast
 *
 * Cloth of tests/weave_detect/scene_weave.h at random.  "Tellable" patches: contrast ≥ 0.5, period ≥ 4 px, repeat within the patch. */
#include "bench.h"
#include "peers_opencv.h"
#include "scene_other.h"
#include "scene_weave.h"

#include "core/context.h"
#include "core/image.h"
#include "core/memory.h"
#include "core/order.h"
#include "weave_detect/detector.h"
#include "weave_detect/patches.h"

#include <math.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { N = 64, WIDE = 2 * N, WITH_WINDOW = -1, SEED = 77, DETECTOR = 0, METHODS = 7, PERIODS = 3, CONTRASTS = 3, OUTCOMES = 6 };

/* Processor time of this thread: other work on the machine does not count. */
static double cpu_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

typedef struct method {
    const char *name;
    void (*peer)(double angle_rad[2], const float *values, int n);
    int rounds; /* of the detector */
    tsuya_detector *detector;
    double seconds;
    double *error_deg;
} method;

static double worse_deg(const double angle[2], const weave_cloth *c)
{
    double weft = c->weft_deg * M_PI / 180.0, warp = c->warp_deg * M_PI / 180.0;
    double straight = fmax(tsuya_line_difference(angle[0], weft), tsuya_line_difference(angle[1], warp));
    double swapped = fmax(tsuya_line_difference(angle[1], weft), tsuya_line_difference(angle[0], warp));
    return fmin(straight, swapped) * 180.0 / M_PI;
}

static tsuya_detector *wide_detector;

/* As the patches of a photograph are looked at: with the window around them, which four patches share. */
static void run_with_window(method *m, tsuya_threads *threads, const float *wide, const float *values)
{
    static tsuya_finding finding;
    const tsuya_finding *around[1] = {&finding};
    double begin = cpu_s();
    tsuya_detector_find(wide_detector, &finding, wide);
    m->seconds += 0.25 * (cpu_s() - begin);
    begin = cpu_s();
    tsuya_detector_follow(m->detector, threads, around, 1, values);
    m->seconds += cpu_s() - begin;
}

static double run_method(method *m, const float *wide, const float *values, const weave_cloth *cloth, tsuya_threads *threads)
{
    double angle[2] = {0.0, 0.0}, begin = cpu_s();
    if (m->rounds == WITH_WINDOW) {
        run_with_window(m, threads, wide, values);
    } else if (m->peer) {
        m->peer(angle, values, N);
    } else {
        tsuya_detector_run(m->detector, threads, values);
    }
    m->seconds += m->rounds == WITH_WINDOW ? 0.0 : cpu_s() - begin;
    if (!m->peer) {
        angle[0] = threads->a.angle_rad;
        angle[1] = threads->b.angle_rad;
    }
    return !m->peer && !(threads->a.seen && threads->b.seen) ? 90.0 : worse_deg(angle, cloth);
}

static void draw_both(float *wide, float *values, const weave_cloth *cloth, const weave_camera *camera)
{
    weave_draw(wide, WIDE, cloth, camera);
    for (int y = 0; y < N; y++) {
        memcpy(values + y * N, wide + (y + N / 2) * WIDE + N / 2, N * sizeof(float));
    }
}

static bool is_tellable(const weave_cloth *cloth, const weave_camera *camera)
{
    return camera->contrast >= 0.5 && fmin(cloth->weft_px, cloth->warp_px) >= 4.0 &&
           weave_draft_repeat(cloth->draft) * fmax(cloth->weft_px, cloth->warp_px) <= N;
}

typedef struct sums {
    int draws, tellable, sure, sure_right;
    double surplus[10], bound_square, error_square;
    int calibrated, bounded, per_draft[WEAVE_DRAFT_COUNT][3];
    double *sure_error;
} sums;

static void calibrate(sums *s, double confidence, bool right)
{
    s->surplus[(int)(9.999 * confidence)] += confidence - right;
    s->calibrated++;
}

/* Both families against the bound, on regular cloth without the fibres that no one could know; wrong peaks are counted elsewhere. */
static void hold_against_bound(sums *s, method *m, uint64_t index)
{
    static float values[N * N], wide[WIDE * WIDE];
    weave_cloth cloth;
    weave_camera camera;
    tsuya_threads t;
    double bound[2];
    weave_random(&cloth, &camera, SEED + 1, index);
    cloth.fibre = 0.0;
    cloth.uneven = 0.0;
    if (camera.contrast < 0.5 || fmin(cloth.weft_px, cloth.warp_px) < 4.0 || fmax(cloth.weft_px, cloth.warp_px) > 10.0 ||
        weave_draft_repeat(cloth.draft) * fmax(cloth.weft_px, cloth.warp_px) > N) {
        return;
    }
    draw_both(wide, values, &cloth, &camera);
    run_method(m, wide, values, &cloth, &t);
    if (!t.a.seen || !t.b.seen || worse_deg((double[2]){t.a.angle_rad, t.b.angle_rad}, &cloth) > 1.0) {
        return;
    }
    weave_bound(&bound[0], &bound[1], N, &cloth, &camera, camera.spread / camera.contrast);
    const double want[2] = {cloth.weft_deg * M_PI / 180.0, cloth.warp_deg * M_PI / 180.0};
    for (int k = 0; k < 2; k++) {
        double e = fmin(tsuya_line_difference(t.a.angle_rad, want[k]), tsuya_line_difference(t.b.angle_rad, want[k]));
        s->error_square += e * e / (bound[k] * bound[k]);
        s->bounded++;
    }
}

static void run_draws(sums *s, method *methods, int draws)
{
    static float values[N * N], wide[WIDE * WIDE];
    for (int i = 0; i < draws; i++) {
        weave_cloth cloth;
        weave_camera camera;
        tsuya_threads t = {0};
        weave_random(&cloth, &camera, SEED, (uint64_t)i);
        draw_both(wide, values, &cloth, &camera);
        bool tellable = is_tellable(&cloth, &camera);
        for (int m = tellable ? METHODS - 1 : DETECTOR; m >= 0; m--) {
            double e = run_method(&methods[m], wide, values, &cloth, &t);
            if (tellable) {
                methods[m].error_deg[s->tellable] = e;
            }
            if (m == DETECTOR) {
                calibrate(s, t.confidence, e < 2.0);
                if (tellable) {
                    int *draft = s->per_draft[cloth.draft];
                    draft[0]++;
                    draft[1] += e < 1.0;
                    draft[2] += t.confidence >= 0.8;
                    if (t.confidence >= 0.8) {
                        s->sure_error[s->sure++] = e;
                        s->sure_right += e < 2.0;
                    }
                }
            }
        }
        s->tellable += tellable;
        s->draws++;
    }
}

static void print_table(const sums *s, method *methods)
{
    int n = s->tellable;
    printf("%-28s %10s %10s %12s %12s\n", "method", "median_deg", "p90_deg", "within_1_deg", "ns_per_px");
    for (int m = 0; m < METHODS; m++) {
        int within = 0;
        for (int i = 0; i < n; i++) {
            within += methods[m].error_deg[i] < 1.0;
        }
        tsuya_sort_doubles(methods[m].error_deg, (size_t)n);
        int runs = m == DETECTOR ? s->draws : n;
        /* at 50 % overlap each pixel is looked at four times; two cores */
        printf("%-28s %10.3f %10.3f %12.3f %12.1f\n", methods[m].name, methods[m].error_deg[n / 2], methods[m].error_deg[(int)(0.9 * (n - 1))],
               (double)within / n, 1e9 * methods[m].seconds / runs / (32.0 * 32.0) / 2.0);
        bench_point("drawn cloth", methods[m].name, methods[m].error_deg[n / 2], "deg median", 1e9 * methods[m].seconds / runs / (32.0 * 32.0) / 2.0, "ns per px");
        bench_point("not within 1 degree", methods[m].name, 1.0 - (double)within / n, "share", 1e9 * methods[m].seconds / runs / (32.0 * 32.0) / 2.0, "ns per px");
    }
    printf("tellable patches %d of %d; time: processor time of a patch over the 32 x 32 px that it stands for, on two cores\n\n", n, s->draws);
}

static void print_confidence(const sums *s, const double *sure_error)
{
    double calibration = 0.0;
    for (int k = 0; k < 10; k++) {
        calibration += fabs(s->surplus[k]) / s->calibrated;
    }
    printf("calibration error %.4f over %d patches; of the tellable %.3f have confidence >= 0.8, of these %.3f are right, p90 %.3f degrees\n", calibration,
           s->calibrated, (double)s->sure / s->tellable, (double)s->sure_right / s->sure, sure_error[(int)(0.9 * (s->sure - 1))]);
    printf("error over the Cramer-Rao bound, rms, period 4 to 10 px: %.2f over %d families\n\n", sqrt(s->error_square / s->bounded), s->bounded);
    for (int d = 0; d < WEAVE_DRAFT_COUNT; d++) {
        const int *p = s->per_draft[d];
        printf("%-10s within 1 degree %.3f, confidence >= 0.8 on %.3f, of %d\n", weave_draft_name((weave_draft)d), (double)p[1] / p[0], (double)p[2] / p[0], p[0]);
    }
}

/* Processor time of all threads. */
static double all_cpu_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

enum { SHEET = 512, SHEETS = 36, EVERY = 16, RIM = 64, ALONG = (SHEET - 2 * RIM) / EVERY, POINTS = ALONG * ALONG };

typedef struct curve_point {
    double seconds, *error_deg;
    int count, sure, sure_right;
} curve_point;

/* What a picture's patches say at points all over it: each asks the patch whose centre is nearest. */
static void judge(curve_point *c, const tsuya_patch_grid *grid, const weave_cloth *cloth)
{
    for (int k = 0; k < POINTS; k++) {
        double x = RIM + (k % ALONG + 0.5) * EVERY, y = RIM + (k / ALONG + 0.5) * EVERY;
        const tsuya_patch *first = grid->patch;
        int column = (int)lround((x - first->x_px) / grid->step_px), row = (int)lround((y - first->y_px) / grid->step_px);
        column = column < 0 ? 0 : column < grid->columns ? column : grid->columns - 1;
        row = row < 0 ? 0 : row < grid->rows ? row : grid->rows - 1;
        const tsuya_threads *t = &grid->patch[(size_t)row * (size_t)grid->columns + (size_t)column].threads;
        double e = t->a.seen && t->b.seen ? worse_deg((double[2]){t->a.angle_rad, t->b.angle_rad}, cloth) : 90.0;
        c->error_deg[c->count++] = e;
        c->sure += t->confidence >= 0.8;
        c->sure_right += t->confidence >= 0.8 && e < 2.0;
    }
}

static bool look_at_sheets(curve_point *c, const tsuya_patch_options *options)
{
    tsuya_context context = tsuya_context_default();
    tsuya_image image;
    bool good = tsuya_image_create(&image, SHEET, SHEET, 1, TSUYA_SAMPLE_F32, TSUYA_ENCODING_SRGB) == TSUYA_OK;
    int drawn = 0;
    for (uint64_t i = 0; good && drawn < SHEETS; i++) {
        weave_cloth cloth;
        weave_camera camera;
        tsuya_patch_grid grid;
        weave_random(&cloth, &camera, SEED + 2, i);
        if (!is_tellable(&cloth, &camera)) {
            continue;
        }
        weave_draw(tsuya_image_f32(&image, 0, 0), SHEET, &cloth, &camera);
        double begin = all_cpu_s();
        good = tsuya_patches_detect(&grid, &image, NULL, options, &context) == TSUYA_OK;
        c->seconds += all_cpu_s() - begin;
        if (good) {
            judge(c, &grid, &cloth);
            tsuya_patches_free(&grid);
        }
        drawn++;
    }
    tsuya_image_free(&image);
    return good;
}

/* Whole sheets: error against time as patch and overlap are turned (refinement: the first table). */
static int run_curve(void)
{
    static const int patch_px[] = {32, 48, 64, 96, 128}, part[] = {1, 2, 4};
    printf("\n%d sheets of %d x %d px, tellable cloth, asked every %d px; time: of two cores\n%6s %8s %11s %9s %13s %7s %11s %10s\n", SHEETS, SHEET, SHEET, EVERY,
           "patch", "overlap", "median_deg", "p90_deg", "within_1_deg", "sure", "sure_right", "ns_per_px");
    for (int k = 0; k < 15; k++) {
        tsuya_patch_options options = tsuya_patch_options_default();
        curve_point c = {.error_deg = tsuya_calloc((size_t)SHEETS * POINTS, sizeof(double))};
        char name[64];
        int within = 0;
        options.patch_px = patch_px[k / 3];
        options.step_px = options.patch_px / part[k % 3];
        if (!c.error_deg || !look_at_sheets(&c, &options)) {
            tsuya_free(c.error_deg);
            return 1;
        }
        tsuya_sort_doubles(c.error_deg, (size_t)c.count);
        while (within < c.count && c.error_deg[within] < 1.0) {
            within++;
        }
        double median = c.error_deg[c.count / 2], ns = 1e9 * c.seconds / 2.0 / ((double)SHEETS * SHEET * SHEET), off = 1.0 - (double)within / c.count;
        printf("%6d %7d%% %11.3f %9.3f %13.3f %7.3f %11.3f %10.1f\n", options.patch_px, 100 - 100 / part[k % 3], median, c.error_deg[(int)(0.9 * (c.count - 1))],
               1.0 - off, (double)c.sure / c.count, c.sure ? (double)c.sure_right / c.sure : NAN, ns);
        snprintf(name, sizeof name, "tsuya, patch %d, overlap %d %%", options.patch_px, 100 - 100 / part[k % 3]);
        bench_point("drawn sheets", name, median, "deg median", ns, "ns per px");
        bench_point("sheets, not within 1 degree", name, off, "share", ns, "ns per px");
        tsuya_free(c.error_deg);
    }
    return 0;
}

/* Whole pictures: time against size. */
static int run_pictures(void)
{
    enum { PICTURES = 3 };
    static const int setting[PICTURES][4] = {{1500, 1000, 64, 32}, {3000, 2000, 64, 32}, {6000, 4000, 64, 32}};
    static float tile[256 * 256];
    weave_cloth cloth = weave_cloth_default();
    weave_camera camera = weave_camera_default();
    tsuya_context context = tsuya_context_default();
    cloth.weft_deg = 20.0;
    cloth.warp_deg = 112.0;
    weave_draw(tile, 256, &cloth, &camera);
    printf("\n%-14s %6s %6s %10s %12s\n", "picture", "patch", "step", "seconds", "ns_per_px");
    for (int k = 0; k < PICTURES; k++) {
        tsuya_image image;
        tsuya_patch_grid grid;
        tsuya_patch_options options = tsuya_patch_options_default();
        options.patch_px = setting[k][2];
        options.step_px = setting[k][3];
        if (tsuya_image_create(&image, setting[k][0], setting[k][1], 1, TSUYA_SAMPLE_F32, TSUYA_ENCODING_SRGB) != TSUYA_OK) {
            return 1;
        }
        for (int y = 0; y < image.height_px; y++) {
            for (int x = 0; x < image.width_px; x++) {
                *tsuya_image_f32(&image, x, y) = tile[(y & 255) * 256 + (x & 255)];
            }
        }
        double begin = tsuya_clock_s();
        tsuya_status status = tsuya_patches_detect(&grid, &image, NULL, &options, &context);
        double seconds = tsuya_clock_s() - begin;
        tsuya_image_free(&image);
        if (status != TSUYA_OK) {
            return 1;
        }
        tsuya_patches_free(&grid);
        printf("%5d x %-6d %6d %6d %10.3f %12.1f\n", setting[k][0], setting[k][1], options.patch_px, options.step_px, seconds,
               1e9 * seconds / ((double)setting[k][0] * setting[k][1]));
    }
    return 0;
}

/* What became of a patch: 0 right, 1 within 2 degrees but not 1, 2 no threads, 3 one family right, 4 a diagonal, 5 else. */
static int outcome_of(const tsuya_threads *t, double error_deg, const weave_cloth *c)
{
    if (error_deg < 2.0) {
        return error_deg < 1.0 ? 0 : 1;
    }
    if (!t->a.seen || !t->b.seen) {
        return 2;
    }
    const double truth[2] = {c->weft_deg * M_PI / 180.0, c->warp_deg * M_PI / 180.0}, bound = 2.0 * M_PI / 180.0;
    double a = fmin(tsuya_line_difference(t->a.angle_rad, truth[0]), tsuya_line_difference(t->a.angle_rad, truth[1]));
    double b = fmin(tsuya_line_difference(t->b.angle_rad, truth[0]), tsuya_line_difference(t->b.angle_rad, truth[1]));
    if (fmin(a, b) < bound) {
        return 3;
    }
    return fmax(a, b) > 15.0 * M_PI / 180.0 ? 4 : 5;
}

static int run_detail(int draws)
{
    static const char *const period_name[] = {"4-5", "5-6.5", "6.5+"}, *const contrast_name[] = {"0.5-1", "1-2", "2-4"};
    static int tally[WEAVE_DRAFT_COUNT][PERIODS][CONTRASTS][OUTCOMES], unsure[WEAVE_DRAFT_COUNT][PERIODS][CONTRASTS];
    static float values[N * N], wide[WIDE * WIDE];
    method m = {.rounds = WITH_WINDOW};
    if (tsuya_detector_create(&m.detector, N, NULL) != TSUYA_OK) {
        return 1;
    }
    for (int i = 0; i < draws; i++) {
        weave_cloth c;
        weave_camera camera;
        tsuya_threads t;
        weave_random(&c, &camera, SEED, (uint64_t)i);
        if (is_tellable(&c, &camera)) {
            draw_both(wide, values, &c, &camera);
            double e = run_method(&m, wide, values, &c, &t), period = fmin(c.weft_px, c.warp_px);
            int p = period < 5.0 ? 0 : period < 6.5 ? 1 : 2, k = camera.contrast < 1.0 ? 0 : camera.contrast < 2.0 ? 1 : 2;
            tally[c.draft][p][k][outcome_of(&t, e, &c)]++;
            unsure[c.draft][p][k] += t.confidence < 0.8;
        }
    }
    tsuya_detector_free(m.detector);
    printf("%-10s %-6s %-8s %8s %8s %8s %8s %8s %8s %8s %8s\n", "weave", "period", "contrast", "patches", "right", "1-2_deg", "none", "one_only", "diagonal",
           "else", "unsure");
    for (int cell = 0; cell < WEAVE_DRAFT_COUNT * PERIODS * CONTRASTS; cell++) {
        int d = cell / (PERIODS * CONTRASTS), p = cell / CONTRASTS % PERIODS, k = cell % CONTRASTS, all = 0;
        for (int o = 0; o < OUTCOMES; o++) {
            all += tally[d][p][k][o];
        }
        printf("%-10s %-6s %-8s %8d", weave_draft_name((weave_draft)d), period_name[p], contrast_name[k], all);
        for (int o = 0; o < OUTCOMES; o++) {
            printf(" %8d", tally[d][p][k][o]);
        }
        printf(" %8d\n", unsure[d][p][k]);
    }
    return 0;
}

int main(int argc, char **argv)
{
    bool detail = argc > 1 && strcmp(argv[1], "--detail") == 0;
    int draws = argc > 1 + detail ? atoi(argv[1 + detail]) : 10000;
    if (tsuya_detector_create(&wide_detector, WIDE, NULL) != TSUYA_OK) {
        return 1;
    }
    if (detail) {
        int failed = run_detail(draws);
        tsuya_detector_free(wide_detector);
        return failed;
    }
    method methods[METHODS] = {
        {.name = "tsuya", .rounds = WITH_WINDOW}, {.name = "tsuya without windows", .rounds = 1}, {.name = "tsuya without refinement", .rounds = 0},
        {.name = "plain FFT peaks", .peer = peer_fourier_peak}, {.name = "Sobel histogram", .peer = peer_sobel_histogram},
        {.name = "OpenCV structure tensor", .peer = peer_structure_tensor}, {.name = "Gaussian derivative tensor", .peer = peer_gaussian_derivative},
    };
    sums s = {.sure_error = tsuya_calloc((size_t)draws, sizeof(double))};
    for (int m = 0; m < METHODS; m++) {
        methods[m].error_deg = tsuya_calloc((size_t)draws, sizeof(double));
        tsuya_detector_options options = {.rounds = methods[m].rounds == WITH_WINDOW ? 1 : methods[m].rounds};
        if (!methods[m].error_deg || tsuya_detector_create(&methods[m].detector, N, &options) != TSUYA_OK) {
            return 1;
        }
    }
    run_draws(&s, methods, draws);
    for (int i = 0; i < draws / 8; i++) {
        hold_against_bound(&s, &methods[DETECTOR], (uint64_t)i);
    }
    print_table(&s, methods);
    tsuya_sort_doubles(s.sure_error, (size_t)s.sure);
    print_confidence(&s, s.sure_error);
    int result = run_curve() || run_pictures();
    for (int m = 0; m < METHODS; m++) {
        tsuya_free(methods[m].error_deg);
        tsuya_detector_free(methods[m].detector);
    }
    tsuya_free(s.sure_error);
    tsuya_detector_free(wide_detector);
    return result;
}
