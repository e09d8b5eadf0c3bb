#include "core/raster.h"

#include "core/memory.h"

#include <stdlib.h>
#include <string.h>

enum {
    SUBPIXEL = 4096,
    GUARD_PX = 1 << 17, /* |coordinate| < 2^29 subpixels, so edge functions stay below 2^62 */
    POLYGON_MAX = 3 + 5,
    BORDER_SAMPLES = 64,
};

/* A projected vertex; flat when it cannot be used without clipping. */
typedef struct screen_vertex {
    int32_t x, y; /* subpixels */
    float z;      /* camera frame */
    bool needs_clip;
} screen_vertex;

/* The part of space that is drawn: z ≥ near, x_low·z ≤ x ≤ x_high·z, and so for y. */
typedef struct frustum {
    double near;
    double x_low, x_high, y_low, y_high;
} frustum;

typedef struct drawing {
    tsuya_raster *raster;
    const tsuya_mesh *mesh;
    const tsuya_camera *camera;
    tsuya_pose camera_from_world;
    frustum frustum;
    screen_vertex *vertex;
} drawing;

tsuya_status tsuya_raster_create(tsuya_raster *raster, int width_px, int height_px)
{
    *raster = (tsuya_raster){0};
    if (width_px < 1 || height_px < 1 || width_px > 65535 || height_px > 65535) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "picture of %d × %d pixels: 1 to 65535 a side are possible", width_px, height_px);
    }
    size_t count = (size_t)width_px * (size_t)height_px;
    raster->depth = tsuya_calloc(count, sizeof *raster->depth);
    raster->triangle = tsuya_calloc(count, sizeof *raster->triangle);
    if (!raster->depth || !raster->triangle) {
        tsuya_raster_free(raster);
        return TSUYA_ERROR_MEMORY;
    }
    raster->width_px = width_px;
    raster->height_px = height_px;
    tsuya_raster_clear(raster);
    return TSUYA_OK;
}

void tsuya_raster_free(tsuya_raster *raster)
{
    tsuya_free(raster->depth);
    tsuya_free(raster->triangle);
    *raster = (tsuya_raster){0};
}

void tsuya_raster_clear(tsuya_raster *raster)
{
    size_t count = (size_t)raster->width_px * (size_t)raster->height_px;
    memset(raster->depth, 0, count * sizeof *raster->depth);
    memset(raster->triangle, 0xff, count * sizeof *raster->triangle);
}

/* Without distortion the guard band bounds the coordinates.  With it, projection may fold back on itself outside the field
 * of view, so nothing is drawn beyond a tenth outside the picture's border. */
static frustum frustum_of_camera(const tsuya_camera *camera, double near)
{
    frustum f = {near, INFINITY, -INFINITY, INFINITY, -INFINITY};
    if (camera->lens <= TSUYA_LENS_SIMPLE_PINHOLE) {
        f.x_low = (-0.999 * GUARD_PX - camera->cx_px) / camera->fx_px;
        f.x_high = (0.999 * GUARD_PX - camera->cx_px) / camera->fx_px;
        f.y_low = (-0.999 * GUARD_PX - camera->cy_px) / camera->fy_px;
        f.y_high = (0.999 * GUARD_PX - camera->cy_px) / camera->fy_px;
        return f;
    }
    double w = camera->width_px, h = camera->height_px;
    for (int k = 0; k <= BORDER_SAMPLES; k++) {
        double s = (double)k / BORDER_SAMPLES;
        const tsuya_vec2 border[4] = {{s * w - 0.5, -0.5}, {s * w - 0.5, h - 0.5}, {-0.5, s * h - 0.5}, {w - 0.5, s * h - 0.5}};
        for (int b = 0; b < 4; b++) {
            tsuya_vec3 ray;
            if (tsuya_camera_unproject(camera, border[b], &ray) && ray.z > 0.0) {
                f.x_low = fmin(f.x_low, ray.x / ray.z);
                f.x_high = fmax(f.x_high, ray.x / ray.z);
                f.y_low = fmin(f.y_low, ray.y / ray.z);
                f.y_high = fmax(f.y_high, ray.y / ray.z);
            }
        }
    }
    double margin_x = 0.1 * (f.x_high - f.x_low), margin_y = 0.1 * (f.y_high - f.y_low);
    return (frustum){near, f.x_low - margin_x, f.x_high + margin_x, f.y_low - margin_y, f.y_high + margin_y};
}

/* How far a point lies inside one of the frustum's five planes. */
static double inside(const frustum *f, int plane, tsuya_vec3 p)
{
    switch (plane) {
    case 0: return p.z - f->near;
    case 1: return p.x - f->x_low * p.z;
    case 2: return f->x_high * p.z - p.x;
    case 3: return p.y - f->y_low * p.z;
    default: return f->y_high * p.z - p.y;
    }
}

static bool inside_all(const frustum *f, tsuya_vec3 p)
{
    bool in = true;
    for (int plane = 0; plane < 5; plane++) {
        in = in && inside(f, plane, p) >= 0.0;
    }
    return in;
}

static bool to_screen(const drawing *d, tsuya_vec3 p_camera, screen_vertex *out)
{
    tsuya_vec2 pixel;
    if (!tsuya_camera_project(d->camera, p_camera, &pixel) || !(fabs(pixel.x) < GUARD_PX) || !(fabs(pixel.y) < GUARD_PX)) {
        return false;
    }
    *out = (screen_vertex){(int32_t)lrint(pixel.x * SUBPIXEL), (int32_t)lrint(pixel.y * SUBPIXEL), (float)p_camera.z, false};
    return true;
}

/* Sutherland & Hodgman against one plane.  A cut lies on the same spot for both triangles of an edge, since it is always
 * computed from the inner end to the outer. */
static int clip(tsuya_vec3 *out, const tsuya_vec3 *in, int count, const frustum *f, int plane)
{
    int kept = 0;
    for (int k = 0; k < count; k++) {
        tsuya_vec3 a = in[k], b = in[(k + 1) % count];
        double da = inside(f, plane, a), db = inside(f, plane, b);
        if (da >= 0.0) {
            out[kept++] = a;
        }
        if ((da >= 0.0) != (db >= 0.0)) {
            tsuya_vec3 in_end = da >= 0.0 ? a : b, out_end = da >= 0.0 ? b : a;
            double t = fmax(da, db) / (fmax(da, db) - fmin(da, db));
            out[kept++] = tsuya_vec3_mad(in_end, t, tsuya_vec3_sub(out_end, in_end));
        }
    }
    return kept;
}

static int64_t edge(const screen_vertex *a, const screen_vertex *b, int64_t x, int64_t y)
{
    return (int64_t)(b->x - a->x) * (y - a->y) - (int64_t)(b->y - a->y) * (x - a->x);
}

/* Inside lies on the positive side (clockwise on the screen, y down): a top edge runs right, a left edge runs up. */
static int64_t edge_bias(const screen_vertex *a, const screen_vertex *b)
{
    bool top = a->y == b->y && b->x > a->x, left = b->y < a->y;
    return top || left ? 0 : -1;
}

static int64_t floor_div(int64_t a, int64_t b) { return a / b - (a % b < 0); }
static int64_t min3(int64_t a, int64_t b, int64_t c) { return a < b ? (a < c ? a : c) : (b < c ? b : c); }
static int64_t max3(int64_t a, int64_t b, int64_t c) { return a > b ? (a > c ? a : c) : (b > c ? b : c); }

typedef struct setup {
    int64_t x0, x1, y0, y1; /* pixels, inclusive */
    int64_t step_x[3], step_y[3], start[3], bias[3];
    double inverse_z[3], low_z, high_z;
} setup;

/* false where no pixel centre can be inside the rows [row_begin, row_end). */
static bool set_up(setup *s, const screen_vertex v[3], int width_px, int row_begin, int row_end)
{
    const screen_vertex *a = &v[0], *b = &v[1], *c = &v[2];
    s->y0 = -floor_div(-min3(a->y, b->y, c->y), SUBPIXEL);
    s->y1 = floor_div(max3(a->y, b->y, c->y), SUBPIXEL);
    s->x0 = -floor_div(-min3(a->x, b->x, c->x), SUBPIXEL);
    s->x1 = floor_div(max3(a->x, b->x, c->x), SUBPIXEL);
    s->y0 = s->y0 < row_begin ? row_begin : s->y0;
    s->y1 = s->y1 > row_end - 1 ? row_end - 1 : s->y1;
    s->x0 = s->x0 < 0 ? 0 : s->x0;
    s->x1 = s->x1 > width_px - 1 ? width_px - 1 : s->x1;
    if (s->x0 > s->x1 || s->y0 > s->y1) {
        return false;
    }
    int64_t area = edge(a, b, c->x, c->y);
    if (area == 0) {
        return false;
    }
    if (area < 0) {
        const screen_vertex *swap = b;
        b = c;
        c = swap;
        area = -area;
    }
    const screen_vertex *corner[3] = {a, b, c};
    for (int k = 0; k < 3; k++) {
        const screen_vertex *from = corner[(k + 1) % 3], *to = corner[(k + 2) % 3];
        s->start[k] = edge(from, to, s->x0 * SUBPIXEL, s->y0 * SUBPIXEL);
        s->step_x[k] = -(int64_t)(to->y - from->y) * SUBPIXEL;
        s->step_y[k] = (int64_t)(to->x - from->x) * SUBPIXEL;
        s->bias[k] = edge_bias(from, to);
        s->inverse_z[k] = 1.0 / ((double)corner[k]->z * (double)area);
    }
    s->low_z = fmin((double)a->z, fmin((double)b->z, (double)c->z));
    s->high_z = fmax((double)a->z, fmax((double)b->z, (double)c->z));
    return true;
}

static void draw_triangle(const drawing *d, const screen_vertex v[3], uint32_t index, int row_begin, int row_end)
{
    setup s;
    if (!set_up(&s, v, d->raster->width_px, row_begin, row_end)) {
        return;
    }
    for (int64_t y = s.y0; y <= s.y1; y++) {
        int64_t e0 = s.start[0], e1 = s.start[1], e2 = s.start[2];
        size_t pixel = (size_t)y * (size_t)d->raster->width_px + (size_t)s.x0;
        for (int64_t x = s.x0; x <= s.x1; x++, pixel++) {
            if (((e0 + s.bias[0]) | (e1 + s.bias[1]) | (e2 + s.bias[2])) >= 0) {
                double inverse = (double)e0 * s.inverse_z[0] + (double)e1 * s.inverse_z[1] + (double)e2 * s.inverse_z[2];
                float z = (float)fmin(fmax(1.0 / inverse, s.low_z), s.high_z);
                float *depth = &d->raster->depth[pixel];
                if (*depth == 0.0f || z < *depth) {
                    *depth = z;
                    d->raster->triangle[pixel] = index;
                }
            }
            e0 += s.step_x[0];
            e1 += s.step_x[1];
            e2 += s.step_x[2];
        }
        s.start[0] += s.step_y[0];
        s.start[1] += s.step_y[1];
        s.start[2] += s.step_y[2];
    }
}

static void draw_clipped(const drawing *d, uint32_t index, int row_begin, int row_end)
{
    tsuya_vec3 polygon[2][POLYGON_MAX];
    int count = 3, from = 0;
    for (int k = 0; k < 3; k++) {
        uint32_t v = d->mesh->triangle[3 * (size_t)index + (size_t)k];
        polygon[0][k] = tsuya_pose_apply(d->camera_from_world, tsuya_mesh_position(d->mesh, v));
    }
    for (int plane = 0; plane < 5 && count > 0; plane++, from ^= 1) {
        count = clip(polygon[from ^ 1], polygon[from], count, &d->frustum, plane);
    }
    screen_vertex v[POLYGON_MAX];
    for (int k = 0; k < count; k++) {
        if (!to_screen(d, polygon[from][k], &v[k])) {
            return;
        }
    }
    for (int k = 2; k < count; k++) {
        const screen_vertex fan[3] = {v[0], v[k - 1], v[k]};
        draw_triangle(d, fan, index, row_begin, row_end);
    }
}

static void draw_rows(const drawing *d, int row_begin, int row_end)
{
    const int64_t low = (int64_t)row_begin * SUBPIXEL, high = (int64_t)(row_end - 1) * SUBPIXEL;
    for (size_t t = 0; t < d->mesh->triangle_count; t++) {
        const uint32_t *i = d->mesh->triangle + 3 * t;
        const screen_vertex v[3] = {d->vertex[i[0]], d->vertex[i[1]], d->vertex[i[2]]};
        if (v[0].needs_clip || v[1].needs_clip || v[2].needs_clip) {
            draw_clipped(d, (uint32_t)t, row_begin, row_end);
        } else if (max3(v[0].y, v[1].y, v[2].y) >= low && min3(v[0].y, v[1].y, v[2].y) <= high) {
            draw_triangle(d, v, (uint32_t)t, row_begin, row_end);
        }
        if ((t & 0xffff) == 0 && tsuya_interrupted()) {
            return;
        }
    }
}

static void project_vertices(drawing *d, int threads)
{
    size_t count = d->mesh->vertex_count;
    double farthest = 0.0;
#pragma omp parallel for num_threads(threads) reduction(max : farthest)
    for (size_t v = 0; v < count; v++) {
        farthest = fmax(farthest, tsuya_pose_apply(d->camera_from_world, tsuya_mesh_position(d->mesh, v)).z);
    }
    d->frustum = frustum_of_camera(d->camera, 1e-5 * farthest);
#pragma omp parallel for num_threads(threads)
    for (size_t v = 0; v < count; v++) {
        tsuya_vec3 p = tsuya_pose_apply(d->camera_from_world, tsuya_mesh_position(d->mesh, v));
        if (!inside_all(&d->frustum, p) || !to_screen(d, p, &d->vertex[v])) {
            d->vertex[v] = (screen_vertex){.needs_clip = true};
        }
    }
}

/* Rows at which the bands begin, so that each has about as many triangles; begin[bands] is the height. */
static void choose_bands(int *begin, int bands, const drawing *d, uint32_t *histogram)
{
    int height = d->raster->height_px;
    uint64_t total = (uint64_t)height; /* every row weighs something */
    for (size_t t = 0; t < d->mesh->triangle_count; t++) {
        int64_t y = floor_div(d->vertex[d->mesh->triangle[3 * t]].y, SUBPIXEL);
        if (y >= 0 && y < height) {
            histogram[y]++;
            total++;
        }
    }
    uint64_t sum = 0;
    int band = 0;
    for (int y = 0; y < height && band < bands; y++) {
        while (band < bands && sum >= total * (uint64_t)band / (uint64_t)bands) {
            begin[band++] = y;
        }
        sum += histogram[y] + 1u;
    }
    while (band <= bands) {
        begin[band++] = height;
    }
}

tsuya_status tsuya_raster_draw(tsuya_raster *raster, const tsuya_mesh *mesh, const tsuya_camera *camera,
                               tsuya_pose camera_from_world, const tsuya_context *context)
{
    if (raster->width_px != camera->width_px || raster->height_px != camera->height_px) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "picture of %d × %d pixels for a camera of %d × %d: they must be the same",
                          raster->width_px, raster->height_px, camera->width_px, camera->height_px);
    }
    tsuya_status status = TSUYA_OK;
    drawing d = {.raster = raster, .mesh = mesh, .camera = camera, .camera_from_world = camera_from_world};
    int *begin = NULL;
    uint32_t *histogram = NULL;
    int bands = context->threads < raster->height_px ? context->threads : raster->height_px;
    TSUYA_NEW(status, d.vertex, mesh->vertex_count);
    TSUYA_NEW(status, begin, (size_t)bands + 1);
    TSUYA_NEW(status, histogram, (size_t)raster->height_px);
    project_vertices(&d, context->threads);
    choose_bands(begin, bands, &d, histogram);
#pragma omp parallel for num_threads(context->threads) schedule(static, 1)
    for (int band = 0; band < bands; band++) {
        draw_rows(&d, begin[band], begin[band + 1]);
    }
    status = tsuya_check_interrupt();
done:
    tsuya_free(d.vertex);
    tsuya_free(begin);
    tsuya_free(histogram);
    return status;
}

bool tsuya_raster_weights(double weights[3], const tsuya_mesh *mesh, uint32_t triangle, const tsuya_camera *camera,
                          tsuya_pose camera_from_world, tsuya_vec2 pixel)
{
    tsuya_vec3 p[3], ray;
    if (!tsuya_camera_unproject(camera, pixel, &ray)) {
        return false;
    }
    for (size_t k = 0; k < 3; k++) {
        p[k] = tsuya_pose_apply(camera_from_world, tsuya_mesh_position(mesh, mesh->triangle[3 * (size_t)triangle + k]));
    }
    /* signed volumes of the tetrahedra over the origin: the ray's barycentric coordinates up to scale */
    double sum = 0.0;
    for (int k = 0; k < 3; k++) {
        weights[k] = tsuya_vec3_dot(ray, tsuya_vec3_cross(p[(k + 1) % 3], p[(k + 2) % 3]));
        sum += weights[k];
    }
    if (!(fabs(sum) > 0.0)) {
        return false;
    }
    for (int k = 0; k < 3; k++) {
        weights[k] /= sum;
    }
    return true;
}
