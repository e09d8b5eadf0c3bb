/* mrcal's LENSMODEL_SPLINED_STEREOGRAPHIC, order 3 (mrcal, "Splined stereographic lens model"): a stereographic projection whose
 * plane is bent by a surface of uniform cubic B-splines. */
#include "core/camera_spline.h"

#include <math.h>

enum { ITERATIONS = 60 };
static const double SLACK = 1e-9; /* of a cell: the edge of the reach belongs to it */

double tsuya_lens_spline_density(const tsuya_lens_spline *s)
{
    return (s->nx - 3) / (4.0 * tan(0.25 * tsuya_rad_from_deg(s->fov_x_deg)));
}

tsuya_vec2 tsuya_lens_spline_reach(const tsuya_lens_spline *s)
{
    double cell = 1.0 / tsuya_lens_spline_density(s);
    return (tsuya_vec2){0.5 * (s->nx - 3) * cell, 0.5 * (s->ny - 3) * cell};
}

tsuya_vec2 tsuya_stereographic_from_ray(tsuya_vec3 p)
{
    double scale = 2.0 / (tsuya_vec3_norm(p) + p.z);
    return (tsuya_vec2){scale * p.x, scale * p.y};
}

tsuya_vec3 tsuya_stereographic_ray(tsuya_vec2 u)
{
    double quarter = 0.25 * (u.x * u.x + u.y * u.y), scale = 1.0 / (1.0 + quarter);
    return (tsuya_vec3){scale * u.x, scale * u.y, scale * (1.0 - quarter)};
}

/* The four B-splines over one cell, t from 0 to 1, and their derivatives. */
static void basis(double b[4], double d[4], double t)
{
    double s = 1.0 - t;
    b[0] = s * s * s / 6.0;
    b[1] = (3.0 * t * t * t - 6.0 * t * t + 4.0) / 6.0;
    b[2] = (3.0 * s * s * s - 6.0 * s * s + 4.0) / 6.0;
    b[3] = t * t * t / 6.0;
    d[0] = -0.5 * s * s;
    d[1] = 1.5 * t * t - 2.0 * t;
    d[2] = -1.5 * s * s + 2.0 * s;
    d[3] = 0.5 * t * t;
}

/* The cell of a coordinate, the outermost continued beyond the edge as mrcal does. */
static int cell_of(double *t, double at, int n)
{
    double floor_at = floor(at);
    int cell = !(floor_at > 1.0) ? 1 : floor_at < n - 3 ? (int)floor_at : n - 3;
    *t = at - cell;
    return cell - 1;
}

/* The 4 × 4 control points that hold a place, from `first` on row by row, and their B-splines there. */
typedef struct cell {
    int first;
    double bx[4], by[4], dx[4], dy[4];
} cell;

static cell cell_at(const tsuya_lens_spline *s, double density, tsuya_vec2 u)
{
    cell c;
    double tx, ty;
    int ix = cell_of(&tx, u.x * density + 0.5 * (s->nx - 1), s->nx), iy = cell_of(&ty, u.y * density + 0.5 * (s->ny - 1), s->ny);
    basis(c.bx, c.dx, tx);
    basis(c.by, c.dy, ty);
    c.first = iy * s->nx + ix;
    return c;
}

static tsuya_vec2 bend(double jacobian[2][2], const tsuya_lens_spline *s, double density, tsuya_vec2 u)
{
    const cell c = cell_at(s, density, u);
    tsuya_vec2 sum = {0, 0}, along_x = {0, 0}, along_y = {0, 0};
    for (int j = 0; j < 4; j++) {
        for (int i = 0; i < 4; i++) {
            const double *p = s->point + 2 * (c.first + j * s->nx + i);
            sum = (tsuya_vec2){sum.x + c.bx[i] * c.by[j] * p[0], sum.y + c.bx[i] * c.by[j] * p[1]};
            along_x = (tsuya_vec2){along_x.x + c.dx[i] * c.by[j] * p[0], along_x.y + c.dx[i] * c.by[j] * p[1]};
            along_y = (tsuya_vec2){along_y.x + c.bx[i] * c.dy[j] * p[0], along_y.y + c.bx[i] * c.dy[j] * p[1]};
        }
    }
    jacobian[0][0] = 1.0 + density * along_x.x;
    jacobian[0][1] = density * along_y.x;
    jacobian[1][0] = density * along_x.y;
    jacobian[1][1] = 1.0 + density * along_y.y;
    return (tsuya_vec2){u.x + sum.x, u.y + sum.y};
}

void tsuya_lens_spline_weights(double weight[16], int *first, const tsuya_lens_spline *s, tsuya_vec2 u)
{
    const cell c = cell_at(s, tsuya_lens_spline_density(s), u);
    *first = c.first;
    for (int i = 0; i < 16; i++) {
        weight[i] = c.bx[i % 4] * c.by[i / 4];
    }
}

static bool within(const tsuya_lens_spline *s, double density, tsuya_vec2 u)
{
    return fabs(u.x) * density <= 0.5 * (s->nx - 3) + SLACK && fabs(u.y) * density <= 0.5 * (s->ny - 3) + SLACK;
}

bool tsuya_camera_spline_project(const tsuya_camera *c, tsuya_vec3 p, tsuya_vec2 *pixel)
{
    double density = tsuya_lens_spline_density(&c->spline), unused[2][2];
    tsuya_vec2 u = tsuya_stereographic_from_ray(p);
    *pixel = (tsuya_vec2){0, 0};
    if (!within(&c->spline, density, u)) {
        return false;
    }
    tsuya_vec2 bent = bend(unused, &c->spline, density, u);
    *pixel = (tsuya_vec2){c->fx_px * bent.x + c->cx_px, c->fy_px * bent.y + c->cy_px};
    return isfinite(pixel->x) && isfinite(pixel->y);
}

/* Newton, no step longer than two cells: the surface beyond one cell is another polynomial. */
bool tsuya_camera_spline_unproject(const tsuya_camera *c, tsuya_vec2 pixel, tsuya_vec3 *ray)
{
    const tsuya_lens_spline *s = &c->spline;
    double density = tsuya_lens_spline_density(s), j[2][2];
    tsuya_vec2 want = {(pixel.x - c->cx_px) / c->fx_px, (pixel.y - c->cy_px) / c->fy_px}, u = want;
    double tolerance = 1e-14 * (1.0 + fabs(want.x) + fabs(want.y));
    for (int i = 0; i < ITERATIONS; i++) {
        tsuya_vec2 bent = bend(j, s, density, u);
        double ex = bent.x - want.x, ey = bent.y - want.y, determinant = j[0][0] * j[1][1] - j[0][1] * j[1][0];
        if (!(determinant > 1e-9) || fabs(ex) + fabs(ey) <= tolerance) {
            break;
        }
        double sx = (j[1][1] * ex - j[0][1] * ey) / determinant, sy = (j[0][0] * ey - j[1][0] * ex) / determinant;
        double shorter = fmin(1.0, 2.0 / (density * hypot(sx, sy)));
        u = (tsuya_vec2){u.x - shorter * sx, u.y - shorter * sy};
    }
    tsuya_vec2 bent = bend(j, s, density, u);
    *ray = tsuya_stereographic_ray(u);
    return within(s, density, u) && fabs(bent.x - want.x) + fabs(bent.y - want.y) <= 1e-9 * (1.0 + fabs(want.x) + fabs(want.y))
        && j[0][0] * j[1][1] - j[0][1] * j[1][0] > 1e-9;
}
