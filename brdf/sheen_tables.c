/* The numbers of a sheen in float, in the order in which batches read them: rows of control values for brdf/sheen_batch.c, cubics for
 * brdf/sheen_wide.c. */
#include "brdf/sheen_tables.h"

#include "core/memory.h"

static const double log2_e = 1.4426950408889634, most_missed = 1e-4; /* of a logarithm, by the wide tables */
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

static double largest(const double *a, int count)
{
    double most = a[0];
    for (int k = 1; k < count; ++k) {
        most = fmax(most, a[k]);
    }
    return most;
}

static double largest_size(const double *a, int count)
{
    double most = 0.0;
    for (int k = 0; k < count; ++k) {
        most = fmax(most, fabs(a[k]));
    }
    return most;
}

/* A bound of every logarithm to base 2 of which the wide kernel takes powers: it has none for what no float can hold. */
static double highest_power(const tsuya_sheen *s)
{
    double most = 0.0, surface = 0.0;
    for (int y = 0; y < 2; ++y) {
        double yarn = largest(s->curve[2 * y], s->spans + 3) + largest(s->curve[2 * y + 1], s->spans + 3);
        most = fmax(most, yarn + fmax(s->slant[y][0], 0.0) + fmax(s->slant[y][1], 0.0));
    }
    for (int r = 0; r < s->terms; ++r) {
        double product = 1.0;
        for (int factor = 0; factor < TSUYA_SHEEN_FACTORS; ++factor) {
            int n = tsuya_sheen_factor_size(s, factor);
            product *= largest_size(s->factor[factor] + r * n, n);
        }
        surface += product;
    }
    return log2_e * fmax(most, surface);
}

static bool fits(const tsuya_sheen *s)
{
    return s->spans < TSUYA_WIDE_CURVE && s->nu <= TSUYA_WIDE_ROUND && s->nv < TSUYA_WIDE_TILT && s->nd < TSUYA_WIDE_DEEP && highest_power(s) < 120.0;
}

static size_t wide_floats(const tsuya_sheen *s) { return tsuya_wide_channel(s, s->channels); }

/* π/4 and the first two derivatives of atan at q = 1. */
const double tsuya_bent[TSUYA_BENT] = {1.0, -0.313883035136164, 0.126659642163397, -0.0273784436297845};

/* The angle, in [0, 90°], that is bent to this one. */
static double straightened(double bent)
{
    double over = bent - 0.25 * M_PI, p = fabs(over), q = tan(p);
    for (int turn = 0; turn < 6; ++turn) {
        double z = q * q, value = q * (tsuya_bent[0] + z * (tsuya_bent[1] + z * (tsuya_bent[2] + z * tsuya_bent[3])));
        q -= (value - p) / (tsuya_bent[0] + z * (3.0 * tsuya_bent[1] + z * (5.0 * tsuya_bent[2] + z * 7.0 * tsuya_bent[3])));
    }
    return 0.25 * M_PI + copysign(atan(q), over);
}

static double value_at(const double *control, double x, double low, int intervals)
{
    double w[4];
    const double *p = control + tsuya_uniform_weights(w, x, low, 0.5 * M_PI, intervals, false);
    return p[0] * w[0] + p[1] * w[1] + p[2] * w[2] + p[3] * w[3];
}

/* Where a cubic meets the curve between an interval's ends: with these it misses least (zeros of Chebyshev's polynomial, stretched until the
 * outer two are the ends). */
enum { MEETS = 4, PLACES = 7 }; /* behind the four places: where it misses most */
#define INNER 0.29289321881345254
static const double places[PLACES] = {0.0, INNER, 1.0 - INNER, 1.0, 0.13, 0.5, 0.87};

/* Of each interval of a table: by how much it misses its curve, and how large the curve is there. */
typedef struct missed {
    int count;
    double by[TSUYA_WIDE_CURVE], size[TSUYA_WIDE_CURVE];
} missed;

/* The cubic through the first four values, as an interval's entries; returns what the others miss. */
static double fill_cubic(float *to, int entries, const double y[PLACES])
{
    const double p = places[1], q = places[2];
    double near = ((y[2] - y[0]) / q - (y[1] - y[0]) / p) / (q - p), far = ((y[3] - y[0]) - (y[2] - y[0]) / q) / (1.0 - q);
    double c = (far - near) / (1.0 - p), b = near - c * (p + q), a = y[3] - y[0] - b - c, most = 0.0;
    for (int i = MEETS; i < PLACES; ++i) {
        most = fmax(most, fabs(y[0] + places[i] * (a + places[i] * (b + places[i] * c)) - y[i]));
    }
    to[0] = (float)y[0];
    to[entries] = (float)a;
    to[2 * entries] = (float)b;
    to[3 * entries] = (float)c;
    return most;
}

/* A curve over an angle in [low, 90°], low 0 or −90°, as cubics over the bent angle, coefficient after coefficient; each goes through four
 * values, its ends among them. */
static missed fill_bent(float *to, int entries, const double *control, double low, int intervals, double factor)
{
    int count = tsuya_wide_intervals(intervals, entries);
    missed m = {.count = count};
    for (int k = 0; k <= count; ++k) {
        double y[PLACES];
        for (int i = 0; i < PLACES; ++i) {
            double bent = low + (0.5 * M_PI - low) * fmin((k + places[i]) / count, 1.0);
            y[i] = factor * value_at(control, copysign(straightened(fabs(bent)), bent), low, intervals);
        }
        double by = fill_cubic(to + k, entries, y);
        if (k < count) {
            m.by[k] = by;
            m.size[k] = largest_size(y, PLACES);
        }
    }
    return m;
}

/* What Fresnel's term adds, over the cosine.  Returns what is missed, relative to the term: a yarn's gloss is at most its strength. */
static double fill_rise(float *to, const tsuya_sheen *s)
{
    const int count = TSUYA_WIDE_RISE - 1;
    double most = 0.0;
    for (int k = 0; k <= count; ++k) {
        double y[PLACES];
        for (int i = 0; i < PLACES; ++i) {
            y[i] = tsuya_sheen_rise(s, s->lowest_cosine + (1.0 - s->lowest_cosine) * fmin((k + places[i]) / count, 1.0));
        }
        double by = fill_cubic(to + k, TSUYA_WIDE_RISE, y);
        most = k < count ? fmax(most, by / (1.0 + fmin(y[0], y[3]))) : most;
    }
    return most;
}

/* The cubics of a periodic curve's intervals. */
static void fill_round(float *to, int entries, const double *control, int functions)
{
    for (int k = 0; k <= functions && k < entries; ++k) {
        double p[4];
        for (int i = 0; i < 4; ++i) {
            p[i] = control[(k + i) % functions];
        }
        bool end = k == functions; /* where the place is on the last knot itself */
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

static const double *factor_of(const tsuya_sheen *s, int factor, int term) { return s->factor[factor] + term * tsuya_sheen_factor_size(s, factor); }

static double largest_of(const tsuya_sheen *s, int factor, int term) { return largest_size(factor_of(s, factor, term), tsuya_sheen_factor_size(s, factor)); }

/* The tables of one term over θh, which hold the constants of one that is level or has no θd, and over θd.  What is said of the former is where
 * the term's factors over φ and of the channels are largest. */
static void fill_term(missed *tilt, missed *deep, const tsuya_sheen *s, int r)
{
    float *round = s->wide + tsuya_wide_term(r), *over_tilt = round + 4 * TSUYA_WIDE_ROUND, *over_deep = over_tilt + 4 * TSUYA_WIDE_TILT;
    const double *of_d = factor_of(s, TSUYA_SHEEN_DEEP, r), *of_phi = factor_of(s, TSUYA_SHEEN_ROUND, r);
    bool level = r < s->level_terms;
    double factor = (s->nd > 0 ? 1.0 : of_d[0]) * (level ? of_phi[0] : 1.0);
    double most = (level ? 1.0 : largest_of(s, TSUYA_SHEEN_ROUND, r)) * largest_of(s, TSUYA_SHEEN_TINT, r);
    fill_round(round, TSUYA_WIDE_ROUND, of_phi, s->nu);
    *tilt = fill_bent(over_tilt, tsuya_wide_tilt(s), factor_of(s, TSUYA_SHEEN_TILT, r), 0.0, s->nv, factor);
    *deep = (missed){.count = 1, .size = {1.0}};
    if (s->nd > 0) {
        *deep = fill_bent(over_deep, TSUYA_WIDE_DEEP, of_d, 0.0, s->nd, 1.0);
    }
    for (int k = 0; k < tilt->count; ++k) {
        tilt->by[k] *= most;
        tilt->size[k] *= most;
    }
}

/* The tables of S; returns a bound of what they miss of it. */
static double fill_terms(const tsuya_sheen *s)
{
    missed tilt[TSUYA_SHEEN_TERMS], deep[TSUYA_SHEEN_TERMS];
    double most = 0.0;
    for (int r = 0; r < s->terms; ++r) {
        fill_term(&tilt[r], &deep[r], s, r);
    }
    for (int i = 0; s->terms > 0 && i < tilt[0].count; ++i) {
        for (int j = 0; j < deep[0].count; ++j) {
            double sum = 0.0;
            for (int r = 0; r < s->terms; ++r) {
                sum += tilt[r].by[i] * deep[r].size[j] + deep[r].by[j] * tilt[r].size[i];
            }
            most = fmax(most, sum);
        }
    }
    return most;
}

/* Returns a bound of what the tables miss of any logarithm, natural as it is relative to a value. */
static double fill_wide(const tsuya_sheen *s)
{
    double most[TSUYA_SHEEN_CURVES];
    for (int curve = 0; curve < TSUYA_SHEEN_CURVES; ++curve) {
        missed m = fill_bent(s->wide + 4 * curve * TSUYA_WIDE_CURVE, TSUYA_WIDE_CURVE, s->curve[curve], -0.5 * M_PI, s->spans, log2_e);
        most[curve] = largest(m.by, m.count) / log2_e;
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
    double rise = tsuya_sheen_glossy(s) ? fill_rise(s->wide + tsuya_wide_rise(), s) : 0.0;
    return rise + fill_terms(s) + fmax(most[TSUYA_SHEEN_WARP_ALONG] + most[TSUYA_SHEEN_WARP_ACROSS], most[TSUYA_SHEEN_WEFT_ALONG] + most[TSUYA_SHEEN_WEFT_ACROSS]);
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
        if (fill_wide(s) > most_missed) { /* curves that break off within an interval: the rows have them exactly */
            tsuya_free(s->wide);
            s->wide = NULL;
        }
    }
done:
    return status;
}

/* The same on every processor: with the wide tables. */
size_t tsuya_sheen_tables_bytes(const tsuya_sheen *s)
{
    return ((size_t)row_floats(s) + wide_floats(s)) * sizeof(float);
}
