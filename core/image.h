/* Images in memory: 8 and 16 bits, or float; the type says whether the numbers are linear.
 *
 * Rows top to bottom, pixels interleaved, channels in the order R G B (A) or one grey channel.  Pixel (0,0) is the centre
 * of the first pixel.  Integer samples span 0 … 255 or 0 … 65535; float samples have 1 at the integer's full scale. */
#ifndef TSUYA_CORE_IMAGE_H
#define TSUYA_CORE_IMAGE_H

#include "core/status.h"

#include <stdbool.h>
#include <stdint.h>

typedef enum tsuya_sample { TSUYA_SAMPLE_U8, TSUYA_SAMPLE_U16, TSUYA_SAMPLE_F32 } tsuya_sample;

typedef enum tsuya_encoding {
    TSUYA_ENCODING_LINEAR, /* proportional to light */
    TSUYA_ENCODING_SRGB,   /* IEC 61966-2-1 */
    TSUYA_ENCODING_DATA,   /* not light: masks, depth, labels */
} tsuya_encoding;

typedef struct tsuya_image {
    int width_px, height_px, channels; /* channels 1, 3 or 4 (data: any) */
    tsuya_sample sample;
    tsuya_encoding encoding;
    size_t row_bytes;
    void *data; /* owned; NULL in an empty image */
} tsuya_image;

/* Zeroed.  Fails on sizes outside 1 … 65535 a side or 1 … 64 channels, and when memory is short. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_image_create(tsuya_image *image, int width_px, int height_px, int channels,
                                                           tsuya_sample sample, tsuya_encoding encoding);
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_image_copy(tsuya_image *copy, const tsuya_image *image);
TSUYA_API void tsuya_image_free(tsuya_image *image); /* leaves an empty image; safe on one */

static inline uint8_t *tsuya_image_u8(const tsuya_image *i, int x, int y)
{
    return (uint8_t *)i->data + (size_t)y * i->row_bytes + (size_t)x * (size_t)i->channels;
}
static inline uint16_t *tsuya_image_u16(const tsuya_image *i, int x, int y)
{
    return (uint16_t *)((char *)i->data + (size_t)y * i->row_bytes) + (size_t)x * (size_t)i->channels;
}
static inline float *tsuya_image_f32(const tsuya_image *i, int x, int y)
{
    return (float *)((char *)i->data + (size_t)y * i->row_bytes) + (size_t)x * (size_t)i->channels;
}

/* One sample as a float in the image's own encoding, 1 = full scale. */
TSUYA_API float tsuya_image_get(const tsuya_image *image, int x, int y, int channel);

/* A copy with another sample type and encoding (sRGB ↔ linear applied; alpha and data never).  Rounds to nearest. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_image_convert(tsuya_image *out, const tsuya_image *in, tsuya_sample sample,
                                                            tsuya_encoding encoding);
/* One channel: Rec.709 luma of the values as they are (no linearisation). */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_image_grey(tsuya_image *out, const tsuya_image *in, tsuya_sample sample);
/* Area-averaging reduction or bilinear enlargement to the given size; pixel centres keep their place (x' + ½ = s (x + ½)). */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_image_resize(tsuya_image *out, const tsuya_image *in, int width_px, int height_px);
/* Bilinear at (x, y), edges clamped, in the image's own encoding; writes `channels` floats. */
TSUYA_API void tsuya_image_sample_bilinear(const tsuya_image *image, double x_px, double y_px, float *out);

TSUYA_API float tsuya_srgb_encode(float linear);  /* clamps to [0,1]; NaN gives 0 */
TSUYA_API float tsuya_srgb_decode(float encoded);

/* Reading.  The format is told by the content, not by the name.  JPEG, PNG (8/16), TIFF (8/16/float), BMP, WebP by OpenCV;
 * EXR by OpenEXR's C core; camera raw by LibRaw (linear 16-bit, camera white balance, no auto-brightness, sRGB primaries).
 * Pixels stay as they are stored: an EXIF orientation is never applied (see core/photo.h).
 * Fails, naming the file, on unreadable, truncated or oversized (> 65535 a side, > 400 Mpix) files. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_image_load(tsuya_image *image, const char *path);
/* Width and height without decoding where the format allows. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_image_probe(int *width_px, int *height_px, const char *path);

/* Writing, atomic (core/file.h).  By extension: .png (8/16), .jpg (8, quality 92), .tif (8/16/float), .exr (float samples
 * only: half or float, ZIP, channels R G B A or Y).  `exr_half` concerns .exr alone. */
typedef struct tsuya_image_save_options {
    int jpeg_quality; /* 1 … 100 */
    bool exr_half;
    int attribute_count; /* text attributes for EXR headers and PNG tEXt is not written */
    const char *const *attribute_name, *const *attribute_value;
} tsuya_image_save_options;
TSUYA_API tsuya_image_save_options tsuya_image_save_options_default(void);
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_image_save(const tsuya_image *image, const char *path,
                                                         const tsuya_image_save_options *options /* NULL: default */);

#endif
