/* What makes a reconstruction metric, as the job and `tsuya reconstruct` give it: a board whose tags stand in the photographs,
 * or measured distances between points marked in them. */
#ifndef TSUYA_APP_CALIB_SCALE_H
#define TSUYA_APP_CALIB_SCALE_H

#include "core/context.h"
#include "core/photo.h"
#include "core/yaml.h"
#include "reconstruct/scale.h"

typedef struct tsuya_calib_scale {
    tsuya_scale_input input;
    tsuya_arena *arena;
} tsuya_calib_scale;

/* Looks for the board's tags in every photograph.  Fails when none is seen. */
TSUYA_MUST_CHECK tsuya_status tsuya_calib_scale_from_board(tsuya_calib_scale *scale, const char *board, const tsuya_photo_set *photos,
                                                           const tsuya_context *context);
/* `distances`: lists of texts, each `METRES`, `PHOTO X,Y X,Y`, `PHOTO X,Y X,Y`, … with both ends' pixels in two photographs or
 * more; `-` for an end that one does not show.  `where`: for messages. */
TSUYA_MUST_CHECK tsuya_status tsuya_calib_scale_from_distances(tsuya_calib_scale *scale, const tsuya_yaml_list *distances, const char *where,
                                                               const tsuya_photo_set *photos);
/* `METRES; PHOTO X,Y X,Y; PHOTO X,Y X,Y` cut at the semicolons, as one of the lists above (in the arena). */
TSUYA_MUST_CHECK tsuya_status tsuya_calib_scale_split(tsuya_yaml_list *list, const char *text, tsuya_arena *arena);
void tsuya_calib_scale_free(tsuya_calib_scale *scale);

#endif
