#include "calib/spline.h"

#include "core/dense.h"
#include "core/memory.h"

#include <math.h>
#include <string.h>

enum { BORDER = 32, SAMPLE_COLS = 96, SAMPLE_ROWS = 72, SIDES = 2 };
/* Beyond the border, of its distance from the axis; how stiff the surface is where no pixel holds it, of a sample's weight. */
static const double MARGIN = 1.03, STIFFNESS = 1e-3, HOLD = 0.002; /* HOLD: of the image's width */

/* u of a pixel; of one that the lens does not reach, as far out again as the last pixel on the way to it that is reached. */
static tsuya_vec2 reach_pixel(const tsuya_camera *lens, tsuya_vec2 pixel)
{
    double low = 0.0, high = 1.0;
    tsuya_vec3 ray;
    if (tsuya_camera_unproject(lens, pixel, &ray)) {
        return tsuya_stereographic_from_ray(ray);
    }
    for (int i = 0; i < 20; i++) {
        double t = 0.5 * (low + high);
        tsuya_vec2 on_way = {lens->cx_px + t * (pixel.x - lens->cx_px), lens->cy_px + t * (pixel.y - lens->cy_px)};
        *(tsuya_camera_unproject(lens, on_way, &ray) ? &low : &high) = t;
    }
    low = fmax(low, 0.05);
    tsuya_vec2 last = {lens->cx_px + low * (pixel.x - lens->cx_px), lens->cy_px + low * (pixel.y - lens->cy_px)}, u = {0, 0};
    if (tsuya_camera_unproject(lens, last, &ray)) {
        u = tsuya_stereographic_from_ray(ray);
    }
    return (tsuya_vec2){u.x / low, u.y / low};
}

/* The largest |u| of the image's border. */
static tsuya_vec2 border_reach(const tsuya_camera *lens)
{
    tsuya_vec2 most = {0, 0};
    for (int i = 0; i <= BORDER; i++) {
        double t = (double)i / BORDER, w = lens->width_px, h = lens->height_px;
        const tsuya_vec2 at[4] = {{t * w - 0.5, -0.5}, {t * w - 0.5, h - 0.5}, {-0.5, t * h - 0.5}, {w - 0.5, t * h - 0.5}};
        for (int k = 0; k < 4; k++) {
            tsuya_vec2 u = reach_pixel(lens, at[k]);
            most = (tsuya_vec2){fmax(most.x, fabs(u.x)), fmax(most.y, fabs(u.y))};
        }
    }
    return most;
}

/* Field and grid that hold `reach`. */
static tsuya_status lay_grid(tsuya_lens_spline *s, tsuya_vec2 reach, int nx)
{
    double fov_deg = tsuya_deg_from_rad(4.0 * atan(0.5 * MARGIN * reach.x));
    *s = (tsuya_lens_spline){.fov_x_deg = (int)fmin(fmax(ceil(fov_deg), 1.0), 350.0)};
    for (s->nx = nx; s->nx >= TSUYA_SPLINE_LEAST_SIDE; s->nx--) {
        double cells = ceil(2.0 * MARGIN * reach.y * tsuya_lens_spline_density(s));
        if (cells + 3.0 <= TSUYA_SPLINE_MOST / s->nx) {
            s->ny = cells < 1.0 ? TSUYA_SPLINE_LEAST_SIDE : (int)cells + 3;
            return TSUYA_OK;
        }
    }
    return tsuya_fail(TSUYA_ERROR_NUMERIC, "no spline covers the lens' field");
}

tsuya_status tsuya_spline_plain(tsuya_camera *splined, int width_px, int height_px, double focal_px, int nx)
{
    *splined = (tsuya_camera){.lens = TSUYA_LENS_SPLINED_STEREOGRAPHIC, .width_px = width_px, .height_px = height_px, .fx_px = focal_px,
                              .fy_px = focal_px, .cx_px = 0.5 * (width_px - 1), .cy_px = 0.5 * (height_px - 1)};
    return lay_grid(&splined->spline, (tsuya_vec2){0.5 * width_px / focal_px, 0.5 * height_px / focal_px}, nx);
}

static void add_square(double *a, const double *weight, const int *at, int count, double scale, int n)
{
    for (int i = 0; i < count; i++) {
        for (int k = 0; k < count; k++) {
            a[at[i] * n + at[k]] += scale * weight[i] * weight[k];
        }
    }
}

/* Second differences of the control points cost a little, so that the surface goes on straight where no sample holds it. */
static void add_stiffness(double *a, const tsuya_lens_spline *s)
{
    static const double second[3] = {1.0, -2.0, 1.0};
    int n = s->nx * s->ny;
    for (int i = 0; i < n; i++) {
        int x = i % s->nx, y = i / s->nx;
        if (x > 0 && x < s->nx - 1) {
            add_square(a, second, (const int[]){i - 1, i, i + 1}, 3, STIFFNESS, n);
        }
        if (y > 0 && y < s->ny - 1) {
            add_square(a, second, (const int[]){i - s->nx, i, i + s->nx}, 3, STIFFNESS, n);
        }
    }
}

/* What the surface must be at a pixel. */
static void add_sample(double *a, double *right, const tsuya_camera *splined, const tsuya_camera *lens, tsuya_vec2 pixel)
{
    const tsuya_lens_spline *s = &splined->spline;
    int first, at[16], n = s->nx * s->ny;
    double weight[16];
    tsuya_vec3 ray;
    if (!tsuya_camera_unproject(lens, pixel, &ray)) {
        return;
    }
    tsuya_vec2 u = tsuya_stereographic_from_ray(ray);
    double want[SIDES] = {(pixel.x - splined->cx_px) / splined->fx_px - u.x, (pixel.y - splined->cy_px) / splined->fy_px - u.y};
    tsuya_lens_spline_weights(weight, &first, s, u);
    for (int i = 0; i < 16; i++) {
        at[i] = first + i / 4 * s->nx + i % 4;
        for (int k = 0; k < SIDES; k++) {
            right[SIDES * at[i] + k] += weight[i] * want[k];
        }
    }
    add_square(a, weight, at, 16, 1.0, n);
}

tsuya_status tsuya_spline_fit(tsuya_camera *splined, const tsuya_camera *lens, int nx)
{
    tsuya_status status = TSUYA_OK;
    double *a = NULL, *right = NULL;
    tsuya_camera out = *lens;
    out.lens = TSUYA_LENS_SPLINED_STEREOGRAPHIC;
    memset(out.distortion, 0, sizeof out.distortion);
    TSUYA_TRY(lay_grid(&out.spline, border_reach(lens), nx));
    size_t n = (size_t)(out.spline.nx * out.spline.ny);
    TSUYA_NEW(status, a, n * n);
    TSUYA_NEW(status, right, SIDES * n);
    for (int i = 0; i < SAMPLE_COLS * SAMPLE_ROWS; i++) {
        double x = (i % SAMPLE_COLS) / (SAMPLE_COLS - 1.0), y = (i / SAMPLE_COLS) / (SAMPLE_ROWS - 1.0);
        add_sample(a, right, &out, lens, (tsuya_vec2){x * lens->width_px - 0.5, y * lens->height_px - 0.5});
    }
    add_stiffness(a, &out.spline);
    if (!tsuya_dense_cholesky(a, (int)n)) {
        status = tsuya_fail(TSUYA_ERROR_NUMERIC, "the lens reaches too little of its image to be followed by a spline");
        goto done;
    }
    tsuya_dense_forward(a, right, (int)n, SIDES);
    tsuya_dense_backward(a, right, (int)n, SIDES);
    memcpy(out.spline.point, right, SIDES * n * sizeof *right);
    *splined = out;
done:
    tsuya_free(a);
    tsuya_free(right);
    return status;
}

int tsuya_spline_holds(tsuya_spline_hold *hold, double *sigma_px, const tsuya_lens_spline *spline, const tsuya_camera *prior)
{
    int count = 0;
    *sigma_px = HOLD * prior->width_px;
    for (int i = 0; i < spline->nx * spline->ny; i++) {
        tsuya_spline_hold h = {.pixel = {(i % spline->nx + 0.5) / spline->nx * prior->width_px - 0.5, (i / spline->nx + 0.5) / spline->ny * prior->height_px - 0.5}};
        if (tsuya_camera_unproject(prior, h.pixel, &h.ray) && h.ray.z > 0.0) {
            hold[count++] = h;
        }
    }
    return count;
}
