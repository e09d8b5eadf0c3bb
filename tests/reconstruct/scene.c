#include "scene.h"

#include "core/context.h"
#include "core/memory.h"

#include <math.h>
#include <string.h>

static const double distance_m = 1.0, focal_over_width = 1.25;
static const double cylinder_radius_m = 0.3, grazing_rad = 75 * M_PI / 180;
static const double slab_half_m = 0.0075; /* six pixels of a picture 320 wide, over two */

const char *scene_name(scene_kind kind)
{
    static const char *const name[SCENE_KIND_COUNT] = {"sheet", "cylinder", "grazing", "slab", "bare", "satin"};
    return name[kind];
}

/* ---- texture: three octaves of value noise in space ---- */

static double lattice(int x, int y, int z, int seed)
{
    uint32_t h = (uint32_t)x * 0x8da6b343u ^ (uint32_t)y * 0xd8163841u ^ (uint32_t)z * 0xcb1ab31fu ^ (uint32_t)seed * 0x9e3779b9u;
    h ^= h >> 16, h *= 0x7feb352du, h ^= h >> 15, h *= 0x846ca68bu, h ^= h >> 16;
    return h * 0x1p-32;
}

static double smooth(double t) { return t * t * (3 - 2 * t); }

static double value_noise(tsuya_vec3 p, int seed)
{
    int x = (int)floor(p.x), y = (int)floor(p.y), z = (int)floor(p.z);
    double u = smooth(p.x - x), v = smooth(p.y - y), w = smooth(p.z - z), sum = 0;
    for (int k = 0; k < 8; k++) {
        int a = k & 1, b = k >> 1 & 1, c = k >> 2;
        sum += (a ? u : 1 - u) * (b ? v : 1 - v) * (c ? w : 1 - w) * lattice(x + a, y + b, z + c, seed);
    }
    return sum;
}

/* Finest cells of 9 mm: about four pixels at a width of 320. */
static double texture(tsuya_vec3 p, int seed)
{
    return 0.2 + 0.25 * value_noise(tsuya_vec3_scale(p, 1 / 0.009), seed) +
           0.2 * value_noise(tsuya_vec3_scale(p, 1 / 0.022), seed + 1) +
           0.15 * value_noise(tsuya_vec3_scale(p, 1 / 0.07), seed + 2);
}

/* ---- surfaces ---- */

static double sheet_height(double x, double y, double *dx, double *dy)
{
    *dx = 0.04 * 9 * cos(9 * x + 1) + 0.015 * 14 * cos(14 * x + 11 * y);
    *dy = 0.03 * 7 * cos(7 * y) + 0.015 * 11 * cos(14 * x + 11 * y);
    return 0.04 * sin(9 * x + 1) + 0.03 * sin(7 * y) + 0.015 * sin(14 * x + 11 * y);
}

/* Newton on the height along the ray; the sheet is gentle enough for one crossing. */
static bool hit_sheet(scene_hit *hit, tsuya_vec3 o, tsuya_vec3 d)
{
    if (d.z >= -0.2) {
        return false;
    }
    double t = -o.z / d.z, dx = 0, dy = 0;
    for (int i = 0; i < 20; i++) {
        tsuya_vec3 p = tsuya_vec3_mad(o, t, d);
        double f = p.z - sheet_height(p.x, p.y, &dx, &dy);
        t -= f / (d.z - dx * d.x - dy * d.y);
        if (fabs(f) < 1e-10) {
            break;
        }
    }
    hit->point = tsuya_vec3_mad(o, t, d);
    sheet_height(hit->point.x, hit->point.y, &dx, &dy);
    hit->normal = tsuya_vec3_unit(tsuya_vec3_make(-dx, -dy, 1));
    return true;
}

static bool hit_cylinder(scene_hit *hit, tsuya_vec3 o, tsuya_vec3 d)
{
    const double radius = cylinder_radius_m, half = 0.26;
    double a = d.x * d.x + d.z * d.z, b = o.x * d.x + o.z * d.z, c = o.x * o.x + o.z * o.z - radius * radius;
    double root = b * b - a * c;
    if (root <= 0) {
        return false;
    }
    double t = (-b - sqrt(root)) / a;
    hit->point = tsuya_vec3_mad(o, t, d);
    hit->normal = tsuya_vec3_unit(tsuya_vec3_make(hit->point.x, 0, hit->point.z));
    return t > 0 && fabs(hit->point.y) < half;
}

static bool hit_grazing(scene_hit *hit, tsuya_vec3 o, tsuya_vec3 d)
{
    tsuya_vec3 n = {0, -sin(grazing_rad), cos(grazing_rad)};
    double facing = tsuya_vec3_dot(n, d), t = -tsuya_vec3_dot(n, o) / facing;
    hit->point = tsuya_vec3_mad(o, t, d);
    hit->normal = facing < 0 ? n : tsuya_vec3_scale(n, -1);
    return t > 0 && fabs(hit->point.x) < 0.35 && tsuya_vec3_norm(hit->point) < 0.6;
}

static bool hit_slab(scene_hit *hit, tsuya_vec3 o, tsuya_vec3 d)
{
    const tsuya_vec3 half = {0.3, 0.22, slab_half_m};
    double near = -HUGE_VAL, far = HUGE_VAL;
    const double from[3] = {o.x, o.y, o.z}, along[3] = {d.x, d.y, d.z}, side[3] = {half.x, half.y, half.z};
    double n[3] = {0, 0, 0};
    for (int k = 0; k < 3; k++) {
        double t0 = (-side[k] - from[k]) / along[k], t1 = (side[k] - from[k]) / along[k];
        double low = fmin(t0, t1), high = fmax(t0, t1);
        if (low > near) {
            near = low;
            n[0] = n[1] = n[2] = 0;
            n[k] = along[k] > 0 ? -1 : 1;
        }
        far = fmin(far, high);
    }
    hit->point = tsuya_vec3_mad(o, near, d);
    hit->normal = tsuya_vec3_make(n[0], n[1], n[2]);
    return near > 0 && near < far;
}

bool scene_trace(scene_hit *hit, scene_kind kind, tsuya_vec3 origin, tsuya_vec3 direction)
{
    static bool (*const surface[SCENE_KIND_COUNT])(scene_hit *, tsuya_vec3, tsuya_vec3) = {
        hit_sheet, hit_cylinder, hit_grazing, hit_slab, hit_sheet, hit_sheet,
    };
    if (!surface[kind](hit, origin, direction)) {
        return false;
    }
    int seed = kind == SCENE_SLAB && hit->normal.z < 0 ? 77 : 5;
    hit->textured = !(kind >= SCENE_BARE && fabs(hit->point.x) < 0.133);
    hit->grey = hit->textured ? texture(hit->point, seed) : 0.45;
    if (kind == SCENE_SATIN) {
        const tsuya_vec3 lamp = {0.3, 0.5, 1.2};
        tsuya_vec3 to_lamp = tsuya_vec3_unit(tsuya_vec3_sub(lamp, hit->point));
        tsuya_vec3 halfway = tsuya_vec3_unit(tsuya_vec3_mad(to_lamp, -1, tsuya_vec3_unit(direction)));
        hit->grey += 0.25 * pow(fmax(0, tsuya_vec3_dot(halfway, hit->normal)), 40);
    }
    return true;
}

double scene_distance_m(scene_kind kind, tsuya_vec3 p)
{
    double dx, dy;
    switch (kind) {
    case SCENE_CYLINDER: return fabs(hypot(p.x, p.z) - cylinder_radius_m);
    case SCENE_GRAZING: return fabs(-sin(grazing_rad) * p.y + cos(grazing_rad) * p.z);
    case SCENE_SLAB: return fabs(fabs(p.z) - slab_half_m);
    default: { /* first order: the height error over the slope */
        double off = p.z - sheet_height(p.x, p.y, &dx, &dy);
        return fabs(off) / sqrt(1 + dx * dx + dy * dy);
    }
    }
}

/* ---- pictures ---- */

static tsuya_vec3 ray_through(const scene_view *v, double x, double y)
{
    tsuya_vec3 ray = {(x - v->camera.cx_px) / v->camera.fx_px, (y - v->camera.cy_px) / v->camera.fy_px, 1};
    return tsuya_mat3_apply_transposed(v->camera_from_world.rotation, ray);
}

static void draw_pixel(scene_view *v, scene_kind kind, double noise, int index, int x, int y)
{
    enum { SIDE = 3 };
    const tsuya_vec3 eye = tsuya_pose_center(v->camera_from_world);
    const size_t at = (size_t)y * (size_t)v->camera.width_px + (size_t)x;
    const size_t pixels = (size_t)v->camera.width_px * (size_t)v->camera.height_px;
    double sum = 0;
    for (int k = 0; k < SIDE * SIDE; k++) {
        scene_hit hit;
        double dx = (k % SIDE + 0.5) / SIDE - 0.5, dy = (k / SIDE + 0.5) / SIDE - 0.5;
        sum += scene_trace(&hit, kind, eye, ray_through(v, x + dx, y + dy)) ? hit.grey : 0.05;
        if (k == SIDE * SIDE / 2 && scene_trace(&hit, kind, eye, ray_through(v, x, y))) {
            tsuya_vec3 n = tsuya_mat3_apply(v->camera_from_world.rotation, hit.normal);
            v->depth[at] = (float)tsuya_pose_apply(v->camera_from_world, hit.point).z;
            v->normal[at] = (float)n.x, v->normal[pixels + at] = (float)n.y, v->normal[2 * pixels + at] = (float)n.z;
            v->textured[at] = hit.textured;
        }
    }
    double value = sum / (SIDE * SIDE) + noise * tsuya_random_normal(11, (uint64_t)index, at);
    v->grey[at] = (float)fmin(fmax(value, 0), 1);
}

static int side_count(scene_kind kind, int count) { return kind == SCENE_SLAB ? (count + 1) / 2 : count; }

bool scene_same_side(const scene_pictures *s, int a, int b)
{
    int half = side_count(s->kind, s->view_count);
    return (a < half) == (b < half);
}

/* Cameras on an arc around the target at alternating heights; the slab's second half stands behind it. */
static tsuya_pose view_pose(scene_kind kind, int index, int count)
{
    int half = side_count(kind, count);
    bool behind = index >= half;
    double step = 7 * M_PI / 180, a = (index % half - 0.5 * (half - 1)) * step;
    double lift = (index & 1 ? 1 : -1) * 3.0 * M_PI / 180;
    if (behind) {
        a += M_PI;
    }
    tsuya_vec3 eye = {distance_m * sin(a) * cos(lift), distance_m * sin(lift), distance_m * cos(a) * cos(lift)};
    return tsuya_pose_look_at(eye, tsuya_vec3_make(0, 0, 0), tsuya_vec3_make(0, 1, 0));
}

static bool view_create(scene_view *v, int width_px, tsuya_pose pose)
{
    int height_px = width_px * 3 / 4;
    double f = focal_over_width * width_px;
    size_t pixels = (size_t)width_px * (size_t)height_px;
    v->camera = (tsuya_camera){.lens = TSUYA_LENS_PINHOLE, .width_px = width_px, .height_px = height_px, .fx_px = f,
                               .fy_px = f, .cx_px = 0.5 * width_px - 0.5, .cy_px = 0.5 * height_px - 0.5};
    v->camera_from_world = pose;
    v->grey = tsuya_calloc(pixels, sizeof(float));
    v->depth = tsuya_calloc(pixels, sizeof(float));
    v->normal = tsuya_calloc(pixels, 3 * sizeof(float));
    v->textured = tsuya_calloc(pixels, 1);
    return v->grey && v->depth && v->normal && v->textured;
}

bool scene_create(scene_pictures *s, scene_kind kind, int width_px, int view_count, double noise)
{
    *s = (scene_pictures){.kind = kind, .view_count = view_count, .noise = noise};
    s->view = tsuya_calloc((size_t)view_count, sizeof *s->view);
    for (int i = 0; s->view && i < view_count; i++) {
        scene_view *v = &s->view[i];
        if (!view_create(v, width_px, view_pose(kind, i, view_count))) {
            scene_free(s);
            return false;
        }
#pragma omp parallel for schedule(dynamic, 4)
        for (int y = 0; y < v->camera.height_px; y++) {
            for (int x = 0; x < v->camera.width_px; x++) {
                draw_pixel(v, kind, noise, i, x, y);
            }
        }
    }
    return s->view != NULL;
}

void scene_free(scene_pictures *s)
{
    for (int i = 0; s->view && i < s->view_count; i++) {
        tsuya_free(s->view[i].grey);
        tsuya_free(s->view[i].depth);
        tsuya_free(s->view[i].normal);
        tsuya_free(s->view[i].textured);
    }
    tsuya_free(s->view);
    memset(s, 0, sizeof *s);
}

double scene_gsd_m(const scene_pictures *s) { return distance_m / s->view[0].camera.fx_px; }
