/* Tags that the detector missed, looked for where their plate's other tags say they are. */
#ifndef TSUYA_CALIB_GUIDED_H
#define TSUYA_CALIB_GUIDED_H

#include "calib/apriltag_adapter.h"
#include "calib/board.h"

/* `seen`: trusted tags, all of the board, room for board->tag_count.  Appends those whose code is read at the predicted place
 * (correlation of the code's cells with the grey values); their corners are the prediction, to be refined. */
TSUYA_MUST_CHECK tsuya_status tsuya_guided_search(tsuya_tag_sighting *seen, int *count, const tsuya_board *board, const tsuya_image *grey);

#endif
