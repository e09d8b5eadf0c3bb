#include "calib/shape.h"

static const double GROWTH_PRIOR = 0.01, BEND_PRIOR = 0.005;

tsuya_plate_shape tsuya_plate_shape_flat(const tsuya_board *board, int plate)
{
    const tsuya_board_plate *p = &board->plate[plate];
    tsuya_vec2 low = board->tag[p->first_tag].corner_m[0], high = low;
    for (int i = 0; i < 4 * p->tag_count; i++) {
        tsuya_vec2 c = board->tag[p->first_tag + i / 4].corner_m[i % 4];
        low = (tsuya_vec2){fmin(low.x, c.x), fmin(low.y, c.y)};
        high = (tsuya_vec2){fmax(high.x, c.x), fmax(high.y, c.y)};
    }
    return (tsuya_plate_shape){.middle_m = {0.5 * (low.x + high.x), 0.5 * (low.y + high.y)}, .half_m = {0.5 * (high.x - low.x), 0.5 * (high.y - low.y)}};
}

static tsuya_vec2 tag_middle(const tsuya_board *board, int tag)
{
    const tsuya_vec2 *c = board->tag[tag].corner_m;
    return (tsuya_vec2){0.25 * (c[0].x + c[1].x + c[2].x + c[3].x), 0.25 * (c[0].y + c[1].y + c[2].y + c[3].y)};
}

/* What each bend lifts where the file has the corner. */
static void lift(double by[TSUYA_BENDS], const tsuya_plate_shape *s, tsuya_vec2 c)
{
    double u = (c.x - s->middle_m.x) / s->half_m.x, v = (c.y - s->middle_m.y) / s->half_m.y;
    by[0] = 1.0 - u * u;
    by[1] = 1.0 - v * v;
    by[2] = u * v;
}

tsuya_vec3 tsuya_plate_shape_corner(const tsuya_plate_shape *s, const tsuya_board *board, int tag, int corner)
{
    tsuya_vec2 c = board->tag[tag].corner_m[corner], m = tag_middle(board, tag);
    double by[TSUYA_BENDS], grown = 1.0 + s->growth, z = 0.0;
    lift(by, s, c);
    for (int k = 0; k < TSUYA_BENDS; k++) {
        z += by[k] * s->bend_m[k];
    }
    return (tsuya_vec3){m.x + grown * (c.x - m.x), m.y + grown * (c.y - m.y), z};
}

void tsuya_plate_shape_gradient(tsuya_vec3 by[TSUYA_SHAPE_PARAMETERS], const tsuya_plate_shape *s, const tsuya_board *board, int tag, int corner)
{
    tsuya_vec2 c = board->tag[tag].corner_m[corner], m = tag_middle(board, tag);
    double z[TSUYA_BENDS];
    lift(z, s, c);
    by[0] = (tsuya_vec3){c.x - m.x, c.y - m.y, 0.0};
    for (int k = 0; k < TSUYA_BENDS; k++) {
        by[1 + k] = (tsuya_vec3){0.0, 0.0, z[k]};
    }
}

void tsuya_plate_shape_prior(double sigma[TSUYA_SHAPE_PARAMETERS], const tsuya_plate_shape *s)
{
    sigma[0] = GROWTH_PRIOR;
    for (int k = 1; k < TSUYA_SHAPE_PARAMETERS; k++) {
        sigma[k] = BEND_PRIOR * hypot(s->half_m.x, s->half_m.y);
    }
}
