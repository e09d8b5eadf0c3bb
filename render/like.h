/* The pictures of a render that have a photograph beside them: compared one by one, and summed up apart for those that were
 * held out.  For render/render.c. */
#ifndef TSUYA_RENDER_LIKE_H
#define TSUYA_RENDER_LIKE_H

#include "render/compare.h"
#include "render/render.h"
#include "render/setup.h"

typedef struct tsuya_like_sum {
    double psnr_db, ssim, compared; /* sums over photographs */
    int photos;
    tsuya_de00_histogram de00;
} tsuya_like_sum;

/* Reads the finished EXR, compares, writes the picture of the comparison and the record's "like". */
TSUYA_MUST_CHECK tsuya_status tsuya_like_compare(tsuya_like_sum *sum, tsuya_json *record, const tsuya_render_frame *frame,
                                                 const double gain[3], const char *exr_path, const char *picture_path,
                                                 const tsuya_context *context);
tsuya_render_like tsuya_like_mean(const tsuya_like_sum *sum);

#endif
