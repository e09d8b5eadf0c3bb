/* Light transport along a wave of camera paths at once: next-event estimation and BSDF sampling joined by multiple
 * importance sampling (power heuristic; Veach 1997), Russian roulette.
 *
 * The paths of a bundle start together: their first rays and first shadow rays lie close together and are traced eight
 * at a time; later ones scatter and are traced one by one.  Between the rays, what the paths need is worked out for the whole wave in
 * loops over planes (render/wave.h); a path's result depends on its own numbers and on its bundle alone.
 *
 * With bands (render/bands.h) a path carries all of them; directions, lamps and ends of paths are chosen for all in common. */
#ifndef TSUYA_RENDER_TRACE_H
#define TSUYA_RENDER_TRACE_H

#include "render/lamps.h"
#include "render/path.h"
#include "render/sampler.h"
#include "render/surface.h"

typedef struct tsuya_tracer {
    const tsuya_scene *scene;
    const tsuya_light_set *lights;
    const tsuya_path_options *options;
    tsuya_lamps lamps;
    const tsuya_bands *bands; /* NULL: r, g, b */
    double **response;     /* with bands: of each lamp with a spectrum, tsuya_bands_respond; else NULL */
} tsuya_tracer;

TSUYA_MUST_CHECK tsuya_status tsuya_tracer_create(tsuya_tracer *tracer, const tsuya_scene *scene, const tsuya_light_set *lights,
                                                  const tsuya_path_options *options);
void tsuya_tracer_free(tsuya_tracer *tracer);

typedef struct tsuya_wave {
    /* By the caller, a lane a path: */
    int count;
    tsuya_planes3 origin, direction; /* direction unit */
    uint32_t key[TSUYA_WAVE], sample[TSUYA_WAVE]; /* tsuya_sampler */
    uint8_t bundle[TSUYA_WAVE]; /* number of the lane's bundle; those of one follow each other, at most TSUYA_RAY_PACKET */
    /* By tsuya_trace: */
    float rgb[3][TSUYA_WAVE];   /* radiance along it */
    bool met[TSUYA_WAVE];       /* the first ray met the cloth */
    /* For tsuya_trace alone: of each lane, its ray's hit, ... */
    tsuya_ray_hit hit[TSUYA_WAVE];
    bool struck[TSUYA_WAVE];
    /* ... the last point of the path, as the next hit of a lamp needs it: density of the direction that left it, sum of tsuya_light_weight, ... */
    tsuya_planes3 last_p, last_n;
    float last_pdf[TSUYA_WAVE], lamp_weights[TSUYA_WAVE];
    float *throughput; /* of each channel: [c * TSUYA_WAVE + lane] */
    /* ... and what its shadow ray decides about. */
    tsuya_ray shadow[TSUYA_WAVE];
    float lamp[3][TSUYA_WAVE];
    bool lit[TSUYA_WAVE], goes_on[TSUYA_WAVE];
    int alive[TSUYA_WAVE], alive_count; /* lanes with a ray */
    struct tsuya_wave_group *group;
    void *block; /* where this lies */
} tsuya_wave;

/* Some 100 kB; with wavelengths 1 kB each more. */
TSUYA_MUST_CHECK tsuya_status tsuya_wave_create(tsuya_wave **wave, const tsuya_tracer *tracer);
void tsuya_wave_free(tsuya_wave *wave);
/* Returns the number of rays. */
uint64_t tsuya_trace(const tsuya_tracer *tracer, tsuya_wave *wave);

/* Dimension pairs of a sample that lie before those of the bounces. */
enum { TSUYA_PAIR_PIXEL, TSUYA_PAIR_FIRST };

#endif
