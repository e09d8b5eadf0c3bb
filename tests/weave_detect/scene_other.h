/* Pictures that are no weave, or one that a patch cannot tell: what a detector of threads must not be sure about. */
#ifndef TSUYA_TESTS_WEAVE_DETECT_SCENE_OTHER_H
#define TSUYA_TESTS_WEAVE_DETECT_SCENE_OTHER_H

#include <stdint.h>

typedef enum other_kind {
    OTHER_NOISE,   /* white */
    OTHER_CLOUDS,  /* 1/f texture */
    OTHER_STRIPES, /* one grating, as a print or a corduroy */
    OTHER_EDGE,    /* a border between two greys */
    OTHER_KNIT,    /* rows of loops: v-shaped stitches */
    OTHER_DOTS,    /* discs on a hexagonal grid */
    OTHER_GREY,
    OTHER_KIND_COUNT
} other_kind;

const char *other_name(other_kind kind);
/* values: n × n; a function of (kind, seed, index). */
void other_draw(float *values, int n, other_kind kind, uint64_t seed, uint64_t index);

#endif
