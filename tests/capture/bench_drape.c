/* A costume on its rack: how long until it rests, and how well it does. */
#include "support.h"

#include "bench.h"
#include "capture/swatch.h"

#include <math.h>
#include <sys/resource.h>

static double cpu_s(void)
{
    struct rusage r;
    getrusage(RUSAGE_SELF, &r);
    return (double)r.ru_utime.tv_sec + 1e-6 * (double)r.ru_utime.tv_usec + (double)r.ru_stime.tv_sec + 1e-6 * (double)r.ru_stime.tv_usec;
}

/* Over the bar's middle, front and back straight down. */
static void hang(tsuya_drape_sheet *s, double radius_m)
{
    for (size_t v = 0; v < s->vertex_count; v++) {
        double *p = s->position + 3 * v, along = p[1], side = along < 0.0 ? -1.0 : 1.0, over = fabs(along) - 0.5 * M_PI * radius_m;
        p[1] = (over > 0.0 ? side * radius_m : radius_m * sin(along / radius_m)) + side * 5e-4 * tsuya_random_uniform(1, 9, v);
        p[2] = over > 0.0 ? -over : radius_m * cos(along / radius_m);
    }
}

/* Draped in place; cpu seconds. */
static double drape(tsuya_drape_sheet *sheet, tsuya_drape_info *info, double width, double coarse, int levels, int threads)
{
    const double radius = 0.015, gap = 1.2e-3 + 1e-3 + 1.2 * coarse * coarse / (8.0 * radius);
    const tsuya_drape_body body[] = {{.shape = TSUYA_DRAPE_BAR, .a = {-0.7, 0, 0}, .b = {0.7, 0, 0}, .radius_m = radius},
                                     {.shape = TSUYA_DRAPE_FLOOR, .a = {0, 0, -1.2 * width}}};
    tsuya_drape_fabric f;
    tsuya_drape_options o = tsuya_drape_options_default();
    tsuya_context context = tsuya_context_default();
    context.threads = threads;
    assert_true(tsuya_drape_fabric_named(&f, "karaori"));
    assert_ok(tsuya_drape_sheet_karaori(sheet, width, coarse));
    hang(sheet, radius + gap);
    double start = cpu_s();
    assert_ok(tsuya_drape_settle(info, sheet, &f, body, 2, &o, levels, &context));
    return cpu_s() - start;
}

/* Ten thousand vertices unless the environment says otherwise: at rest in a minute of two cores, without intersections, and the same to the
 * last bit by one thread and by two. */
static void a_costume_comes_to_rest(void **state)
{
    (void)state;
    const char *wanted = getenv("TSUYA_BENCH_LEVELS"), *spacing = getenv("TSUYA_BENCH_SPACING");
    int levels = wanted ? (int)strtol(wanted, NULL, 10) : 2;
    double coarse = (spacing ? strtod(spacing, NULL) : 0.0056) * (1 << levels);
    tsuya_drape_sheet sheet[2];
    for (int k = 0; k < 2; k++) {
        tsuya_drape_info info;
        size_t crossings;
        double clock = tsuya_clock_s(), used = drape(&sheet[k], &info, 0.5, coarse, levels, k + 1);
        clock = tsuya_clock_s() - clock;
        assert_ok(tsuya_drape_intersections(&crossings, &sheet[k]));
        print_message("%zu vertices, %d levels, %d threads: %d steps, %d newton, %.1f s of cpu, %.1f s; energy %.6g J, rise %.1e J, speed %.1e m/s, "
                      "%d contacts, %zu crossings\n", sheet[k].vertex_count, levels, k + 1, info.steps, info.newton_steps, used, clock, info.energy_j,
                      info.energy_rise_j, info.speed_m_s, info.contacts, crossings);
        assert_true(info.at_rest && crossings == 0 && info.energy_rise_j <= 1e-9);
        assert_true(used < 60.0);
    }
    assert_memory_equal(sheet[0].position, sheet[1].position, 3 * sheet[0].vertex_count * sizeof(double));
    tsuya_drape_sheet_free(&sheet[0]);
    tsuya_drape_sheet_free(&sheet[1]);
}

/* Cusick's swatch in finer cells: how far its drape coefficient is from the finest one's, and what that costs. */
static void finer_cells_drape_alike(void **state)
{
    (void)state;
    static const double spacing_m[] = {0.01, 0.0075, 0.006};
    enum { MESHES = 3 };
    for (int k = 0; k < 2; k++) {
        double coefficient[MESHES], used[MESHES], spread;
        for (int m = 0; m < MESHES; m++) {
            swatch w = swatch_alike(k ? 0.03 : 0.02);
            w.spacing_m = spacing_m[m];
            used[m] = cpu_s();
            coefficient[m] = settled(&w, k ? 1 : 4, &spread).coefficient;
            used[m] = cpu_s() - used[m];
        }
        for (int m = 0; m < MESHES - 1; m++) {
            char method[64];
            snprintf(method, sizeof method, "%d cm in cells of %.1f mm", 2 + k, 1e3 * spacing_m[m]);
            bench_point("drape coefficient", method, fabs(coefficient[m] - coefficient[MESHES - 1]), "points", used[m], "s of cpu");
        }
        assert_true(fabs(coefficient[1] - coefficient[MESHES - 1]) < 2.0);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(finer_cells_drape_alike), cmocka_unit_test(a_costume_comes_to_rest)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
