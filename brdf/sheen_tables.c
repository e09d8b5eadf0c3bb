/* The numbers of a sheen in float, in the order in which batches read them: rows of control values for brdf/sheen_batch.c, cubics for
 * brdf/sheen_wide.c. */
#include "brdf/sheen_tables.h"

#include "core/memory.h"

static const double log2_e = 1.4426950408889634;
static const int paired[4] = {TSUYA_SHEEN_WARP_ALONG, TSUYA_SHEEN_WEFT_ACROSS, TSUYA_SHEEN_WARP_ACROSS, TSUYA_SHEEN_WEFT_ALONG};

static int curve_floats(const tsuya_sheen *s) { return 2 * (s->spans + 3); }

static int row_floats(const tsuya_sheen *s)
{
    int rows = s->terms > 0 ? s->nu + 3 + s->nv + 3 + tsuya_sheen_layers(s) + s->channels : 0;
    return ((2 * curve_floats(s) + 15) & ~15) + rows * TSUYA_SHEEN_TERMS;
}

tsuya_sheen_rows tsuya_sheen_rows_of(const tsuya_sheen *s)
{
    tsuya_sheen_rows r = {.over_b = s->fast, .over_t = s->fast + curve_floats(s)};
    r.round = s->fast + ((2 * curve_floats(s) + 15) & ~15);
    r.tilt = r.round + (s->nu + 3) * TSUYA_SHEEN_TERMS;
    r.deep = r.tilt + (s->nv + 3) * TSUYA_SHEEN_TERMS;
    r.tint = r.deep + tsuya_sheen_layers(s) * TSUYA_SHEEN_TERMS;
    return r;
}

static void fill_rows(const tsuya_sheen *s)
{
    tsuya_sheen_rows r = tsuya_sheen_rows_of(s);
    float *of[TSUYA_SHEEN_FACTORS] = {r.deep, r.round, r.tilt, r.tint};
    for (int k = 0; k < curve_floats(s); ++k) {
        r.over_b[k] = (float)s->curve[paired[k % 2]][k / 2];
        r.over_t[k] = (float)s->curve[paired[2 + k % 2]][k / 2];
    }
    for (int factor = 0; factor < TSUYA_SHEEN_FACTORS && s->terms > 0; ++factor) {
        int size = tsuya_sheen_factor_size(s, factor), all = size + (factor == TSUYA_SHEEN_ROUND ? 3 : 0);
        for (int k = 0; k < all * s->terms; ++k) {
            of[factor][k / s->terms * TSUYA_SHEEN_TERMS + k % s->terms] = (float)s->factor[factor][k % s->terms * size + k / s->terms % size];
        }
    }
}

static bool fits(const tsuya_sheen *s)
{
    return s->spans < TSUYA_WIDE_CURVE && s->nu <= TSUYA_WIDE_ROUND && s->nv < TSUYA_WIDE_TILT && s->nd < TSUYA_WIDE_DEEP;
}

static size_t wide_floats(const tsuya_sheen *s) { return tsuya_wide_channel(s, s->channels); }

/* The cubics of a curve's intervals, coefficient after coefficient; `functions` control values, after the last one comes the first. */
static void fill_cubics(float *to, int entries, const double *control, int functions, int intervals, double factor)
{
    for (int k = 0; k <= intervals && k < entries; ++k) {
        double p[4];
        for (int i = 0; i < 4; ++i) {
            p[i] = factor * control[(k + i) % functions];
        }
        bool end = k == intervals; /* where the place is on the last knot itself */
        to[k] = (float)((p[0] + 4.0 * p[1] + p[2]) / 6.0);
        to[entries + k] = end ? 0.0f : (float)(0.5 * (p[2] - p[0]));
        to[2 * entries + k] = end ? 0.0f : (float)(0.5 * (p[0] + p[2]) - p[1]);
        to[3 * entries + k] = end ? 0.0f : (float)((p[3] - p[0]) / 6.0 + 0.5 * (p[1] - p[2]));
    }
}

static bool is_level(const tsuya_sheen *s, int term)
{
    const double *round = s->factor[TSUYA_SHEEN_ROUND] + term * s->nu;
    double low = round[0], high = round[0];
    for (int k = 1; k < s->nu; ++k) {
        low = fmin(low, round[k]);
        high = fmax(high, round[k]);
    }
    return high - low <= 1e-7 * fmax(fabs(low), fabs(high));
}

static void fill_wide(const tsuya_sheen *s)
{
    for (int curve = 0; curve < TSUYA_SHEEN_CURVES; ++curve) {
        fill_cubics(s->wide + 4 * curve * TSUYA_WIDE_CURVE, TSUYA_WIDE_CURVE, s->curve[curve], s->spans + 3, s->spans, log2_e);
    }
    for (int r = 0; r < s->terms; ++r) {
        float *round = s->wide + tsuya_wide_term(r), *tilt = round + 4 * TSUYA_WIDE_ROUND, *deep = tilt + 4 * TSUYA_WIDE_TILT;
        const double *over_d = s->factor[TSUYA_SHEEN_DEEP] + r * tsuya_sheen_layers(s);
        double factor = (s->nd > 0 ? 1.0 : over_d[0]) * (r < s->level_terms ? s->factor[TSUYA_SHEEN_ROUND][r * s->nu] : 1.0);
        fill_cubics(round, TSUYA_WIDE_ROUND, s->factor[TSUYA_SHEEN_ROUND] + r * s->nu, s->nu, s->nu, 1.0);
        fill_cubics(tilt, TSUYA_WIDE_TILT, s->factor[TSUYA_SHEEN_TILT] + r * (s->nv + 3), s->nv + 3, s->nv, factor);
        if (s->nd > 0) {
            fill_cubics(deep, TSUYA_WIDE_DEEP, over_d, s->nd + 3, s->nd, 1.0);
        }
    }
    for (int c = 0; c < s->channels; ++c) {
        float *to = s->wide + tsuya_wide_channel(s, c);
        for (int r = 0; r < s->terms; ++r) {
            to[r] = (float)(log2_e * s->factor[TSUYA_SHEEN_TINT][r * s->channels + c]);
        }
        to[TSUYA_WIDE_WARP] = (float)s->strength[0][c];
        to[TSUYA_WIDE_WEFT] = (float)s->strength[1][c];
        to[TSUYA_WIDE_MATTE] = (float)s->matte[c];
    }
}

tsuya_status tsuya_sheen_tables(tsuya_sheen *s)
{
    tsuya_status status = TSUYA_OK;
    tsuya_free(s->fast);
    tsuya_free(s->wide);
    s->wide = NULL;
    s->level_terms = 0;
    while (s->level_terms < s->terms && is_level(s, s->level_terms)) {
        s->level_terms++;
    }
    TSUYA_NEW(status, s->fast, (size_t)row_floats(s));
    fill_rows(s);
    if (fits(s) && tsuya_sheen_wide_here()) {
        TSUYA_NEW(status, s->wide, wide_floats(s));
        fill_wide(s);
    }
done:
    return status;
}

/* The same on every processor: with the wide tables. */
size_t tsuya_sheen_tables_bytes(const tsuya_sheen *s)
{
    return ((size_t)row_floats(s) + wide_floats(s)) * sizeof(float);
}
