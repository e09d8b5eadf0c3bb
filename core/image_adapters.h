/* What image_io.c asks of the adapters: encoded bytes to pixels and back.  Pixel order R G B (A) on this side. */
#ifndef TSUYA_CORE_IMAGE_ADAPTERS_H
#define TSUYA_CORE_IMAGE_ADAPTERS_H

#include "core/image.h"

/* OpenCV: JPEG, PNG, TIFF, BMP, WebP from a file's bytes.  Orientation tags are passed over. */
TSUYA_INTERNAL TSUYA_MUST_CHECK tsuya_status tsuya_opencv_decode(tsuya_image *image, const char *bytes, size_t size, const char *path);
/* OpenCV writes `path` itself (a temporary name that ends in the format's extension). */
TSUYA_INTERNAL TSUYA_MUST_CHECK tsuya_status tsuya_opencv_encode(const tsuya_image *image, const char *path, int jpeg_quality);

TSUYA_MUST_CHECK tsuya_status tsuya_exr_load(tsuya_image *image, const char *path);
TSUYA_MUST_CHECK tsuya_status tsuya_exr_probe(int *width_px, int *height_px, const char *path);
TSUYA_MUST_CHECK tsuya_status tsuya_exr_save(const tsuya_image *image, const char *path, const tsuya_image_save_options *options);

/* Camera raw is told by its extension: inside it is mostly TIFF. */
bool tsuya_raw_extension(const char *path);
TSUYA_MUST_CHECK tsuya_status tsuya_raw_load(tsuya_image *image, const char *path);
TSUYA_MUST_CHECK tsuya_status tsuya_raw_probe(int *width_px, int *height_px, const char *path);

#endif
