/* What every bench prints beside its own tables: points of error against cost, which `tsuya bench` gathers and draws. */
#ifndef TSUYA_TESTS_BENCH_H
#define TSUYA_TESTS_BENCH_H

#include <stdio.h>

/* part: what is measured, one panel of the picture; method: ours, one of its parts switched off, a peer.  Names without commas. */
static inline void bench_point(const char *part, const char *method, double error, const char *error_unit, double cost, const char *cost_unit)
{
    printf("point,%s,%s,%.6g,%s,%.6g,%s\n", part, method, error, error_unit, cost, cost_unit);
    fflush(stdout);
}

#endif
