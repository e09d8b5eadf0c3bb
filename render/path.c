#include "render/path.h"

#include "core/color.h"
#include "core/memory.h"

#include "render/trace.h"

#include <math.h>
#include <omp.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

enum { TILE_PX = 16, BLOCK = 4, EMPTY_SPP = BLOCK, AROUND = 3, SIDE = 2 * AROUND + 1 };

/* Stream of the rays that look for the cloth, apart from every pixel's own. */
static const uint64_t FINDER = 0x66696e646572;

tsuya_path_options tsuya_path_options_default(void)
{
    return (tsuya_path_options){.spp = 64, .bounces = 4, .lamps_visible = true, .strategy = TSUYA_STRATEGY_MIS};
}

/* Running sums of a pixel, enough to go on with it later. */
typedef struct pixel_sum {
    double rgb[3], mean, spread; /* Welford's mean and sum of squares of the luminance */
    double block, block_mean, block_spread; /* the same of the means of BLOCK samples that stratify each other */
    double met_sum;              /* of the luminance of samples that met the cloth */
    uint32_t samples, met;
} pixel_sum;

static void add_to_block(pixel_sum *sum, double luminance)
{
    sum->block += luminance / BLOCK;
    if (sum->samples % BLOCK == 0) {
        double d = sum->block - sum->block_mean;
        sum->block_mean += d / (sum->samples / BLOCK);
        sum->block_spread += d * (sum->block - sum->block_mean);
        sum->block = 0.0;
    }
}

static void add_sample(pixel_sum *sum, const double rgb[3], bool met)
{
    double luminance = tsuya_rgb_luminance(rgb), d = luminance - sum->mean;
    sum->samples++;
    sum->mean += d / sum->samples;
    sum->spread += d * (luminance - sum->mean);
    sum->met += met;
    sum->met_sum += met ? luminance : 0.0;
    add_to_block(sum, luminance);
    for (int c = 0; c < 3; ++c) {
        sum->rgb[c] += rgb[c];
    }
}

typedef struct picture {
    tsuya_tracer tracer;
    const tsuya_camera *camera;
    tsuya_pose camera_from_world;
    tsuya_vec3 eye;
    bool plain; /* the lens does not bend: rays run along base + x right + y down, in the world */
    tsuya_vec3 base, right, down;
    uint64_t seed;
    pixel_sum *sum;
    uint32_t *target; /* samples that each pixel shall have */
    uint8_t *cloth;   /* at or near the cloth; NULL: not looked for */
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

/* Samples of one pixel that go as a bundle; behind those that have a lane, `blank` ones that the lens cannot invert. */
typedef struct bundle { size_t pixel; int count, blank; } bundle;

/* What one thread has on its way. */
typedef struct traffic {
    tsuya_wave *wave;
    bundle bundle[TSUYA_WAVE]; /* of the wave, in order */
    int bundles;
    uint64_t rays;
} traffic;

/* Puts the next samples of a pixel on the wave. */
static void start_bundle(const picture *p, traffic *t, size_t pixel, tsuya_sampler first, int wanted)
{
    const int width = p->camera->width_px, x = (int)(pixel % (size_t)width), y = (int)(pixel / (size_t)width);
    uint32_t key[TSUYA_WAVE_VECTOR], sample[TSUYA_WAVE_VECTOR];
    float u[2][TSUYA_WAVE_VECTOR];
    tsuya_wave *w = t->wave;
    bundle *b = &t->bundle[t->bundles];
    for (uint32_t k = 0; k < TSUYA_WAVE_VECTOR; ++k) {
        key[k] = first.key;
        sample[k] = first.sample + k;
    }
    tsuya_sampler_pairs(key, sample, TSUYA_WAVE_VECTOR, TSUYA_PAIR_PIXEL, u[0], u[1]);
    *b = (bundle){.pixel = pixel};
    for (int k = 0; k < wanted; ++k) {
        tsuya_vec3 direction;
        if (!camera_ray(p, x - 0.5 + (double)u[0][k], y - 0.5 + (double)u[1][k], &direction)) {
            b->blank++;
            continue;
        }
        const int lane = w->count++;
        w->key[lane] = key[k];
        w->sample[lane] = sample[k];
        w->bundle[lane] = (uint8_t)t->bundles;
        tsuya_planes3_set(&w->origin, lane, p->eye);
        tsuya_planes3_set(&w->direction, lane, direction);
        b->count++;
    }
    t->bundles++;
}

/* Traces the wave, and gives the pixels what their samples found. */
static void land(const picture *p, traffic *t)
{
    const double black[3] = {0, 0, 0};
    const tsuya_wave *w = t->wave;
    int lane = 0;
    t->rays += tsuya_trace(&p->tracer, t->wave);
    for (int k = 0; k < t->bundles; ++k) {
        pixel_sum *sum = &p->sum[t->bundle[k].pixel];
        for (int i = 0; i < t->bundle[k].count; ++i, ++lane) {
            add_sample(sum, (const double[3]){w->rgb[0][lane], w->rgb[1][lane], w->rgb[2][lane]}, w->met[lane]);
        }
        for (int i = 0; i < t->bundle[k].blank; ++i) {
            add_sample(sum, black, false);
        }
    }
    t->wave->count = t->bundles = 0;
}

/* Brings a pixel to its target, once the wave has landed. */
static void start_pixel(const picture *p, traffic *t, size_t pixel)
{
    tsuya_sampler next = tsuya_sampler_start(p->seed, pixel, p->sum[pixel].samples);
    while (next.sample < p->target[pixel]) {
        uint32_t wanted = p->target[pixel] - next.sample;
        wanted = wanted < TSUYA_RAY_PACKET ? wanted : TSUYA_RAY_PACKET;
        if (t->wave->count + TSUYA_RAY_PACKET > TSUYA_WAVE || t->bundles == TSUYA_WAVE) {
            land(p, t);
        }
        start_bundle(p, t, pixel, next, (int)wanted);
        next.sample += wanted;
    }
}

/* Variance of a mean of n samples, a/n + b/n^1.5: what chance decides, and edges of all kinds, whose stratified samples err
 * by the strata that the edge crosses alone (Mitchell, "Consequences of stratified sampling in graphics", SIGGRAPH 1996). */
typedef struct variance_law { double a, b; } variance_law;

static double variance_of_mean(variance_law law, double n) { return law.a / n + law.b / (n * sqrt(n)); }

/* From the variance of samples, that of means of BLOCK of them, and the part of the former that the cloth's outline makes. */
static variance_law law_from(double of_samples, double of_blocks, double of_outline)
{
    const double edge = 1.0 - 1.0 / sqrt(BLOCK);
    double b = fmin(fmax((of_samples - BLOCK * of_blocks) / edge, of_outline), of_samples);
    return (variance_law){of_samples - b, b};
}

/* Variance that samples would have if cloth and background each were one grey. */
static double outline_variance(const pixel_sum *s)
{
    if (s->met == 0 || s->met == s->samples) {
        return 0.0;
    }
    double share = (double)s->met / s->samples, cloth = s->met_sum / s->met;
    double background = (s->mean * s->samples - s->met_sum) / (s->samples - s->met);
    return share * (1.0 - share) * (cloth - background) * (cloth - background);
}

static variance_law own_law(const pixel_sum *s)
{
    double n = s->samples, blocks = floor(n / BLOCK), of_samples = n > 1.0 ? s->spread / (n - 1.0) : 0.0;
    return law_from(of_samples, blocks > 1.0 ? s->block_spread / (blocks - 1.0) : of_samples / BLOCK, outline_variance(s));
}

/* Standard error of the mean's luminance. */
static double standard_error(const pixel_sum *s)
{
    return s->samples > 1 ? sqrt(variance_of_mean(own_law(s), s->samples)) : 0.0;
}

static double relative_error(const pixel_sum *s) { return s->mean > 0.0 ? standard_error(s) / s->mean : 0.0; }

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
            const pixel_sum *s = &p->sum[(size_t)y * (size_t)p->camera->width_px + (size_t)x];
            if (s->met == s->samples && s->samples > 1) {
                sum += relative_error(s);
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
            start_pixel(p, t, (size_t)y * (size_t)p->camera->width_px + (size_t)x);
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

/* Marks the pixels within AROUND of one whose ray met the cloth, and plans their pilots. */
static uint64_t find_cloth(picture *p, int spp, const tsuya_context *context)
{
    int width = p->camera->width_px, height = p->camera->height_px;
#pragma omp parallel for schedule(dynamic, 8) num_threads(context->threads)
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            p->cloth[(size_t)y * (size_t)width + (size_t)x] = finds_cloth(p, x, y) ? 2 : 0;
        }
    }
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            uint8_t *here = &p->cloth[(size_t)y * (size_t)width + (size_t)x];
            for (int k = 0; k < SIDE * SIDE && *here == 0; ++k) {
                int i = x + k % SIDE - AROUND, j = y + k / SIDE - AROUND;
                *here = i >= 0 && i < width && j >= 0 && j < height && p->cloth[(size_t)j * (size_t)width + (size_t)i] == 2;
            }
            int pilot = *here ? TSUYA_PATH_PILOT_SPP : EMPTY_SPP;
            p->target[(size_t)y * (size_t)width + (size_t)x] = (uint32_t)(pilot < spp ? pilot : spp);
        }
    }
    return (uint64_t)width * (uint64_t)height;
}

typedef struct around { variance_law law; double level; } around;

static around look_around(const picture *p, int x, int y)
{
    double of_samples = 0.0, of_blocks = 0.0, of_outline = 0.0, blocks = 0.0, level = 0.0;
    int count = 0;
    for (int k = 0; k < SIDE * SIDE; ++k) {
        int i = x + k % SIDE - AROUND, j = y + k / SIDE - AROUND;
        if (k != SIDE * SIDE / 2 && i >= 0 && i < p->camera->width_px && j >= 0 && j < p->camera->height_px) {
            const pixel_sum *s = &p->sum[(size_t)j * (size_t)p->camera->width_px + (size_t)i];
            of_samples += s->spread / (s->samples - 1);
            of_blocks += s->block_spread;
            of_outline += outline_variance(s);
            blocks += (s->samples / BLOCK) - 1;
            level += s->mean;
            count++;
        }
    }
    count = count > 0 ? count : 1;
    of_samples /= count;
    return (around){law_from(of_samples, blocks > 0.0 ? of_blocks / blocks : of_samples / BLOCK, of_outline / count), level / count};
}

/* Error aimed at: E times the level; where that is darker than the cloth's mean, as photon noise of a photograph has it that
 * reaches E at the mean, down to a tenth of the mean. */
static double aimed_error(double noise, double level, double cloth)
{
    return noise * fmax(fmax(level, sqrt(fmax(level * cloth, 0.0))), 0.1 * cloth);
}

/* What a pixel has ahead of it: how its error falls, and the error aimed at. */
typedef struct prospect {
    float a, b, aim;
} prospect;

/* Samples until the error is `factor` times the one aimed at. */
static double samples_wanted(const prospect *f, double factor)
{
    double square = pow(factor * f->aim, 2.0);
    return square > 0.0 ? f->a / square + cbrt(pow(f->b / square, 2.0)) : 0.0;
}

static uint32_t samples_planned(const picture *p, size_t k, const prospect *f, double factor)
{
    return (uint32_t)fmin(fmax(BLOCK * ceil(samples_wanted(f, factor) / BLOCK), p->target[k]), p->tracer.options->spp);
}

/* From what is around each pixel; its own values have no part in it. */
static void look_ahead(prospect *ahead, const picture *p, const tsuya_context *context)
{
    int width = p->camera->width_px, height = p->camera->height_px;
    double sum = 0.0, pixels = 0.0, noise = p->tracer.options->noise;
    for (size_t k = 0; k < (size_t)width * (size_t)height; ++k) {
        sum += p->cloth[k] ? p->sum[k].mean : 0.0;
        pixels += p->cloth[k] ? 1.0 : 0.0;
    }
#pragma omp parallel for schedule(static) num_threads(context->threads)
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            size_t k = (size_t)y * (size_t)width + (size_t)x;
            around a = look_around(p, x, y);
            double own = p->cloth[k] ? 1.0 : 0.0, rest = pixels - own;
            double cloth = rest > 0.0 ? (sum - own * p->sum[k].mean) / rest : 0.0;
            ahead[k] = (prospect){(float)a.law.a, (float)a.law.b, (float)aimed_error(noise, a.level, cloth)};
        }
    }
}

/* Whether half of the pixels with `parity` that show cloth would be within the noise asked for, by their own pilots. */
static bool enough(const picture *p, const prospect *ahead, double factor, size_t parity)
{
    size_t width = (size_t)p->camera->width_px, pixels = width * (size_t)p->camera->height_px, within = 0, all = 0;
    for (size_t k = 0; k < pixels; ++k) {
        if (p->cloth[k] == 2 && ((k % width + k / width) & 1) == parity) {
            double n = samples_planned(p, k, &ahead[k], factor);
            ++all;
            within += variance_of_mean(own_law(&p->sum[k]), n) <= pow(p->tracer.options->noise * p->sum[k].mean, 2.0);
        }
    }
    return 2 * within >= all;
}

/* Samples that each pixel needs.  Errors may be larger than aimed at, by one factor for the whole picture, as long as half of the
 * cloth is within the noise asked for. */
static tsuya_status plan_samples(const picture *p, const tsuya_context *context)
{
    static const double leniency[] = {3.0, 2.5, 2.0, 1.75, 1.5, 1.25, 1.0};
    size_t width = (size_t)p->camera->width_px, pixels = width * (size_t)p->camera->height_px;
    double factor[2] = {1.0, 1.0};
    tsuya_status status = TSUYA_OK;
    prospect *ahead = NULL;
    TSUYA_NEW(status, ahead, pixels);
    look_ahead(ahead, p, context);
    for (size_t parity = 0; parity < 2; ++parity) { /* each half follows the other */
        int k = 0;
        while (leniency[k] > 1.0 && !enough(p, ahead, leniency[k], parity)) {
            ++k;
        }
        factor[1 - parity] = leniency[k];
    }
    for (size_t k = 0; k < pixels; ++k) {
        p->target[k] = samples_planned(p, k, &ahead[k], factor[(k % width + k / width) & 1]);
    }
done:
    tsuya_free(ahead);
    return status;
}

static void fill_film(tsuya_film *film, tsuya_path_info *info, const pixel_sum *sum)
{
    size_t pixels = (size_t)film->width_px * (size_t)film->height_px;
    uint64_t samples = 0;
    for (size_t k = 0; k < pixels; ++k) {
        double n = sum[k].samples > 0 ? sum[k].samples : 1.0;
        for (size_t c = 0; c < 3; ++c) {
            film->rgb[3 * k + c] = (float)(sum[k].rgb[c] / n);
        }
        film->alpha[k] = (float)(sum[k].met / n);
        film->error[k] = (float)standard_error(&sum[k]);
        film->samples[k] = sum[k].samples;
        samples += sum[k].samples;
    }
    info->spp_mean = (double)samples / (double)pixels;
}

static int compare_floats(const void *a, const void *b)
{
    float x = *(const float *)a, y = *(const float *)b;
    return (x > y) - (x < y);
}

static tsuya_status measure_noise(double *median, const tsuya_film *film, const pixel_sum *sum)
{
    size_t pixels = (size_t)film->width_px * (size_t)film->height_px, count = 0;
    float *relative = tsuya_calloc(pixels, sizeof *relative);
    if (!relative) {
        return TSUYA_ERROR_MEMORY;
    }
    for (size_t k = 0; k < pixels; ++k) {
        if (film->alpha[k] > 0.99f && sum[k].mean > 0.0) {
            relative[count++] = (float)relative_error(&sum[k]);
        }
    }
    qsort(relative, count, sizeof *relative, compare_floats);
    *median = count > 0 ? relative[count / 2] : 0.0;
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
    if (!(o->noise > 0.0 && o->spp > EMPTY_SPP)) {
        for (size_t k = 0; k < pixels; ++k) {
            p->target[k] = (uint32_t)o->spp;
        }
        return render_tiles(p, context, 0.0, 1.0, rays);
    }
    tsuya_status status = TSUYA_OK;
    TSUYA_NEW(status, p->cloth, pixels);
    *rays += find_cloth(p, o->spp, context);
    TSUYA_GOTO_DONE(status, render_tiles(p, context, 0.0, 0.2, rays));
    TSUYA_GOTO_DONE(status, plan_samples(p, context));
    TSUYA_GOTO_DONE(status, render_tiles(p, context, 0.2, 1.0, rays));
done:
    tsuya_free(p->cloth);
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
    size_t pixels = (size_t)camera->width_px * (size_t)camera->height_px;
    TSUYA_NEW(status, film->rgb, 3 * pixels);
    TSUYA_NEW(status, film->alpha, pixels);
    TSUYA_NEW(status, film->error, pixels);
    TSUYA_NEW(status, film->samples, pixels);
    TSUYA_NEW(status, p.sum, pixels);
    TSUYA_NEW(status, p.target, pixels);
    TSUYA_GOTO_DONE(status, render_all(&p, pixels, &info->rays, context));
    fill_film(film, info, p.sum);
    TSUYA_GOTO_DONE(status, measure_noise(&info->noise_median, film, p.sum));
    info->seconds = tsuya_clock_s() - start;
done:
    tsuya_free(p.sum);
    tsuya_free(p.target);
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
