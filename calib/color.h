/* A camera's colours: vignetting from flat cards, white balance and a 3 × 3 matrix from a 24-patch chart.
 *
 *     rgb = exposure · matrix · (white_balance ∘ value / vignetting(r))
 *
 * with `value` linear (sRGB decoded, raw as it is), rgb linear Rec.709 in which the chart's reflectances stand as its maker states
 * them.  The matrix' rows sum to 1, so that greys stay grey.  It minimises the sum of squared ΔE00 (its local metric at each
 * patch, Levenberg–Marquardt); a gradient of the light across the chart is estimated beside it and taken out.
 *
 * Vignetting is exp(k₂r² + k₄r⁴ + k₆r⁶), r = 1 at half the diagonal; each card has a level a channel and a gradient of its own
 * light (exponential too, so that the whole is one linear least squares on logarithms, reweighted against dust). */
#ifndef TSUYA_CALIB_COLOR_H
#define TSUYA_CALIB_COLOR_H

#include "calib/chart.h"
#include "core/json.h"

enum { TSUYA_COLOR_CARDS = 16, TSUYA_FLAT_COLS = 32, TSUYA_FLAT_ROWS = 24 };

/* A flat card's light, coarse: medians of cells, NaN where more than a tenth of the cell is clipped. */
typedef struct tsuya_flat_card {
    int width_px, height_px;
    double rgb[TSUYA_FLAT_ROWS][TSUYA_FLAT_COLS][3];
} tsuya_flat_card;
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_flat_card_read(tsuya_flat_card *card, const tsuya_image *photo, const char *name);

typedef struct tsuya_vignetting {
    int width_px, height_px;
    double k[3];                    /* all 0: none known */
    double corner;                  /* light that is left in the corners, a share */
    double residual;                /* RMS of what the model leaves, a share */
    double gradient[TSUYA_COLOR_CARDS][2]; /* of each card's light, from the middle to the right and lower edge, a share */
} tsuya_vignetting;
/* Cards of one size.  Fails where they are not flat (a quarter of the cells and more lies 5 % off). `balance` (may be NULL): gains
 * that make the cards grey, green 1. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_vignetting_fit(tsuya_vignetting *vignetting, double balance[3], const tsuya_flat_card *card, int count);
/* Light that reaches a pixel, a share of the middle's. */
TSUYA_API double tsuya_vignetting_at(const tsuya_vignetting *vignetting, double x_px, double y_px);

typedef struct tsuya_color_stats { double mean, median, max; int count; } tsuya_color_stats;

typedef struct tsuya_color {
    tsuya_vignetting vignetting;
    bool has_matrix;
    double white_balance[3], exposure;
    tsuya_mat3 matrix;
    double light_gradient[2];       /* across the chart, from its middle to its right and lower edge, a share */
    double gamma;                   /* slope of the greys, log value over log reflectance: 1 is linear */
    double grey_deviation;          /* largest deviation of a grey from proportional, a share */
    int grey_worst;                 /* its patch, 0 … 23 */
    bool left_out[TSUYA_CHART_PATCHES]; /* clipped */
    tsuya_lab reference[TSUYA_CHART_PATCHES], measured[TSUYA_CHART_PATCHES]; /* D65 */
    double de00[TSUYA_CHART_PATCHES], de00_heldout[TSUYA_CHART_PATCHES]; /* NaN where left out */
    tsuya_color_stats light, dark;  /* patches with L* from 40 on, and below */
    tsuya_color_stats heldout;      /* each patch by the fit of the others */
} tsuya_color;

/* `vignetting`: as it was found, or NULL.  Fails where greys are clipped, too dark, or patches are not those of the reference
 * (median ΔE00 above 15). */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_color_fit(tsuya_color *color, const tsuya_chart *chart, const tsuya_lab reference_d50[TSUYA_CHART_PATCHES],
                                                        const tsuya_vignetting *vignetting, const char *name);
/* rgb of a pixel's linear value. */
TSUYA_API tsuya_vec3 tsuya_color_apply(const tsuya_color *color, const double value[3], double x_px, double y_px);
TSUYA_API void tsuya_color_to_json(tsuya_json *object, const tsuya_color *color);
/* What apply needs, from color.json. */
TSUYA_MUST_CHECK TSUYA_API tsuya_status tsuya_color_load(tsuya_color *color, const char *path);

#endif
