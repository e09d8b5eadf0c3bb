/* Where the mapper's models of one set could be joined (inside reconstruct/). */
#ifndef TSUYA_RECONSTRUCT_GROUPS_H
#define TSUYA_RECONSTRUCT_GROUPS_H

#include "core/json.h"
#include "reconstruct/pairs.h"

/* The photographs of two models between which a further one is most likely to join them. */
typedef struct tsuya_bridge {
    const char *from, *to; /* names, borrowed from the models */
    int matches;           /* verified between them; 0: chosen by the look of their thumbnails */
    float likeness;
} tsuya_bridge;

/* Of the pairs with one photograph in each model alone the one with most verified matches, else the one that looks most
 * alike.  False where a model has no photograph of its own. */
bool tsuya_groups_bridge(tsuya_bridge *bridge, const tsuya_sparse_model *a, const tsuya_sparse_model *b, const tsuya_database *database,
                         const tsuya_pairs *pairs, const tsuya_photo_set *photos);

/* Warns, and fills `array` with {photos: [names], join: {from, to, matches}} for every model but the kept one. */
TSUYA_MUST_CHECK tsuya_status tsuya_groups_report(tsuya_json *array, const tsuya_sparse_model *model, int model_count, int kept,
                                                  const tsuya_database *database, const tsuya_photo_set *photos,
                                                  const tsuya_context *context);

#endif
