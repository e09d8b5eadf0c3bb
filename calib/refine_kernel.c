/* Eight pixels at a time.  Φ by Abramowitz & Stegun 26.2.17 (7.5e-8), logarithm by the series of artanh, exponential by its own. */
#include "calib/refine_kernel.h"

#include "core/clones.h"

#include <string.h>

enum { LANES = TSUYA_EDGE_LANES, CHUNK = 512, SUMS = EDGE_PARAMETERS * (EDGE_PARAMETERS + 1) / 2 + EDGE_PARAMETERS + 1 };

typedef float vf __attribute__((vector_size(4 * LANES)));
typedef int32_t vi __attribute__((vector_size(4 * LANES)));
#pragma GCC diagnostic ignored "-Wpsabi" /* vectors go to inlined functions only */
#define INLINE static inline __attribute__((always_inline))

static const float DARKEST = 1e-4f; /* of light: black levels are kept from 0, where the tone curve is infinitely steep */

INLINE vf choose(vi where, vf a, vf b) { return (vf)(((vi)a & where) | ((vi)b & ~where)); }

/* 2^x for |x| < 126: the nearest whole power into the exponent, the rest by its series. */
INLINE vf power_of_two(vf x)
{
    const float round = 12582912.0f; /* 1.5 · 2^23: adding it leaves whole numbers */
    vf whole = (x + round) - round, t = (x - whole) * 0.693147181f;
    vf series = 1.0f + t * (1.0f + t * (0.5f + t * (1.0f / 6 + t * (1.0f / 24 + t * (1.0f / 120 + t * (1.0f / 720 + t * (1.0f / 5040)))))));
    return (vf)((vi)series + (__builtin_convertvector(whole, vi) << 23));
}

/* log₂ of positive numbers. */
INLINE vf log_two(vf x)
{
    vi bits = (vi)x - 0x3f3504f3; /* √½: the mantissa comes out between that and its double */
    vi exponent = bits >> 23;
    vf m = (vf)((bits & 0x007fffff) + 0x3f3504f3), s = (m - 1.0f) / (m + 1.0f), q = s * s;
    return __builtin_convertvector(exponent, vf) + 2.885390082f * s * (1.0f + q * (1.0f / 3 + q * (1.0f / 5 + q * (1.0f / 7 + q * (1.0f / 9)))));
}

/* The normal distribution and its density. */
INLINE void normal_at(vf *share, vf *density, vf z)
{
    vf size = choose(z < 0.0f, -z, z);
    size = choose(size > 9.0f, size * 0.0f + 9.0f, size);
    vf t = 1.0f / (1.0f + 0.2316419f * size);
    *density = 0.398942280f * power_of_two(-0.721347520f * size * size);
    vf tail = *density * t * (0.319381530f + t * (-0.356563782f + t * (1.781477937f + t * (-1.821255978f + t * 1.330274429f))));
    *share = choose(z < 0.0f, tail, 1.0f - tail);
}

/* Share of white behind one blur; its derivatives by the edge's place and by that blur. */
INLINE void behind_blur(vf *share, vf *by_place, vf *by_blur, vf off, float blur, vf stray)
{
    const float per_px = 1.0f / blur;
    const vf z = off * per_px, left = 1.0f - stray;
    vf density;
    normal_at(share, &density, z);
    *share = stray + left * *share;
    *by_place = left * density * per_px;
    *by_blur = -*by_place * z;
}

/* Residual and gradient of the pixels from i on. */
INLINE vf evaluate(vf g[EDGE_PARAMETERS], const float p[EDGE_PARAMETERS], const tsuya_edge_pixels *s, int i, bool curved, bool sharpened, bool learn)
{
    vf u = *(const vf *)&s->u[i], bend = u * u - 1.0f / 3, share, by_place, by_blur, lobes = u * 0.0f, rise = u * 0.0f + 1.0f;
    const vf off = p[EDGE_OFFSET] + p[EDGE_SLOPE] * u + p[EDGE_BOW] * bend - *(const vf *)&s->depth[i];
    behind_blur(&share, &by_place, &by_blur, off, p[EDGE_BLUR], *(const vf *)&s->stray[i]);
    if (sharpened) {
        const float wide = (float)tsuya_edge_wide((double)p[EDGE_BLUR]), c = p[EDGE_SHARPENING];
        vf wide_share, wide_by_place, wide_by_blur;
        behind_blur(&wide_share, &wide_by_place, &wide_by_blur, off, wide, *(const vf *)&s->stray_wide[i]);
        lobes = share - wide_share;
        share += c * lobes;
        by_place += c * (by_place - wide_by_place);
        by_blur += c * (by_blur - p[EDGE_BLUR] / wide * wide_by_blur);
    }
    const vf black = p[EDGE_BLACK] + p[EDGE_BLACK_SLOPE] * u, contrast = p[EDGE_WHITE] + p[EDGE_WHITE_SLOPE] * u - black, even = black + contrast * share;
    const vf arc = 1.0f + p[EDGE_ARC] * bend;
    vf light = even * arc;
    light = choose(light > DARKEST, light, u * 0.0f + DARKEST);
    vf value = light;
    if (curved) {
        const float by_tone = 1.0f / p[EDGE_TONE], lift = (float)EDGE_TONE_LIFT * (p[EDGE_TONE] - 1.0f);
        vf logarithm = log_two(light), power = power_of_two(logarithm * by_tone);
        value = (1.0f + lift) * power - lift;
        rise = (1.0f + lift) * by_tone * power / light;
        if (learn) {
            g[EDGE_TONE] = (1.0f + lift) * power * logarithm * (-0.693147181f * by_tone * by_tone) + (float)EDGE_TONE_LIFT * (power - 1.0f);
        }
    }
    g[EDGE_ARC] = rise * even * bend;
    rise *= arc;
    if (learn) {
        g[EDGE_SHARPENING] = rise * contrast * lobes;
    }
    g[EDGE_OFFSET] = rise * contrast * by_place;
    g[EDGE_SLOPE] = g[EDGE_OFFSET] * u;
    g[EDGE_BOW] = g[EDGE_OFFSET] * bend;
    g[EDGE_BLUR] = rise * contrast * by_blur;
    g[EDGE_WHITE] = rise * share;
    g[EDGE_WHITE_SLOPE] = g[EDGE_WHITE] * u;
    g[EDGE_BLACK] = rise - g[EDGE_WHITE];
    g[EDGE_BLACK_SLOPE] = g[EDGE_BLACK] * u;
    return *(const vf *)&s->grey[i] - value;
}

/* Lower half of JᵀJ row by row, then Jᵀr, then r², over one chunk. */
INLINE void add_chunk(double *sum, const float p[EDGE_PARAMETERS], const tsuya_edge_pixels *s, int begin, int end, bool curved, bool sharpened, bool learn)
{
    const int size = learn ? EDGE_PARAMETERS : EDGE_TONE;
    const vi lane = {0, 1, 2, 3, 4, 5, 6, 7};
    vf part[SUMS] = {0};
    for (int i = begin; i < end; i += LANES) {
        vf g[EDGE_PARAMETERS], r = evaluate(g, p, s, i, curved, sharpened, learn);
        vf *out = part;
        if (i + LANES > end) {
            vi there = lane + i < end;
            for (int a = 0; a < size; a++) {
                g[a] = (vf)((vi)g[a] & there);
            }
            r = (vf)((vi)r & there);
        }
#pragma GCC unroll 11
        for (int a = 0; a < size; a++) {
#pragma GCC unroll 11
            for (int b = 0; b <= a; b++) {
                *out++ += g[a] * g[b];
            }
        }
#pragma GCC unroll 11
        for (int a = 0; a < size; a++) {
            *out++ += g[a] * r;
        }
        *out += r * r;
    }
    for (int k = 0; k < size * (size + 1) / 2 + size + 1; k++) {
        for (int l = 0; l < LANES; l++) {
            sum[k] += (double)part[k][l];
        }
    }
}

INLINE void add_chunks(double *sum, const float p[EDGE_PARAMETERS], const tsuya_edge_pixels *s, bool curved, bool sharpened, bool learn)
{
    for (int begin = 0; begin < s->count; begin += CHUNK) {
        add_chunk(sum, p, s, begin, begin + CHUNK < s->count ? begin + CHUNK : s->count, curved, sharpened, learn);
    }
}

#define CLONED TSUYA_CLONES("arch=x86-64-v3", "default") static void
CLONED add_linear(double *sum, const float *p, const tsuya_edge_pixels *s) { add_chunks(sum, p, s, false, false, false); }
CLONED add_curved(double *sum, const float *p, const tsuya_edge_pixels *s) { add_chunks(sum, p, s, true, false, false); }
CLONED add_sharpened(double *sum, const float *p, const tsuya_edge_pixels *s) { add_chunks(sum, p, s, true, true, false); }
CLONED add_learning(double *sum, const float *p, const tsuya_edge_pixels *s) { add_chunks(sum, p, s, true, true, true); }

void tsuya_edge_normal_sum(tsuya_edge_normal *n, const double p[EDGE_PARAMETERS], tsuya_edge_pixels *s, bool learn)
{
    float narrow[EDGE_PARAMETERS];
    double sum[SUMS] = {0}, *at = sum;
    int size = learn ? EDGE_PARAMETERS : EDGE_TONE;
    for (int a = 0; a < EDGE_PARAMETERS; a++) {
        narrow[a] = (float)p[a];
    }
    for (int i = s->count; i % LANES; i++) {
        s->u[i] = s->depth[i] = s->grey[i] = s->stray[i] = s->stray_wide[i] = 0.0f;
    }
    (learn ? add_learning : p[EDGE_SHARPENING] != 0.0 ? add_sharpened : p[EDGE_TONE] == 1.0 ? add_linear : add_curved)(sum, narrow, s);
    memset(n, 0, sizeof *n);
    for (int a = 0; a < size; a++) {
        for (int b = 0; b <= a; b++) {
            n->h[a][b] = *at++;
        }
    }
    for (int a = 0; a < size; a++) {
        n->g[a] = *at++;
    }
    n->squares = *at;
}
