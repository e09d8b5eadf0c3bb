/* Which of the two families is the weft. */
#ifndef TSUYA_WEAVE_DETECT_LABEL_H
#define TSUYA_WEAVE_DETECT_LABEL_H

#include "weave_detect/patches.h"

/* Orders the families of every patch: a becomes the weft; sets `weft_told`.  With `weft_deg` (NaN: not known) the weft is the family nearer
 * to it; otherwise, where the picture's crosses stand one way, the family of the coarser threads if nearly all sure patches agree which
 * that is; otherwise the nearer to the horizontal, which is a name and no finding. */
void tsuya_patches_label(tsuya_patch_grid *grid, double weft_deg);

#endif
