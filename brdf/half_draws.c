/* Draws of the half vector for many viewers, in float: with the table searched once for all of them, or for each. */
#include "brdf/half_table.h"
#include "brdf/kernel.h"
#include "brdf/sampling.h"

#include "core/clones.h"

#include <stdint.h>

static int cosine_draws(int total) { return total / 10 * TSUYA_HALF_COSINE_TENTHS; }

static double radical_inverse(uint32_t i)
{
    double sum = 0.0;
    for (double step = 0.5; i > 0; i >>= 1, step *= 0.5) {
        sum += i & 1 ? step : 0.0;
    }
    return sum;
}

void tsuya_half_table_shared_draws(const tsuya_half_table *t, int total, float *shared)
{
    int lobe = cosine_draws(total);
    for (int k = 0; k < total; ++k) {
        int among = k < lobe ? lobe : total - lobe, at = k < lobe ? k : k - lobe;
        const double u[2] = {(at + 0.5) / among, radical_inverse((uint32_t)at)};
        tsuya_vec3 w = k < lobe ? tsuya_sample_cosine(u[0], u[1]) : tsuya_half_table_draw(t, u);
        shared[k] = (float)w.x;
        shared[total + k] = (float)w.y;
        shared[2 * total + k] = (float)w.z;
    }
}

/* Density of h = (x, y, z), z > 0, of any length. */
static inline __attribute__((always_inline)) float density_at(const tsuya_half_table *t, float hx, float hy, float hz)
{
    const int rows = t->theta_cells, columns = t->phi_cells;
    float across = sqrtf(hx * hx + hy * hy), tx = fabsf(hx), ty = fabsf(hy), wide = tx > ty ? tx : ty, thin = tx > ty ? ty : tx;
    float turn = angle_from(thin / (wide > 1e-30f ? wide : 1e-30f), ty > tx);
    float tilt = angle_from((across > hz ? hz : across) / (across > hz ? across : hz), across > hz);
    int i = (int)(tilt * ((float)rows / half_pi)), j = (int)(unfold_azimuth(turn, hx, hy) * ((float)columns / two_pi));
    i = i < rows ? i : rows - 1;
    j = j < columns ? j : columns - 1;
    return t->density[i * columns + j];
}

TSUYA_CLONES("arch=x86-64-v3", "default") static void
take_draws(const tsuya_half_table *t, tsuya_vec3 wo, const float *shared, int total, int from, int count, float *const wi[3], float *weight)
{
    const float ox = (float)wo.x, oy = (float)wo.y, oz = (float)wo.z;
    const float lobe = (float)cosine_draws(total), rest = (float)total - lobe; /* draws of either kind: weights need no share */
    const int direct = cosine_draws(total) - from;
    float *restrict wx = wi[0], *restrict wy = wi[1], *restrict wz = wi[2];
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        float x = shared[k], y = shared[total + k], z = shared[2 * total + k], twice = 2.0f * (x * ox + y * oy + z * oz);
        bool is_direct = k < direct;
        float ix = is_direct ? x : twice * x - ox, iy = is_direct ? y : twice * y - oy, iz = is_direct ? z : twice * z - oz;
        bool up = iz > 0.0f && (is_direct || twice > 0.0f);
        iz = up ? iz : 1.0f;
        ix = up ? ix : 0.0f;
        iy = up ? iy : 0.0f;
        float hx = ix + ox, hy = iy + oy, hz = iz + oz, cosine = 0.5f * sqrtf(hx * hx + hy * hy + hz * hz); /* of wo and h */
        float pdf = lobe * iz * 0.318309886f + rest * density_at(t, hx, hy, hz) / (4.0f * (cosine > 1e-6f ? cosine : 1e-6f));
        wx[k] = ix;
        wy[k] = iy;
        wz[k] = iz;
        weight[k] = up ? iz / pdf : 0.0f;
    }
}

void tsuya_half_table_take_draws(const tsuya_half_table *t, tsuya_vec3 wo, const float *shared, int total, int from, int count, float *const wi[3],
                                 float *weight)
{
    take_draws(t, wo, shared, total, from, count, wi, weight);
}

static const float cosine_share = 0.1f * TSUYA_HALF_COSINE_TENTHS;

TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
pdf_all(const tsuya_half_table *t, const tsuya_direction_batch *d, float *restrict pdf)
{
    const float *restrict ix = d->wi_x, *restrict iy = d->wi_y, *restrict iz = d->wi_z;
    const float *restrict ox = d->wo_x, *restrict oy = d->wo_y, *restrict oz = d->wo_z;
#pragma omp simd
    for (int k = 0; k < d->count; ++k) {
        float x = ix[k] + ox[k], y = iy[k] + oy[k], z = iz[k] + oz[k], size = x * x + y * y + z * z;
        bool up = (iz[k] > 0.0f) & (oz[k] > 0.0f) & (size < 16.0f); /* others are answered by nobody: any place in the table will do */
        float cosine = 0.5f * sqrtf(size), density = density_at(t, up ? x : 0.0f, up ? y : 0.0f, up ? z : 1.0f);
        pdf[k] = cosine_share * iz[k] * 0.318309886f + (1.0f - cosine_share) * density / (4.0f * (cosine > 1e-6f ? cosine : 1e-6f));
    }
}

void tsuya_half_table_pdf_batch(const tsuya_half_table *t, const tsuya_direction_batch *d, float *pdf) { pdf_all(t, d, pdf); }

/* One step of a search: on by `step` where u lies there or beyond.  The last number is 1, which no u reaches. */
static inline __attribute__((always_inline)) int advance(const float *cumulative, int first, int cells, float u, int at, int step)
{
    int next = at + step < cells ? at + step : cells;
    return at + (-(int)(u >= cumulative[first + next]) & (next - at));
}

/* The interval of the cumulative table from `first` on that holds u: of up to 64. */
static inline __attribute__((always_inline)) int find(const float *cumulative, int first, int cells, float u)
{
    int at = advance(cumulative, first, cells, u, 0, 32);
    at = advance(cumulative, first, cells, u, at, 16);
    at = advance(cumulative, first, cells, u, at, 8);
    at = advance(cumulative, first, cells, u, at, 4);
    at = advance(cumulative, first, cells, u, at, 2);
    return advance(cumulative, first, cells, u, at, 1);
}

/* The place in it. */
static inline __attribute__((always_inline)) float within(float low, float high, float u)
{
    float width = high - low, share = (u - low) / (width > 0.0f ? width : 1.0f);
    share = share < 0.0f ? 0.0f : share;
    share = share < 1.0f ? share : 1.0f;
    return width > 0.0f ? share : 0.5f;
}

enum { BLOCK = 64 };

/* Cells of draws, and the places in them: of θh in a, of φh in b, in cells. */
typedef struct cells { int row[BLOCK]; float a[BLOCK], b[BLOCK]; } cells;

/* Numbers for the table out of those for both lobes. */
static inline __attribute__((always_inline)) float for_table(float u)
{
    float rest = (u - cosine_share) * (1.0f / (1.0f - cosine_share));
    return rest > 0.0f ? rest : 0.0f;
}

TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
search(const tsuya_half_table *t, int count, const float *restrict ua, const float *restrict ub, cells *restrict to)
{
    const float *restrict marginal = t->marginal, *restrict conditional = t->conditional;
    const int rows = t->theta_cells, columns = t->phi_cells;
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        float a = for_table(ua[k]), b = ub[k];
        int i = find(marginal, 0, rows, a), first = i * (columns + 1), j = find(conditional, first, columns, b);
        to->row[k] = i;
        to->a[k] = within(marginal[i], marginal[i + 1], a);
        to->b[k] = (float)j + within(conditional[first + j], conditional[first + j + 1], b);
    }
}

TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
reflect(const tsuya_half_table *t, int count, const cells *restrict at, const float *const wo[3], const float *const u[2], float *const wi[3])
{
    const float *restrict ox = wo[0], *restrict oy = wo[1], *restrict oz = wo[2], *restrict ua = u[0], *restrict ub = u[1], *restrict edge = t->edge;
    const float per_column = 1.0f / (float)t->phi_cells;
    float *restrict ix = wi[0], *restrict iy = wi[1], *restrict iz = wi[2];
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        float x, y, z, sine, cosine, low = edge[at->row[k]], hz = low + at->a[k] * (edge[at->row[k] + 1] - low), flat = 1.0f - hz * hz;
        tsuya_sample_cosine_f32(ua[k] * (1.0f / cosine_share), ub[k], &x, &y, &z);
        sine_of_turn(at->b[k] * per_column, &sine, &cosine);
        float r = sqrtf(flat > 0.0f ? flat : 0.0f), hx = r * cosine, hy = r * sine, twice = 2.0f * (ox[k] * hx + oy[k] * hy + oz[k] * hz);
        float rx = twice * hx - ox[k], ry = twice * hy - oy[k], rz = twice * hz - oz[k];
        bool direct = ua[k] < cosine_share, up = twice > 0.0f;
        rz = up ? rz : 0.0f;
        ix[k] = direct ? x : rx;
        iy[k] = direct ? y : ry;
        iz[k] = direct ? z : rz;
    }
}

void tsuya_half_table_sample_batch(const tsuya_half_table *t, int count, const float *const wo[3], const float *const u[2], float *const wi[3])
{
    cells at;
    for (int from = 0; from < count; from += BLOCK) {
        int here = count - from < BLOCK ? count - from : BLOCK;
        search(t, here, u[0] + from, u[1] + from, &at);
        reflect(t, here, &at, (const float *const[3]){wo[0] + from, wo[1] + from, wo[2] + from}, (const float *const[2]){u[0] + from, u[1] + from},
                (float *const[3]){wi[0] + from, wi[1] + from, wi[2] + from});
    }
}
