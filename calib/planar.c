#include "calib/planar.h"

#include <string.h>

/* Mean and scale that bring points to unit spread. */
static void normalise(double t[3], const tsuya_vec2 *p, int n)
{
    double x = 0, y = 0, spread = 0;
    for (int i = 0; i < n; i++) {
        x += p[i].x / n;
        y += p[i].y / n;
    }
    for (int i = 0; i < n; i++) {
        spread += hypot(p[i].x - x, p[i].y - y) / n;
    }
    t[0] = x;
    t[1] = y;
    t[2] = spread > 0.0 ? M_SQRT2 / spread : 0.0;
}

static void add_row(double a[8][9], const double row[9])
{
    for (int i = 0; i < 8; i++) {
        for (int k = 0; k < 9; k++) {
            a[i][k] += row[i] * row[k];
        }
    }
}

/* Gauss with pivots on the normal equations; false where singular. */
static bool solve8(double a[8][9])
{
    for (int c = 0; c < 8; c++) {
        int pivot = c;
        for (int r = c + 1; r < 8; r++) {
            pivot = fabs(a[r][c]) > fabs(a[pivot][c]) ? r : pivot;
        }
        if (!(fabs(a[pivot][c]) > 1e-10)) {
            return false;
        }
        double swap[9];
        memcpy(swap, a[c], sizeof swap);
        memcpy(a[c], a[pivot], sizeof swap);
        memcpy(a[pivot], swap, sizeof swap);
        for (int r = 0; r < 8; r++) {
            double factor = r == c ? 0.0 : a[r][c] / a[c][c];
            for (int k = c; k < 9; k++) {
                a[r][k] -= factor * a[c][k];
            }
        }
    }
    return true;
}

bool tsuya_homography_fit(tsuya_mat3 *h, const tsuya_vec2 *plane, const tsuya_vec2 *image, int n)
{
    double s[3], t[3], a[8][9] = {{0}};
    normalise(s, plane, n);
    normalise(t, image, n);
    if (n < 4 || s[2] == 0.0 || t[2] == 0.0) {
        return false;
    }
    for (int i = 0; i < n; i++) {
        double x = s[2] * (plane[i].x - s[0]), y = s[2] * (plane[i].y - s[1]);
        double u = t[2] * (image[i].x - t[0]), v = t[2] * (image[i].y - t[1]);
        add_row(a, (double[9]){x, y, 1, 0, 0, 0, -u * x, -u * y, u});
        add_row(a, (double[9]){0, 0, 0, x, y, 1, -v * x, -v * y, v});
    }
    if (!solve8(a)) {
        return false;
    }
    double q[9];
    for (int i = 0; i < 8; i++) {
        q[i] = a[i][8] / a[i][i];
    }
    q[8] = 1.0;
    tsuya_mat3 core = {{{q[0], q[1], q[2]}, {q[3], q[4], q[5]}, {q[6], q[7], q[8]}}};
    tsuya_mat3 from_plane = {{{s[2], 0, -s[2] * s[0]}, {0, s[2], -s[2] * s[1]}, {0, 0, 1}}};
    tsuya_mat3 to_image = {{{1.0 / t[2], 0, t[0]}, {0, 1.0 / t[2], t[1]}, {0, 0, 1}}};
    *h = tsuya_mat3_multiply(to_image, tsuya_mat3_multiply(core, from_plane));
    return true;
}

tsuya_vec2 tsuya_homography_apply(tsuya_mat3 h, tsuya_vec2 p)
{
    tsuya_vec3 q = tsuya_mat3_apply(h, (tsuya_vec3){p.x, p.y, 1.0});
    return (tsuya_vec2){q.x / q.z, q.y / q.z};
}

double tsuya_homography_focal(double *certainty, const tsuya_mat3 *h, const double *weight, int n, double cx_px, double cy_px)
{
    double aa = 0.0, ab = 0.0;
    for (int i = 0; i < n; i++) {
        tsuya_vec3 c[2];
        double norm[2];
        for (int k = 0; k < 2; k++) {
            double z = h[i].e[2][k];
            c[k] = (tsuya_vec3){h[i].e[0][k] - cx_px * z, h[i].e[1][k] - cy_px * z, z};
            norm[k] = hypot(c[k].x, c[k].y);
        }
        if (!(norm[0] > 0.0) || !(norm[1] > 0.0)) {
            continue;
        }
        /* With w = f²: (x₁x₂ + y₁y₂) + w z₁z₂ = 0, and the same for the difference of the squares; scaled to image size. */
        double scale = cx_px + cy_px, inner = 1.0 / (norm[0] * norm[1]);
        double b[2] = {(c[0].x * c[1].x + c[0].y * c[1].y) * inner, (norm[0] * norm[0] - norm[1] * norm[1]) * inner};
        double a[2] = {scale * scale * c[0].z * c[1].z * inner, scale * scale * (c[0].z * c[0].z - c[1].z * c[1].z) * inner};
        for (int k = 0; k < 2; k++) {
            aa += weight[i] * a[k] * a[k];
            ab -= weight[i] * a[k] * b[k];
        }
    }
    *certainty = aa;
    return aa > 0.0 && ab > 0.0 ? (cx_px + cy_px) * sqrt(ab / aa) : 0.0;
}

bool tsuya_homography_pose(tsuya_pose *pose, tsuya_mat3 h, double focal_px, double cx_px, double cy_px)
{
    tsuya_vec3 c[3];
    for (int k = 0; k < 3; k++) {
        double z = h.e[2][k];
        c[k] = (tsuya_vec3){(h.e[0][k] - cx_px * z) / focal_px, (h.e[1][k] - cy_px * z) / focal_px, z};
    }
    double scale = 2.0 / (tsuya_vec3_norm(c[0]) + tsuya_vec3_norm(c[1]));
    scale = c[2].z < 0.0 ? -scale : scale;
    if (!isfinite(scale)) {
        return false;
    }
    tsuya_vec3 x = tsuya_vec3_scale(c[0], scale), y = tsuya_vec3_scale(c[1], scale), z = tsuya_vec3_cross(x, y);
    tsuya_mat3 m = {{{x.x, y.x, z.x}, {x.y, y.y, z.y}, {x.z, y.z, z.z}}}, u, v;
    double values[3];
    tsuya_mat3_svd(m, &u, values, &v);
    pose->rotation = tsuya_mat3_multiply(u, tsuya_mat3_transpose(v));
    pose->translation = tsuya_vec3_scale(c[2], scale);
    return tsuya_mat3_determinant(pose->rotation) > 0.0 && isfinite(pose->translation.z);
}
