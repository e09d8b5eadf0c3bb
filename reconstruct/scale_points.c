#include "reconstruct/scale_points.h"

#include "core/memory.h"
#include "core/order.h"

#include <string.h>

enum { PAIRS_VIEWS = 16, STEPS = 8, ROUNDS = 3 };

static const double GATE_SIGMAS = 4.0, GATE_PX = 2.0, LEAST_ANGLE_RAD = 0.0087; /* half a degree */

/* A sighting as a ray. */
typedef struct ray {
    tsuya_pose pose;         /* camera_from_world */
    tsuya_vec3 center, direction; /* in the world */
    double u, v, focal;      /* on the plane z = 1, and pixels per unit of it */
    double sigma_px;         /* the corner's own */
    int view, point;
    bool used;
} ray;

typedef struct work {
    ray *ray;
    int count;
    double camera_sigma_px; /* what the cameras leave */
} work;

bool tsuya_scale_invert(tsuya_mat3 *inverse, tsuya_mat3 a)
{
    double d = tsuya_mat3_determinant(a), trace = a.e[0][0] + a.e[1][1] + a.e[2][2];
    if (!(trace > 0.0) || !(d > 1e-18 * trace * trace * trace)) {
        return false;
    }
    for (int i = 0; i < 3; i++) {
        for (int j = 0; j < 3; j++) {
            int i1 = (i + 1) % 3, i2 = (i + 2) % 3, j1 = (j + 1) % 3, j2 = (j + 2) % 3;
            inverse->e[j][i] = (a.e[i1][j1] * a.e[i2][j2] - a.e[i1][j2] * a.e[i2][j1]) / d;
        }
    }
    return true;
}

static bool residual(double r[2], const ray *k, tsuya_vec3 p)
{
    tsuya_vec3 c = tsuya_pose_apply(k->pose, p);
    if (!(c.z > 0.0)) {
        return false;
    }
    r[0] = k->focal * (k->u - c.x / c.z);
    r[1] = k->focal * (k->v - c.y / c.z);
    return true;
}

static double gate(const work *w, const ray *k)
{
    return fmax(GATE_SIGMAS * hypot(k->sigma_px, w->camera_sigma_px), w->camera_sigma_px > 0.0 ? 0.0 : GATE_PX);
}

/* The point nearest to two rays. */
static bool meet(tsuya_vec3 *p, const ray *a, const ray *b)
{
    double c = tsuya_vec3_dot(a->direction, b->direction), det = 1.0 - c * c;
    if (det < LEAST_ANGLE_RAD * LEAST_ANGLE_RAD) {
        return false;
    }
    tsuya_vec3 d = tsuya_vec3_sub(b->center, a->center);
    double da = tsuya_vec3_dot(d, a->direction), db = tsuya_vec3_dot(d, b->direction);
    double s = (da - c * db) / det, t = (c * da - db) / det;
    tsuya_vec3 pa = tsuya_vec3_mad(a->center, s, a->direction), pb = tsuya_vec3_mad(b->center, t, b->direction);
    *p = tsuya_vec3_scale(tsuya_vec3_add(pa, pb), 0.5);
    return s > 0.0 && t > 0.0;
}

/* Share of the error that is not outlying, summed; smaller is better. */
static double cost(const work *w, const ray *k, int n, tsuya_vec3 p)
{
    double sum = 0.0, r[2];
    for (int i = 0; i < n; i++) {
        double g = gate(w, &k[i]);
        sum += residual(r, &k[i], p) ? fmin(1.0, (r[0] * r[0] + r[1] * r[1]) / (g * g)) : 1.0;
    }
    return sum;
}

static bool best_pair(tsuya_vec3 *best, const work *w, const ray *k, int n)
{
    double least = INFINITY;
    int step = 1 + (n - 1) / PAIRS_VIEWS;
    for (int i = 0; i < n; i += step) {
        for (int j = i + step; j < n; j += step) {
            tsuya_vec3 p;
            double c = meet(&p, &k[i], &k[j]) ? cost(w, k, n, p) : INFINITY;
            if (c < least) {
                least = c;
                *best = p;
            }
        }
    }
    return isfinite(least);
}

static void accumulate(tsuya_mat3 *a, tsuya_vec3 *b, const work *w, const ray *k, tsuya_vec3 p)
{
    double r[2], s2 = k->sigma_px * k->sigma_px + w->camera_sigma_px * w->camera_sigma_px;
    if (!residual(r, k, p)) {
        return;
    }
    tsuya_vec3 c = tsuya_pose_apply(k->pose, p);
    tsuya_vec3 row[2] = {{k->focal / c.z, 0, -k->focal * c.x / (c.z * c.z)}, {0, k->focal / c.z, -k->focal * c.y / (c.z * c.z)}};
    for (int i = 0; i < 2; i++) {
        tsuya_vec3 j = tsuya_mat3_apply_transposed(k->pose.rotation, row[i]);
        double v[3] = {j.x, j.y, j.z};
        for (int m = 0; m < 3; m++) {
            for (int n = 0; n < 3; n++) {
                a->e[m][n] += v[m] * v[n] / s2;
            }
        }
        *b = tsuya_vec3_mad(*b, r[i] / s2, j);
    }
}

static bool refine(tsuya_scale_point *point, const work *w, const ray *k, int n)
{
    for (int step = 0; step < STEPS; step++) {
        tsuya_mat3 a = {{{0}}};
        tsuya_vec3 b = {0, 0, 0};
        for (int i = 0; i < n; i++) {
            if (k[i].used) {
                accumulate(&a, &b, w, &k[i], point->position);
            }
        }
        if (!tsuya_scale_invert(&point->covariance, a)) {
            return false;
        }
        point->position = tsuya_vec3_add(point->position, tsuya_mat3_apply(point->covariance, b));
    }
    return isfinite(point->position.x + point->position.y + point->position.z);
}

static void find_point(tsuya_scale_point *point, work *w, ray *k, int n)
{
    double r[2], widest = 0.0;
    *point = (tsuya_scale_point){.sighted = n};
    if (!best_pair(&point->position, w, k, n)) {
        return;
    }
    for (int round = 0; round < 2; round++) {
        int first = -1;
        point->views = 0;
        widest = 0.0;
        for (int i = 0; i < n; i++) {
            k[i].used = residual(r, &k[i], point->position) && hypot(r[0], r[1]) < gate(w, &k[i]);
            if (k[i].used) {
                point->views++;
                first = first < 0 ? i : first;
                widest = fmax(widest, tsuya_vec3_norm(tsuya_vec3_cross(k[first].direction, k[i].direction)));
            }
        }
        if (point->views < 2 || widest < LEAST_ANGLE_RAD || !refine(point, w, k, n)) {
            return;
        }
    }
    point->found = true;
}

/* What residuals show beyond the corners' own sigmas: the medians of |residual| over all views of points seen three times and
 * more (two rays meet whatever the cameras do). */
static tsuya_status find_camera_sigma(tsuya_scale_points *points, work *w)
{
    double *size = tsuya_calloc(2 * (size_t)w->count, sizeof *size), sum = 0.0, r[2], own = 0.0;
    int n = 0, all = 0;
    if (!size) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int i = 0; i < w->count; i++) {
        const ray *k = &w->ray[i];
        const tsuya_scale_point *p = &points->point[k->point];
        if (!p->found || !k->used || !residual(r, k, p->position)) {
            continue;
        }
        sum += r[0] * r[0] + r[1] * r[1];
        all += 2;
        if (p->views >= 3) {
            double freedom = sqrt(2.0 * p->views / (2.0 * p->views - 3.0));
            size[n++] = fabs(r[0]) * freedom;
            size[n++] = fabs(r[1]) * freedom;
            own += 2.0 * k->sigma_px * k->sigma_px;
        }
    }
    points->reprojection_px = all ? sqrt(sum / all) : NAN;
    if (n) {
        tsuya_sort_doubles(size, (size_t)n);
        double seen = 1.4826 * size[n / 2];
        w->camera_sigma_px = sqrt(fmax(seen * seen - own / n, 1e-6));
    } else {
        w->camera_sigma_px = 0.5;
    }
    tsuya_free(size);
    return TSUYA_OK;
}

static bool make_ray(ray *k, const tsuya_sparse_model *model, const tsuya_scale_sighting *s)
{
    int v = tsuya_sparse_model_find(model, s->photo);
    tsuya_vec3 d;
    if (v < 0) {
        return false;
    }
    const tsuya_view *view = &model->view[v];
    const tsuya_camera *camera = &model->camera[view->camera];
    if (!tsuya_camera_unproject(camera, s->pixel, &d) || !(d.z > 1e-3)) {
        return false;
    }
    *k = (ray){.pose = view->camera_from_world, .center = tsuya_pose_center(view->camera_from_world), .u = d.x / d.z, .v = d.y / d.z,
               .focal = sqrt(camera->fx_px * camera->fy_px), .sigma_px = s->sigma_px, .view = v, .point = s->point};
    k->direction = tsuya_mat3_apply_transposed(view->camera_from_world.rotation, d);
    return true;
}

/* Rays stand point by point, as the sightings do. */
static void find_all(tsuya_scale_points *points, work *w)
{
    for (int i = 0; i < w->count;) {
        int n = 1;
        while (i + n < w->count && w->ray[i + n].point == w->ray[i].point) {
            n++;
        }
        find_point(&points->point[w->ray[i].point], w, &w->ray[i], n);
        i += n;
    }
}

tsuya_status tsuya_scale_points_create(tsuya_scale_points *points, int count, const tsuya_sparse_model *model, const tsuya_scale_input *input)
{
    work w = {0};
    bool *seen = NULL;
    tsuya_status status = TSUYA_OK;
    *points = (tsuya_scale_points){.count = count};
    TSUYA_NEW(status, points->point, (size_t)count);
    TSUYA_NEW(status, w.ray, (size_t)input->sighting_count);
    TSUYA_NEW(status, seen, (size_t)model->view_count);
    for (int i = 0; i < input->sighting_count; i++) {
        if (make_ray(&w.ray[w.count], model, &input->sighting[i])) {
            points->photos += !seen[w.ray[w.count].view];
            seen[w.ray[w.count++].view] = true;
        }
    }
    for (int round = 0; round < ROUNDS; round++) {
        find_all(points, &w);
        TSUYA_GOTO_DONE(status, find_camera_sigma(points, &w));
    }
done:
    tsuya_free(w.ray);
    tsuya_free(seen);
    if (status != TSUYA_OK) {
        tsuya_scale_points_free(points);
    }
    return status;
}

void tsuya_scale_points_free(tsuya_scale_points *points)
{
    tsuya_free(points->point);
    *points = (tsuya_scale_points){0};
}
