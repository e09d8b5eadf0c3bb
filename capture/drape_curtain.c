/* A curtain as it is hung up: its heading follows a wave, and everything below hangs straight down from it, so that nothing is
 * stretched.  The wave is y = A sin(2π n x / width); A is such that chords of one cell each lead from end to end. */
#include "capture/drape_parts.h"

#include "core/memory.h"

#include <math.h>

enum { CELLS_A_PLEAT = 8, PARTS = 32, HALVINGS = 60 };
static const double least_fullness = 1.02, most_fullness = 4.0;

/* The next place of the wave at this distance from (x, amplitude sin(per x)); looked for in small parts, for the distance may fall again. */
static double next_on_wave(double x, double amplitude, double per, double distance)
{
    double y = amplitude * sin(per * x), near = 0.0, far = distance;
    for (int k = 1; k <= PARTS; k++) {
        double step = distance * k / PARTS;
        if (hypot(step, amplitude * sin(per * (x + step)) - y) >= distance) {
            far = step;
            break;
        }
        near = step;
    }
    for (int k = 0; k < HALVINGS; k++) {
        double middle = 0.5 * (near + far);
        bool beyond = hypot(middle, amplitude * sin(per * (x + middle)) - y) >= distance;
        near = beyond ? near : middle;
        far = beyond ? middle : far;
    }
    return x + far;
}

/* Where `columns` chords end that start at 0. */
static double walk(double *x, double amplitude, double per, double chord, int columns)
{
    double at = 0.0;
    for (int i = 0; i <= columns; i++) {
        if (x) {
            x[i] = at;
        }
        at = i < columns ? next_on_wave(at, amplitude, per, chord) : at;
    }
    return at;
}

tsuya_status tsuya_drape_sheet_curtain(tsuya_drape_sheet *s, double width_m, double drop_m, double fullness, int pleats, double spacing_m)
{
    tsuya_status status = TSUYA_OK;
    double flat = width_m * fullness, *x = NULL;
    if (!(spacing_m > 0.0 && width_m > 0.0 && drop_m > 0.0 && fullness >= least_fullness && fullness <= most_fullness) || pleats < 1 ||
        !(flat / spacing_m >= CELLS_A_PLEAT * pleats && flat / spacing_m <= 10000.0 && drop_m / spacing_m <= 10000.0)) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "drape: a curtain of %g x %g m, %g times as wide, in %d pleats and cells of %g m; %g to %g times and at least %d cells a "
                          "pleat are accepted", width_m, drop_m, fullness, pleats, spacing_m, least_fullness, most_fullness, CELLS_A_PLEAT);
    }
    int columns = (int)ceil(flat / spacing_m), rows = (int)ceil(drop_m / spacing_m);
    double chord = flat / columns, row = drop_m / rows, per = 2.0 * M_PI * pleats / width_m, low = 0.0, high = flat / pleats;
    TSUYA_NEW(status, x, (size_t)columns + 1);
    for (int k = 0; k < HALVINGS; k++) {
        double middle = 0.5 * (low + high);
        bool too_low = walk(NULL, middle, per, chord, columns) > width_m;
        low = too_low ? middle : low;
        high = too_low ? high : middle;
    }
    (void)walk(x, high, per, chord, columns);
    TSUYA_GOTO_DONE(status, tsuya_drape_sheet_grid(s, 0.0, 0.0, 1.0, columns, rows));
    for (size_t k = 0; k < 3 * s->triangle_count; k++) {
        s->uv[2 * k] = chord * s->uv[2 * k] - 0.5 * flat;
        s->uv[2 * k + 1] = row * s->uv[2 * k + 1] - drop_m;
    }
    for (size_t v = 0; v < s->vertex_count; v++) {
        double *p = s->position + 3 * v, at = x[v % ((size_t)columns + 1)];
        s->fixed[v] = v / ((size_t)columns + 1) == (size_t)rows;
        p[2] = row * p[1] - drop_m;
        p[0] = at - 0.5 * width_m;
        p[1] = high * sin(per * at);
    }
done:
    tsuya_free(x);
    return status;
}
