/* Where a pixel's light comes from along one axis of the sensor: over its own width, spread by a Gaussian (what lens and low-pass filter
 * blur).  Kept as the places below which even shares of it lie, so that rays in strata of the share are strata of the blur as well. */
#ifndef TSUYA_CAPTURE_STUDIO_SPREAD_H
#define TSUYA_CAPTURE_STUDIO_SPREAD_H

enum { TSUYA_SPREAD_STEPS = 512 };
typedef struct tsuya_studio_spread { double place_px[TSUYA_SPREAD_STEPS + 1]; } tsuya_studio_spread;

/* sigma_px: of the Gaussian, ≥ 0. */
void tsuya_studio_spread_fill(tsuya_studio_spread *spread, double sigma_px);

/* From the pixel's middle; share in [0, 1]. */
static inline double tsuya_studio_spread_at(const tsuya_studio_spread *s, double share)
{
    int k = (int)(share * TSUYA_SPREAD_STEPS);
    k = k < TSUYA_SPREAD_STEPS ? k : TSUYA_SPREAD_STEPS - 1;
    return s->place_px[k] + (share * TSUYA_SPREAD_STEPS - k) * (s->place_px[k + 1] - s->place_px[k]);
}

#endif
