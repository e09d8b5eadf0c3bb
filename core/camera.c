#include "core/camera.h"

#include "core/camera_spline.h"

#include <string.h>

/* Distorted normalised coordinates and their Jacobian (OpenCV calib3d, "Detailed Description"). */
static void distort(const double k[12], double x, double y, double out[2], double jacobian[2][2])
{
    double r2 = x * x + y * y, r4 = r2 * r2;
    double numerator = 1 + r2 * (k[0] + r2 * (k[1] + r2 * k[4]));
    double denominator = 1 + r2 * (k[5] + r2 * (k[6] + r2 * k[7]));
    double radial = numerator / denominator;
    out[0] = x * radial + 2 * k[2] * x * y + k[3] * (r2 + 2 * x * x) + k[8] * r2 + k[9] * r4;
    out[1] = y * radial + k[2] * (r2 + 2 * y * y) + 2 * k[3] * x * y + k[10] * r2 + k[11] * r4;
    if (!jacobian) {
        return;
    }
    double numerator_d = k[0] + r2 * (2 * k[1] + 3 * r2 * k[4]); /* by r² */
    double denominator_d = k[5] + r2 * (2 * k[6] + 3 * r2 * k[7]);
    double radial_d = (numerator_d - radial * denominator_d) / denominator;
    jacobian[0][0] = radial + 2 * x * x * radial_d + 2 * k[2] * y + 6 * k[3] * x + 2 * x * (k[8] + 2 * k[9] * r2);
    jacobian[0][1] = 2 * x * y * radial_d + 2 * k[2] * x + 2 * k[3] * y + 2 * y * (k[8] + 2 * k[9] * r2);
    jacobian[1][0] = 2 * x * y * radial_d + 2 * k[2] * x + 2 * k[3] * y + 2 * x * (k[10] + 2 * k[11] * r2);
    jacobian[1][1] = radial + 2 * y * y * radial_d + 6 * k[2] * y + 2 * k[3] * x + 2 * y * (k[10] + 2 * k[11] * r2);
}

bool tsuya_camera_project(const tsuya_camera *camera, tsuya_vec3 p, tsuya_vec2 *pixel)
{
    *pixel = (tsuya_vec2){0, 0};
    if (!(p.z > 0.0)) {
        return false;
    }
    if (camera->lens == TSUYA_LENS_SPLINED_STEREOGRAPHIC) {
        return tsuya_camera_spline_project(camera, p, pixel);
    }
    double d[2];
    distort(camera->distortion, p.x / p.z, p.y / p.z, d, NULL);
    pixel->x = camera->fx_px * d[0] + camera->cx_px;
    pixel->y = camera->fy_px * d[1] + camera->cy_px;
    return isfinite(pixel->x) && isfinite(pixel->y);
}

bool tsuya_camera_unproject(const tsuya_camera *camera, tsuya_vec2 pixel, tsuya_vec3 *ray)
{
    if (camera->lens == TSUYA_LENS_SPLINED_STEREOGRAPHIC) {
        return tsuya_camera_spline_unproject(camera, pixel, ray);
    }
    double u = (pixel.x - camera->cx_px) / camera->fx_px, v = (pixel.y - camera->cy_px) / camera->fy_px;
    double x = u, y = v, tolerance = 1e-14 * (1 + fabs(u) + fabs(v));
    bool found = false;
    for (int i = 0; i < 50 && !found; i++) {
        double d[2], j[2][2];
        distort(camera->distortion, x, y, d, j);
        double ex = d[0] - u, ey = d[1] - v, determinant = j[0][0] * j[1][1] - j[0][1] * j[1][0];
        if (!(determinant > 1e-9)) {
            break; /* past the fold of the distortion */
        }
        x -= (j[1][1] * ex - j[0][1] * ey) / determinant;
        y -= (j[0][0] * ey - j[1][0] * ex) / determinant;
        found = fabs(ex) + fabs(ey) <= tolerance;
    }
    *ray = tsuya_vec3_unit((tsuya_vec3){x, y, 1});
    double d[2], j[2][2];
    distort(camera->distortion, x, y, d, j);
    return isfinite(x) && isfinite(y) && fabs(d[0] - u) + fabs(d[1] - v) <= 1e-9 * (1 + fabs(u) + fabs(v))
        && j[0][0] * j[1][1] - j[0][1] * j[1][0] > 1e-9;
}

tsuya_camera tsuya_camera_scaled(const tsuya_camera *camera, int width_px, int height_px)
{
    tsuya_camera scaled = *camera;
    double sx = (double)width_px / camera->width_px, sy = (double)height_px / camera->height_px;
    scaled.width_px = width_px;
    scaled.height_px = height_px;
    scaled.fx_px *= sx;
    scaled.fy_px *= sy;
    scaled.cx_px = (camera->cx_px + 0.5) * sx - 0.5;
    scaled.cy_px = (camera->cy_px + 0.5) * sy - 0.5;
    return scaled;
}
