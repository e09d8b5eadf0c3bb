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
enum { TSUYA_WIDE_LANES = 16, TSUYA_WIDE_CURVE = 48, TSUYA_WIDE_ROUND = 16, TSUYA_WIDE_TILT = 32, TSUYA_WIDE_DEEP = 16 };
enum { TSUYA_WIDE_TERM = 4 * (TSUYA_WIDE_ROUND + TSUYA_WIDE_TILT + TSUYA_WIDE_DEEP) };
enum { TSUYA_WIDE_WARP = TSUYA_SHEEN_TERMS, TSUYA_WIDE_WEFT, TSUYA_WIDE_MATTE }; /* of a channel's row, behind the tints */
/* Intervals of a table: as many times those of its curve as have room. */
static inline int tsuya_wide_intervals(int intervals, int entries) { return (entries - 1) / intervals * intervals; }
/* Entries of the tables over θh: half of the room where that is enough, for it is one register instead of two. */
static inline int tsuya_wide_tilt(const tsuya_sheen *s) { return s->nv > 7 && s->nv < TSUYA_WIDE_TILT / 2 ? TSUYA_WIDE_TILT / 2 : TSUYA_WIDE_TILT; }

/* Tables over ψ, θh and θd lie over the bent angle q (1 + a q² + b q⁴ + c q⁶), q the tangent to 45° and of the rest of a right angle beyond.  It is
 * within 0.00089 of atan q, with the same slope at 0 and the same first two derivatives at 45°: a cubic over it is as good as one over the
 * angle, for half the operations. */
enum { TSUYA_BENT = 4 };
extern const double tsuya_bent[TSUYA_BENT];

static inline size_t tsuya_wide_term(int term) { return (size_t)(4 * TSUYA_SHEEN_CURVES * TSUYA_WIDE_CURVE + term * TSUYA_WIDE_TERM); }
static inline size_t tsuya_wide_channel(const tsuya_sheen *s, int channel) { return tsuya_wide_term(s->terms) + (size_t)(channel * TSUYA_WIDE_LANES); }

TSUYA_MUST_CHECK tsuya_status tsuya_sheen_tables(tsuya_sheen *sheen);
size_t tsuya_sheen_tables_bytes(const tsuya_sheen *sheen);

/* Whether this processor has the registers. */
bool tsuya_sheen_wide_here(void);
/* As tsuya_sheen_eval_batch: on any processor, and only with `wide`. */
void tsuya_sheen_eval_rows(const tsuya_sheen *sheen, int channels, const tsuya_direction_batch *batch, float *value);
void tsuya_sheen_eval_wide(const tsuya_sheen *sheen, int channels, const tsuya_direction_batch *batch, float *value);

#endif
