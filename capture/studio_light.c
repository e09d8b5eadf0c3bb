/* Light at the vertices: soft lamps by shadow rays, one reflection between surfaces by rays over the hemisphere.
 *
 * What arrives from a lamp is kept as a vector (the vector irradiance of Gershun 1939), so that threads much finer than the
 * mesh can turn their own normal to it. */
#include "capture/studio_light.h"

#include "core/color.h"
#include "core/memory.h"
#include "render/frame.h"

#include <math.h>
#include <string.h>

static const float OFFSET_M = 5e-5f; /* where rays leave a surface; far below the mesh's spacing */
static const double STEEP_LEAST = 0.02; /* cosine: what a beam stands for on a plane stays finite */
enum { STREAM_LAMP = 1000, STREAM_AMBIENT = 2000 };

static tsuya_vec3 at(const float *vectors, size_t i) { return (tsuya_vec3){vectors[3 * i], vectors[3 * i + 1], vectors[3 * i + 2]}; }

tsuya_vec3 tsuya_studio_interpolate(const float *vectors, const uint32_t *t, const double w[3])
{
    tsuya_vec3 sum = tsuya_vec3_scale(at(vectors, t[0]), w[0]);
    return tsuya_vec3_mad(tsuya_vec3_mad(sum, w[1], at(vectors, t[1])), w[2], at(vectors, t[2]));
}

/* Where the beam's axis meets a print, and how far it spreads there along the print's x and y: the standard deviation of its square and of
 * the pupil's disc, laid on the plane, as the width of an even box.  False where the plane is seen from its edge. */
static bool lay_down(tsuya_vec3 *at, double spread_m[2], const tsuya_studio_print *print, const studio_beam *beam)
{
    const tsuya_vec3 eye = tsuya_pose_apply(print->print_from_world, beam->eye), d = tsuya_mat3_apply(print->print_from_world.rotation, beam->axis);
    const double t = -eye.z / d.z;
    if (!(fabs(d.z) > STEEP_LEAST) || !(t > 0.0)) {
        return false;
    }
    const double unsharp = beam->aperture_m > 0.0 ? 2.0 * beam->aperture_m * fabs(t * beam->depth / beam->focus_m - 1.0) : 0.0;
    const double width_m = sqrt(t * beam->width * t * beam->width + 0.75 * unsharp * unsharp);
    spread_m[0] = width_m * sqrt(1.0 + d.x * d.x / (d.z * d.z));
    spread_m[1] = width_m * sqrt(1.0 + d.y * d.y / (d.z * d.z));
    *at = tsuya_vec3_mad(eye, t, d);
    return true;
}

static void prop_albedo(const tsuya_studio *s, const tsuya_ray_hit *hit, const double w[3], const studio_beam *beam, float rgb[3])
{
    const uint32_t *t = s->mesh.triangle + 3 * (size_t)hit->triangle;
    size_t end = s->cloth_triangles;
    for (int k = 0; k < s->prop_count; k++) {
        const tsuya_studio_prop *prop = &s->prop[k];
        end += prop->mesh.triangle_count;
        if (hit->triangle < end) {
            double spread_m[2] = {0, 0};
            tsuya_vec3 at;
            memcpy(rgb, prop->albedo, sizeof prop->albedo);
            if (prop->print) {
                if (!beam || !lay_down(&at, spread_m, prop->print, beam)) {
                    at = tsuya_pose_apply(prop->print->print_from_world, tsuya_studio_interpolate(s->mesh.position, t, w));
                }
                tsuya_studio_print_at(prop->print, at, spread_m, rgb);
            }
            return;
        }
    }
}

void tsuya_studio_albedo(const tsuya_studio *s, const tsuya_ray_hit *hit, const studio_beam *beam, float rgb[3])
{
    const uint32_t *t = s->mesh.triangle + 3 * (size_t)hit->triangle;
    double w[3], u = 0.0, v = 0.0;
    tsuya_studio_weights(hit, w);
    if (hit->triangle >= s->cloth_triangles) {
        prop_albedo(s, hit, w, beam, rgb);
        return;
    }
    const float *uv = s->cloth->uv;
    for (int k = 0; k < 3; k++) {
        u += w[k] * (double)uv[2 * t[k]];
        v += w[k] * (double)uv[2 * t[k] + 1];
    }
    tsuya_studio_dye_at(s->weave, u, v, rgb);
    for (int c = 0; c < 3 && s->gloss; c++) {
        rgb[c] = (float)(s->reflected[0] + s->reflected[1] * (double)rgb[c]);
    }
}

static tsuya_ray ray_from(tsuya_vec3 p, tsuya_vec3 n, tsuya_vec3 direction, double far)
{
    tsuya_vec3 o = tsuya_vec3_mad(p, (double)OFFSET_M, n);
    return (tsuya_ray){{(float)o.x, (float)o.y, (float)o.z}, {(float)direction.x, (float)direction.y, (float)direction.z}, 0.0f, (float)far};
}

typedef struct place {
    tsuya_vec3 p, n;
    size_t vertex, slot; /* slot: side · vertices + vertex */
} place;

static void light_from_lamp(tsuya_studio *s, const place *at_place, int lamp, int samples, uint64_t seed)
{
    const tsuya_light *light = &s->lights->light[s->lamp[lamp]];
    tsuya_vec3 sum = {0, 0, 0};
    int side = (int)ceil(sqrt(samples)), drawn = 0, above = 0, seen = 0;
    for (int k = 0; k < side * side; k++) {
        uint64_t counter = (uint64_t)(at_place->slot * (size_t)(side * side) + (size_t)k);
        double u[2] = {(k % side + tsuya_random_uniform(seed, (uint64_t)(STREAM_LAMP + lamp), 2 * counter)) / side,
                       (k / side + tsuya_random_uniform(seed, (uint64_t)(STREAM_LAMP + lamp), 2 * counter + 1)) / side};
        tsuya_light_sample sample;
        drawn++;
        bool arrives = tsuya_light_sample_at(light, at_place->p, at_place->n, u, &sample) && tsuya_vec3_dot(sample.wi, at_place->n) > 0.0;
        if (arrives) {
            tsuya_ray ray = ray_from(at_place->p, at_place->n, sample.wi, isfinite(sample.distance_m) ? 0.999 * sample.distance_m : INFINITY);
            double strength = tsuya_rgb_luminance(sample.rgb) / (light->luminance * sample.pdf);
            above++;
            if (!tsuya_ray_scene_occluded(s->rays, &ray)) {
                seen++;
                sum = tsuya_vec3_mad(sum, strength, sample.wi);
            }
        }
        if (sample.delta) {
            break;
        }
    }
    sum = tsuya_vec3_scale(sum, 1.0 / drawn);
    s->arriving[at_place->slot * (size_t)s->lamp_count + (size_t)lamp] = (tsuya_vec3f){(float)sum.x, (float)sum.y, (float)sum.z};
    s->visible[at_place->slot * (size_t)s->lamp_count + (size_t)lamp] = above > 0 ? (float)seen / (float)above : 0.0f;
    double irradiance = fmax(0.0, tsuya_vec3_dot(sum, at_place->n));
    for (int c = 0; c < 3; c++) {
        s->direct[3 * at_place->slot + (size_t)c] += (float)(irradiance * light->rgb[c]);
    }
}

/* Radiance along a ray that meets nothing. */
static void sky(const tsuya_studio *s, tsuya_vec3 p, tsuya_vec3 n, tsuya_vec3 direction, double rgb[3])
{
    for (int l = 0; l < s->lights->count; l++) {
        double distance_m, own[3], pdf;
        if (s->lights->light[l].kind == TSUYA_LIGHT_ENVIRONMENT && tsuya_light_hit(&s->lights->light[l], p, n, direction, &distance_m, own, &pdf)) {
            for (int c = 0; c < 3; c++) {
                rgb[c] += own[c];
            }
        }
    }
}

/* Radiance that a surface sends back of what the lamps sent it. */
static void reflected(const tsuya_studio *s, const tsuya_ray_hit *hit, tsuya_vec3 direction, double rgb[3])
{
    const uint32_t *t = s->mesh.triangle + 3 * (size_t)hit->triangle;
    double w[3];
    float albedo[3];
    tsuya_studio_weights(hit, w);
    tsuya_vec3 n = tsuya_studio_interpolate(s->mesh.normal, t, w);
    size_t side = tsuya_vec3_dot(n, direction) > 0.0 ? s->mesh.vertex_count : 0;
    uint32_t slots[3] = {t[0] + (uint32_t)side, t[1] + (uint32_t)side, t[2] + (uint32_t)side};
    tsuya_vec3 irradiance = tsuya_studio_interpolate(s->direct, slots, w);
    tsuya_studio_albedo(s, hit, NULL, albedo);
    rgb[0] += (double)albedo[0] * irradiance.x / M_PI;
    rgb[1] += (double)albedo[1] * irradiance.y / M_PI;
    rgb[2] += (double)albedo[2] * irradiance.z / M_PI;
}

static void light_from_around(tsuya_studio *s, const place *at_place, int samples, uint64_t seed)
{
    double sum[3] = {0, 0, 0};
    int side = (int)ceil(sqrt(samples));
    tsuya_vec3 x, y;
    tsuya_frame_from_normal(at_place->n, &x, &y);
    for (int k = 0; k < side * side; k++) {
        uint64_t counter = (uint64_t)(at_place->slot * (size_t)(side * side) + (size_t)k);
        double a = (k % side + tsuya_random_uniform(seed, STREAM_AMBIENT, 2 * counter)) / side;
        double b = (k / side + tsuya_random_uniform(seed, STREAM_AMBIENT, 2 * counter + 1)) / side;
        double r = sqrt(a), phi = 2.0 * M_PI * b; /* density cosθ/π */
        tsuya_vec3 d = tsuya_vec3_mad(tsuya_vec3_mad(tsuya_vec3_scale(x, r * cos(phi)), r * sin(phi), y), sqrt(1.0 - a), at_place->n);
        tsuya_ray ray = ray_from(at_place->p, at_place->n, d, INFINITY);
        tsuya_ray_hit hit;
        if (tsuya_ray_scene_intersect(s->rays, &ray, &hit)) {
            reflected(s, &hit, d, sum);
        } else {
            sky(s, at_place->p, at_place->n, d, sum);
        }
    }
    for (int c = 0; c < 3; c++) {
        s->ambient[3 * at_place->slot + (size_t)c] = (float)(sum[c] * M_PI / (side * side));
    }
}

static place place_of(const tsuya_studio *s, size_t slot)
{
    size_t vertex = slot % s->mesh.vertex_count;
    double side = slot < s->mesh.vertex_count ? 1.0 : -1.0;
    return (place){tsuya_mesh_position(&s->mesh, vertex), tsuya_vec3_scale(at(s->mesh.normal, vertex), side), vertex, slot};
}

tsuya_status tsuya_studio_light(tsuya_studio *s, int samples, const tsuya_context *context)
{
    size_t slots = STUDIO_SIDES * s->mesh.vertex_count;
    for (int pass = 0; pass < 2; pass++) {
#pragma omp parallel for schedule(dynamic, 512) num_threads(context->threads)
        for (size_t slot = 0; slot < slots; slot++) {
            if (tsuya_interrupted()) {
                continue;
            }
            place here = place_of(s, slot);
            for (int lamp = 0; pass == 0 && lamp < s->lamp_count; lamp++) {
                light_from_lamp(s, &here, lamp, samples, context->seed);
            }
            if (pass == 1) {
                light_from_around(s, &here, samples, context->seed);
            }
        }
        TSUYA_TRY(tsuya_check_interrupt());
        tsuya_progress_update(context, "lamps", pass + 1, 2, NULL);
    }
    return TSUYA_OK;
}
