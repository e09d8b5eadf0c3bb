/* What batches read of a sheen, in float: built once, by tsuya_sheen_prepare. */
#ifndef TSUYA_BRDF_SHEEN_TABLES_H
#define TSUYA_BRDF_SHEEN_TABLES_H

#include "brdf/sheen.h"

/* Rows of all terms side by side, `round` going on past the seam by three; terms that are not there are 0. */
typedef struct tsuya_sheen_rows {
    float *over_b, *over_t;              /* pairs: warp along and weft across; warp across and weft along */
    float *round, *tilt, *deep, *tint;   /* TSUYA_SHEEN_TERMS numbers a control value; tint: a channel */
} tsuya_sheen_rows;
tsuya_sheen_rows tsuya_sheen_rows_of(const tsuya_sheen *sheen);

/* Tables that fit into a few registers of sixteen floats (brdf/sheen_wide.c): each curve as four tables, the coefficients of the cubic
 * on each interval, and one entry more for the end.  Logarithms are to base 2. */
enum { TSUYA_WIDE_LANES = 16, TSUYA_WIDE_CURVE = 48, TSUYA_WIDE_ROUND = 16, TSUYA_WIDE_TILT = 32, TSUYA_WIDE_DEEP = 16, TSUYA_WIDE_RISE = 16 };
enum { TSUYA_WIDE_TERM = 4 * (TSUYA_WIDE_ROUND + TSUYA_WIDE_TILT + TSUYA_WIDE_DEEP) };
enum { TSUYA_WIDE_WARP = TSUYA_SHEEN_TERMS, TSUYA_WIDE_WEFT, TSUYA_WIDE_MATTE }; /* of a channel's row, behind the tints */
/* Intervals of a table: as many times those of its curve as have room. */
static inline int tsuya_wide_intervals(int intervals, int entries) { return (entries - 1) / intervals * intervals; }
/* Entries of the tables over θh: half of the room where that is enough, for it is one register instead of two. */
static inline int tsuya_wide_tilt(const tsuya_sheen *s) { return s->nv > 7 && s->nv < TSUYA_WIDE_TILT / 2 ? TSUYA_WIDE_TILT / 2 : TSUYA_WIDE_TILT; }

/* Tables over ψ, θh and θd lie over a bent angle, 45° and q (1 + a q² + b q⁴ + c q⁶) of the tangent q of what the angle has over 45°: |q| <= 1, for which
 * neither half of a right angle needs a case of its own.  It is within 0.00089 of the angle, with the same first two derivatives at both
 * ends, where tables meet their mirror images: a cubic over it is as good as one over the angle, for half the operations. */
enum { TSUYA_BENT = 4 };
extern const double tsuya_bent[TSUYA_BENT];

/* Where the tables lie: the curves, Fresnel's term over the cosine from `lowest_cosine` to 1, S term by term, a row a channel. */
static inline size_t tsuya_wide_rise(void) { return 4 * TSUYA_SHEEN_CURVES * TSUYA_WIDE_CURVE; }
static inline size_t tsuya_wide_term(int term) { return tsuya_wide_rise() + (size_t)(4 * TSUYA_WIDE_RISE + term * TSUYA_WIDE_TERM); }
static inline size_t tsuya_wide_channel(const tsuya_sheen *s, int channel) { return tsuya_wide_term(s->terms) + (size_t)(channel * TSUYA_WIDE_LANES); }

TSUYA_MUST_CHECK tsuya_status tsuya_sheen_tables(tsuya_sheen *sheen);
size_t tsuya_sheen_tables_bytes(const tsuya_sheen *sheen);

/* Whether this processor has the registers. */
bool tsuya_sheen_wide_here(void);
/* As tsuya_sheen_eval_batch: on any processor, and only with `wide`. */
void tsuya_sheen_eval_rows(const tsuya_sheen *sheen, int channels, const tsuya_direction_batch *batch, float *value);
void tsuya_sheen_eval_wide(const tsuya_sheen *sheen, int channels, const tsuya_direction_batch *batch, float *value);

#endif
