#include "calib/misfit.h"

#include "core/memory.h"

#include <string.h>

enum { COLS = 16, ROWS = 12, CELLS = COLS * ROWS };

typedef struct cell {
    tsuya_vec2 sum, of_photo; /* of_photo: of the photograph that is being counted */
    double count, in_photo;
    double own, own_count;    /* squares of the photographs' sums and counts */
} cell;

static void close_photo(cell *c)
{
    for (int i = 0; i < CELLS; i++) {
        c[i].sum = (tsuya_vec2){c[i].sum.x + c[i].of_photo.x, c[i].sum.y + c[i].of_photo.y};
        c[i].count += c[i].in_photo;
        c[i].own += c[i].of_photo.x * c[i].of_photo.x + c[i].of_photo.y * c[i].of_photo.y;
        c[i].own_count += c[i].in_photo * c[i].in_photo;
        c[i].of_photo = (tsuya_vec2){0, 0};
        c[i].in_photo = 0.0;
    }
}

static int place(double at, int side_px, int n)
{
    int i = (int)floor((at + 0.5) * n / side_px);
    return i < 0 ? 0 : i < n ? i : n - 1;
}

/* Of residuals r = m + e with m of the cell: Σ over pairs of different photographs is m² times their number. */
tsuya_status tsuya_misfit(double *share, const tsuya_solve *s)
{
    tsuya_status status = TSUYA_OK;
    cell *c = NULL;
    double common = 0.0, chance = 0.0, all = 0.0;
    TSUYA_NEW(status, c, CELLS);
    for (int v = 0; v < s->view_count; v++) {
        if (v > 0 && s->view[v].photo != s->view[v - 1].photo) {
            close_photo(c);
        }
        for (int i = s->view[v].first; i < s->view[v].first + s->view[v].count; i++) {
            const tsuya_solve_observation *o = &s->observation[i];
            cell *at = &c[place(o->pixel.y, s->camera.height_px, ROWS) * COLS + place(o->pixel.x, s->camera.width_px, COLS)];
            double length = hypot(o->residual_px.x, o->residual_px.y) / o->weight_sigma_px;
            double scale = fmin(1.0, TSUYA_OUTLIER_SIGMAS / length) / o->weight_sigma_px;
            tsuya_vec2 r = {scale * o->residual_px.x, scale * o->residual_px.y};
            at->of_photo = (tsuya_vec2){at->of_photo.x + r.x, at->of_photo.y + r.y};
            at->in_photo += 1.0;
            all += r.x * r.x + r.y * r.y;
        }
    }
    close_photo(c);
    for (int i = 0; i < CELLS; i++) {
        double pairs = c[i].count * c[i].count - c[i].own_count;
        if (pairs > 0.0) {
            double weight = c[i].count / pairs;
            common += weight * (c[i].sum.x * c[i].sum.x + c[i].sum.y * c[i].sum.y - c[i].own);
            chance += weight * weight * c[i].own * c[i].own; /* photographs' sums in any direction */
        }
    }
    *share = common > 3.0 * sqrt(chance) ? common / all : 0.0;
done:
    tsuya_free(c);
    return status;
}
