/* The frequencies of a pair of thread families to a fraction of a bin.
 *
 * The strongest points of the weave's lattice are taken as sinusoids.  At each, the pixels' transform and its first moments are made
 * under a window that is flat but for its rim, so that almost nothing of the patch's information is given away; what the points leak
 * into each other (also into their mirrors) is taken out by the window's own transform.  A moment in quadrature with the amplitude
 * says how far the point lies from where the lattice has it: one Gauss–Newton step.  The two families' frequencies are then the least
 * squares solution of
 *     f(a1, a2) = a1·f1 + a2·f2,
 * each point weighted by its own Cramér–Rao covariance (Rife & Boorstyn, "Single-tone parameter estimation", 1974, in two
 * dimensions) and by how much uneven threads smear it: threads that stand unevenly but straight move their points along their own
 * frequency only, which leaves their angle untouched. */
#ifndef TSUYA_WEAVE_DETECT_REFINE_H
#define TSUYA_WEAVE_DETECT_REFINE_H

#include "weave_detect/lattice.h"

enum { TSUYA_TONES = 28, TSUYA_TONES_FIRST = 10, TSUYA_WINDOW_STEPS = 32 };

typedef struct tsuya_refiner {
    int n;
    float *window, *plain;   /* n; n × n: the patch under the window */
    float *wave;             /* cos, sin, x·cos, x·sin along an axis, 4 × n */
    float *column;           /* what the columns sum up to under it, 4 × n */
    float *transform;        /* of the window, and of x·window: 2 a step of 1/(n · WINDOW_STEPS), from 0 to 1 */
    double sum, sum_xx;      /* Σ w, Σ w x² over the patch, x from the middle */
    double energy;           /* Σ w v² */
} tsuya_refiner;

TSUYA_MUST_CHECK tsuya_status tsuya_refiner_create(tsuya_refiner **refiner, int n);
void tsuya_refiner_free(tsuya_refiner *refiner);

typedef struct tsuya_refined {
    double f[2][2];
    double sigma_rad[2]; /* of each family's angle */
    double noise;        /* standard deviation of the residual */
    int tones;           /* points that were used */
    double scatter;      /* rms of the points about the lattice, in their own standard deviations */
    double power;        /* Σ amplitude² of the points that were used */
} tsuya_refined;

/* A point a1·f1 + a2·f2 of a lattice, and the amplitude² that a spectrum has there. */
typedef struct tsuya_lattice_point {
    float a1, a2, power;
} tsuya_lattice_point;

/* The points that carry most information about the frequencies; at most `most`. */
int tsuya_refine_points(tsuya_lattice_point *point, int most, const tsuya_spectrum *spectrum, int step, const double f[2][2]);
/* Takes the patch of the spectrum; only `detrended` is used. */
void tsuya_refine_begin(tsuya_refiner *refiner, const tsuya_spectrum *spectrum);
/* After that: one round of Gauss–Newton on the given points from frequencies `f`.  False where the fit loses its points. */
bool tsuya_refine_at(tsuya_refined *refined, tsuya_refiner *refiner, const double f[2][2], const tsuya_lattice_point *point, int count);

/* `rounds` of Gauss–Newton: 1 is enough; the last looks at all points, those before at the strongest.  0: the basis as it came.  False where
 * the fit loses its points; `refined` then holds the basis as it came. */
bool tsuya_refine(tsuya_refined *refined, tsuya_refiner *refiner, const tsuya_spectrum *spectrum, const tsuya_basis *basis, int rounds);

/* One family alone, from a peak and its harmonics; `f` holds a start and gets the result.  False where the fit loses them. */
bool tsuya_refine_single(double f[2], double *sigma_rad, tsuya_refiner *refiner, const tsuya_spectrum *spectrum, int rounds);

#endif
