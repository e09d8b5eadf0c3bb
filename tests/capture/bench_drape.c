/* A costume on its rack: how long until it rests, and how well it does. */
#include "support.h"

#include "capture/drape.h"

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

static void a_costume_comes_to_rest(void **state)
{
    (void)state;
    const char *wanted = getenv("TSUYA_BENCH_LEVELS"), *spacing = getenv("TSUYA_BENCH_SPACING"), *side = getenv("TSUYA_BENCH_SIDE");
    int levels = wanted ? (int)strtol(wanted, NULL, 10) : 2;
    double fine = spacing ? strtod(spacing, NULL) : 0.0058, width = side ? strtod(side, NULL) : 0.5;
    double coarse = fine * (1 << levels), radius = 0.015, gap = 1.2e-3 + 1e-3 + 1.2 * coarse * coarse / (8.0 * radius);
    tsuya_drape_sheet sheet;
    tsuya_drape_fabric f;
    tsuya_drape_info info;
    tsuya_drape_options o = tsuya_drape_options_default();
    tsuya_context context = tsuya_context_default();
    const tsuya_drape_body body[] = {{.shape = TSUYA_DRAPE_BAR, .a = {-0.7, 0, 0}, .b = {0.7, 0, 0}, .radius_m = radius},
                                     {.shape = TSUYA_DRAPE_FLOOR, .a = {0, 0, -1.2 * width}}};
    size_t crossings;
    context.threads = 2;
    assert_true(tsuya_drape_fabric_named(&f, "karaori"));
    assert_ok(tsuya_drape_sheet_karaori(&sheet, width, coarse));
    hang(&sheet, radius + gap);
    double start = cpu_s(), clock = tsuya_clock_s();
    assert_ok(tsuya_drape_settle(&info, &sheet, &f, body, 2, &o, levels, &context));
    double used = cpu_s() - start;
    assert_ok(tsuya_drape_intersections(&crossings, &sheet));
    print_message("%zu vertices, %d levels: %d steps, %d newton, %.1f s of cpu, %.1f s; energy %.6g J, rise %.1e J, speed %.1e m/s, %d contacts, "
                  "%zu crossings%s\n", sheet.vertex_count, levels, info.steps, info.newton_steps, used, tsuya_clock_s() - clock, info.energy_j,
                  info.energy_rise_j, info.speed_m_s, info.contacts, crossings, info.at_rest ? "" : ", NOT AT REST");
    tsuya_drape_sheet_free(&sheet);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(a_costume_comes_to_rest)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
