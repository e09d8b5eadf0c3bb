/* What every reflectance model must keep: reciprocity, energy, sampling that follows its density, float like double, finite
 * at every angle; and materials that survive their JSON while hostile JSON does not get in. */
#include "brdf/material.h"

#include "brdf/chi_square.h"
#include "brdf/fit.h"
#include "capture/microcylinder.h"
#include "core/context.h"
#include "core/memory.h"

#include <math.h>
#include <setjmp.h>
#include <stdarg.h>
#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include <cmocka.h>

enum { MATERIALS = 12, FITTED = 6, TANAKA = 8 }; /* tanaka is neither reciprocal nor bounded nor continuous: tests/brdf/test_tanaka.c */
static tsuya_material *material[MATERIALS];

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

/* A satin of the tests' own: bright ridges along the warp, a dull weft. */
static const tsuya_microcylinder cloth = {
    .warp = {1.5, {0.05, 0.02, 0.01}, 0.1, 4.0, 8.0, 0.8, 4, {-25, -10, 10, 25}, {1, 2, 1}},
    .weft = {1.5, {0.2, 0.1, 0.05}, 0.5, 20.0, 40.0, 0.2, 2, {0, 0}, {1}},
};

static bool fit_materials(void)
{
    static const char *const names[] = {"ward", "ashikhmin", "tanaka", "yarn", "ndf", "nurbs3"};
    const double light[] = {30, 30, 60}, view[] = {30, 60, 10};
    tsuya_samples s;
    tsuya_context context = tsuya_context_default();
    bool ok = tsuya_samples_create(&s, 4 * 3 * 33, 3, NULL) == TSUYA_OK;
    s.count = 0;
    for (int k = 0; ok && k < 4 * 3 * 33; ++k) {
        int bench = k / 33 % 3;
        double azimuth = 45.0 * (k / 99), tilt = 3.0 * (k % 33 - 16);
        tsuya_vec3 wi = tsuya_goniometer_direction(light[bench], 0, azimuth, tilt), wo = tsuya_goniometer_direction(view[bench], 180, azimuth, tilt);
        if (wi.z > 0.17 && wo.z > 0.17) {
            s.wi[s.count] = wi;
            s.wo[s.count] = wo;
            tsuya_microcylinder_eval_reciprocal(&cloth, wi, wo, s.value + 3 * s.count++);
        }
    }
    for (int m = 0; ok && m < MATERIALS - FITTED; ++m) {
        tsuya_fit_info info;
        const tsuya_fit_options options = {names[m], names[m], NAN};
        ok = tsuya_brdf_fit(&material[FITTED + m], &info, NULL, NULL, &s, &options, &context) == TSUYA_OK;
        print_message("%-10s fit %.4f, held out %.4f, %.1f ns, %zu bytes, reciprocity %.2g, furnace %.3f\n", info.model, info.fit.cbrt,
                      info.heldout.cbrt, info.eval_ns, info.bytes, info.reciprocity_deficit, info.furnace);
    }
    tsuya_samples_free(&s);
    return ok;
}

static int set_up(void **state)
{
    (void)state;
    const double white[3] = {1, 1, 1}, plain[3] = {0.047, 0.047, 0.047}, gold[3] = {1.0, 0.7, 0.3}, red[3] = {0.2, 0.02, 0.03};
    const double black[3] = {0, 0, 0};
    bool ok = tsuya_material_lambert(&material[0], white) == TSUYA_OK && tsuya_material_default_silk(&material[1]) == TSUYA_OK &&
              tsuya_material_ggx(&material[2], 0.5, 0.5, plain, 1.55, white) == TSUYA_OK &&
              tsuya_material_ggx(&material[3], 0.1, 0.4, gold, 1.5, red) == TSUYA_OK &&
              tsuya_material_ggx(&material[4], 0.05, 0.02, plain, 1.5, black) == TSUYA_OK &&
              tsuya_material_ggx(&material[5], 1.0, 0.08, plain, 1.8, white) == TSUYA_OK && fit_materials();
    return ok ? 0 : -1;
}

static int tear_down(void **state)
{
    (void)state;
    for (int m = 0; m < MATERIALS; ++m) {
        tsuya_material_free(material[m]);
    }
    return 0;
}

static void test_reciprocity(void **state)
{
    (void)state;
    for (int m = 0; m < MATERIALS; m += m + 1 == TANAKA ? 2 : 1) {
        for (uint64_t k = 0; k < 5000; ++k) {
            double a[3], b[3];
            tsuya_vec3 wi = random_direction(1, k), wo = random_direction(2, k);
            tsuya_material_eval(material[m], NULL, wi, wo, a);
            tsuya_material_eval(material[m], NULL, wo, wi, b);
            for (int c = 0; c < 3; ++c) {
                assert_true(a[c] >= 0.0 && fabs(a[c] - b[c]) <= 1e-6 * fmax(a[c], b[c]));
            }
        }
    }
}

/* ∫ f cosθi dwi by importance sampling with many draws on a lattice; independent of the material's own table. */
static void furnace(const tsuya_material *m, tsuya_vec3 wo, double albedo[3])
{
    enum { SIDE = 220 };
    memset(albedo, 0, 3 * sizeof *albedo);
    for (int k = 0; k < SIDE * SIDE; ++k) {
        double third = fmod(0.5 + k * 0.6180339887498949, 1.0), f[3];
        const double u[3] = {(k % SIDE + 0.5) / SIDE, (k / SIDE + 0.5) / SIDE, third};
        tsuya_vec3 wi;
        if (!tsuya_material_sample(m, NULL, wo, u, &wi)) {
            continue;
        }
        double pdf = tsuya_material_eval_pdf(m, NULL, wi, wo, f);
        for (int c = 0; c < 3; ++c) {
            albedo[c] += f[c] * wi.z / (pdf * SIDE * SIDE);
        }
    }
}

static void test_white_furnace(void **state)
{
    (void)state;
    const double theta[] = {0.0, 15.0, 40.0, 60.0, 75.0, 85.0, 88.5};
    for (int m = 0; m < MATERIALS; m += m + 1 == TANAKA ? 2 : 1) {
        for (size_t k = 0; k < sizeof theta / sizeof theta[0]; ++k) {
            for (int phi = 0; phi < 4; ++phi) {
                double albedo[3], tabulated[3];
                tsuya_vec3 wo = direction(theta[k], 30.0 * phi);
                furnace(material[m], wo, albedo);
                tsuya_material_albedo(material[m], NULL, wo, tabulated);
                for (int c = 0; c < 3; ++c) {
                    if (!(albedo[c] <= 1.0 + 1e-3) || !(fabs(albedo[c] - tabulated[c]) < 4e-3)) {
                        fail_msg("material %d, wo at %g, %d: albedo %g, tabulated %g", m, theta[k], 30 * phi, albedo[c], tabulated[c]);
                    }
                    assert_true(m != 0 || albedo[c] >= 1.0 - 2e-3);
                }
            }
        }
    }
}

static void test_sampling_follows_pdf(void **state)
{
    (void)state;
    const int which[] = {0, 1, 2, 3, 5, 6, 7, 8, 9, 10, 11}; /* the sharp lobe of 4 needs finer cells than any quadrature here */
    const double theta[] = {0.0, 35.0, 70.0, 85.0};
    for (size_t m = 0; m < sizeof which / sizeof which[0]; ++m) {
        for (size_t k = 0; k < sizeof theta / sizeof theta[0]; ++k) {
            tsuya_vec3 wo = direction(theta[k], 25.0 + 90.0 * (double)k);
            int freedom;
            double z = chi_square_z(&freedom, material[which[m]], wo, 10 * m + k);
            if (!(z < chi_square_bar(44))) {
                fail_msg("material %d, wo at %g degrees: chi-square z %.2f with %d degrees of freedom", which[m], theta[k], z, freedom);
            }
        }
    }
}

static void test_batch_like_double(void **state)
{
    (void)state;
    enum { COUNT = 4099 }; /* no multiple of any vector width */
    static float d[6][COUNT], value[3 * COUNT];
    const tsuya_direction_batch batch = {COUNT, d[0], d[1], d[2], d[3], d[4], d[5]};
    for (int k = 0; k < COUNT; ++k) {
        tsuya_vec3 wi = random_direction(4, (uint64_t)k), wo = random_direction(5, (uint64_t)k);
        if (k % 3 == 0) {
            wo = tsuya_vec3_unit(tsuya_vec3_mad((tsuya_vec3){-wi.x, -wi.y, wi.z}, 0.05, wo)); /* near the mirror */
        }
        wi.z = k % 17 == 0 ? -wi.z : wi.z;
        const double all[6] = {wi.x, wi.y, wi.z, wo.x, wo.y, wo.z};
        for (int i = 0; i < 6; ++i) {
            d[i][k] = (float)all[i];
        }
    }
    for (int m = 0; m < MATERIALS; ++m) {
        tsuya_material_eval_batch(material[m], NULL, &batch, value);
        double peak = 0.0;
        for (int k = 0; k < COUNT; ++k) {
            double f[3];
            tsuya_vec3 wi = {d[0][k], d[1][k], d[2][k]}, wo = {d[3][k], d[4][k], d[5][k]};
            tsuya_material_eval(material[m], NULL, wi, wo, f);
            for (int c = 0; c < 3; ++c) {
                peak = fmax(peak, f[c]);
                if (!(fabs(value[c * COUNT + k] - f[c]) <= 1e-4 * fmax(f[c], 1e-3 * peak))) {
                    fail_msg("material %d: float %.9g, double %.9g", m, (double)value[c * COUNT + k], f[c]);
                }
            }
        }
    }
}

/* A view that was looked up once says the same as a lookup with every call, to the bit. */
static void test_view(void **state)
{
    (void)state;
    const double dye[3] = {0.3, 0.0, 0.1};
    for (int k = 0; k < MATERIALS * 200; ++k) {
        const tsuya_material *m = material[k % MATERIALS];
        const double *with = k / MATERIALS % 2 ? dye : NULL;
        tsuya_vec3 wi = random_direction(31, (uint64_t)k), wo = random_direction(32, (uint64_t)k), one, other;
        wo.z = k / MATERIALS % 10 == 3 ? -wo.z : wo.z;
        double a[3], b[3];
        const double u[3] = {tsuya_random_uniform(33, 1, (uint64_t)k), tsuya_random_uniform(33, 2, (uint64_t)k), tsuya_random_uniform(33, 3, (uint64_t)k)};
        tsuya_material_view v = tsuya_material_view_of(m, with, wo);
        assert_true(tsuya_material_view_eval_pdf(&v, wi, a) == tsuya_material_pdf(m, with, wi, wo));
        tsuya_material_eval(m, with, wi, wo, b);
        assert_memory_equal(a, b, sizeof a);
        bool drawn = tsuya_material_view_sample(&v, u, &one);
        assert_true(drawn == tsuya_material_sample(m, with, wo, u, &other));
        assert_true(!drawn || memcmp(&one, &other, sizeof one) == 0);
    }
}

/* Many views at once say the same in float: values, densities, and draws that follow them. */
static void test_looks(void **state)
{
    (void)state;
    enum { N = TSUYA_MATERIAL_LOOKS };
    float d[6][N], dye[3 * N], share[N], rest[3 * N], value[3 * N], pdf[N];
    int beside = 0, all = 0;
    for (int round = 0; round < 20 * MATERIALS; ++round) {
        const tsuya_material *m = material[round % MATERIALS];
        const bool dyed = round / MATERIALS % 2;
        const tsuya_material_looks looks = {m, N, dyed ? dye : NULL, {d[3], d[4], d[5]}, share, rest};
        for (int k = 0; k < N; ++k) {
            tsuya_vec3 wi = random_direction(41, (uint64_t)(round * N + k)), wo = random_direction(42, (uint64_t)(round * N + k));
            wi.z = k % 17 == 0 ? -wi.z : wi.z;
            wo.z = k % 19 == 0 ? -wo.z : wo.z;
            const double both[6] = {wi.x, wi.y, wi.z, wo.x, wo.y, wo.z};
            for (int i = 0; i < 6; ++i) {
                d[i][k] = (float)both[i];
            }
            for (int c = 0; c < 3; ++c) {
                dye[c * N + k] = (float)(0.3 * c * tsuya_random_uniform(43, 1, (uint64_t)k));
            }
        }
        tsuya_material_look(&looks);
        tsuya_material_looks_eval_pdf(&looks, (const float *const[3]){d[0], d[1], d[2]}, value, pdf);
        for (int k = 0; k < N; ++k) {
            const double own[3] = {dye[k], dye[N + k], dye[2 * N + k]};
            tsuya_vec3 wi = {d[0][k], d[1][k], d[2][k]}, wo = {d[3][k], d[4][k], d[5][k]};
            double f[3], density = tsuya_material_eval_pdf(m, dyed ? own : NULL, wi, wo, f);
            for (int c = 0; c < 3; ++c) {
                assert_true(fabs(value[c * N + k] - f[c]) <= 2e-4 * fmax(f[c], 1e-2));
            }
            assert_true((pdf[k] > 0.0f) == (density > 0.0));
            beside += !(fabs(pdf[k] - density) <= 1e-3 * density); /* at the edges of a table's cells either side is right */
            ++all;
        }
    }
    assert_true(beside < all / 500);
    const int which[] = {0, 1, 2, 3, 5, 6, 7, 8, 9, 10, 11};
    for (size_t k = 0; k < sizeof which / sizeof which[0]; ++k) {
        int freedom;
        double z = chi_square_looks_z(&freedom, material[which[k]], direction(20.0 + 5.0 * (double)k, 25.0 + 90.0 * (double)k), 500 + k);
        if (!(z < chi_square_bar(11))) {
            fail_msg("material %d: chi-square z %.2f with %d degrees of freedom", which[k], z, freedom);
        }
    }
}

static void check_finite(const tsuya_material *m, tsuya_vec3 wi, tsuya_vec3 wo)
{
    double f[3], albedo[3];
    float one[6] = {(float)wi.x, (float)wi.y, (float)wi.z, (float)wo.x, (float)wo.y, (float)wo.z}, value[3];
    const tsuya_direction_batch batch = {1, &one[0], &one[1], &one[2], &one[3], &one[4], &one[5]};
    double pdf = tsuya_material_eval_pdf(m, NULL, wi, wo, f);
    tsuya_material_eval_batch(m, NULL, &batch, value);
    tsuya_material_albedo(m, NULL, wo, albedo);
    assert_true(isfinite(pdf) && pdf >= 0.0);
    for (int c = 0; c < 3; ++c) {
        assert_true(isfinite(f[c]) && f[c] >= 0.0 && isfinite(value[c]) && value[c] >= 0.0f);
        assert_true(isfinite(albedo[c]) && albedo[c] >= 0.0 && albedo[c] <= 1.0 + 1e-6);
        assert_true((wi.z > 0.0 && wo.z > 0.0) || (f[c] == 0.0 && value[c] == 0.0f && pdf == 0.0));
    }
}

static void test_hard_directions(void **state)
{
    (void)state;
    const double theta[] = {0.0, 1e-9, 45.0, 89.9, 90.0 - 1e-5, 90.0, 90.0 + 1e-9, 120.0, 180.0};
    const double phi[] = {0.0, 90.0, 180.0 - 1e-12, 180.0, 359.9999999999, 33.0};
    enum { T = sizeof theta / sizeof theta[0], P = sizeof phi / sizeof phi[0] };
    for (int k = 0; k < MATERIALS * T * T * P * P; ++k) {
        int m = k % MATERIALS, a = k / MATERIALS % T, b = k / (MATERIALS * T) % T, p = k / (MATERIALS * T * T) % P;
        check_finite(material[m], direction(theta[a], phi[p]), direction(theta[b], phi[k / (MATERIALS * T * T * P)]));
    }
    for (int m = 0; m < MATERIALS; ++m) {
        const double corners[4][3] = {{0, 0, 0}, {1 - 0x1p-53, 0, 1 - 0x1p-53}, {0, 1 - 0x1p-53, 0.5}, {1 - 0x1p-53, 1 - 0x1p-53, 1 - 0x1p-53}};
        for (int k = 0; k < 4 * T; ++k) {
            tsuya_vec3 wi, wo = direction(theta[k / 4], 40.0);
            if (tsuya_material_sample(material[m], NULL, wo, corners[k % 4], &wi)) {
                assert_true(wi.z > 0.0 && fabs(tsuya_vec3_norm(wi) - 1.0) < 1e-9);
                check_finite(material[m], wi, wo);
            }
        }
    }
}

/* The azimuth of a direction means nothing at the pole, and nothing may jump at its seam. */
static void test_continuity(void **state)
{
    (void)state;
    for (int m = 0; m < MATERIALS; m += m + 1 == TANAKA ? 2 : 1) {
        for (int k = 0; k < 36; ++k) {
            double a[3], b[3];
            tsuya_material_eval(material[m], NULL, direction(1e-7, 10.0 * k), direction(30.0, 20.0), a);
            tsuya_material_eval(material[m], NULL, direction(0.0, 0.0), direction(30.0, 20.0), b);
            assert_true(fabs(a[1] - b[1]) <= 1e-5 * fmax(a[1], b[1]));
            tsuya_material_eval(material[m], NULL, direction(30.0, 180.0 - 1e-8), direction(20.0, 10.0 * k), a);
            tsuya_material_eval(material[m], NULL, direction(30.0, -180.0 + 1e-8), direction(20.0, 10.0 * k), b);
            assert_true(fabs(a[1] - b[1]) <= 1e-5 * fmax(a[1], b[1]));
        }
    }
}

/* Black satin in another colour: linear in the dye, and only the part under the surface changes. */
static void test_dye(void **state)
{
    (void)state;
    const double dyes[3][3] = {{0, 0, 0}, {0.4, 0.2, 0.1}, {0.8, 0.4, 0.2}};
    tsuya_vec3 wi = direction(20, 10), wo = direction(40, 100);
    double f[3][3];
    for (int k = 0; k < 3; ++k) {
        tsuya_material_eval(material[1], dyes[k], wi, wo, f[k]);
    }
    for (int c = 0; c < 3; ++c) {
        assert_true(fabs(f[2][c] - f[0][c] - 2.0 * (f[1][c] - f[0][c])) < 1e-14);
        assert_true(f[1][c] > f[0][c] && f[0][c] > 0.0);
    }
    const double bad[3] = {0.2, 1.5, 0.2};
    assert_int_equal(tsuya_material_set_dye(material[1], bad), TSUYA_ERROR_INPUT);
    assert_non_null(strstr(tsuya_reason(), "1.5"));
}

/* Turned by 90° a cloth with weft and warp exchanged is the same cloth. */
static void test_frame(void **state)
{
    (void)state;
    const double ks[3] = {0.05, 0.05, 0.05}, dye[3] = {0.0, 0.0, 0.0};
    tsuya_material *turned;
    assert_int_equal(tsuya_material_ggx(&turned, 0.10, 0.35, ks, 1.55, dye), TSUYA_OK);
    tsuya_material *straight;
    assert_int_equal(tsuya_material_ggx(&straight, 0.35, 0.10, ks, 1.55, dye), TSUYA_OK);
    double along[3], across[3], again[3];
    tsuya_material_eval(straight, NULL, direction(20, 0), direction(20, 0), along);
    tsuya_material_eval(straight, NULL, direction(20, 90), direction(20, 90), across);
    tsuya_material_eval(turned, NULL, direction(20, 90), direction(20, 90), again);
    assert_true(along[0] > 1.5 * across[0]); /* broad across the warp's fibres, so brighter off the mirror along the weft */
    assert_true(fabs(again[0] - along[0]) < 1e-3 * along[0]);
    tsuya_material_free(turned);
    tsuya_material_free(straight);
}

static void test_json_round_trip(void **state)
{
    (void)state;
    char path[64];
    snprintf(path, sizeof path, "material-%ld.json", (long)getpid());
    for (int m = 0; m < MATERIALS; ++m) {
        tsuya_material *again;
        assert_int_equal(tsuya_material_save(material[m], path), TSUYA_OK);
        assert_int_equal(tsuya_material_load(&again, path), TSUYA_OK);
        tsuya_material_info a = tsuya_material_get_info(material[m]), b = tsuya_material_get_info(again);
        assert_string_equal(a.name, b.name);
        assert_string_equal(a.model, b.model);
        assert_int_equal(a.is_default, b.is_default);
        assert_true(isnan(b.heldout_cbrt) == (m < FITTED) && a.bytes == b.bytes && a.bytes <= 65536);
        for (uint64_t k = 0; k < 200; ++k) {
            double f[3], g[3];
            tsuya_material_eval(material[m], NULL, random_direction(8, k), random_direction(9, k), f);
            tsuya_material_eval(again, NULL, random_direction(8, k), random_direction(9, k), g);
            assert_memory_equal(f, g, sizeof f);
        }
        tsuya_material_free(again);
    }
    unlink(path);
    tsuya_material_info silk = tsuya_material_get_info(material[1]);
    assert_true(silk.is_default);
    assert_non_null(strstr(silk.name, "not measured"));
}

#define HEAD "{\"format\":\"tsuya material\",\"version\":\"1.0\",\"name\":\"n\",\"channels\":[\"r\",\"g\",\"b\"],"
#define PARAMETERS "\"parameters\":{\"alpha_weft\":0.3,\"alpha_warp\":0.1,\"eta\":1.5,\"strength\":[0.04,0.04,0.04]}"

static void test_hostile_json(void **state)
{
    (void)state;
    static const struct { const char *text, *names; } bad[] = {
        {"", ""},
        {"[]", ""},
        {"{}", "format"},
        {"{\"format\":\"tsuya material\",\"version\":\"2.0\"}", "newer"},
        {"{\"format\":\"tsuya material\",\"version\":\"1.x\"}", "version"},
        {"{\"format\":\"tsuya material\",\"version\":\"99999999999.0\"}", "version"},
        {"{\"format\":\"tsuya material\",\"version\":\"1.0\",\"channels\":[]}", "channels"},
        {"{\"format\":\"tsuya material\",\"version\":\"1.0\",\"channels\":[3],\"name\":\"n\"}", "channels[0]"},
        {HEAD "\"model\":\"gxx-aniso\"," PARAMETERS "}", "ggx-aniso"},
        {HEAD "\"model\":\"ggx-aniso\"}", "parameters"},
        {HEAD "\"model\":\"ggx-aniso\",\"parameters\":{}}", "alpha_weft"},
        {HEAD "\"model\":\"ggx-aniso\",\"parameters\":{\"alpha_weft\":1e300,\"alpha_warp\":0.1,\"eta\":1.5,\"strength\":[0,0,0]}}", "alpha_weft"},
        {HEAD "\"model\":\"ggx-aniso\",\"parameters\":{\"alpha_weft\":-1,\"alpha_warp\":0.1,\"eta\":1.5,\"strength\":[0,0,0]}}", "alpha_weft"},
        {HEAD "\"model\":\"ggx-aniso\",\"parameters\":{\"alpha_weft\":null,\"alpha_warp\":0.1,\"eta\":1.5,\"strength\":[0,0,0]}}", "alpha_weft"},
        {HEAD "\"model\":\"ggx-aniso\",\"parameters\":{\"alpha_weft\":0.1,\"alpha_warp\":0.1,\"eta\":1.5,\"strength\":[0,0]}}", "strength"},
        {HEAD "\"model\":\"ggx-aniso\",\"dye\":{\"reflectance\":[0,2,0],\"coupling\":\"lambert\"}," PARAMETERS "}", "reflectance"},
        {HEAD "\"model\":\"ggx-aniso\",\"dye\":{\"reflectance\":[0,0,0],\"coupling\":\"glue\"}," PARAMETERS "}", "glue"},
        {HEAD "\"model\":\"ggx-aniso\",\"support\":{\"theta_i_deg\":[0,900]}," PARAMETERS "}", "theta_i_deg"},
    };
    for (size_t k = 0; k < sizeof bad / sizeof bad[0]; ++k) {
        tsuya_material *m = material[0];
        assert_int_not_equal(tsuya_material_parse(&m, bad[k].text, "evil.json"), TSUYA_OK);
        assert_null(m);
        if (!strstr(tsuya_reason(), bad[k].names) || !strstr(tsuya_reason(), "evil.json")) {
            fail_msg("case %zu: reason \"%s\" names no evil.json or no \"%s\"", k, tsuya_reason(), bad[k].names);
        }
    }
    tsuya_material *m;
    assert_int_equal(tsuya_material_parse(&m, HEAD "\"model\":\"ggx-aniso\"," PARAMETERS "}", "good.json"), TSUYA_OK);
    tsuya_material_free(m);
}

static void test_every_allocation_failing(void **state)
{
    (void)state;
    for (uint64_t n = 1;; ++n) {
        tsuya_material *m = NULL;
        tsuya_memory_fail_at(n);
        tsuya_status status = tsuya_material_default_silk(&m);
        tsuya_memory_fail_at(0);
        if (status == TSUYA_OK) {
            tsuya_material_free(m);
            assert_true(n > 5);
            break;
        }
        assert_int_equal(status, TSUYA_ERROR_MEMORY);
        assert_null(m);
    }
}

int main(void)
{
    const struct CMUnitTest tests[] = {
        cmocka_unit_test(test_reciprocity),
        cmocka_unit_test(test_white_furnace),
        cmocka_unit_test(test_sampling_follows_pdf),
        cmocka_unit_test(test_batch_like_double),
        cmocka_unit_test(test_view),
        cmocka_unit_test(test_looks),
        cmocka_unit_test(test_hard_directions),
        cmocka_unit_test(test_continuity),
        cmocka_unit_test(test_dye),
        cmocka_unit_test(test_frame),
        cmocka_unit_test(test_json_round_trip),
        cmocka_unit_test(test_hostile_json),
        cmocka_unit_test(test_every_allocation_failing),
    };
    return cmocka_run_group_tests(tests, set_up, tear_down);
}
