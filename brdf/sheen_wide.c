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

/* 1/x and 1/√x: the processor's 14 digits and one step of Newton's. */
INLINE lanes inverse(lanes x)
{
    lanes r = _mm512_rcp14_ps(x);
    return r + r * (all(1.0f) - x * r);
}

INLINE lanes inverse_root(lanes x)
{
    lanes r = _mm512_rsqrt14_ps(x);
    return r + r * (all(0.5f) - all(0.5f) * x * r * r);
}

/* atan of [0, 1] by Chebyshev's alternation, to 2.5e-7; and to 1.7e-6, for what only smooth curves are looked up with.  In intervals of a
 * curve: the coefficients are multiplied by their number. */
enum { FINE = 7, ROUGH = 6 };
static const double fine_atan[FINE] = {9.999961115e-1, -3.331736805e-1, 1.980781556e-1, -1.323334210e-1, 7.962367237e-2, -3.360422057e-2, 6.811793291e-3};
static const double rough_atan[ROUGH] = {9.999772191e-1, -3.326228279e-1, 1.935403761e-1, -1.164264820e-1, 5.264735147e-2, -1.171913573e-2};

INLINE lanes odd_polynomial(lanes t, const float *a, int count)
{
    lanes z = t * t, p = all(a[count - 1]);
    for (int k = count - 2; k >= 0; --k) {
        p = p * z + all(a[k]);
    }
    return t * p;
}

/* 2^x, of x to 115: Taylor's polynomial, its last powers by Chebyshev's in those before them; 4e-6. */
INLINE lanes power_of_two(lanes x)
{
    x = _mm512_min_ps(x, all(115.0f));
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

INLINE curve_32 load_32(const float *table)
{
    curve_32 c;
    for (int k = 0; k < 4; ++k) {
        c.low[k] = _mm512_load_ps(table + 32 * k);
        c.high[k] = _mm512_load_ps(table + 32 * k + 16);
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
    lanes gloss[STEPS];                             /* what Fresnel's term adds, the same in every channel; its rise first */
    lanes term[TSUYA_SHEEN_TERMS][STEPS];
} block;

/* What sixteen directions are to the cloth. */
typedef struct half {
    lanes x, y, z, tx, ty;
} half;

/* atan and a quarter of a turn, in intervals. */
typedef struct angle_scale {
    float atan[FINE], quarter;
} angle_scale;

static angle_scale scale_of(const double *atan, int count, double per_rad)
{
    angle_scale s = {.quarter = (float)(0.5 * M_PI * per_rad)};
    for (int k = 0; k < count; ++k) {
        s.atan[k] = (float)(atan[k] * per_rad);
    }
    return s;
}

/* ψ of one component. */
INLINE lanes inclination(lanes component, lanes size, lanes z, const angle_scale *s)
{
    lanes p = odd_polynomial(_mm512_min_ps(size, z) * inverse(_mm512_max_ps(size, z)), s->atan, FINE), quarter = all(s->quarter);
    p = _mm512_mask_sub_ps(p, _mm512_cmp_ps_mask(size, z, _CMP_GT_OQ), quarter, p);
    return quarter + _mm512_or_ps(p, _mm512_and_ps(component, all(-0.0f)));
}

INLINE lanes azimuth(const half *h, const angle_scale *s)
{
    lanes wide = _mm512_max_ps(_mm512_max_ps(h->tx, h->ty), all(1e-18f));
    lanes p = odd_polynomial(_mm512_min_ps(h->tx, h->ty) * inverse(wide), s->atan, ROUGH);
    p = _mm512_mask_sub_ps(p, _mm512_cmp_ps_mask(h->ty, h->tx, _CMP_GT_OQ), all(s->quarter), p);
    p = _mm512_mask_sub_ps(p, _mm512_movepi32_mask(_mm512_castps_si512(h->x)), all(2.0f * s->quarter), p);
    return _mm512_mask_sub_ps(p, _mm512_movepi32_mask(_mm512_castps_si512(h->y)), all(4.0f * s->quarter), p);
}

/* The angle whose tangent squared is across2 / along2. */
INLINE lanes angle_of_squares(lanes across2, lanes along2, const angle_scale *s)
{
    lanes small = _mm512_min_ps(across2, along2), large = _mm512_max_ps(across2, along2);
    lanes p = odd_polynomial(small * inverse_root(_mm512_max_ps(small * large, all(1e-37f))), s->atan, ROUGH);
    return _mm512_mask_sub_ps(p, _mm512_cmp_ps_mask(across2, along2, _CMP_GT_OQ), all(s->quarter), p);
}

/* What every sixteen directions need of the sheen; logarithms to base 2. */
typedef struct cloth {
    const float *curves, *terms, *channels;
    int count, level; /* terms; and those that do not change with φ, which come first */
    bool deep, glossy;
    float lowest_cosine, per_cosine, gloss[2], rise[TSUYA_SHEEN_RISE];
    angle_scale psi, phi, theta, d;
    float slant[2][2], reach[2][2]; /* [yarn][of dy2, dx2] */
} cloth;

static cloth cloth_of(const tsuya_sheen *s)
{
    cloth c = {.curves = s->wide, .terms = s->wide + tsuya_wide_term(0), .channels = s->wide + tsuya_wide_channel(s, 0)};
    c.count = s->terms;
    c.level = s->level_terms;
    c.deep = s->nd > 0;
    c.glossy = s->gloss[0] + s->gloss[1] > 0.0;
    c.lowest_cosine = (float)s->lowest_cosine;
    c.per_cosine = (float)(2.0 / (1.0 - s->lowest_cosine));
    c.gloss[0] = (float)s->gloss[0];
    c.gloss[1] = (float)s->gloss[1];
    memcpy(c.rise, s->fast_rise, sizeof c.rise);
    c.psi = scale_of(fine_atan, FINE, s->spans / M_PI);
    c.phi = scale_of(rough_atan, ROUGH, s->nu / (2.0 * M_PI));
    c.theta = scale_of(rough_atan, ROUGH, s->nv / (0.5 * M_PI));
    c.d = scale_of(rough_atan, ROUGH, s->nd / (0.5 * M_PI));
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

/* Fresnel's term less 1, from 4 (wi·h)². */
INLINE lanes rise_of(const cloth *c, lanes sum2)
{
    lanes cosine = all(0.5f) * sum2 * inverse_root(_mm512_max_ps(sum2, all(1e-18f)));
    lanes t = (_mm512_max_ps(cosine, all(c->lowest_cosine)) - all(c->lowest_cosine)) * all(c->per_cosine) - all(1.0f), p = all(c->rise[TSUYA_SHEEN_RISE - 1]);
    for (int k = TSUYA_SHEEN_RISE - 2; k >= 0; --k) {
        p = p * t + all(c->rise[k]);
    }
    return p;
}

/* Lanes of step `step` behind `from` that there are. */
INLINE __mmask16 lanes_at(int count, int from, int step)
{
    int left = count - from - step * TSUYA_WIDE_LANES;
    return left < TSUYA_WIDE_LANES ? (__mmask16)((1u << left) - 1u) : (__mmask16)0xffff;
}

INLINE void find_places(block *b, const cloth *c, const tsuya_direction_batch *d, int from, int steps, bool flat, bool deep, bool glossy)
{
    for (int k = 0; k < steps; ++k) {
        int at = from + k * TSUYA_WIDE_LANES;
        __mmask16 here = lanes_at(d->count, from, k);
        lanes ix = _mm512_maskz_loadu_ps(here, d->wi_x + at), iy = _mm512_maskz_loadu_ps(here, d->wi_y + at);
        lanes iz = _mm512_maskz_loadu_ps(here, d->wi_z + at), ox = _mm512_maskz_loadu_ps(here, d->wo_x + at);
        lanes oy = _mm512_maskz_loadu_ps(here, d->wo_y + at), oz = _mm512_maskz_loadu_ps(here, d->wo_z + at);
        lanes dx = ix - ox, dy = iy - oy, dz = iz - oz, dx2 = dx * dx, dy2 = dy * dy;
        half h = {.x = ix + ox, .y = iy + oy, .z = _mm512_max_ps(iz + oz, all(1e-9f))};
        h.tx = _mm512_abs_ps(h.x);
        h.ty = _mm512_abs_ps(h.y);
        b->falloff[k] = inverse(h.z) * all(0.5f);
        b->warp[k] = slanted(c, 0, dx2, dy2);
        b->weft[k] = slanted(c, 1, dx2, dy2);
        b->t[k] = place_of(inclination(h.x, h.tx, h.z, &c->psi));
        b->b[k] = place_of(inclination(h.y, h.ty, h.z, &c->psi));
        lanes across2 = h.x * h.x + h.y * h.y, z2 = h.z * h.z;
        if (glossy) {
            b->gloss[k] = rise_of(c, across2 + z2);
        }
        if (flat || deep) {
            b->u[k] = place_of(azimuth(&h, &c->phi));
            b->v[k] = place_of(angle_of_squares(across2, z2, &c->theta));
        }
        if (deep) {
            b->d[k] = place_of(angle_of_squares(dz * dz + dx2 + dy2, across2 + z2, &c->d));
        }
    }
}

/* Adds the two curves over one inclination, one of each yarn. */
INLINE void add_curves(lanes *warp, lanes *weft, const place *places, const float *of_warp, const float *of_weft, int steps)
{
    for (int k = 0; k < steps; ++k) {
        const place p = places[k];
        __mmask16 last = _mm512_test_epi32_mask(p.at, _mm512_set1_epi32(32));
        warp[k] += value_48(of_warp, &p, last);
        weft[k] += value_48(of_weft, &p, last);
    }
}

INLINE void weave_yarns(block *b, const cloth *c, int steps, bool glossy)
{
    const int size = 4 * TSUYA_WIDE_CURVE;
    add_curves(b->warp, b->weft, b->b, c->curves + TSUYA_SHEEN_WARP_ALONG * size, c->curves + TSUYA_SHEEN_WEFT_ACROSS * size, steps);
    add_curves(b->warp, b->weft, b->t, c->curves + TSUYA_SHEEN_WARP_ACROSS * size, c->curves + TSUYA_SHEEN_WEFT_ALONG * size, steps);
    for (int k = 0; k < steps; ++k) {
        b->warp[k] = power_of_two(b->warp[k]) * b->falloff[k];
        b->weft[k] = power_of_two(b->weft[k]) * b->falloff[k];
        if (glossy) {
            b->gloss[k] *= all(c->gloss[0]) * b->warp[k] + all(c->gloss[1]) * b->weft[k];
        }
    }
}

INLINE void multiply_term(lanes *term, const block *b, const float *table, int steps, bool level, bool deep)
{
    const curve_16 round = load_16(table), over_d = load_16(table + 4 * (TSUYA_WIDE_ROUND + TSUYA_WIDE_TILT));
    const curve_32 tilt = load_32(table + 4 * TSUYA_WIDE_ROUND);
    for (int k = 0; k < steps; ++k) {
        const place u = b->u[k], v = b->v[k], d = b->d[k];
        lanes product = value_32(&tilt, &v);
        if (!level) {
            product *= value_16(&round, &u);
        }
        if (deep) {
            product *= value_16(&over_d, &d);
        }
        term[k] = product;
    }
}

INLINE void multiply_terms(block *b, const cloth *c, int steps, bool deep)
{
    for (int r = 0; r < c->level; ++r) {
        multiply_term(b->term[r], b, c->terms + r * TSUYA_WIDE_TERM, steps, true, deep);
    }
    for (int r = c->level; r < c->count; ++r) {
        multiply_term(b->term[r], b, c->terms + r * TSUYA_WIDE_TERM, steps, false, deep);
    }
}

INLINE void eval_all(float *value, const cloth *c, int channels, const tsuya_direction_batch *batch, bool flat, bool deep, bool glossy)
{
    block b;
    for (int from = 0; from < batch->count; from += STEPS * TSUYA_WIDE_LANES) {
        int left = (batch->count - from + TSUYA_WIDE_LANES - 1) / TSUYA_WIDE_LANES, steps = left < STEPS ? left : STEPS;
        find_places(&b, c, batch, from, steps, flat, deep, glossy);
        weave_yarns(&b, c, steps, glossy);
        if (flat || deep) {
            multiply_terms(&b, c, steps, deep);
        }
        for (int channel = 0; channel < channels; ++channel) {
            const float *row = c->channels + channel * TSUYA_WIDE_LANES;
            float *to = value + (size_t)channel * (size_t)batch->count + from;
            for (int k = 0; k < steps; ++k) {
                lanes f = all(row[TSUYA_WIDE_WARP]) * b.warp[k] + all(row[TSUYA_WIDE_WEFT]) * b.weft[k] + all(row[TSUYA_WIDE_MATTE]) * b.falloff[k];
                if (glossy) {
                    f += b.gloss[k];
                }
                if (flat || deep) {
                    lanes sum = all(row[0]) * b.term[0][k];
                    for (int r = 1; r < c->count; ++r) {
                        sum += all(row[r]) * b.term[r][k];
                    }
                    f *= power_of_two(sum);
                }
                _mm512_mask_storeu_ps(to + k * TSUYA_WIDE_LANES, lanes_at(batch->count, from, k), f);
            }
        }
    }
}

void tsuya_sheen_eval_wide(const tsuya_sheen *s, int channels, const tsuya_direction_batch *batch, float *value)
{
    const cloth c = cloth_of(s);
    const tsuya_direction_batch own = *batch; /* which no store of a value can change */
    switch ((c.count == 0 ? 0 : c.deep ? 2 : 1) + (c.glossy ? 3 : 0)) {
    case 0: eval_all(value, &c, channels, &own, false, false, false); break;
    case 1: eval_all(value, &c, channels, &own, true, false, false); break;
    case 2: eval_all(value, &c, channels, &own, false, true, false); break;
    case 3: eval_all(value, &c, channels, &own, false, false, true); break;
    case 4: eval_all(value, &c, channels, &own, true, false, true); break;
    default: eval_all(value, &c, channels, &own, false, true, true); break;
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
