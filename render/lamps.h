/* Lamps for a wave of paths: what render/light.h does for one point, in float. */
#ifndef TSUYA_RENDER_LAMPS_H
#define TSUYA_RENDER_LAMPS_H

#include "render/light.h"
#include "render/wave.h"

/* A lamp in numbers that a lane can pick up. */
typedef struct tsuya_lamp {
    float position[3], direction[3], side[3], up[3]; /* side, up: times the lamp's size */
    float rgb[3], area, reach, luminance;
    float round;  /* 1: disk */
    float placed; /* 0: light from afar */
} tsuya_lamp;

typedef struct tsuya_lamps {
    const tsuya_light_set *set;
    tsuya_lamp *lamp;
    bool in_the_way; /* some lamp has an extent, so that rays can run into it */
} tsuya_lamps;

/* Borrows the set. */
TSUYA_MUST_CHECK tsuya_status tsuya_lamps_create(tsuya_lamps *lamps, const tsuya_light_set *set);
void tsuya_lamps_free(tsuya_lamps *lamps);

/* One lamp for each lane, with a probability in proportion to its weight (tsuya_light_weight). */
typedef struct tsuya_lamp_choice {
    int lamp[TSUYA_WAVE]; /* −1: none can shine here */
    float probability[TSUYA_WAVE], sum[TSUYA_WAVE]; /* sum of all weights */
} tsuya_lamp_choice;
void tsuya_lamps_choose(const tsuya_lamps *lamps, int count, const tsuya_planes3 *p, const tsuya_planes3 *n, const float *u, tsuya_lamp_choice *choice);

/* Light that arrives from the lamps chosen. */
typedef struct tsuya_lamp_samples {
    tsuya_planes3 wi;          /* unit, to the lamp */
    float distance[TSUYA_WAVE]; /* INFINITY for directional and environment */
    float rgb[3][TSUYA_WAVE], pdf[TSUYA_WAVE], delta[TSUYA_WAVE]; /* as in tsuya_light_sample; pdf 0: nothing arrives */
} tsuya_lamp_samples;
void tsuya_lamps_sample(const tsuya_lamps *lamps, int count, const tsuya_planes3 *p, const tsuya_planes3 *n, const tsuya_lamp_choice *choice,
                        const float *const u[2], tsuya_lamp_samples *samples);

/* tsuya_light_hit of one lamp for rays from `origin`; pdf 0 where the ray misses it. */
typedef struct tsuya_lamp_hits { float distance[TSUYA_WAVE], pdf[TSUYA_WAVE]; } tsuya_lamp_hits;
void tsuya_lamps_hit(const tsuya_lamps *lamps, int lamp, int count, const tsuya_planes3 *origin, const tsuya_planes3 *n, const tsuya_planes3 *direction,
                     tsuya_lamp_hits *hits);

#endif
