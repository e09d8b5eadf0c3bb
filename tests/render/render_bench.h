/* What the benches of render share. */
#ifndef TSUYA_TESTS_RENDER_BENCH_H
#define TSUYA_TESTS_RENDER_BENCH_H

#include "render_scenes.h"

/* Processor time: other work on the machine does not count. */
double bench_cpu_s(void);
/* Orders the values. */
double bench_median(double *value, int count);
/* Mean over pixels and channels. */
double film_squared_error(const tsuya_film *film, const tsuya_film *reference);

#endif
