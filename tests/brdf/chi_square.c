#include "brdf/chi_square.h"

#include "core/context.h"

#include <math.h>
#include <string.h>

enum { COS_CELLS = 24, PHI_CELLS = 48, CELLS = COS_CELLS * PHI_CELLS, DRAWS = 1000000 };

/* Midpoints of each cell, 24 × 24 of them. */
static void expected_draws(double *expected, const tsuya_material *m, tsuya_vec3 wo)
{
    enum { SUB = 24 };
#pragma omp parallel for schedule(static)
    for (int cell = 0; cell < CELLS; ++cell) {
        double sum = 0.0;
        for (int k = 0; k < SUB * SUB; ++k) {
            double z = ((cell / PHI_CELLS) + (k / SUB + 0.5) / SUB) / COS_CELLS, r = sqrt(1.0 - z * z);
            double phi = 2.0 * M_PI * ((cell % PHI_CELLS) + (k % SUB + 0.5) / SUB) / PHI_CELLS;
            sum += tsuya_material_pdf(m, NULL, (tsuya_vec3){r * cos(phi), r * sin(phi), z}, wo);
        }
        expected[cell] = DRAWS * sum * 2.0 * M_PI / (CELLS * (double)(SUB * SUB));
    }
}

static void count_one(double *seen, tsuya_vec3 wi)
{
    double phi = atan2(wi.y, wi.x);
    int j = (int)((phi < 0.0 ? phi + 2.0 * M_PI : phi) / (2.0 * M_PI) * PHI_CELLS), i = (int)(wi.z * COS_CELLS);
    seen[(i < COS_CELLS ? i : COS_CELLS - 1) * PHI_CELLS + (j < PHI_CELLS ? j : PHI_CELLS - 1)] += 1.0;
}

static void count_draws(double *seen, const tsuya_material *m, tsuya_vec3 wo, uint64_t stream)
{
    for (uint64_t k = 0; k < DRAWS; ++k) {
        const double u[3] = {tsuya_random_uniform(3, stream, 3 * k), tsuya_random_uniform(3, stream, 3 * k + 1), tsuya_random_uniform(3, stream, 3 * k + 2)};
        tsuya_vec3 wi;
        if (tsuya_material_sample(m, NULL, wo, u, &wi)) {
            count_one(seen, wi);
        }
    }
}

static void count_looks(double *seen, const tsuya_material *m, tsuya_vec3 wo, uint64_t stream)
{
    enum { N = TSUYA_MATERIAL_LOOKS };
    float u[3][N], wi[3][N], o[3][N], share[N], rest[3 * N];
    const tsuya_material_looks looks = {m, N, NULL, {o[0], o[1], o[2]}, share, rest};
    for (int k = 0; k < N; ++k) {
        o[0][k] = (float)wo.x;
        o[1][k] = (float)wo.y;
        o[2][k] = (float)wo.z;
    }
    tsuya_material_look(&looks);
    for (uint64_t from = 0; from < DRAWS; from += N) {
        for (int k = 0; k < N; ++k) {
            for (int c = 0; c < 3; ++c) { /* 24 bits, so that none becomes 1 */
                u[c][k] = (float)floor(0x1p24 * tsuya_random_uniform(3, stream, 3 * (from + (uint64_t)k) + (uint64_t)c)) * 0x1p-24f;
            }
        }
        tsuya_material_looks_sample(&looks, (const float *const[3]){u[0], u[1], u[2]}, (float *const[3]){wi[0], wi[1], wi[2]});
        for (int k = 0; k < N; ++k) {
            if (wi[2][k] > 0.0f) {
                count_one(seen, (tsuya_vec3){wi[0][k], wi[1][k], wi[2][k]});
            }
        }
    }
}

/* Cells are pooled until ten draws are expected; the draws that end under the surface are one cell more. */
static double pearson(int *freedom, const double *seen, const double *expected)
{
    double chi2 = 0.0, pool_seen = 0.0, pool_expected = 0.0, all_seen = 0.0, all_expected = 0.0;
    *freedom = -1;
    for (int k = 0; k <= CELLS; ++k) {
        double s = k < CELLS ? seen[k] : DRAWS - all_seen, e = k < CELLS ? expected[k] : fmax(DRAWS - all_expected, 0.0);
        all_seen += s;
        all_expected += e;
        pool_seen += s;
        pool_expected += e;
        if (pool_expected >= 10.0) {
            chi2 += (pool_seen - pool_expected) * (pool_seen - pool_expected) / pool_expected;
            *freedom += 1;
            pool_seen = pool_expected = 0.0;
        }
    }
    return chi2;
}

/* Wilson–Hilferty: χ² with n degrees of freedom as a standard normal. */
static double z_of(int *freedom, void (*count)(double *, const tsuya_material *, tsuya_vec3, uint64_t), const tsuya_material *material, tsuya_vec3 wo,
                   uint64_t stream)
{
    static double seen[CELLS], expected[CELLS];
    memset(seen, 0, sizeof seen);
    expected_draws(expected, material, wo);
    count(seen, material, wo, stream);
    double chi2 = pearson(freedom, seen, expected), v = 2.0 / (9.0 * *freedom);
    return (cbrt(chi2 / *freedom) - (1.0 - v)) / sqrt(v);
}

double chi_square_z(int *freedom, const tsuya_material *material, tsuya_vec3 wo, uint64_t stream)
{
    return z_of(freedom, count_draws, material, wo, stream);
}

double chi_square_looks_z(int *freedom, const tsuya_material *material, tsuya_vec3 wo, uint64_t stream)
{
    return z_of(freedom, count_looks, material, wo, stream);
}

double chi_square_bar(int tests)
{
    double level = 1.0 - pow(0.99, 1.0 / tests), low = 0.0, high = 10.0;
    for (int k = 0; k < 60; ++k) {
        double middle = 0.5 * (low + high);
        *(0.5 * erfc(middle / sqrt(2.0)) > level ? &low : &high) = middle;
    }
    return low;
}
