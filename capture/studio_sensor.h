/* From radiance to a photograph on disk: exposure, photon and read noise, quantisation, JPEG with EXIF. */
#ifndef TSUYA_CAPTURE_STUDIO_SENSOR_H
#define TSUYA_CAPTURE_STUDIO_SENSOR_H

#include "core/context.h"
#include "core/image.h"

typedef struct tsuya_studio_sensor {
    double full_radiance;  /* that fills a pixel's well, per channel */
    double full_well_e;    /* electrons of a full well; 0: no photon noise */
    double read_noise_e;   /* standard deviation, electrons */
    bool bayer;            /* one colour a pixel (RGGB), the others interpolated */
    bool deep;             /* 16 bits instead of 8 */
} tsuya_studio_sensor;
TSUYA_API tsuya_studio_sensor tsuya_studio_sensor_default(void); /* 1, 20000 e⁻, 4 e⁻ */

/* sRGB of 8 or 16 bits.  Photon noise is drawn as the normal distribution of the same variance (over 50 electrons indistinguishable). */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_studio_develop(tsuya_image *photograph, const tsuya_image *radiance,
                                                             const tsuya_studio_sensor *sensor, uint64_t stream,
                                                             const tsuya_context *context);

/* Channel that a mosaic's pixel sees, and the three colours there (mosaic: width × height). */
TSUYA_API int tsuya_studio_bayer_channel(int x, int y);
TSUYA_API void tsuya_studio_demosaic(float rgb[3], const float *mosaic, int width, int height, int x, int y);

/* What a camera writes beside the picture. */
typedef struct tsuya_studio_exif {
    const char *make, *model, *taken; /* "2026:01:31 10:00:00" */
    double focal_mm, exposure_s, f_number;
    int focal_35mm, iso;
} tsuya_studio_exif;

/* JPEG with an EXIF segment (Exif 2.3: TIFF header, IFD 0, Exif IFD). Atomic. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_studio_save_jpeg(const tsuya_image *photograph, const char *path, int quality,
                                                               const tsuya_studio_exif *exif);

#endif
