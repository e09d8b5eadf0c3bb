#include "weave_detect/patches.h"

#include "core/geometry.h"
#include "core/memory.h"
#include "core/order.h"


static const double SURE = 0.8;

static double median(double *value, size_t count)
{
    if (count == 0) {
        return NAN;
    }
    tsuya_sort_doubles(value, count);
    return value[count / 2];
}

/* Period of the weft, of the warp, angle between them, of a sure patch. */
static double quantity(const tsuya_threads *t, int which)
{
    switch (which) {
    case 0: return t->a.period_px;
    case 1: return t->b.period_px;
    default: return tsuya_deg_from_rad(tsuya_line_difference(t->a.angle_rad, t->b.angle_rad));
    }
}

static tsuya_weave_kind commonest_kind(const tsuya_patch_grid *grid)
{
    size_t tally[4] = {0};
    int best = 0;
    for (size_t i = 0; i < tsuya_patch_count(grid); i++) {
        const tsuya_threads *t = &grid->patch[i].threads;
        tally[t->kind] += t->confidence >= SURE;
    }
    for (int k = 1; k < 4; k++) {
        best = tally[k] > tally[best] ? k : best;
    }
    return (tsuya_weave_kind)best;
}

/* Of the lines of the sure twill patches; NaN where there are none. */
static double mean_diagonal_deg(const tsuya_patch_grid *grid)
{
    double re = 0.0, im = 0.0;
    for (size_t i = 0; i < tsuya_patch_count(grid); i++) {
        const tsuya_threads *t = &grid->patch[i].threads;
        if (t->confidence >= SURE && t->kind == TSUYA_WEAVE_TWILL) {
            re += cos(2.0 * t->diagonal_rad);
            im += sin(2.0 * t->diagonal_rad);
        }
    }
    return hypot(re, im) > 0.0 ? tsuya_deg_from_rad(tsuya_line_wrap(0.5 * atan2(im, re))) : NAN;
}

void tsuya_patches_to_json(tsuya_json *figures, const tsuya_patch_grid *grid, double px_per_cm)
{
    size_t count = tsuya_patch_count(grid), sure = 0;
    double *value = tsuya_calloc(count, sizeof *value), middle[3] = {NAN, NAN, NAN};
    for (int q = 0; value && q < 3; q++) {
        sure = 0;
        for (size_t i = 0; i < count; i++) {
            const tsuya_threads *t = &grid->patch[i].threads;
            if (t->confidence >= SURE) {
                value[sure++] = quantity(t, q);
            }
        }
        middle[q] = median(value, sure);
    }
    tsuya_free(value);
    tsuya_json_set_number(figures, "patches", (double)count);
    tsuya_json_set_number(figures, "sure", count > 0 ? (double)sure / (double)count : 0.0);
    tsuya_json_set_number(figures, "period_weft_px", middle[0]);
    tsuya_json_set_number(figures, "period_warp_px", middle[1]);
    tsuya_json_set_number(figures, "angle_between_deg", middle[2]);
    if (px_per_cm > 0.0) {
        tsuya_json_set_number(figures, "threads_per_cm_weft", px_per_cm / middle[0]);
        tsuya_json_set_number(figures, "threads_per_cm_warp", px_per_cm / middle[1]);
    }
    tsuya_weave_kind kind = commonest_kind(grid);
    tsuya_json_set_text(figures, "kind", tsuya_weave_kind_name(kind));
    if (kind == TSUYA_WEAVE_TWILL) {
        tsuya_json_set_number(figures, "diagonal_deg", mean_diagonal_deg(grid));
    }
    tsuya_json_set_text(figures, "weft_told_by", tsuya_weft_told_name(grid->weft_told));
}
