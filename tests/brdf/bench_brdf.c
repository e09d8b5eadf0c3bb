/* Error beside time: every model on cloths that no model describes, the project's bars under each table; what a fit costs by the number of
 * samples; whether sampling follows its density, and what energy and reciprocity say.
 *
 *     bench_brdf [MOST_SAMPLES]     (default 1000000; 10000000 takes minutes more)
 *
 * Times are processor time where it says so; evaluations are timed in turn with those of ggx-aniso. */
#include "bench.h"
#include "brdf/chi_square.h"
#include "brdf/fit.h"
#include "brdf/truth.h"
#include "core/context.h"
#include "core/memory.h"
#include "support.h"

#include <time.h>

enum { MODELS = 9, PARTS = 3, AUTO = MODELS, GGX_ANISO = 2 };
static const char *const model_names[MODELS + 1] = {"lambert", "ggx", "ggx-aniso", "ward", "ashikhmin", "tanaka", "yarn", "ndf", "nurbs3", "auto"};

/* Processor time of all threads: other work on the machine does not count. */
static double cpu_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

typedef struct cloth_case {
    const char *name;
    const char *const *part; /* of what is held out */
    double bar[PARTS];       /* e_cbrt; NaN: none is set */
    double of_lobes[PARTS];  /* and at most this share of the best fitted lobe */
} cloth_case;

static const char *const bench_parts[PARTS] = {"held-out tilts", "held-out azimuths", "another geometry"};
static const char *const fabric_parts[PARTS] = {"all held out", "azimuth 0", "azimuth 90"};

typedef struct row {
    tsuya_fit_info info;
    tsuya_material *material;
    double error[PARTS], ns, ggx_ns, cpu_s, float_error;
} row;

/* The largest deviation of float batches from double, relative to the value or to the peak's thousandth. */
static double float_error(const tsuya_material *m)
{
    enum { COUNT = 4099, CHANNELS = 3 };
    static float d[6][COUNT], value[CHANNELS * COUNT];
    static double truth[CHANNELS * COUNT];
    const tsuya_direction_batch batch = {COUNT, d[0], d[1], d[2], d[3], d[4], d[5]};
    int channels = tsuya_material_get_info(m).channel_count;
    double peak = 0.0, worst = 0.0;
    for (int k = 0; k < COUNT; ++k) {
        for (int i = 0; i < 2; ++i) {
            double z = 0.01 + 0.99 * tsuya_random_uniform(3, (uint64_t)i, 2 * (uint64_t)k), r = sqrt(1.0 - z * z);
            double phi = 2.0 * M_PI * tsuya_random_uniform(3, (uint64_t)i, 2 * (uint64_t)k + 1);
            d[3 * i][k] = (float)(r * cos(phi));
            d[3 * i + 1][k] = (float)(r * sin(phi));
            d[3 * i + 2][k] = (float)z;
        }
        double f[CHANNELS];
        tsuya_material_eval(m, NULL, (tsuya_vec3){d[0][k], d[1][k], d[2][k]}, (tsuya_vec3){d[3][k], d[4][k], d[5][k]}, f);
        for (int c = 0; c < channels; ++c) {
            truth[c * COUNT + k] = f[c];
            peak = fmax(peak, f[c]);
        }
    }
    tsuya_material_eval_batch(m, NULL, &batch, value);
    for (int k = 0; k < channels * COUNT; ++k) {
        worst = fmax(worst, fabs((double)value[k] - truth[k]) / fmax(truth[k], 1e-3 * peak));
    }
    return worst;
}

static void time_in_turn(row *rows)
{
    for (int m = 0; m <= MODELS; ++m) {
        rows[m].ns = rows[m].ggx_ns = INFINITY;
        for (int turn = 0; turn < 12; ++turn) {
            double own, ggx;
            assert_ok(tsuya_material_time(&own, rows[m].material));
            assert_ok(tsuya_material_time(&ggx, rows[GGX_ANISO].material));
            rows[m].ns = fmin(rows[m].ns, own);
            rows[m].ggx_ns = fmin(rows[m].ggx_ns, ggx);
        }
    }
}

static void fit_all(row *rows, const tsuya_samples *fit, const tsuya_samples *const held[PARTS])
{
    tsuya_context context = tsuya_context_default();
    for (int m = 0; m <= MODELS; ++m) {
        const tsuya_fit_options options = {model_names[m], model_names[m], NAN};
        double begin = cpu_s();
        assert_ok(tsuya_brdf_fit(&rows[m].material, &rows[m].info, NULL, NULL, fit, &options, &context));
        rows[m].cpu_s = cpu_s() - begin;
        rows[m].float_error = float_error(rows[m].material);
        for (int p = 0; p < PARTS; ++p) {
            rows[m].error[p] = truth_error(rows[m].material, held[p], -1);
        }
    }
    time_in_turn(rows);
}

static void print_row(const cloth_case *c, const row *r, const char *name)
{
    char part[64];
    printf("%-22s %9.4f %9.4f %9.4f %9.2f %8.2f %8zu %8.2f %8.2f %10.1e %9.4f %9.1e\n", name, r->error[0], r->error[1], r->error[2], r->ns, r->ns / r->ggx_ns,
           r->info.bytes, r->info.seconds, r->cpu_s, r->info.reciprocity_deficit, r->info.furnace, r->float_error);
    for (int p = 0; p < PARTS; ++p) {
        snprintf(part, sizeof part, "%s: %s", c->name, c->part[p]);
        bench_point(part, name, r->error[p], "e_cbrt", r->ns, "ns per evaluation");
    }
}

static void print_bars(const cloth_case *c, const row *rows)
{
    const int lobes[] = {1, GGX_ANISO, 3, 4};
    printf("%-22s", "bar");
    for (int p = 0; p < PARTS; ++p) {
        printf(isfinite(c->bar[p]) ? " %9.3f" : "         -", c->bar[p]);
    }
    printf("      12.0     1.50    65536                       1.0e-06    1.0010   1.0e-04\n%-22s", "auto, of best lobe");
    for (int p = 0; p < PARTS; ++p) {
        double best = INFINITY;
        for (int k = 0; k < 4; ++k) {
            best = fmin(best, rows[lobes[k]].error[p]);
        }
        printf(" %9.2f", rows[AUTO].error[p] / best);
    }
    if (isfinite(c->of_lobes[0])) {
        printf("     bar %.2f %.2f %.2f", c->of_lobes[0], c->of_lobes[1], c->of_lobes[2]);
    }
    printf("\n\n");
}

/* Rows stay for the caller: free_rows. */
static void measure(row rows[MODELS + 1], const cloth_case *c, const tsuya_samples *fit, const tsuya_samples *const held[PARTS])
{
    fit_all(rows, fit, held);
    printf("%s: %d readings, e_cbrt on what is held out (%s; %s; %s)\n", c->name, fit->count, c->part[0], c->part[1], c->part[2]);
    printf("%-22s %9s %9s %9s %9s %8s %8s %8s %8s %10s %9s %9s\n", "model", "first", "second", "third", "eval_ns", "of_ggx", "bytes", "fit_s", "cpu_s",
           "recipr", "furnace", "float");
    for (int m = 0; m <= MODELS; ++m) {
        char name[32];
        snprintf(name, sizeof name, m == AUTO ? "%s (%s)" : "%s", model_names[m], rows[m].info.model);
        print_row(c, &rows[m], name);
    }
    print_bars(c, rows);
}

static void free_rows(row *rows)
{
    for (int m = 0; m <= MODELS; ++m) {
        tsuya_material_free(rows[m].material);
    }
}

/* The draws of every model of one cloth; the bar is that of the whole family of tests. */
static void sample_all(const char *name, const row *rows)
{
    const double theta[] = {0.0, 35.0, 70.0, 85.0};
    double bar = chi_square_bar(4 * MODELS);
    printf("sampling of %s: chi-square of 1e6 draws as a standard normal; bar %.2f (1 %%, Sidak over %d tests)\n", name, bar, 4 * MODELS);
    for (int m = 0; m < MODELS; ++m) {
        double worst = -INFINITY, begin = cpu_s();
        printf("%-12s", model_names[m]);
        for (int k = 0; k < 4; ++k) {
            double t = tsuya_rad_from_deg(theta[k]), p = tsuya_rad_from_deg(25.0 + 90.0 * k);
            int freedom;
            double z = chi_square_z(&freedom, rows[m].material, (tsuya_vec3){sin(t) * cos(p), sin(t) * sin(p), cos(t)}, (uint64_t)(4 * m + k));
            printf(" %6.2f (%4d)", z, freedom);
            worst = fmax(worst, z);
        }
        printf("   %s, %.1f s\n", worst <= bar ? "passes" : "FAILS", cpu_s() - begin);
    }
    printf("\n");
}

/* Directions over the hemisphere to 80°, every other pair about the mirror, as a gonioreflectometer's table has them. */
static void scattered(tsuya_samples *s, int count, const tsuya_microcylinder *cloth)
{
    assert_ok(tsuya_samples_create(s, count, 3, NULL));
#pragma omp parallel for schedule(static)
    for (int k = 0; k < count; ++k) {
        tsuya_vec3 w[2];
        for (int i = 0; i < 2; ++i) {
            double z = 0.18 + 0.82 * tsuya_random_uniform(5, (uint64_t)i, 2 * (uint64_t)k), r = sqrt(1.0 - z * z);
            double phi = 2.0 * M_PI * tsuya_random_uniform(5, (uint64_t)i, 2 * (uint64_t)k + 1);
            w[i] = (tsuya_vec3){r * cos(phi), r * sin(phi), z};
        }
        tsuya_vec3 near = tsuya_vec3_unit(tsuya_vec3_mad((tsuya_vec3){-w[0].x, -w[0].y, w[0].z}, 0.4, w[1]));
        s->wi[k] = w[0];
        s->wo[k] = k % 2 && near.z > 0.18 ? near : w[1];
        tsuya_microcylinder_eval_reciprocal(cloth, s->wi[k], s->wo[k], s->value + 3 * (size_t)k);
        for (int c = 0; c < 3; ++c) {
            s->value[3 * (size_t)k + (size_t)c] *= fmax(0.0, 1.0 + 0.01 * tsuya_random_normal(5, 7, 3 * (uint64_t)k + (uint64_t)c));
        }
    }
}

static void fit_by_count(const tsuya_microcylinder *satin, int most)
{
    static const char *const names[] = {"ggx-aniso", "yarn", "ndf", "nurbs3", "auto"};
    tsuya_context context = tsuya_context_default();
    tsuya_microcylinder coarse = *satin;
    coarse.step_deg = 4.0; /* eight times cheaper, and a truth as good */
    tsuya_samples held;
    scattered(&held, 20011, &coarse);
    printf("what a fit costs, held-out fits included; bar: 1000000 samples in 20 s on 2 cores\n%-12s %10s %10s %10s %12s %10s\n", "model", "samples", "seconds",
           "cpu_s", "us_a_sample", "e_cbrt");
    for (int count = 1000; count <= most && count > 0; count *= 10) {
        tsuya_samples s;
        scattered(&s, count, &coarse);
        for (size_t m = 0; m < sizeof names / sizeof *names; ++m) {
            const tsuya_fit_options options = {names[m], names[m], NAN};
            tsuya_fit_info info;
            tsuya_material *material;
            double begin = cpu_s();
            assert_ok(tsuya_brdf_fit(&material, &info, NULL, NULL, &s, &options, &context));
            double cpu = cpu_s() - begin, error = truth_error(material, &held, -1);
            char part[64];
            printf("%-12s %10d %10.2f %10.2f %12.2f %10.4f\n", names[m], count, info.seconds, cpu, 1e6 * info.seconds / count, error);
            snprintf(part, sizeof part, "fit of %d samples", count);
            bench_point(part, names[m], error, "e_cbrt", 1e6 * info.seconds / count, "us a sample");
            tsuya_material_free(material);
        }
        tsuya_samples_free(&s);
    }
    tsuya_samples_free(&held);
}

static void measure_cloth(const cloth_case *c, const truth_cloth *cloth, uint64_t seed, bool sampling)
{
    truth_set set;
    row rows[MODELS + 1];
    truth_set_read_cloth(&set, cloth, 0.01, seed);
    const tsuya_samples *const held[PARTS] = {&set.tilts, &set.azimuths, &set.geometry};
    measure(rows, c, &set.fit, held);
    if (sampling) {
        sample_all(c->name, rows);
    }
    free_rows(rows);
    truth_set_free(&set);
}

static void measure_fabric(void)
{
    const cloth_case c = {"measured fabric", fabric_parts, {0.022, 0.030, 0.024}, {NAN, NAN, NAN}};
    tsuya_samples fit, all, along, across;
    row rows[MODELS + 1];
    if (!truth_fabric_read(&fit, &all)) {
        printf("measured fabric: its curves are not there, skipped\n");
        return;
    }
    truth_at_azimuth(&along, &all, 0);
    truth_at_azimuth(&across, &all, 90);
    const tsuya_samples *const held[PARTS] = {&all, &along, &across};
    measure(rows, &c, &fit, held);
    free_rows(rows);
    tsuya_samples_free(&fit);
    tsuya_samples_free(&all);
    tsuya_samples_free(&along);
    tsuya_samples_free(&across);
}

int main(int argc, char **argv)
{
    static const struct { const char *key; cloth_case c; } published[] = {
        {"polyester_satin_charm", {"satin", bench_parts, {0.015, 0.065, 0.055}, {0.15, 0.45, 0.55}}},
        {"silk_crepe_de_chine", {"crepe", bench_parts, {0.007, 0.038, 0.033}, {NAN, NAN, NAN}}},
        {"linen_plain", {"linen", bench_parts, {0.005, 0.013, 0.012}, {NAN, NAN, NAN}}},
    };
    int most = argc > 1 ? atoi(argv[1]) : 1000000;
    setvbuf(stdout, NULL, _IOLBF, 0);
    const char *path = test_data("brdf/microcylinder_fits.txt");
    tsuya_microcylinder cloth, satin = truth_steep_twill;
    for (size_t k = 0; path && k < 3; ++k) {
        assert_ok(tsuya_microcylinder_load(&cloth, path, published[k].key));
        satin = k == 0 ? cloth : satin;
        const truth_cloth truth = truth_of_microcylinder(&cloth);
        measure_cloth(&published[k].c, &truth, 1, k == 0);
    }
    const cloth_case twill = {"steep twill", bench_parts, {NAN, NAN, NAN}, {NAN, NAN, NAN}};
    const truth_cloth truth = truth_of_microcylinder(&truth_steep_twill);
    measure_cloth(&twill, &truth, 3, !path);
    for (int k = 0; truth_weaves[k]; ++k) {
        tsuya_irawan weave;
        const cloth_case c = {truth_weaves[k], bench_parts, {NAN, NAN, NAN}, {NAN, NAN, NAN}};
        if (truth_weave_load(&weave, truth_weaves[k])) {
            const truth_cloth woven = truth_of_irawan(&weave);
            measure_cloth(&c, &woven, 5, false);
        }
    }
    measure_fabric();
    fit_by_count(&satin, most);
    return 0;
}
