#include "render_bench.h"

#include <time.h>

#include "core/order.h"

double bench_cpu_s(void)
{
    struct timespec t;
    clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

double bench_median(double *value, int count)
{
    tsuya_sort_doubles(value, (size_t)count);
    return value[count / 2];
}

double film_squared_error(const tsuya_film *film, const tsuya_film *reference)
{
    size_t values = 3 * (size_t)film->width_px * (size_t)film->height_px;
    double sum = 0.0;
    for (size_t k = 0; k < values; ++k) {
        double d = (double)film->rgb[k] - (double)reference->rgb[k];
        sum += d * d;
    }
    return sum / (double)values;
}
