#include "render/path.h"

#include "core/clones.h"
#include "core/color.h"
#include "core/memory.h"
#include "core/order.h"

#include "render/noise.h"
#include "render/trace.h"

#include <math.h>
#include <omp.h>
#include <stdio.h>
#include <string.h>

enum { TILE_PX = 16 };

/* Stream of the rays that look for the cloth, apart from every pixel's own. */
static const uint64_t FINDER = 0x66696e646572;

tsuya_path_options tsuya_path_options_default(void)
{
    return (tsuya_path_options){.spp = 64, .bounces = 4, .lamps_visible = true, .strategy = TSUYA_STRATEGY_MIS};
}

typedef struct picture {
    tsuya_tracer tracer;
    const tsuya_camera *camera;
    tsuya_pose camera_from_world;
    tsuya_vec3 eye;
    bool plain; /* the lens does not bend: rays run along base + x right + y down, in the world */
    tsuya_vec3 base, right, down;
    uint64_t seed;
    tsuya_pixel_sum *sum;
    tsuya_noise_plan plan; /* target is always there, the rest where noise is asked for */
    /* For the progress: of the tiles that are done in this pass. */
    double noise_sum;
    size_t noise_pixels;
} picture;

static bool camera_ray(const picture *p, double x, double y, tsuya_vec3 *direction)
{
    tsuya_vec3 ray;
    if (p->plain) {
        ray = tsuya_vec3_mad(tsuya_vec3_mad(p->base, x, p->right), y, p->down);
        *direction = tsuya_vec3_scale(ray, 1.0 / tsuya_vec3_norm(ray));
        return true;
    }
    if (!tsuya_camera_unproject(p->camera, (tsuya_vec2){x, y}, &ray)) {
        return false;
    }
    *direction = tsuya_mat3_apply_transposed(p->camera_from_world.rotation, ray);
    return true;
}

/* Where the lens does not bend, rays are linear in the pixel. */
static void straighten(picture *p)
{
    const tsuya_camera *c = p->camera;
    tsuya_mat3 r = p->camera_from_world.rotation;
    p->right = tsuya_mat3_apply_transposed(r, (tsuya_vec3){1.0 / c->fx_px, 0.0, 0.0});
    p->down = tsuya_mat3_apply_transposed(r, (tsuya_vec3){0.0, 1.0 / c->fy_px, 0.0});
    p->base = tsuya_mat3_apply_transposed(r, (tsuya_vec3){-c->cx_px / c->fx_px, -c->cy_px / c->fy_px, 1.0});
}

/* What one thread has on its way. */
typedef struct traffic {
    tsuya_wave *wave;
    struct { int x, y; } pixel[TSUYA_WAVE]; /* of each path */
    uint64_t rays;
} traffic;

/* Directions through x + u, y + v where the lens does not bend. */
TSUYA_CLONES("arch=x86-64-v4", "arch=x86-64-v3", "default") static void
plain_rays(const picture *p, int count, const float *restrict x, const float *restrict y, const float *restrict u, const float *restrict v,
           tsuya_planes3 *restrict direction)
{
    const tsuya_vec3 base = p->base, right = p->right, down = p->down;
#pragma omp simd
    for (int k = 0; k < count; ++k) {
        double i = (double)x[k] - 0.5 + (double)u[k], j = (double)y[k] - 0.5 + (double)v[k];
        double a = base.x + i * right.x + j * down.x, b = base.y + i * right.y + j * down.y, c = base.z + i * right.z + j * down.z;
        double scale = 1.0 / sqrt(a * a + b * b + c * c);
        direction->x[k] = (float)(a * scale);
        direction->y[k] = (float)(b * scale);
        direction->z[k] = (float)(c * scale);
    }
}

/* The camera's rays of some paths. */
static void aim(const picture *p, traffic *t, int from, int count)
{
    _Alignas(64) float x[TSUYA_LANES], y[TSUYA_LANES], u[TSUYA_LANES], v[TSUYA_LANES];
    uint32_t key[TSUYA_LANES], sample[TSUYA_LANES];
    const int padded = tsuya_lanes_padded(count);
    tsuya_planes3 direction;
    for (int k = 0; k < padded; ++k) {
        int i = from + (k < count ? k : 0);
        key[k] = t->wave->walker[i].key;
        sample[k] = t->wave->walker[i].sample;
        x[k] = (float)t->pixel[i].x;
        y[k] = (float)t->pixel[i].y;
    }
    tsuya_sampler_pairs(key, sample, padded, TSUYA_PAIR_PIXEL, u, v);
    if (p->plain) {
        plain_rays(p, padded, x, y, u, v, &direction);
    }
    for (int k = 0; k < count; ++k) {
        tsuya_walker *w = &t->wave->walker[from + k];
        tsuya_vec3 bent = {0, 0, 1};
        w->blank = !p->plain && !camera_ray(p, (double)x[k] - 0.5 + (double)u[k], (double)y[k] - 0.5 + (double)v[k], &bent);
        tsuya_vec3f d = p->plain ? tsuya_lane(&direction, k) : (tsuya_vec3f){(float)bent.x, (float)bent.y, (float)bent.z};
        w->ray = (tsuya_ray){{(float)p->eye.x, (float)p->eye.y, (float)p->eye.z}, {d.x, d.y, d.z}, 0.0f, INFINITY};
    }
}

/* Traces the wave, and gives the pixels what their samples found; samples that the lens cannot invert are black. */
static void land(const picture *p, traffic *t)
{
    for (int k = 0; k < t->wave->count; k += TSUYA_LANES) {
        aim(p, t, k, t->wave->count - k < TSUYA_LANES ? t->wave->count - k : TSUYA_LANES);
    }
    t->rays += tsuya_trace(&p->tracer, t->wave);
    for (int k = 0; k < t->wave->count; ++k) {
        const tsuya_walker *w = &t->wave->walker[k];
        const double rgb[3] = {(double)w->rgb[0], (double)w->rgb[1], (double)w->rgb[2]};
        tsuya_pixel_add(&p->sum[(size_t)t->pixel[k].y * (size_t)p->camera->width_px + (size_t)t->pixel[k].x], rgb, w->met);
    }
    t->wave->count = 0;
}

/* Brings a pixel to its target, once the wave has landed; its samples go in bundles. */
static void start_pixel(const picture *p, traffic *t, int x, int y)
{
    const size_t pixel = (size_t)y * (size_t)p->camera->width_px + (size_t)x;
    tsuya_wave *w = t->wave;
    tsuya_sampler next = tsuya_sampler_start(p->seed, pixel, p->sum[pixel].samples);
    while (next.sample < p->plan.target[pixel]) {
        if (w->count + TSUYA_RAY_PACKET > TSUYA_WAVE) {
            land(p, t);
        }
        uint8_t bundle = w->count > 0 ? (uint8_t)(w->walker[w->count - 1].bundle + 1) : 0;
        for (int k = 0; k < TSUYA_RAY_PACKET && next.sample < p->plan.target[pixel]; ++k, ++next.sample) {
            t->pixel[w->count].x = x;
            t->pixel[w->count].y = y;
            w->walker[w->count].key = next.key;
            w->walker[w->count].sample = next.sample;
            w->walker[w->count++].bundle = bundle;
        }
    }
}

typedef struct tile { int x0, y0, x1, y1; } tile;

static tile tile_at(const picture *p, int index)
{
    int columns = (p->camera->width_px + TILE_PX - 1) / TILE_PX;
    tile t = {index % columns * TILE_PX, index / columns * TILE_PX, 0, 0};
    t.x1 = t.x0 + TILE_PX < p->camera->width_px ? t.x0 + TILE_PX : p->camera->width_px;
    t.y1 = t.y0 + TILE_PX < p->camera->height_px ? t.y0 + TILE_PX : p->camera->height_px;
    return t;
}

static int tile_count(const picture *p)
{
    return ((p->camera->width_px + TILE_PX - 1) / TILE_PX) * ((p->camera->height_px + TILE_PX - 1) / TILE_PX);
}

/* The noise so far belongs to what is shown and to nothing else: sums in the order in which tiles end. */
static void tell_progress(picture *p, tile t, double done, const tsuya_context *context)
{
    double sum = 0.0;
    size_t pixels = 0;
    char text[48];
    for (int y = t.y0; y < t.y1; ++y) {
        for (int x = t.x0; x < t.x1; ++x) {
            const tsuya_pixel_sum *s = &p->sum[(size_t)y * (size_t)p->camera->width_px + (size_t)x];
            if (s->met == s->samples && s->samples > 1) {
                sum += tsuya_pixel_relative_error(s);
                ++pixels;
            }
        }
    }
#pragma omp critical(tsuya_path_progress)
    {
        p->noise_sum += sum;
        p->noise_pixels += pixels;
        snprintf(text, sizeof text, "noise %.1f %%", p->noise_pixels > 0 ? 100.0 * p->noise_sum / (double)p->noise_pixels : 0.0);
    }
    tsuya_progress_update(context, "render", done, 1.0, text);
}

static tsuya_status create_traffic(traffic **all, const picture *p, int threads)
{
    tsuya_status status = TSUYA_OK;
    TSUYA_NEW(status, *all, (size_t)threads);
    for (int k = 0; k < threads; ++k) {
        TSUYA_GOTO_DONE(status, tsuya_wave_create(&(*all)[k].wave, &p->tracer));
    }
done:
    return status;
}

static void free_traffic(traffic *all, int threads)
{
    for (int k = 0; all && k < threads; ++k) {
        tsuya_wave_free(all[k].wave);
    }
    tsuya_free(all);
}

static void render_tile(const picture *p, traffic *t, tile at)
{
    for (int y = at.y0; y < at.y1; ++y) {
        for (int x = at.x0; x < at.x1; ++x) {
            start_pixel(p, t, x, y);
        }
    }
    land(p, t);
}

/* Brings every pixel to its target. */
static tsuya_status render_tiles(picture *p, const tsuya_context *context, double done_before, double done_after, uint64_t *rays)
{
    int tiles = tile_count(p), finished = 0;
    tsuya_status status = TSUYA_OK;
    traffic *all = NULL;
    p->noise_sum = 0.0;
    p->noise_pixels = 0;
    TSUYA_GOTO_DONE(status, create_traffic(&all, p, context->threads));
#pragma omp parallel for schedule(dynamic, 1) num_threads(context->threads)
    for (int index = 0; index < tiles; ++index) {
        if (tsuya_interrupted()) {
            continue;
        }
        tile t = tile_at(p, index);
        int now;
        render_tile(p, &all[omp_get_thread_num()], t);
#pragma omp atomic capture
        now = ++finished;
        if (context->progress) {
            tell_progress(p, t, done_before + (done_after - done_before) * now / tiles, context);
        }
    }
    for (int k = 0; k < context->threads; ++k) {
        *rays += all[k].rays;
    }
    status = tsuya_check_interrupt();
done:
    free_traffic(all, context->threads);
    return status;
}

/* Whether a ray of its own through the pixel meets the cloth. */
static bool finds_cloth(const picture *p, int x, int y)
{
    size_t k = (size_t)y * (size_t)p->camera->width_px + (size_t)x;
    tsuya_vec3 direction;
    tsuya_ray_hit hit;
    double u[2];
    tsuya_sampler_pair(tsuya_sampler_start(p->seed ^ FINDER, k, 0), TSUYA_PAIR_PIXEL, u);
    if (!camera_ray(p, x - 0.5 + u[0], y - 0.5 + u[1], &direction)) {
        return false;
    }
    tsuya_ray ray = {{(float)p->eye.x, (float)p->eye.y, (float)p->eye.z},
                     {(float)direction.x, (float)direction.y, (float)direction.z}, 0.0f, INFINITY};
    return tsuya_scene_intersect(p->tracer.scene, &ray, &hit);
}

/* Marks the pixels whose rays meet the cloth, and plans all pilots. */
static uint64_t find_cloth(picture *p, const tsuya_context *context)
{
    int width = p->camera->width_px, height = p->camera->height_px;
#pragma omp parallel for schedule(dynamic, 8) num_threads(context->threads)
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            p->plan.cloth[(size_t)y * (size_t)width + (size_t)x] = finds_cloth(p, x, y) ? 2 : 0;
        }
    }
    tsuya_noise_plan_pilots(&p->plan, TSUYA_PATH_PILOT_SPP);
    return (uint64_t)width * (uint64_t)height;
}

static void fill_film(tsuya_film *film, tsuya_path_info *info, const tsuya_pixel_sum *sum)
{
    size_t pixels = (size_t)film->width_px * (size_t)film->height_px;
    uint64_t samples = 0;
    for (size_t k = 0; k < pixels; ++k) {
        double n = sum[k].samples > 0 ? sum[k].samples : 1.0;
        for (size_t c = 0; c < 3; ++c) {
            film->rgb[3 * k + c] = (float)(sum[k].rgb[c] / n);
        }
        film->alpha[k] = (float)(sum[k].met / n);
        film->error[k] = (float)tsuya_pixel_error(&sum[k]);
        film->samples[k] = sum[k].samples;
        samples += sum[k].samples;
    }
    info->spp_mean = (double)samples / (double)pixels;
}

static tsuya_status measure_noise(double *median, const tsuya_film *film, const tsuya_pixel_sum *sum)
{
    size_t pixels = (size_t)film->width_px * (size_t)film->height_px, count = 0;
    float *relative = tsuya_calloc(pixels, sizeof *relative);
    if (!relative) {
        return TSUYA_ERROR_MEMORY;
    }
    for (size_t k = 0; k < pixels; ++k) {
        if (film->alpha[k] > 0.99f && sum[k].mean > 0.0) {
            relative[count++] = (float)tsuya_pixel_relative_error(&sum[k]);
        }
    }
    *median = count > 0 ? (double)tsuya_select_float(relative, count, count / 2) : 0.0;
    tsuya_free(relative);
    return TSUYA_OK;
}

static tsuya_status check(const tsuya_camera *camera, const tsuya_path_options *o)
{
    if (camera->width_px < 1 || camera->height_px < 1 || camera->width_px > 65535 || camera->height_px > 65535) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "render: size %d × %d; expected 1 to 65535 a side", camera->width_px, camera->height_px);
    }
    if (o->spp < 1 || o->spp > 1 << 20 || o->bounces < 1 || o->bounces > 1000) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "render: spp %d, bounces %d; expected 1 to 1048576 and 1 to 1000", o->spp, o->bounces);
    }
    if (!(o->noise >= 0.0 && isfinite(o->noise))) {
        return tsuya_fail(TSUYA_ERROR_INPUT, "render: noise %g; expected a relative error such as 0.02, or 0", o->noise);
    }
    return TSUYA_OK;
}

static tsuya_status render_all(picture *p, size_t pixels, uint64_t *rays, const tsuya_context *context)
{
    const tsuya_path_options *o = p->tracer.options;
    if (!(o->noise > 0.0 && o->spp > TSUYA_NOISE_BLOCK)) {
        for (size_t k = 0; k < pixels; ++k) {
            p->plan.target[k] = (uint32_t)o->spp;
        }
        return render_tiles(p, context, 0.0, 1.0, rays);
    }
    tsuya_status status = TSUYA_OK;
    TSUYA_NEW(status, p->plan.cloth, pixels);
    *rays += find_cloth(p, context);
    TSUYA_GOTO_DONE(status, render_tiles(p, context, 0.0, 0.2, rays));
    TSUYA_GOTO_DONE(status, tsuya_noise_plan_samples(&p->plan));
    TSUYA_GOTO_DONE(status, render_tiles(p, context, 0.2, 1.0, rays));
done:
    tsuya_free(p->plan.cloth);
    return status;
}

static bool bends(const tsuya_camera *camera)
{
    for (int k = 0; k < 12; ++k) {
        if (camera->distortion[k] != 0.0) {
            return true;
        }
    }
    return camera->lens == TSUYA_LENS_SPLINED_STEREOGRAPHIC;
}

tsuya_status tsuya_path_render(tsuya_film *film, tsuya_path_info *info, const tsuya_scene *scene, const tsuya_light_set *lights,
                               const tsuya_camera *camera, tsuya_pose camera_from_world, const tsuya_path_options *options,
                               const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    double start = tsuya_clock_s();
    picture p = {.camera = camera, .camera_from_world = camera_from_world,
                 .eye = tsuya_pose_center(camera_from_world), .plain = !bends(camera), .seed = context->seed};
    *film = (tsuya_film){camera->width_px, camera->height_px, NULL, NULL, NULL, NULL};
    *info = (tsuya_path_info){0};
    TSUYA_TRY(check(camera, options));
    TSUYA_TRY(tsuya_tracer_create(&p.tracer, scene, lights, options));
    straighten(&p);
    p.plan = (tsuya_noise_plan){camera->width_px, camera->height_px, context->threads, options->noise, options->spp, NULL, NULL, NULL};
    size_t pixels = (size_t)camera->width_px * (size_t)camera->height_px;
    TSUYA_NEW(status, film->rgb, 3 * pixels);
    TSUYA_NEW(status, film->alpha, pixels);
    TSUYA_NEW(status, film->error, pixels);
    TSUYA_NEW(status, film->samples, pixels);
    TSUYA_NEW(status, p.sum, pixels);
    TSUYA_NEW(status, p.plan.target, pixels);
    p.plan.sum = p.sum;
    TSUYA_GOTO_DONE(status, render_all(&p, pixels, &info->rays, context));
    fill_film(film, info, p.sum);
    TSUYA_GOTO_DONE(status, measure_noise(&info->noise_median, film, p.sum));
    info->seconds = tsuya_clock_s() - start;
done:
    tsuya_free(p.sum);
    tsuya_free(p.plan.target);
    tsuya_tracer_free(&p.tracer);
    if (status != TSUYA_OK) {
        tsuya_film_free(film);
    }
    return status;
}

void tsuya_film_free(tsuya_film *film)
{
    tsuya_free(film->rgb);
    tsuya_free(film->alpha);
    tsuya_free(film->error);
    tsuya_free(film->samples);
    *film = (tsuya_film){0};
}
