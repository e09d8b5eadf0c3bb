/* The two-dimensional Fourier transform of a real square, for sizes that are powers of two.
 *
 * Stockham's self-sorting radix-2 algorithm on many columns at once, the columns being what the vector units work on; two real
 * columns travel as one complex one.  Only frequencies with ky ≥ 0 are made. */
#ifndef TSUYA_WEAVE_DETECT_FOURIER_H
#define TSUYA_WEAVE_DETECT_FOURIER_H

#include "core/status.h"

/* Workspace and result: the transform at (kx, ky), 0 ≤ kx < size (wrapped), 0 ≤ ky ≤ size/2, stands at kx · stride + ky. */
typedef struct tsuya_fourier {
    int size, stride;
    float *re, *im;             /* result */
    float *other_re, *other_im; /* scratch */
    float *cosine, *sine;       /* of −2πk/size, k < size/2 */
} tsuya_fourier;

TSUYA_MUST_CHECK tsuya_status tsuya_fourier_create(tsuya_fourier *fourier, int size); /* power of two, 16 … 1024 */
void tsuya_fourier_free(tsuya_fourier *fourier);
/* values: size × size, rows top to bottom (y down). */
void tsuya_fourier_run(tsuya_fourier *fourier, const float *values);

#endif
