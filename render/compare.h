/* A rendered picture against the photograph that the same camera took.
 *
 * Compared are the pixels that the mask keeps and that the render's cloth covers wholly; which share of the mask that is is
 * said beside.  The render's exposure and white balance are one gain per channel on its linear values: given, or fitted so that
 * each channel's mean over the pixels that the photograph did not clip is the photograph's.  The render is then clipped to
 * [0, 1] as a camera does, and both are taken for sRGB pictures seen under D65.
 *
 *   PSNR   of the sRGB-encoded values, all three channels, peak 1
 *   SSIM   Wang, Bovik, Sheikh, Simoncelli, IEEE TIP 13(4), 2004: luma of the encoded values, Gaussian window of 11 pixels with
 *          σ = 1.5 over the compared pixels, K1 = 0.01, K2 = 0.03
 *   ΔE00   CIEDE2000, pixel by pixel */
#ifndef TSUYA_RENDER_COMPARE_H
#define TSUYA_RENDER_COMPARE_H

#include "core/context.h"
#include "core/image.h"
#include "core/json.h"

typedef struct tsuya_compare_options {
    double gain[3]; /* r g b; NaN in the first: fitted */
} tsuya_compare_options;
TSUYA_API tsuya_compare_options tsuya_compare_options_default(void); /* fitted */

typedef struct tsuya_comparison {
    double gain[3];
    bool fitted;
    double compared;  /* share of the mask's pixels that were compared */
    double pixels;    /* their number */
    double psnr_db, ssim, de00_mean, de00_median, de00_p95;
} tsuya_comparison;

/* Histogram of ΔE00, so that the quantiles of several photographs together can be told: bins of 0.02, the last one open. */
enum { TSUYA_DE00_BINS = 5000 };
typedef struct tsuya_de00_histogram {
    uint64_t count[TSUYA_DE00_BINS];
    double sum; /* of ΔE00 */
    uint64_t pixels;
} tsuya_de00_histogram;
TSUYA_API double tsuya_de00_quantile(const tsuya_de00_histogram *histogram, double share); /* NaN of none */

/* render: linear float RGBA, alpha the cloth's coverage; photo: sRGB of the same size or of the same shape (then resized in
 * linear light); mask: NULL or one channel, above half keeps.  `map` (may be NULL): ΔE00 in one float channel, −1 where nothing
 * was compared.  `histogram` (may be NULL) is added to.  Fails on other shapes and where nothing can be compared. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_compare(tsuya_comparison *result, tsuya_image *map, tsuya_de00_histogram *histogram,
                                                      const tsuya_image *render, const tsuya_image *photo, const tsuya_image *mask,
                                                      const tsuya_compare_options *options, const char *name,
                                                      const tsuya_context *context);

/* Photograph, render with its gains, and ΔE00 (black 0, red 7, yellow 13, white 20 and more), side by side, cut to what was compared. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_compare_picture(tsuya_image *picture, const tsuya_comparison *result,
                                                              const tsuya_image *map, const tsuya_image *render,
                                                              const tsuya_image *photo);
TSUYA_API void tsuya_comparison_to_json(tsuya_json *object, const tsuya_comparison *result);

#endif
