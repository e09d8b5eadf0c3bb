/* Light transport along a handful of camera paths at once: next-event estimation and BSDF sampling joined by multiple
 * importance sampling (power heuristic; Veach 1997), Russian roulette.
 *
 * The paths of a packet start as one bundle: their first rays and first shadow rays lie close together and are traced eight
 * at a time; later ones scatter and are traced one by one.
 *
 * With bands (render/bands.h) a path carries all of them; directions, lamps and ends of paths are chosen for all in common. */
#ifndef TSUYA_RENDER_TRACE_H
#define TSUYA_RENDER_TRACE_H

#include "render/path.h"
#include "render/sampler.h"

typedef struct tsuya_tracer {
    const tsuya_scene *scene;
    const tsuya_light_set *lights;
    const tsuya_path_options *options;
    bool lamps_in_the_way; /* some lamp has an extent, so that rays can run into it */
    const tsuya_bands *bands; /* NULL: r, g, b */
    double **response;     /* with bands: of each lamp with a spectrum, tsuya_bands_respond; else NULL */
} tsuya_tracer;

typedef struct tsuya_camera_path {
    tsuya_vec3 origin, direction; /* unit */
    tsuya_sampler sampler;
    double rgb[3]; /* radiance along it, set by tsuya_trace */
    bool met;      /* the first ray met the cloth */
} tsuya_camera_path;

TSUYA_MUST_CHECK tsuya_status tsuya_tracer_create(tsuya_tracer *tracer, const tsuya_scene *scene, const tsuya_light_set *lights,
                                                  const tsuya_path_options *options);
void tsuya_tracer_free(tsuya_tracer *tracer);
/* count ≤ TSUYA_RAY_PACKET. Returns the number of rays. */
uint64_t tsuya_trace(const tsuya_tracer *tracer, tsuya_camera_path *path, int count);

/* Dimension pairs of a sample that lie before those of the bounces. */
enum { TSUYA_PAIR_PIXEL, TSUYA_PAIR_FIRST };

#endif
