/* Debian's AprilTag library behind plain structs.
 *
 * The library puts the first pixel's centre at (0.5, 0.5); every coordinate that leaves here has it at (0, 0).  That shift is
 * made in one place (tsuya_tag_pixel) and held by tests/calib/test_refine.c.  Corner 0 is the tag's lower left, then
 * counter-clockwise, as the library orders them. */
#ifndef TSUYA_CALIB_APRILTAG_ADAPTER_H
#define TSUYA_CALIB_APRILTAG_ADAPTER_H

#include "core/geometry.h"
#include "core/image.h"

typedef struct tsuya_tag_detector tsuya_tag_detector;

typedef struct tsuya_tag_sighting {
    int id, hamming;     /* code bits that were corrected */
    double margin;       /* of the code's bits, grey levels */
    tsuya_vec2 corner_px[4];
} tsuya_tag_sighting;

typedef struct tsuya_tag_detector_options {
    const char *family;
    int border_bits; /* 1, or 2 for Kalibr's grids */
    double decimate; /* 1: quads are looked for at full resolution */
} tsuya_tag_detector_options;

/* One detector serves one thread, and many images: making one takes as long as looking through a megapixel.  Fails on unknown families. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_tag_detector_create(tsuya_tag_detector **detector,
                                                                  const tsuya_tag_detector_options *options);
TSUYA_API void tsuya_tag_detector_free(tsuya_tag_detector *detector);
/* From the next image on. */
TSUYA_API void tsuya_tag_detector_decimate(tsuya_tag_detector *detector, double decimate);
/* Codes of the family. */
TSUYA_API int tsuya_tag_detector_codes(const tsuya_tag_detector *detector);
/* Edge of the tag in code cells (the black square's). */
TSUYA_API int tsuya_tag_detector_cells(const tsuya_tag_detector *detector);

/* Tags of a grey 8-bit image, by id and then from top to bottom; tsuya_free. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_tag_detect(tsuya_tag_sighting **sighting, int *count, tsuya_tag_detector *detector,
                                                         const tsuya_image *grey);
/* A library's image coordinate in our convention. */
TSUYA_API double tsuya_tag_pixel(double library_px);

/* The code as cells, row by row from the top, 1 white: `width` × `width` cells of which the tag's edge spans the middle
 * `border_width`; the rest is quiet zone.  tsuya_free. */
typedef struct tsuya_tag_pattern {
    uint8_t *white;
    int width, border_width;
} tsuya_tag_pattern;
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_tag_pattern_create(tsuya_tag_pattern *pattern, const char *family, int border_bits, int id);
TSUYA_API void tsuya_tag_pattern_free(tsuya_tag_pattern *pattern);

#endif
