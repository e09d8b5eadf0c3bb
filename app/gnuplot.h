/* Pictures drawn by gnuplot: a script is written beside the picture, run, and taken away again. */
#ifndef TSUYA_APP_GNUPLOT_H
#define TSUYA_APP_GNUPLOT_H

#include "core/status.h"

#include <stdio.h>

typedef struct tsuya_gnuplot {
    FILE *script; /* write commands and data here; terminal and output are set */
    char *path, *temporary, *script_path;
} tsuya_gnuplot;

/* A PNG of that size. */
TSUYA_MUST_CHECK tsuya_status tsuya_gnuplot_begin(tsuya_gnuplot *plot, const char *path, int width_px, int height_px);
/* Runs the script; the picture is there as a whole or not at all.  Fails with gnuplot's own last line. */
TSUYA_MUST_CHECK tsuya_status tsuya_gnuplot_end(tsuya_gnuplot *plot);
/* 'text' as gnuplot takes it, without anything that it would run or interpret. */
void tsuya_gnuplot_text(const tsuya_gnuplot *plot, const char *text);

#endif
