/* The cloth's own model in float for AVX-512 (F, BW, DQ, VL): sixteen directions at a time, everything in registers.  A curve's control
 * values fit into one to three of them, so that a look-up is a permutation instead of a read from memory. */
#include "brdf/sheen_tables.h"

#include <math.h>
#include <string.h>

#ifdef __x86_64__
#pragma GCC push_options
#pragma GCC target("avx512f,avx512bw,avx512dq,avx512vl,fma,prefer-vector-width=512")
#include <immintrin.h>

#define INLINE static inline __attribute__((always_inline))
typedef __m512 lanes;
typedef __m512i whole;

/* A place on the knots: which interval, and where in it. */
typedef struct place {
    whole at;
    lanes t;
} place;

INLINE lanes all(float x) { return _mm512_set1_ps(x); }

/* atan of [0, 1] by Chebyshev's alternation, to 1.7e-6: for the azimuth.  The other angles are the bent ones that their curves are tabulated
 * over (brdf/sheen_tables.h).  Both in intervals of a curve: the coefficients are multiplied by their number. */
enum { ATAN = 6 };
static const double atan_odd[ATAN] = {9.999772191e-1, -3.326228279e-1, 1.935403761e-1, -1.164264820e-1, 5.264735147e-2, -1.171913573e-2};

INLINE lanes odd_polynomial(lanes t, const float *a, int count)
{
    lanes z = t * t, p = all(a[count - 1]);
    for (int k = count - 2; k >= 0; --k) {
        p = p * z + all(a[k]);
    }
    return t * p;
}

/* 2^x: Taylor's polynomial, its last powers by Chebyshev's in those before them; 4e-6.  Tables are made only where no x is too large. */
INLINE lanes power_of_two(lanes x)
{
    lanes n = _mm512_roundscale_ps(x, _MM_FROUND_TO_NEAREST_INT | _MM_FROUND_NO_EXC), r = x - n;
    lanes p = all(9.6758923e-3f) * r + all(5.5920783e-2f);
    p = p * r + all(2.4022109e-1f);
    p = p * r + all(6.9312114e-1f);
    return _mm512_scalef_ps(p * r + all(1.0f), n);
}

/* Places come from 0 to the number of intervals, which has an entry too. */
INLINE place place_of(lanes x)
{
    whole at = _mm512_cvttps_epi32(x);
    return (place){at, x - _mm512_cvtepi32_ps(at)};
}

INLINE lanes cubic(lanes a0, lanes a1, lanes a2, lanes a3, lanes t) { return a0 + t * (a1 + t * (a2 + t * a3)); }

/* The coefficients of a curve in registers: of up to 16, 32 and 48 intervals. */
typedef struct curve_16 {
    lanes a[4];
} curve_16;

typedef struct curve_32 {
    lanes low[4], high[4];
} curve_32;

INLINE curve_16 load_16(const float *table)
{
    return (curve_16){{_mm512_load_ps(table), _mm512_load_ps(table + 16), _mm512_load_ps(table + 32), _mm512_load_ps(table + 48)}};
}

/* `entries` from one coefficient's table to the next. */
INLINE curve_32 load_32(const float *table, int entries)
{
    curve_32 c;
    for (int k = 0; k < 4; ++k) {
        c.low[k] = _mm512_load_ps(table + entries * k);
        c.high[k] = _mm512_load_ps(table + entries * k + 16);
    }
    return c;
}

INLINE lanes value_16(const curve_16 *c, const place *p)
{
    return cubic(_mm512_permutexvar_ps(p->at, c->a[0]), _mm512_permutexvar_ps(p->at, c->a[1]), _mm512_permutexvar_ps(p->at, c->a[2]),
                 _mm512_permutexvar_ps(p->at, c->a[3]), p->t);
}

INLINE lanes value_32(const curve_32 *c, const place *p)
{
    return cubic(_mm512_permutex2var_ps(c->low[0], p->at, c->high[0]), _mm512_permutex2var_ps(c->low[1], p->at, c->high[1]),
                 _mm512_permutex2var_ps(c->low[2], p->at, c->high[2]), _mm512_permutex2var_ps(c->low[3], p->at, c->high[3]), p->t);
}

INLINE lanes pick_48(const float *table, whole at, __mmask16 last)
{
    lanes two = _mm512_permutex2var_ps(_mm512_load_ps(table), at, _mm512_load_ps(table + 16));
    return _mm512_mask_permutexvar_ps(two, last, at, _mm512_load_ps(table + 32));
}

INLINE lanes value_48(const float *table, const place *p, __mmask16 last)
{
    return cubic(pick_48(table, p->at, last), pick_48(table + 48, p->at, last), pick_48(table + 96, p->at, last),
                 pick_48(table + 144, p->at, last), p->t);
}

enum { STEPS = 8 };

/* Some steps of sixteen directions, stage after stage, so that one step need not wait for the step before it: places of the angles
 * among the intervals, then what they say. */
typedef struct block {
    place t[STEPS], b[STEPS], u[STEPS], v[STEPS], d[STEPS];
    lanes warp[STEPS], weft[STEPS], falloff[STEPS]; /* warp, weft: logarithms first */
    lanes gloss[STEPS];                             /* what Fresnel's term adds, the same in every channel; 4 (wi·h)² first */
    lanes term[TSUYA_SHEEN_TERMS][STEPS];           /* those that are not there stay 0 */
    __mmask16 here[STEPS], seen[STEPS];             /* lanes that there are, and those with both directions finite and above the surface */
} block;

/* What sixteen directions are to the cloth. */
typedef struct half {
    lanes x, y, z, tx, ty;
} half;

/* An arc's odd polynomial, and a quarter of a turn, in intervals. */
typedef struct angle_scale {
    float odd[ATAN], quarter;
} angle_scale;

static angle_scale scale_of(const double *odd, int count, double per_rad)
{
    angle_scale s = {.quarter = (float)(0.5 * M_PI * per_rad)};
    for (int k = 0; k < count; ++k) {
        s.odd[k] = (float)(odd[k] * per_rad);
    }
    return s;
}

/* The angle whose tangent is across / along, both at least 0, from q = (across - along)/(across + along), the tangent of what it has over
 * 45 degrees: neither half of the right angle needs a case of its own. */
INLINE lanes angle_of(lanes q, const angle_scale *s)
{
    lanes z = q * q, p = all(s->odd[TSUYA_BENT - 1]);
    for (int k = TSUYA_BENT - 2; k >= 0; --k) {
        p = p * z + all(s->odd[k]);
    }
    return q * p + all(0.5f * s->quarter);
}

/* ψ of one component. */
INLINE lanes inclination(lanes component, lanes size, lanes z, const angle_scale *s)
{
    return all(s->quarter) + _mm512_or_ps(angle_of((size - z) / (size + z), s), _mm512_and_ps(component, all(-0.0f)));
}

INLINE lanes azimuth(const half *h, const angle_scale *s)
{
    lanes wide = _mm512_max_ps(_mm512_max_ps(h->tx, h->ty), all(1e-18f));
    lanes p = odd_polynomial(_mm512_min_ps(h->tx, h->ty) / wide, s->odd, ATAN);
    p = _mm512_mask_sub_ps(p, _mm512_cmp_ps_mask(h->ty, h->tx, _CMP_GT_OQ), all(s->quarter), p);
    p = _mm512_mask_sub_ps(p, _mm512_movepi32_mask(_mm512_castps_si512(h->x)), all(2.0f * s->quarter), p);
    return _mm512_mask_sub_ps(p, _mm512_movepi32_mask(_mm512_castps_si512(h->y)), all(4.0f * s->quarter), p);
}

/* The angle whose tangent squared is across2 / along2. */
INLINE lanes angle_of_squares(lanes across2, lanes along2, const angle_scale *s)
{
    lanes root = _mm512_sqrt_ps(across2 * along2);
    return angle_of((across2 - along2) / (across2 + along2 + (root + root)), s);
}

/* What every sixteen directions need of the sheen; logarithms to base 2. */
typedef struct cloth {
    const float *curves, *terms, *channels;
    int count, level; /* terms; and those that do not change with φ, which come first */
    bool flat, deep, glossy, small, low; /* small, low: curves of the yarns of up to 31 intervals, and over θh of up to 15 */
    float lowest, per, gloss[2]; /* of the cosine; per: intervals */
    angle_scale psi, phi, theta, d;
    float slant[2][2], reach[2][2]; /* [yarn][of dy2, dx2] */
} cloth;

static void take_gloss(cloth *c, const tsuya_sheen *s)
{
    c->glossy = tsuya_sheen_glossy(s);
    c->lowest = (float)s->lowest_cosine;
    c->per = (float)((TSUYA_WIDE_RISE - 1) / (1.0 - s->lowest_cosine));
    c->gloss[0] = (float)s->gloss[0];
    c->gloss[1] = (float)s->gloss[1];
}

static cloth cloth_of(const tsuya_sheen *s)
{
    cloth c = {.curves = s->wide, .terms = s->wide + tsuya_wide_term(0), .channels = s->wide + tsuya_wide_channel(s, 0)};
    int spans = tsuya_wide_intervals(s->spans, TSUYA_WIDE_CURVE);
    c.count = s->terms;
    c.level = s->level_terms;
    c.flat = s->terms > 0;
    c.deep = s->nd > 0 && c.flat;
    c.small = spans < 32;
    c.low = tsuya_wide_tilt(s) < TSUYA_WIDE_TILT;
    take_gloss(&c, s);
    c.psi = scale_of(tsuya_bent, TSUYA_BENT, spans / M_PI);
    c.phi = scale_of(atan_odd, ATAN, s->nu / (2.0 * M_PI));
    c.theta = scale_of(tsuya_bent, TSUYA_BENT, c.flat ? tsuya_wide_intervals(s->nv, tsuya_wide_tilt(s)) / (0.5 * M_PI) : 0.0);
    c.d = scale_of(tsuya_bent, TSUYA_BENT, c.deep ? tsuya_wide_intervals(s->nd, TSUYA_WIDE_DEEP) / (0.5 * M_PI) : 0.0);
    for (int yarn = 0; yarn < 2; ++yarn) {
        for (int k = 0; k < 2; ++k) {
            double slant = s->slant[yarn][yarn == 0 ? k : 1 - k];
            c.slant[yarn][k] = (float)(0.25 * 1.4426950408889634 * slant);
            c.reach[yarn][k] = slant > 0.0 ? (float)(4.0 * s->reach[1 - k]) : 16.0f;
        }
    }
    return c;
}

INLINE lanes slanted(const cloth *c, int yarn, lanes dx2, lanes dy2)
{
    return all(c->slant[yarn][0]) * _mm512_min_ps(dy2, all(c->reach[yarn][0])) + all(c->slant[yarn][1]) * _mm512_min_ps(dx2, all(c->reach[yarn][1]));
}

/* All sixteen without a mask, which would cost an instruction more each. */
INLINE lanes load_some(const float *from, int left, __mmask16 here) { return left < TSUYA_WIDE_LANES ? _mm512_maskz_loadu_ps(here, from) : _mm512_loadu_ps(from); }

INLINE void find_places(block *b, const cloth *c, const tsuya_direction_batch *d, int from, int steps, bool flat, bool deep)
{
    for (int k = 0; k < steps; ++k) {
        int at = from + k * TSUYA_WIDE_LANES, left = d->count - at;
        __mmask16 here = (__mmask16)(left < TSUYA_WIDE_LANES ? (1u << left) - 1u : 0xffffu);
        lanes ix = load_some(d->wi_x + at, left, here), iy = load_some(d->wi_y + at, left, here), iz = load_some(d->wi_z + at, left, here);
        lanes ox = load_some(d->wo_x + at, left, here), oy = load_some(d->wo_y + at, left, here), oz = load_some(d->wo_z + at, left, here);
        lanes dx = ix - ox, dy = iy - oy, dz = iz - oz, dx2 = dx * dx, dy2 = dy * dy;
        half h = {.x = ix + ox, .y = iy + oy, .z = _mm512_max_ps(iz + oz, all(1e-9f))};
        h.tx = _mm512_abs_ps(h.x);
        h.ty = _mm512_abs_ps(h.y);
        b->here[k] = here;
        b->seen[k] = _mm512_cmp_ps_mask(_mm512_min_ps(iz, oz), all(0.0f), _CMP_GT_OQ) & _mm512_cmp_ps_mask(h.tx + h.ty + (iz + oz), all(INFINITY), _CMP_LT_OQ);
        b->falloff[k] = all(0.5f) / h.z;
        b->warp[k] = slanted(c, 0, dx2, dy2);
        b->weft[k] = slanted(c, 1, dx2, dy2);
        b->t[k] = place_of(inclination(h.x, h.tx, h.z, &c->psi));
        b->b[k] = place_of(inclination(h.y, h.ty, h.z, &c->psi));
        lanes across2 = h.x * h.x + h.y * h.y, z2 = h.z * h.z;
        if (c->glossy) {
            b->gloss[k] = across2 + z2;
        }
        if (flat) {
            b->u[k] = place_of(azimuth(&h, &c->phi));
            b->v[k] = place_of(angle_of_squares(across2, z2, &c->theta));
        }
        if (deep) {
            b->d[k] = place_of(angle_of_squares(dz * dz + dx2 + dy2, across2 + z2, &c->d));
        }
    }
}

/* Adds the two curves over one inclination, one of each yarn. */
INLINE void add_curves(lanes *warp, lanes *weft, const place *places, const float *of_warp, const float *of_weft, int steps, bool small)
{
    if (small) {
        const curve_32 a = load_32(of_warp, TSUYA_WIDE_CURVE), c = load_32(of_weft, TSUYA_WIDE_CURVE);
        for (int k = 0; k < steps; ++k) {
            const place p = places[k];
            warp[k] += value_32(&a, &p);
            weft[k] += value_32(&c, &p);
        }
        return;
    }
    for (int k = 0; k < steps; ++k) {
        const place p = places[k];
        __mmask16 last = _mm512_test_epi32_mask(p.at, _mm512_set1_epi32(32));
        warp[k] += value_48(of_warp, &p, last);
        weft[k] += value_48(of_weft, &p, last);
    }
}

INLINE void weave_yarns(block *b, const cloth *c, int steps)
{
    const int size = 4 * TSUYA_WIDE_CURVE;
    add_curves(b->warp, b->weft, b->b, c->curves + TSUYA_SHEEN_WARP_ALONG * size, c->curves + TSUYA_SHEEN_WEFT_ACROSS * size, steps, c->small);
    add_curves(b->warp, b->weft, b->t, c->curves + TSUYA_SHEEN_WARP_ACROSS * size, c->curves + TSUYA_SHEEN_WEFT_ALONG * size, steps, c->small);
    for (int k = 0; k < steps; ++k) {
        b->warp[k] = power_of_two(b->warp[k]);
        b->weft[k] = power_of_two(b->weft[k]);
    }
}

/* What Fresnel's term adds to the yarns. */
INLINE void shine(block *b, const cloth *c, int steps)
{
    const curve_16 rise = load_16(c->curves + tsuya_wide_rise());
    for (int k = 0; k < steps; ++k) {
        lanes cosine = _mm512_min_ps(_mm512_max_ps(all(0.5f) * _mm512_sqrt_ps(b->gloss[k]), all(c->lowest)), all(1.0f));
        place p = place_of(cosine * all(c->per) - all(c->lowest * c->per));
        b->gloss[k] = (all(c->gloss[0]) * b->warp[k] + all(c->gloss[1]) * b->weft[k]) * value_16(&rise, &p);
    }
}

INLINE void multiply_term(lanes *term, const block *b, const float *table, int steps, bool level, bool deep, bool low)
{
    const curve_16 round = load_16(table), over_d = load_16(table + 4 * (TSUYA_WIDE_ROUND + TSUYA_WIDE_TILT));
    const curve_32 tilt = load_32(table + 4 * TSUYA_WIDE_ROUND, TSUYA_WIDE_TILT);
    const curve_16 low_tilt = load_16(table + 4 * TSUYA_WIDE_ROUND);
    for (int k = 0; k < steps; ++k) {
        const place u = b->u[k], v = b->v[k], d = b->d[k];
        lanes product = low ? value_16(&low_tilt, &v) : value_32(&tilt, &v);
        if (!level) {
            product *= value_16(&round, &u);
        }
        if (deep) {
            product *= value_16(&over_d, &d);
        }
        term[k] = product;
    }
}

INLINE void multiply_terms(block *b, const cloth *c, int steps, bool deep, bool low)
{
    for (int r = 0; r < c->level; ++r) {
        multiply_term(b->term[r], b, c->terms + r * TSUYA_WIDE_TERM, steps, true, deep, low);
    }
    for (int r = c->level; r < c->count; ++r) {
        multiply_term(b->term[r], b, c->terms + r * TSUYA_WIDE_TERM, steps, false, deep, low);
    }
}

/* Values of some channels, whose planes lie `plane` numbers apart, from so many terms. */
INLINE void colour(float *value, size_t plane, const block *b, const float *row, int steps, int channels, int terms)
{
    for (int k = 0; k < steps; ++k) {
        const lanes warp = b->warp[k], weft = b->weft[k], gloss = b->gloss[k], falloff = b->falloff[k];
        for (int channel = 0; channel < channels; ++channel) {
            const float *a = row + channel * TSUYA_WIDE_LANES;
            lanes f = all(a[TSUYA_WIDE_WARP]) * warp + (all(a[TSUYA_WIDE_WEFT]) * weft + (all(a[TSUYA_WIDE_MATTE]) + gloss)), share = falloff;
            if (terms > 0) {
                lanes sum = all(a[0]) * b->term[0][k];
                for (int r = 1; r < terms; ++r) {
                    sum += all(a[r]) * b->term[r][k];
                }
                share *= power_of_two(sum);
            }
            _mm512_mask_storeu_ps(value + (size_t)channel * plane + k * TSUYA_WIDE_LANES, b->here[k], _mm512_maskz_mul_ps(b->seen[k], f, share));
        }
    }
}

INLINE void colour_some(float *value, size_t plane, const block *b, const float *row, int steps, int channels, int terms)
{
    switch (terms == 0 ? 0 : terms <= 4 ? 4 : terms <= 6 ? 6 : 8) {
    case 0: colour(value, plane, b, row, steps, channels, 0); break;
    case 4: colour(value, plane, b, row, steps, channels, 4); break;
    case 6: colour(value, plane, b, row, steps, channels, 6); break;
    default: colour(value, plane, b, row, steps, channels, TSUYA_SHEEN_TERMS); break;
    }
}

INLINE void eval_all(float *value, const cloth *c, int channels, const tsuya_direction_batch *batch, bool flat, bool deep)
{
    block b;
    memset(b.gloss, 0, sizeof b.gloss);
    memset(b.term, 0, sizeof b.term);
    for (int from = 0; from < batch->count; from += STEPS * TSUYA_WIDE_LANES) {
        int left = (batch->count - from + TSUYA_WIDE_LANES - 1) / TSUYA_WIDE_LANES, steps = left < STEPS ? left : STEPS;
        find_places(&b, c, batch, from, steps, flat, deep);
        weave_yarns(&b, c, steps);
        if (c->glossy) {
            shine(&b, c, steps);
        }
        if (flat && c->low) {
            multiply_terms(&b, c, steps, deep, true);
        } else if (flat) {
            multiply_terms(&b, c, steps, deep, false);
        }
        size_t plane = (size_t)batch->count;
        for (int channel = 0; channel < channels;) {
            const float *row = c->channels + channel * TSUYA_WIDE_LANES;
            float *to = value + (size_t)channel * plane + from;
            bool three = channels - channel >= 3;
            if (three) {
                colour_some(to, plane, &b, row, steps, 3, c->count);
            } else {
                colour_some(to, plane, &b, row, steps, 1, c->count);
            }
            channel += three ? 3 : 1;
        }
    }
}

void tsuya_sheen_eval_wide(const tsuya_sheen *s, int channels, const tsuya_direction_batch *batch, float *value)
{
    const cloth c = cloth_of(s);
    const tsuya_direction_batch own = *batch; /* which no store of a value can change */
    if (c.deep) {
        eval_all(value, &c, channels, &own, true, true);
    } else if (c.flat) {
        eval_all(value, &c, channels, &own, true, false);
    } else {
        eval_all(value, &c, channels, &own, false, false);
    }
}
#pragma GCC pop_options

bool tsuya_sheen_wide_here(void)
{
    return __builtin_cpu_supports("avx512f") && __builtin_cpu_supports("avx512bw") && __builtin_cpu_supports("avx512dq") &&
           __builtin_cpu_supports("avx512vl");
}

#else

bool tsuya_sheen_wide_here(void) { return false; }

void tsuya_sheen_eval_wide(const tsuya_sheen *s, int channels, const tsuya_direction_batch *batch, float *value)
{
    (void)s, (void)channels, (void)batch, (void)value;
}
#endif
