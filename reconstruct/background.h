/* A background that stands still in the picture while the object turns (a turntable before a fixed camera), or looks the same
 * from everywhere (black cloth all around), found in the photographs themselves (inside reconstruct/).
 *
 * At each pixel of the photographs, reduced, the background is what most of them agree on: the fullest window of a twentieth of
 * grey, and in it the median of each channel.  It is taken for one where two thirds of the photographs agree along two thirds of
 * the picture's border; a camera that is carried around a subject does not show that.  In a photograph the background is then
 * what goes out to the border and is alike in a whole neighbourhood, so that something of its colour inside the object stays;
 * where fewer than half of the photographs agree (a quarter where there is contrast), the object stands there in most, and only a smooth
 * continuation is followed. */
#ifndef TSUYA_RECONSTRUCT_BACKGROUND_H
#define TSUYA_RECONSTRUCT_BACKGROUND_H

#include "core/context.h"
#include "core/json.h"
#include "core/photo.h"

typedef struct tsuya_background_info {
    bool found;
    double border; /* share of the picture's border where two thirds of the photographs agree */
    double masked; /* share of all pixels that the masks leave out; 0 where none was found */
} tsuya_background_info;

/* Where there is a background, writes FOLDER/NAME.png for every photograph, of its size: 255 keeps.  Fewer than eight photographs
 * tell none.  Fails where a photograph cannot be read or a mask not written.  Decodes every photograph twice. */
TSUYA_MUST_CHECK TSUYA_INTERNAL tsuya_status tsuya_background_masks(tsuya_background_info *info, const tsuya_photo_set *photos, const char *folder,
                                                                    const tsuya_context *context);

#endif
