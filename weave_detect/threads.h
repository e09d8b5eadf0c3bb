/* What one patch of cloth tells about its threads.
 *
 * Angles run along the threads, counter-clockwise from +x with y up, in [0, π). */
#ifndef TSUYA_WEAVE_DETECT_THREADS_H
#define TSUYA_WEAVE_DETECT_THREADS_H

#include "core/status.h"

#include <stdbool.h>

typedef enum tsuya_weave_kind {
    TSUYA_WEAVE_UNKNOWN,
    TSUYA_WEAVE_PLAIN,
    TSUYA_WEAVE_TWILL,
    TSUYA_WEAVE_SATIN,
} tsuya_weave_kind;

/* What said which family is the weft.  Of the threads alone only their counts do, for a warp is usually the denser. */
typedef enum tsuya_weft_told {
    TSUYA_WEFT_UNKNOWN, /* the family nearer to the horizontal, which is a name and no finding */
    TSUYA_WEFT_USER,
    TSUYA_WEFT_COUNT,
    TSUYA_WEFT_HEM, /* of a surface: its rims */
} tsuya_weft_told;

typedef struct tsuya_thread_family {
    bool seen;
    double angle_rad;
    double period_px; /* from one thread to the next, at right angles to them */
    double sigma_rad; /* standard deviation of the angle, given that these are the threads */
} tsuya_thread_family;

typedef struct tsuya_threads {
    tsuya_thread_family a, b; /* the two families, in no order until they are labelled: then a is the weft, b the warp */
    double confidence;        /* probability that both angles are within 2 degrees of the threads */
    tsuya_weave_kind kind;
    double diagonal_rad;      /* along the lines of a twill, where `kind` is one */
    double flow_rad;          /* along the texture (structure tensor), whatever makes it */
    double flow_coherence;    /* [0, 1]; 0: none, or no texture at all */
} tsuya_threads;

TSUYA_API const char *tsuya_weave_kind_name(tsuya_weave_kind kind); /* "unknown", "plain", "twill", "satin" */

TSUYA_API const char *tsuya_weft_told_name(tsuya_weft_told told); /* "unknown", "user", "thread count", "hem" */

/* 1 where the first period is larger by more than a tenth, −1 where the second is, else 0, also where one was not seen (0). */
TSUYA_API int tsuya_coarser_family(double period_a, double period_b);
/* Angle into [0, π). */
TSUYA_API double tsuya_line_wrap(double angle_rad);
/* Between two lines, in [0, π/2]. */
TSUYA_API double tsuya_line_difference(double a_rad, double b_rad);

#endif
