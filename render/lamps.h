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
    int lamp[TSUYA_LANES]; /* −1: none can shine here */
    float probability[TSUYA_LANES], sum[TSUYA_LANES]; /* sum of all weights */
} tsuya_lamp_choice;
void tsuya_lamps_choose(const tsuya_lamps *lamps, int count, const tsuya_planes3 *p, const tsuya_planes3 *n, const float *u, tsuya_lamp_choice *choice);

/* Each lane's lamp as planes. */
typedef struct tsuya_picked_lamps { tsuya_planes3 position, direction, side, up; float area[TSUYA_LANES], round[TSUYA_LANES], placed[TSUYA_LANES]; } tsuya_picked_lamps;

/* Light that arrives from the lamps chosen. */
typedef struct tsuya_lamp_samples {
    tsuya_picked_lamps picked; /* room */
    tsuya_planes3 wi;          /* unit, to the lamp */
    float distance[TSUYA_LANES]; /* INFINITY for directional and environment */
    float rgb[3][TSUYA_LANES], pdf[TSUYA_LANES], delta[TSUYA_LANES]; /* as in tsuya_light_sample; pdf 0: nothing arrives */
} tsuya_lamp_samples;
void tsuya_lamps_sample(const tsuya_lamps *lamps, int count, const tsuya_planes3 *p, const tsuya_planes3 *n, const tsuya_lamp_choice *choice,
                        const float *const u[2], tsuya_lamp_samples *samples);

/* Rays that may run into a lamp on their way. */
typedef struct tsuya_lamp_rays {
    tsuya_planes3 from, n, direction; /* n: normal where they start (tsuya_light_hit) */
    float reach[TSUYA_LANES];          /* to what they met; INFINITY: nothing */
    bool first;                       /* from the camera; else, with `shared`, a lamp counts as it must beside its own samples: */
    bool shared;
    float pdf[TSUYA_LANES], weights[TSUYA_LANES]; /* of the direction; the sum of weights of all lamps where it started */
} tsuya_lamp_rays;
/* Share of the lamp's radiance that each ray brings, 0 where it misses the lamp; false: all do. */
bool tsuya_lamps_meet(const tsuya_lamps *lamps, int lamp, int count, const tsuya_lamp_rays *rays, float *share);

#endif
