/* Cloth as photographs show it at their worst, and pictures that only look like cloth, with what is true about their threads. */
#ifndef TSUYA_TESTS_WEAVE_DETECT_SCENE_HARD_H
#define TSUYA_TESTS_WEAVE_DETECT_SCENE_HARD_H

#include <stdbool.h>
#include <stdint.h>

typedef enum hard_kind {
    HARD_KNIT,        /* stitches: no warp and weft */
    HARD_PRINT,       /* woven cloth with stripes printed askew */
    HARD_MOIRE,       /* threads finer than two pixels, sampled sharply */
    HARD_FINE,        /* about one pixel a thread */
    HARD_BLOCKS,      /* a shaded wall, for a coarse JPEG file */
    HARD_BLOCKED,     /* cloth, for a coarse JPEG file */
    HARD_BAYER_WALL,  /* a coloured wall as the sensor has it: every other pixel red, green or blue */
    HARD_BAYER,       /* coloured cloth as the sensor has it */
    HARD_HIGHLIGHT,   /* cloth with a highlight that is clipped */
    HARD_SEAM,        /* two cuts of cloth, at different angles */
    HARD_BACKGROUND,  /* cloth in front of something soft */
    HARD_KIND_COUNT
} hard_kind;

const char *hard_name(hard_kind kind);

typedef struct hard_truth {
    int count;                  /* of crosses that some of the picture shows: 0, 1, 2 */
    double weft_deg[2], warp_deg[2];
    double weft_px[2], warp_px[2];
} hard_truth;

/* values: n × n; a function of (kind, seed, index). */
void hard_draw(float *values, int n, hard_truth *truth, hard_kind kind, uint64_t seed, uint64_t index);

/* Stripes (of one or several widths) dyed into a picture, at least 12 degrees off both families. */
void hard_print(float *values, int n, double weft_deg, double warp_deg, uint64_t seed, uint64_t index);
/* A colour filter array over one colour: RGGB. */
void hard_mosaic(float *values, int n, uint64_t seed, uint64_t index);
/* Takes `other` beyond a line near the middle, with a dark seam along it. */
void hard_join(float *values, const float *other, int n, uint64_t seed, uint64_t index);

#endif
