/* Readings that are hard, each fitted with every model: what comes out must be finite, never negative, continuous where directions
 * meet, the same in float as in double, reciprocal, and give back no more light than it gets.  tanaka is excepted where its
 * definition is: there reciprocity, energy and jumps are its own (tests/brdf/test_tanaka.c). */
#include "brdf/fit.h"
#include "brdf/truth.h"
#include "core/context.h"
#include "core/memory.h"
#include "support.h"

#include <math.h>

enum { MODELS = 9, TANAKA = 5 };
static const char *const models[MODELS] = {"lambert", "ggx", "ggx-aniso", "ward", "ashikhmin", "tanaka", "yarn", "ndf", "nurbs3"};

static const tsuya_microcylinder cloth = {
    .warp = {1.5, {0.05, 0.02, 0.01}, 0.1, 4.0, 8.0, 0.8, 4, {-25, -10, 10, 25}, {1, 2, 1}},
    .weft = {1.5, {0.2, 0.1, 0.05}, 0.5, 20.0, 40.0, 0.2, 2, {0, 0}, {1}},
};

static tsuya_vec3 direction(double theta_deg, double phi_deg)
{
    double t = tsuya_rad_from_deg(theta_deg), p = tsuya_rad_from_deg(phi_deg);
    return (tsuya_vec3){sin(t) * cos(p), sin(t) * sin(p), cos(t)};
}

static tsuya_vec3 random_direction(uint64_t stream, uint64_t k)
{
    double z = 0.002 + 0.998 * tsuya_random_uniform(7, stream, 2 * k), r = sqrt(1.0 - z * z);
    double phi = 2.0 * M_PI * tsuya_random_uniform(7, stream, 2 * k + 1);
    return (tsuya_vec3){r * cos(phi), r * sin(phi), z};
}

/* What makes readings hard: changes `s`, which holds the cloth's readings every 6° with `azimuth` and `tilt` in degrees. */
typedef struct hard_case {
    const char *name;
    void (*change)(tsuya_samples *s);
    bool bright; /* far more than a surface can reflect */
} hard_case;

static int azimuth_of_row(const tsuya_samples *s, int k) { return (int)lround(s->azimuth_deg[k]) / 45; }

static double half_angle_deg(const tsuya_samples *s, int k)
{
    tsuya_vec3 h = tsuya_vec3_unit(tsuya_vec3_add(s->wi[k], s->wo[k]));
    return tsuya_deg_from_rad(acos(fmin(h.z, 1.0)));
}

static void keep_rows(tsuya_samples *s, bool (*keep)(const tsuya_samples *, int))
{
    int n = 0;
    for (int k = 0; k < s->count; ++k) {
        if (keep(s, k)) {
            s->wi[n] = s->wi[k];
            s->wo[n] = s->wo[k];
            s->azimuth_deg[n] = s->azimuth_deg[k];
            memmove(s->value + 3 * n++, s->value + 3 * k, 3 * sizeof *s->value);
        }
    }
    s->count = n;
}

static void scale_all(tsuya_samples *s, double factor)
{
    for (int k = 0; k < 3 * s->count; ++k) {
        s->value[k] *= factor;
    }
}

static void as_it_is(tsuya_samples *s) { (void)s; }
static void tiny(tsuya_samples *s) { scale_all(s, 1e-12); }
static void huge(tsuya_samples *s) { scale_all(s, 1e12); }
static void too_bright(tsuya_samples *s) { scale_all(s, 20.0); }

static void zeros(tsuya_samples *s)
{
    for (int k = 0; k < 3 * s->count; ++k) {
        s->value[k] = k % 3 == 0 || k % 7 == 0 ? 0.0 : s->value[k];
    }
}

static void repeated(tsuya_samples *s)
{
    int half = s->count / 2;
    for (int k = 0; k < half; ++k) { /* the second half repeats the first, and disagrees by a tenth */
        s->wi[half + k] = s->wi[k];
        s->wo[half + k] = s->wo[k];
        s->azimuth_deg[half + k] = s->azimuth_deg[k];
        for (int c = 0; c < 3; ++c) {
            s->value[3 * (half + k) + c] = 1.1 * s->value[3 * k + c];
        }
    }
    s->count = 2 * half;
}

static bool some_tilts(const tsuya_samples *s, int k) { return azimuth_of_row(s, k) % 2 ? half_angle_deg(s, k) > 20.0 : k % 3 > 0; }
static void missing_tilts(tsuya_samples *s) { keep_rows(s, some_tilts); }

static void dark_channel(tsuya_samples *s)
{
    for (int k = 0; k < s->count; ++k) {
        s->value[3 * k + 1] = 0.0;
    }
}

static void clipped(tsuya_samples *s)
{
    for (int k = 0; k < 3 * s->count; ++k) {
        s->value[k] = s->value[k] > 0.1 ? NAN : s->value[k];
    }
}

static void noisy(tsuya_samples *s)
{
    for (int k = 0; k < 3 * s->count; ++k) {
        s->value[k] = fmax(0.0, s->value[k] + 0.05 * tsuya_random_normal(3, 4, (uint64_t)k));
    }
}

/* One degree wide: a single reading of each azimuth sees it. */
static void narrow(tsuya_samples *s)
{
    for (int k = 0; k < 3 * s->count; ++k) {
        double z = half_angle_deg(s, k / 3) / 0.5;
        s->value[k] = 0.02 + 40.0 * exp(-0.5 * z * z);
    }
}

static void four_peaks(tsuya_samples *s)
{
    static const double at[4] = {-24, -6, 6, 24};
    for (int k = 0; k < 3 * s->count; ++k) {
        int spoke = azimuth_of_row(s, k / 3);
        double side = s->wi[k / 3].z > s->wo[k / 3].z ? 1.0 : -1.0, z = (side * half_angle_deg(s, k / 3) - at[spoke]) / 4.0;
        s->value[k] = 0.02 + (1.0 + spoke) * exp(-0.5 * z * z);
    }
}

static bool first_azimuth(const tsuya_samples *s, int k) { return azimuth_of_row(s, k) == 0; }
static void one_azimuth(tsuya_samples *s) { keep_rows(s, first_azimuth); }

static bool every_ninth(const tsuya_samples *s, int k) { return k % 9 == 0 && k < 72 && s->count > 0; }
static void eight(tsuya_samples *s)
{
    keep_rows(s, every_ninth);
    s->count = s->count < 8 ? s->count : 8;
}

static void one_place(tsuya_samples *s)
{
    for (int k = 0; k < s->count; ++k) {
        s->wi[k] = s->wi[0];
        s->wo[k] = s->wo[0];
    }
}

/* Everything on the poles of all coordinates: the light, the viewer and the half vector at the normal. */
static void at_the_poles(tsuya_samples *s)
{
    for (int k = 0; k < s->count; ++k) {
        tsuya_vec3 up = {0.0, 0.0, 1.0}, w = s->wi[k];
        s->wi[k] = k % 3 == 0 ? up : w;
        s->wo[k] = k % 3 == 1 ? up : k % 3 == 2 ? (tsuya_vec3){-w.x, -w.y, w.z} : s->wo[k];
    }
}

static void grazing(tsuya_samples *s)
{
    for (int k = 0; k < s->count; ++k) {
        double z = 1e-9 + 1e-3 * (k % 5), r = sqrt(1.0 - z * z), phi = 0.37 * k;
        s->wi[k] = k % 2 ? s->wi[k] : (tsuya_vec3){r * cos(phi), r * sin(phi), z};
        s->wo[k] = k % 4 ? s->wo[k] : (tsuya_vec3){-r * cos(phi), -r * sin(phi), z};
    }
}

static const hard_case cases[] = {
    {"as it is", as_it_is, false},
    {"scale 1e-12", tiny, false},
    {"scale 1e12", huge, true},
    {"20 times too bright", too_bright, true},
    {"zero values", zeros, false},
    {"repeated tilts", repeated, false},
    {"missing tilts", missing_tilts, false},
    {"one channel dark", dark_channel, false},
    {"clipped", clipped, false},
    {"noise over the floor", noisy, false},
    {"a peak under the step", narrow, false},
    {"four different peaks", four_peaks, false},
    {"one azimuth", one_azimuth, false},
    {"eight readings", eight, false},
    {"all at one place", one_place, false},
    {"at the poles", at_the_poles, false},
    {"grazing", grazing, false},
};
enum { CASES = sizeof cases / sizeof cases[0] };

static void read_case(tsuya_samples *s, const hard_case *hard)
{
    static const double light[] = {30, 30, 60}, view[] = {30, 60, 10};
    assert_ok(tsuya_samples_create(s, 4 * 3 * 17, 3, NULL));
    s->azimuth_deg = tsuya_calloc(4 * 3 * 17, sizeof *s->azimuth_deg);
    assert_non_null(s->azimuth_deg);
    s->count = 0;
    for (int k = 0; k < 4 * 3 * 17; ++k) {
        int bench = k / 17 % 3;
        double azimuth = 45.0 * (k / 51), tilt = 6.0 * (k % 17 - 8);
        tsuya_vec3 wi = tsuya_goniometer_direction(light[bench], 0, azimuth, tilt), wo = tsuya_goniometer_direction(view[bench], 180, azimuth, tilt);
        if (wi.z > 0.17 && wo.z > 0.17) {
            s->wi[s->count] = wi;
            s->wo[s->count] = wo;
            s->azimuth_deg[s->count] = azimuth;
            tsuya_microcylinder_eval_reciprocal(&cloth, wi, wo, s->value + 3 * s->count++);
        }
    }
    hard->change(s);
    tsuya_free(s->azimuth_deg); /* half of the cases have moved what it says */
    s->azimuth_deg = NULL;
}

static void check_pair(const tsuya_material *m, const char *what, tsuya_vec3 wi, tsuya_vec3 wo, bool physical)
{
    double f[3], back[3], albedo[3];
    float one[6] = {(float)wi.x, (float)wi.y, (float)wi.z, (float)wo.x, (float)wo.y, (float)wo.z}, value[3];
    const tsuya_direction_batch batch = {1, &one[0], &one[1], &one[2], &one[3], &one[4], &one[5]};
    double pdf = tsuya_material_eval_pdf(m, NULL, wi, wo, f);
    tsuya_material_eval(m, NULL, wo, wi, back);
    tsuya_material_eval_batch(m, NULL, &batch, value);
    tsuya_material_albedo(m, NULL, wo, albedo);
    bool ok = isfinite(pdf) && pdf >= 0.0;
    for (int c = 0; c < 3; ++c) {
        ok &= isfinite(f[c]) && f[c] >= 0.0 && isfinite(value[c]) && value[c] >= 0.0f && albedo[c] >= 0.0 && albedo[c] <= 1.0 + 1e-6;
        ok &= (wi.z > 0.0 && wo.z > 0.0) || (f[c] == 0.0 && value[c] == 0.0f && pdf == 0.0);
        ok &= !physical || fabs(f[c] - back[c]) <= 1e-6 * fmax(f[c], back[c]);
    }
    if (!ok) {
        fail_msg("%s: wi %g %g %g, wo %g %g %g: f %g %g %g, back %g, float %g %g %g, pdf %g", what, wi.x, wi.y, wi.z, wo.x, wo.y, wo.z, f[0], f[1],
                 f[2], back[0], (double)value[0], (double)value[1], (double)value[2], pdf);
    }
}

static void check_directions(const tsuya_material *m, const char *what, bool physical)
{
    static const double theta[] = {0.0, 1e-9, 30.0, 89.9, 90.0 - 1e-7, 90.0, 90.0 + 1e-9, 180.0}, phi[] = {0.0, 90.0, 180.0, 359.9999999999, 33.0};
    enum { T = sizeof theta / sizeof theta[0], P = sizeof phi / sizeof phi[0] };
    for (int k = 0; k < T * T * P * P; ++k) {
        check_pair(m, what, direction(theta[k % T], phi[k / (T * T) % P]), direction(theta[k / T % T], phi[k / (T * T * P)]), physical);
    }
    for (uint64_t k = 0; k < 500; ++k) {
        check_pair(m, what, random_direction(1, k), random_direction(2, k), physical);
    }
    const double bad[3] = {NAN, INFINITY, -INFINITY};
    for (int k = 0; k < 18; ++k) { /* every component of either direction, once of each kind */
        tsuya_vec3 w[2] = {direction(20, 30), direction(40, 200)};
        (&w[k / 9].x)[k / 3 % 3] = bad[k % 3];
        double f[3], pdf = tsuya_material_eval_pdf(m, NULL, w[0], w[1], f);
        assert_true(pdf == 0.0 && f[0] == 0.0 && f[1] == 0.0 && f[2] == 0.0);
        float one[6] = {(float)w[0].x, (float)w[0].y, (float)w[0].z, (float)w[1].x, (float)w[1].y, (float)w[1].z}, value[3] = {1, 1, 1};
        const tsuya_direction_batch batch = {1, &one[0], &one[1], &one[2], &one[3], &one[4], &one[5]};
        tsuya_material_eval_batch(m, NULL, &batch, value);
        assert_true(value[0] == 0.0f && value[1] == 0.0f && value[2] == 0.0f);
    }
}

/* The poles of light, viewer and half vector, the seams of azimuth: values to either side agree. */
static void check_continuity(const tsuya_material *m, const char *what)
{
    for (int k = 0; k < 24; ++k) {
        double a[3], b[3], phi = 15.0 * k;
        const tsuya_vec3 pair[4][4] = {
            {direction(1e-7, phi), direction(30, 20), direction(0, 0), direction(30, 20)},
            {direction(30, 20), direction(1e-7, phi), direction(30, 20), direction(0, 0)},
            {direction(30, phi), direction(30 + 1e-7, phi + 180), direction(30, phi), direction(30 - 1e-7, phi + 180)},
            {direction(30, 180 - 1e-8), direction(20, phi), direction(30, -180 + 1e-8), direction(20, phi)},
        };
        for (int kind = 0; kind < 4; ++kind) {
            tsuya_material_eval(m, NULL, pair[kind][0], pair[kind][1], a);
            tsuya_material_eval(m, NULL, pair[kind][2], pair[kind][3], b);
            for (int c = 0; c < 3; ++c) {
                if (!(fabs(a[c] - b[c]) <= 1e-4 * fmax(a[c], b[c]))) {
                    fail_msg("%s: kind %d, azimuth %g: %g and %g", what, kind, phi, a[c], b[c]);
                }
            }
        }
    }
}

static void check_float(const tsuya_material *m, const char *what)
{
    enum { COUNT = 1001 };
    static float d[6][COUNT], value[3 * COUNT];
    static double f[COUNT][3];
    const tsuya_direction_batch batch = {COUNT, d[0], d[1], d[2], d[3], d[4], d[5]};
    double peak = 0.0;
    for (int k = 0; k < COUNT; ++k) {
        tsuya_vec3 wi = random_direction(4, (uint64_t)k), wo = random_direction(5, (uint64_t)k);
        wo = k % 3 == 0 ? tsuya_vec3_unit(tsuya_vec3_mad((tsuya_vec3){-wi.x, -wi.y, wi.z}, 0.05, wo)) : wo;
        const double all[6] = {wi.x, wi.y, wi.z, wo.x, wo.y, wo.z};
        for (int i = 0; i < 6; ++i) {
            d[i][k] = (float)all[i];
        }
        tsuya_material_eval(m, NULL, (tsuya_vec3){d[0][k], d[1][k], d[2][k]}, (tsuya_vec3){d[3][k], d[4][k], d[5][k]}, f[k]);
        peak = fmax(fmax(peak, f[k][0]), fmax(f[k][1], f[k][2]));
    }
    tsuya_material_eval_batch(m, NULL, &batch, value);
    for (int k = 0; k < 3 * COUNT; ++k) {
        double exact = f[k % COUNT][k / COUNT];
        if (!(fabs(value[k] - exact) <= 1e-4 * fmax(exact, 1e-3 * peak))) {
            fail_msg("%s: float %.9g, double %.9g (peak %g)", what, (double)value[k], exact, peak);
        }
    }
}

/* ∫ f cosθi dwi from the BRDF on a lattice of its own draws, the largest over the channels. */
static double furnace(const tsuya_material *m, tsuya_vec3 wo)
{
    enum { SIDE = 160 };
    double albedo[3] = {0};
    for (int k = 0; k < SIDE * SIDE; ++k) {
        double f[3], pdf;
        const double u[3] = {(k % SIDE + 0.5) / SIDE, (k / SIDE + 0.5) / SIDE, fmod(0.5 + k * 0.6180339887498949, 1.0)};
        tsuya_vec3 wi;
        if (tsuya_material_sample(m, NULL, wo, u, &wi) && (pdf = tsuya_material_eval_pdf(m, NULL, wi, wo, f)) > 0.0) {
            for (int c = 0; c < 3; ++c) {
                albedo[c] += f[c] * wi.z / (pdf * SIDE * SIDE);
            }
        }
    }
    return fmax(albedo[0], fmax(albedo[1], albedo[2]));
}

static double check_energy(const tsuya_material *m, const char *what)
{
    static const double theta[] = {0, 20, 45, 63, 76, 84, 88.5};
    double highest = 0.0;
    for (int k = 0; k < 14; ++k) {
        double now = furnace(m, direction(theta[k % 7], 11.0 + 57.0 * k));
        highest = fmax(highest, now);
        if (!(now <= 1.0 + 1e-3)) {
            print_message("%s: furnace %.4f at %g degrees\n", what, now, theta[k % 7]);
        }
    }
    return highest;
}

static void test_every_case_with_every_model(void **state)
{
    (void)state;
    tsuya_context context = tsuya_context_default();
    const char *only_case = getenv("TSUYA_HARD_CASE"), *only_model = getenv("TSUYA_HARD_MODEL");
    int bad = 0;
    for (int k = 0; k < CASES * MODELS; ++k) {
        const hard_case *hard = &cases[k / MODELS];
        bool physical = k % MODELS != TANAKA;
        if ((only_case && !strstr(hard->name, only_case)) || (only_model && strcmp(only_model, models[k % MODELS]) != 0)) {
            continue;
        }
        tsuya_samples s;
        tsuya_material *m;
        tsuya_fit_info info;
        char what[96];
        snprintf(what, sizeof what, "%s, %s", hard->name, models[k % MODELS]);
        read_case(&s, hard);
        const tsuya_fit_options options = {"cloth", models[k % MODELS], NAN};
        if (tsuya_brdf_fit(&m, &info, NULL, NULL, &s, &options, &context) != TSUYA_OK) {
            fail_msg("%s: %s", what, tsuya_reason());
        }
        check_directions(m, what, physical);
        check_float(m, what);
        if (physical) {
            check_continuity(m, what);
            double highest = check_energy(m, what);
            bad += !(highest <= 1.0 + 1e-3) || (hard->bright && !(highest > 0.5));
            print_message("%-36s e_cbrt %.4f, furnace %.4f\n", what, info.fit.cbrt, highest);
        }
        tsuya_material_free(m);
        tsuya_samples_free(&s);
    }
    assert_int_equal(bad, 0);
}

/* Readings that rise with the angle between light and camera, at every tilt, as far as 70° between them: what a yarn gains from that ends
 * where the readings do, but for Fresnel's term. */
static void test_slants_end_with_the_readings(void **state)
{
    (void)state;
    tsuya_context context = tsuya_context_default();
    const tsuya_fit_options options = {"cloth", "yarn", NAN};
    tsuya_samples s;
    tsuya_material *m;
    tsuya_fit_info info;
    read_case(&s, &cases[0]);
    int n = 0;
    for (int k = 0; k < s.count; ++k) {
        double apart = 0.25 * (2.0 - 2.0 * tsuya_vec3_dot(s.wi[k], s.wo[k]));
        if (apart < 0.34) {
            s.wi[n] = s.wi[k];
            s.wo[n] = s.wo[k];
            for (int c = 0; c < 3; ++c) {
                s.value[3 * n + c] = s.value[3 * k + c] * exp(8.0 * apart);
            }
            n++;
        }
    }
    s.count = n;
    assert_ok(tsuya_brdf_fit(&m, &info, NULL, NULL, &s, &options, &context));
    for (int azimuth = 0; azimuth < 180; azimuth += 45) {
        double edge[3], beyond[3];
        tsuya_vec3 a = direction(35, azimuth), b = direction(35, azimuth + 180), c = direction(80, azimuth), d = direction(80, azimuth + 180);
        tsuya_material_eval(m, NULL, a, b, edge);
        tsuya_material_eval(m, NULL, c, d, beyond);
        double gain = beyond[1] * (c.z + d.z) / (edge[1] * (a.z + b.z));
        print_message("azimuth %d: what is left of the masking gains %.2f from 35 to 80 degrees\n", azimuth, gain);
        assert_true(gain > 0.0 && gain <= 2.0);
    }
    tsuya_material_free(m);
    tsuya_samples_free(&s);
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_every_case_with_every_model), cmocka_unit_test(test_slants_end_with_the_readings)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
