#include "capture/studio_spread.h"

#include "core/memory.h"

#include <math.h>

static const double FARTHEST_SIGMAS = 4.0;

/* ∫ Φ */
static double normal_integral(double z) { return z * 0.5 * erfc(-z * M_SQRT1_2) + exp(-0.5 * z * z) / sqrt(2.0 * M_PI); }

static double share_below(double place_px, double sigma_px)
{
    if (sigma_px <= 0.0) {
        return fmin(fmax(place_px + 0.5, 0.0), 1.0);
    }
    return sigma_px * (normal_integral((place_px + 0.5) / sigma_px) - normal_integral((place_px - 0.5) / sigma_px));
}

/* Fills the weights; the variance of cells that are even within. */
static double fill(tsuya_studio_spread *s, double sigma_px)
{
    const double cell = 1.0 / s->side, start = -0.5 - s->reach;
    double sum = 0.0, squares = 0.0;
    for (int i = 0; i < s->count; i++) {
        s->weight[i] = share_below(start + (i + 1) * cell, sigma_px) - share_below(start + i * cell, sigma_px);
        sum += s->weight[i];
    }
    for (int i = 0; i < s->count; i++) {
        const double middle = start + (i + 0.5) * cell;
        s->weight[i] /= sum;
        squares += s->weight[i] * middle * middle;
    }
    return squares + cell * cell / 12.0;
}

tsuya_status tsuya_studio_spread_create(tsuya_studio_spread *s, double sigma_px, int side)
{
    tsuya_status status = TSUYA_OK;
    double low = 0.0, high = sigma_px;
    *s = (tsuya_studio_spread){.side = side, .reach = (int)ceil(FARTHEST_SIGMAS * sigma_px)};
    s->count = (2 * s->reach + 1) * side;
    TSUYA_NEW(status, s->weight, (size_t)s->count);
    for (int i = 0; i < 40 && high > low; i++) {
        const double middle = 0.5 * (low + high);
        *(fill(s, middle) > 1.0 / 12.0 + sigma_px * sigma_px ? &high : &low) = middle;
    }
    (void)fill(s, 0.5 * (low + high));
done:
    return status;
}

void tsuya_studio_spread_free(tsuya_studio_spread *s)
{
    tsuya_free(s->weight);
    s->weight = NULL;
}
