#include "render/path.h"

#include "core/memory.h"

#include "render/sampler.h"

#include <math.h>
#include <omp.h>
#include <stdlib.h>
#include <string.h>

enum { TILE_PX = 16, PILOT_SPP = 16 };

/* Dimension pairs of a sample: the pixel, then a block per bounce. */
enum { PAIR_PIXEL, PAIR_FIRST, PAIR_LAMP = 0, PAIR_DIRECTION, PAIR_CHOICE, PAIR_TURN, PAIRS_PER_BOUNCE };

typedef struct tracer {
    const tsuya_scene *scene;
    const tsuya_light_set *lights;
    const tsuya_path_options *options;
} tracer;

/* The last point of a path, as the next hit of a lamp needs it. */
typedef struct vertex {
    tsuya_vec3 p, n;
    double pdf;          /* of the direction that left it */
    double lamp_weights; /* sum of tsuya_light_weight there */
} vertex;

tsuya_path_options tsuya_path_options_default(void)
{
    return (tsuya_path_options){.spp = 64, .bounces = 4, .lamps_visible = true, .strategy = TSUYA_STRATEGY_MIS};
}

static tsuya_vec3 to_local(const tsuya_surface *s, tsuya_vec3 w)
{
    return (tsuya_vec3){tsuya_vec3_dot(w, s->x), tsuya_vec3_dot(w, s->y), tsuya_vec3_dot(w, s->n)};
}

static tsuya_vec3 to_world(const tsuya_surface *s, tsuya_vec3 w)
{
    return tsuya_vec3_mad(tsuya_vec3_mad(tsuya_vec3_scale(s->x, w.x), w.y, s->y), w.z, s->n);
}

static tsuya_ray make_ray(tsuya_vec3 origin, tsuya_vec3 direction, double far)
{
    return (tsuya_ray){{(float)origin.x, (float)origin.y, (float)origin.z},
                       {(float)direction.x, (float)direction.y, (float)direction.z},
                       0.0f,
                       far < 3e38 ? (float)far : INFINITY};
}

static void report_ray(const tracer *t, const tsuya_ray *ray, bool shadow)
{
    if (t->options->ray_sink) {
        t->options->ray_sink(t->options->ray_user, ray, shadow);
    }
}

static double power_heuristic(double a, double b)
{
    double r = b / a;
    return 1.0 / (1.0 + r * r);
}

/* Weight of a lamp sample against a direction sample, and the other way round, under the strategy. */
static double lamp_share(const tracer *t, double pdf_lamp, double pdf_direction)
{
    return t->options->strategy == TSUYA_STRATEGY_MIS    ? power_heuristic(pdf_lamp, pdf_direction)
           : t->options->strategy == TSUYA_STRATEGY_BSDF ? 0.0
                                                         : 1.0;
}

static double direction_share(const tracer *t, double pdf_direction, double pdf_lamp)
{
    return t->options->strategy == TSUYA_STRATEGY_MIS     ? power_heuristic(pdf_direction, pdf_lamp)
           : t->options->strategy == TSUYA_STRATEGY_LAMPS ? 0.0
                                                          : 1.0;
}

/* One lamp with a probability in proportion to its weight, by a reservoir of one; −1 when none can shine here. */
static int choose_lamp(const tsuya_light_set *lights, const tsuya_surface *s, double u, double *probability, double *sum)
{
    int chosen = -1;
    double chosen_weight = 0.0, total = 0.0;
    for (int k = 0; k < lights->count; ++k) {
        double w = tsuya_light_weight(&lights->light[k], s->p, s->n);
        if (!(w > 0.0)) {
            continue;
        }
        total += w;
        double q = w / total;
        if (u < q) {
            chosen = k;
            chosen_weight = w;
            u /= q;
        } else {
            u = (u - q) / (1.0 - q);
        }
    }
    *sum = total;
    *probability = total > 0.0 ? chosen_weight / total : 0.0;
    return chosen;
}

static bool lamp_visible(const tracer *t, const tsuya_surface *s, const tsuya_light_sample *sample, uint64_t *rays)
{
    tsuya_vec3 origin, direction = sample->wi;
    if (!tsuya_surface_ray_origin(t->scene, s, sample->wi, &origin)) {
        return false;
    }
    double far = INFINITY;
    if (isfinite(sample->distance_m)) {
        tsuya_vec3 d = tsuya_vec3_sub(tsuya_vec3_mad(s->p, sample->distance_m, sample->wi), origin);
        far = tsuya_vec3_norm(d) * (1.0 - 1e-5);
        direction = tsuya_vec3_unit(d);
    }
    tsuya_ray ray = make_ray(origin, direction, far);
    ++*rays;
    report_ray(t, &ray, true);
    return !tsuya_scene_occluded(t->scene, &ray);
}

/* Light from one lamp, chosen and sampled. */
static void add_lamp(const tracer *t, const tsuya_surface *s, tsuya_vec3 wo, tsuya_sampler sampler, uint32_t pair, double choice,
                     const double throughput[3], double rgb[3], double *lamp_weights, uint64_t *rays)
{
    double probability, u[2], f[3];
    int k = choose_lamp(t->lights, s, choice, &probability, lamp_weights);
    tsuya_light_sample sample;
    if (k < 0 || t->options->strategy == TSUYA_STRATEGY_BSDF) {
        return;
    }
    tsuya_sampler_pair(sampler, pair, u);
    if (!tsuya_light_sample_at(&t->lights->light[k], s->p, s->n, u, &sample)) {
        return;
    }
    tsuya_vec3 wi = to_local(s, sample.wi);
    if (!(wi.z > 0.0)) {
        return;
    }
    double pdf_direction = s->shader->eval_pdf(s->shader->user, s->dye, wi, wo, f);
    double pdf_lamp = sample.pdf * probability;
    double scale = wi.z / pdf_lamp * (sample.delta ? 1.0 : lamp_share(t, pdf_lamp, pdf_direction));
    double value[3], most = 0.0;
    for (int c = 0; c < 3; ++c) {
        value[c] = throughput[c] * f[c] * sample.rgb[c] * scale;
        most = fmax(most, value[c]);
    }
    if (most > 0.0 && lamp_visible(t, s, &sample, rays)) {
        for (int c = 0; c < 3; ++c) {
            rgb[c] += value[c];
        }
    }
}

/* Lamps that a ray runs into before `distance`; last NULL: seen by the camera itself. */
static void add_lamps_hit(const tracer *t, const vertex *last, tsuya_vec3 origin, tsuya_vec3 direction, double distance,
                          const double throughput[3], double rgb[3])
{
    for (int k = 0; k < t->lights->count; ++k) {
        const tsuya_light *light = &t->lights->light[k];
        double lamp_distance, emitted[3], pdf, share = 1.0;
        bool skipped = !last && light->kind != TSUYA_LIGHT_ENVIRONMENT && !t->options->lamps_visible;
        tsuya_vec3 from = last ? last->p : origin, n = last ? last->n : direction;
        if (skipped || !tsuya_light_hit(light, from, n, direction, &lamp_distance, emitted, &pdf)) {
            continue;
        }
        if (lamp_distance > distance || (isinf(lamp_distance) && isfinite(distance))) {
            continue;
        }
        if (last) {
            double weight = tsuya_light_weight(light, last->p, last->n);
            share = direction_share(t, last->pdf, last->lamp_weights > 0.0 ? pdf * weight / last->lamp_weights : 0.0);
        }
        for (int c = 0; c < 3; ++c) {
            rgb[c] += throughput[c] * emitted[c] * share;
        }
    }
}

/* Draws the next direction; false when the path ends. */
static bool scatter(const tracer *t, const tsuya_surface *s, tsuya_vec3 wo, const double u[3], double throughput[3], vertex *last,
                    tsuya_vec3 *origin, tsuya_vec3 *direction)
{
    tsuya_vec3 wi;
    double f[3], most = 0.0;
    if (!s->shader->sample(s->shader->user, s->dye, wo, u, &wi)) {
        return false;
    }
    double pdf = s->shader->eval_pdf(s->shader->user, s->dye, wi, wo, f);
    if (!(pdf > 0.0)) {
        return false;
    }
    for (int c = 0; c < 3; ++c) {
        throughput[c] *= f[c] * wi.z / pdf;
        most = fmax(most, throughput[c]);
    }
    *direction = tsuya_vec3_unit(to_world(s, wi));
    last->p = s->p;
    last->n = s->n;
    last->pdf = pdf;
    return most > 0.0 && tsuya_surface_ray_origin(t->scene, s, *direction, origin);
}

/* Where the weft is unknown: the frame turned by a uniform angle, which averages the reflectance over the azimuth. */
static void turn_frame(tsuya_surface *s, double u)
{
    double angle = 2.0 * M_PI * u, c = cos(angle), k = sin(angle);
    tsuya_vec3 x = s->x, y = s->y;
    s->x = tsuya_vec3_mad(tsuya_vec3_scale(x, c), k, y);
    s->y = tsuya_vec3_mad(tsuya_vec3_scale(y, c), -k, x);
}

/* Paths that carry little go on rarely, and then for more.  At the hit, so that lamps met on the way have been counted. */
static bool survives(double throughput[3], double u)
{
    double keep = fmin(1.0, fmax(0.05, fmax(throughput[0], fmax(throughput[1], throughput[2]))));
    for (int c = 0; c < 3; ++c) {
        throughput[c] /= keep;
    }
    return u < keep;
}

/* Radiance along one ray; whether it met the cloth. */
static bool trace(const tracer *t, tsuya_vec3 origin, tsuya_vec3 direction, tsuya_sampler sampler, double rgb[3], uint64_t *rays)
{
    double throughput[3] = {1, 1, 1};
    vertex last = {0};
    for (int depth = 0;; ++depth) {
        uint32_t pair = (uint32_t)(PAIR_FIRST + PAIRS_PER_BOUNCE * depth);
        tsuya_ray ray = make_ray(origin, direction, INFINITY);
        tsuya_ray_hit hit;
        ++*rays;
        report_ray(t, &ray, false);
        bool met = tsuya_scene_intersect(t->scene, &ray, &hit);
        add_lamps_hit(t, depth > 0 ? &last : NULL, origin, direction, met ? hit.distance : INFINITY, throughput, rgb);
        if (!met || depth == t->options->bounces) {
            return met || depth > 0;
        }
        double choice[2], turn[2], u[3];
        tsuya_sampler_pair(sampler, pair + PAIR_TURN, turn);
        if (depth > 0 && !survives(throughput, turn[1])) {
            return true;
        }
        tsuya_surface s;
        tsuya_scene_surface(t->scene, &hit, tsuya_vec3_scale(direction, -1.0), &s);
        if (!s.has_weft) {
            turn_frame(&s, turn[0]);
        }
        tsuya_vec3 wo = to_local(&s, tsuya_vec3_scale(direction, -1.0));
        tsuya_sampler_pair(sampler, pair + PAIR_CHOICE, choice);
        add_lamp(t, &s, wo, sampler, pair + PAIR_LAMP, choice[0], throughput, rgb, &last.lamp_weights, rays);
        tsuya_sampler_pair(sampler, pair + PAIR_DIRECTION, u);
        u[2] = choice[1];
        if (!scatter(t, &s, wo, u, throughput, &last, &origin, &direction)) {
            return true;
        }
    }
}

/* Running sums of a pixel, enough to go on with it later. */
typedef struct pixel_sum {
    double rgb[3], mean, spread; /* Welford's mean and sum of squares of the luminance */
    uint32_t samples, met;
} pixel_sum;

static void add_sample(pixel_sum *sum, const double rgb[3], bool met)
{
    double luminance = 0.2126 * rgb[0] + 0.7152 * rgb[1] + 0.0722 * rgb[2], d = luminance - sum->mean;
    sum->samples++;
    sum->mean += d / sum->samples;
    sum->spread += d * (luminance - sum->mean);
    sum->met += met;
    for (int c = 0; c < 3; ++c) {
        sum->rgb[c] += rgb[c];
    }
}

typedef struct picture {
    tracer tracer;
    const tsuya_camera *camera;
    tsuya_pose camera_from_world;
    uint64_t seed;
    pixel_sum *sum;
    uint32_t *target; /* samples that each pixel shall have */
} picture;

static uint64_t render_pixel(const picture *p, int x, int y)
{
    size_t k = (size_t)y * (size_t)p->camera->width_px + (size_t)x;
    pixel_sum *sum = &p->sum[k];
    tsuya_vec3 eye = tsuya_pose_center(p->camera_from_world);
    uint64_t rays = 0;
    while (sum->samples < p->target[k]) {
        tsuya_sampler sampler = tsuya_sampler_start(p->seed, k, sum->samples);
        double u[2], rgb[3] = {0, 0, 0};
        tsuya_vec3 ray;
        bool met = false;
        tsuya_sampler_pair(sampler, PAIR_PIXEL, u);
        if (tsuya_camera_unproject(p->camera, (tsuya_vec2){x - 0.5 + u[0], y - 0.5 + u[1]}, &ray)) {
            met = trace(&p->tracer, eye, tsuya_mat3_apply_transposed(p->camera_from_world.rotation, ray), sampler, rgb, &rays);
        }
        add_sample(sum, rgb, met);
    }
    return rays;
}

/* Brings every pixel to its target. */
static tsuya_status render_tiles(const picture *p, const tsuya_context *context, double done_before, double done_after, uint64_t *rays)
{
    int columns = (p->camera->width_px + TILE_PX - 1) / TILE_PX, rows = (p->camera->height_px + TILE_PX - 1) / TILE_PX;
    int finished = 0;
    uint64_t total = 0;
#pragma omp parallel for schedule(dynamic, 1) num_threads(context->threads) reduction(+ : total)
    for (int tile = 0; tile < columns * rows; ++tile) {
        if (tsuya_interrupted()) {
            continue;
        }
        int x0 = tile % columns * TILE_PX, y0 = tile / columns * TILE_PX, now;
        for (int y = y0; y < y0 + TILE_PX && y < p->camera->height_px; ++y) {
            for (int x = x0; x < x0 + TILE_PX && x < p->camera->width_px; ++x) {
                total += render_pixel(p, x, y);
            }
        }
#pragma omp atomic capture
        now = ++finished;
        tsuya_progress_update(context, "render", done_before + (done_after - done_before) * now / (columns * rows), 1.0, NULL);
    }
    *rays += total;
    return tsuya_check_interrupt();
}

/* Samples that each pixel needs, from the variance in its eight neighbours. */
static void plan_samples(const picture *p, const tsuya_path_options *o)
{
    int width = p->camera->width_px, height = p->camera->height_px;
    double mean = 0.0;
    for (size_t k = 0; k < (size_t)width * (size_t)height; ++k) {
        mean += p->sum[k].mean;
    }
    double floor_luminance = 0.1 * mean / ((double)width * height);
    for (int y = 0; y < height; ++y) {
        for (int x = 0; x < width; ++x) {
            double variance = 0.0, level = 0.0;
            int count = 0;
            for (int k = 0; k < 9; ++k) {
                int i = x + k % 3 - 1, j = y + k / 3 - 1;
                if (k != 4 && i >= 0 && i < width && j >= 0 && j < height) {
                    const pixel_sum *s = &p->sum[(size_t)j * (size_t)width + (size_t)i];
                    variance += s->spread / (s->samples - 1);
                    level += s->mean;
                    ++count;
                }
            }
            double aim = count > 0 ? o->noise * (level / count + floor_luminance) : 0.0;
            double wanted = aim > 0.0 ? variance / count / (aim * aim) : 0.0;
            uint32_t *target = &p->target[(size_t)y * (size_t)width + (size_t)x];
            *target = (uint32_t)fmin(fmax(wanted, *target), o->spp);
        }
    }
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
        film->error[k] = n > 1.0 ? (float)sqrt(sum[k].spread / (n * (n - 1.0))) : 0.0f;
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
            relative[count++] = film->error[k] / (float)sum[k].mean;
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
    bool adaptive = o->noise > 0.0 && o->spp > PILOT_SPP;
    for (size_t k = 0; k < pixels; ++k) {
        p->target[k] = adaptive ? PILOT_SPP : (uint32_t)o->spp;
    }
    TSUYA_TRY(render_tiles(p, context, 0.0, adaptive ? 0.2 : 1.0, rays));
    if (adaptive) {
        plan_samples(p, o);
        TSUYA_TRY(render_tiles(p, context, 0.2, 1.0, rays));
    }
    return TSUYA_OK;
}

tsuya_status tsuya_path_render(tsuya_film *film, tsuya_path_info *info, const tsuya_scene *scene, const tsuya_light_set *lights,
                               const tsuya_camera *camera, tsuya_pose camera_from_world, const tsuya_path_options *options,
                               const tsuya_context *context)
{
    tsuya_status status = TSUYA_OK;
    double start = tsuya_clock_s();
    picture p = {.tracer = {scene, lights, options}, .camera = camera, .camera_from_world = camera_from_world, .seed = context->seed};
    *film = (tsuya_film){camera->width_px, camera->height_px, NULL, NULL, NULL, NULL};
    *info = (tsuya_path_info){0};
    TSUYA_TRY(check(camera, options));
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
