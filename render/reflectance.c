#include "render/reflectance.h"

#include "brdf/fit.h"
#include "brdf/sampling.h"

#include "core/memory.h"

#include "render/surface.h"

#include <math.h>
#include <string.h>

enum { DRAWN = 512, FEWEST = 32, RAYS = 16, LAMPS = 16 };

/* In the order of their cost.  tanaka, ward and ashikhmin are none: what comes before them does no worse for less, and the first is not physical. */
static const char *const ladder[] = {"lambert", "ggx", "ggx-aniso", "yarn", "ndf", "nurbs3"};
enum { RUNGS = sizeof ladder / sizeof *ladder, LOBES = 3 };

/* What one ray of a pixel meets. */
typedef struct place {
    tsuya_vec3 x, y, n, wo; /* frame; towards the viewer, in it */
    bool has_dye;
    double dye[3];
} place;

typedef struct pixel {
    place place[RAYS];
    int count; /* rays that met the material; the others show something else */
    tsuya_vec3 lamp[LAMPS];
} pixel;

typedef struct drawing {
    const tsuya_scene *scene;
    const tsuya_shader *shader;
    const tsuya_reflectance_view *view;
    int view_count;
    uint64_t seed;
} drawing;

static double uniform(const drawing *d, int drawn, int number)
{
    return tsuya_random_uniform(d->seed, UINT64_C(0x7265666c) + (uint64_t)drawn, (uint64_t)number);
}

static tsuya_vec3 to_local(const place *p, tsuya_vec3 w)
{
    return (tsuya_vec3){tsuya_vec3_dot(w, p->x), tsuya_vec3_dot(w, p->y), tsuya_vec3_dot(w, p->n)};
}

static tsuya_vec3 to_world(const place *p, tsuya_vec3 w)
{
    return tsuya_vec3_mad(tsuya_vec3_mad(tsuya_vec3_scale(p->x, w.x), w.y, p->y), w.z, p->n);
}

/* false where the ray meets another material, or nothing. */
static bool look_along(place *p, const drawing *d, tsuya_vec3 eye, tsuya_vec3 direction, double turn)
{
    const tsuya_ray ray = {{(float)eye.x, (float)eye.y, (float)eye.z}, {(float)direction.x, (float)direction.y, (float)direction.z}, 0.0f, INFINITY};
    tsuya_ray_hit hit;
    tsuya_planes3 wo;
    tsuya_corners corners;
    tsuya_surfaces s;
    if (!tsuya_scene_intersect(d->scene, &ray, &hit) || tsuya_scene_shader_at(d->scene, &hit) != d->shader) {
        return false;
    }
    tsuya_vec3 back = tsuya_vec3_scale(direction, -1.0);
    for (int k = 0; k < tsuya_lanes_padded(1); ++k) {
        tsuya_planes3_set(&wo, k, back);
    }
    tsuya_scene_surfaces(d->scene, &hit, 1, &wo, d->shader, &corners, &s);
    tsuya_vec3 x = tsuya_planes3_at(&s.x, 0), y = tsuya_planes3_at(&s.y, 0);
    double angle = s.has_weft[0] > 0.0f ? 0.0 : 2.0 * M_PI * turn, c = cos(angle), k = sin(angle);
    *p = (place){.x = tsuya_vec3_mad(tsuya_vec3_scale(x, c), k, y), .y = tsuya_vec3_mad(tsuya_vec3_scale(y, c), -k, x), .n = tsuya_planes3_at(&s.n, 0), .has_dye = s.dyed};
    for (int i = 0; s.dyed && i < 3; ++i) {
        p->dye[i] = s.dye[i * s.count];
    }
    p->wo = to_local(p, back);
    return true;
}

static void stand_lamps(pixel *p, const drawing *d, int number)
{
    const place *first = &p->place[0];
    for (int k = 0; k < LAMPS; ++k) {
        double u[3];
        tsuya_vec3 wi;
        for (int c = 0; c < 3; ++c) {
            u[c] = uniform(d, number, 1000 + 3 * k + c);
        }
        if (k % 2 == 0 || !tsuya_material_sample(d->shader->material, first->has_dye ? first->dye : NULL, first->wo, u, &wi)) {
            wi = tsuya_sample_cosine(u[0], u[1]);
        }
        p->lamp[k] = to_world(first, wi);
    }
}

/* A pixel of some picture; false where its rays do not meet the material. */
static bool draw_pixel(pixel *p, const drawing *d, int number)
{
    const tsuya_reflectance_view *v = &d->view[(int)(uniform(d, number, 0) * d->view_count)];
    tsuya_vec3 eye = tsuya_pose_center(v->camera_from_world), ray;
    double x = floor(uniform(d, number, 1) * v->camera->width_px), y = floor(uniform(d, number, 2) * v->camera->height_px);
    p->count = 0;
    for (int k = 0; k < RAYS; ++k) { /* one in each sixteenth of the pixel */
        const tsuya_vec2 at = {x - 0.5 + (k % 4 + uniform(d, number, 10 + 3 * k)) / 4.0, y - 0.5 + (k / 4 + uniform(d, number, 11 + 3 * k)) / 4.0};
        if (tsuya_camera_unproject(v->camera, at, &ray)) {
            tsuya_vec3 direction = tsuya_vec3_unit(tsuya_mat3_apply_transposed(v->camera_from_world.rotation, ray));
            p->count += look_along(&p->place[p->count], d, eye, direction, uniform(d, number, 12 + 3 * k));
        }
    }
    if (p->count > 0) {
        stand_lamps(p, d, number);
    }
    return p->count > 0;
}

/* Mean of f cosθ over the pixel. */
static void shown(double rgb[3], const pixel *p, tsuya_vec3 lamp, const tsuya_material *m, const double under[3])
{
    rgb[0] = rgb[1] = rgb[2] = 0.0;
    for (int k = 0; k < p->count; ++k) {
        const place *at = &p->place[k];
        tsuya_vec3 wi = to_local(at, lamp);
        double dye[3], f[3];
        for (int c = 0; c < 3; ++c) {
            dye[c] = fmin(at->dye[c] + under[c], 1.0);
        }
        tsuya_material_eval(m, at->has_dye ? dye : NULL, wi, at->wo, f);
        for (int c = 0; c < 3; ++c) {
            rgb[c] += f[c] * fmax(wi.z, 0.0) / RAYS;
        }
    }
}

static double error_of(const pixel *p, int count, const tsuya_material *full, const tsuya_material *simple, const double under[3])
{
    const double nothing[3] = {0, 0, 0};
    double off = 0.0, all = 0.0;
    for (int k = 0; k < count * LAMPS; ++k) {
        double a[3], b[3];
        shown(a, &p[k / LAMPS], p[k / LAMPS].lamp[k % LAMPS], full, nothing);
        shown(b, &p[k / LAMPS], p[k / LAMPS].lamp[k % LAMPS], simple, under);
        for (int c = 0; c < 3; ++c) {
            double d = cbrt(b[c]) - cbrt(a[c]);
            off += d * d;
            all += cbrt(a[c]) * cbrt(a[c]);
        }
    }
    return all > 0.0 ? sqrt(off / all) : INFINITY;
}

/* How many rungs are cheaper than a model. */
static int rungs_below(const char *model)
{
    for (int k = 0; k < RUNGS; ++k) {
        if (strcmp(ladder[k], model) == 0) {
            return k;
        }
    }
    return LOBES;
}

/* The first model of the ladder, before the material's own, that shows the same. */
static tsuya_status climb(tsuya_material **simple, double under[3], tsuya_reflectance_choice *choice, const pixel *p, const tsuya_material *full, double tolerance)
{
    const int below = rungs_below(choice->model);
    for (int k = 0; k < below; ++k) {
        tsuya_material *m;
        double diffuse[3];
        TSUYA_TRY(tsuya_material_refit(&m, diffuse, full, ladder[k]));
        double error = error_of(p, choice->pixels, full, m, diffuse);
        choice->candidate[choice->tried] = ladder[k];
        choice->candidate_error[choice->tried++] = error;
        if (error <= tolerance) {
            *simple = m;
            memcpy(under, diffuse, sizeof diffuse);
            choice->model = ladder[k];
            choice->error = error;
            break;
        }
        tsuya_material_free(m);
    }
    return TSUYA_OK;
}

tsuya_status tsuya_reflectance_choose(tsuya_material **simple, double under[3], tsuya_reflectance_choice *choice, const tsuya_scene *scene,
                                      int material, const tsuya_reflectance_view *view, int view_count, double tolerance,
                                      const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    const drawing d = {scene, tsuya_scene_shader(scene, material), view, view_count, context->seed};
    const tsuya_material *full = d.shader->material;
    pixel *p = NULL;
    *simple = NULL;
    under[0] = under[1] = under[2] = 0.0;
    *choice = (tsuya_reflectance_choice){.model = full ? tsuya_material_get_info(full).model : ""};
    if (!(tolerance > 0.0) || !full || d.shader->spectral || view_count == 0) {
        return TSUYA_OK;
    }
    TSUYA_NEW(status, p, DRAWN);
    for (int k = 0; k < 16 * DRAWN && choice->pixels < DRAWN; ++k) {
        choice->pixels += draw_pixel(&p[choice->pixels], &d, k);
    }
    if (choice->pixels >= FEWEST) {
        status = climb(simple, under, choice, p, full, tolerance);
    }
done:
    tsuya_free(p);
    return status;
}
