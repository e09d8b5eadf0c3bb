/* Which peaks of a spectrum are threads.
 *
 * Threads that lie side by side with frequencies f1 (picks) and f2 (ends) make peaks at k·f1 and k·f2; how they interlace adds peaks at
 * rational combinations a·f1 + b·f2.  Plain weave, twill and satin are all "one step": the next pick is the same, shifted by s
 * ends of a repeat of n.  Then a + s·b is whole, with a and b multiples of 1/n.  So many pairs of peaks span the same set of
 * points, and the lattice alone cannot say which pair is the threads: a plain weave's diagonals span it as well as its threads
 * do.  What does say it is how strong each kind of peak is: threads are continuous and have harmonics, interlacing has not.
 *
 * Threads finer than two pixels are seen at f − k, k whole.  Their points then fit a lattice too, all but the interlacing: half of
 * k1 + k2 need not be whole, and a point ½f1 + ½f2 stands half a cycle from where the seen lattice has it.  Stripes of a print are peaks
 * outside the lattice, or peaks of which a family is a multiple.
 *
 * Every pair of peaks (and of their sums and differences) that can be two threads is described by the levels at the points that
 * matter, and a small network weighs them (lattice_weights.h).  A soft maximum over the pairs, with one more alternative that
 * means "none of these", makes the weights probabilities. */
#ifndef TSUYA_WEAVE_DETECT_LATTICE_H
#define TSUYA_WEAVE_DETECT_LATTICE_H

#include "weave_detect/spectrum.h"
#include "weave_detect/threads.h"

enum { TSUYA_FEATURES = 56, TSUYA_BASES = 40, TSUYA_HIDDEN = 32, TSUYA_STEPS = 9 };

/* How the threads interlace: repeat n and step s. */
typedef struct tsuya_step {
    int repeat, step; /* step is signed: twills lean both ways */
    tsuya_weave_kind kind;
} tsuya_step;
extern const tsuya_step tsuya_steps[TSUYA_STEPS];

typedef struct tsuya_basis {
    double f[2][2];  /* [family][x, y], cycles a pixel; the family of the stronger fundamental first */
    int step;        /* index of the step that explains the peaks best */
    float feature[TSUYA_FEATURES];
    float score, probability;
} tsuya_basis;

typedef struct tsuya_bases {
    tsuya_basis basis[TSUYA_BASES];
    int count;
    float none_feature[TSUYA_FEATURES];
    float none_probability;
} tsuya_bases;

/* The alternatives with their features. */
void tsuya_bases_list(tsuya_bases *bases, const tsuya_spectrum *spectrum);
/* Their probabilities; with the one of "none", they sum to 1. */
void tsuya_bases_weigh(tsuya_bases *bases);

/* The weights: hidden layer (HIDDEN × (FEATURES + 1)), then the sum (HIDDEN + 1).  The fit writes them (tests/weave_detect/fit_lattice.c). */
enum { TSUYA_WEIGHTS = TSUYA_HIDDEN * (TSUYA_FEATURES + 1) + TSUYA_HIDDEN + 1 };
float tsuya_bases_score(const float *weight, const float *feature);

#endif
