#include "scene_other.h"

#include "core/context.h"

#include <math.h>

const char *other_name(other_kind kind)
{
    static const char *const name[] = {"noise", "clouds", "stripes", "edge", "knit", "dots", "grey"};
    return name[kind];
}

/* Value noise of a cell size. */
static double value_noise(double x, double y, double cell, uint64_t seed)
{
    double u = x / cell + 1000.0, v = y / cell + 1000.0, sum = 0.0;
    int i = (int)u, j = (int)v;
    double a = u - i, b = v - j;
    a = a * a * (3.0 - 2.0 * a);
    b = b * b * (3.0 - 2.0 * b);
    for (int k = 0; k < 4; k++) {
        int di = k & 1, dj = k >> 1;
        double w = (di ? a : 1.0 - a) * (dj ? b : 1.0 - b);
        sum += w * tsuya_random_uniform(seed, (uint64_t)(i + di), (uint64_t)(j + dj));
    }
    return sum - 0.5;
}

static double stitch(double u, double v)
{
    double course = floor(v), t = v - course, wale = u - floor(u) - 0.5;
    double leg = fabs(wale) - 0.18 - 0.16 * t; /* two legs that spread upwards */
    return exp(-40.0 * leg * leg) * (0.6 + 0.4 * sin(M_PI * t));
}

static double dot(double u, double v)
{
    double best = 9.0;
    for (int j = -1; j <= 1; j++) {
        double row = round(v / 0.866) + j, shift = fmod(fabs(row), 2.0) * 0.5, column = round(u - shift) + shift;
        best = fmin(best, hypot(u - column, v - 0.866 * row));
    }
    return best < 0.32;
}

void other_draw(float *values, int n, other_kind kind, uint64_t seed, uint64_t index)
{
    double r[8];
    uint64_t own = seed * 7919u + index;
    for (int k = 0; k < 8; k++) {
        r[k] = tsuya_random_uniform(own, 3, (uint64_t)k);
    }
    double a = 2.0 * M_PI * r[0], period = 4.0 * pow(4.0, r[1]), noise = 0.02 * pow(8.0, r[2]);
    for (int i = 0; i < n * n; i++) {
        double x = i % n, y = (int)(i / n), u = (cos(a) * x + sin(a) * y) / period + r[3], v = (cos(a) * y - sin(a) * x) / period + r[4];
        double value = 0.5;
        switch (kind) {
        case OTHER_CLOUDS:
            for (int octave = 0; octave < 5; octave++) {
                value += 0.3 * pow(0.6, octave) * value_noise(x, y, 24.0 / (1 << octave), own + (uint64_t)octave);
            }
            break;
        case OTHER_STRIPES: value += 0.1 * sin(2.0 * M_PI * u) + (r[5] < 0.5 ? 0.07 * sin(4.0 * M_PI * u) : 0.0); break;
        case OTHER_EDGE: value += 0.2 * tanh(3.0 * (u - n / (2.0 * period) * (cos(a) + sin(a)) - r[3] + r[5] - 0.5)); break;
        case OTHER_KNIT: value += 0.2 * stitch(u, 1.3 * v); break;
        case OTHER_DOTS: value += 0.15 * dot(u, v); break;
        case OTHER_NOISE:
        case OTHER_GREY:
        case OTHER_KIND_COUNT: break;
        }
        values[i] = (float)(value + (kind == OTHER_GREY ? 0.0 : noise * tsuya_random_normal(own, 9, (uint64_t)i)));
    }
}
