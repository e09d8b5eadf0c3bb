/* The cloth's own model by itself: a net as a sum of products of curves, and floats like doubles on every processor, whichever this is. */
#include "brdf/sheen.h"
#include "brdf/dye.h"
#include "brdf/sheen_tables.h"
#include "core/context.h"
#include "core/memory.h"
#include "support.h"

#include <math.h>
#include <string.h>

typedef struct shape {
    int spans, nu, nv, nd;
    double gloss, lowest_cosine;
} shape;

/* Fits the registers of the wide tables, just and not at all; with and without S, θd and Fresnel's term. */
static const shape shapes[] = {
    {36, 0, 0, 0, 0, 0},        {36, 0, 0, 0, 0.02, 0.0},   {36, 12, 20, 0, 0, 0},      {36, 12, 20, 0, 0.02, 0.3}, {36, 12, 20, 6, 0, 0},
    {36, 12, 20, 6, 0.02, 0.0}, {47, 16, 31, 15, 0.02, 0.7}, {48, 12, 20, 6, 0.02, 0.0}, {36, 17, 20, 0, 0.02, 0.0}, {36, 7, 1, 1, 0.02, 0.0},
    {31, 8, 15, 6, 0.02, 0.5}, {45, 8, 15, 6, 0.02, 0.2},
};

/* Three products over φ, signed θ and θd that pass the pole smoothly; v is 0 at the pole's control value. */
static double net_value(double phi, double v, double d, int c)
{
    return 0.4 * (c + 1) * cos(2.0 * phi) * v * v * (1.0 + d) + 0.3 * cos(phi - 0.4) * v * (1.0 - 0.5 * d) - (0.2 + 0.1 * c) * (v * v + d);
}

static void fill_net(tsuya_sheen *s)
{
    for (int k = 0; k < tsuya_sheen_net_points(s->nu, s->nv, s->nd); ++k) {
        int v = k % (s->nv + 3), u = k / (s->nv + 3) % s->nu, d = k / (s->nv + 3) / s->nu;
        for (int c = 0; c < s->channels; ++c) {
            s->net[(size_t)k * (size_t)s->line + (size_t)c] =
                (float)net_value(2.0 * M_PI * u / s->nu, (double)(v - 1) / s->nv, s->nd > 0 ? (double)d / s->nd : 0.0, c);
        }
    }
}

static tsuya_sheen *made(const shape *of)
{
    tsuya_sheen *s;
    assert_ok(tsuya_sheen_create(&s, 3, of->spans, of->nu, of->nv, of->nd));
    assert_ok(tsuya_sheen_create_net(s));
    for (int k = 0; k < TSUYA_SHEEN_CURVES; ++k) {
        for (int i = 0; i < of->spans + 3; ++i) {
            double psi = M_PI * (i - 1.0) / of->spans - 0.5 * M_PI;
            s->curve[k][i] = -(k % 2 ? 6.0 : 1.5) * (psi - 0.1 * k) * (psi - 0.1 * k) + 0.1 * sin(5.0 * psi);
        }
    }
    for (int c = 0; c < 3; ++c) {
        s->strength[0][c] = 0.2 + 0.05 * c;
        s->strength[1][c] = 0.1 - 0.03 * c;
        s->matte[c] = 0.05;
    }
    memcpy(s->slant, (double[2][2]){{1.0, -0.5}, {-0.3, 0.8}}, sizeof s->slant);
    s->reach[0] = 0.3;
    s->reach[1] = 0.2;
    s->eta = of->gloss > 0.0 ? 1.55 : 1.0;
    s->lowest_cosine = of->lowest_cosine;
    s->gloss[0] = of->gloss;
    s->gloss[1] = 0.5 * of->gloss;
    fill_net(s);
    return s;
}

static tsuya_vec3 random_direction(uint64_t stream, uint64_t k)
{
    double z = 0.002 + 0.998 * tsuya_random_uniform(7, stream, 2 * k), r = sqrt(1.0 - z * z), phi = 2.0 * M_PI * tsuya_random_uniform(7, stream, 2 * k + 1);
    return (tsuya_vec3){r * cos(phi), r * sin(phi), z};
}

/* What the whole net says, by its own weights. */
static void test_terms_of_a_net(void **state)
{
    (void)state;
    for (size_t n = 0; n < sizeof shapes / sizeof shapes[0]; ++n) {
        if (shapes[n].nu == 0) {
            continue;
        }
        enum { COUNT = 300 };
        static double net[COUNT][3];
        tsuya_sheen *s = made(&shapes[n]);
        for (int turn = 0; turn < 2; ++turn) {
            for (uint64_t k = 0; k < COUNT; ++k) {
                tsuya_half_angles a = tsuya_half_angles_of(random_direction(1, k), random_direction(2, k));
                int index[64];
                double weight[64], terms[3];
                if (turn == 0) {
                    int count = tsuya_sheen_stencil(index, weight, &a, s->nu, s->nv, s->nd);
                    for (int i = 0; i < 3 * count; ++i) {
                        net[k][i % 3] = (i < 3 ? 0.0 : net[k][i % 3]) + weight[i / 3] * (double)s->net[(size_t)index[i / 3] * (size_t)s->line + (size_t)(i % 3)];
                    }
                    continue;
                }
                tsuya_sheen_surface(terms, s, &a);
                for (int c = 0; c < 3; ++c) {
                    assert_near(terms[c], net[k][c], 5e-3);
                }
            }
            if (turn == 0) {
                assert_ok(tsuya_sheen_separate(s, NULL, NULL));
                assert_true(s->terms > 0 && s->terms <= 6 && !s->net);
            }
        }
        tsuya_sheen_free(s);
    }
}

typedef void kernel(const tsuya_sheen *s, int channels, const tsuya_direction_batch *batch, float *value);

static void check_kernel(kernel *eval, const char *name, const tsuya_sheen *s, size_t n)
{
    enum { MOST = 1031 };
    static const int counts[] = {1, 15, 16, 17, 127, 128, 129, MOST};
    static float d[6][MOST], value[3 * MOST];
    for (uint64_t k = 0; k < MOST; ++k) {
        tsuya_vec3 wi = random_direction(3, k), wo = k % 3 == 0 ? (tsuya_vec3){-wi.x, -wi.y, wi.z} : random_direction(4, k);
        const double all[6] = {wi.x, wi.y, wi.z, wo.x, wo.y, wo.z};
        for (int i = 0; i < 6; ++i) {
            d[i][k] = (float)all[i];
        }
    }
    for (size_t i = 0; i < sizeof counts / sizeof counts[0]; ++i) {
        const tsuya_direction_batch batch = {counts[i], d[0], d[1], d[2], d[3], d[4], d[5]};
        eval(s, 3, &batch, value);
        for (int k = 0; k < counts[i]; ++k) {
            double f[3];
            tsuya_sheen_eval(s, 3, (tsuya_vec3){d[0][k], d[1][k], d[2][k]}, (tsuya_vec3){d[3][k], d[4][k], d[5][k]}, f);
            for (int c = 0; c < 3; ++c) {
                if (!(fabs((double)value[c * counts[i] + k] - f[c]) <= 1e-4 * f[c])) {
                    fail_msg("%s, shape %zu, %d of %d: float %.9g, double %.9g", name, n, k, counts[i], (double)value[c * counts[i] + k], f[c]);
                }
            }
        }
    }
}

static void test_floats_on_every_processor(void **state)
{
    (void)state;
    for (size_t n = 0; n < sizeof shapes / sizeof shapes[0]; ++n) {
        tsuya_sheen *s = made(&shapes[n]);
        assert_ok(tsuya_sheen_separate(s, NULL, NULL));
        assert_ok(tsuya_sheen_prepare(s));
        check_kernel(tsuya_sheen_eval_rows, "rows", s, n);
        if (s->wide) {
            check_kernel(tsuya_sheen_eval_wide, "wide", s, n);
        }
        tsuya_sheen_free(s);
    }
}

/* Below the surface, on it, and not finite. */
static void check_clears(kernel *eval, const tsuya_sheen *s)
{
    enum { COUNT = 20 };
    static const float bad[5] = {-0.5f, 0.0f, NAN, INFINITY, -INFINITY};
    float d[6][COUNT], value[3 * COUNT];
    for (int k = 0; k < COUNT; ++k) {
        for (int i = 0; i < 6; ++i) {
            d[i][k] = i % 3 == 2 ? 0.8f : 0.6f * (float)(i % 3);
        }
        d[k < 10 ? 2 : 5][k] = k % 2 ? bad[k / 2 % 5] : d[2][k];
        d[k < 10 ? 0 : 4][k] = k % 4 == 2 ? NAN : d[0][k];
    }
    const tsuya_direction_batch batch = {COUNT, d[0], d[1], d[2], d[3], d[4], d[5]};
    eval(s, 3, &batch, value);
    for (int k = 0; k < 3 * COUNT; ++k) {
        assert_true(k % COUNT % 4 == 0 ? value[k] > 0.0f : value[k] == 0.0f);
    }
}

static void test_unseen_directions(void **state)
{
    (void)state;
    for (size_t n = 0; n < sizeof shapes / sizeof shapes[0]; ++n) {
        tsuya_sheen *s = made(&shapes[n]);
        assert_ok(tsuya_sheen_separate(s, NULL, NULL));
        assert_ok(tsuya_sheen_prepare(s));
        check_clears(tsuya_sheen_eval_rows, s);
        if (s->wide) {
            check_clears(tsuya_sheen_eval_wide, s);
        }
        tsuya_sheen_free(s);
    }
}

/* Cloths that would reflect too much near the horizon, and everywhere: floats hold them as doubles do. */
static void test_limited_batches(void **state)
{
    (void)state;
    enum { COUNT = 2000 };
    static float d[6][COUNT], value[3 * COUNT];
    bool near_horizon = false, everywhere = false;
    for (int turn = 0; turn < 3; ++turn) {
        tsuya_sheen *s = made(&(shape){36, 0, 0, 0, 0, 0});
        tsuya_material *m;
        for (int k = 0; k < 3 * 3; ++k) {
            (k < 3 ? s->strength[0] : k < 6 ? s->strength[1] : s->matte)[k % 3] *= (double[]){3.7, 4.4, 60.0}[turn];
        }
        assert_ok(tsuya_sheen_prepare(s));
        assert_ok(tsuya_material_create(&m, &tsuya_brdf_yarn, s, "bright", 3, NULL));
        near_horizon |= m->limit && m->limit->level_above < 0.5f;
        everywhere |= m->limit && m->limit->level_above > 1.0f;
        for (uint64_t k = 0; k < COUNT; ++k) {
            tsuya_vec3 wi = random_direction(10, k), wo = random_direction(11, k);
            const double all[6] = {wi.x, wi.y, wi.z, wo.x, wo.y, wo.z};
            for (int i = 0; i < 6; ++i) {
                d[i][k] = (float)all[i];
            }
        }
        const tsuya_direction_batch batch = {COUNT, d[0], d[1], d[2], d[3], d[4], d[5]};
        tsuya_material_eval_batch(m, NULL, &batch, value);
        for (int k = 0; k < COUNT; ++k) {
            double f[3];
            tsuya_material_eval(m, NULL, (tsuya_vec3){d[0][k], d[1][k], d[2][k]}, (tsuya_vec3){d[3][k], d[4][k], d[5][k]}, f);
            for (int c = 0; c < 3; ++c) {
                assert_near((double)value[c * COUNT + k], f[c], 1e-4 * f[c]);
            }
        }
        tsuya_material_free(m);
    }
    assert_true(near_horizon && everywhere);
}

/* The largest factors that a file may hold: large, but finite. */
static void test_extreme_terms(void **state)
{
    (void)state;
    tsuya_sheen *s = made(&(shape){36, 12, 20, 6, 0.02, 0.0});
    s->terms = TSUYA_SHEEN_TERMS;
    for (int factor = 0; factor < TSUYA_SHEEN_FACTORS; ++factor) {
        for (int k = 0; k < s->terms * tsuya_sheen_factor_size(s, factor); ++k) {
            s->factor[factor][k] = 200.0;
        }
    }
    for (uint64_t k = 0; k < 100; ++k) {
        double f[3];
        tsuya_sheen_eval(s, 3, random_direction(5, k), random_direction(6, k), f);
        assert_true(isfinite(f[0]) && isfinite(f[1]) && isfinite(f[2]));
    }
    tsuya_sheen_free(s);
}

/* A file of an older version, whose S is one number everywhere. */
static tsuya_material *with_net(const char *model, int points, double log_value)
{
    char *text = tsuya_calloc(20000, 1), *at = text;
    tsuya_material *m;
    assert_non_null(text);
    at += sprintf(at, "{\"format\":\"tsuya material\",\"version\":\"1.0\",\"name\":\"n\",\"channels\":[\"r\",\"g\",\"b\"],\"model\":\"%s\",\"parameters\":{\"intervals_psi\":4", model);
    for (int k = 0; k < 4; ++k) {
        at += sprintf(at, ",\"%s\":[-3,-2,-1,0,-1,-2,-3]", (const char *[]){"warp_along", "warp_across", "weft_along", "weft_across"}[k]);
    }
    at += sprintf(at, ",\"slant\":[0,0,0,0],\"strength_warp\":[0.1,0.1,0.1],\"strength_weft\":[0.05,0.05,0.05],\"matte\":[0.02,0.02,0.02],"
                      "\"surface\":{\"functions_phi\":5,\"intervals_theta\":2,\"intervals_theta_d\":1,\"log_control\":[");
    for (int k = 0; k < 3 * points; ++k) {
        at += sprintf(at, "%s%g", k ? "," : "", log_value * (1 + k % 3));
    }
    sprintf(at, "]}}}");
    assert_ok(tsuya_material_parse(&m, text, "old.json"));
    tsuya_free(text);
    return m;
}

static void test_nets_of_older_files(void **state)
{
    (void)state;
    for (int deep = 0; deep < 2; ++deep) {
        const char *model = deep ? "nurbs3" : "ndf";
        int points = 5 * 5 * (deep ? 4 : 1);
        tsuya_material *plain = with_net(model, points, 0.0), *risen = with_net(model, points, -0.2);
        for (uint64_t k = 0; k < 100; ++k) {
            double f[3], g[3];
            tsuya_vec3 wi = random_direction(8, k), wo = random_direction(9, k);
            tsuya_material_eval(plain, NULL, wi, wo, f);
            tsuya_material_eval(risen, NULL, wi, wo, g);
            for (int c = 0; c < 3; ++c) {
                assert_near(g[c], f[c] * exp(-0.2 * (1 + c)), 1e-5 * f[c]);
            }
        }
        tsuya_material_free(plain);
        tsuya_material_free(risen);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {cmocka_unit_test(test_terms_of_a_net), cmocka_unit_test(test_floats_on_every_processor),
                                       cmocka_unit_test(test_unseen_directions), cmocka_unit_test(test_limited_batches), cmocka_unit_test(test_extreme_terms), cmocka_unit_test(test_nets_of_older_files)};
    return cmocka_run_group_tests(tests, NULL, NULL);
}
