#include "capture/studio_spread.h"

#include <math.h>

/* ∫ Φ */
static double normal_integral(double z) { return z * 0.5 * erfc(-z * M_SQRT1_2) + exp(-0.5 * z * z) / sqrt(2.0 * M_PI); }

static double share_below(double place_px, double sigma_px)
{
    if (sigma_px <= 0.0) {
        return fmin(fmax(place_px + 0.5, 0.0), 1.0);
    }
    return sigma_px * (normal_integral((place_px + 0.5) / sigma_px) - normal_integral((place_px - 0.5) / sigma_px));
}

void tsuya_studio_spread_fill(tsuya_studio_spread *s, double sigma_px)
{
    for (int k = 0; k <= TSUYA_SPREAD_STEPS / 2; k++) {
        /* the outermost step keeps the mean of its tail, which falls about as an exponential */
        double share = (k > 0 ? k : sigma_px > 0.0 ? exp(-2.0) : 0.0) / TSUYA_SPREAD_STEPS, low = -0.5 - 8.0 * sigma_px, high = 0.0;
        for (int i = 0; i < 60; i++) {
            double middle = 0.5 * (low + high);
            *(share_below(middle, sigma_px) > share ? &high : &low) = middle;
        }
        s->place_px[k] = low;
        s->place_px[TSUYA_SPREAD_STEPS - k] = -low;
    }
}
