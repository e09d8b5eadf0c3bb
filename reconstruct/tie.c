#include "reconstruct/tie.h"

#include "core/dense.h"
#include "core/memory.h"
#include "core/order.h"

#include <math.h>
#include <string.h>

enum { POSE = 6, GRID = 5, HALVES = 2 };
static const double FRAME[2] = {0.25, 0.75}; /* depths, as quantiles of those that the view observes */

typedef struct normal { double a[POSE * POSE], b[POSE]; } normal;

typedef struct rows { double pose[2][POSE], point[2][3], residual[2]; } rows; /* of one observation, over sigma */

/* d pixel / d point in the camera's frame, by central differences. */
static bool gradient(double g[2][3], tsuya_vec2 *pixel, const tsuya_camera *camera, tsuya_vec3 p)
{
    const double h = 1e-6 * fabs(p.z);
    const tsuya_vec3 axis[3] = {{h, 0, 0}, {0, h, 0}, {0, 0, h}};
    bool fine = tsuya_camera_project(camera, p, pixel);
    for (int k = 0; fine && k < 3; k++) {
        tsuya_vec2 more, less;
        fine = tsuya_camera_project(camera, tsuya_vec3_add(p, axis[k]), &more) && tsuya_camera_project(camera, tsuya_vec3_sub(p, axis[k]), &less);
        g[0][k] = (more.x - less.x) / (2.0 * h);
        g[1][k] = (more.y - less.y) / (2.0 * h);
    }
    return fine;
}

/* Of a small turn about the camera's centre and a shift, both in its frame. */
static void pose_row(double row[POSE], const double g[3], tsuya_vec3 p)
{
    tsuya_vec3 turn = tsuya_vec3_cross(p, (tsuya_vec3){g[0], g[1], g[2]});
    const double all[POSE] = {turn.x, turn.y, turn.z, g[0], g[1], g[2]};
    memcpy(row, all, sizeof all);
}

static bool observe(rows *r, const tsuya_sparse_model *model, const tsuya_view *view, const tsuya_observation *o, double sigma_px)
{
    double g[2][3];
    tsuya_vec2 pixel;
    tsuya_vec3 p = tsuya_pose_apply(view->camera_from_world, model->point[o->point].position);
    if (!gradient(g, &pixel, &model->camera[view->camera], p)) {
        return false;
    }
    r->residual[0] = ((double)o->x_px - pixel.x) / sigma_px;
    r->residual[1] = ((double)o->y_px - pixel.y) / sigma_px;
    for (int i = 0; i < 2; i++) {
        tsuya_vec3 world = tsuya_mat3_apply_transposed(view->camera_from_world.rotation, (tsuya_vec3){g[i][0], g[i][1], g[i][2]});
        for (int k = 0; k < 3; k++) {
            g[i][k] /= sigma_px;
        }
        pose_row(r->pose[i], g[i], p);
        r->point[i][0] = world.x / sigma_px, r->point[i][1] = world.y / sigma_px, r->point[i][2] = world.z / sigma_px;
    }
    return true;
}

/* Information on every point from all that see it, as Cholesky's factor; its first entry is 0 where they do not determine it. */
static void inform(double (*point)[9], const tsuya_sparse_model *model, const double *sigma_px)
{
    rows r;
    for (size_t i = 0; i < model->point_count; i++) {
        for (int t = 0; t < model->point[i].track_count; t++) {
            const tsuya_track_element *e = &model->point[i].track[t];
            const tsuya_view *view = &model->view[e->view];
            bool seen = observe(&r, model, view, &view->observation[e->observation], sigma_px[e->view]);
            for (int k = 0; seen && k < 9; k++) {
                point[i][k] += r.point[0][k / 3] * r.point[0][k % 3] + r.point[1][k / 3] * r.point[1][k % 3];
            }
        }
        if (!tsuya_dense_cholesky(point[i], 3)) {
            point[i][0] = 0.0;
        }
    }
}

/* Jᵀ (I − Jp H⁻¹ Jpᵀ) J: what is left of the observation once its point has followed. */
static void accumulate(normal *n, const rows *r, const double factor[9])
{
    double left[3][2], weight[2][2];
    for (int k = 0; k < 3; k++) {
        left[k][0] = r->point[0][k], left[k][1] = r->point[1][k];
    }
    tsuya_dense_forward(factor, left[0], 3, 2);
    for (int i = 0; i < 4; i++) {
        weight[i / 2][i % 2] = (i / 2 == i % 2) - left[0][i / 2] * left[0][i % 2] - left[1][i / 2] * left[1][i % 2] - left[2][i / 2] * left[2][i % 2];
    }
    for (int m = 0; m < POSE; m++) {
        double w0 = weight[0][0] * r->pose[0][m] + weight[1][0] * r->pose[1][m], w1 = weight[0][1] * r->pose[0][m] + weight[1][1] * r->pose[1][m];
        for (int k = 0; k < POSE; k++) {
            n->a[POSE * m + k] += w0 * r->pose[0][k] + w1 * r->pose[1][k];
        }
        n->b[m] += r->pose[0][m] * r->residual[0] + r->pose[1][m] * r->residual[1];
    }
}

/* Σ JᵀJ / (2 n) over a grid of the frame at two depths: turns a change of pose into pixels. */
static void frame_of(double m[POSE * POSE], const tsuya_camera *camera, double *depth, int count)
{
    int n = 0;
    memset(m, 0, POSE * POSE * sizeof *m);
    tsuya_sort_doubles(depth, (size_t)count);
    for (int i = 0; i < 2 * GRID * GRID; i++) {
        double z = depth[(int)(FRAME[i % 2] * (count - 1))], g[2][3], row[POSE];
        tsuya_vec2 at = {(i / 2 % GRID + 0.5) / GRID * camera->width_px - 0.5, (i / 2 / GRID + 0.5) / GRID * camera->height_px - 0.5};
        tsuya_vec3 ray;
        if (!tsuya_camera_unproject(camera, at, &ray) || !(ray.z > 1e-3)) {
            continue;
        }
        tsuya_vec3 p = tsuya_vec3_scale(ray, z / ray.z);
        for (int c = 0; gradient(g, &at, camera, p) && c < 2; c++, n++) {
            pose_row(row, g[c], p);
            for (int k = 0; k < POSE * POSE; k++) {
                m[k] += row[k / POSE] * row[k % POSE];
            }
        }
    }
    for (int k = 0; n > 0 && k < POSE * POSE; k++) {
        m[k] /= n;
    }
}

/* sqrt(trace(A⁻¹ M)); A is used up. */
static double by_normal(double a[POSE * POSE], const double m[POSE * POSE])
{
    double x[POSE * POSE], trace = 0.0;
    if (!tsuya_dense_cholesky(a, POSE)) {
        return INFINITY;
    }
    memcpy(x, m, sizeof x);
    tsuya_dense_forward(a, x, POSE, POSE);
    tsuya_dense_backward(a, x, POSE, POSE);
    for (int k = 0; k < POSE; k++) {
        trace += x[(POSE + 1) * k];
    }
    return sqrt(trace);
}

static double by_halves(normal half[HALVES], const double m[POSE * POSE])
{
    double sum = 0.0, d[POSE];
    for (int h = 0; h < HALVES; h++) {
        if (!tsuya_dense_cholesky(half[h].a, POSE)) {
            return INFINITY;
        }
        tsuya_dense_forward(half[h].a, half[h].b, POSE, 1);
        tsuya_dense_backward(half[h].a, half[h].b, POSE, 1);
    }
    for (int k = 0; k < POSE; k++) {
        d[k] = half[0].b[k] - half[1].b[k];
    }
    for (int k = 0; k < POSE * POSE; k++) {
        sum += d[k / POSE] * m[k] * d[k % POSE];
    }
    return 0.5 * sqrt(sum);
}

static void measure(tsuya_tie *tie, const tsuya_sparse_model *model, int v, double sigma_px, const double (*point)[9], double *depth)
{
    const tsuya_view *view = &model->view[v];
    normal half[HALVES] = {0}, whole;
    double m[POSE * POSE];
    rows r;
    *tie = (tsuya_tie){0, INFINITY, INFINITY};
    for (int k = 0; k < view->observation_count; k++) {
        const tsuya_observation *o = &view->observation[k];
        if (o->point >= 0 && point[o->point][0] > 0.0 && observe(&r, model, view, o, sigma_px)) {
            depth[tie->observations] = tsuya_pose_apply(view->camera_from_world, model->point[o->point].position).z;
            accumulate(&half[tie->observations++ % HALVES], &r, point[o->point]);
        }
    }
    if (tie->observations == 0) {
        return;
    }
    frame_of(m, &model->camera[view->camera], depth, tie->observations);
    for (int k = 0; k < POSE * POSE; k++) {
        whole.a[k] = half[0].a[k] + half[1].a[k];
    }
    tie->normal_px = by_normal(whole.a, m);
    tie->halves_px = by_halves(half, m);
}

tsuya_status tsuya_ties_measure(tsuya_tie *tie, const tsuya_sparse_model *model, const double *sigma_px)
{
    tsuya_status status = TSUYA_OK;
    double (*point)[9] = NULL, *depth = NULL;
    int most = 0;
    for (int v = 0; v < model->view_count; v++) {
        most = model->view[v].observation_count > most ? model->view[v].observation_count : most;
    }
    TSUYA_NEW(status, point, model->point_count + 1);
    TSUYA_NEW(status, depth, (size_t)most + 1);
    inform(point, model, sigma_px);
    for (int v = 0; v < model->view_count; v++) {
        measure(&tie[v], model, v, sigma_px[v], (const double (*)[9])point, depth);
    }
done:
    tsuya_free(point);
    tsuya_free(depth);
    return status;
}

/* ---- leaving out ---- */

/* New index of every view, or −1. */
static void close_up_views(int *index, tsuya_sparse_model *model, const bool *drop)
{
    int kept = 0;
    for (int v = 0; v < model->view_count; v++) {
        index[v] = drop[v] ? -1 : kept;
        if (drop[v]) {
            tsuya_free(model->view[v].name);
            tsuya_free(model->view[v].observation);
        } else {
            model->view[kept++] = model->view[v];
        }
    }
    model->view_count = kept;
}

tsuya_status tsuya_views_drop(tsuya_sparse_model *model, const bool *drop)
{
    tsuya_status status = TSUYA_OK;
    int *index;
    size_t kept = 0;
    TSUYA_NEW(status, index, (size_t)model->view_count + 1);
    close_up_views(index, model, drop);
    for (size_t i = 0; i < model->point_count; i++) {
        tsuya_point *p = &model->point[i];
        int count = 0;
        for (int t = 0; t < p->track_count; t++) {
            if (index[p->track[t].view] >= 0) {
                p->track[count++] = (tsuya_track_element){index[p->track[t].view], p->track[t].observation};
            }
        }
        p->track_count = count;
        for (int t = 0; t < count; t++) {
            model->view[p->track[t].view].observation[p->track[t].observation].point = count >= 2 ? (int64_t)kept : -1;
        }
        if (count >= 2) {
            model->point[kept++] = *p;
        } else {
            tsuya_free(p->track);
        }
    }
    model->point_count = kept;
done:
    tsuya_free(index);
    return status;
}
