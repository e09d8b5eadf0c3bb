#include "weave_detect/threads.h"

#include <math.h>

#ifndef M_PI
#define M_PI 3.14159265358979323846
#endif

const char *tsuya_weave_kind_name(tsuya_weave_kind kind)
{
    static const char *const names[] = {"unknown", "plain", "twill", "satin"};
    return names[kind];
}

const char *tsuya_weft_told_name(tsuya_weft_told told)
{
    static const char *const names[] = {"unknown", "user", "thread count", "hem"};
    return names[told];
}

int tsuya_coarser_family(double period_a, double period_b)
{
    const double differ = 1.1;
    if (!(period_a > 0.0 && period_b > 0.0)) {
        return 0;
    }
    return (period_a > differ * period_b) - (period_b > differ * period_a);
}

double tsuya_line_wrap(double angle_rad)
{
    double a = fmod(angle_rad, M_PI);
    a = a < 0.0 ? a + M_PI : a;
    return a >= M_PI ? 0.0 : a;
}

double tsuya_line_difference(double a_rad, double b_rad)
{
    double d = tsuya_line_wrap(a_rad - b_rad);
    return fmin(d, M_PI - d);
}
