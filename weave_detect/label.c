#include "weave_detect/label.h"

#include "core/geometry.h"

static void swap_families(tsuya_threads *threads)
{
    tsuya_thread_family a = threads->a;
    threads->a = threads->b;
    threads->b = a;
}

void tsuya_patches_label(tsuya_patch_grid *grid, double weft_deg)
{
    double weft_rad = isfinite(weft_deg) ? tsuya_rad_from_deg(weft_deg) : 0.0;
    for (size_t i = 0; i < tsuya_patch_count(grid); i++) {
        tsuya_threads *t = &grid->patch[i].threads;
        double a = t->a.seen ? tsuya_line_difference(t->a.angle_rad, weft_rad) : 0.25 * M_PI;
        double b = t->b.seen ? tsuya_line_difference(t->b.angle_rad, weft_rad) : 0.25 * M_PI;
        if (b < a) {
            swap_families(t);
        }
    }
}
