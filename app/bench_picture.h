/* Points of error against cost that benches print: kept, saved as a table, drawn by gnuplot. */
#ifndef TSUYA_APP_BENCH_PICTURE_H
#define TSUYA_APP_BENCH_PICTURE_H

#include "core/status.h"

#include <stddef.h>

typedef struct tsuya_bench_point {
    const char *stage; /* borrowed */
    char part[64], method[64], error_unit[32], cost_unit[32];
    double error, cost;
} tsuya_bench_point;

typedef struct tsuya_bench_points {
    tsuya_bench_point *point;
    size_t count, room;
} tsuya_bench_points;

/* line: "part,method,error,error_unit,cost,cost_unit"; fails on any other. */
TSUYA_MUST_CHECK tsuya_status tsuya_bench_points_add(tsuya_bench_points *points, const char *stage, const char *line);
void tsuya_bench_points_free(tsuya_bench_points *points);

/* FOLDER/bench.csv */
TSUYA_MUST_CHECK tsuya_status tsuya_bench_points_save(const tsuya_bench_points *points, const char *folder);
/* FOLDER/STAGE.svg: a panel a part, both axes logarithmic where every value is positive. */
TSUYA_MUST_CHECK tsuya_status tsuya_bench_picture(const tsuya_bench_points *points, const char *stage, const char *folder);

#endif
