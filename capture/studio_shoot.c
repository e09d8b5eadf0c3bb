/* The studio's photographs: rays through a lens, and what its pixels take of them. */
#include "capture/studio_light.h"
#include "capture/studio_spread.h"

#include "core/memory.h"

#include <math.h>
#include <omp.h>
#include <string.h>

enum { BAND = 64, CHANNELS = 4 }; /* rows at once; red, green, blue, cloth */

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
    int threads;
    uint64_t seed;
    tsuya_studio_spread spread;
    float *fine;   /* of each thread: the cells of one row of pixels, with those beyond either end, row by row */
    float *across; /* of a band's rows of cells, with those beyond either end: what pixels take along them */
} shooting;

/* The lens about one pixel, straight there. */
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

static size_t row_cells(const shooting *s) { return (size_t)(s->shot->camera.width_px + 2 * s->spread.reach) * (size_t)s->spread.side; }

static size_t row_pixels(const shooting *s) { return (size_t)s->shot->camera.width_px * CHANNELS; }

/* A ray through every cell of pixel x of row y; `fine`: its first cell. */
static void shoot_pixel(const shooting *s, const pixel_lens *lens, int x, int y, float *fine)
{
    const tsuya_studio_shot *shot = s->shot;
    const int side = s->spread.side, reach = s->spread.reach;
    const size_t number = (size_t)(y + reach) * (size_t)(shot->camera.width_px + 2 * reach) + (size_t)(x + reach);
    studio_cache cache = {.filled = false};
    for (int k = 0; k < side * side; k++) {
        const uint64_t counter = (uint64_t)number * (uint64_t)(side * side) + (uint64_t)k;
        tsuya_vec2 off = {(k % side + tsuya_random_uniform(s->seed, shot->stream, 4 * counter)) / side - 0.5,
                          (k / side + tsuya_random_uniform(s->seed, shot->stream, 4 * counter + 1)) / side - 0.5};
        const tsuya_vec2 middle = {(k % side + 0.5) / side - 0.5, (k / side + 0.5) / side - 0.5};
        studio_beam beam = {.eye = s->eye, .width = 1.0 / (shot->camera.fx_px * side), .aperture_m = shot->aperture_m, .focus_m = shot->focus_m};
        tsuya_vec3 direction, origin = s->eye;
        double rgb[3] = {0, 0, 0};
        float *cell = fine + CHANNELS * ((size_t)(k / side) * row_cells(s) + (size_t)(k % side));
        memset(cell, 0, CHANNELS * sizeof *cell);
        if (!ray_of(lens, &shot->camera, x, y, off, &direction) || !ray_of(lens, &shot->camera, x, y, middle, &beam.axis)) {
            continue;
        }
        beam.depth = beam.axis.z;
        beam.axis = tsuya_mat3_apply_transposed(shot->camera_from_world.rotation, beam.axis);
        if (shot->aperture_m > 0.0) {
            through_pupil(s, 4 * counter + 2, &origin, &direction);
        }
        direction = tsuya_mat3_apply_transposed(shot->camera_from_world.rotation, direction);
        tsuya_ray ray = {{(float)origin.x, (float)origin.y, (float)origin.z},
                         {(float)direction.x, (float)direction.y, (float)direction.z}, 0.0f, INFINITY};
        tsuya_ray_hit hit;
        if (tsuya_ray_scene_intersect(s->studio->rays, &ray, &hit)) {
            tsuya_studio_shade(s->studio, &hit, tsuya_vec3_mad(origin, (double)hit.distance, direction), direction, &beam, &cache, rgb);
            cell[3] = hit.triangle < s->studio->cloth_triangles ? 1.0f : 0.0f;
        } else {
            background(s->studio, origin, direction, rgb);
        }
        for (int c = 0; c < 3; c++) {
            cell[c] = (float)rgb[c];
        }
    }
}

/* Row y of pixels: its cells, and what every pixel takes along each of their rows, into `across`. */
static void shoot_row(const shooting *s, int y, float *fine, float *across)
{
    const tsuya_camera *camera = &s->shot->camera;
    const tsuya_studio_spread *spread = &s->spread;
    pixel_lens lens = {.next_known = false};
    for (int x = -spread->reach; x < camera->width_px + spread->reach; x++) {
        lens_move(&lens, camera, x, y);
        shoot_pixel(s, &lens, x, y, fine + CHANNELS * (size_t)((x + spread->reach) * spread->side));
    }
    for (int j = 0; j < spread->side; j++) {
        const float *row = fine + CHANNELS * (size_t)j * row_cells(s);
        float *out = across + (size_t)j * row_pixels(s);
        for (int x = 0; x < camera->width_px; x++) {
            float sum[CHANNELS] = {0};
            for (int i = 0; i < spread->count; i++) {
                const float w = (float)spread->weight[i];
                for (int c = 0; c < CHANNELS; c++) {
                    sum[c] += w * row[CHANNELS * (x * spread->side + i) + c];
                }
            }
            memcpy(out + CHANNELS * x, sum, sizeof sum);
        }
    }
}

/* Row y of the photograph from the rows of cells about it. */
static void gather_row(tsuya_image *radiance, tsuya_image *coverage, const shooting *s, int y, const float *across)
{
    const size_t stride = row_pixels(s);
    for (int x = 0; x < s->shot->camera.width_px; x++) {
        float sum[CHANNELS] = {0}, *rgb = tsuya_image_f32(radiance, x, y);
        for (int j = 0; j < s->spread.count; j++) {
            const float w = (float)s->spread.weight[j], *from = across + (size_t)j * stride + CHANNELS * (size_t)x;
            for (int c = 0; c < CHANNELS; c++) {
                sum[c] += w * from[c];
            }
        }
        const double factor = falloff(s->shot, x, y);
        for (int c = 0; c < 3; c++) {
            rgb[c] = (float)(factor * (double)sum[c]);
        }
        *tsuya_image_u8(coverage, x, y) = (uint8_t)lroundf(255.0f * fminf(sum[3], 1.0f));
    }
}

/* Band after band; the last rows of cells of one are the first of the next. */
static void shoot_bands(tsuya_image *radiance, tsuya_image *coverage, const shooting *s)
{
    const int height = s->shot->camera.height_px, reach = s->spread.reach;
    const size_t pixel_row = (size_t)s->spread.side * row_pixels(s), cells = CHANNELS * (size_t)s->spread.side * row_cells(s);
    int known = -reach; /* rows below this one are shot */
    for (int top = 0; top < height && !tsuya_interrupted(); top += BAND) {
        const int end = top + BAND < height ? top + BAND : height, first = top - reach;
#pragma omp parallel for schedule(dynamic, 4) num_threads(s->threads)
        for (int y = known; y < end + reach; y++) {
            if (!tsuya_interrupted()) {
                shoot_row(s, y, s->fine + (size_t)omp_get_thread_num() * cells, s->across + (size_t)(y - first) * pixel_row);
            }
        }
        known = end + reach;
#pragma omp parallel for schedule(static) num_threads(s->threads)
        for (int y = top; y < end; y++) {
            gather_row(radiance, coverage, s, y, s->across + (size_t)(y - reach - first) * pixel_row);
        }
        memmove(s->across, s->across + (size_t)(end - top) * pixel_row, 2 * (size_t)reach * pixel_row * sizeof *s->across);
    }
}

tsuya_status tsuya_studio_shoot(tsuya_image *radiance, tsuya_image *coverage, const tsuya_studio *studio, const tsuya_studio_shot *shot,
                                const tsuya_context *context)
{
    const tsuya_camera *camera = &shot->camera;
    shooting s = {.studio = studio, .shot = shot, .eye = tsuya_pose_center(shot->camera_from_world), .seed = context->seed, .threads = context->threads};
    tsuya_status status;
    *radiance = *coverage = (tsuya_image){0};
    TSUYA_GOTO_DONE(status, tsuya_studio_spread_create(&s.spread, shot->blur_px, (int)fmax(1.0, floor(sqrt(shot->spp)))));
    TSUYA_NEW(status, s.fine, (size_t)s.threads * (size_t)s.spread.side * row_cells(&s) * CHANNELS);
    TSUYA_NEW(status, s.across, (size_t)(BAND + 2 * s.spread.reach) * (size_t)s.spread.side * row_pixels(&s));
    TSUYA_GOTO_DONE(status, tsuya_image_create(radiance, camera->width_px, camera->height_px, 3, TSUYA_SAMPLE_F32, TSUYA_ENCODING_LINEAR));
    TSUYA_GOTO_DONE(status, tsuya_image_create(coverage, camera->width_px, camera->height_px, 1, TSUYA_SAMPLE_U8, TSUYA_ENCODING_DATA));
    shoot_bands(radiance, coverage, &s);
    status = tsuya_check_interrupt();
done:
    if (status != TSUYA_OK) {
        tsuya_image_free(radiance);
        tsuya_image_free(coverage);
    }
    tsuya_studio_spread_free(&s.spread);
    tsuya_free(s.fine);
    tsuya_free(s.across);
    return status;
}
