/* Is a photograph as bright and as coloured as the others that show the same surface?
 *
 * Two photographs share patches of surface, of a like size in both.  The median over them of log2 of one's light over the other's is what the pair says, the
 * median deviation from it (shine that moves with the camera, mostly) is how sure it is: a difference within its own spread counts as none.
 * A photograph stands out by what its neighbours agree on: the middle one of what they say, and nothing where the two middle ones
 * disagree in sign, so that one spoilt photograph does not spoil its neighbours' names.  Cameras that measure light themselves write down what
 * they did: who stands out must do so with and without the differences of exposure that EXIF tells (a camera that opens up where it is
 * darker takes pictures that are alike), and exposures that EXIF tells and the pixels confirm are judged on their own.
 *
 * The limit is the option's, or 3.5 robust standard deviations of the session where it wanders more by itself (B. Iglewicz,
 * D. Hoaglin, "How to Detect and Handle Outliers", 1993).  Beside this, one gain a photograph explains all pairs best (least squares,
 * the session's median as zero): that is what the table shows, and its spread is the drift of the whole session. */
#include "capture/check_photo.h"

#include "core/memory.h"

#include <math.h>

enum { SWEEPS = 500, FEWEST_PATCHES = 10, FEWEST_NEIGHBOURS = 2 };
static const double SAME_SCALE = 2.0; /* beyond it a pattern's colours run into each other in one photograph and not in the other */
static const double SHINE = 0.5;     /* of a colour that shine takes from one photograph to another */
static const double NORMAL = 1.4826; /* standard deviation over median absolute deviation */

static bool usable(const float *color)
{
    return fminf(color[0], fminf(color[1], color[2])) > 0.004f && fmaxf(color[0], fmaxf(color[1], color[2])) < 0.95f;
}

/* Green, red against green, blue against green. */
static double light_of(const float *color, int which)
{
    return which == 1 ? log2((double)color[1]) : log2((double)(color[which] / color[1]));
}

/* What one patch says: the two photographs' difference, and how coloured it is in both. */
typedef struct patch { double off, chroma; } patch;

static double spread_about(const patch *p, int n, double middle, double slope, double *list)
{
    for (int k = 0; k < n; k++) {
        list[k] = fabs(p[k].off - slope * p[k].chroma - middle);
    }
    return NORMAL * tsuya_check_median(list, n);
}

static double middle_of(const patch *p, int n, double slope, double *list)
{
    for (int k = 0; k < n; k++) {
        list[k] = p[k].off - slope * p[k].chroma;
    }
    return tsuya_check_median(list, n);
}

/* Shine has the lamp's colour and takes from a patch's own: it moves log ratios of channels in proportion to themselves, white balance moves
 * all of them alike.  The slope is a Bayesian's (SHINE before anything is seen): patches of one colour cannot tell it, and leave the gain as
 * uncertain as their colour is strong. */
static void tell_gain(double *gain, double *spread, const patch *p, int n, double *list)
{
    double middle = middle_of(p, n, 0.0, list), own = spread_about(p, n, middle, 0.0, list), sum[5] = {0};
    for (int k = 0; k < n; k++) {
        if (fabs(p[k].off - middle) <= TSUYA_CHECK_OUTLIER * own) {
            const double term[5] = {1.0, p[k].chroma, p[k].off, p[k].chroma * p[k].chroma, p[k].chroma * p[k].off};
            for (int i = 0; i < 5; i++) {
                sum[i] += term[i];
            }
        }
    }
    double mean = sum[1] / sum[0], xx = sum[3] - sum[1] * mean, xy = sum[4] - sum[2] * mean, noise = fmax(own * own, 1e-6);
    double slope = xy / (xx + noise / (SHINE * SHINE)), doubt = 1.0 / (xx / noise + 1.0 / (SHINE * SHINE));
    *gain = middle_of(p, n, slope, list);
    *spread = hypot(spread_about(p, n, *gain, slope, list), mean * sqrt(doubt));
}

/* How much larger a shows than b what both show: by the distances between features.  1 where there are none. */
static double magnification(const tsuya_check_sight *a, const tsuya_check_sight *b, const tsuya_feature_pair *pair, int count, double *list)
{
    int n = 0;
    for (int k = 0; k + 1 < count; k++) {
        double x[4], y[4];
        for (int i = 0; i < 2; i++) {
            tsuya_features_place(a->features, pair[k + i].a, &x[i], &y[i]);
            tsuya_features_place(b->features, pair[k + i].b, &x[2 + i], &y[2 + i]);
        }
        double one = hypot(x[1] - x[0], y[1] - y[0]) / a->work_scale, other = hypot(x[3] - x[2], y[3] - y[2]) / b->work_scale;
        if (one > 0.0 && other > 0.0) {
            list[n++] = one / other;
        }
    }
    return n > 0 ? tsuya_check_median(list, n) : 1.0;
}

void tsuya_check_compare_light(tsuya_check_relation *r, const tsuya_check_sight *a, const tsuya_check_sight *b, const tsuya_feature_pair *pair,
                               double *list)
{
    patch *p = (patch *)list; /* two numbers each; what follows is room to sort */
    double larger = magnification(a, b, pair, r->shared, list);
    bool comparable = larger < SAME_SCALE && larger > 1.0 / SAME_SCALE;
    for (int c = 0; c < 3; c++) {
        int n = 0;
        for (int k = 0; k < r->shared; k++) {
            const float *from = a->color + 3 * pair[k].a, *to = b->color + 3 * pair[k].b;
            if (usable(from) && usable(to)) {
                double one = light_of(from, c), other = light_of(to, c);
                p[n++] = (patch){one - other, c == 1 ? 0.0 : 0.5 * (one + other)};
            }
        }
        r->ratio[c] = r->spread[c] = NAN;
        if (comparable && n >= FEWEST_PATCHES) {
            tell_gain(&r->ratio[c], &r->spread[c], p, n, list + 2 * (ptrdiff_t)n);
        }
    }
}

static bool speaks(const tsuya_check_relation *r, int which, int fewest)
{
    return r->used && r->shared >= fewest && isfinite(r->ratio[which]);
}

/* Gauss–Seidel on the normal equations of Σ w (x_i − x_j − d_ij)². */
static void solve_gains(double *gain, const tsuya_check_relation *relations, int count, int which, int fewest)
{
    for (int i = 0; i < count; i++) {
        gain[i] = 0.0;
    }
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        for (int i = 0; i < count; i++) {
            double sum = 0.0, weight = 0.0;
            for (int j = 0; j < count; j++) {
                const tsuya_check_relation *r = &relations[i * count + j];
                if (j != i && speaks(r, which, fewest)) {
                    sum += r->shared * (gain[j] + r->ratio[which]);
                    weight += r->shared;
                }
            }
            gain[i] = weight > 0.0 ? sum / weight : 0.0;
        }
    }
}

/* Zero at the session's median; NaN for whoever has no neighbour. */
static void centre(double *value, double *list, const tsuya_check *check)
{
    int n = 0;
    for (int i = 0; i < check->count; i++) {
        if (check->photo[i].neighbours > 0) {
            list[n++] = value[i];
        }
    }
    double middle = n > 0 ? tsuya_check_median(list, n) : 0.0;
    for (int i = 0; i < check->count; i++) {
        value[i] = check->photo[i].neighbours > 0 ? value[i] - middle : NAN;
    }
}

/* log2 of the exposure that EXIF tells; NaN where it does not. */
static double told_ev(const tsuya_photo *p)
{
    bool known = p->exposure_s > 0.0 && p->f_number > 0.0 && p->iso > 0.0;
    return known ? log2(p->exposure_s * p->iso / (p->f_number * p->f_number)) : NAN;
}

/* Of two that should agree: 0 where they do not in sign. */
static double smaller(double a, double b) { return a * b <= 0.0 ? 0.0 : fabs(a) < fabs(b) ? a : b; }

/* The middle of what the neighbours say. */
static double agreed(double *said, int n)
{
    if (n < FEWEST_NEIGHBOURS) {
        return NAN;
    }
    (void)tsuya_check_median(said, n); /* sorts */
    return smaller(said[(n - 1) / 2], said[n / 2]);
}

/* By how much a photograph stands out; `explained`: beyond what EXIF tells. */
static double stands_out(const tsuya_check *check, const tsuya_check_relation *relations, int i, int which, int fewest, bool explained, double *list)
{
    int n = 0;
    for (int j = 0; j < check->count; j++) {
        const tsuya_check_relation *r = &relations[i * check->count + j];
        if (j == i || !speaks(r, which, fewest)) {
            continue;
        }
        double told = explained && which == 1 ? told_ev(&check->photo[i].photo) - told_ev(&check->photo[j].photo) : 0.0;
        double off = r->ratio[which] - (isfinite(told) ? told : 0.0);
        list[n++] = fabs(off) > r->spread[which] ? off : 0.0;
    }
    return agreed(list, n);
}

/* Robust standard deviation about zero. */
static double scatter(const double *value, int count, double *list)
{
    int n = 0;
    for (int i = 0; i < count; i++) {
        if (isfinite(value[i])) {
            list[n++] = fabs(value[i]);
        }
    }
    return n > 0 ? NORMAL * tsuya_check_median(list, n) : 0.0;
}

/* Exposures that EXIF tells and the pixels confirm. */
static void judge_told(tsuya_check *check, const double *raw, double *list, double limit)
{
    int n = 0;
    for (int i = 0; i < check->count; i++) {
        double told = told_ev(&check->photo[i].photo);
        if (isfinite(told)) {
            list[n++] = told;
        }
    }
    double middle = n > 0 ? tsuya_check_median(list, n) : NAN;
    for (int i = 0; i < check->count; i++) {
        double told = told_ev(&check->photo[i].photo) - middle;
        bool off = fabs(told) > limit && fabs(raw[i]) > limit && told * raw[i] > 0.0;
        check->photo[i].told_ev = off ? told : 0.0;
    }
}

static void set_limits(tsuya_check *check, const double *value, double *list, const tsuya_check_options *options)
{
    for (int c = 0; c < 3; c++) {
        double own = scatter(value + (ptrdiff_t)c * check->count, check->count, list);
        check->limit_ev[c] = fmax(c == 1 ? options->exposure_ev : options->white_balance_ev, TSUYA_CHECK_OUTLIER * own);
    }
}

static void set_wander(tsuya_check *check, double *list)
{
    int n = 0;
    for (int i = 0; i < check->count; i++) {
        if (isfinite(check->photo[i].exposure_ev)) {
            list[n++] = check->photo[i].exposure_ev;
        }
    }
    (void)tsuya_check_median(list, n); /* sorts */
    check->wander_ev = n > 0 ? list[(int)(0.9 * (n - 1))] - list[(int)(0.1 * (n - 1))] : NAN;
}

tsuya_status tsuya_check_light(tsuya_check *check, const tsuya_check_relation *relations, const tsuya_check_options *options)
{
    tsuya_status status = TSUYA_OK;
    double *value = NULL;
    size_t n = (size_t)check->count;
    int fewest = options->shared_features;
    TSUYA_NEW(status, value, 8 * n);
    double *gain = value, *apart = value + 3 * n, *raw = value + 6 * n, *list = value + 7 * n;
    for (int c = 0; c < 3; c++) {
        solve_gains(gain + (size_t)c * n, relations, check->count, c, fewest);
        centre(gain + (size_t)c * n, list, check);
        for (int i = 0; i < check->count; i++) {
            apart[(size_t)c * n + (size_t)i] = stands_out(check, relations, i, c, fewest, true, list);
        }
    }
    for (size_t i = 0; i < n; i++) {
        tsuya_checked_photo *p = &check->photo[i];
        p->red_ev = gain[i];
        p->exposure_ev = gain[n + i];
        p->blue_ev = gain[2 * n + i];
        raw[i] = stands_out(check, relations, (int)i, 1, fewest, false, list);
        apart[n + i] = smaller(raw[i], apart[n + i]);
        for (size_t c = 0; c < 3; c++) {
            p->apart_ev[c] = apart[c * n + i];
        }
    }
    set_limits(check, apart, list, options);
    judge_told(check, raw, list, options->exposure_ev);
    set_wander(check, list);
done:
    tsuya_free(value);
    return status;
}
