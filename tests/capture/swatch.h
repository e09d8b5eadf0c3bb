/* Cusick's swatch and what the drape's tests and benches share. */
#ifndef TSUYA_TESTS_CAPTURE_SWATCH_H
#define TSUYA_TESTS_CAPTURE_SWATCH_H

#include "capture/drape.h"

static const double GRAVITY = 9.81;
/* Twist over both bending rigidities, between what measured cloth shows by the two readings in drape.h. */
static const double TWIST = 0.9;

/* Alike along weft and warp. */
tsuya_drape_fabric plain(double mass, double bend);
/* Tip of a heavy elastica clamped level, length 1: B θ'' = −w (1 − s) cos θ (θ downwards). */
void elastica(double w_over_b, double *x, double *drop);
/* tsuya_drape_run, and a line on how it went. */
void run(tsuya_drape_info *info, tsuya_drape_sheet *sheet, const tsuya_drape_fabric *f, const tsuya_drape_body *body, int bodies,
         const tsuya_drape_options *o, int threads);

/* 30 cm on an 18 cm disc. */
typedef struct swatch {
    double bending_length_m; /* mean of weft and warp */
    double ratio;            /* of warp to weft */
    double twist, spacing_m;
    int threads;
} swatch;
/* Alike along weft and warp, in cells of 1 cm. */
swatch swatch_alike(double bending_length_m);
typedef struct draped {
    double coefficient, energy_j; /* share of the ring in the shadow, % */
    int folds;
} draped;
/* From an uneven start of this seed; `positions` (tsuya_free) may be NULL. */
draped cusick(const swatch *w, uint64_t seed, double **positions);
/* Where so many starts lead that are uneven each in its own way: the one of least energy, and how far they spread. */
draped settled(const swatch *w, int starts, double *spread);

#endif
