/* Path tracing of one picture (light transport: render/trace.h): samples by pixel and dimension alone, so that the bytes of a
 * picture do not depend on the number of threads. */
#ifndef TSUYA_RENDER_PATH_H
#define TSUYA_RENDER_PATH_H

#include "core/camera.h"
#include "core/context.h"

#include "render/light.h"
#include "render/scene.h"

typedef enum tsuya_strategy { TSUYA_STRATEGY_MIS, TSUYA_STRATEGY_LAMPS, TSUYA_STRATEGY_BSDF } tsuya_strategy;

typedef struct tsuya_path_options {
    int spp;              /* samples per pixel; with `noise` the most that a pixel gets */
    double noise;         /* > 0: aimed standard error relative to the luminance, median over the cloth, see below; 0: fixed spp */
    int bounces;          /* reflections along a path; 1: lamps only */
    bool lamps_visible;   /* disks and rectangles in front of the camera */
    const tsuya_shader *card; /* stands in for every material, without dye; NULL: the scene's own */
    tsuya_strategy strategy; /* for tests; point, spot and directional lamps need MIS or LAMPS */
    bool single_rays;     /* for benches: no eight at a time */
    /* For benches: told every ray (single thread), those of a packet together. NULL: nobody. */
    void (*ray_sink)(void *user, const tsuya_ray *ray, int count, bool shadow);
    void *ray_user;
} tsuya_path_options;
TSUYA_API tsuya_path_options tsuya_path_options_default(void); /* 64 spp, noise 0, 4 bounces, lamps visible, MIS */

/* Samples of a pixel before anything is known of it. */
enum { TSUYA_PATH_PILOT_SPP = 8 };

/* With `noise` E, every pixel at or near the cloth first gets a pilot of 8 samples, the others 4; then as many as the
 * variance that the pilots saw in the 48 pixels around it asks for.  What is at the cloth is told by rays of their own that count
 * for nothing else.  A pixel's number of samples therefore never depends on its own values, and its mean stays unbiased.
 * Aimed error: E times the luminance L around the pixel; where L is below the cloth's mean M, E sqrt(L M), which is how photon noise
 * falls, or a tenth of E M where that is more.  E is asked of the median over the cloth: as long as half of it is within E, pixels
 * may err up to three times as much as that, all by the same factor.  The factor of every second pixel is found on the
 * others.  The standard errors count chance as a/n and edges (outlines, shadows), which the
 * samples of a pixel stratify, as b/n^1.5; a and b come from the variances of samples and of means of four. */
typedef struct tsuya_film {
    int width_px, height_px;
    float *rgb;          /* mean radiance, linear Rec.709, 3 per pixel */
    float *alpha;        /* share of samples that met the cloth */
    float *error;        /* standard error of the mean's luminance, from the samples' spread */
    uint32_t *samples;   /* per pixel */
} tsuya_film;

typedef struct tsuya_path_info {
    double seconds, spp_mean;
    uint64_t rays;
    double noise_median; /* error over luminance, median over pixels that the cloth covers */
} tsuya_path_info;

/* Pixel (x, y) integrates the square of side 1 around its centre.  Samples that the lens cannot invert are black. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_path_render(tsuya_film *film, tsuya_path_info *info, const tsuya_scene *scene,
                                                          const tsuya_light_set *lights, const tsuya_camera *camera,
                                                          tsuya_pose camera_from_world, const tsuya_path_options *options,
                                                          const tsuya_context *context);
TSUYA_API void tsuya_film_free(tsuya_film *film);

#endif
