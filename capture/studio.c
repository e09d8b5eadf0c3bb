/* The studio put together, and its photographs: rays through a lens, threads under the vertices' light. */
#include "capture/studio_light.h"

#include "core/memory.h"

#include <math.h>
#include <stdlib.h>
#include <string.h>

enum { FLOOR_CELLS = 96, STAND_SIDES = 96, STAND_ROWS = 24 };
static const double FLOOR_HALF_M = 2.5;

/* Finer towards the middle, where shadows are. */
static double floor_coordinate(int i)
{
    double t = 2.0 * i / FLOOR_CELLS - 1.0;
    return FLOOR_HALF_M * t * fabs(t);
}

static void add_floor(tsuya_studio *s, size_t vertex, size_t triangle)
{
    tsuya_mesh *m = &s->mesh;
    for (int j = 0; j <= FLOOR_CELLS; j++) {
        for (int i = 0; i <= FLOOR_CELLS; i++) {
            size_t v = vertex + (size_t)(j * (FLOOR_CELLS + 1) + i);
            m->position[3 * v] = (float)floor_coordinate(i);
            m->position[3 * v + 1] = (float)floor_coordinate(j);
            m->normal[3 * v + 2] = 1.0f;
        }
    }
    for (int j = 0; j < FLOOR_CELLS; j++) {
        for (int i = 0; i < FLOOR_CELLS; i++) {
            uint32_t a = (uint32_t)vertex + (uint32_t)(j * (FLOOR_CELLS + 1) + i), d = a + FLOOR_CELLS + 1;
            memcpy(m->triangle + 3 * triangle, (uint32_t[]){a, a + 1, d + 1, a, d + 1, d}, 6 * sizeof *m->triangle);
            triangle += 2;
        }
    }
}

/* A round stand under the cloth, up to a little below its lowest place over the axis. */
static void add_stand(tsuya_studio *s, size_t vertex, size_t triangle)
{
    tsuya_mesh *m = &s->mesh;
    for (int row = 0; row <= STAND_ROWS; row++) {
        for (int k = 0; k < STAND_SIDES; k++) {
            size_t v = vertex + (size_t)(row * STAND_SIDES + k);
            double phi = 2.0 * M_PI * k / STAND_SIDES;
            m->normal[3 * v] = (float)cos(phi);
            m->normal[3 * v + 1] = (float)sin(phi);
            m->position[3 * v] = (float)(s->stand_radius_m * cos(phi));
            m->position[3 * v + 1] = (float)(s->stand_radius_m * sin(phi));
            m->position[3 * v + 2] = (float)(s->stand_height_m * row / STAND_ROWS);
        }
    }
    for (int row = 0; row < STAND_ROWS; row++) {
        for (int k = 0; k < STAND_SIDES; k++) {
            uint32_t a = (uint32_t)vertex + (uint32_t)(row * STAND_SIDES + k), b = (uint32_t)vertex + (uint32_t)(row * STAND_SIDES + (k + 1) % STAND_SIDES);
            memcpy(m->triangle + 3 * triangle, (uint32_t[]){a, b, b + STAND_SIDES, a, b + STAND_SIDES, a + STAND_SIDES}, 6 * sizeof *m->triangle);
            triangle += 2;
        }
    }
}

static tsuya_status build_mesh(tsuya_studio *s)
{
    const tsuya_mesh *cloth = &s->cloth->mesh;
    size_t floor_vertices = (FLOOR_CELLS + 1) * (FLOOR_CELLS + 1), floor_triangles = 2 * FLOOR_CELLS * FLOOR_CELLS;
    size_t stand_vertices = s->stand_radius_m > 0.0 ? (STAND_ROWS + 1) * STAND_SIDES : 0;
    size_t stand_triangles = s->stand_radius_m > 0.0 ? 2 * STAND_ROWS * STAND_SIDES : 0;
    s->cloth_vertices = cloth->vertex_count;
    s->cloth_triangles = cloth->triangle_count;
    TSUYA_TRY(tsuya_mesh_create(&s->mesh, cloth->vertex_count + floor_vertices + stand_vertices,
                                cloth->triangle_count + floor_triangles + stand_triangles, TSUYA_MESH_NORMAL));
    memcpy(s->mesh.position, cloth->position, 3 * cloth->vertex_count * sizeof(float));
    memcpy(s->mesh.normal, cloth->normal, 3 * cloth->vertex_count * sizeof(float));
    memcpy(s->mesh.triangle, cloth->triangle, 3 * cloth->triangle_count * sizeof(uint32_t));
    add_floor(s, cloth->vertex_count, cloth->triangle_count);
    if (stand_vertices > 0) {
        add_stand(s, cloth->vertex_count + floor_vertices, cloth->triangle_count + floor_triangles);
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
    s->stand_radius_m = options->stand_radius_m;
    s->stand_height_m = options->stand_height_m;
    TSUYA_GOTO_DONE(status, find_lamps(s));
    TSUYA_GOTO_DONE(status, build_mesh(s));
    size_t slots = STUDIO_SIDES * s->mesh.vertex_count;
    TSUYA_NEW(status, s->arriving, slots * (size_t)s->lamp_count);
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
    tsuya_free(s->ambient);
    tsuya_free(s->direct);
    tsuya_free(s);
}

static int compare_float(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

double tsuya_studio_white(const tsuya_studio *s, double albedo)
{
    float *irradiance = tsuya_calloc(s->cloth_vertices, sizeof *irradiance);
    double white = 1.0;
    for (size_t v = 0; irradiance && v < s->cloth_vertices; v++) {
        irradiance[v] = s->direct[3 * v + 1] + s->ambient[3 * v + 1];
    }
    if (irradiance && s->cloth_vertices > 0) {
        qsort(irradiance, s->cloth_vertices, sizeof *irradiance, compare_float);
        white = albedo * (double)irradiance[(size_t)(0.95 * (double)(s->cloth_vertices - 1))] / M_PI;
    }
    tsuya_free(irradiance);
    return white;
}

/* The yarn's own normal: tilted off the cloth's by its slopes across and along. */
static tsuya_vec3 yarn_normal(const tsuya_studio *s, const tsuya_studio_yarn *yarn, const uint32_t *t, const double w[3], tsuya_vec3 n)
{
    tsuya_vec3 weft = tsuya_vec3_tangent(tsuya_studio_interpolate(s->cloth->mesh.weft, t, w), n);
    tsuya_vec3 warp = tsuya_vec3_tangent(tsuya_studio_interpolate(s->cloth->warp, t, w), n);
    tsuya_vec3 along = yarn->is_weft ? weft : warp;
    tsuya_vec3 across = tsuya_vec3_tangent(yarn->is_weft ? warp : weft, along);
    return tsuya_vec3_unit(tsuya_vec3_mad(tsuya_vec3_mad(n, yarn->across, across), yarn->along, along));
}

static void shade(const tsuya_studio *s, const tsuya_ray_hit *hit, tsuya_vec3 direction, double rgb[3])
{
    const uint32_t *t = s->mesh.triangle + 3 * (size_t)hit->triangle;
    double w[3];
    float albedo[3];
    tsuya_studio_weights(hit, w);
    tsuya_vec3 n = tsuya_vec3_unit(tsuya_studio_interpolate(s->mesh.normal, t, w));
    bool back = tsuya_vec3_dot(n, direction) > 0.0;
    tsuya_vec3 yarn_n = n = tsuya_vec3_scale(n, back ? -1.0 : 1.0);
    tsuya_studio_albedo(s, hit, albedo);
    if (hit->triangle < s->cloth_triangles) {
        const float *uv = s->cloth->uv;
        double u = w[0] * (double)uv[2 * t[0]] + w[1] * (double)uv[2 * t[1]] + w[2] * (double)uv[2 * t[2]];
        double v = w[0] * (double)uv[2 * t[0] + 1] + w[1] * (double)uv[2 * t[1] + 1] + w[2] * (double)uv[2 * t[2] + 1];
        tsuya_studio_yarn yarn = tsuya_studio_weave_at(s->weave, u, v);
        memcpy(albedo, yarn.albedo, sizeof albedo);
        yarn_n = yarn_normal(s, &yarn, t, w, n);
    }
    double share = 0.5 + 0.5 * tsuya_vec3_dot(yarn_n, n), irradiance[3];
    for (int c = 0; c < 3; c++) {
        irradiance[c] = 0.0;
        for (int k = 0; k < 3; k++) {
            irradiance[c] += share * w[k] * (double)s->ambient[3 * (t[k] + (back ? s->mesh.vertex_count : 0)) + (size_t)c];
        }
    }
    for (int lamp = 0; lamp < s->lamp_count; lamp++) {
        tsuya_vec3 arriving = {0, 0, 0};
        for (int k = 0; k < 3; k++) {
            tsuya_vec3f a = s->arriving[(t[k] + (back ? s->mesh.vertex_count : 0)) * (size_t)s->lamp_count + (size_t)lamp];
            arriving = tsuya_vec3_mad(arriving, w[k], (tsuya_vec3){(double)a.x, (double)a.y, (double)a.z});
        }
        double facing = fmax(0.0, tsuya_vec3_dot(arriving, yarn_n));
        for (int c = 0; c < 3; c++) {
            irradiance[c] += facing * s->lights->light[s->lamp[lamp]].rgb[c];
        }
    }
    for (int c = 0; c < 3; c++) {
        rgb[c] += (double)albedo[c] * irradiance[c] / M_PI;
    }
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

typedef struct shot {
    const tsuya_studio *studio;
    const tsuya_camera *camera;
    tsuya_pose camera_from_world;
    tsuya_vec3 eye;
    int spp, side; /* side: strata of a pixel */
    uint64_t seed, stream;
} shot;

static void shoot_pixel(const shot *s, int x, int y, float *rgb, uint8_t *coverage)
{
    double sum[3] = {0, 0, 0};
    int covered = 0;
    for (int k = 0; k < s->spp; k++) {
        uint64_t counter = (uint64_t)((size_t)y * (size_t)s->camera->width_px + (size_t)x) * (uint64_t)s->spp + (uint64_t)k;
        tsuya_vec2 pixel = {x - 0.5 + (k % s->side + tsuya_random_uniform(s->seed, s->stream, 2 * counter)) / s->side,
                            y - 0.5 + (k / s->side % s->side + tsuya_random_uniform(s->seed, s->stream, 2 * counter + 1)) / s->side};
        tsuya_vec3 ray_camera, direction;
        if (!tsuya_camera_unproject(s->camera, pixel, &ray_camera)) {
            continue;
        }
        direction = tsuya_mat3_apply_transposed(s->camera_from_world.rotation, ray_camera);
        tsuya_ray ray = {{(float)s->eye.x, (float)s->eye.y, (float)s->eye.z},
                         {(float)direction.x, (float)direction.y, (float)direction.z}, 0.0f, INFINITY};
        tsuya_ray_hit hit;
        if (tsuya_ray_scene_intersect(s->studio->rays, &ray, &hit)) {
            shade(s->studio, &hit, direction, sum);
            covered += hit.triangle < s->studio->cloth_triangles;
        } else {
            background(s->studio, s->eye, direction, sum);
        }
    }
    for (int c = 0; c < 3; c++) {
        rgb[c] = (float)(sum[c] / s->spp);
    }
    *coverage = (uint8_t)lround(255.0 * covered / s->spp);
}

tsuya_status tsuya_studio_shoot(tsuya_image *radiance, tsuya_image *coverage, const tsuya_studio *studio, const tsuya_camera *camera,
                                tsuya_pose camera_from_world, int spp, uint64_t stream, const tsuya_context *context)
{
    int side = (int)fmax(1.0, floor(sqrt(spp)));
    shot s = {studio, camera, camera_from_world, tsuya_pose_center(camera_from_world), side * side, side, context->seed, stream};
    *radiance = *coverage = (tsuya_image){0};
    TSUYA_TRY(tsuya_image_create(radiance, camera->width_px, camera->height_px, 3, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    tsuya_status status = tsuya_image_create(coverage, camera->width_px, camera->height_px, 1, TSUYA_SAMPLE_U8, TSUYA_ENCODING_DATA);
    if (status == TSUYA_OK) {
#pragma omp parallel for schedule(dynamic, 8) num_threads(context->threads)
        for (int y = 0; y < camera->height_px; y++) {
            for (int x = 0; x < camera->width_px && !tsuya_interrupted(); x++) {
                shoot_pixel(&s, x, y, tsuya_image_f32(radiance, x, y), tsuya_image_u8(coverage, x, y));
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
