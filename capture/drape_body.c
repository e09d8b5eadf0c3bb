/* Signed distances of the bodies that a cloth lies on. */
#include "capture/drape.h"

#include <math.h>

typedef struct field { double distance; tsuya_vec3 gradient; } field;

static tsuya_vec3 unit_or_up(tsuya_vec3 d) { return tsuya_vec3_norm(d) > 0.0 ? tsuya_vec3_unit(d) : (tsuya_vec3){0, 0, 1}; }

static field bar(const tsuya_drape_body *b, tsuya_vec3 p)
{
    tsuya_vec3 axis = tsuya_vec3_sub(b->b, b->a), from = tsuya_vec3_sub(p, b->a);
    double length2 = tsuya_vec3_dot(axis, axis), t = length2 > 0.0 ? fmin(fmax(tsuya_vec3_dot(from, axis) / length2, 0.0), 1.0) : 0.0;
    tsuya_vec3 d = tsuya_vec3_mad(from, -t, axis);
    return (field){tsuya_vec3_norm(d) - b->radius_m, unit_or_up(d)};
}

/* Round cone: exact between two tangent spheres. */
static field form(const tsuya_drape_body *b, tsuya_vec3 p)
{
    tsuya_vec3 axis = tsuya_vec3_sub(b->b, b->a), from = tsuya_vec3_sub(p, b->a);
    double length = tsuya_vec3_norm(axis), slope = (b->radius_m - b->radius_b_m) / length;
    tsuya_vec3 z = tsuya_vec3_scale(axis, 1.0 / length);
    double along = tsuya_vec3_dot(from, z);
    tsuya_vec3 out = tsuya_vec3_mad(from, -along, z);
    double across = tsuya_vec3_norm(out), rise = sqrt(fmax(1.0 - slope * slope, 0.0));
    double at = along - across * slope / fmax(rise, 1e-9); /* of the sphere on the axis whose tangent cone passes there */
    double t = fmin(fmax(at, 0.0), length);
    tsuya_vec3 d = tsuya_vec3_mad(from, -t, z);
    return (field){tsuya_vec3_norm(d) - (b->radius_m - slope * t), unit_or_up(d)};
}

/* Outside distance of a rounded box in `n` dimensions, q = |p − centre| − half size + rounding. */
static double rounded(const double *q, int n, double round_m, double *gradient)
{
    double outside = 0.0, inside = -INFINITY;
    int most = 0;
    for (int i = 0; i < n; i++) {
        double o = fmax(q[i], 0.0);
        gradient[i] = o;
        outside += o * o;
        if (q[i] > inside) {
            inside = q[i];
            most = i;
        }
    }
    outside = sqrt(outside);
    for (int i = 0; i < n; i++) {
        gradient[i] = outside > 0.0 ? gradient[i] / outside : i == most ? 1.0 : 0.0;
    }
    return outside + fmin(inside, 0.0) - round_m;
}

static field disc(const tsuya_drape_body *b, tsuya_vec3 p)
{
    double x = p.x - b->b.x, y = p.y - b->b.y, r = hypot(x, y), middle = 0.5 * (b->a.z + b->b.z), g[2];
    double q[2] = {r - b->radius_m + b->round_m, fabs(p.z - middle) - 0.5 * fabs(b->b.z - b->a.z) + b->round_m};
    field f = {rounded(q, 2, b->round_m, g), {0, 0, 0}};
    f.gradient = (tsuya_vec3){r > 0.0 ? g[0] * x / r : 0.0, r > 0.0 ? g[0] * y / r : 0.0, p.z >= middle ? g[1] : -g[1]};
    return f;
}

static field box(const tsuya_drape_body *b, tsuya_vec3 p)
{
    const double *a = &b->a.x, *c = &b->b.x, *x = &p.x;
    double q[3], g[3];
    for (int i = 0; i < 3; i++) {
        q[i] = fabs(x[i] - 0.5 * (a[i] + c[i])) - 0.5 * fabs(c[i] - a[i]) + b->round_m;
    }
    field f = {rounded(q, 3, b->round_m, g), {0, 0, 0}};
    double *out = &f.gradient.x;
    for (int i = 0; i < 3; i++) {
        out[i] = x[i] >= 0.5 * (a[i] + c[i]) ? g[i] : -g[i];
    }
    return f;
}

double tsuya_drape_body_distance(const tsuya_drape_body *b, tsuya_vec3 p, tsuya_vec3 *gradient)
{
    field f = {p.z - b->a.z, {0, 0, 1}};
    switch (b->shape) {
    case TSUYA_DRAPE_FLOOR: break;
    case TSUYA_DRAPE_BAR: f = bar(b, p); break;
    case TSUYA_DRAPE_DISC: f = disc(b, p); break;
    case TSUYA_DRAPE_BOX: f = box(b, p); break;
    case TSUYA_DRAPE_FORM: f = form(b, p); break;
    }
    if (gradient) {
        *gradient = f.gradient;
    }
    return f.distance;
}
