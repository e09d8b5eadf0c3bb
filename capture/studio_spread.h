/* What a pixel takes of the light around it: over its own square, spread by a Gaussian (what lens and low-pass filter blur), as weights of
 * the cells that pixels are cut into.  Neighbouring pixels share their cells, as they do behind a lens, so that a ray serves all of them
 * and an edge is as smooth as its blur.
 *
 * One axis; the weights of a cell are the product of both.  Cells are finite, so that the Gaussian is taken narrower by what they spread
 * themselves: the variance of the whole is that of pixel and blur. */
#ifndef TSUYA_CAPTURE_STUDIO_SPREAD_H
#define TSUYA_CAPTURE_STUDIO_SPREAD_H

#include "core/status.h"

typedef struct tsuya_studio_spread {
    int side;       /* cells of a pixel */
    int reach;      /* whole pixels on either side whose cells count */
    int count;      /* (2 reach + 1) · side */
    double *weight; /* owned; from the first cell of the pixel that is `reach` before; the sum is 1 */
} tsuya_studio_spread;

/* sigma_px: of the Gaussian, ≥ 0. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_studio_spread_create(tsuya_studio_spread *spread, double sigma_px, int side);
TSUYA_INTERNAL void tsuya_studio_spread_free(tsuya_studio_spread *spread);

#endif
