#include "weave_detect/label.h"

#include "core/geometry.h"

static const double SURE = 0.8, ALIKE = 0.5; /* ALIKE: length of the mean of the sure crosses, from which the picture has one direction */
static const double MOST = 0.8; /* share of the sure patches whose periods must say the same */

static void swap_families(tsuya_threads *threads)
{
    tsuya_thread_family a = threads->a;
    threads->a = threads->b;
    threads->b = a;
}

static void name_nearest(tsuya_patch_grid *grid, double weft_rad)
{
    for (size_t i = 0; i < tsuya_patch_count(grid); i++) {
        tsuya_threads *t = &grid->patch[i].threads;
        double a = t->a.seen ? tsuya_line_difference(t->a.angle_rad, weft_rad) : 0.25 * M_PI;
        double b = t->b.seen ? tsuya_line_difference(t->b.angle_rad, weft_rad) : 0.25 * M_PI;
        if (b < a) {
            swap_families(t);
        }
    }
}

/* The axis of the sure patches' mean cross that is nearer to the horizontal; false where the crosses stand every way. */
static bool mean_axis(double *axis_rad, const tsuya_patch_grid *grid)
{
    double re = 0.0, im = 0.0, count = 0.0;
    for (size_t i = 0; i < tsuya_patch_count(grid); i++) {
        const tsuya_threads *t = &grid->patch[i].threads;
        if (t->confidence >= SURE) {
            re += cos(4.0 * t->a.angle_rad) + cos(4.0 * t->b.angle_rad);
            im += sin(4.0 * t->a.angle_rad) + sin(4.0 * t->b.angle_rad);
            count += 2.0;
        }
    }
    *axis_rad = 0.25 * atan2(im, re);
    return hypot(re, im) > ALIKE * count;
}

/* The coarser threads are the weft, where nearly all sure patches say which they are. */
static bool name_coarser(tsuya_patch_grid *grid)
{
    size_t sure = 0, coarser_a = 0, coarser_b = 0;
    for (size_t i = 0; i < tsuya_patch_count(grid); i++) {
        const tsuya_threads *t = &grid->patch[i].threads;
        if (t->confidence >= SURE) {
            int coarser = tsuya_coarser_family(t->a.period_px, t->b.period_px);
            sure++;
            coarser_a += coarser > 0;
            coarser_b += coarser < 0;
        }
    }
    bool told = sure > 0 && (double)(coarser_a > coarser_b ? coarser_a : coarser_b) >= MOST * (double)sure;
    for (size_t i = 0; told && coarser_b > coarser_a && i < tsuya_patch_count(grid); i++) {
        swap_families(&grid->patch[i].threads);
    }
    return told;
}

void tsuya_patches_label(tsuya_patch_grid *grid, double weft_deg)
{
    double axis_rad;
    if (isfinite(weft_deg)) {
        name_nearest(grid, tsuya_rad_from_deg(weft_deg));
        grid->weft_told = TSUYA_WEFT_USER;
        return;
    }
    bool one_way = mean_axis(&axis_rad, grid);
    name_nearest(grid, one_way ? axis_rad : 0.0);
    grid->weft_told = one_way && name_coarser(grid) ? TSUYA_WEFT_COUNT : TSUYA_WEFT_UNKNOWN;
}
