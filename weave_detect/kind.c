#include "weave_detect/kind.h"

#include <math.h>

static const double PLACE_BINS = 0.75;  /* from the point to its peak */
static const float OWN_LEAST = 2.55f;   /* ln(1 + power/noise) of a draft's own peaks, mean */
static const float NOISE_LEVEL = 2.0f;  /* what noise reaches: all of a draft's own peaks must be higher, or it is out of the question */
static const float CORNER_LEAST = 3.5f; /* of plain weave's, which have only the absence of others beside them */
static const float AHEAD = 1.0f;        /* of the next draft */

static inline double square(double x) { return x * x; }

static double centred(double x) { return x - floor(x + 0.4999); }

/* Of the peak at a1·f1 + a2·f2 (or at its mirror); 0 where there is none. */
static float peak_level(const tsuya_spectrum *s, const double f[2][2], double a1, double a2)
{
    double fx = a1 * f[0][0] + a2 * f[1][0], fy = a1 * f[0][1] + a2 * f[1][1], bound = square(PLACE_BINS / s->n);
    for (int i = 0; i < s->peak_count; i++) { /* the highest first */
        double px = (double)s->peak[i].fx, py = (double)s->peak[i].fy;
        if (fmin(square(px - fx) + square(py - fy), square(px + fx) + square(py + fy)) < bound) {
            return s->peak[i].level;
        }
    }
    return 0.0f;
}

/* The point of the step's fraction k that lies nearest to 0. */
static void set_point(double a[2], const tsuya_step *step, int k)
{
    a[1] = (double)k / step->repeat;
    a[0] = centred(-(double)step->step * a[1]);
}

/* The peaks that the draft alone has: fractions of its repeat that no shorter repeat has. */
typedef struct own_peaks {
    float mean, lowest, highest;
} own_peaks;

static own_peaks find_own(const tsuya_spectrum *s, const double f[2][2], const tsuya_step *step)
{
    own_peaks own = {.lowest = HUGE_VALF};
    int count = 0;
    for (int k = 1; 2 * k < step->repeat; k++) {
        double a[2];
        if (step->repeat % 2 == 0 && k % 2 == 0) {
            continue;
        }
        set_point(a, step, k);
        float level = peak_level(s, f, a[0], a[1]);
        own.mean += level;
        own.lowest = fminf(own.lowest, level);
        own.highest = fmaxf(own.highest, level);
        count++;
    }
    own.mean = own.lowest > NOISE_LEVEL ? own.mean / (float)count : 0.0f;
    return own;
}

static tsuya_kind twill(const double f[2][2], const tsuya_step *step)
{
    double a[2];
    set_point(a, step, 1);
    double fx = a[0] * f[0][0] + a[1] * f[1][0], fy = a[0] * f[0][1] + a[1] * f[1][1];
    return (tsuya_kind){TSUYA_WEAVE_TWILL, tsuya_line_wrap(atan2(fx, fy))};
}

tsuya_kind tsuya_kind_tell(const tsuya_spectrum *s, const double f[2][2])
{
    const tsuya_kind unknown = {TSUYA_WEAVE_UNKNOWN, NAN}, plain = {TSUYA_WEAVE_PLAIN, NAN}, satin = {TSUYA_WEAVE_SATIN, NAN};
    float best = 0.0f, second = 0.0f, highest = 0.0f, eighths = 0.0f;
    int step = 0;
    for (int k = 1; k < TSUYA_STEPS; k++) {
        own_peaks own = find_own(s, f, &tsuya_steps[k]);
        highest = fmaxf(highest, own.highest);
        if (tsuya_steps[k].repeat == 8) {
            eighths = fmaxf(eighths, own.highest);
            if (own.mean > OWN_LEAST) { /* its quarters are a twill's */
                return satin;
            }
        }
        second = own.mean > best ? best : fmaxf(second, own.mean);
        step = own.mean > best ? k : step;
        best = fmaxf(best, own.mean);
    }
    float corner = fmaxf(peak_level(s, f, 0.5, 0.5), peak_level(s, f, -0.5, 0.5));
    if (highest < NOISE_LEVEL && corner > CORNER_LEAST) {
        return plain;
    }
    if (best < OWN_LEAST || best < second + AHEAD || (tsuya_steps[step].repeat == 4 && eighths > NOISE_LEVEL)) {
        return unknown;
    }
    return tsuya_steps[step].kind == TSUYA_WEAVE_TWILL ? twill(f, &tsuya_steps[step]) : satin;
}
