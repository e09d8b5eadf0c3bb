/* Cloth drawn from its yarns, for the tests and benches of the weave detector.
 *
 * Two sets of threads cross as a draft says.  A thread is a rounded ridge whose centre line rises over and dips under the
 * threads that it crosses; at each point the higher one is seen, lit by one lamp, with fibres that run along the thread; between
 * open threads the dark ground is seen.  Nothing here knows of spectra, lattices or any part of the detector. */
#ifndef TSUYA_TESTS_WEAVE_DETECT_SCENE_WEAVE_H
#define TSUYA_TESTS_WEAVE_DETECT_SCENE_WEAVE_H

#include <stdbool.h>
#include <stdint.h>

typedef enum weave_draft {
    WEAVE_PLAIN,
    WEAVE_TWILL_21,
    WEAVE_TWILL_22,
    WEAVE_TWILL_31,
    WEAVE_SATIN_5,
    WEAVE_SATIN_8,
    WEAVE_DRAFT_COUNT
} weave_draft;

const char *weave_draft_name(weave_draft draft);
int weave_draft_repeat(weave_draft draft); /* threads of either family until the draft repeats */
bool weave_warp_over(weave_draft draft, int pick, int end);

typedef struct weave_cloth {
    weave_draft draft;
    double weft_deg, warp_deg;  /* along the threads, counter-clockwise with y up */
    double weft_px, warp_px;    /* from thread to thread, at right angles to them */
    double weft_phase, warp_phase;
    double fill;                /* width of a thread over its period: 1 closed, 0.6 open */
    double crimp;               /* height of the wave of a thread's centre line over its radius, mean of the families */
    double balance;             /* −1 … 1: the warp's crimp is (1 + balance) times that, the weft's (1 − balance): ribs */
    double uneven;              /* standard deviation of thread positions and widths, of a period */
    double fibre;               /* contrast of the fibres */
    double rough;               /* 0: machine-made; 1: as hand-spun linen: slubs, threads that wander and differ in brightness */
    double hair;                /* contrast of loose fibre ends that lie across the threads */
    double lamp_azimuth_deg, lamp_height_deg;
    double weft_albedo, warp_albedo, ground;
    uint64_t seed;              /* of threads and fibres */
} weave_cloth;

weave_cloth weave_cloth_default(void); /* plain, period 6, at right angles, regular */

typedef struct weave_camera {
    double blur_px;        /* standard deviation of a Gaussian, on top of the pixel's own square */
    double contrast;       /* standard deviation of the clean pattern over that of the noise; 0: no noise */
    double gradient;       /* of the lamp over the patch: ±gradient at its edges */
    double gradient_deg;
    double level, spread;  /* mean of the picture and standard deviation of the clean pattern */
    uint64_t seed;         /* of the noise */
} weave_camera;

weave_camera weave_camera_default(void);

enum { WEAVE_THREADS = 256 }; /* thread numbers repeat modulo this */

/* A cloth with everything about it that is drawn by lot. */
typedef struct weave_loom {
    weave_cloth cloth;
    double lamp[2][3]; /* along, across, up of each family */
    double offset[2][WEAVE_THREADS], width[2][WEAVE_THREADS], fibre_phase[2][WEAVE_THREADS], shade[2][WEAVE_THREADS];
    double wave[2][2][4]; /* [family][mode]: amplitude (threads), per thread across, per thread along, phase */
} weave_loom;

void weave_loom_set(weave_loom *loom, const weave_cloth *cloth);
/* Brightness at thread coordinates: pick and end numbers, whole at the threads' centres. */
double weave_brightness(const weave_loom *loom, double pick, double end);

/* values: n × n, rows top to bottom. */
void weave_draw(float *values, int n, const weave_cloth *cloth, const weave_camera *camera);
/* The same without noise. */
void weave_draw_clean(float *values, int n, const weave_cloth *cloth, const weave_camera *camera);

/* Cramér–Rao bound (one standard deviation, radians) of the weft's and the warp's angle, given the true pattern and white noise of
 * standard deviation `sigma`; periods and phases are unknown too. */
void weave_bound(double *weft_rad, double *warp_rad, int n, const weave_cloth *cloth, const weave_camera *camera, double sigma);

/* A cloth and camera at random: draft `index` mod 6, period 3 to 12 px, uneven or open in half of the cases, contrast 0.25 to 4, shear
 * to 15 degrees, blur, lamp gradient.  A function of (seed, index). */
void weave_random(weave_cloth *cloth, weave_camera *camera, uint64_t seed, uint64_t index);
/* The same with rough yarns. */
void weave_random_rough(weave_cloth *cloth, weave_camera *camera, uint64_t seed, uint64_t index);
/* Spun yarns as of cotton: hairy, of two thicknesses, one family nearly straight and hidden; softly focused. */
void weave_random_spun(weave_cloth *cloth, weave_camera *camera, uint64_t seed, uint64_t index);

#endif
