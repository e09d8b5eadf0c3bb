#include "calib/projection.h"

#include "calib/mrcal_adapter.h"
#include "core/memory.h"
#include "core/order.h"

#include <string.h>

enum { MOTION = 6, ITERATIONS = 20 };

tsuya_status tsuya_projection_map_create(tsuya_projection_map *map, int cols, int rows)
{
    tsuya_status status = TSUYA_OK;
    *map = (tsuya_projection_map){.cols = cols, .rows = rows};
    TSUYA_NEW(status, map->value, (size_t)cols * (size_t)rows);
    TSUYA_NEW(status, map->covered, (size_t)cols * (size_t)rows);
    memset(map->covered, true, (size_t)cols * (size_t)rows * sizeof *map->covered);
done:
    if (status != TSUYA_OK) {
        tsuya_projection_map_free(map);
    }
    return status;
}

void tsuya_projection_map_free(tsuya_projection_map *map)
{
    tsuya_free(map->value);
    tsuya_free(map->covered);
    *map = (tsuya_projection_map){0};
}

tsuya_vec2 tsuya_projection_pixel(const tsuya_projection_map *map, const tsuya_camera *camera, int cell)
{
    return (tsuya_vec2){(double)(cell % map->cols) * (camera->width_px - 1) / (map->cols - 1),
                        (double)(cell / map->cols) * (camera->height_px - 1) / (map->rows - 1)};
}

static int nearest(double at, int side_px, int n)
{
    int i = (int)rint(at * (n - 1.0) / (side_px - 1));
    return i < 0 ? 0 : i < n ? i : n - 1;
}

int tsuya_projection_cell(const tsuya_projection_map *map, const tsuya_camera *camera, tsuya_vec2 pixel)
{
    return nearest(pixel.y, camera->height_px, map->rows) * map->cols + nearest(pixel.x, camera->width_px, map->cols);
}

/* The cells within one and a half of a pixel. */
static void mark(tsuya_projection_map *map, int width_px, int height_px, double x_px, double y_px)
{
    double x = x_px * (map->cols - 1.0) / (width_px - 1), y = y_px * (map->rows - 1.0) / (height_px - 1);
    for (int j = (int)ceil(y - 1.5); j <= y + 1.5; j++) {
        for (int i = (int)ceil(x - 1.5); i <= x + 1.5; i++) {
            if (i >= 0 && j >= 0 && i < map->cols && j < map->rows) {
                map->covered[j * map->cols + i] = true;
            }
        }
    }
}

void tsuya_projection_cover(tsuya_projection_map *map, const tsuya_solve *solve)
{
    memset(map->covered, false, (size_t)map->cols * (size_t)map->rows * sizeof *map->covered);
    for (int k = 0; k < solve->observation_count; k++) {
        const tsuya_solve_observation *o = &solve->observation[k];
        if (!o->outlier) {
            mark(map, solve->camera.width_px, solve->camera.height_px, o->pixel.x, o->pixel.y);
        }
    }
}

void tsuya_projection_cover_corners(tsuya_projection_map *map, const tsuya_corner_set *corners, int width_px, int height_px)
{
    memset(map->covered, false, (size_t)map->cols * (size_t)map->rows * sizeof *map->covered);
    for (int k = 0; k < corners->count; k++) {
        mark(map, width_px, height_px, corners->corner[k].x_px, corners->corner[k].y_px);
    }
}

void tsuya_projection_cover_middle(tsuya_projection_map *map, int width_px, int height_px)
{
    const tsuya_camera frame = {.width_px = width_px, .height_px = height_px};
    double reach = fmin(width_px, height_px) / 3.0;
    for (int cell = 0; cell < map->cols * map->rows; cell++) {
        tsuya_vec2 q = tsuya_projection_pixel(map, &frame, cell);
        map->covered[cell] = hypot(q.x - 0.5 * (width_px - 1), q.y - 0.5 * (height_px - 1)) <= reach;
    }
}

/* Gradient of a pixel by a small motion (rotation vector, translation) of the point. */
static void by_motion(double a[2][MOTION], const double by_point[6], tsuya_vec3 p)
{
    for (int r = 0; r < 2; r++) {
        const double *g = by_point + 3 * r;
        a[r][0] = g[2] * p.y - g[1] * p.z;
        a[r][1] = g[0] * p.z - g[2] * p.x;
        a[r][2] = g[1] * p.x - g[0] * p.y;
        a[r][3] = g[0];
        a[r][4] = g[1];
        a[r][5] = g[2];
    }
}

/* Solves the leading n × n of a symmetric system for m right sides in place; false where singular. */
static bool solve_symmetric(double a[MOTION][MOTION], double *right, int n, int m)
{
    for (int c = 0; c < n; c++) {
        double diagonal = a[c][c];
        for (int k = 0; k < c; k++) {
            diagonal -= a[c][k] * a[c][k];
        }
        if (!(diagonal > 1e-12 * a[c][c])) {
            return false;
        }
        a[c][c] = sqrt(diagonal);
        for (int r = c + 1; r < n; r++) {
            for (int k = 0; k < c; k++) {
                a[r][c] -= a[r][k] * a[c][k];
            }
            a[r][c] /= a[c][c];
        }
    }
    for (int j = 0; j < m; j++) {
        for (int r = 0; r < n; r++) {
            for (int k = 0; k < r; k++) {
                right[r * m + j] -= a[r][k] * right[k * m + j];
            }
            right[r * m + j] /= a[r][r];
        }
        for (int r = n - 1; r >= 0; r--) {
            for (int k = r + 1; k < n; k++) {
                right[r * m + j] -= a[k][r] * right[k * m + j];
            }
            right[r * m + j] /= a[r][r];
        }
    }
    return true;
}

/* The point that a cell of camera `a` looks at: unit distance stands for infinity. */
static bool cell_point(tsuya_vec3 *p, const tsuya_projection_map *map, const tsuya_camera *a, int cell, double distance_m)
{
    tsuya_vec3 ray;
    if (!tsuya_camera_unproject(a, tsuya_projection_pixel(map, a, cell), &ray)) {
        return false;
    }
    *p = tsuya_vec3_scale(ray, isfinite(distance_m) ? distance_m : 1.0);
    return true;
}

/* One Gauss–Newton step of the motion; returns its length, or a negative number where it is undetermined. */
static double motion_step(tsuya_pose *motion, const tsuya_projection_map *map, const tsuya_camera *a, const tsuya_camera *b, double distance_m)
{
    double h[MOTION][MOTION] = {{0}}, g[MOTION] = {0};
    int n = isfinite(distance_m) ? MOTION : 3;
    for (int cell = 0; cell < map->cols * map->rows; cell++) {
        tsuya_vec3 p;
        tsuya_vec2 q, want = tsuya_projection_pixel(map, a, cell);
        double by_point[6], j[2][MOTION];
        if (!map->covered[cell] || !cell_point(&p, map, a, cell, distance_m)) {
            continue;
        }
        tsuya_vec3 moved = tsuya_pose_apply(*motion, p);
        if (!tsuya_mrcal_project(&q, by_point, NULL, b, moved)) {
            continue;
        }
        by_motion(j, by_point, moved);
        double r[2] = {want.x - q.x, want.y - q.y};
        for (int i = 0; i < n; i++) {
            g[i] += j[0][i] * r[0] + j[1][i] * r[1];
            for (int k = 0; k < n; k++) {
                h[i][k] += j[0][i] * j[0][k] + j[1][i] * j[1][k];
            }
        }
    }
    if (!solve_symmetric(h, g, n, 1)) {
        return -1.0;
    }
    tsuya_pose small = {tsuya_mat3_from_rodrigues((tsuya_vec3){g[0], g[1], g[2]}), {g[3] * (n > 3), g[4] * (n > 3), g[5] * (n > 3)}};
    *motion = tsuya_pose_compose(small, *motion);
    return fabs(g[0]) + fabs(g[1]) + fabs(g[2]) + (n > 3 ? (fabs(g[3]) + fabs(g[4]) + fabs(g[5])) / distance_m : 0.0);
}

tsuya_status tsuya_projection_difference(tsuya_projection_map *map, tsuya_pose *b_from_a, const tsuya_camera *a, const tsuya_camera *b, double distance_m)
{
    tsuya_pose motion = tsuya_pose_identity();
    double moved = 1.0;
    if (a->width_px != b->width_px || a->height_px != b->height_px) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "the cameras' images are %d x %d and %d x %d px; one size is expected", a->width_px, a->height_px,
                          b->width_px, b->height_px);
    }
    for (int i = 0; i < ITERATIONS && moved > 1e-12; i++) {
        moved = motion_step(&motion, map, a, b, distance_m);
        if (moved < 0.0) {
            return tsuya_fail(TSUYA_ERROR_NUMERIC, "the two cameras cannot be aligned: too little of the image is covered");
        }
    }
    for (int cell = 0; cell < map->cols * map->rows; cell++) {
        tsuya_vec3 p;
        tsuya_vec2 q, want = tsuya_projection_pixel(map, a, cell);
        map->value[cell] = NAN;
        if (cell_point(&p, map, a, cell, distance_m) && tsuya_camera_project(b, tsuya_pose_apply(motion, p), &q)) {
            map->value[cell] = hypot(q.x - want.x, q.y - want.y);
        }
    }
    if (b_from_a) {
        *b_from_a = motion;
    }
    return TSUYA_OK;
}

/* Gradients at a cell: by the intrinsics (2 × n) and by the motion (2 × 6). */
static bool cell_gradients(double by_intrinsics[2 * TSUYA_INTRINSICS_MOST], double motion[2][MOTION], const tsuya_projection_map *map,
                           const tsuya_camera *camera, int cell, double distance_m)
{
    tsuya_vec3 p;
    tsuya_vec2 q;
    double by_point[6];
    if (!cell_point(&p, map, camera, cell, distance_m) || !tsuya_mrcal_project(&q, by_point, by_intrinsics, camera, p)) {
        return false;
    }
    by_motion(motion, by_point, p);
    return true;
}

/* What the motion does for a unit change of each intrinsic: M (6 × n). */
static bool compensation(double *m, const tsuya_projection_map *map, const tsuya_camera *camera, double distance_m, int n)
{
    double h[MOTION][MOTION] = {{0}};
    int free_motions = isfinite(distance_m) ? MOTION : 3;
    memset(m, 0, MOTION * (size_t)n * sizeof *m);
    for (int cell = 0; cell < map->cols * map->rows; cell++) {
        double b[2 * TSUYA_INTRINSICS_MOST], a[2][MOTION];
        if (!map->covered[cell] || !cell_gradients(b, a, map, camera, cell, distance_m)) {
            continue;
        }
        for (int r = 0; r < 2; r++) {
            for (int i = 0; i < free_motions; i++) {
                for (int k = 0; k < n; k++) {
                    m[i * n + k] -= a[r][i] * b[r * n + k];
                }
                for (int k = 0; k < free_motions; k++) {
                    h[i][k] += a[r][i] * a[r][k];
                }
            }
        }
    }
    return solve_symmetric(h, m, free_motions, n);
}

/* √λ₁ of d C dᵀ (d: 2 × n). */
static double worst_sigma(const double *d, const double *covariance, int n)
{
    double s[3] = {0};
    for (int i = 0; i < n; i++) {
        double x = 0.0, y = 0.0;
        for (int k = 0; k < n; k++) {
            x += covariance[i * n + k] * d[k];
            y += covariance[i * n + k] * d[n + k];
        }
        s[0] += d[i] * x;
        s[1] += d[i] * y;
        s[2] += d[n + i] * y;
    }
    double middle = 0.5 * (s[0] + s[2]), half = 0.5 * (s[0] - s[2]);
    return sqrt(fmax(middle + hypot(half, s[1]), 0.0));
}

tsuya_status tsuya_projection_uncertainty(tsuya_projection_map *map, const tsuya_camera *camera, const double *covariance, double distance_m)
{
    double m[MOTION * TSUYA_INTRINSICS_MOST];
    int n = tsuya_lens_parameters(camera);
    if (!compensation(m, map, camera, distance_m, n)) {
        return tsuya_fail(TSUYA_ERROR_NUMERIC, "too little of the image is covered to state an uncertainty");
    }
    for (int cell = 0; cell < map->cols * map->rows; cell++) {
        double d[2 * TSUYA_INTRINSICS_MOST], a[2][MOTION];
        map->value[cell] = NAN;
        if (!cell_gradients(d, a, map, camera, cell, distance_m)) {
            continue;
        }
        for (int r = 0; r < 2; r++) {
            for (int k = 0; k < n; k++) {
                for (int i = 0; i < MOTION; i++) {
                    d[r * n + k] += a[r][i] * m[i * n + k];
                }
            }
        }
        map->value[cell] = worst_sigma(d, covariance, n);
    }
    return TSUYA_OK;
}

/* Of a splined lens: how pixels grow with the angle along x at its axis. */
double tsuya_projection_focal(double *sigma_px, const tsuya_camera *camera, const double *covariance)
{
    static const double angle = 1e-3;
    int n = tsuya_lens_parameters(camera);
    double by[2][2 * TSUYA_INTRINSICS_MOST], by_point[6], variance = 0.0;
    tsuya_vec2 q[2] = {{0}};
    if (camera->lens != TSUYA_LENS_SPLINED_STEREOGRAPHIC) {
        *sigma_px = sqrt(covariance[0]);
        return camera->fx_px;
    }
    for (int k = 0; k < 2; k++) {
        (void)tsuya_mrcal_project(&q[k], by_point, by[k], camera, (tsuya_vec3){k ? sin(angle) : -sin(angle), 0.0, cos(angle)});
    }
    for (int i = 0; i < n; i++) {
        for (int k = 0; k < n; k++) {
            variance += (by[1][i] - by[0][i]) * covariance[i * n + k] * (by[1][k] - by[0][k]);
        }
    }
    *sigma_px = sqrt(variance) / (2.0 * angle);
    return (q[1].x - q[0].x) / (2.0 * angle);
}

tsuya_status tsuya_projection_summary(tsuya_projection_stats *stats, const tsuya_projection_map *map)
{
    int cells = map->cols * map->rows, n = 0;
    double *value = tsuya_calloc((size_t)cells, sizeof *value), sum = 0.0;
    *stats = (tsuya_projection_stats){NAN, NAN, NAN};
    if (!value) {
        return TSUYA_ERROR_MEMORY;
    }
    for (int i = 0; i < cells; i++) {
        if (map->covered[i] && isfinite(map->value[i])) {
            sum += map->value[i];
            value[n++] = map->value[i];
        }
    }
    if (n) {
        tsuya_sort_doubles(value, (size_t)n);
        *stats = (tsuya_projection_stats){sum / n, value[(size_t)(0.9 * (n - 1))], value[n - 1]};
    }
    tsuya_free(value);
    return TSUYA_OK;
}

double tsuya_projection_center(const tsuya_projection_map *map) { return map->value[map->rows / 2 * map->cols + map->cols / 2]; }

double tsuya_projection_corner(int *which, const tsuya_projection_map *map)
{
    const int cell[4] = {0, map->cols - 1, (map->rows - 1) * map->cols, map->rows * map->cols - 1};
    double worst = -1.0;
    *which = 0;
    for (int i = 0; i < 4; i++) {
        double v = map->value[cell[i]];
        if (!isfinite(v) || v > worst) {
            worst = isfinite(v) ? v : INFINITY;
            *which = i;
        }
    }
    return isfinite(worst) ? worst : NAN;
}
