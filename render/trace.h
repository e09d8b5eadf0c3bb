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

/* A path on its way. */
typedef struct tsuya_walker {
    /* By the caller: */
    tsuya_ray ray;         /* from the camera */
    uint32_t key, sample;  /* tsuya_sampler */
    uint8_t bundle;        /* number of its bundle (modulo 256); those of one follow each other, at most TSUYA_RAY_PACKET */
    bool blank;            /* no ray */
    /* By tsuya_trace: */
    bool met;              /* the first ray met the cloth */
    float rgb[3];          /* radiance along it */
    /* For tsuya_trace alone: */
    bool struck, lit, goes_on; /* its ray met the cloth; a shadow ray decides about `lamp`; it has a next ray */
    tsuya_ray_hit hit;
    tsuya_vec3f last_p, last_n; /* the last point, as the next hit of a lamp needs it: */
    float last_pdf;             /* density of the direction that left it */
    float lamp_weights;         /* sum of tsuya_light_weight there */
    tsuya_ray shadow;
    float lamp[3];
} tsuya_walker;

typedef struct tsuya_wave {
    int count;
    tsuya_walker walker[TSUYA_WAVE];
    /* For tsuya_trace alone: */
    float *throughput;  /* of each channel: [walker * channels + c] */
    int alive[TSUYA_WAVE], alive_count; /* walkers with a ray */
    struct tsuya_wave_group *group;
    void *block; /* where this lies */
} tsuya_wave;

/* Some 100 kB; 2 kB a wavelength more. */
TSUYA_MUST_CHECK tsuya_status tsuya_wave_create(tsuya_wave **wave, const tsuya_tracer *tracer);
void tsuya_wave_free(tsuya_wave *wave);
/* Returns the number of rays. */
uint64_t tsuya_trace(const tsuya_tracer *tracer, tsuya_wave *wave);

/* Dimension pairs of a sample that lie before those of the bounces. */
enum { TSUYA_PAIR_PIXEL, TSUYA_PAIR_FIRST };

#endif
