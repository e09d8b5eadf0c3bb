/* The studio put together, and its photographs: rays through a lens. */
#include "capture/studio_light.h"
#include "capture/studio_spread.h"

#include "core/memory.h"
#include "core/order.h"

#include <math.h>
#include <string.h>

/* One mesh of everything: the cloth, then the props. */
static tsuya_status build_mesh(tsuya_studio *s)
{
    const tsuya_mesh none = {0};
    size_t vertices = 0, triangles = 0;
    for (int k = -1; k < s->prop_count; k++) {
        const tsuya_mesh *m = k >= 0 ? &s->prop[k].mesh : s->cloth ? &s->cloth->mesh : &none;
        vertices += m->vertex_count;
        triangles += m->triangle_count;
    }
    s->cloth_vertices = s->cloth ? s->cloth->mesh.vertex_count : 0;
    s->cloth_triangles = s->cloth ? s->cloth->mesh.triangle_count : 0;
    TSUYA_TRY(tsuya_mesh_create(&s->mesh, vertices, triangles, TSUYA_MESH_NORMAL));
    vertices = triangles = 0;
    for (int k = -1; k < s->prop_count; k++) {
        const tsuya_mesh *m = k >= 0 ? &s->prop[k].mesh : s->cloth ? &s->cloth->mesh : &none;
        if (m->vertex_count > 0) {
            memcpy(s->mesh.position + 3 * vertices, m->position, 3 * m->vertex_count * sizeof(float));
            memcpy(s->mesh.normal + 3 * vertices, m->normal, 3 * m->vertex_count * sizeof(float));
        }
        for (size_t i = 0; i < 3 * m->triangle_count; i++) {
            s->mesh.triangle[3 * triangles + i] = m->triangle[i] + (uint32_t)vertices;
        }
        vertices += m->vertex_count;
        triangles += m->triangle_count;
    }
    return TSUYA_OK;
}

static tsuya_status find_lamps(tsuya_studio *s)
{
    for (int l = 0; l < s->lights->count; l++) {
        if (s->lights->light[l].kind == TSUYA_LIGHT_ENVIRONMENT) {
            continue;
        }
        if (s->lamp_count == TSUYA_STUDIO_LAMPS) {
            return tsuya_fail(TSUYA_ERROR_INPUT, "studio: more than %d lamps", TSUYA_STUDIO_LAMPS);
        }
        s->lamp[s->lamp_count++] = l;
    }
    return TSUYA_OK;
}

tsuya_status tsuya_studio_create(tsuya_studio **studio, const tsuya_studio_cloth *cloth, const tsuya_studio_weave *weave,
                                 const tsuya_light_set *lights, const tsuya_studio_options *options, const tsuya_context *context)
{
    tsuya_status status;
    tsuya_studio *s;
    *studio = NULL;
    TSUYA_NEW(status, s, 1);
    s->cloth = cloth;
    s->weave = weave;
    s->lights = lights;
    s->prop = options->prop;
    s->prop_count = options->prop_count;
    s->gloss = cloth ? options->cloth : NULL;
    if (s->gloss) {
        tsuya_studio_measure_gloss(s);
    }
    TSUYA_GOTO_DONE(status, find_lamps(s));
    TSUYA_GOTO_DONE(status, build_mesh(s));
    size_t slots = STUDIO_SIDES * s->mesh.vertex_count;
    TSUYA_NEW(status, s->arriving, slots * (size_t)s->lamp_count);
    TSUYA_NEW(status, s->visible, slots * (size_t)s->lamp_count);
    TSUYA_NEW(status, s->ambient, 3 * slots);
    TSUYA_NEW(status, s->direct, 3 * slots);
    TSUYA_GOTO_DONE(status, tsuya_ray_scene_create(&s->rays, &s->mesh));
    TSUYA_GOTO_DONE(status, tsuya_studio_light(s, options->samples, context));
    *studio = s;
    s = NULL;
done:
    tsuya_studio_free(s);
    return status;
}

void tsuya_studio_free(tsuya_studio *s)
{
    if (!s) {
        return;
    }
    tsuya_ray_scene_free(s->rays);
    tsuya_mesh_free(&s->mesh);
    tsuya_free(s->arriving);
    tsuya_free(s->visible);
    tsuya_free(s->ambient);
    tsuya_free(s->direct);
    tsuya_free(s);
}

double tsuya_studio_white(const tsuya_studio *s, double albedo)
{
    size_t count = s->cloth_vertices > 0 ? s->cloth_vertices : s->mesh.vertex_count;
    float *irradiance = tsuya_calloc(count, sizeof *irradiance);
    double white = 1.0;
    for (size_t v = 0; irradiance && v < count; v++) {
        irradiance[v] = s->direct[3 * v + 1] + s->ambient[3 * v + 1];
    }
    if (irradiance && count > 0) {
        tsuya_sort_floats(irradiance, count);
        white = albedo * (double)irradiance[(size_t)(0.95 * (double)(count - 1))] / M_PI;
    }
    tsuya_free(irradiance);
    return white;
}

static void background(const tsuya_studio *s, tsuya_vec3 eye, tsuya_vec3 direction, double rgb[3])
{
    for (int l = 0; l < s->lights->count; l++) {
        double distance_m, own[3], pdf;
        if (s->lights->light[l].kind == TSUYA_LIGHT_ENVIRONMENT &&
            tsuya_light_hit(&s->lights->light[l], eye, direction, direction, &distance_m, own, &pdf)) {
            for (int c = 0; c < 3; c++) {
                rgb[c] += own[c];
            }
        }
    }
}

typedef struct shooting {
    const tsuya_studio *studio;
    const tsuya_studio_shot *shot;
    tsuya_vec3 eye;
    int side; /* strata of a pixel */
    uint64_t seed;
    tsuya_studio_spread spread;
} shooting;

/* The lens about one pixel, straight there: the blur's tails lie within 0.01 px of where they belong even in a wide lens. */
typedef struct pixel_lens {
    bool straight, next_known;
    tsuya_vec3 middle, right, down, next; /* ray, its change from one pixel to the next; ray of the next in the row */
} pixel_lens;

/* Pixel x of row y; `l` is that of x − 1, or zero. */
static void lens_move(pixel_lens *l, const tsuya_camera *camera, int x, int y)
{
    tsuya_vec3 down;
    bool known = l->next_known;
    l->middle = l->next;
    known = known || tsuya_camera_unproject(camera, (tsuya_vec2){x, y}, &l->middle);
    l->next_known = tsuya_camera_unproject(camera, (tsuya_vec2){x + 1.0, y}, &l->next);
    l->straight = known && l->next_known && tsuya_camera_unproject(camera, (tsuya_vec2){x, y + 1.0}, &down);
    if (l->straight) {
        l->right = tsuya_vec3_sub(l->next, l->middle);
        l->down = tsuya_vec3_sub(down, l->middle);
    }
}

static bool ray_of(const pixel_lens *l, const tsuya_camera *camera, int x, int y, tsuya_vec2 off, tsuya_vec3 *direction)
{
    if (!l->straight) {
        return tsuya_camera_unproject(camera, (tsuya_vec2){x + off.x, y + off.y}, direction);
    }
    *direction = tsuya_vec3_unit(tsuya_vec3_mad(tsuya_vec3_mad(l->middle, off.x, l->right), off.y, l->down));
    return true;
}

/* Through a place on the entrance pupil to where the pixel's ray meets the sharp plane. */
static void through_pupil(const shooting *s, uint64_t counter, tsuya_vec3 *origin, tsuya_vec3 *direction)
{
    double r = s->shot->aperture_m * sqrt(tsuya_random_uniform(s->seed, s->shot->stream, counter));
    double phi = 2.0 * M_PI * tsuya_random_uniform(s->seed, s->shot->stream, counter + 1);
    tsuya_vec3 on_pupil = {r * cos(phi), r * sin(phi), 0.0}, sharp = tsuya_vec3_scale(*direction, s->shot->focus_m / direction->z);
    *direction = tsuya_vec3_unit(tsuya_vec3_sub(sharp, on_pupil));
    *origin = tsuya_vec3_add(s->eye, tsuya_mat3_apply_transposed(s->shot->camera_from_world.rotation, on_pupil));
}

/* Light that the lens passes at a pixel. */
static double falloff(const tsuya_studio_shot *s, int x, int y)
{
    double w = s->camera.width_px, h = s->camera.height_px, dx = x - 0.5 * (w - 1.0), dy = y - 0.5 * (h - 1.0);
    double r2 = 4.0 * (dx * dx + dy * dy) / (w * w + h * h);
    return 1.0 - s->vignetting * r2 * r2;
}

static void shoot_pixel(const shooting *s, const pixel_lens *lens, int x, int y, float *rgb, uint8_t *coverage)
{
    const tsuya_studio_shot *shot = s->shot;
    double sum[3] = {0, 0, 0};
    int covered = 0, spp = s->side * s->side;
    studio_cache cache = {.filled = false};
    uint64_t pixel_number = (uint64_t)((size_t)y * (size_t)shot->camera.width_px + (size_t)x);
    for (int k = 0; k < spp; k++) {
        uint64_t counter = pixel_number * (uint64_t)spp + (uint64_t)k;
        tsuya_vec2 off = {tsuya_studio_spread_at(&s->spread, (k % s->side + tsuya_random_uniform(s->seed, shot->stream, 4 * counter)) / s->side),
                          tsuya_studio_spread_at(&s->spread, (k / s->side + tsuya_random_uniform(s->seed, shot->stream, 4 * counter + 1)) / s->side)};
        tsuya_vec3 direction, origin = s->eye;
        if (!ray_of(lens, &shot->camera, x, y, off, &direction)) {
            continue;
        }
        if (shot->aperture_m > 0.0) {
            through_pupil(s, 4 * counter + 2, &origin, &direction);
        }
        direction = tsuya_mat3_apply_transposed(shot->camera_from_world.rotation, direction);
        tsuya_ray ray = {{(float)origin.x, (float)origin.y, (float)origin.z},
                         {(float)direction.x, (float)direction.y, (float)direction.z}, 0.0f, INFINITY};
        tsuya_ray_hit hit;
        if (tsuya_ray_scene_intersect(s->studio->rays, &ray, &hit)) {
            double width = (double)hit.distance / (shot->camera.fx_px * s->side);
            tsuya_studio_shade(s->studio, &hit, tsuya_vec3_mad(origin, (double)hit.distance, direction), direction, width, &cache, sum);
            covered += hit.triangle < s->studio->cloth_triangles;
        } else {
            background(s->studio, origin, direction, sum);
        }
    }
    double factor = falloff(shot, x, y) / spp;
    for (int c = 0; c < 3; c++) {
        rgb[c] = (float)(sum[c] * factor);
    }
    *coverage = (uint8_t)lround(255.0 * covered / spp);
}

tsuya_status tsuya_studio_shoot(tsuya_image *radiance, tsuya_image *coverage, const tsuya_studio *studio, const tsuya_studio_shot *shot,
                                const tsuya_context *context)
{
    const tsuya_camera *camera = &shot->camera;
    shooting s = {.studio = studio, .shot = shot, .eye = tsuya_pose_center(shot->camera_from_world), .seed = context->seed,
                  .side = (int)fmax(1.0, floor(sqrt(shot->spp)))};
    tsuya_studio_spread_fill(&s.spread, shot->blur_px);
    *radiance = *coverage = (tsuya_image){0};
    TSUYA_TRY(tsuya_image_create(radiance, camera->width_px, camera->height_px, 3, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    tsuya_status status = tsuya_image_create(coverage, camera->width_px, camera->height_px, 1, TSUYA_SAMPLE_U8, TSUYA_ENCODING_DATA);
    if (status == TSUYA_OK) {
#pragma omp parallel for schedule(dynamic, 8) num_threads(context->threads)
        for (int y = 0; y < camera->height_px; y++) {
            pixel_lens lens = {.next_known = false};
            for (int x = 0; x < camera->width_px && !tsuya_interrupted(); x++) {
                lens_move(&lens, camera, x, y);
                shoot_pixel(&s, &lens, x, y, tsuya_image_f32(radiance, x, y), tsuya_image_u8(coverage, x, y));
            }
        }
        status = tsuya_check_interrupt();
    }
    if (status != TSUYA_OK) {
        tsuya_image_free(radiance);
        tsuya_image_free(coverage);
    }
    return status;
}
