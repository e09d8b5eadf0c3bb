#include "render/like.h"

#include <math.h>
#include <string.h>

static void add(tsuya_like_sum *sum, const tsuya_comparison *c)
{
    sum->psnr_db += c->psnr_db;
    sum->ssim += c->ssim;
    sum->compared += c->compared;
    sum->photos++;
}

tsuya_status tsuya_like_compare(tsuya_like_sum *sum, tsuya_json *record, const tsuya_render_frame *frame, const double gain[3],
                                const char *exr_path, const char *picture_path, const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    tsuya_image render = {0}, photo = {0}, mask = {0}, map = {0}, picture = {0};
    tsuya_comparison comparison;
    tsuya_compare_options options;
    memcpy(options.gain, gain, sizeof options.gain);
    TSUYA_GOTO_DONE(status, tsuya_image_load(&render, exr_path));
    TSUYA_GOTO_DONE(status, tsuya_image_load(&photo, frame->photo));
    if (frame->mask) {
        TSUYA_GOTO_DONE(status, tsuya_image_load(&mask, frame->mask));
    }
    TSUYA_GOTO_DONE(status, tsuya_compare(&comparison, &map, &sum->de00, &render, &photo, frame->mask ? &mask : NULL, &options,
                                          frame->photo, context));
    TSUYA_GOTO_DONE(status, tsuya_compare_picture(&picture, &comparison, &map, &render, &photo));
    TSUYA_GOTO_DONE(status, tsuya_image_save(&picture, picture_path, NULL));
    add(sum, &comparison);
    tsuya_json *like = tsuya_json_set_object(record, "like");
    tsuya_json_set_text(like, "photo", frame->photo);
    tsuya_json_set_text(like, "mask", frame->mask);
    tsuya_json_set_bool(like, "held_out", frame->held_out);
    tsuya_comparison_to_json(like, &comparison);
done:
    tsuya_image_free(&render);
    tsuya_image_free(&photo);
    tsuya_image_free(&mask);
    tsuya_image_free(&map);
    tsuya_image_free(&picture);
    return status;
}

tsuya_render_like tsuya_like_mean(const tsuya_like_sum *sum)
{
    double n = sum->photos > 0 ? (double)sum->photos : (double)NAN;
    return (tsuya_render_like){.photos = sum->photos,
                               .psnr_db = sum->psnr_db / n,
                               .ssim = sum->ssim / n,
                               .compared = sum->compared / n,
                               .de00_mean = sum->de00.sum / (double)sum->de00.pixels,
                               .de00_median = tsuya_de00_quantile(&sum->de00, 0.5),
                               .de00_p95 = tsuya_de00_quantile(&sum->de00, 0.95)};
}
