/* Which photographs to match with which: neighbours in the order of their names, and look-alikes, so that matching grows
 * with n·k and not with n².
 *
 * Look-alikes are told by thumbnails: histograms of gradient orientation (after Dalal & Triggs, CVPR 2005) over the
 * mask's bounding box, 8 × 8 cells of 8 orientations, clipped and normalised. */
#ifndef TSUYA_RECONSTRUCT_PAIRS_H
#define TSUYA_RECONSTRUCT_PAIRS_H

#include "core/context.h"
#include "core/photo.h"
#include "reconstruct/database_adapter.h"

typedef struct tsuya_pairs_options {
    int sequence;   /* neighbours on each side in the order of names; default 4, then also at distances 8, 16, 32 */
    int look_alike; /* most similar others of each photograph; default 6 */
    int all_up_to;  /* so few photographs are matched all against all; default 12 */
    int verified_least; /* a photograph with fewer verified neighbours gets a second round; default 4 */
} tsuya_pairs_options;
tsuya_pairs_options tsuya_pairs_options_default(void);

typedef struct tsuya_pairs {
    int photo_count;
    uint8_t *chosen; /* photo_count × photo_count, symmetric */
    float *likeness; /* photo_count × photo_count, [0, 1] */
    int count, possible;
} tsuya_pairs;

/* The first round. */
TSUYA_MUST_CHECK tsuya_status tsuya_pairs_create(tsuya_pairs *pairs, const tsuya_photo_set *photos, const tsuya_pairs_options *options,
                                                 const tsuya_context *context);
/* The second round, from what the first verified: photographs with few verified neighbours, and photographs outside the
 * largest connected part, are paired with the neighbours of their neighbours and with further look-alikes.  `added` is
 * the number of new pairs, 0 when the view graph is sound. */
TSUYA_MUST_CHECK tsuya_status tsuya_pairs_extend(tsuya_pairs *pairs, int *added, const tsuya_database *database,
                                                 const tsuya_photo_set *photos, const tsuya_pairs_options *options);
/* COLMAP's match list: two names a line. */
TSUYA_MUST_CHECK tsuya_status tsuya_pairs_save(const tsuya_pairs *pairs, const tsuya_photo_set *photos, const char *path);
void tsuya_pairs_free(tsuya_pairs *pairs);

#endif
